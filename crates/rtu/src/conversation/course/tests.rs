//! How long a call may go on, how often, and what one attempt leaves to the next: on paper, without a line.

use super::*;
use crate::conversation::outcome::Cut;
use crate::{AnswerError, ExceptionCode, FrameError};

const TIMEOUT: Duration = Duration::from_millis(100);

const SILENCE: Unanswered = Unanswered::NoAnswer { timeout: TIMEOUT, attempts: 1 };
const DAMAGE: Unanswered = Unanswered::Corrupt(FrameError::Crc { computed: 1, received: 2 });
const ANOTHER_UNITS: Unanswered = Unanswered::Wrong(AnswerError::Unit { asked: 1, came: 2 });
const REFUSAL: Unanswered = Unanswered::Refused { function: 3, code: ExceptionCode::ILLEGAL_ADDRESS };

/// After these a read is asked again: the same may well succeed the next time.
const PASSING: [Unanswered; 8] = [
    Unanswered::CutShort(Cut::Lost),
    Unanswered::Busy { timeout: TIMEOUT },
    Unanswered::Doubtful,
    Unanswered::Disagreeing { asked: 4 },
    SILENCE,
    Unanswered::Unreached,
    DAMAGE,
    ANOTHER_UNITS,
];

/// The request went out, and no right answer came.
const UNANSWERED: [Unanswered; 4] = [SILENCE, Unanswered::Unreached, DAMAGE, ANOTHER_UNITS];

/// After these asking again would help nobody.
const FINAL: [Unanswered; 6] = [
    Unanswered::CutShort(Cut::Unusable),
    Unanswered::CutShort(Cut::GivenUp),
    REFUSAL,
    Unanswered::Reopened,
    Unanswered::NotAsked { left: TIMEOUT },
    Unanswered::NotTaken { times: 1 },
];

fn at(millis: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(millis)
}

fn failed(why: Unanswered, ended: Instant) -> Slip {
    Slip { why, sent: None, ended }
}

/// Asks, and meets with `failure` before any time has passed: whether there is another attempt.
fn asks_and_fails(course: &mut Course, failure: Unanswered) -> bool {
    let asked = course.asked();
    course.asks(at(0));
    course.goes_on(&failed(failure, at(0)), asked, false)
}

/// An attempt that ends before the question: whether there is another one.
fn fails_before_asking(course: &mut Course, failure: Unanswered) -> bool {
    let asked = course.asked();
    course.goes_on(&failed(failure, at(0)), asked, false)
}

/// How often may be asked when all ends in `failure`.
fn questions(course: &mut Course, failure: Unanswered) -> u32 {
    let more = (0..100).take_while(|_| asks_and_fails(course, failure)).count();
    assert!(more < 100, "without end");
    course.asked()
}

#[test]
fn silence_costs_a_retry_and_damage_half_of_one() {
    for retries in 0..5 {
        let questions = |failure| questions(&mut Course::new(TIMEOUT, retries), failure);
        assert_eq!(questions(SILENCE), retries + 1, "{retries} retries");
        assert_eq!(questions(Unanswered::Unreached), retries + 1, "{retries} retries");
        assert_eq!(questions(DAMAGE), 2 * retries + 1, "{retries} retries");
        assert_eq!(questions(ANOTHER_UNITS), 2 * retries + 1, "{retries} retries");
    }
    // Two damaged ones and one silence are two retries.
    let mut mixed = Course::new(TIMEOUT, 2);
    let asked = [DAMAGE, SILENCE, DAMAGE, SILENCE].map(|failure| asks_and_fails(&mut mixed, failure));
    assert_eq!(asked, [true, true, true, false]);
}

#[test]
fn only_what_may_succeed_the_next_time_is_asked_again() {
    for failure in PASSING {
        assert!(asks_and_fails(&mut Course::new(TIMEOUT, 1), failure), "{failure:?}");
    }
    for failure in FINAL {
        assert!(!asks_and_fails(&mut Course::new(TIMEOUT, 1), failure), "{failure:?}");
    }
}

