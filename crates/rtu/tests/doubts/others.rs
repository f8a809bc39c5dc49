//! Another master on the same line, whose answers are overheard: what nobody asked for makes its shape theirs.

use crate::asker::*;
use drivebus_rtu::*;

/// When something is heard first.
const NOW: u64 = 10_000;
const MINUTE: u64 = 60_000;

/// On a line that may have others, long after it was opened.
fn asker() -> Asker {
    let mut asker = Asker::of_a_unit_that_echoes();
    asker.master.expect_others(true);
    asker
}

/// The same, and `frame` came at `NOW` while nothing was asked.
fn overheard(frame: &Adu) -> Asker {
    let mut asker = asker();
    assert_eq!(asker.hears(NOW, frame), Came::Nothing);
    asker
}

fn theirs(until: u64) -> Attribution {
    Attribution::Others(ms(until))
}

/// What becomes of the request in flight when its time is over.
fn ends(asker: &mut Asker, now: u64) -> Came {
    match asker.master.poll(ms(now) + TIMEOUT) {
        Some(Event::Answer(Answer::Exception { .. })) => Came::Refusal,
        Some(Event::Wrong { error, .. }) => Came::Wrong(error),
        Some(Event::NoAnswer { .. }) => Came::Nothing,
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_answer_that_nobody_asked_for_makes_its_shape_theirs() {
    let asker = overheard(&words(unit(1), 1, 7));
    let over = NOW + MINUTE;
    for now in [ms(NOW), before(ms(over))] {
        assert_eq!(asker.attribution(now, &read(1)), theirs(over));
        assert!(!asker.tells_apart(now, &read(1)), "an answer of one word proves nothing");
        assert_eq!(asker.attribution(now, &read(2)), Attribution::Certain, "another length does");
        assert!(asker.tells_apart(now, &read(2)));
        let input = Request::read_of(Table::Input, 0x2100, 1).unwrap();
        assert_eq!(asker.attribution(now, &input), Attribution::Certain, "and another table");
        assert_eq!(asker.master.attribution(now, unit(2), &read(1)), Attribution::Certain, "and another unit");
        assert_eq!(asker.attribution(now, &Request::echo(7)), Attribution::Certain, "a fresh word is nobody else's");
        assert!(asker.master.has_others(now, unit(1)) && !asker.master.has_others(now, unit(2)));
    }
    assert_eq!(asker.attribution(ms(over), &read(1)), Attribution::Certain);
    assert!(!asker.master.has_others(ms(over), unit(1)));
}

#[test]
fn where_there_are_no_others_nothing_is_theirs() {
    let mut asker = Asker::of_a_unit_that_echoes();
    assert_eq!(asker.hears(NOW, &words(unit(1), 1, 7)), Came::Nothing);
    assert_eq!(asker.attribution(ms(NOW), &read(1)), Attribution::Certain);
    assert!(!asker.master.has_others(ms(NOW), unit(1)));
    asker.reads(NOW, unit(1), 1);
    assert_eq!(asker.asks(NOW, unit(1), &read(2), &refuses(unit(1), &read(2))), Came::Refusal, "at once");
}

/// Who asks once an hour is still there when none was heard for some hours.
#[test]
fn it_counts_for_ten_times_as_long_as_it_was_heard_for() {
    let mut asker = overheard(&words(unit(1), 1, 7));
    for (value, heard, over) in
        [(8, 5_000, MINUTE), (9, 6_000, MINUTE), (8, 60_000, 600_000), (9, 3_600_000, 36_000_000)]
    {
        assert_eq!(asker.hears(NOW + heard, &words(unit(1), 1, value)), Came::Nothing);
        assert_eq!(asker.attribution(ms(NOW + heard), &read(1)), theirs(NOW + heard + over), "after {heard} ms");
    }
}

#[test]
fn words_of_a_shape_that_is_theirs_are_no_answer() {
    let mut asker = overheard(&words(unit(1), 1, 7));
    assert_eq!(asker.asks(NOW, unit(1), &read(1), &words(unit(1), 1, 8)), Came::Wrong(AnswerError::Others));
    assert!(asker.in_quarantine(ms(NOW)), "the own one is still to come");
    // The next is asked in another length, and both of one word are passed over.
    asker.sends(NOW, unit(1), &read(2), TIMEOUT);
    assert_eq!(asker.hears(NOW, &words(unit(1), 1, 8)), Came::Nothing);
    assert_eq!(asker.hears(NOW + 1, &words(unit(1), 1, 9)), Came::Nothing);
    assert_eq!(asker.hears(NOW + 2, &words(unit(1), 2, 9)), Came::Answer);
    assert!(!asker.in_quarantine(ms(NOW + 2)));
}

/// Nobody owes it: what is taken for an answer was another's, and the own one comes while the next is waited for.
#[test]
fn an_answer_of_another_length_makes_that_length_theirs() {
    for patience in [None, Some(Patience::new(TIMEOUT, TIMEOUT))] {
        let mut asker = asker();
        asker.master.be_patient(patience);
        asker.reads(NOW, unit(1), 1);
        asker.sends(NOW, unit(1), &read(2), TIMEOUT);
        let came = asker.hears(NOW + 1, &words(unit(1), 1, 8));
        assert_eq!(asker.attribution(ms(NOW + 1), &read(1)), theirs(NOW + 1 + MINUTE));
        match patience {
            None => assert_eq!(came, Came::Wrong(AnswerError::Count { asked: 2, came: 1 })),
            Some(_) => assert_eq!((came, asker.hears(NOW + 2, &words(unit(1), 2, 9))), (Came::Nothing, Came::Answer)),
        }
    }
}

#[test]
fn what_is_owed_here_is_not_theirs() {
    let mut asker = asker();
    asker.leaves_open(NOW, unit(1), &read(1));
    assert_eq!(asker.hears(NOW + 1, &words(unit(1), 1, 7)), Came::Nothing);
    assert!(!asker.master.has_others(ms(NOW + 1), unit(1)), "it is late");
    assert_eq!(asker.hears(NOW + 100, &words(unit(1), 1, 8)), Came::Nothing);
    assert!(asker.master.has_others(ms(NOW + 100), unit(1)), "one was owed, not two");
}

/// A line may bring a frame twice at once; of this one nobody knows how soon that is.
#[test]
fn what_comes_twice_is_one() {
    let mut asker = asker();
    asker.leaves_open(NOW, unit(1), &read(1));
    for _ in 0..2 {
        assert_eq!(asker.hears(NOW + 1, &words(unit(1), 1, 7)), Came::Nothing);
    }
    assert!(!asker.master.has_others(ms(NOW + 1), unit(1)));
}

#[test]
fn a_refusal_that_may_be_theirs_decides_only_where_nothing_else_comes() {
    let refused = refuses(unit(1), &read(2));
    let mut asker = overheard(&words(unit(1), 1, 7));
    assert_eq!(asker.asks(NOW, unit(1), &read(2), &refused), Came::Nothing);
    assert_eq!(asker.hears(NOW + 1, &words(unit(1), 2, 8)), Came::Answer);
    assert_eq!(asker.asks(NOW + 100, unit(1), &read(2), &refused), Came::Nothing);
    assert_eq!(ends(&mut asker, NOW + 100), Came::Refusal);
    assert!(!asker.in_quarantine(ms(NOW + 200)), "it is answered");
    // Of a function that they were not heard to use it is the own one.
    let write = Request::write(0x2000, 1);
    assert_eq!(asker.asks(NOW + 200, unit(2), &read(2), &refuses(unit(2), &read(2))), Came::Refusal);
    asker.echoes(NOW + 200, unit(1));
    assert_eq!(asker.asks(NOW + 200, unit(1), &write, &refuses(unit(1), &write)), Came::Refusal);
}

/// What a refusal of a write may say is that another's was refused.
#[test]
fn a_write_that_may_not_be_the_refused_one_is_not_known_to_be_undone() {
    let (write, other) = (Request::write(0x2000, 1), Request::write(0x2001, 5));
    let mut asker = overheard(&confirms(unit(1), &other));
    assert_eq!(asker.asks(NOW, unit(1), &write, &refuses(unit(1), &write)), Came::Nothing);
    let code = ExceptionCode::ILLEGAL_ADDRESS;
    assert_eq!(ends(&mut asker, NOW), Came::Wrong(AnswerError::Refusal { code }));
}

#[test]
fn echoes_of_their_writes_are_passed_over() {
    let (write, other) = (Request::write(0x2000, 1), Request::write(0x2000, 5));
    let mut asker = overheard(&confirms(unit(1), &other));
    assert_eq!(asker.attribution(ms(NOW), &other), Attribution::Certain, "whoever asked, it took that value");
    assert_eq!(asker.asks(NOW, unit(1), &write, &confirms(unit(1), &other)), Came::Nothing);
    assert_eq!(asker.hears(NOW + 1, &confirms(unit(1), &write)), Came::Answer);
    assert_eq!(asker.asks(NOW + 2, unit(1), &write, &confirms(unit(1), &other)), Came::Nothing);
    let error = AnswerError::Echo { asked: [0x2000, 1], came: [0x2000, 5] };
    assert_eq!(ends(&mut asker, NOW + 2), Came::Wrong(error), "told when nothing else came");
}

/// The echo of 10H says where something was written, not what.
#[test]
fn of_several_words_it_is_the_address_and_the_count_that_are_theirs() {
    let many = |address, words: &'static [u16]| Request::write_many(address, words).unwrap();
    let asker = overheard(&confirms(unit(1), &many(0x2000, &[1, 2])));
    assert_eq!(asker.attribution(ms(NOW), &many(0x2000, &[3, 4])), theirs(NOW + MINUTE));
    assert_eq!(asker.attribution(ms(NOW), &many(0x2000, &[3])), Attribution::Certain);
    assert_eq!(asker.attribution(ms(NOW), &many(0x2001, &[3, 4])), Attribution::Certain);
    let custom = |answer| Request::custom(&[0x10, 0x20, 0, 0, 2, 4, 0, 1, 0, 2], answer).unwrap();
    assert_eq!(asker.attribution(ms(NOW), &custom(AnswerLength::BySilence)), theirs(NOW + MINUTE));
    assert_eq!(asker.attribution(ms(NOW), &custom(AnswerLength::Bytes(5))), theirs(NOW + MINUTE));
    assert_eq!(asker.attribution(ms(NOW), &custom(AnswerLength::Bytes(6))), Attribution::Certain);
}

#[test]
fn what_comes_in_first_contact_counts_until_that_is_over() {
    let mut asker = Asker::new();
    asker.master.expect_others(true);
    asker.master.opened(ms(NOW));
    assert_eq!(asker.hears(NOW + 100, &words(unit(1), 1, 7)), Came::Nothing);
    asker.echoes(NOW + 200, unit(1));
    let over = NOW + 1_000;
    assert_eq!(asker.attribution(before(ms(over)), &read(1)), theirs(over), "it may be an own one from before");
    assert_eq!(asker.attribution(ms(over), &read(1)), Attribution::Certain);
    assert_eq!(asker.hears(NOW + 300, &words(unit(1), 1, 8)), Came::Nothing);
    assert_eq!(asker.attribution(ms(over), &read(1)), theirs(NOW + 300 + MINUTE), "the unit has caught up");
}

/// What there is no room for leaves its unit one of which nothing is told apart.
#[test]
fn of_a_unit_of_which_something_was_forgotten_everything_may_be_theirs() {
    let mut asker = asker();
    for heard in 0..48_u8 {
        assert_eq!(asker.hears(NOW + u64::from(heard), &words(unit(1 + heard), 1, 7)), Came::Nothing);
    }
    let of = |asker: &Asker, now, raw| asker.master.attribution(ms(now), unit(raw), &read(5));
    assert_eq!(of(&asker, NOW + 50, 1), Attribution::Certain);
    assert_eq!(asker.hears(NOW + 50, &words(unit(100), 1, 7)), Came::Nothing);
    assert_eq!(of(&asker, NOW + 50, 1), theirs(NOW + MINUTE));
    assert_eq!(of(&asker, NOW + 50, 2), Attribution::Certain);
    assert_eq!(of(&asker, NOW + MINUTE, 1), Attribution::Certain);
    assert_eq!(asker.hears(NOW + MINUTE + 1, &words(unit(101), 1, 7)), Came::Nothing);
    assert_eq!(of(&asker, NOW + MINUTE + 1, 3), Attribution::Certain, "what is over gives way");
}
