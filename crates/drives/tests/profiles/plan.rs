//! The planner against a search through every possible plan.

use drivebus_drives::{Access, Entry, Profile, ReadCost, ReadSpan, Table, plan_reads};
use proptest::prelude::*;

/// The least cost and, at that cost, the fewest reads that cover `wanted`, by trying every read that could cover the
/// lowest address still missing: overlapping reads, reads that begin or end in a hole, everything.
fn search(wanted: u16, allowed: u16, max_words: u16, cost: ReadCost) -> (u64, usize) {
    if wanted == 0 {
        return (0, 0);
    }
    let lowest = u16::try_from(wanted.trailing_zeros()).unwrap();
    let mut best = (u64::MAX, usize::MAX);
    for first in lowest.saturating_sub(max_words - 1)..=lowest {
        for count in (lowest - first + 1)..=max_words.min(16 - first) {
            let read = (u16::MAX >> (16 - count)) << first;
            if read & !allowed == 0 {
                let (rest, reads) = search(wanted & !read, allowed, max_words, cost);
                best = best.min((rest + u64::from(cost.request) + u64::from(cost.word) * u64::from(count), reads + 1));
            }
        }
    }
    best
}

fn addresses(bits: u16) -> Vec<u16> {
    (0..16).filter(|bit| bits & (1 << bit) != 0).collect()
}

/// Checks one plan: it covers what was asked for, keeps the rules, and costs what the best plan costs.
fn check(wanted: u16, readable: u16, max_words: u16, cost: ReadCost) {
    let plan = plan_reads(&addresses(wanted), max_words, cost, |address| readable & (1 << address) != 0);
    let mut covered = 0_u16;
    let mut total = 0;
    for ReadSpan { address, count, .. } in &plan {
        assert!((1..=max_words).contains(count));
        for word in *address..address + count {
            assert_eq!(covered & (1 << word), 0, "{word} is read twice");
            covered |= 1 << word;
        }
        total += u64::from(cost.request) + u64::from(cost.word) * u64::from(*count);
    }
    assert_eq!(wanted & !covered, 0, "something is missing");
    assert_eq!(covered & !(wanted | readable), 0, "something unreadable is read");
    assert_eq!((total, plan.len()), search(wanted, wanted | readable, max_words, cost), "{wanted:b} {readable:b}");
    assert!(plan.is_sorted());
}

