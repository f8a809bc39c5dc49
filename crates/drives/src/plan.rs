//! The read planner: many words in the cheapest reads that a drive allows.
//!
//! Knows addresses and costs; knows nothing of what a word means.

/// One read: `count` words from `address`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ReadSpan {
    /// The first address.
    pub address: u16,
    /// How many words, at least 1.
    pub count: u16,
}

/// What a read costs, in any unit of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct ReadCost {
    /// What every request costs, however many words it asks for.
    pub request: u32,
    /// What each word costs on top.
    pub word: u32,
}

/// The cheapest reads that hold all of `wanted`, in address order; of equally cheap plans, one with the fewest reads.
///
/// A read has at most `max_words` words (at least 1 is assumed). It runs across addresses that were not asked for only
/// where `readable` says that a drive answers for each of them. Merging is not always a gain: a hole costs its words.
///
/// `wanted` may be in any order and repeat itself.
pub fn plan_reads(wanted: &[u16], max_words: u16, cost: ReadCost, readable: impl Fn(u16) -> bool) -> Vec<ReadSpan> {
    let mut wanted = wanted.to_vec();
    wanted.sort_unstable();
    wanted.dedup();

    // best[n] is the cheapest way to read the first n addresses: its cost, its number of reads, and where the last read
    // begins. The last read can only begin at one of the addresses before, as long as it is short enough.
    let mut best = vec![(0_u64, 0_usize, 0_usize)];
    for end in 1..=wanted.len() {
        let last = wanted[end - 1];
        let mut cheapest = None;
        for start in (0..end).rev() {
            let first = wanted[start];
            let words = u64::from(last - first) + 1;
            let hole = start + 1 < end && !(first + 1..wanted[start + 1]).all(&readable);
            if words > u64::from(max_words.max(1)) || hole {
                break;
            }
            let (before, reads, _) = best[start];
            let total = before + u64::from(cost.request) + u64::from(cost.word) * words;
            let candidate = (total, reads + 1, start);
            cheapest = Some(cheapest.map_or(candidate, |known| candidate.min(known)));
        }
        // One address alone always fits, so there is a cheapest one.
        best.extend(cheapest);
    }

    let mut spans = Vec::new();
    let mut end = wanted.len();
    while end > 0 {
        let (_, _, start) = best[end];
        spans.push(ReadSpan { address: wanted[start], count: wanted[end - 1] - wanted[start] + 1 });
        end = start;
    }
    spans.reverse();
    spans
}
