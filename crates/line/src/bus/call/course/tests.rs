//! How long a call may go on, how often, and what one attempt leaves to the next: on paper, without a line.

use std::sync::Arc;

use drivebus_rtu::{AnswerError, ExceptionCode, FrameError, SerialFormat};

use super::*;
use crate::line::PortError;
use crate::nobody;
use crate::options::AdapterEcho;
use crate::owner::Owner;
use crate::owner::resync::FreshWords;

const TIMEOUT: Duration = Duration::from_millis(100);
const UNIT: UnitAddress = UnitAddress::MIN;

const SILENCE: Failure = Failure::NoAnswer { timeout: TIMEOUT, attempts: 1 };
const DAMAGE: Failure = Failure::Corrupt(FrameError::Crc { computed: 1, received: 2 });
const ANOTHER_UNITS: Failure = Failure::Wrong(AnswerError::Unit { asked: 1, came: 2 });
const REFUSAL: Failure = Failure::Refused { function: 3, code: ExceptionCode::ILLEGAL_ADDRESS };

fn port(kind: PortErrorKind) -> Failure {
    Failure::Port(PortError::new(kind, "port", "trouble"))
}

/// After these a read is asked again: the same may well succeed the next time.
fn passing() -> Vec<Failure> {
    let others = [Failure::Busy { timeout: TIMEOUT }, Failure::Doubtful, Failure::Disagreeing { asked: 4 }];
    [port(PortErrorKind::Lost)].into_iter().chain(others).chain(unanswered()).collect()
}

/// The request went out, and no right answer came.
fn unanswered() -> [Failure; 4] {
    [SILENCE, Failure::Unreached, DAMAGE, ANOTHER_UNITS]
}

/// After these asking again would help nobody.
fn final_ones() -> Vec<Failure> {
    let ports = [PortErrorKind::NotFound, PortErrorKind::Busy, PortErrorKind::Closed, PortErrorKind::Other];
    let others = [
        REFUSAL,
        Failure::Closed,
        Failure::Interrupted,
        Failure::Reopened,
        Failure::NotAsked { left: TIMEOUT },
        Failure::NotTaken { times: 1, shows: vec![7] },
    ];
    ports.into_iter().map(port).chain(others).collect()
}

fn at(millis: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(millis)
}

fn failed(failure: Failure, ended: impl Into<Option<Instant>>) -> CallError {
    let (request, ended) = (Vec::new(), ended.into());
    CallError { failure, destination: UNIT.into(), request, raw: Vec::new(), sent: None, ended }
}

/// Asks, and meets with `failure` before any time has passed: whether there is another attempt.
fn asks_and_fails(course: &mut Course, failure: Failure) -> bool {
    let asked = course.asked();
    course.asks(at(0));
    course.goes_on(&failed(failure, at(0)), asked, false)
}

/// An attempt that ends before the question: whether there is another one.
fn fails_before_asking(course: &mut Course, failure: Failure) -> bool {
    let asked = course.asked();
    course.goes_on(&failed(failure, at(0)), asked, false)
}

/// How often may be asked when all ends in `failure`.
fn questions(course: &mut Course, failure: &Failure) -> u32 {
    let more = (0..100).take_while(|_| asks_and_fails(course, failure.clone())).count();
    assert!(more < 100, "without end");
    course.asked()
}

#[test]
fn silence_costs_a_retry_and_damage_half_of_one() {
    for retries in 0..5 {
        let questions = |failure| questions(&mut Course::new(TIMEOUT, retries), &failure);
        assert_eq!(questions(SILENCE), retries + 1, "{retries} retries");
        assert_eq!(questions(Failure::Unreached), retries + 1, "{retries} retries");
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
    for failure in passing() {
        assert!(asks_and_fails(&mut Course::new(TIMEOUT, 1), failure.clone()), "{failure:?}");
    }
    for failure in final_ones() {
        assert!(!asks_and_fails(&mut Course::new(TIMEOUT, 1), failure.clone()), "{failure:?}");
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
        let went_on = [(); 6].map(|()| fails_before_asking(&mut course, Failure::Doubtful));
        assert_eq!(went_on, [true, true, true, true, false, false], "asked {asked} times");
    }
    // None of them was a question: all retries are left.
    let mut course = Course::new(TIMEOUT, 2);
    assert!([SILENCE, DAMAGE, SILENCE].into_iter().all(|failure| fails_before_asking(&mut course, failure)));
    assert_eq!(questions(&mut course, &SILENCE), 3);
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
        assert!(!fails_before_asking(&mut course, Failure::Doubtful), "nothing is left to ask with");
    }
}

