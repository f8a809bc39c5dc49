//! The master over a scripted line: silence, time-outs, and answers that are not the answer.

use drivebus_rtu::*;

const TIMEOUT: Duration = Duration::from_millis(100);

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn at(micros: u64) -> Instant {
    Instant::from_nanos(micros * 1_000)
}

/// What is counted where only this was.
fn tally(of: impl FnOnce(&mut Tally)) -> Tally {
    let mut tally = Tally::default();
    of(&mut tally);
    tally
}

fn words(unit_address: u8, words: &[u16]) -> Vec<u8> {
    Adu::answer(unit(unit_address), &Answer::read(words).unwrap()).as_bytes().to_vec()
}

/// A master on a 115 200 bit/s line that has sent `request` to unit 1 at 1.75 ms; the request ends at 2.5 ms.
fn waiting(request: &Request<'_>) -> Master {
    let format = SerialFormat::new(115_200, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec).unwrap();
    let mut master = Master::new(&format);
    send(&mut master, 0, request);
    master
}

/// Begins at `now` and has the request leave after the silence. Returns when its last bit is gone.
fn send(master: &mut Master, now: u64, request: &Request<'_>) -> u64 {
    master.begin(at(now), unit(1).into(), request, TIMEOUT).unwrap();
    let go = master.deadline().unwrap();
    assert!(matches!(master.poll(go), Some(Event::Transmit(_))), "silence is over at the deadline");
    let end = go.as_nanos() / 1_000 + 750;
    master.sent(at(end));
    end
}

#[test]
fn nothing_is_sent_before_the_silence_is_over() {
    let mut master = Master::with_silence(Duration::from_micros(1_750));
    let request = Request::read(0x2100, 1).unwrap();
    master.begin(at(100), unit(1).into(), &request, TIMEOUT).unwrap();
    assert_eq!(master.poll(at(1_849)), None, "a line never watched may be busy");
    master.receive(at(1_849), &[0x55]);
    assert_eq!(master.deadline(), Some(at(3_599)), "counted from the last byte seen");
    assert_eq!(master.poll(at(3_598)), None);
    let wire = [0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36];
    assert_eq!(master.poll(at(3_599)), Some(Event::Transmit(&wire)));
    assert_eq!(master.take_tally(), tally(|tally| tally.noise = 1));
}

#[test]
fn a_line_that_is_never_silent_is_given_up_with_nothing_sent() {
    let mut master = Master::with_silence(Duration::from_millis(2));
    master.begin(at(0), unit(1).into(), &Request::write(0x2000, 1), TIMEOUT).unwrap();
    for millis in 1..102 {
        master.receive(at(millis * 1_000), &[0]);
        assert_eq!(master.poll(at(millis * 1_000)), None);
    }
    assert_eq!(master.poll(at(102_000)), Some(Event::Busy));
    assert!(!master.in_quarantine(at(200_000), unit(1)));
}

#[test]
fn the_answer_is_there_at_its_last_byte() {
    let mut master = waiting(&Request::read(0x2100, 1).unwrap());
    let answer = words(1, &[3]);
    for (index, byte) in answer.iter().enumerate() {
        let now = at(5_000 + 95 * index as u64);
        assert_eq!(master.poll(now), None);
        master.receive(now, &[*byte]);
    }
    let Some(Event::Answer(Answer::Read { words, .. })) = master.poll(at(5_570)) else { panic!("an answer") };
    assert_eq!(words, Words::new(&[3]));
}

#[test]
fn a_refusal_is_there_at_its_last_byte() {
    let mut master = waiting(&Request::write(1, 3));
    master.receive(at(5_000), &[0x01, 0x86, 0x04, 0x43, 0xA3]);
    assert_eq!(master.poll(at(5_000)), Some(Event::Answer(Answer::exception(6, ExceptionCode::DEVICE_FAILURE))));
    assert!(!master.in_quarantine(at(200_000), unit(1)));
}

