//! Each kind of fault does what its text says, in virtual time.

use std::time::Duration;

use drivebus_line::{Line, PortErrorKind};
use drivebus_rtu::{Frame, Instant, SerialFormat};
use drivebus_sim::{FaultKind, Options, SimError};

use crate::bench::{Bench, framed, hex, pdu, write_many_pdu};

/// How often each kind is tried: enough to meet every place and every length.
const TIMES: usize = 300;
/// More than a fault's delays.
const LONG: Duration = Duration::from_secs(3);

/// Two words of drive 1 and the answer to them: fault history, empty.
const WORDS: [u16; 2] = [0x0A, 0xB7];

fn request() -> Vec<u8> {
    framed(1, &pdu(0x03, &[0x000B, 2]))
}

fn answer() -> Vec<u8> {
    framed(1, &[&[0x03, 4][..], &pdu(0, &WORDS)[1..]].concat())
}

/// Drive 1 with two known words, and `kind` in every answer.
fn hit_by(kind: FaultKind) -> Bench {
    let mut bench = Bench::new();
    bench.write_many(0x000B, &WORDS);
    bench.simulator.wire().set_rate(kind, 1.0).unwrap();
    bench
}

/// What arrives after `request`, each time, with the moments.
fn arrivals(bench: &mut Bench, request: &[u8]) -> Vec<Vec<(Instant, u8)>> {
    (0..TIMES)
        .map(|_| {
            let silence = bench.line.now() + SerialFormat::DEFAULT.t35();
            bench.line.sleep(silence);
            let sent = bench.line.send(request).unwrap();
            bench.listen(sent + LONG)
        })
        .collect()
}

/// The same, only the bytes; every one of them was counted.
fn heard(kind: FaultKind) -> Vec<Vec<u8>> {
    let mut bench = hit_by(kind);
    let heard = arrivals(&mut bench, &request());
    assert_eq!(bench.simulator.wire().counts(kind), TIMES as u64);
    heard.into_iter().map(|came| came.into_iter().map(|(_, byte)| byte).collect()).collect()
}

#[test]
fn one_bit_is_turned_over() {
    let turned: Vec<u32> = heard(FaultKind::FlipBit)
        .iter()
        .map(|came| came.iter().zip(answer()).map(|(came, sent)| (came ^ sent).count_ones()).sum())
        .collect();
    assert_eq!(turned, [1; TIMES]);
}

#[test]
fn one_character_is_lost_or_comes_twice() {
    let whole = answer();
    let lost = |came: &[u8]| (0..whole.len()).any(|at| came == [&whole[..at], &whole[at + 1..]].concat());
    assert!(heard(FaultKind::LoseByte).iter().all(|came| lost(came)));
    let twice = |came: &[u8]| (0..whole.len()).any(|at| came == [&whole[..=at], &whole[at..]].concat());
    assert!(heard(FaultKind::DoubleByte).iter().all(|came| twice(came)));
}

#[test]
fn noise_comes_where_it_is_said_to() {
    let whole = answer();
    for (kind, most) in [(FaultKind::NoiseBefore, 8), (FaultKind::NoiseAfter, 8), (FaultKind::NoiseInside, 3)] {
        let heard = heard(kind);
        let lengths: Vec<usize> = heard.iter().map(|came| came.len() - whole.len()).collect();
        assert_eq!((lengths.iter().min(), lengths.iter().max()), (Some(&1), Some(&most)), "{kind}");
        for came in heard {
            let extra = came.len() - whole.len();
            let placed = |at: usize| came[..at] == whole[..at] && came[at + extra..] == whole[at..];
            match kind {
                FaultKind::NoiseBefore => assert!(placed(0)),
                FaultKind::NoiseAfter => assert!(placed(whole.len())),
                _ => assert!((1..whole.len()).any(placed)),
            }
        }
    }
}

#[test]
fn a_collision_garbles_characters_in_a_row() {
    let whole = answer();
    for came in heard(FaultKind::Collision) {
        assert_eq!(came.len(), whole.len());
        let wrong: Vec<usize> = (0..whole.len()).filter(|&at| came[at] != whole[at]).collect();
        assert!(wrong.len() >= 2 && wrong.windows(2).all(|pair| pair[1] == pair[0] + 1), "{wrong:?}");
    }
}

