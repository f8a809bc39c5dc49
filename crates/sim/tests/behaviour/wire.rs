//! The wire: times, silence, collisions, faults, trace.

use std::time::Duration;

use drivebus_line::Line;
use drivebus_rtu::Instant;
use drivebus_sim::{Options, Side, Simulator};

use crate::bench::{Bench, framed, hex, pdu};

/// 19 200 bit/s 8E1, by hand: 11 bits, 3.5 × 11 bits, rounded up.
const T35: u64 = 2_005_209;
/// n × 11 bits at 19 200 bit/s, rounded up.
const CHAR_1: u64 = 572_917;
const CHARS_7: u64 = 4_010_417;
const CHARS_8: u64 = 4_583_334;
/// P14.03 from the factory.
const RESPONSE_DELAY: u64 = 5_000_000;

fn at(nanos: u64) -> Instant {
    Instant::from_nanos(nanos)
}

fn read_identification() -> Vec<u8> {
    framed(1, &pdu(0x03, &[0x2103, 1]))
}

#[test]
fn every_character_takes_its_time() {
    let mut bench = Bench::new();
    assert_eq!(bench.line.send(&read_identification()).unwrap(), at(CHARS_8));
    let heard = bench.listen(at(1_000_000_000));
    let begin = CHARS_8 + T35 + RESPONSE_DELAY;
    assert_eq!(heard.len(), 7);
    assert_eq!(heard[0], (at(begin + CHAR_1), 0x01));
    assert_eq!(heard[6].0, at(begin + CHARS_7));
    assert_eq!(
        bench.simulator.wire().trace().iter().map(|sent| (sent.begin, sent.side)).collect::<Vec<_>>(),
        [(at(0), Side::Master), (at(begin), Side::Unit)]
    );
}

#[test]
fn the_response_delay_is_a_parameter() {
    let mut bench = Bench::new();
    bench.write(0x0E03, 0);
    bench.line.sleep(at(1_000_000_000));
    bench.line.send(&read_identification()).unwrap();
    let heard = bench.listen(at(2_000_000_000));
    assert_eq!(heard[6].0, at(1_000_000_000 + CHARS_8 + T35 + CHARS_7));
}

#[test]
fn two_pieces_without_a_gap_are_one_frame_and_later_ones_join_until_silence() {
    let mut bench = Bench::new();
    let frame = read_identification();
    // 3 characters end at 1 718 750 ns; the second piece is handed over while the first is still on its way.
    bench.line.send(&frame[..3]).unwrap();
    bench.line.sleep(at(1_000_000));
    assert_eq!(bench.line.send(&frame[3..6]).unwrap(), at(1_718_750 + 1_718_750));
    // The third piece comes one nanosecond before silence would end the frame.
    bench.line.sleep(at(1_718_750 + 1_718_750 + T35 - 1));
    bench.line.send(&frame[6..]).unwrap();
    assert_eq!(bench.listen(at(1_000_000_000)).len(), 7);
    assert_eq!((bench.simulator.wire().requests(), bench.simulator.wire().silence_violations()), (1, 0));

    let now = bench.line.now();
    bench.line.send(&frame[..3]).unwrap();
    bench.line.sleep(now + Duration::from_nanos(1_718_750 + T35));
    bench.line.send(&frame[3..]).unwrap();
    assert_eq!(bench.listen(at(2_000_000_000)), [], "silence cut the frame in two");
}

#[test]
fn a_request_within_the_silence_is_counted_and_by_strict_units_ignored() {
    for (strict, gap, violations, answer_length) in
        [(false, T35, 0, 7), (false, T35 - 1, 1, 7), (true, T35, 0, 7), (true, T35 - 1, 1, 0), (true, 0, 1, 0)]
    {
        let mut bench = Bench::with(Options::default().strict_silence(strict));
        let last = at(CHARS_8 + T35 + RESPONSE_DELAY + CHARS_7);
        bench.line.send(&read_identification()).unwrap();
        bench.line.sleep(last);
        assert_eq!(bench.line.receive(&mut [0; 16], last).unwrap(), 7);
        bench.line.sleep(last + Duration::from_nanos(gap));
        let sent = bench.line.send(&read_identification()).unwrap();
        let answer = bench.listen(sent + Duration::from_secs(1));
        let wire = bench.simulator.wire();
        assert_eq!((wire.requests(), wire.silence_violations()), (2, violations), "strict {strict}, gap {gap}");
        assert_eq!(answer.len(), answer_length, "strict {strict}, gap {gap}");
    }
}