/// They cost no retry, and four more attempts than questions are granted.
#[test]
fn attempts_that_end_with_a_probe_are_bounded_apart() {
    for (asked, retries) in [(0, 0), (0, 2), (1, 1), (2, 3)] {
        let mut course = Course::new(TIMEOUT, retries);
        for _ in 0..asked {
            assert!(asks_and_fails(&mut course, SILENCE));
        }
        let went_on = [(); 6].map(|()| fails_before_asking(&mut course, Unanswered::Doubtful));
        assert_eq!(went_on, [true, true, true, true, false, false], "asked {asked} times");
    }
    // None of them was a question: all retries are left.
    let mut course = Course::new(TIMEOUT, 2);
    assert!([SILENCE, DAMAGE, SILENCE].into_iter().all(|failure| fails_before_asking(&mut course, failure)));
    assert_eq!(questions(&mut course, SILENCE), 3);
}

#[test]
fn eight_requests_are_allowed_for_each_question_the_last_look_at_the_adapter_included() {
    for retries in 0..3 {
        let mut course = Course::new(TIMEOUT, retries);
        let allowed = 8 * (retries + 1) - 1;
        for sent in 0..allowed {
            assert!(course.sends(), "{sent} of {allowed}");
        }
        assert!(!course.sends() && !course.sends());
        assert!(!fails_before_asking(&mut course, Unanswered::Doubtful), "nothing is left to ask with");
    }
}

#[test]
fn there_is_another_attempt_as_long_as_one_request_is_left() {
    let mut course = Course::new(TIMEOUT, 0);
    assert!((0..6).all(|_| course.sends()));
    assert!(fails_before_asking(&mut course, Unanswered::Doubtful));
    assert!(course.sends());
    assert!(!fails_before_asking(&mut course, Unanswered::Doubtful));
}

/// A write and the reads that look for its words are one call.
#[test]
fn what_goes_on_with_something_else_has_only_the_requests_that_are_left() {
    let mut course = Course::new(TIMEOUT, 0);
    assert!((0..3).all(|_| course.sends()));
    assert!(!asks_and_fails(&mut course, SILENCE));
    course.go_on_with(TIMEOUT, 2);
    assert_eq!(course.asked(), 0);
    assert!(course.is_in_time(at(1_000)), "its time begins anew");
    assert!((0..4).all(|_| course.sends()));
    assert!(!course.sends());
    let mut course = Course::new(TIMEOUT, 0);
    course.go_on_with(TIMEOUT, 2);
    assert_eq!(questions(&mut course, SILENCE), 3);
}

/// What is watched takes its own time: that of all time-outs, in one call; and what others use of the line meanwhile, none of it.
#[test]
fn the_time_to_watch_is_none_of_that_to_ask() {
    let mut course = Course::new(TIMEOUT, 1);
    course.asks(at(0));
    assert!(course.sends() && course.may_watch());
    assert_eq!(course.watches(at(50), at(180)), at(180));
    course.has_watched(at(350));
    assert!(course.is_in_time(at(200 + 299)) && !course.is_in_time(at(200 + 300)));
    assert!(course.may_watch());
    assert_eq!(course.watches(at(400), at(900)), at(470), "no longer than there is time for");
    course.has_watched(at(470));
    assert!(!course.may_watch());
    course.has_watched(at(480));
    assert!(course.is_in_time(at(569)) && !course.is_in_time(at(570)));
    assert_eq!((0..99).take_while(|_| course.sends()).count(), 16, "nor of the requests, of which there were 15");
}

/// The time-outs of all questions once before the first of them, and once from it on.
#[test]
fn the_time_is_that_of_all_time_outs_twice() {
    let nearly = |millis: u64| Instant::from_nanos(at(millis).as_nanos() - 1);
    for (retries, allowed) in [(0, 100), (2, 300)] {
        let mut course = Course::new(TIMEOUT, retries);
        assert!(course.is_in_time(at(50)), "it begins with the first look");
        assert!(course.is_in_time(nearly(50 + allowed)));
        assert!(!course.is_in_time(at(50 + allowed)));
        course.asks(at(70));
        assert!(course.is_in_time(nearly(70 + allowed)));
        assert!(!course.is_in_time(at(70 + allowed)));
        course.asks(at(90));
        assert!(!course.is_in_time(at(70 + allowed)), "and with the first question, not with each");
        assert_eq!(course.asked(), 2);
    }
}

#[test]
fn no_attempt_begins_when_the_time_is_over() {
    for (ended, goes_on) in [(at(199), true), (at(200), false)] {
        let mut course = Course::new(TIMEOUT, 1);
        course.asks(at(0));
        assert_eq!(course.goes_on(&failed(SILENCE, ended), 0, false), goes_on, "{ended:?}");
    }
}

