//! Each line searched as far as it goes in seconds. `make model` goes further, and breaks the rules one by one.

use drivebus_model::before::NOTHING;
use drivebus_model::{Budget, Order, SCENARIOS, Scenario, Search};

fn line(name: &str) -> &'static Scenario {
    SCENARIOS.iter().find(|scenario| scenario.name == name).unwrap_or(&SCENARIOS[0])
}

macro_rules! lines {
    ($($test:ident: $name:literal,)*) => {
        const SEARCHED: &[&str] = &[$($name),*];

        $(
            #[test]
            fn $test() {
                let scenario = line($name);
                let found = Search::new(scenario, scenario.small).run(Order::Shortest, 1);
                if let Some((_, trace)) = found.refuted {
                    panic!("{trace}");
                }
                assert_eq!(found.unseen, [], "in {} states", found.states);
            }
        )*
    };
}

lines! {
    in_order: "in-order",
    in_order_commands: "in-order-commands",
    first_contact: "first-contact",
    refuses_echoes: "refuses-08H",
    silent_on_echoes: "silent-on-08H",
    overtaking: "overtaking",
    overtaking_one_word_at_a_time: "overtaking-one",
    overtaking_in_two_parts: "overtaking-sixteen",
    overtaking_commands: "overtaking-commands",
    overtaking_without_echo: "overtaking-no-echo",
    overtaking_with_other_lengths: "other-lengths",
    values_read_back: "read-back",
    reads_of_a_stop: "stop-reads",
    two_units: "two-units",
    adapter_that_echoes: "adapter-echoes",
    adapter_that_nobody_knows: "adapter-unknown",
    unit_replaced: "replaced",
    damaged_once: "damaged-once",
    damaged_again: "damaged-again",
    damaged_again_one_word_at_a_time: "damaged-again-one",
}

#[test]
fn every_line_is_searched() {
    let names: Vec<_> = SCENARIOS.iter().map(|scenario| scenario.name).collect();
    assert_eq!(names, SEARCHED);
}

/// A search that finds nothing wrong where something is, finds nothing.
#[test]
fn a_program_that_heeds_nothing_is_found_out_by_the_shortest_run() {
    let scenario = Scenario { heeds: false, ..line("in-order").clone() };
    let found = Search::new(&scenario, Budget { retries: 0, ..Budget::requests(2) }).run(Order::Shortest, 1);
    let (property, trace) = found.refuted.unwrap();
    assert_eq!(property, "no answer is attributed to a request it was not sent for");
    let expected = "\
not so: no answer is attributed to a request it was not sent for
on the line \"in-order\": a unit that echoes and answers in order, damage, aborts, restarts
    0.00 s  a program is to read 1 word of unit 1
    0.00 s  request 1: read 1 word of unit 1
    0.50 s    request 1 times out: left open; the call is given up
    0.50 s  a program is to read 1 word of unit 1
    0.50 s  request 2: read 1 word of unit 1
    0.50 s    unit 1: the answer to request 1 (the words of 1 register) arrives, while request 2 is waited for: taken for the answer; the call is answered
            WRONG: it was not given to this request
";
    assert_eq!(trace, expected);
}

/// What is assumed of such a unit is assumed for a reason.
#[test]
fn an_answer_of_another_length_is_believed_where_it_is_the_first_and_overtakes() {
    let scenario = Scenario { before: NOTHING, ..line("other-lengths").clone() };
    let budget = Budget { lengths: 1, retries: 0, ..Budget::requests(3) };
    let (property, trace) = Search::new(&scenario, budget).run(Order::Shortest, 1).refuted.unwrap();
    assert_eq!(property, "no answer is attributed to a request it was not sent for");
    assert!(trace.contains("request 1: read 1 word of unit 1, which gives another number of words"), "{trace}");
    assert!(trace.contains("the answer to request 1 (the words of 2 registers) arrives, while request 3"), "{trace}");
}