#[test]
fn a_request_glued_to_the_one_before_is_a_violation() {
    let first = framed(3, &pdu(0x06, &[0x0E03, 0]));
    for (strict, answered) in [(false, true), (true, false)] {
        let mut bench = Bench::with(Options::default().strict_silence(strict));
        let broadcast = framed(0, &pdu(0x06, &[0x0E03, 0]));
        let end = bench.line.send(&broadcast).unwrap();
        bench.line.sleep(end + Duration::from_nanos(T35 / 2));
        bench.line.send(&first).unwrap();
        let answer: Vec<u8> = bench.listen(at(1_000_000_000)).into_iter().map(|(_, byte)| byte).collect();
        assert_eq!(answer == first, answered, "strict {strict}");
        assert_eq!(bench.simulator.wire().silence_violations(), 1);
    }
}

#[test]
fn only_right_frames_for_this_unit_are_answered() {
    let mut bench = Bench::new();
    let good = read_identification();
    for bit in 0..good.len() * 8 {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(bench.exchange(&bad), [], "bit {bit}");
    }
    assert_eq!(bench.exchange(&framed(2, &pdu(0x03, &[0x2103, 1]))), [], "there is no unit 2");
    assert_eq!(bench.exchange(&framed(248, &pdu(0x03, &[0x2103, 1]))), [], "a reserved address");
    assert_eq!(bench.exchange(&framed(1, &[0x83, 0x02])), [], "an exception is no request");
    assert_eq!(bench.exchange(&[0x55; 600]), [], "a babbling master");
    assert_eq!(bench.exchange(&good), hex("01 03 02 01 A0 B9 AC"));
}

#[test]
fn everybody_acts_on_a_broadcast_and_nobody_answers() {
    let mut bench = Bench::new();
    assert_eq!(bench.exchange(&framed(0, &pdu(0x06, &[0x000B, 123]))), []);
    for unit in [1, 3] {
        assert_eq!(bench.simulator.drive(unit).unwrap().register(0x000B), Ok(123));
    }
}

#[test]
fn faults_spoil_the_answers_they_were_meant_for() {
    let mut bench = Bench::new();
    let (request, answer) = (read_identification(), hex("01 03 02 01 A0 B9 AC"));
    let wire = bench.simulator.wire();

    wire.drop_answers(2);
    assert_eq!(bench.exchange(&request), []);
    assert_eq!(bench.exchange(&request), []);
    assert_eq!(bench.exchange(&request), answer);

    wire.answer_with(&[0xAA, 0xBB]);
    assert_eq!(bench.exchange(&request), [0xAA, 0xBB]);

    wire.noise_before(&[0x00], 1);
    wire.noise_after(&[0xFF], 1);
    let mut noisy = vec![0x00];
    noisy.extend_from_slice(&answer);
    noisy.push(0xFF);
    assert_eq!(bench.exchange(&request), noisy);

    wire.drop_answers(1);
    wire.clear();
    assert_eq!(bench.exchange(&request), answer);

    wire.delay_answers(Duration::from_millis(300), 1);
    let begin = bench.line.now() + Duration::from_secs(1);
    bench.line.sleep(begin);
    bench.line.send(&request).unwrap();
    let first = bench.listen(begin + Duration::from_secs(1))[0].0;
    assert_eq!(first, begin + Duration::from_nanos(CHARS_8 + T35 + RESPONSE_DELAY + 300_000_000 + CHAR_1));
}

