//! More open requests than are kept: of what had to be forgotten anything may still come, for as long as it could have.

use crate::asker::*;
use drivebus_rtu::*;

/// Kinds of open requests that are kept.
const KEPT: u8 = 32;
const WRITE: Request<'_> = Request::write(0x2000, 1);
const ECHO: Request<'_> = Request::echo(0xBEEF);

/// Leaves one read open of each of `count` units from `first` on.
fn fill(asker: &mut Asker, now: u64, first: u8, count: u8) {
    for raw in first..first + count {
        asker.leaves_open(now, unit(raw), &read(1));
    }
}

/// Unit 1 has left one word open at 1 s, and there is no place left for that.
fn forgotten(mut asker: Asker) -> Asker {
    asker.leaves_open(1_000, unit(1), &read(1));
    fill(&mut asker, 1_001, 101, KEPT - 1);
    assert!(asker.tells_apart(ms(1_001), &read(2)), "there was a place for it");
    asker.leaves_open(1_001, unit(200), &read(1));
    asker
}

#[test]
fn of_a_unit_whose_open_request_was_forgotten_only_an_echo_is_sure() {
    let asker = forgotten(Asker::new());
    let over = ms(1_000) + OVERTAKING;
    for request in [read(1), read(125), WRITE] {
        assert_eq!(asker.attribution(before(over), &request), Attribution::Wait(over), "{request:?}");
        assert_eq!(asker.attribution(over, &request), Attribution::Certain, "{request:?}");
        assert!(!asker.tells_apart(before(over), &request), "{request:?}");
    }
    assert_eq!(asker.attribution(ms(1_001), &ECHO), Attribution::Certain);
    assert!(asker.tells_apart(ms(1_001), &ECHO) && asker.tells_apart(over, &read(1)));
    assert!(asker.in_quarantine(before(over)) && !asker.in_quarantine(over));
    // The others are remembered.
    let others = |raw| asker.master.attribution(ms(1_001), unit(raw), &read(1));
    assert_eq!([101, 131, 200].map(others), [Attribution::Repeat { words: 2, refusal: 2 }; 3]);
    assert_eq!(others(201), Attribution::Certain);
    assert!(asker.master.tells_apart(ms(1_001), unit(101), &read(2)));
}

#[test]
fn what_is_forgotten_may_come_as_long_as_the_latest_of_it() {
    let mut asker = Asker::new();
    asker.leaves_open_for(1_000, unit(1), &read(1), Duration::from_secs(2));
    asker.leaves_open(1_001, unit(2), &read(1));
    fill(&mut asker, 1_002, 101, KEPT);
    for raw in [1, 2] {
        let waits = asker.master.attribution(ms(1_002), unit(raw), &read(1));
        assert_eq!(waits, Attribution::Wait(ms(9_000)), "unit {raw}");
    }
}

/// By when an answer was taken last that it may have been.
#[test]
fn the_oldest_is_forgotten_first() {
    let mut asker = Asker::new();
    asker.leaves_open(1_000, unit(1), &read(1));
    asker.echoes(1_000, unit(1));
    fill(&mut asker, 1_500, 101, KEPT - 1);
    asker.reads(2_000, unit(1), 1);
    asker.leaves_open(2_000, unit(200), &read(1));
    let repeat = Attribution::Repeat { words: 2, refusal: 2 };
    assert_eq!(asker.attribution(ms(2_000), &read(1)), repeat, "its answer may have been taken just now");
    assert_eq!(asker.master.attribution(ms(2_000), unit(101), &read(1)), Attribution::Wait(ms(4_500)));
}

#[test]
fn no_refusal_is_sure_while_something_forgotten_may_come() {
    for (now, expected) in [(3_999, Came::Nothing), (4_000, Came::Refusal)] {
        let mut asker = forgotten(Asker::new());
        assert_eq!(asker.asks(now, unit(1), &WRITE, &refuses(unit(1), &WRITE)), expected, "at {now} ms");
    }
    // Nor does that of an echo settle what was asked before.
    let mut asker = forgotten(Asker::new());
    assert_eq!(asker.asks(3_999, unit(1), &ECHO, &refuses(unit(1), &ECHO)), Came::Refusal);
    assert!(asker.in_quarantine(ms(3_999)));
    assert!(!asker.in_quarantine(ms(4_001)), "unit 101 made room for that echo");
}