#[test]
fn every_small_plan_is_the_best() {
    let costs = [ReadCost::new(5, 2), ReadCost::new(100, 1), ReadCost::new(0, 1)];
    for wanted in 0..1 << 6 {
        for readable in 0..1 << 6 {
            for max_words in 1..=4 {
                for cost in costs {
                    check(wanted, readable, max_words, cost);
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn every_plan_is_the_best(wanted in 0_u16..1 << 10, readable in 0_u16..1 << 10, max_words in 1_u16..=5, request in 0_u32..30, word in 0_u32..5) {
        check(wanted, readable, max_words, ReadCost::new(request, word));
    }

    #[test]
    fn order_and_repetition_do_not_matter(wanted in prop::collection::vec(any::<u16>(), 0..40)) {
        let cost = ReadCost::new(316, 22);
        let mut sorted = wanted.clone();
        sorted.sort_unstable();
        sorted.dedup();
        prop_assert_eq!(plan_reads(&wanted, 16, cost, |_| true), plan_reads(&sorted, 16, cost, |_| true));
    }
}

#[test]
fn the_ends_of_the_address_space_are_reached() {
    let cost = ReadCost::new(316, 22);
    let plan = plan_reads(&[0xFFFF, 0xFFF0, 0x0000], 16, cost, |_| true);
    assert_eq!(
        plan,
        [
            ReadSpan { table: Table::Holding, address: 0, count: 1 },
            ReadSpan { table: Table::Holding, address: 0xFFF0, count: 16 }
        ]
    );
}

#[test]
fn a_gd350_is_read_in_few_requests() {
    let profile = Profile::builtin("gd350").unwrap();
    let plan = |names: &[&str]| {
        let entries: Vec<_> = names.iter().map(|name| profile.find(name).unwrap()).collect();
        profile.plan(entries).unwrap().iter().map(|span| (span.address, span.count)).collect::<Vec<_>>()
    };
    // All 23 monitor registers take two reads of 16 words at most.
    let monitor = profile.plan(profile.monitor()).unwrap();
    assert_eq!((monitor.len(), monitor.iter().map(|span| span.count).sum::<u16>()), (2, 23));
    // Section 9.4.8: six fault types in one read.
    assert_eq!(plan(&["P07.27", "P07.28", "P07.29", "P07.30", "P07.31", "P07.32"]), [(0x071B, 6)]);
    assert_eq!(plan(&["output_current", "running_frequency"]), [(0x3000, 5)]);
    assert_eq!(plan(&["output_current", "output_current"]), [(0x3004, 1)]);
    // 2104H to 2FFFH are unknown, and so is P00.13.
    assert_eq!(plan(&["identification_code", "running_frequency"]), [(0x2103, 1), (0x3000, 1)]);
    assert_eq!(plan(&["P00.12", "P00.14"]), [(0x000C, 1), (0x000E, 1)]);
    assert_eq!(plan(&[]), []);
    // At 19200 8E1 with 5 ms delay: 20 characters of 11 bits and 96 bit times for a request, 22 for a word.
    assert_eq!(profile.serial().unwrap().read_cost(), ReadCost::new(316, 22));
}

#[test]
fn a_compiled_plan_finds_each_value_in_the_words_of_its_reads() {
    let profile = Profile::builtin("gd350").unwrap();
    // Out of order, twice, across a gap, and from both sides of it.
    let names = ["output_current", "P00.11", "running_frequency", "fault_code", "output_current", "hdi_frequency_2"];
    let entries: Vec<_> = names.iter().map(|name| profile.find(name).unwrap()).collect();
    let plan = profile.compile(&entries).unwrap();
    assert_eq!(plan.reads(), profile.plan(entries.iter().copied()).unwrap());
    // Each address holds itself.
    let words: Vec<u16> = plan.reads().iter().flat_map(|read| read.address..read.address + read.count).collect();
    assert_eq!(plan.words(), words.len());
    let counts: Vec<_> = plan.values(&words).map(|(_, value)| value.unwrap().count()).collect();
    assert_eq!(counts, [0x3004, 0x000B, 0x3000, 0x2102, 0x3004, 0x3011]);
    let cut: Vec<_> = plan.values(&words[..1]).map(|(_, value)| value.is_some()).collect();
    assert_eq!(cut, [false, true, false, false, false, false], "what did not come has no value");
}

#[test]
fn nothing_is_read_for_no_names() {
    let plan = Profile::builtin("gd350").unwrap().compile(&[]).unwrap();
    assert!(plan.reads().is_empty());
    assert_eq!((plan.words(), plan.values(&[1]).count()), (0, 0));
}

/// VFD500 manual, appendix A.3: a read stays inside one group of parameters; r16.00 takes two words.
#[test]
fn no_read_leaves_its_group_and_none_cuts_a_value_in_two() {
    let profile = Profile::builtin("vfd500").unwrap();
    let readable: Vec<&Entry> = profile.entries().filter(|entry| entry.access() != Access::Wo).collect();
    let spans = profile.plan(readable.iter().copied()).unwrap();
    for span in &spans {
        assert_eq!(span.address >> 8, (span.address + span.count - 1) >> 8, "{span:?}");
        assert!(span.count <= 16, "{span:?}");
    }
    for entry in &readable {
        let first = entry.address().unwrap();
        let whole = |span: &&ReadSpan| span.address <= first && first + entry.words() <= span.address + span.count;
        assert_eq!(spans.iter().filter(whole).count(), 1, "{}", entry.name());
    }
    // P00.07 and P00.08 stand side by side; r25.00 and r27.00 do not, whatever lies between.
    let pair = |one: &str, other: &str| {
        profile.plan([profile.find(one).unwrap(), profile.find(other).unwrap()]).unwrap().len()
    };
    assert_eq!((pair("P00.07", "P00.08"), pair("r25.00", "r27.00"), pair("r16.00", "r16.00")), (1, 2, 1));

    let meter = profile.compile(&[profile.find("r16.00").unwrap()]).unwrap();
    let values: Vec<String> = meter.values(&[0x86A0, 0x0001]).map(|(_, value)| value.unwrap().to_string()).collect();
    assert_eq!(values, ["100000"], "the low word comes first (manual, p. 137)");
}

/// A table that names the VFD-E manual: one parameter a read. Its registers are read together, as the manual does (p. 170).
#[test]
fn a_parameter_is_read_alone_where_the_family_says_so() {
    let profile = Profile::builtin("vfd-e").unwrap();
    let spans = |names: &[&str]| {
        let entries: Vec<&Entry> = names.iter().map(|name| profile.find(name).unwrap()).collect();
        let spans = profile.plan(entries).unwrap();
        spans.iter().map(|span| (span.address, span.count)).collect::<Vec<_>>()
    };
    assert_eq!(spans(&["02.00", "02.01"]), [(0x0200, 1), (0x0201, 1)]);
    assert_eq!(spans(&["set_frequency_actual", "running_frequency"]), [(0x2102, 2)]);
    assert_eq!(spans(&["05.01", "running_frequency", "05.00"]), [(0x0500, 1), (0x0501, 1), (0x2103, 1)]);
}
