//! How long an answer that came damaged may still come, to the nanosecond. Each unit is asked once, so that nothing else is open.

use crate::asker::*;
use drivebus_rtu::*;

/// How long is listened on for the rest of an answer.
const PAUSE: u64 = 10;

fn patient() -> Asker {
    let mut asker = Asker::new();
    let (pause, usual) = (Duration::from_millis(PAUSE), Duration::ZERO);
    asker.master.be_patient(Some(Patience::new(pause, usual)));
    asker
}

/// The answer of unit `raw` to a read of two words, without its fifth byte.
fn damaged(raw: u8) -> Vec<u8> {
    let mut bytes = words(unit(raw), 2, 7).as_bytes().to_vec();
    bytes.remove(5);
    bytes
}

/// Unit `raw` is asked for two words with a time-out of `timeout`, `bytes` come, and at `given_up` the request ends. How long its
/// answer is owed from then on, in milliseconds.
fn owed(asker: &mut Asker, given_up: u64, raw: u8, bytes: &[u8], timeout: Duration) -> u64 {
    asker.sends(given_up - PAUSE, unit(raw), &read(2), timeout);
    asker.master.receive(ms(given_up - PAUSE), bytes);
    assert!(asker.master.poll(before(ms(given_up))).is_none());
    assert!(asker.master.poll(ms(given_up)).is_some());
    let is_owed = |now| asker.master.attribution(now, unit(raw), &read(2)).may_be_mistaken();
    let times = [0, 2 * PAUSE, 1_000, 2_000, 3_000];
    let over =
        |&millis: &u64| !is_owed(ms(given_up + millis)) && (millis == 0 || is_owed(before(ms(given_up + millis))));
    times.into_iter().find(over).unwrap()
}

fn comes_damaged(asker: &mut Asker, given_up: u64, raw: u8) -> u64 {
    owed(asker, given_up, raw, &damaged(raw), Duration::from_millis(500))
}

/// Behind its damaged answer unit 9 is heard to give the right one.
fn comes_damaged_and_right(asker: &mut Asker, now: u64) {
    asker.sends(now, unit(9), &read(2), TIMEOUT);
    let mut damaged = words(unit(9), 2, 7).as_bytes().to_vec();
    damaged[5] ^= 0x10;
    asker.master.receive(ms(now), &damaged);
    assert!(asker.master.poll(ms(now + 1)).is_none());
    assert_eq!(asker.hears(now + 2, &words(unit(9), 2, 7)), Came::Answer);
}

/// Three have come damaged by 1 s, and none again.
fn known() -> Asker {
    let mut asker = patient();
    for (raw, given_up) in [(1, 100), (2, 500), (3, 1_000)] {
        assert_eq!(comes_damaged(&mut asker, given_up, raw), 1_000, "unit {raw}");
    }
    asker
}

#[test]
fn three_damaged_answers_and_a_second_say_that_the_next_does_not_come_again() {
    assert_eq!(comes_damaged(&mut known(), 1_999, 4), 1_000);
    assert_eq!(comes_damaged(&mut known(), 2_000, 4), 0);
    // Two are not enough, however long ago.
    let mut asker = patient();
    for (raw, given_up) in [(1, 100), (2, 5_000), (3, 9_000), (4, 9_999)] {
        assert_eq!(comes_damaged(&mut asker, given_up, raw), 1_000, "unit {raw}");
    }
    assert_eq!(comes_damaged(&mut asker, 10_000, 5), 0);
}

#[test]
fn a_damaged_answer_may_come_again_for_its_time_out_if_that_is_longer() {
    let timeout = Duration::from_secs(2);
    assert_eq!(owed(&mut patient(), 1_000, 1, &damaged(1), timeout), 2_000);
    assert_eq!(owed(&mut known(), 2_000, 4, &damaged(4), timeout), 0);
}

