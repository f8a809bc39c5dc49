//! The read planner: many words in the cheapest reads that a drive allows.
//!
//! Knows addresses and costs; knows nothing of what a word means.

use crate::place::{Place, Table};

/// One read: `count` words, or bits, of `table` from `address`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ReadSpan {
    /// Where.
    pub table: Table,
    /// The first address.
    pub address: u16,
    /// How many words, at least 1.
    pub count: u16,
}

impl ReadSpan {
    /// Where it begins.
    pub const fn place(&self) -> Place {
        Place::new(self.table, self.address)
    }
}

/// What a read costs, in any unit of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub struct ReadCost {
    /// What every request costs, however many words it asks for.
    pub request: u32,
    /// What each word costs on top.
    pub word: u32,
}

impl ReadCost {
    /// So much for every request, and so much for each word.
    pub const fn new(request: u32, word: u32) -> Self {
        Self { request, word }
    }
}

/// What a drive allows in one read, and what reads cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ReadRules {
    /// Most words.
    pub(crate) max_words: u16,
    /// Whether a read may run from one parameter group (the high byte of the address) into the next.
    pub(crate) across_groups: bool,
    pub(crate) cost: ReadCost,
}

/// The cheapest reads that hold all of `wanted`, in address order; of equally cheap plans, one with the fewest reads.
///
/// A read has at most `max_words` words (at least 1 is assumed). It runs across addresses that were not asked for only
/// where `readable` says that a drive answers for each of them. Merging is not always a gain: a hole costs its words.
///
/// `wanted` may be in any order and repeat itself.
pub fn plan_reads(wanted: &[u16], max_words: u16, cost: ReadCost, readable: impl Fn(u16) -> bool) -> Vec<ReadSpan> {
    let wanted: Vec<_> = wanted.iter().map(|&address| ReadSpan { table: Table::Holding, address, count: 1 }).collect();
    plan_spans(&wanted, ReadRules { max_words, across_groups: true, cost }, |place| readable(place.address))
}

/// As [`plan_reads`], for values of one word or more, none of which is cut in two. Those wanted must not overlap.
pub(crate) fn plan_spans(wanted: &[ReadSpan], rules: ReadRules, readable: impl Fn(Place) -> bool) -> Vec<ReadSpan> {
    let mut wanted = wanted.to_vec();
    wanted.sort_unstable();
    wanted.dedup();
    let tables = wanted.chunk_by(|one, other| one.table == other.table);
    tables.flat_map(|wanted| plan_table(wanted, rules, &readable)).collect()
}

/// As [`plan_spans`], for values of one table in address order: no read runs from one into another.
fn plan_table(wanted: &[ReadSpan], rules: ReadRules, readable: impl Fn(Place) -> bool) -> Vec<ReadSpan> {
    let table = wanted.first().map_or(Table::Holding, |span| span.table);
    let last_of = |span: &ReadSpan| span.address + (span.count - 1);

    // Whether the drive answers for all that lies before a value, from the end of the one before.
    let joined = |pair: &[ReadSpan]| {
        (last_of(&pair[0]) + 1..pair[1].address).all(|address| readable(Place::new(table, address)))
    };
    let joins: Vec<bool> = std::iter::once(false).chain(wanted.windows(2).map(joined)).collect();

    // best[n] is the cheapest way to read the first n values: its cost, its number of reads, and where the last read
    // begins. The last read can only begin at one of the values before, as long as it is short enough.
    let most = u64::from(rules.max_words.max(1));
    let mut best = vec![(0_u64, 0_usize, 0_usize)];
    for end in 1..=wanted.len() {
        let last = last_of(&wanted[end - 1]);
        let mut cheapest = None;
        for start in (0..end).rev() {
            let first = wanted[start].address;
            let words = u64::from(last - first) + 1;
            let crosses = !rules.across_groups && first >> 8 != last >> 8;
            // One value alone is read, whatever the rules say: the drive is the one to refuse it.
            if start + 1 < end && (words > most || !joins[start + 1] || crosses) {
                break;
            }
            let (before, reads, _) = best[start];
            let total = before + (u64::from(rules.cost.request) + u64::from(rules.cost.word) * words);
            // Of two equal ones the last found is taken: its last read begins earlier.
            if cheapest.is_none_or(|(least, fewest, _)| (total, reads + 1) <= (least, fewest)) {
                cheapest = Some((total, reads + 1, start));
            }
        }
        // One value alone always fits, so there is a cheapest one.
        best.extend(cheapest);
    }

    let mut spans = Vec::new();
    let mut end = wanted.len();
    while end > 0 {
        let (_, _, start) = best[end];
        let address = wanted[start].address;
        spans.push(ReadSpan { table, address, count: last_of(&wanted[end - 1]) - address + 1 });
        end = start;
    }
    spans.reverse();
    spans
}