#[test]
fn a_lost_answer_was_earned_and_a_lost_request_was_not_heard() {
    for (kind, done) in [(FaultKind::Silence, 1), (FaultKind::Deaf, 0)] {
        let mut bench = hit_by(kind);
        let before = bench.drive().words_written();
        assert_eq!(bench.exchange(&framed(1, &pdu(0x06, &[0x000B, 77]))), []);
        assert_eq!(bench.drive().words_written() - before, done, "{kind}");
        assert_eq!(bench.simulator.wire().counts(kind), 1);
    }
}

#[test]
fn delays_are_as_long_as_they_were_set() {
    for (kind, shortest, longest) in
        [(FaultKind::Delay, 0, 50), (FaultKind::Late, 600, 1_200), (FaultKind::Overtaken, 600, 2_400)]
    {
        let mut bench = hit_by(kind);
        for came in arrivals(&mut bench, &request()) {
            assert_eq!(came.iter().map(|&(_, byte)| byte).collect::<Vec<_>>(), answer());
        }
        // Behind the write at the beginning, request and answer in turn.
        let trace = bench.simulator.wire().trace();
        let delays: Vec<f64> = trace[2..]
            .chunks_exact(2)
            .map(|pair| pair[1].begin.saturating_duration_since(pair[0].begin).as_secs_f64() * 1e3)
            // 8 characters of the request, the silence, 5 ms of P14.03.
            .map(|millis| millis - (4.583_334 + 2.005_209 + 5.0))
            .collect();
        assert_eq!(delays.len(), TIMES);
        assert!(delays.iter().all(|delay| (f64::from(shortest)..=f64::from(longest)).contains(delay)), "{delays:?}");
        // Of 300 draws some fall into the first and the last tenth.
        let tenth = f64::from(longest - shortest) / 10.0;
        assert!(delays.iter().any(|&delay| delay < f64::from(shortest) + tenth), "{kind}");
        assert!(delays.iter().any(|&delay| delay > f64::from(longest) - tenth), "{kind}");
    }
}

#[test]
fn a_late_answer_comes_in_order_before_that_to_the_next_request() {
    let mut bench = hit_by(FaultKind::FlipBit);
    let wire = bench.simulator.wire();
    wire.clear();
    wire.set_late(Duration::from_millis(20));
    wire.script(&[(1, FaultKind::Late)]);
    let sent = bench.line.send(&request()).unwrap();
    bench.line.sleep(sent + Duration::from_millis(10));
    bench.line.send(&framed(1, &pdu(0x03, &[0x2103, 1]))).unwrap();
    let came: Vec<u8> = bench.listen(sent + LONG).into_iter().map(|(_, byte)| byte).collect();
    assert_eq!(came, [answer(), hex("01 03 02 01 A0 B9 AC")].concat());
}

/// Drive 1, of which the first answer is hit by `kind` and comes 40 ms later, is asked for `WORDS`, then for its code.
fn two_questions(kind: FaultKind) -> Vec<u8> {
    let mut bench = hit_by(kind);
    let wire = bench.simulator.wire();
    wire.clear();
    let later = Duration::from_millis(40);
    wire.set_late(later);
    wire.set_overtaken(later, later);
    wire.script(&[(1, kind)]);
    let sent = bench.line.send(&request()).unwrap();
    bench.line.sleep(sent + Duration::from_millis(10));
    bench.line.send(&framed(1, &pdu(0x03, &[0x2103, 1]))).unwrap();
    let came = bench.listen(sent + LONG);
    assert_eq!(wire.counts(kind), 1);
    came.into_iter().map(|(_, byte)| byte).collect()
}

#[test]
fn later_answers_pass_one_that_is_overtaken_and_wait_behind_one_that_is_late() {
    let code = hex("01 03 02 01 A0 B9 AC");
    assert_eq!(two_questions(FaultKind::Overtaken), [code.clone(), answer()].concat());
    assert_eq!(two_questions(FaultKind::Late), [answer(), code].concat());
}