/// The one that may come again may have been taken; then the other is as open as any.
#[test]
fn an_answer_taken_while_a_damaged_one_may_come_again_leaves_one_open() {
    for (taken, over) in [(1_099, 1_099 + 3_000), (1_100, 1_100)] {
        let mut asker = patient();
        assert_eq!(comes_damaged(&mut asker, 100, 1), 1_000);
        asker.reads(taken, unit(1), 2);
        let is_owed = |now| asker.master.attribution(now, unit(1), &read(2)).may_be_mistaken();
        assert!(!is_owed(ms(over)) && (over == taken || is_owed(before(ms(over)))), "taken at {taken} ms");
    }
}

/// The rest of what broke off, which looks like the end of an answer, has no more bytes than were missing, and comes as soon as
/// the answer may come again: here within two time-outs.
#[test]
fn soon_after_something_broke_off_nothing_is_believed_that_may_be_its_rest() {
    let whole = words(unit(9), 6, 7);
    let breaks_off = |asker: &mut Asker, len: usize| {
        asker.sends(2_900, unit(9), &read(6), Duration::from_millis(100));
        asker.master.receive(ms(2_900), &whole.as_bytes()[..len]);
        assert!(asker.master.poll(ms(3_000)).is_some());
    };
    let lacks = |rest: usize| whole.as_bytes().len() - rest;
    // Eight bytes are left of the answer to two words.
    for (rest, given_up, expected) in [(8, 3_199, 3_000), (8, 3_200, 0), (7, 3_199, 0), (14, 3_199, 3_000)] {
        let mut asker = known();
        breaks_off(&mut asker, lacks(rest));
        assert_eq!(comes_damaged(&mut asker, given_up, 4), expected, "{rest} bytes are missing");
    }
    // The longer rest of two counts, and the later end.
    for (given_up, expected) in [(3_349, 3_000), (3_350, 0)] {
        let mut asker = known();
        breaks_off(&mut asker, lacks(10));
        asker.sends(3_050, unit(8), &read(2), Duration::from_millis(100));
        asker.master.receive(ms(3_050), &words(unit(8), 2, 7).as_bytes()[..5]);
        assert!(asker.master.poll(ms(3_150)).is_some());
        assert_eq!(comes_damaged(&mut asker, given_up, 4), expected, "given up at {given_up} ms");
    }
    // Nothing is no beginning.
    let mut asker = known();
    asker.sends(2_950, unit(9), &read(2), Duration::from_millis(50));
    assert!(asker.master.poll(ms(3_000)).is_some());
    assert_eq!(comes_damaged(&mut asker, 3_099, 4), 0);
}

#[test]
fn a_late_answer_that_comes_damaged_is_owed_no_more_where_none_comes_again() {
    for (mut asker, is_owed) in [(patient(), true), (known(), false)] {
        asker.leaves_open_for(5_000, unit(4), &read(2), Duration::from_millis(500));
        asker.master.receive(ms(6_000), &damaged(4));
        let _ = asker.master.poll(ms(6_000 + PAUSE));
        asker.sends(6_100, unit(9), &read(6), TIMEOUT);
        assert_eq!(asker.master.attribution(ms(6_100), unit(4), &read(2)).may_be_mistaken(), is_owed);
    }
}

/// What an adapter hands over last may be a byte. Of an answer that is all there nothing is waited for so long.
#[test]
fn what_lacks_a_byte_is_waited_for_as_long_as_the_line_pauses() {
    for (pause, missing, over) in [(10, 1, 10), (10, 2, 10), (60, 1, 60), (60, 2, 60), (60, 0, 20)] {
        let mut asker = Asker::new();
        asker.master.be_patient(Some(Patience::new(Duration::from_millis(pause), Duration::ZERO)));
        asker.sends(1_000, unit(4), &read(2), TIMEOUT.max(Duration::from_millis(200)));
        let mut bytes = words(unit(4), 2, 7).as_bytes().to_vec();
        bytes[4] ^= u8::from(missing == 0);
        asker.master.receive(ms(1_010), &bytes[..bytes.len() - missing]);
        assert!(asker.master.poll(before(ms(1_010 + over))).is_none(), "{missing} are missing, pauses are {pause} ms");
        assert!(asker.master.poll(ms(1_010 + over)).is_some(), "{missing} are missing, pauses are {pause} ms");
    }
}