/// Refusals of reads are all alike: the one that comes for a read that its length tells apart may be meant for what is open.
/// It ends the read, which is owed then, and proves nothing.
#[test]
fn a_refusal_proves_nothing_of_a_read_of_another_length() {
    let mut master = waiting(&Request::read(0x2100, 1).unwrap());
    assert!(matches!(master.poll(at(110_000)), Some(Event::NoAnswer { .. })));
    let end = send(&mut master, 200_000, &Request::read(0x2200, 2).unwrap());
    let refusal = Adu::answer(unit(1), &Answer::exception(3, ExceptionCode::ILLEGAL_ADDRESS));
    master.receive(at(end + 2_000), refusal.as_bytes());
    let error = AnswerError::Refusal { code: ExceptionCode::ILLEGAL_ADDRESS };
    assert!(matches!(master.poll(at(end + 2_000)), Some(Event::Wrong { error: came, .. }) if came == error));
    assert!(master.in_quarantine(at(end + 9_000), unit(1)));
    let next = Request::read(0x2300, 2).unwrap();
    assert!(!master.tells_apart(at(end + 9_000), unit(1), &next), "its own answer may still come");
}

/// An answer that is open and comes is not owed any more: nothing has to be sent to end that doubt.
#[test]
fn an_open_answer_that_is_seen_is_owed_no_more() {
    let read = Request::read(0x2100, 1).unwrap();
    let mut master = waiting(&read);
    assert!(matches!(master.poll(at(110_000)), Some(Event::NoAnswer { .. })));
    assert_eq!(master.attribution(at(110_000), unit(1), &read), Attribution::Repeat { words: 2, refusal: 2 });
    master.receive(at(150_000), &words(1, &[3]));
    assert_eq!(master.poll(at(150_000)), None);
    assert!(!master.in_quarantine(at(150_000), unit(1)));
    assert_eq!(master.attribution(at(150_000), unit(1), &read), Attribution::Certain);
}

/// A master that has asked `read` twice; both answers are open.
fn asked_twice_in_vain(read: &Request<'_>) -> Master {
    let mut master = waiting(read);
    assert!(matches!(master.poll(at(110_000)), Some(Event::NoAnswer { .. })));
    master.begin_in_doubt(at(110_000), unit(1).into(), read, TIMEOUT).unwrap();
    assert!(matches!(master.poll(at(110_000)), Some(Event::Transmit(_))));
    master.sent(at(111_000));
    assert!(matches!(master.poll(at(220_000)), Some(Event::NoAnswer { .. })));
    master
}

/// The line may bring a frame twice at once: of two open answers only one is seen by that.
#[test]
fn a_frame_that_comes_twice_is_one_answer() {
    let read = Request::read(0x2100, 1).unwrap();
    let mut master = asked_twice_in_vain(&read);
    for at_ in [230_000, 230_100] {
        master.receive(at(at_), &words(1, &[3]));
        assert_eq!(master.poll(at(at_)), None);
    }
    assert!(master.in_quarantine(at(230_100), unit(1)));
    assert_eq!(master.attribution(at(230_100), unit(1), &read), Attribution::Repeat { words: 2, refusal: 2 });
}

/// After a silence the same bytes are another answer: that of a question that was put twice.
#[test]
fn the_same_frame_after_a_silence_is_another_answer() {
    let read = Request::read(0x2100, 1).unwrap();
    let mut master = asked_twice_in_vain(&read);
    // Seven characters and the silence: 2.4 ms at 115 200 bit/s.
    for at_ in [230_000, 233_000] {
        master.receive(at(at_), &words(1, &[3]));
        assert_eq!(master.poll(at(at_)), None);
    }
    assert!(!master.in_quarantine(at(233_000), unit(1)));
    assert_eq!(master.attribution(at(233_000), unit(1), &read), Attribution::Certain);
}

/// A write looks like its own confirmation: what an adapter has sent back is no answer that was seen.
#[test]
fn an_open_write_is_not_seen_by_what_may_be_its_own_echo() {
    let write = Request::write(0x2000, 5);
    let mut master = waiting(&write);
    assert!(matches!(master.poll(at(110_000)), Some(Event::NoAnswer { .. })));
    master.receive(at(150_000), Adu::request(unit(1).into(), &write).as_bytes());
    assert_eq!(master.poll(at(150_000)), None);
    assert!(master.in_quarantine(at(150_000), unit(1)));
    assert_eq!(master.attribution(at(150_000), unit(1), &write), Attribution::Wait(at(110_000) + OVERTAKING));
}