#[test]
fn an_answer_that_may_be_passed_waits_behind_one_that_is_late() {
    let mut bench = hit_by(FaultKind::Late);
    let wire = bench.simulator.wire();
    wire.clear();
    wire.set_late(Duration::from_millis(200));
    wire.set_overtaken(Duration::from_millis(20), Duration::from_millis(30));
    wire.script(&[(1, FaultKind::Late), (2, FaultKind::Overtaken)]);
    let sent = bench.line.send(&request()).unwrap();
    bench.line.sleep(sent + Duration::from_millis(10));
    bench.line.send(&framed(1, &pdu(0x03, &[0x2103, 1]))).unwrap();
    let came: Vec<u8> = bench.listen(sent + LONG).into_iter().map(|(_, byte)| byte).collect();
    assert_eq!(came, [answer(), hex("01 03 02 01 A0 B9 AC")].concat());
}

#[test]
fn a_script_replaces_the_answers_it_names() {
    let mut bench = hit_by(FaultKind::Late);
    let wire = bench.simulator.wire();
    wire.clear();
    wire.script_with(&[(3, FaultKind::Silence), (3, FaultKind::Late)], &[(2, &[1, 2, 3]), (3, &[4]), (4, &[])]);
    let came: Vec<Vec<u8>> = (0..5).map(|_| bench.exchange(&request())).collect();
    assert_eq!(came, [answer(), vec![1, 2, 3], vec![], vec![], answer()]);
    wire.script_with(&[], &[(1, &[5])]);
    wire.clear();
    assert_eq!(bench.exchange(&request()), answer());
}

#[test]
fn a_split_answer_comes_in_pieces_16_ms_apart() {
    let mut bench = hit_by(FaultKind::Split);
    let character = SerialFormat::DEFAULT.char_time() + Duration::from_nanos(1);
    let mut pieces = Vec::new();
    for came in arrivals(&mut bench, &request()) {
        assert_eq!(came.iter().map(|&(_, byte)| byte).collect::<Vec<_>>(), answer());
        let gaps = came.windows(2).map(|pair| pair[1].0.saturating_duration_since(pair[0].0));
        let pauses: Vec<Duration> = gaps.filter(|&gap| gap > character).collect();
        let pause = Duration::from_millis(16);
        assert!(pauses.iter().all(|&gap| gap >= pause && gap <= pause + character), "{pauses:?}");
        pieces.push(pauses.len() + 1);
    }
    assert_eq!((pieces.iter().min(), pieces.iter().max()), (Some(&2), Some(&4)));
}

#[test]
fn a_foreign_frame_comes_before_the_answer_with_its_silence() {
    let mut bench = hit_by(FaultKind::Foreign);
    for came in arrivals(&mut bench, &request()) {
        let bytes: Vec<u8> = came.iter().map(|&(_, byte)| byte).collect();
        let (foreign, own) = bytes.split_at(answer().len());
        assert_eq!(own, answer());
        let foreign_frame = Frame::parse(foreign).unwrap();
        assert_ne!(foreign_frame.address(), 1);
        assert!((1..=247).contains(&foreign_frame.address()));
        assert_eq!(foreign_frame.pdu()[..2], [0x03, 4]);
        let silence = came[foreign.len()].0.saturating_duration_since(came[foreign.len() - 1].0);
        assert!(silence >= SerialFormat::DEFAULT.t35());
    }
}

#[test]
fn another_function_answers_before_or_instead() {
    let whole = answer();
    let heard = heard(FaultKind::WrongFunction);
    let (before, instead): (Vec<_>, Vec<_>) = heard.iter().partition(|came| came.len() > whole.len());
    assert!(!before.is_empty() && !instead.is_empty());
    for came in &heard {
        let frame = Frame::parse(&came[..whole.len()]).unwrap();
        assert_eq!((frame.address(), &frame.pdu()[..2]), (1, &[0x04, 4][..]));
    }
    assert!(before.iter().all(|came| came[whole.len()..] == whole));
    assert!(instead.iter().all(|came| came.len() == whole.len()));
}