#[test]
fn what_is_seen_settles_nothing_while_something_forgotten_may_come() {
    let mut asker = forgotten(Asker::of_a_unit_that_echoes());
    asker.leaves_open(1_500, unit(1), &read(2));
    asker.hears(1_500, &words(unit(1), 2, 7));
    assert!(asker.in_quarantine(ms(1_500)));
}

/// In order it is settled, but it may overtake; and when it cannot any more, it is as if it had never been.
#[test]
fn an_echo_ends_the_quarantine_but_not_what_may_overtake() {
    let mut asker = forgotten(Asker::new());
    asker.echoes(3_999, unit(1));
    assert!(!asker.in_quarantine(ms(3_999)));
    assert_eq!(asker.attribution(ms(3_999), &read(1)), Attribution::Wait(ms(4_000)));
    asker.echoes(4_000, unit(1));
    // The time is common to all; who has nothing open any more does not have it with them.
    fill(&mut asker, 4_500, 10, KEPT);
    asker.leaves_open(4_500, unit(60), &read(1));
    assert_eq!(asker.master.attribution(ms(4_500), unit(10), &read(1)), Attribution::Wait(ms(7_500)));
    assert_eq!(asker.attribution(ms(4_500), &read(1)), Attribution::Certain);
}

/// The places of what is settled and past are free; the others are not.
#[test]
fn only_what_is_settled_and_past_makes_room() {
    let filled = || {
        let mut asker = Asker::new();
        fill(&mut asker, 1_000, 101, KEPT);
        (101..101 + KEPT).for_each(|raw| asker.echoes(1_000, unit(raw)));
        asker
    };
    let certain = |asker: &Asker, now: u64, raw| {
        asker.master.attribution(ms(now), unit(raw), &read(2)) == Attribution::Repeat { words: 1, refusal: 2 }
    };
    let mut early = filled();
    early.leaves_open(3_999, unit(1), &read(1));
    assert_eq!(early.master.attribution(ms(3_999), unit(101), &read(2)), Attribution::Wait(ms(4_000)));
    assert!(certain(&early, 3_999, 102));
    let mut asker = filled();
    fill(&mut asker, 4_000, 1, KEPT);
    assert!((1..=KEPT).all(|raw| certain(&asker, 4_000, raw)), "there was room for all");
    asker.leaves_open(4_000, unit(200), &read(1));
    assert_eq!(asker.master.attribution(ms(4_000), unit(1), &read(2)), Attribution::Wait(ms(7_000)));
    let first = asker.master.attribution(ms(4_000), unit(101), &read(2));
    assert_eq!(first, Attribution::Certain, "nothing of it was forgotten");
}

/// A unit that returned an echo answers in order, however late. What it was asked may come as long as no echo comes back.
#[test]
fn what_was_forgotten_of_a_unit_in_quarantine_is_never_past() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(5));
    asker.leaves_open(2_000, unit(1), &read(1));
    fill(&mut asker, 9_000, 101, KEPT - 2);
    assert!(!asker.tells_apart(ms(9_000), &read(5)), "five words are open");
    asker.leaves_open(9_000, unit(200), &read(1));
    assert!(asker.in_quarantine(ms(9_000)));
    assert!(!asker.tells_apart(ms(9_000), &read(5)), "nobody knows any more what is open");
    assert_eq!(asker.asks(9_000, unit(1), &WRITE, &refuses(unit(1), &WRITE)), Came::Nothing, "nor what was refused");
    asker.master.abort(ms(9_000));
    let mut refusing = asker.clone();
    asker.echoes(9_500, unit(1));
    assert!(!asker.in_quarantine(ms(9_500)) && asker.tells_apart(ms(9_500), &read(5)));
    // Nor is it for ever where the unit returns none any more.
    for _ in 0..5 {
        assert!(refusing.in_quarantine(ms(9_000) + PATIENCE));
        assert_eq!(refusing.asks(9_000, unit(1), &ECHO, &refuses(unit(1), &ECHO)), Came::Refusal);
    }
    assert!(!refusing.in_quarantine(ms(9_000) + PATIENCE));
}