/// A long time-out makes late answers later.
#[test]
fn an_answer_may_overtake_for_four_time_outs_at_least() {
    let read = Request::read(0x2100, 1).unwrap();
    let mut master = Master::new(&SerialFormat::DEFAULT);
    let timeout = Duration::from_secs(2);
    master.begin(at(10_000), unit(1).into(), &read, timeout).unwrap();
    assert!(matches!(master.poll(at(20_000)), Some(Event::Transmit(_))));
    master.sent(at(20_000));
    let given_up = at(20_000) + timeout;
    assert!(matches!(master.poll(given_up), Some(Event::NoAnswer { .. })));
    assert!(master.attribution(given_up + Duration::from_millis(7_999), unit(1), &read).may_be_mistaken());
    assert!(!master.attribution(given_up + Duration::from_secs(8), unit(1), &read).may_be_mistaken());
}

#[test]
fn strangers_do_not_stop_the_clock() {
    let mut master = waiting(&Request::read(0x2100, 1).unwrap());
    master.receive(at(4_000), &words(2, &[7]));
    assert_eq!(master.poll(at(4_000)), None, "another unit");
    let foreign = Adu::answer(unit(1), &Answer::custom(&[0x04, 2, 0, 7]).unwrap());
    master.receive(at(8_000), foreign.as_bytes());
    assert_eq!(master.poll(at(8_000)), None, "another function");
    master.receive(at(12_000), &words(1, &[3]));
    assert!(matches!(master.poll(at(12_000)), Some(Event::Answer(Answer::Read { .. }))));
    assert_eq!(master.take_tally().foreign, 2);
}

#[test]
fn a_whole_frame_that_cannot_be_right_is_wrong_at_once() {
    let mut master = waiting(&Request::read(0x2100, 4).unwrap());
    let short = words(1, &[3]);
    master.receive(at(5_000), &short);
    assert_eq!(
        master.poll(at(5_000)),
        Some(Event::Wrong { error: AnswerError::Count { asked: 4, came: 1 }, frame: &short })
    );
    assert!(master.in_quarantine(at(200_000), unit(1)));

    let mut master = waiting(&Request::write(0x2001, 1000));
    let other = Adu::request(unit(1).into(), &Request::write(0x2001, 999));
    master.receive(at(5_000), other.as_bytes());
    assert!(matches!(master.poll(at(5_000)), Some(Event::Wrong { error: AnswerError::Echo { .. }, .. })));
}

/// Eight bytes are the length of a request, and of most answers; these eight are the beginning of a longer one.
#[test]
fn a_beginning_with_a_right_crc_by_chance_is_not_the_answer() {
    let mut words_sent = [0x1234, 0x5600, 0, 9, 9, 9];
    let crc = crc16(&[0x01, 0x03, 0x0C, 0x12, 0x34, 0x56]).to_le_bytes();
    words_sent[1] |= u16::from(crc[0]);
    words_sent[2] = u16::from(crc[1]) << 8;
    let answer = words(1, &words_sent);
    assert!(Frame::parse(&answer[..8]).is_ok());

    let mut master = waiting(&Request::read(0x3000, 6).unwrap());
    for (index, byte) in answer.iter().enumerate() {
        assert_eq!(master.poll(at(5_000)), None, "after {index} bytes");
        master.receive(at(5_000), &[*byte]);
    }
    let Some(Event::Answer(Answer::Read { words, .. })) = master.poll(at(5_000)) else { panic!("an answer") };
    assert_eq!(words, Words::new(&words_sent));
}

#[test]
fn a_corrupt_answer_is_told_when_silence_shows_that_nothing_follows() {
    let mut master = waiting(&Request::read(0x2100, 1).unwrap());
    let mut bytes = words(1, &[3]);
    bytes[3] ^= 0x10;
    master.receive(at(5_000), &bytes);
    assert_eq!(master.poll(at(6_749)), None);
    assert!(matches!(master.poll(at(6_750)), Some(Event::Corrupt { error: FrameError::Crc { .. }, .. })));
    assert!(master.in_quarantine(at(200_000), unit(1)));
}

#[test]
fn a_beginning_of_an_answer_is_handed_over_when_the_time_is_over() {
    let mut master = waiting(&Request::read(0x2100, 4).unwrap());
    let bytes = words(1, &[1, 2, 3, 4]);
    master.receive(at(5_000), &bytes[..6]);
    assert_eq!(master.poll(at(102_499)), None);
    assert_eq!(master.poll(at(102_500)), Some(Event::NoAnswer { bytes: &bytes[..6] }));
}