#[test]
fn answers_carry_fewer_or_more_words_than_asked_for() {
    let short: Vec<usize> =
        heard(FaultKind::Short).iter().map(|came| Frame::parse(came).unwrap().pdu().len()).collect();
    assert!(short.iter().all(|length| [2, 4].contains(length)) && short.contains(&2) && short.contains(&4));
    let mut long: Vec<usize> = Vec::new();
    for came in heard(FaultKind::Long) {
        let pdu = Frame::parse(&came).unwrap().pdu();
        assert_eq!(pdu[..2], [0x03, u8::try_from(pdu.len() - 2).unwrap()]);
        assert_eq!(pdu[2..6], answer()[3..7]);
        long.push(pdu.len());
    }
    long.sort_unstable();
    long.dedup();
    assert_eq!(long, [8, 10, 12, 14]);
}

#[test]
fn confirmations_of_writes_and_refusals_have_the_wrong_length_too() {
    let write = framed(1, &pdu(0x06, &[0x000B, WORDS[0]]));
    let write_many = framed(1, &write_many_pdu(0x000B, &WORDS));
    let refused = framed(1, &pdu(0x03, &[0xFFFF, 1]));
    for (kind, expected) in [(FaultKind::Short, [3, 3, 1]), (FaultKind::Long, [7, 7, 4])] {
        for (request, length) in [&write, &write_many, &refused].into_iter().zip(expected) {
            let mut bench = hit_by(kind);
            for came in arrivals(&mut bench, request) {
                let came: Vec<u8> = came.into_iter().map(|(_, byte)| byte).collect();
                let frame = Frame::parse(&came).unwrap();
                assert!(if kind == FaultKind::Short {
                    frame.pdu().len() == length
                } else {
                    frame.pdu().len() >= length
                });
            }
        }
    }
}

#[test]
fn no_mixture_of_faults_ever_looks_like_the_answer() {
    let mut bench = Bench::with(Options::default().seed(3));
    bench.write_many(0x000B, &WORDS);
    let wire = bench.simulator.wire();
    wire.set_late(Duration::from_millis(1));
    wire.set_overtaken(Duration::from_millis(1), Duration::from_millis(4));
    for kind in FaultKind::ALL.into_iter().filter(|&kind| kind != FaultKind::Unplug) {
        wire.set_rate(kind, 0.2).unwrap();
    }
    let whole = answer();
    for came in (0..20).flat_map(|_| arrivals(&mut bench, &request())) {
        let came: Vec<u8> = came.into_iter().map(|(_, byte)| byte).collect();
        for window in came.windows(whole.len()).filter(|window| window[..2] == [1, 3]) {
            assert!(*window == whole || Frame::parse(window).is_err(), "{window:02X?}");
        }
    }
    for kind in FaultKind::ALL.into_iter().filter(|&kind| kind != FaultKind::Unplug) {
        assert!(wire.counts(kind) > 0, "{kind} never happened");
    }
}

#[test]
fn an_adapter_that_echoes_gives_back_each_character_when_it_has_left() {
    let mut bench = Bench::new();
    let wire = bench.simulator.wire();
    wire.set_echo(true);
    let mut other = bench.simulator.line();
    let request = framed(1, &pdu(0x03, &[0x2103, 1]));
    bench.line.send(&request).unwrap();
    let came = bench.listen(Instant::from_nanos(1_000_000_000));
    // The echo, then 2 ms of silence and 5 ms of P14.03 later the answer.
    let bytes: Vec<u8> = came.iter().map(|&(_, byte)| byte).collect();
    assert_eq!(bytes, [request.clone(), hex("01 03 02 01 A0 B9 AC")].concat());
    // n × 11 bits at 19 200 bit/s, rounded up.
    assert_eq!((came[0].0.as_nanos(), came[7].0.as_nanos()), (572_917, 4_583_334));
    // Who did not send it hears the answer only.
    let mut buffer = [0; 64];
    assert_eq!(other.receive(&mut buffer, bench.simulator.now()).unwrap(), 7);
    wire.clear();
    assert!(wire.echo(), "an adapter stays what it is");
    wire.set_echo(false);
    assert_eq!(bench.exchange(&request), hex("01 03 02 01 A0 B9 AC"));
}