/// Who has to ask three times to be sure of one answer may fail four times more, and may take two time-outs more.
#[test]
fn what_has_to_be_repeated_is_granted_once() {
    let mut course = Course::new(TIMEOUT, 0);
    course.takes_more(2, TIMEOUT);
    assert_eq!(questions(&mut course, SILENCE), 5);

    let mut course = Course::new(TIMEOUT, 0);
    for more in [2, 2, 1] {
        course.takes_more(more, TIMEOUT);
    }
    assert_eq!(questions(&mut course, SILENCE), 5, "the same is granted once");

    let mut course = Course::new(TIMEOUT, 0);
    course.takes_more(2, TIMEOUT);
    course.takes_more(3, TIMEOUT);
    assert_eq!(questions(&mut course, SILENCE), 7);

    // Before the first look, and after it.
    let mut course = Course::new(TIMEOUT, 0);
    course.takes_more(1, TIMEOUT);
    assert!(course.is_in_time(at(0)));
    assert!(course.is_in_time(at(199)) && !course.is_in_time(at(200)));
    course.takes_more(3, TIMEOUT);
    assert!(course.is_in_time(at(399)) && !course.is_in_time(at(400)));
    course.asks(at(50));
    assert!(course.is_in_time(at(449)) && !course.is_in_time(at(450)));
}

#[test]
fn that_a_write_was_not_proven_is_said_once() {
    let mut course = Course::new(TIMEOUT, 0);
    assert!(!course.take_unproven());
    course.is_unproven();
    assert!(course.take_unproven());
    assert!(!course.take_unproven());
}

/// What a unit was asked, and over which connection.
const ASKED: Asked = (7, 2);

/// A read was put in this form, and ended so.
fn after(form: Form, failure: Option<Unanswered>) -> Course {
    let mut course = Course::new(TIMEOUT, 1);
    course.leaves_open(form, failure, Some(ASKED));
    course
}

/// A read that was left open, and nothing else: the answer is to the same question, whenever it comes.
#[test]
fn only_a_read_that_brought_no_answer_may_be_asked_again_as_it_was() {
    for form in [Form::Plain, Form::Apart(3), Form::Repeated] {
        for failure in UNANSWERED {
            let mut course = after(form, Some(failure));
            assert_eq!(course.owes_only_this(ASKED), Some(form));
            assert_eq!(course.owes_only_this(ASKED), None, "it is said once");
        }
    }
    for failure in PASSING.into_iter().filter(|failure| !UNANSWERED.contains(failure)).chain(FINAL) {
        assert_eq!(after(Form::Plain, Some(failure)).owes_only_this(ASKED), None, "{failure:?}");
    }
    assert_eq!(after(Form::Plain, None).owes_only_this(ASKED), None, "it was answered");
    // What acts may have acted, and nobody answers a broadcast.
    let mut course = Course::new(TIMEOUT, 1);
    course.leaves_open(Form::Plain, Some(SILENCE), None);
    assert_eq!(course.owes_only_this(ASKED), None);
}

#[test]
fn who_asked_something_else_in_between_may_have_left_that_open() {
    for other in [(ASKED.0 + 1, ASKED.1), (ASKED.0, ASKED.1 + 1)] {
        assert_eq!(after(Form::Plain, Some(SILENCE)).owes_only_this(other), None, "{other:?}");
    }
}

#[test]
fn a_question_that_is_repeated_goes_on_only_where_nothing_else_is_owed() {
    let mut course = Course::new(TIMEOUT, 0);
    course.repeats(false, ASKED);
    assert_eq!(course.owes_only_this(ASKED), None);
    course.repeats(true, ASKED);
    assert_eq!(course.owes_only_this(ASKED), Some(Form::Repeated));
    let mut course = after(Form::Apart(2), Some(SILENCE));
    course.asks_otherwise();
    assert_eq!(course.owes_only_this(ASKED), None, "it is put in another way");
}

#[test]
fn a_time_out_without_an_end_is_never_longer_than_that() {
    for timeout in [Duration::from_nanos(u64::MAX), Duration::from_secs(u64::MAX), Duration::MAX] {
        let mut course = Course::new(timeout, u32::MAX);
        course.asks(at(1));
        course.takes_more(u32::MAX, timeout);
        assert!(course.is_in_time(at(1_000)), "{timeout:?}");
    }
}