/// The first row of every comparison: the reply to register 100 arrives while register 200 is read.
#[test]
fn a_late_answer_is_never_the_answer_to_another_request() {
    let mut master = waiting(&Request::read(100, 1).unwrap());
    assert!(matches!(master.poll(at(102_500)), Some(Event::NoAnswer { .. })));
    let read = Request::read(200, 1).unwrap();
    assert_eq!(
        master.begin(at(102_500), unit(1).into(), &read, TIMEOUT),
        Err(BeginError::Quarantine { unit: unit(1) })
    );
    let end = send(&mut master, 102_500, &Request::echo(0xBEEF));
    master.receive(at(end + 2_000), &words(1, &[100]));
    assert_eq!(master.poll(at(end + 2_000)), None, "the late answer");
    let echo = Adu::answer(unit(1), &Answer::confirming(&Request::echo(0xBEEF)).unwrap());
    master.receive(at(end + 5_000), echo.as_bytes());
    assert!(matches!(master.poll(at(end + 5_000)), Some(Event::Answer(Answer::Echo { .. }))));
    assert_eq!(master.take_tally().late, 1);

    let end = send(&mut master, end + 5_000, &read);
    master.receive(at(end + 2_000), &words(1, &[200]));
    let Some(Event::Answer(Answer::Read { words, .. })) = master.poll(at(end + 2_000)) else { panic!("an answer") };
    assert_eq!(words, Words::new(&[200]));
}

#[test]
fn only_the_fresh_word_ends_the_quarantine() {
    let mut master = waiting(&Request::read(0, 1).unwrap());
    assert!(matches!(master.poll(at(102_500)), Some(Event::NoAnswer { .. })));
    let end = send(&mut master, 102_500, &Request::echo(1)) + 100_000;
    assert!(matches!(master.poll(at(end)), Some(Event::NoAnswer { .. })));
    let end = send(&mut master, end, &Request::echo(2));
    for (word, over) in [(1, false), (2, true)] {
        let echo = Adu::answer(unit(1), &Answer::confirming(&Request::echo(word)).unwrap());
        master.receive(at(end + 2_000), echo.as_bytes());
        assert_eq!(master.poll(at(end + 2_000)).is_some(), over);
        assert_eq!(master.in_quarantine(at(400_000), unit(1)), !over);
    }
}

#[test]
fn a_stop_goes_out_whatever_else_is_in_doubt() {
    let mut master = waiting(&Request::read(100, 1).unwrap());
    assert!(matches!(master.poll(at(102_500)), Some(Event::NoAnswer { .. })));
    let stop = Request::write(0x2000, 5);
    master.begin_in_doubt(at(102_500), unit(1).into(), &stop, TIMEOUT).unwrap();
    assert!(matches!(master.poll(at(102_500)), Some(Event::Transmit(_))));
    master.sent(at(103_250));
    master.receive(at(105_000), &words(1, &[100]));
    assert_eq!(master.poll(at(105_000)), None, "the late answer to the read");
    master.receive(at(110_000), Adu::request(unit(1).into(), &stop).as_bytes());
    assert!(matches!(master.poll(at(110_000)), Some(Event::Answer(Answer::WriteSingle { .. }))));
    assert!(!master.in_quarantine(at(200_000), unit(1)), "nothing else was owed");
}

#[test]
fn a_stop_that_an_earlier_one_may_have_confirmed_leaves_the_doubt() {
    let stop = Request::write(0x2000, 5);
    let mut master = waiting(&stop);
    assert!(matches!(master.poll(at(102_500)), Some(Event::NoAnswer { .. })));
    master.begin_in_doubt(at(102_500), unit(1).into(), &stop, TIMEOUT).unwrap();
    assert!(matches!(master.poll(at(102_500)), Some(Event::Transmit(_))));
    master.sent(at(103_250));
    master.receive(at(110_000), Adu::request(unit(1).into(), &stop).as_bytes());
    assert!(matches!(master.poll(at(110_000)), Some(Event::Answer(Answer::WriteSingle { .. }))));
    assert!(master.in_quarantine(at(200_000), unit(1)), "it may have been the answer to the earlier stop");
}