#[test]
fn a_line_that_was_unplugged_is_lost_for_good() {
    let mut bench = Bench::new();
    let wire = bench.simulator.wire();
    let lost = |result: Result<usize, drivebus_line::PortError>| result.unwrap_err().kind == PortErrorKind::Lost;
    bench.line.send(&request()).unwrap();
    wire.unplug();
    assert!(!wire.is_plugged());
    let soon = bench.line.now() + Duration::from_millis(1);
    assert!(lost(bench.line.receive(&mut [0; 8], soon)));
    assert_eq!(bench.line.send(&request()).unwrap_err().kind, PortErrorKind::Lost);
    let asleep = bench.line.now() + Duration::from_secs(1);
    bench.line.sleep(asleep);
    assert_eq!(bench.line.now(), asleep, "time passes without the line");

    let before = bench.simulator.now();
    assert_eq!(bench.simulator.open_line().unwrap_err().kind, PortErrorKind::NotFound);
    assert_eq!(bench.simulator.now(), before + Duration::from_millis(10));
    wire.replug().unwrap();
    let later = bench.line.now() + Duration::from_millis(1);
    assert!(lost(bench.line.receive(&mut [0; 8], later)), "it was opened before");
    bench.line = bench.simulator.open_line().unwrap();
    assert_eq!(bench.read::<1>(0x2103), [0x01A0]);
    assert_eq!(wire.counts(FaultKind::Unplug), 0, "this was no fault by chance");
}

#[test]
fn what_the_adapter_was_sending_is_cut_off() {
    let mut bench = Bench::new();
    let written = bench.drive().words_written();
    let sent = bench.line.send(&framed(1, &pdu(0x06, &[0x000B, 5]))).unwrap();
    bench.line.sleep(Instant::from_nanos(sent.as_nanos() - 1));
    bench.simulator.wire().unplug();
    bench.simulator.advance(Duration::from_secs(1)).unwrap();
    assert_eq!(bench.drive().words_written(), written, "its last character was not over");
}

#[test]
fn an_adapter_that_falls_out_comes_back_by_itself() {
    let mut bench = Bench::new();
    let wire = bench.simulator.wire();
    wire.set_replug(Duration::from_millis(200));
    wire.script(&[(2, FaultKind::Unplug)]);
    assert_eq!(bench.read::<1>(0x2103), [0x01A0]);
    let asked = bench.line.now();
    bench.line.send(&framed(1, &pdu(0x06, &[0x000B, 5]))).unwrap();
    assert_eq!(bench.line.receive(&mut [0; 8], asked + LONG).unwrap_err().kind, PortErrorKind::Lost);
    assert_eq!(bench.drive().writes().last().map(|write| write.value), Some(5), "the drive heard the request");
    let mut vain = 0;
    bench.line = loop {
        match bench.simulator.open_line() {
            Ok(line) => break line,
            Err(_) => vain += 1,
        }
    };
    // The request was over and silence with it when the adapter fell out; then 200 ms in steps of 10 ms.
    assert_eq!(vain, 20);
    assert_eq!(bench.read::<1>(0x000B), [5]);
    assert_eq!(wire.counts(FaultKind::Unplug), 1);
}

#[test]
fn the_same_seed_gives_the_same_faults() {
    let run = |seed| {
        let mut bench = Bench::with(Options::default().seed(seed));
        let wire = bench.simulator.wire();
        FaultKind::ALL[..17].iter().for_each(|&kind| wire.set_rate(kind, 0.1).unwrap());
        arrivals(&mut bench, &request())
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn rates_are_shares_and_are_forgotten_by_clear() {
    let wire = Bench::new().simulator.wire();
    for share in [-0.1, 1.1, f64::NAN] {
        assert!(matches!(wire.set_rate(FaultKind::Late, share), Err(SimError::Rate { .. })));
    }
    wire.set_rate(FaultKind::Late, 0.5).unwrap();
    wire.set_rate(FaultKind::Deaf, 1.0).unwrap();
    assert_eq!(wire.rates(), [(FaultKind::Late, 0.5), (FaultKind::Deaf, 1.0)]);
    wire.clear();
    assert_eq!(wire.rates(), []);
}

#[test]
fn writes_that_were_taken_are_not_shown_again() {
    let mut bench = Bench::new();
    let drive = bench.drive();
    bench.write_many(0x000B, &WORDS);
    assert_eq!(drive.take_writes().iter().map(|write| write.value).collect::<Vec<_>>(), WORDS);
    assert_eq!(drive.take_writes(), []);
    bench.write(0x000B, 9);
    assert_eq!(drive.writes().len(), 1);
    assert_eq!(drive.words_written(), 3);
}
