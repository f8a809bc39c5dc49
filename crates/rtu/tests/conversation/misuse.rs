//! What is said to a conversation out of turn: an error each, nothing sent after it, and never a panic.

use drivebus_rtu::*;

use crate::rig::*;

/// A call whose request is handed out, and not yet said to be on its way.
pub(crate) fn handed_out<'r>(rig: &mut Rig, question: Question<'r>, fresh: &'r FreshWords) -> Conversation<'r> {
    let mut call = Conversation::new(question, fresh);
    loop {
        match call.next(rig.now, &mut rig.known) {
            Step::Send(_) => return call,
            Step::Listen(until) => {
                rig.now = rig.now.max(until);
                call.heard(rig.now, &mut rig.known, &[]).unwrap();
            }
            Step::LetPass => {}
            other => panic!("{other:?}"),
        }
    }
}

fn is_misused(told: &Told) {
    assert_eq!((&told.end, told.sent.len()), (&End::Failed(Unanswered::Misused), 0));
}

#[test]
fn bytes_that_nobody_asked_for_are_refused_and_change_nothing() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1), &fresh);
    assert_eq!(call.heard(rig.now, &mut rig.known, &words(&[8])), Err(OutOfTurn));
    assert!(matches!(call.next(rig.now, &mut rig.known), Step::LetPass));
    assert_eq!(call.heard(rig.now, &mut rig.known, &words(&[8])), Err(OutOfTurn));
    assert_eq!(rig.carry_out(&mut call).end, End::Words(vec![7]));
    assert_eq!(call.heard(rig.now, &mut rig.known, &words(&[8])), Err(OutOfTurn));
    assert_eq!(OutOfTurn.to_string(), "nothing was asked that this could be the answer to");
}

#[test]
fn a_request_that_was_not_handed_out_is_not_on_its_way() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1), &fresh);
    assert_eq!(call.sent(&mut rig.known, rig.now), Err(OutOfTurn));
    assert!(matches!(call.next(rig.now, &mut rig.known), Step::LetPass));
    assert!(matches!(call.next(rig.now, &mut rig.known), Step::Listen(_)));
    assert_eq!(call.sent(&mut rig.known, rig.now), Err(OutOfTurn), "it is begun, and waits for the silence");
    assert_eq!(rig.carry_out(&mut call).end, End::Words(vec![7]));
    assert_eq!(call.sent(&mut rig.known, rig.now), Err(OutOfTurn));
}

#[test]
fn a_request_is_on_its_way_once() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = handed_out(&mut rig, ask(7, 1), &fresh);
    assert_eq!(call.sent(&mut rig.known, rig.now), Ok(rig.now + TIMEOUT));
    assert_eq!(call.sent(&mut rig.known, rig.now + ms(50)), Err(OutOfTurn));
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, rig.now), (silence(1), at(5_000) + TIMEOUT), "it is waited for from the first time on");
}

#[test]
fn who_does_not_say_that_it_is_on_its_way_is_told() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = handed_out(&mut rig, ask(7, 1).retries(3), &fresh);
    let told = rig.carry_out(&mut call);
    is_misused(&told);
    assert!(told.last_sent.is_some(), "it may have been sent");
    assert!(rig.known.master().in_quarantine(rig.now, UNIT));
}

#[test]
fn time_that_goes_back_ends_the_call() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1).retries(3), &fresh);
    assert!(matches!(call.next(rig.now, &mut rig.known), Step::LetPass));
    rig.now = at(4_000);
    is_misused(&rig.carry_out(&mut call));
    // Nor may the bytes come before the last moment.
    let mut rig = Rig::settled();
    let mut call = handed_out(&mut rig, ask(7, 1).retries(3), &fresh);
    call.sent(&mut rig.known, rig.now).unwrap();
    assert_eq!(call.heard(at(4_999), &mut rig.known, &words(&[7])), Err(OutOfTurn));
    call.heard(at(5_050), &mut rig.known, &[]).unwrap();
    rig.now = at(5_049);
    is_misused(&rig.carry_out(&mut call));
    assert!(rig.known.master().in_quarantine(at(5_050), UNIT), "the unit was asked");
}

#[test]
fn a_misused_call_still_says_that_its_request_may_have_been_done() {
    let fresh = FreshWords::beginning_at(1);
    // While the write is on the wire, when that is over, and while its words are read back.
    for requests in 1..4 {
        for heard in [false, true] {
            let mut rig = Rig::settled();
            let mut call = Conversation::new(set(9, 5).read_back(Some(9)), &fresh);
            let mut count = 0;
            loop {
                match call.next(rig.now, &mut rig.known) {
                    Step::Send(_) => {
                        call.sent(&mut rig.known, rig.now).unwrap();
                        count += 1;
                        if count == requests && !heard {
                            break;
                        }
                    }
                    Step::Listen(until) => {
                        rig.now = rig.now.max(until);
                        call.heard(rig.now, &mut rig.known, &[]).unwrap();
                    }
                    Step::Heard(_) if count == requests => break,
                    Step::Done(_) => break,
                    _ => {}
                }
            }
            rig.now = at(1);
            let told = rig.carry_out(&mut call);
            assert_eq!((told.end == End::Done, told.last_sent), (false, Some(at(5_000))), "{requests} {heard}");
        }
    }
}