#[test]
fn giving_up_a_request_that_went_out_is_remembered() {
    let mut master = waiting(&Request::read(0, 1).unwrap());
    assert!(master.abort(at(10_000)));
    assert!(master.in_quarantine(at(200_000), unit(1)));
    assert!(!master.in_quarantine(at(200_000), unit(2)));
    master.begin(at(10_000), unit(2).into(), &Request::read(0, 1).unwrap(), TIMEOUT).unwrap();
    assert!(!master.abort(at(10_000)), "nothing had been sent");
    assert!(!master.in_quarantine(at(200_000), unit(2)));
}

#[test]
fn a_broadcast_ends_with_the_turnaround_delay() {
    let mut master = Master::new(&SerialFormat::DEFAULT);
    assert_eq!(
        master.begin(at(0), Destination::Broadcast, &Request::read(0, 1).unwrap(), TURNAROUND),
        Err(BeginError::BroadcastRead)
    );
    master.begin(at(0), Destination::Broadcast, &Request::write(0x2000, 5), TURNAROUND).unwrap();
    assert!(matches!(master.poll(at(3_000)), Some(Event::Transmit(_))));
    master.sent(at(8_000));
    assert_eq!(master.deadline(), Some(at(108_000)));
    assert_eq!(master.poll(at(107_999)), None);
    assert_eq!(master.poll(at(108_000)), Some(Event::BroadcastDone));
}

#[test]
fn the_adapters_own_echo_is_seen_and_then_taken_off() {
    // A read of 16 words from 2000H: its echo begins like its answer.
    let request = Request::read(0x2000, 16).unwrap();
    let own = Adu::request(unit(1).into(), &request);
    let mut master = waiting(&request);
    master.receive(at(2_500), own.as_bytes());
    assert_eq!(master.poll(at(2_500)), None);
    master.receive(at(6_000), &words(1, &[9; 16]));
    assert!(matches!(master.poll(at(6_000)), Some(Event::Answer(Answer::Read { .. }))));
    assert_eq!(master.take_tally(), tally(|tally| tally.own_echo = 1));

    master.strip_echo(true);
    let write = Request::write(0x2001, 1000);
    let own = Adu::request(unit(1).into(), &write);
    let end = send(&mut master, 10_000, &write);
    master.receive(at(end), own.as_bytes());
    assert_eq!(master.poll(at(end)), None, "the echo is not the confirmation");
    master.receive(at(end + 3_000), own.as_bytes());
    assert!(matches!(master.poll(at(end + 3_000)), Some(Event::Answer(Answer::WriteSingle { .. }))));
}

#[test]
fn a_glitch_does_not_hide_the_adapters_echo() {
    let write = Request::write(0x2001, 1000);
    let own = Adu::request(unit(1).into(), &write);
    let mut master = Master::with_silence(Duration::from_micros(1_750));
    master.strip_echo(true);
    let end = send(&mut master, 0, &write);
    master.receive(at(end), &[&[0x00], own.as_bytes()].concat());
    assert_eq!(master.poll(at(end)), None, "the echo is not the confirmation");
    master.receive(at(end + 3_000), own.as_bytes());
    assert!(matches!(master.poll(at(end + 3_000)), Some(Event::Answer(Answer::WriteSingle { .. }))));
    let expected = tally(|tally| (tally.own_echo, tally.noise, tally.noise_idle) = (1, 1, 1));
    assert_eq!(master.take_tally(), expected);
}

#[test]
fn a_line_that_is_opened_anew_owes_what_the_old_one_did() {
    let mut master = waiting(&Request::read(0x2100, 1).unwrap());
    master.opened(at(20_000));
    assert!(master.in_quarantine(at(1_500_000), unit(1)));
    master.begin(at(20_000), unit(2).into(), &Request::echo(7), TIMEOUT).unwrap();
    assert_eq!(master.poll(at(21_749)), None, "nobody knows what was on the line before");
    assert!(matches!(master.poll(at(21_750)), Some(Event::Transmit(_))));
}

/// Two bytes of noise that are those of the answer's beginning.
#[test]
fn a_false_beginning_does_not_hide_the_answer() {
    let mut master = waiting(&Request::read(0x2100, 1).unwrap());
    master.receive(at(5_000), &[&[0x01, 0x03], words(1, &[3]).as_slice()].concat());
    assert!(matches!(master.poll(at(5_000)), Some(Event::Answer(Answer::Read { .. }))));
    assert_eq!(master.take_tally().noise, 2);
}

