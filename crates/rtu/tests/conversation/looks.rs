//! Looks at the adapter, and what was tried before the question, where they come to nothing.

use drivebus_rtu::*;

use crate::rig::Does::{Damaged, Nothing, Refuses, Right, Says};
use crate::rig::*;

/// A line in use of whose adapter nothing is known.
fn unknown() -> Rig {
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Unknown);
    rig.now = at(5_000);
    rig
}

#[test]
fn silence_shows_that_the_adapter_does_not_echo_if_little_noise_came_beside() {
    // A quarter of the request at most.
    for (noise, found) in [(0, OwnEcho::Absent), (2, OwnEcho::Absent), (3, OwnEcho::Unknown), (4, OwnEcho::Unknown)] {
        let mut rig = unknown().does([Says(vec![0x55; noise])]);
        assert_eq!(rig.run(ask(9, 1)).end, silence(1));
        assert_eq!(rig.known.echo(), found, "{noise} bytes");
    }
}

#[test]
fn an_answer_beside_what_may_be_left_of_an_echo_shows_nothing() {
    let mut rig = unknown();
    // The end of the request that looks.
    let left = &read(0, 1)[5..];
    let refusal = sealed(&[UNIT.get(), 0x83, 2]);
    for (answer, came) in [(words(&[5]), &[][..]), (refusal.clone(), &refusal)] {
        rig.then = Says([left, &answer].concat());
        let told = rig.run(set(9, 1));
        assert_eq!((told.end, told.sent), (End::Failed(Unanswered::Doubtful), vec![read(0, 1); 7]));
        assert_eq!((told.last_sent, &told.raw[..], rig.known.echo()), (None, came, OwnEcho::Unknown));
        assert_eq!(told.counts.retries, 2, "an attempt ends with the third");
    }
}

#[test]
fn looks_that_only_come_damaged_are_told_when_the_call_may_send_no_more() {
    let mut rig = unknown().always(3, Damaged);
    let told = rig.run(set(9, 1));
    assert!(matches!(told.end, End::Failed(Unanswered::Corrupt(_))), "{:?}", told.end);
    assert_eq!(told.sent, vec![read(0, 1); 7], "one request is kept, and the write is not sent");
    assert_eq!((told.last_sent, told.raw.len()), (None, 7), "what came instead of the last");
}

#[test]
fn an_echo_that_came_damaged_is_not_one_that_the_unit_does_not_know() {
    let mut rig = Rig::settled();
    assert_eq!(rig.run(ask(7, 1)).end, End::Words(vec![7]), "it lives, and 7 can be read");
    rig.is_silent_on(ask(7, 1));
    rig.always.insert(8, Damaged);
    let told = rig.run(set(9, 1));
    assert!(told.sent.len() > 1 && told.sent.iter().all(|sent| *sent == echo()), "{:02X?}", told.sent);
}

#[test]
fn longer_reads_that_came_damaged_are_asked_for_again() {
    let mut rig = Rig::settled().always(8, Right);
    rig.is_silent_on(ask(0x100, 1).in_doubt(true));
    rig.next([Damaged, Damaged, Damaged]);
    let told = rig.run(ask(9, 1).retries(1));
    assert!(matches!(told.end, End::Failed(Unanswered::Corrupt(_))), "{:?}", told.end);
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![echo(), read(9, 3)]), "two words are owed now, too");
}

#[test]
fn answers_that_have_to_agree_and_do_not_are_told_when_the_call_may_send_no_more() {
    let mut rig = Rig::settled();
    rig.most = 1;
    for _ in 0..3 {
        rig.is_silent_on(ask(7, 1).in_doubt(true));
    }
    let differ = |count: u16| (1..=count).map(|word| Says(words(&[word])));
    let three = rig.known.clone();
    // An echo, the longer read that is refused, and what is left of seven and of nine for three answers more.
    rig.next([Right, Refuses(3)].into_iter().chain(differ(9).flat_map(|says| [Damaged, says])));
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::Disagreeing { asked: 14 }), 16));
    // Where the unit could not be made sure of any more, that is told.
    rig.known = three;
    rig.next([Right, Refuses(3)].into_iter().chain(differ(4)).chain([Nothing]).chain(vec![Damaged; 9]));
    // Another call asks when four answers have come, and the unit is silent.
    rig.meanwhile = vec![None; 9].into();
    rig.meanwhile.push_back(Some(ask(8, 1).in_doubt(true)));
    let told = rig.run(ask(9, 1));
    assert!(matches!(told.end, End::Failed(Unanswered::Corrupt(_))), "{told:?}");
    assert_eq!((told.sent.len(), told.sent.last()), (13, Some(&echo())), "{told:02X?}");
}

#[test]
fn for_answers_that_have_to_agree_twice_as_many_failures_are_granted_and_no_others() {
    let mut rig = Rig::settled();
    rig.most = 1;
    rig.is_silent_on(ask(7, 1));
    rig.next([Right, Refuses(3), Right, Damaged, Damaged, Damaged, Damaged, Damaged, Right, Right]);
    let told = rig.run(ask(9, 1));
    assert!(matches!(told.end, End::Failed(Unanswered::Corrupt(_))), "{told:?}");
    assert_eq!(told.sent.len(), 8, "four that came damaged are granted");
}
