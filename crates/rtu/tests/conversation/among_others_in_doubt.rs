//! Reads on a line where another master's answers come here, too, of a unit that may still answer something else, and reads
//! that have to be asked as they are.

use drivebus_rtu::*;

use crate::among_others::{rig, theirs};
use crate::rig::*;

#[test]
fn what_is_verified_is_asked_as_it_is_and_parted_from_what_is_asked_closely_before() {
    let mut rig = rig();
    let told = rig.run(ask(9, 2).verify(true));
    assert_eq!(told.sent[..3], [read(9, 2), read(9, 1), read(9, 2)]);
    rig.run(ask(9, 2).in_doubt(true));
    assert_eq!(rig.run(ask(9, 2).verify(true)).sent[..2], [read(9, 1), read(9, 2)]);
    rig.now = rig.now + ms(200);
    assert_eq!(rig.run(ask(9, 2).verify(true)).sent[0], read(9, 2), "nothing that was asked before can come for it");
}

#[test]
fn what_is_verified_agrees_though_other_reads_part_what_is_asked() {
    let told = rig().run(ask(9, 2).verify(true));
    assert_eq!((told.end, told.sent), (End::Words(vec![9, 10]), vec![read(9, 2), read(9, 1), read(9, 2)]));
    assert_eq!(told.counts.verified, 1);
    // What another call asked in between may be open, and what was heard before counts no more.
    let mut rig = rig();
    rig.meanwhile = [None, Some(ask(9, 2).in_doubt(true))].into();
    let told = rig.run(ask(9, 2).verify(true));
    assert_eq!(told.end, End::Words(vec![9, 10]));
    assert_eq!(told.sent.iter().filter(|sent| **sent == read(9, 2)).count(), 3, "{:02X?}", told.sent);
}

#[test]
fn a_unit_in_doubt_is_echoed_before_anything_else_is_asked_of_it() {
    // Whether it was read before or not, closely behind or not, and whether the question may have another length.
    for (met, pause, verify) in
        [(false, 200, false), (false, 200, true), (true, 200, false), (true, 200, true), (true, 0, true)]
    {
        let mut rig = rig();
        if met {
            assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
            rig.now = rig.now + ms(200);
        }
        rig.is_silent_on(ask(9, 16).in_doubt(true));
        rig.now = rig.now + ms(pause);
        let told = rig.run(ask(9, 16).verify(verify));
        assert_eq!(told.sent[0], echo(), "{met} {pause} {verify}: {:02X?}", told.sent);
    }
}

/// A unit that gives no more than three words, as it has shown, and was read lately.
fn of_three() -> Rig {
    let mut rig = rig();
    rig.most = 3;
    assert_eq!(rig.run(ask(9, 3)).sent, [read(9, 3), read(9, 1)]);
    // Closely behind it one word more is asked for, and refused.
    let told = rig.run(ask(9, 3));
    assert_eq!((told.end, told.sent), (End::Words(vec![9, 10, 11]), vec![read(9, 3)]));
    let told = rig.run(ask(9, 3));
    assert_eq!(told.sent[0], read(9, 4));
    rig
}

#[test]
fn where_no_other_length_is_given_a_read_of_fewer_words_parts_two_that_follow_each_other() {
    let mut rig = of_three();
    let told = rig.run(ask(9, 3));
    assert_eq!((told.end, told.sent), (End::Words(vec![9, 10, 11]), vec![read(9, 1), read(9, 3)]));
}

#[test]
fn a_read_that_never_went_out_ends_no_doubt_about_the_unit() {
    let mut rig = of_three();
    rig.is_silent_on(ask(0x100, 1).in_doubt(true));
    // The line is never silent for as long as the caller wants.
    rig.known.stray(rig.now, &[0xFF]);
    for millis in 6..120 {
        rig.comes(ms(millis), vec![0xFF]);
    }
    let told = rig.run(ask(9, 3).gap(ms(50)).in_doubt(true));
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::Busy { timeout: TIMEOUT }), 0));
    assert_eq!(rig.run(ask(9, 3)).sent[0], echo());
}

#[test]
fn what_is_heard_at_first_contact_and_in_every_length_is_waited_for() {
    let mut rig = Rig::opened(Opened::new().may_echo(false).may_have_others(true), OwnEcho::Absent);
    rig.most = 1;
    // It may be the answer to what this program asked before it was started again.
    theirs(&mut rig, &words(&[0x77]));
    let asked = rig.now;
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent[0].clone()), (End::Words(vec![9]), echo()), "{:02X?}", told.sent);
    assert_eq!(told.stood_by, [Instant::ZERO + FIRST_CONTACT], "the unit was asked before that: {asked:?}");
    assert_eq!(told.sent.last(), Some(&read(9, 1)));
}