/// A unit that returns echoes owes its answer until it has returned one; any other may keep it for itself in the end.
#[test]
fn time_ends_the_doubt_only_about_a_unit_that_returns_no_echo() {
    for echoes in [false, true] {
        let mut master = waiting(&Request::echo(0x1234));
        if echoes {
            master.receive(
                at(5_000),
                Adu::answer(unit(1), &Answer::confirming(&Request::echo(0x1234)).unwrap()).as_bytes(),
            );
            assert!(matches!(master.poll(at(5_000)), Some(Event::Answer(Answer::Echo { .. }))));
        } else {
            assert!(matches!(master.poll(at(110_000)), Some(Event::NoAnswer { .. })));
        }
        let end = send(&mut master, 200_000, &Request::read(0x2100, 1).unwrap());
        let given_up = at(end) + TIMEOUT;
        assert!(matches!(master.poll(given_up), Some(Event::NoAnswer { .. })));
        assert!(master.in_quarantine(given_up + PATIENCE.saturating_sub(Duration::from_nanos(1)), unit(1)));
        assert_eq!(master.in_quarantine(given_up + PATIENCE, unit(1)), echoes);
    }
}

/// Every cut of what may come after a request: what is said to be lacking is never more than what does, or the answer
/// would be looked for too late.
#[test]
fn what_an_answer_lacks_is_never_overstated() {
    let read = Request::read(0x3000, 16).unwrap();
    let one = Request::read(0x0300, 1).unwrap();
    let write = Request::write(0x2001, 0x1388);
    let echo = |request: &Request<'_>| Adu::request(unit(1).into(), request).as_bytes().to_vec();
    let answer = |answer: Answer<'_>| Adu::answer(unit(1), &answer).as_bytes().to_vec();
    let sixteen = words(1, &[7; 16]);
    let refusal = answer(Answer::exception(3, ExceptionCode::ILLEGAL_ADDRESS));
    let cases = [
        (&read, sixteen.clone()),
        (&read, refusal.clone()),
        (&read, [echo(&read), sixteen.clone()].concat()),
        (&one, words(1, &[7])),
        (&one, [echo(&one), refusal.clone()].concat()),
        (&write, answer(Answer::confirming(&write).unwrap())),
        (&write, answer(Answer::exception(6, ExceptionCode::ILLEGAL_VALUE))),
    ];
    for (request, bytes) in cases {
        for strips in [false, true] {
            let mut master = waiting(request);
            master.strip_echo(strips);
            for (count, &byte) in bytes.iter().enumerate() {
                let now = at(100_000 + 573 * count as u64);
                let left = bytes.len() - count;
                assert!(master.lacks() <= left, "{request:?}: {} of {left} at {count} of {bytes:02X?}", master.lacks());
                assert_eq!(master.receive(now, &[byte]), 1);
                if master.poll(now).is_some() {
                    break;
                }
                // Silence that has told nothing is no reason to look again, or the caller would spin.
                let (mut later, then) = (master.clone(), now + Duration::from_millis(10));
                assert!(later.poll(then).is_some() || later.deadline() > Some(then), "{count} of {bytes:02X?}");
            }
        }
    }
    // And it says enough to be of use: of 37 bytes, not each is looked for.
    let mut master = waiting(&read);
    let _ = master.receive(at(100_000), &sixteen[..4]);
    assert!(master.poll(at(100_000)).is_none());
    assert_eq!(master.lacks(), 33);
    assert_eq!(waiting(&read).lacks(), 0, "nothing has begun");
}

const PATIENCE_OF_10_MS: Patience = Patience::new(Duration::from_millis(10), Duration::from_millis(5));

/// As [`waiting`], with patience.
fn waiting_patiently(request: &Request<'_>) -> Master {
    let mut master = Master::with_silence(Duration::from_micros(1_750));
    master.be_patient(Some(PATIENCE_OF_10_MS));
    send(&mut master, 0, request);
    master
}