#[test]
fn what_a_call_came_to_it_says_again() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = Conversation::new(ask(7, 1), &fresh);
    for now in [at(5_000), at(9_000), at(1)] {
        rig.now = now;
        assert_eq!(rig.carry_out(&mut call).end, End::Words(vec![7]));
    }
    call.cut_short(rig.now, &mut rig.known, Cut::GivenUp);
    call.give_way(rig.now, &mut rig.known, TIMEOUT);
    assert_eq!(rig.carry_out(&mut call).end, End::Words(vec![7]));
}

#[test]
fn of_two_calls_at_once_on_one_line_the_second_is_not_begun() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut first = handed_out(&mut rig, ask(7, 1), &fresh);
    first.sent(&mut rig.known, rig.now).unwrap();
    let told = rig.run(ask(9, 1).retries(3));
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::NotBegun(BeginError::OutOfTurn)), 0));
    first.heard(rig.now, &mut rig.known, &words(&[7])).unwrap();
    assert_eq!(rig.carry_out(&mut first).end, End::Words(vec![7]), "and the first goes on");
}

#[test]
fn a_call_never_sends_nor_hears_what_belongs_to_another() {
    let fresh = FreshWords::beginning_at(1);
    for is_out in [false, true] {
        let mut rig = Rig::settled();
        let mut first = Conversation::new(ask(7, 1).retries(3), &fresh);
        assert!(matches!(first.next(rig.now, &mut rig.known), Step::LetPass));
        assert!(matches!(first.next(rig.now, &mut rig.known), Step::Listen(_)), "it is begun");
        rig.known.abort(rig.now);
        let mut second = Conversation::new(set(9, 1).in_doubt(true), &fresh);
        assert!(matches!(second.next(rig.now, &mut rig.known), Step::LetPass));
        assert!(matches!(second.next(rig.now, &mut rig.known), Step::Listen(_)));
        second.heard(rig.now, &mut rig.known, &[]).unwrap();
        if is_out {
            assert!(matches!(second.next(rig.now, &mut rig.known), Step::Send(_)));
            second.sent(&mut rig.known, rig.now).unwrap();
        }
        assert_eq!(first.heard(rig.now, &mut rig.known, &write(9, 1)), Err(OutOfTurn));
        is_misused(&rig.carry_out(&mut first));
        if is_out {
            second.heard(rig.now, &mut rig.known, &write(9, 1)).unwrap();
        }
        assert_eq!(rig.carry_out(&mut second).end, End::Confirmed, "and the second goes on");
    }
}

#[test]
fn a_line_that_is_opened_under_a_request_gives_it_up() {
    let mut rig = Rig::settled();
    let fresh = FreshWords::beginning_at(1);
    let mut call = handed_out(&mut rig, set(7, 1), &fresh);
    call.sent(&mut rig.known, rig.now).unwrap();
    rig.known.opened(rig.now, &Opened::new());
    let told = rig.carry_out(&mut call);
    is_misused(&told);
    assert!(told.last_sent.is_some());
}

#[test]
fn of_more_units_than_there_is_room_for_nothing_is_sent() {
    let mut known: Known<1, 1> = Known::new(SerialFormat::DEFAULT, OwnEcho::Absent, 7);
    let fresh = FreshWords::beginning_at(1);
    let other = Question::new(UnitAddress::new(2).unwrap().into(), Request::read(7, 1).unwrap(), TIMEOUT);
    for (question, is_room) in [(ask(7, 1), true), (other, false), (ask(8, 1), true)] {
        let mut call = Conversation::new(question.retries(3), &fresh);
        match call.next(at(5_000), &mut known) {
            Step::LetPass => assert!(is_room),
            Step::Done(Outcome::Failed { why, sent: None, .. }) => {
                assert_eq!((why, is_room), (Unanswered::NoRoom { units: 1 }, false));
            }
            other => panic!("{other:?}"),
        }
    }
    let all = Question::new(Destination::Broadcast, Request::write(7, 1), TIMEOUT);
    assert!(matches!(Conversation::new(all, &fresh).next(at(5_000), &mut known), Step::LetPass));
}

