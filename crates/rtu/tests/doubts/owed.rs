//! As many answers can come as the unit owes: where one was taken that may have been another's, one of the two is open.

use drivebus_rtu::*;
use proptest::collection::vec;
use proptest::prelude::*;

use crate::asker::{Asker, Came, ms, read, refuses, unit, words};

fn repeat(words: u8, refusal: u8) -> Attribution {
    Attribution::Repeat { words, refusal }
}

/// A read of `count` words is refused at `now`.
fn refused(asker: &mut Asker, now: u64, count: u16) {
    assert_eq!(asker.asks(now, unit(1), &read(count), &refuses(unit(1), &read(count))), Came::Refusal);
}

/// A unit that owes the answers to so many reads of two words, and answers again.
fn owing(times: u64) -> Asker {
    let mut asker = Asker::of_a_unit_that_echoes();
    for time in 0..times {
        asker.leaves_open(1_000 + time, unit(1), &read(2));
    }
    asker.echoes(1_500, unit(1));
    asker
}

/// A drive that was silent twice, and refuses what it is asked then: that tells which family it is.
#[test]
fn however_many_refusals_are_taken_no_more_can_come() {
    let mut asker = owing(2);
    for (time, count) in (2_000..).zip([1, 3, 4, 5, 1, 1, 1, 3, 3, 4]) {
        refused(&mut asker, time, count);
        assert_eq!(asker.attribution(ms(time), &read(6)), repeat(1, 3), "after {time}");
    }
    assert_eq!(asker.attribution(ms(2_100), &read(1)), repeat(3, 3));
}

/// Of what is told apart one less can come, and of what took its place: once more is asked in any case.
#[test]
fn what_was_seen_can_not_come_in_the_place_of_another() {
    let mut asker = owing(2);
    refused(&mut asker, 2_000, 1);
    refused(&mut asker, 2_001, 1);
    assert_eq!(asker.attribution(ms(2_002), &read(1)), repeat(3, 3));
    for time in [2_010, 2_020] {
        assert_eq!(asker.hears(time, &words(unit(1), 2, 7)), Came::Nothing);
        assert_eq!(asker.attribution(ms(time), &read(1)), repeat(2, 2));
    }
}

/// What was asked for first is forgotten before what took its place: that counts on.
#[test]
fn what_took_the_place_of_another_is_owed_when_that_is_forgotten() {
    let mut asker = owing(2);
    refused(&mut asker, 2_000, 1);
    refused(&mut asker, 2_001, 1);
    asker.reads(4_000, unit(1), 1);
    // By now the reads of two words are past, and an echo forgets them; those of one word are not.
    asker.echoes(5_500, unit(1));
    assert_eq!(asker.attribution(ms(5_500), &read(2)), repeat(1, 3));
    assert_eq!(asker.attribution(ms(5_500), &read(1)), repeat(3, 3));
}

/// In quarantine a refusal counts as no answer, and was one.
#[test]
fn what_was_refused_in_quarantine_came_all_the_same() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.leaves_open(1_000, unit(1), &read(2));
    for (time, count) in [(1_100, 3), (1_200, 4)] {
        let came = asker.asks(time, unit(1), &read(count), &refuses(unit(1), &read(count)));
        assert_eq!(came, Came::Wrong(AnswerError::Refusal { code: ExceptionCode::ILLEGAL_ADDRESS }));
        assert!(asker.in_quarantine(ms(time)));
    }
    asker.echoes(1_300, unit(1));
    assert_eq!(asker.attribution(ms(1_300), &read(1)), repeat(1, 2));
}

/// Where another master asks, an answer may be its, and then nothing of ours has come.
#[test]
fn where_others_ask_nothing_is_told_by_what_came() {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.master.expect_others(true);
    asker.leaves_open(1_000, unit(1), &read(2));
    asker.echoes(1_500, unit(1));
    refused(&mut asker, 2_000, 1);
    assert_eq!(asker.attribution(ms(2_000), &read(3)), repeat(1, 3));
}

fn pdu(frame: &Adu) -> &[u8] {
    let bytes = frame.as_bytes();
    &bytes[1..bytes.len() - 2]
}

/// A cable that was out for minutes.
#[test]
fn more_is_left_open_than_is_counted() {
    let asker = owing(300);
    assert!(matches!(asker.attribution(ms(1_600), &read(2)), Attribution::Wait(_)));
    assert_eq!(asker.attribution(ms(1_600), &read(1)), repeat(1, u8::MAX));
}

/// A unit on a line where answers overtake each other: what it was asked and has not answered.
struct Owing {
    asker: Asker,
    now: u64,
    owed: Vec<Request<'static>>,
}

impl Owing {
    /// The right answer: each register has its own number for a word, and those from 8 on are refused, each by its own code.
    fn right(request: &Request<'_>) -> Adu {
        let Request::Read { address, count, .. } = *request else { panic!("only reads are asked") };
        match u8::try_from(address).unwrap() {
            refused @ 8.. => Adu::answer(unit(1), &Answer::exception(3, ExceptionCode(refused))),
            value => words(unit(1), count, value.into()),
        }
    }

    fn leaves_open(&mut self, request: Request<'static>) {
        self.now += 1;
        self.asker.leaves_open(self.now, unit(1), &request);
        self.asker.echoes(self.now, unit(1));
        self.owed.push(request);
    }

    /// Asks until the answers agree. Of what could be taken for the answer, `late` says which comes: the right one, or one that
    /// is owed.
    fn asks(&mut self, request: Request<'static>, mut late: impl Iterator<Item = u8>) {
        let attribution = self.asker.attribution(ms(self.now), &request);
        let mut agreement = Agreement::new(attribution, 1);
        if matches!(attribution, Attribution::Wait(_)) {
            return;
        }
        while !agreement.is_in_vain() {
            self.now += 1;
            self.owed.push(request);
            let fits = |owed: &&Request<'_>| request.judge(pdu(&Self::right(owed))).is_ok();
            let candidates = self.owed.iter().filter(fits).count();
            let which = usize::from(late.next().unwrap_or(u8::MAX)).min(candidates - 1);
            let came = *self.owed.iter().filter(fits).nth(which).unwrap();
            let place = self.owed.iter().position(|owed| *owed == came).unwrap();
            self.owed.remove(place);
            let frame = Self::right(&came);
            assert!(matches!(self.asker.asks(self.now, unit(1), &request, &frame), Came::Answer | Came::Refusal));
            let answer = request.judge(pdu(&frame)).unwrap();
            if agreement.hear(unit(1), &answer) {
                assert_eq!(frame.as_bytes(), Self::right(&request).as_bytes(), "{came:?} was believed: {request:?}");
                return;
            }
        }
    }
}

fn reads() -> impl Strategy<Value = Request<'static>> {
    (prop_oneof![Just(1_u16), Just(2), Just(8), Just(9)], prop_oneof![3 => Just(1_u16), 1 => Just(2)])
        .prop_map(|(address, count)| Request::read(address, count).unwrap())
}

proptest! {
    /// Whatever is left open, and whichever of the answers that could be meant comes first: none is believed that is not the own.
    #[test]
    fn no_late_answer_is_believed(
        steps in vec((any::<bool>(), reads(), vec(0_u8..4, 0..12)), 1..14),
    ) {
        let mut owing = Owing { asker: Asker::of_a_unit_that_echoes(), now: 1, owed: Vec::new() };
        for (is_left, request, late) in steps {
            if is_left {
                owing.leaves_open(request);
            } else {
                owing.asks(request, late.into_iter());
            }
        }
    }
}