/// Whole, and in lumps with a silence between them.
#[test]
fn an_answer_without_one_of_its_bytes_is_corrupt_before_the_time_is_over() {
    let request = Request::read(0x2100, 4).unwrap();
    let whole = words(1, &[0x1234, 0x5678, 0x9ABC, 0xDEF0]);
    for (lost, lump) in (0..whole.len()).flat_map(|lost| [(lost, 1), (lost, 3), (lost, 12)]) {
        let mut bytes = whole.clone();
        bytes.remove(lost);
        let mut master = waiting_patiently(&request);
        let mut now = 9_000;
        for part in bytes.chunks(lump) {
            now += 3_000;
            assert_eq!(master.poll(at(now)), None, "without {lost}, by {lump}");
            master.receive(at(now), part);
        }
        assert_eq!(master.poll(at(now + 9_999)), None, "without {lost}, by {lump}");
        match master.poll(at(now + 10_000)) {
            Some(Event::Corrupt { bytes: came, .. }) => assert_eq!(came, bytes, "without {lost}, by {lump}"),
            other => panic!("without {lost}, by {lump}: {other:?}"),
        }
        let is_owed = |millis: u64| master.attribution(at(1_000 * millis), unit(1), &request).may_be_mistaken();
        assert!(is_owed(200) && !is_owed(300), "it may come again, for two time-outs");
    }
}

#[test]
fn the_right_answer_behind_one_that_cannot_be_is_taken() {
    let request = Request::read(0x2100, 1).unwrap();
    let mut damaged = words(1, &[3]);
    damaged[3] ^= 0x10;
    for spoilt in [damaged, words(1, &[3, 3])] {
        let mut master = waiting_patiently(&request);
        master.receive(at(9_000), &spoilt);
        assert_eq!(master.poll(at(14_000)), None);
        let mut given_up = master.clone();
        master.receive(at(14_000), &words(1, &[3]));
        assert!(matches!(master.poll(at(14_000)), Some(Event::Answer(Answer::Read { .. }))), "{spoilt:02X?}");
        assert!(!master.in_quarantine(at(15_000), unit(1)));
        assert_eq!(given_up.deadline(), Some(at(19_000)));
        assert_eq!(given_up.poll(at(18_999)), None);
        match given_up.poll(at(19_000)) {
            Some(Event::Corrupt { bytes, .. } | Event::Wrong { frame: bytes, .. }) => assert_eq!(bytes, spoilt),
            other => panic!("{other:?}"),
        }
        assert!(
            given_up.in_quarantine(at(20_000), unit(1))
                || matches!(given_up.attribution(at(20_000), unit(1), &request), Attribution::Repeat { words: 2, .. })
        );
    }
}

/// A line on which every answer comes damaged, once: [`ask`](Self::ask) reads, and says whether the answer is still owed
/// afterwards.
struct Damaging {
    master: Master,
    /// In microseconds.
    now: u64,
}

impl Damaging {
    const READ: [u16; 2] = [0x2100, 2];

    fn request() -> Request<'static> {
        Request::read(Self::READ[0], Self::READ[1]).unwrap()
    }

    fn new() -> Self {
        let mut master = Master::with_silence(Duration::from_micros(1_750));
        master.be_patient(Some(PATIENCE_OF_10_MS));
        Self { master, now: 0 }
    }

    fn ask(&mut self, came: &[u8]) -> bool {
        self.master.begin_in_doubt(at(self.now), unit(1).into(), &Self::request(), Duration::from_millis(100)).unwrap();
        self.now += 2_000;
        assert!(matches!(self.master.poll(at(self.now)), Some(Event::Transmit(_))));
        self.now += 8_000;
        self.master.sent(at(self.now));
        self.master.receive(at(self.now + 6_000), came);
        self.now += 100_000;
        let event = self.master.poll(at(self.now));
        assert!(matches!(event, Some(Event::Corrupt { .. } | Event::NoAnswer { .. })), "{event:?}");
        self.master.attribution(at(self.now), unit(1), &Self::request()).may_be_mistaken()
    }

    fn pass(&mut self, millis: u64) {
        self.now += 1_000 * millis;
    }

    fn stray(&mut self, frame: &[u8]) {
        self.now += 20_000;
        self.master.receive(at(self.now), frame);
        self.master.poll(at(self.now + 5_000));
        self.now += 5_000;
    }

    /// What a damaged answer is known by: three of them, and a second.
    fn known() -> Self {
        let mut line = Self::new();
        assert!((0..3).all(|_| line.ask(&damaged())), "nothing is known yet");
        line.pass(900);
        line
    }
}

fn damaged() -> Vec<u8> {
    let mut bytes = words(1, &[3, 4]);
    bytes.remove(5);
    bytes
}

