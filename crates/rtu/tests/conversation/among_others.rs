//! Reads on a line where another master's answers come here, too.

use drivebus_rtu::*;

use crate::rig::Does::{And, AndBefore, Nothing, Refuses, Right};
use crate::rig::*;

fn others() -> Opened {
    Opened::new().may_echo(false).may_have_others(true)
}

/// Such a line, with nothing in doubt.
fn rig() -> Rig {
    let mut rig = Rig::opened(others(), OwnEcho::Absent);
    rig.now = at(5_000);
    rig
}

/// Another master has this answered now, and nobody here has asked.
fn theirs(rig: &mut Rig, frame: &[u8]) {
    rig.now = rig.now + ms(50);
    rig.known.stray(rig.now, frame);
    rig.now = rig.now + ms(50);
}

#[test]
fn the_first_answer_is_believed_behind_another_read() {
    let mut rig = rig();
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![read(9, 1), read(9, 2)]));
    rig.now = rig.now + ms(200);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.sent, [read(9, 1)], "once is enough where nobody was heard");
}

#[test]
fn an_answer_behind_which_another_like_it_came_is_nobodys() {
    let mut rig = rig();
    rig.next([Right, And(words(&[0x77]))]);
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.exchanges.iter().flatten().count(), 0);
    assert!(told.sent.len() > 2, "it is asked in another length: {:02X?}", told.sent);
}

#[test]
fn a_length_that_another_master_asks_for_is_not_asked_for() {
    let mut rig = rig();
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    theirs(&mut rig, &words(&[0x77]));
    for _ in 0..20 {
        let told = rig.run(ask(9, 1));
        assert_eq!(told.end, End::Words(vec![9]));
        assert!(told.sent.iter().all(|frame| frame[5] != 1), "{:02X?}", told.sent);
        rig.now = rig.now + ms(150);
    }
}

#[test]
fn where_every_length_that_the_unit_gives_is_asked_for_nothing_is_sent() {
    let mut rig = rig();
    rig.most = 1;
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    theirs(&mut rig, &words(&[0x77]));
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Failed(Unanswered::OthersAsk), "{told:?}");
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::OthersAsk), 0));
}

#[test]
fn a_refused_read_of_another_length_is_remembered() {
    let mut rig = rig();
    rig.most = 1;
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent), (End::Words(vec![9]), vec![read(9, 1), read(9, 2)]));
    rig.now = rig.now + ms(500);
    assert_eq!(rig.run(ask(9, 1)).sent, [read(9, 1)]);
}

#[test]
fn two_reads_that_follow_each_other_closely_never_have_one_length() {
    let mut rig = rig();
    let mut before = 0;
    for _ in 0..20 {
        let told = rig.run(ask(9, 1));
        assert_eq!(told.end, End::Words(vec![9]));
        for frame in &told.sent {
            assert_ne!(frame[5], before);
            before = frame[5];
        }
    }
}

#[test]
fn a_write_that_another_master_sends_too_is_told_as_not_known() {
    let many = Request::write_many(9, &[1, 2]).unwrap();
    let question = Question::new(UNIT.into(), many, TIMEOUT);
    let mut rig = rig();
    assert_eq!(rig.run(question).end, End::Confirmed);
    theirs(&mut rig, &sealed(&[1, 16, 0, 9, 0, 2]));
    let told = rig.run(question);
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::OthersAsk), 1));
    assert!(told.last_sent.is_some(), "it may have been done");
    // Where the words can be read, what they are tells it.
    let told = rig.run(question.read_back(Some(9)));
    assert_eq!(told.end, End::Done);
}

#[test]
fn a_refusal_of_the_question_as_it_is_is_told() {
    let told = rig().always(3, Refuses(2)).run(ask(9, 1));
    assert_eq!(told.end, End::Failed(Unanswered::Refused { function: 3, code: ExceptionCode(2) }));
    assert_eq!(told.sent.len(), 1);
}

#[test]
fn others_that_fall_silent_are_forgotten_with_time() {
    let mut rig = rig();
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    theirs(&mut rig, &words(&[0x77]));
    rig.now = rig.now + 2 * OTHERS;
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert_eq!(told.sent[0], read(9, 1));
}

#[test]
fn a_line_of_ones_own_has_no_others() {
    let rig = Rig::settled();
    assert!(!rig.known.may_have_others());
    assert!(self::rig().known.may_have_others());
}

#[test]
fn what_proves_an_answer_counts_as_a_request_of_the_call() {
    for retries in 0..3 {
        let mut rig = rig();
        rig.then = AndBefore;
        let told = rig.run(ask(9, 1).retries(retries));
        assert!(told.sent.len() <= 8 * (retries as usize + 1), "{} for {retries}: {:?}", told.sent.len(), told.end);
    }
}

#[test]
fn a_length_that_was_proven_beside_others_is_asked_for_without_another_proof() {
    let mut rig = rig();
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    theirs(&mut rig, &words(&[0x77]));
    let told = rig.run(ask(9, 1));
    assert_eq!(
        (told.end, told.sent.len(), told.counts.resyncs),
        (End::Words(vec![9]), 2, 1),
        "the question and its proof"
    );
    let length = told.sent[0][5];
    rig.now = rig.now + ms(200);
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent.len()), (End::Words(vec![9]), 1));
    assert_eq!(told.sent[0][5], length);
}

#[test]
fn where_the_proof_meets_silence_nothing_is_believed() {
    let mut rig = rig().does([Right, Nothing]);
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent.len()), (silence(1), 2));
}