#[test]
fn where_there_is_room_for_few_units_it_is_for_any() {
    let mut known: Known<2, 1> = Known::new(SerialFormat::DEFAULT, OwnEcho::Absent, 7);
    let fresh = FreshWords::beginning_at(1);
    for (unit, is_room) in [(247, true), (100, true), (1, false), (247, true)] {
        let unit = UnitAddress::new(unit).unwrap();
        let question = Question::new(unit.into(), Request::read(7, 1).unwrap(), TIMEOUT);
        let mut call = Conversation::new(question, &fresh);
        let step = call.next(at(5_000), &mut known);
        assert_eq!(matches!(step, Step::LetPass), is_room, "{unit:?}: {step:?}");
    }
}

/// Goes on with `call` until its request number `requests` is on the wire.
fn until_sent(rig: &mut Rig, call: &mut Conversation<'_>, requests: usize, came: &[Vec<u8>]) {
    let (mut sent, mut came) = (0, came.iter());
    loop {
        match call.next(rig.now, &mut rig.known) {
            Step::Send(_) => {
                call.sent(&mut rig.known, rig.now).unwrap();
                sent += 1;
                if sent == requests {
                    return;
                }
            }
            Step::Listen(until) => {
                let bytes = if sent > 0 { came.next() } else { None };
                rig.now = if bytes.is_some() { rig.now } else { rig.now.max(until) };
                call.heard(rig.now, &mut rig.known, bytes.map_or(&[], |bytes| bytes)).unwrap();
            }
            _ => {}
        }
    }
}

#[test]
fn what_went_out_before_a_look_at_the_adapter_is_not_said_to_be_undone() {
    let fresh = FreshWords::beginning_at(1);
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Unknown);
    rig.now = at(5_000);
    let mut call = Conversation::new(set(9, 1).in_doubt(true), &fresh);
    until_sent(&mut rig, &mut call, 2, &[write(9, 1)]);
    rig.now = at(1);
    let told = rig.carry_out(&mut call);
    is_misused(&told);
    assert_eq!(told.last_sent, Some(at(5_000)));
}

#[test]
fn a_probe_is_not_the_question() {
    let fresh = FreshWords::beginning_at(1);
    let mut rig = Rig::opened(Opened::new(), OwnEcho::Absent);
    let mut call = Conversation::new(set(9, 1), &fresh);
    until_sent(&mut rig, &mut call, 1, &[]);
    rig.now = Instant::ZERO;
    let told = rig.carry_out(&mut call);
    is_misused(&told);
    assert_eq!(told.last_sent, None);
}

#[test]
fn the_later_of_two_cuts_counts_and_a_refusal_stays_one() {
    let fresh = FreshWords::beginning_at(1);
    let mut rig = Rig::settled();
    let mut call = Conversation::new(ask(9, 1).retries(3), &fresh);
    until_sent(&mut rig, &mut call, 1, &[]);
    call.cut_short(rig.now, &mut rig.known, Cut::Lost);
    call.cut_short(rig.now, &mut rig.known, Cut::GivenUp);
    let told = rig.carry_out(&mut call);
    assert_eq!((told.end, told.sent.len()), (End::Failed(Unanswered::CutShort(Cut::GivenUp)), 0));
    let mut rig = Rig::settled();
    let mut call = Conversation::new(ask(9, 1).retries(3), &fresh);
    until_sent(&mut rig, &mut call, 1, &[]);
    call.heard(rig.now, &mut rig.known, &sealed(&[1, 0x83, 2])).unwrap();
    while !matches!(call.next(rig.now, &mut rig.known), Step::Heard(_)) {
        call.heard(rig.now, &mut rig.known, &[]).unwrap();
    }
    call.cut_short(rig.now, &mut rig.known, Cut::GivenUp);
    let refused = Unanswered::Refused { function: 3, code: ExceptionCode(2) };
    assert_eq!(rig.carry_out(&mut call).end, End::Failed(refused), "the unit has said what it does");
}

#[test]
fn a_call_that_is_misused_while_its_answer_is_proved_says_when_it_asked() {
    let fresh = FreshWords::beginning_at(1);
    let mut rig = Rig::opened(Opened::new().may_echo(false).may_have_others(true), OwnEcho::Absent);
    rig.now = at(5_000);
    let mut call = Conversation::new(ask(9, 1), &fresh);
    until_sent(&mut rig, &mut call, 2, &[words(&[9])]);
    while !matches!(call.next(rig.now, &mut rig.known), Step::Heard(_)) {
        call.heard(rig.now, &mut rig.known, &words(&[9, 10])).unwrap();
    }
    assert!(matches!(call.next(rig.now, &mut rig.known), Step::Listen(_)));
    assert!(rig.now > at(5_000), "what proves it went out later");
    rig.now = at(1);
    let told = rig.carry_out(&mut call);
    is_misused(&told);
    assert_eq!(told.last_sent, Some(at(5_000)));
}