#[test]
fn damaged_answers_that_never_come_again_are_owed_no_more() {
    assert!(!Damaging::known().ask(&damaged()));
    let mut early = Damaging::new();
    assert!((0..4).all(|_| early.ask(&damaged())), "within two time-outs after the third they may all come again");
    assert!((0..4).all(|_| !early.ask(&damaged())), "none did, and the first three are not expected any more");
    for lost in 0..9 {
        let mut bytes = words(1, &[3, 4]);
        bytes.remove(lost);
        assert!(!Damaging::known().ask(&bytes), "without {lost}");
        if lost > 3 {
            bytes.remove(lost - 1);
            assert!(!Damaging::known().ask(&bytes), "without {lost} and the one before");
        }
    }
}

#[test]
fn what_is_not_told_for_the_answer_leaves_it_owed() {
    let whole = words(1, &[3, 4]);
    let cases: [(&str, &[u8]); 6] = [
        ("nothing", &[]),
        ("noise", &[0x55; 9]),
        ("the beginning of it", &whole[..6]),
        ("another unit's and function's", &[&[2, 4][..], &damaged()[2..]].concat()),
        ("another function's and length's", &[&[1, 5, 6][..], &damaged()[3..]].concat()),
        ("one byte too many", &[&whole[..6], &[0x55, 0x55], &whole[7..]].concat()),
    ];
    for (name, came) in cases {
        assert!(Damaging::known().ask(came), "{name}");
    }
}

/// One character of its beginning may be damaged, and any behind: nothing else is owed that could look so.
#[test]
fn an_answer_is_told_by_its_place_and_length_where_no_other_is_open() {
    let whole = words(1, &[3, 4]);
    for place in 0..whole.len() {
        let mut turned = whole.clone();
        turned[place] ^= 0x40;
        turned[6] ^= 0x10;
        assert!(!Damaging::known().ask(&turned), "{place} is turned over");
    }
    // With the right beginning the CRC agrees, however much of it is lost.
    for lost in 1..=3 {
        assert!(!Damaging::known().ask(&whole[lost..]), "the first {lost} are lost");
    }
}

/// What is as long, or longer and cut short, and begins like that may be it.
#[test]
fn a_damaged_answer_that_could_be_another_is_not_told() {
    let mut turned = words(1, &[3, 4]);
    turned[2] = 6;
    for (other, is_owed) in [(3, true), (9, false)] {
        let mut line = Damaging::known();
        let read = Request::read(0x2200, other).unwrap();
        line.master.still_owed(at(line.now), unit(1), &read, Duration::from_millis(100));
        assert_eq!(line.ask(&turned), is_owed, "{other} words are owed");
    }
}

/// The rest of what broke off looks like the end of an answer when it comes behind the beginning of another.
#[test]
fn for_three_seconds_after_something_broke_off_no_damaged_answer_is_believed_to_be_all() {
    for (after, is_owed) in [(2_800, true), (3_300, false)] {
        let mut line = Damaging::known();
        line.ask(&words(1, &[3, 4])[..5]);
        line.pass(after);
        assert_eq!(line.ask(&damaged()), is_owed, "{after} ms");
    }
}

#[test]
fn a_damaged_answer_that_comes_again_says_that_the_next_may_too() {
    let mut line = Damaging::known();
    assert!(!line.ask(&damaged()));
    line.stray(&words(1, &[3, 4]));
    assert!(line.ask(&damaged()) && line.ask(&damaged()) && line.ask(&damaged()));
    line.pass(1_000);
    assert!(!line.ask(&damaged()));
    line.stray(&words(1, &[3, 4, 5]));
    assert!(!line.ask(&damaged()), "that was no answer to this");
}

/// What looks damaged before the unit usually answers may be noise.
#[test]
fn before_its_usual_time_a_unit_is_not_given_up() {
    let mut master = Master::with_silence(Duration::from_micros(1_750));
    let (pause, usual) = (Duration::from_millis(5), Duration::from_millis(30));
    master.be_patient(Some(Patience::new(pause, usual)));
    let end = send(&mut master, 0, &Request::read(0x2100, 1).unwrap());
    master.receive(at(end + 100), &[0x01, 0x03, 0x02, 0x55]);
    assert_eq!(master.poll(at(end + 29_999)), None);
    let mut given_up = master.clone();
    assert!(matches!(given_up.poll(at(end + 30_000)), Some(Event::Corrupt { .. })));
    master.receive(at(end + 29_999), &words(1, &[3]));
    assert!(matches!(master.poll(at(end + 29_999)), Some(Event::Answer(Answer::Read { .. }))));
}