#[test]
fn a_late_answer_comes_after_the_next_request_and_holds_back_its_answer() {
    let mut bench = Bench::new();
    let wire = bench.simulator.wire();
    wire.delay_answers(Duration::from_millis(30), 1);
    bench.line.send(&read_identification()).unwrap();
    bench.line.sleep(at(20_000_000));
    bench.line.send(&framed(1, &pdu(0x03, &[0x2100, 1]))).unwrap();
    // The second answer is due at 20 + 4.58 + 2.01 + 5 ms, the late one at 41.59 ms: a unit has one buffer.
    let heard: Vec<u8> = bench.listen(at(1_000_000_000)).into_iter().map(|(_, byte)| byte).collect();
    assert_eq!(heard, [hex("01 03 02 01 A0 B9 AC"), hex("01 03 02 00 03 F8 45")].concat());
    assert_eq!(wire.collisions(), 0);
}

/// A run with a collision; returns what the master heard.
fn collide(seed: u64) -> (Simulator, Vec<u8>) {
    let mut bench = Bench::with(Options::default().seed(seed));
    bench.line.send(&read_identification()).unwrap();
    // 1 ms into the answer the master speaks.
    bench.line.sleep(at(CHARS_8 + T35 + RESPONSE_DELAY + 1_000_000));
    bench.line.send(&read_identification()).unwrap();
    let mut buffer = [0; 64];
    bench.line.sleep(at(1_000_000_000));
    let count = bench.line.receive(&mut buffer, at(1_000_000_000)).unwrap();
    (bench.simulator, buffer[..count].to_vec())
}

#[test]
fn where_both_sides_speak_both_are_spoilt() {
    let (simulator, heard) = collide(0);
    let answer = hex("01 03 02 01 A0 B9 AC");
    assert_eq!(heard.len(), 7, "the request that collided got no answer");
    // The first character ends at 0.57 ms and is whole; all others overlap the request.
    assert_eq!(heard[0], answer[0]);
    assert!(heard.iter().zip(&answer).skip(1).all(|(heard, sent)| heard != sent));
    // 6 characters of the answer, and those of the request until the answer ends: 3.01 ms, so 6.
    assert_eq!(simulator.wire().collisions(), 12);
    assert_eq!(simulator.wire().silence_violations(), 1);
}

#[test]
fn the_same_seed_gives_the_same_run() {
    let (first, heard_first) = collide(7);
    let (second, heard_second) = collide(7);
    assert_eq!(heard_first, heard_second);
    assert_eq!(first.wire().trace(), second.wire().trace());
    assert_ne!(heard_first, collide(8).1);
}

#[test]
fn the_trace_keeps_the_last_thousand() {
    let mut bench = Bench::new();
    for _ in 0..501 {
        bench.exchange(&read_identification());
    }
    let trace = bench.simulator.wire().trace();
    assert_eq!(trace.len(), 1_000);
    assert_eq!((trace[998].side, trace[999].side), (Side::Master, Side::Unit));
    assert_eq!(trace[999].bytes, hex("01 03 02 01 A0 B9 AC"));
}

#[test]
fn an_hour_of_silence_passes_at_once() {
    let mut bench = Bench::new();
    bench.line.sleep(at(3_600_000_000_000));
    assert_eq!(bench.simulator.now(), at(3_600_000_000_000));
    bench.simulator.advance(Duration::from_secs(1)).unwrap();
    assert_eq!(bench.line.now(), at(3_601_000_000_000));
    assert_eq!(bench.read::<1>(0x2103), [0x01A0]);
}

#[test]
fn impossible_simulations_are_refused_in_words() {
    let refused = |units: &[(u8, &str)]| {
        Simulator::new(units.iter().copied(), Options::default()).map(|_| ()).unwrap_err().to_string()
    };
    assert_eq!(refused(&[(0, "gd350")]), "unit address 0 is not a number from 1 to 247");
    assert_eq!(refused(&[(248, "gd350")]), "unit address 248 is not a number from 1 to 247");
    assert_eq!(refused(&[(1, "gd350"), (1, "gd350")]), "unit 1 is there twice; give each unit an address of its own");
    assert!(refused(&[(1, "gd35O")]).contains("gd350"), "the closest name is given");
    let simulator = Simulator::new([(1, "gd350"), (7, "gd350")], Options::default()).unwrap();
    assert_eq!(simulator.drive(2).unwrap_err().to_string(), "no unit 2 is simulated; there are 1, 7");
    assert_eq!(simulator.name(), "sim:1=gd350,7=gd350");
}