#[test]
fn there_is_another_attempt_as_long_as_one_request_is_left() {
    let mut course = Course::new(TIMEOUT, 0);
    assert!((0..6).all(|_| course.sends()));
    assert!(fails_before_asking(&mut course, Failure::Doubtful));
    assert!(course.sends());
    assert!(!fails_before_asking(&mut course, Failure::Doubtful));
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
    assert_eq!(questions(&mut course, &SILENCE), 3);
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
    for (ended, goes_on) in [(Some(at(199)), true), (Some(at(200)), false), (None, false)] {
        let mut course = Course::new(TIMEOUT, 1);
        course.asks(at(0));
        assert_eq!(course.goes_on(&failed(SILENCE, ended), 0, false), goes_on, "{ended:?}");
    }
}

/// Who has to ask three times to be sure of one answer may fail twice more, and may take two time-outs more.
#[test]
fn what_has_to_be_repeated_is_granted_once() {
    let mut course = Course::new(TIMEOUT, 0);
    course.takes_more(2, TIMEOUT);
    assert_eq!(questions(&mut course, &SILENCE), 3);

    let mut course = Course::new(TIMEOUT, 0);
    for more in [2, 2, 1] {
        course.takes_more(more, TIMEOUT);
    }
    assert_eq!(questions(&mut course, &SILENCE), 3, "the same is granted once");

    let mut course = Course::new(TIMEOUT, 0);
    course.takes_more(2, TIMEOUT);
    course.takes_more(3, TIMEOUT);
    assert_eq!(questions(&mut course, &SILENCE), 4);

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

fn owner() -> Owner {
    let words = Arc::new(FreshWords::new());
    let mut owner = Owner::new(nobody::opener(), SerialFormat::DEFAULT, AdapterEcho::Absent, words, Arc::default());
    owner.open(&mut || false).unwrap();
    owner
}

/// `request` was put to `destination` in this form, and ended so.
fn after(
    owner: &Owner,
    destination: Destination,
    request: &Request<'_>,
    form: Form,
    result: Result<Done, Failure>,
) -> Course {
    let ask = Ask {
        destination,
        request,
        timeout: TIMEOUT,
        learns: false,
        gap: Duration::ZERO,
        in_doubt: false,
        yields: None,
        meanings: None,
    };
    let mut course = Course::new(TIMEOUT, 1);
    let result = result.map_err(|failure| Box::new(failed(failure, at(0))));
    course.leaves_open(&ask, form, &result, |unit| owner.asked(unit));
    course
}

fn lost_read(owner: &Owner, form: Form) -> Course {
    after(owner, UNIT.into(), &Request::read(100, 1).unwrap(), form, Err(SILENCE))
}

/// A read that was left open, and nothing else: the answer is to the same question, whenever it comes.
#[test]
fn only_a_read_that_brought_no_answer_may_be_asked_again_as_it_was() {
    let owner = owner();
    let read = Request::read(100, 1).unwrap();
    for form in [Form::Plain, Form::Apart(3), Form::Repeated] {
        for failure in unanswered() {
            let mut course = after(&owner, UNIT.into(), &read, form, Err(failure));
            assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), Some(form));
            assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), None, "it is said once");
        }
    }
    let answered = passing().into_iter().filter(|failure| !unanswered().contains(failure));
    for failure in answered.chain(final_ones()) {
        let mut course = after(&owner, UNIT.into(), &read, Form::Plain, Err(failure.clone()));
        assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), None, "{failure:?}");
    }
    let done = Done { sent: at(0), ended: at(10) };
    assert_eq!(after(&owner, UNIT.into(), &read, Form::Plain, Ok(done)).owes_only_this(|| owner.asked(UNIT)), None);
    // What acts may have acted.
    for request in [Request::write(100, 5), Request::write_many(100, &[5]).unwrap(), Request::echo(7)] {
        let mut course = after(&owner, UNIT.into(), &request, Form::Plain, Err(SILENCE));
        assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), None, "{request:?}");
    }
    let mut broadcast = after(&owner, Destination::Broadcast, &read, Form::Plain, Err(SILENCE));
    assert_eq!(broadcast.owes_only_this(|| owner.asked(UNIT)), None);
}

#[test]
fn who_asked_something_else_in_between_may_have_left_that_open() {
    let owner = owner();
    let mut course = lost_read(&owner, Form::Plain);
    owner.stats().units.entry(UNIT).or_default().requests += 1;
    assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), None, "another request");
    let mut course = lost_read(&owner, Form::Plain);
    owner.stats().reconnects += 1;
    assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), None, "another connection");
    let mut course = lost_read(&owner, Form::Plain);
    owner.stats().units.entry(UnitAddress::MAX).or_default().requests += 1;
    assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), Some(Form::Plain), "another unit's is no rival");
}

#[test]
fn a_question_that_is_repeated_goes_on_only_where_nothing_else_is_owed() {
    let owner = owner();
    let mut course = Course::new(TIMEOUT, 0);
    course.repeats(false, || owner.asked(UNIT));
    assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), None);
    course.repeats(true, || owner.asked(UNIT));
    assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), Some(Form::Repeated));
    let mut course = lost_read(&owner, Form::Apart(2));
    course.asks_otherwise();
    assert_eq!(course.owes_only_this(|| owner.asked(UNIT)), None, "it is put in another way");
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