/// The late answer of unit 4 to a read of two words comes as `bytes` while nothing is in flight; `other` is open besides.
fn owed_after(bytes: &[u8], other: Option<(u8, Request<'_>)>) -> bool {
    let mut asker = known();
    asker.leaves_open_for(5_000, unit(4), &read(2), Duration::from_millis(500));
    if let Some((raw, request)) = other {
        asker.leaves_open_for(5_000, unit(raw), &request, Duration::from_millis(500));
    }
    asker.master.receive(ms(6_000), bytes);
    let _ = asker.master.poll(ms(6_000 + PAUSE));
    asker.sends(6_100, unit(9), &read(6), TIMEOUT);
    asker.master.attribution(ms(6_100), unit(4), &read(2)).may_be_mistaken()
}

/// Seventeen bytes are too many for the eight that came, and a beginning of which nothing is right is another's.
#[test]
fn a_late_answer_is_told_from_others_by_its_length_and_its_beginning() {
    let of_input = |count| Request::read_of(Table::Input, 0, count).unwrap();
    for (raw, request, is_owed) in
        [(5, read(6), false), (5, of_input(3), false), (5, read(3), true), (4, of_input(3), true)]
    {
        assert_eq!(owed_after(&damaged(4), Some((raw, request))), is_owed, "{request:?} of unit {raw} is open");
    }
}

#[test]
fn a_late_answer_is_told_by_two_of_the_first_three_of_its_bytes() {
    let mut bytes = damaged(4);
    assert!(!owed_after(&bytes, None));
    bytes[0] = 0x55;
    assert!(!owed_after(&bytes, None));
    bytes[1] = 0xAA;
    assert!(owed_after(&bytes, None));
}

/// More is open than is kept: what came damaged may be left of what was forgotten, until that cannot come any more.
#[test]
fn a_late_answer_that_comes_damaged_stays_owed_while_it_may_be_a_forgotten_one() {
    for (now, is_owed) in [(before(ms(8_000)), true), (ms(8_000), false)] {
        let mut asker = known();
        asker.leaves_open(5_000, unit(1), &read(1));
        asker.leaves_open(5_001, unit(4), &read(16));
        for raw in 101..=131 {
            asker.leaves_open(5_001, unit(raw), &read(1));
        }
        asker.master.receive(ms(7_980), &words(unit(4), 16, 7).as_bytes()[..36]);
        let _ = asker.master.poll(now);
        assert_eq!(asker.master.attribution(now, unit(4), &read(16)).may_be_mistaken(), is_owed, "at {now:?}");
    }
}

/// An answer of which more bytes came than it has is all there.
#[test]
fn what_is_longer_than_an_open_answer_leaves_none_of_that_to_come() {
    for (open, expected) in [(8, 3_000), (3, 0)] {
        let mut asker = known();
        asker.leaves_open_for(2_500, unit(8), &read(open), Duration::from_millis(100));
        asker.sends(2_900, unit(9), &read(4), Duration::from_millis(100));
        // Twelve of thirteen bytes, and two of the first three are damaged: it may be left of any.
        let mut bytes = words(unit(9), 4, 7).as_bytes()[1..].to_vec();
        (bytes[0], bytes[1], bytes[5]) = (0x55, 0xAA, 0x11);
        asker.master.receive(ms(2_900), &bytes);
        assert!(asker.master.poll(ms(3_000)).is_some());
        assert_eq!(comes_damaged(&mut asker, 3_100, 4), expected, "{open} words are open");
    }
}

/// What broke off may be the beginning of any that may still come: until its time is over, and its unit has caught up.
#[test]
fn what_comes_no_more_leaves_nothing_to_come() {
    for (caught_up, given_up, expected) in [(true, 5_499, 3_000), (true, 5_500, 0), (false, 5_500, 3_000)] {
        let mut asker = known();
        asker.echoes(2_400, unit(8));
        asker.leaves_open(2_500, unit(8), &read(8));
        if caught_up {
            asker.echoes(2_600, unit(8));
        }
        asker.sends(given_up - 100, unit(9), &read(4), Duration::from_millis(100));
        // Twelve of thirteen bytes, and two of the first three are damaged.
        let mut bytes = words(unit(9), 4, 7).as_bytes()[1..].to_vec();
        (bytes[0], bytes[1], bytes[5]) = (0x55, 0xAA, 0x11);
        asker.master.receive(ms(given_up - 100), &bytes);
        assert!(asker.master.poll(ms(given_up)).is_some());
        assert_eq!(comes_damaged(&mut asker, given_up + 100, 4), expected, "given up at {given_up} ms");
    }
}

/// That the line was opened anew, or brought one again, says nothing of what broke off before.
#[test]
fn what_broke_off_is_kept_in_mind_when_all_else_is_forgotten() {
    for broke_off in [false, true] {
        let mut asker = patient();
        if broke_off {
            asker.sends(40, unit(8), &read(6), Duration::from_secs(1));
            asker.master.receive(ms(40), &words(unit(8), 6, 7).as_bytes()[..5]);
            assert!(asker.master.poll(ms(50)).is_some());
        }
        comes_damaged_and_right(&mut asker, 60);
        let expected = if broke_off { 3_000 } else { 1_000 };
        for (raw, given_up) in [(1, 100), (2, 500), (3, 1_000)] {
            assert_eq!(comes_damaged(&mut asker, given_up, raw), expected, "unit {raw}");
        }
        assert_eq!(comes_damaged(&mut asker, 2_500, 4), if broke_off { 1_000 } else { 0 });
    }
}

#[test]
fn one_that_comes_again_or_a_line_that_is_opened_anew_begins_the_count_again() {
    let again = |asker: &mut Asker| assert_eq!(asker.hears(2_000, &words(unit(2), 2, 7)), Came::Nothing);
    let opened = |asker: &mut Asker| asker.master.opened(ms(1_000));
    // What came damaged was all, as far as the line had shown; then the right one comes right behind it.
    let behind = |asker: &mut Asker| {
        asker.sends(2_000, unit(9), &read(2), TIMEOUT);
        let mut damaged = words(unit(9), 2, 7).as_bytes().to_vec();
        damaged[5] ^= 0x10;
        asker.master.receive(ms(2_000), &damaged);
        assert!(asker.master.poll(ms(2_001)).is_some());
        assert_eq!(asker.hears(2_003, &words(unit(9), 2, 7)), Came::Nothing);
    };
    let forgets: [&dyn Fn(&mut Asker); 3] = [&again, &opened, &behind];
    for forget in forgets {
        let mut asker = known();
        forget(&mut asker);
        for (raw, given_up) in [(4, 3_000), (5, 3_100), (6, 3_200), (7, 4_199)] {
            assert_eq!(comes_damaged(&mut asker, given_up, raw), 1_000, "unit {raw}");
        }
        assert_eq!(comes_damaged(&mut asker, 4_200, 8), 0);
    }
    // A refusal, another length and another unit's are none of those.
    let mut asker = known();
    for other in [refuses(unit(2), &read(2)), words(unit(2), 3, 7), words(unit(9), 2, 7)] {
        asker.hears(2_000, &other);
    }
    assert_eq!(comes_damaged(&mut asker, 2_100, 4), 0);
}

/// What stands before a whole frame and behind it did not come in a row.
#[test]
fn what_a_frame_stands_between_is_no_answer_that_lost_a_byte() {
    let answer = words(unit(1), 2, 7);
    let other = confirms(unit(9), &Request::write(0x2001, 1000));
    let owed = |left: &[u8]| owed(&mut patient(), 100, 1, left, Duration::from_millis(PAUSE));
    for left in [&answer.as_bytes()[1..], &damaged(1)] {
        assert_eq!(owed(left), 2 * PAUSE, "{left:02X?}");
        let (before, behind) = left.split_at(4);
        assert_eq!(owed(&[before, other.as_bytes(), behind].concat()), 3_000, "{left:02X?}, split");
    }
}
