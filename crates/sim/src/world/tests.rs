//! What may happen in a world, and what a master may not notice of how that is worked out.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::time::Duration;

use drivebus_rtu::{Adu, DataBits, Parity, Request, Silence, StopBits};
use proptest::prelude::*;

use super::*;
use crate::model::Model;

fn world(strict_silence: bool) -> World {
    let map = Arc::new(Model::from("gd350").map().unwrap());
    let drive = |unit| (unit, Drive::new(UnitAddress::new(unit).unwrap(), Arc::clone(&map), Instant::ZERO));
    World::new(SerialFormat::default(), strict_silence, 7, Drives::new(BTreeMap::from([1, 2].map(drive))))
}

/// 8E1 at this speed.
fn at(speed: u32) -> SerialFormat {
    SerialFormat::new(speed, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec).unwrap()
}

/// Asks unit 1 for two words; what came within a second.
fn asked(world: &mut World, port: Listener) -> Vec<u8> {
    let now = world.now();
    world.transmit(port, now, Adu::request(UnitAddress::MIN.into(), &Request::read(0x3000, 2).unwrap()).as_bytes());
    world.advance(now + Duration::from_secs(1));
    let mut buffer = [0; 64];
    let count = world.take(port, &mut buffer);
    buffer[..count].to_vec()
}

/// What may happen to a world.
#[derive(Debug, Clone)]
enum Act {
    /// A read of so many words of a unit, or, where it is longer than that, only its first characters.
    Send {
        unit: u8,
        count: u16,
        length: usize,
    },
    /// Characters that are no frame, and more than one has.
    Babble(usize),
    Pass(Duration),
    Unplug,
    Replug,
    DelayAnswers(Duration),
    /// Every unit is set to this speed, and the adapter too, or not.
    Settings(u32, bool),
}

fn act() -> impl Strategy<Value = Act> {
    let send = (1..=2_u8, 1..=16_u16, 3..30_usize).prop_map(|(unit, count, length)| Act::Send { unit, count, length });
    prop_oneof![
        6 => send,
        8 => (0..30_000_000_u64).prop_map(|nanos| Act::Pass(Duration::from_nanos(nanos))),
        2 => (0..1_200_000_000_u64).prop_map(|nanos| Act::Pass(Duration::from_nanos(nanos))),
        2 => (520..2_000_usize).prop_map(Act::Babble),
        1 => Just(Act::Unplug),
        2 => Just(Act::Replug),
        2 => (0..600_000_000_u64).prop_map(|nanos| Act::DelayAnswers(Duration::from_nanos(nanos))),
        1 => (prop::sample::select(&[9_600, 19_200, 115_200][..]), any::<bool>())
            .prop_map(|(speed, both)| Act::Settings(speed, both)),
    ]
}

/// Lets `acts` happen; says what the master had to read after each, and what the world is like in the end.
fn happened(mut world: World, acts: &[Act]) -> (Vec<Vec<u8>>, World) {
    let port = world.attach();
    let mut read = Vec::new();
    let mut buffer = [0; 4_096];
    for act in acts {
        let now = world.now();
        match *act {
            Act::Send { unit, count, length } => {
                let to = UnitAddress::new(unit).unwrap().into();
                let frame = Adu::request(to, &Request::read(0x3000, count).unwrap());
                let bytes = frame.as_bytes();
                world.transmit(port, now, &bytes[..length.min(bytes.len())]);
            }
            Act::Babble(length) => {
                world.transmit(port, now, &vec![0x55; length]);
            }
            Act::Pass(time) => world.advance(now + time),
            Act::Unplug => world.unplug(now, None),
            Act::Replug => world.replug(),
            Act::DelayAnswers(delay) => world.wire.spoil.delay_answers(delay, 1),
            Act::Settings(speed, both) => {
                world.set_format(at(speed));
                if both {
                    world.set_adapter(port, at(speed));
                }
            }
        }
        let count = world.take(port, &mut buffer);
        read.push(buffer[..count].to_vec());
    }
    (read, world)
}

/// Reads of `counts` words, one a second; what a port with `fifo` hands over, and when.
fn handed_over(fifo: usize, faults: &[(u64, FaultKind)], echo: bool, counts: &[u16]) -> Vec<(Instant, Vec<u8>)> {
    let unit = UnitAddress::MIN;
    let mut world = world(false);
    world.wire.faults.script(faults, &[]);
    world.wire.echo = echo;
    let port = world.attach();
    let mut handed = Vec::new();
    let mut buffer = [0; 512];
    for (count, second) in counts.iter().zip(1..) {
        let sent = Instant::ZERO + Duration::from_secs(second);
        world.transmit(port, sent, Adu::request(unit.into(), &Request::read(0x3000, *count).unwrap()).as_bytes());
        let until = if second == counts.len() as u64 { 100 } else { second + 1 };
        let until = Instant::ZERO + Duration::from_secs(until);
        while let Some(next) = world.next_hand_over(port, fifo).filter(|next| next.at < until) {
            assert!(next.at > world.now(), "a wake-up for nothing");
            world.advance(next.at);
            let taken = world.hand_over(port, &mut buffer, fifo);
            if taken > 0 {
                handed.push((next.at, buffer[..taken].to_vec()));
            }
        }
    }
    handed
}

fn kind() -> impl Strategy<Value = FaultKind> {
    // An unplugged port hands over nothing at all.
    prop::sample::select(&FaultKind::ALL[..17])
}

#[test]
fn a_late_answer_that_meets_an_echo_fills_the_same_fifo() {
    let faults = [(3, FaultKind::Late), (1, FaultKind::Long), (1, FaultKind::Delay)];
    let lumps = handed_over(2, &faults, true, &[1, 1, 2, 1]);
    assert!(lumps.iter().all(|(_, lump)| lump.len() <= 2), "{lumps:02X?}");
}

#[test]
fn units_make_nothing_of_what_comes_at_another_speed_or_with_other_parity() {
    let mut world = world(false);
    let port = world.attach();
    let usual = asked(&mut world, port);
    assert_eq!(usual.len(), 9);
    let format = |speed, bits, parity, stop| SerialFormat::new(speed, bits, parity, stop, Silence::Spec).unwrap();
    let fits = [
        format(19_200, DataBits::Eight, Parity::Even, StopBits::Two),
        format(19_700, DataBits::Eight, Parity::Even, StopBits::One),
        format(18_700, DataBits::Eight, Parity::Even, StopBits::One),
    ];
    for adapter in fits {
        world.set_adapter(port, adapter);
        assert_eq!(asked(&mut world, port), usual, "{adapter}");
    }
    let misfits = [
        format(9_600, DataBits::Eight, Parity::Even, StopBits::One),
        format(19_800, DataBits::Eight, Parity::Even, StopBits::One),
        format(18_600, DataBits::Eight, Parity::Even, StopBits::One),
        format(19_200, DataBits::Eight, Parity::None, StopBits::One),
        format(19_200, DataBits::Eight, Parity::Odd, StopBits::One),
        format(19_200, DataBits::Seven, Parity::Even, StopBits::One),
    ];
    for adapter in misfits {
        world.set_adapter(port, adapter);
        assert_eq!(asked(&mut world, port), [], "{adapter}");
    }
    assert_eq!(world.wire.requests, 10, "each was on the wire");
    world.set_adapter(port, SerialFormat::DEFAULT);
    assert_eq!(asked(&mut world, port), usual);
}

#[test]
fn who_listens_at_another_speed_reads_as_many_characters_and_none_of_them_right() {
    let mut world = world(false);
    let (port, other) = (world.attach(), world.attach());
    world.set_adapter(other, at(9_600));
    let usual = asked(&mut world, port);
    let mut buffer = [0; 64];
    let count = world.take(other, &mut buffer);
    assert_eq!(count, usual.len());
    assert!(usual.iter().zip(&buffer).all(|(right, read)| right != read));
}

#[test]
fn units_that_are_set_to_another_speed_lose_what_is_on_its_way_and_answer_at_theirs() {
    let mut world = world(false);
    let port = world.attach();
    let usual = asked(&mut world, port);
    let request = Adu::request(UnitAddress::MIN.into(), &Request::read(0x3000, 2).unwrap());
    // Amid the request, before the answer, amid the answer: 8 and 9 characters of 573 us, a silence of 2 ms, 5 ms delay.
    for millis in [2, 8, 14] {
        let now = world.now();
        world.transmit(port, now, request.as_bytes());
        world.advance(now + Duration::from_millis(millis));
        world.set_format(at(9_600));
        world.advance(now + Duration::from_secs(1));
        let count = world.take(port, &mut [0; 64]);
        assert!(count < usual.len(), "{count} characters, {millis} ms");
        assert_eq!(asked(&mut world, port), usual, "an adapter that follows");
        let traced = world.wire.trace.to_vec();
        let [sent, answered] = &traced[traced.len() - 2..] else { unreachable!() };
        // 8 characters, the silence (3.5) at 9 600 bit/s with 11 bits each, and the 5 ms that a GD350 takes.
        let took = 11.5 * 11.0 / 9_600.0 + 0.005;
        let taken = answered.begin.saturating_duration_since(sent.begin).as_secs_f64();
        assert!((taken - took).abs() < 1e-6, "{taken}");
        world.set_format(SerialFormat::DEFAULT);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn a_fifo_changes_neither_the_characters_nor_the_end_of_a_run(
        fifo in 2_usize..20,
        faults in prop::collection::vec((1..5_u64, kind()), 0..4),
        echo: bool,
        counts in prop::collection::vec(1..17_u16, 1..5),
    ) {
        let single: Vec<(Instant, u8)> = handed_over(1, &faults, echo, &counts)
            .into_iter()
            .map(|(at, bytes)| { assert_eq!(bytes.len(), 1, "one at a time"); (at, bytes[0]) })
            .collect();
        let mut place = 0;
        for (at, lump) in handed_over(fifo, &faults, echo, &counts) {
            let next = place + lump.len();
            let bytes: Vec<u8> = single[place..next].iter().map(|&(_, byte)| byte).collect();
            prop_assert_eq!(&lump, &bytes);
            prop_assert_eq!(at, single[next - 1].0, "at the moment of its last character");
            // 572 917 ns are 11 bits at 19 200 bit/s, rounded up.
            let runs_on = single.get(next).is_some_and(|&(after, _)| after <= at + Duration::from_nanos(572_917));
            prop_assert!(lump.len() == fifo || lump.len() < fifo && !runs_on, "{} of {fifo}", lump.len());
            place = next;
        }
        prop_assert_eq!(place, single.len());
    }

    #[test]
    fn nothing_tells_whether_characters_came_one_by_one(
        faults in prop::collection::vec((1..20_u64, prop::sample::select(&FaultKind::ALL[..])), 0..8),
        strict: bool,
        echo: bool,
        acts in prop::collection::vec(act(), 1..60),
    ) {
        let [fast, slow] = [false, true].map(|plodding| {
            let mut world = world(strict);
            world.wire.plodding = plodding;
            world.wire.faults.script(&faults, &[]);
            world.wire.echo = echo;
            happened(world, &acts)
        });
        prop_assert_eq!(fast.0, slow.0);
        let [fast, slow] = [fast.1, slow.1].map(|world| {
            let Wire { requests, silence_violations, collisions, .. } = world.wire;
            let wakeup = world.wire.next_wakeup();
            let counts = FaultKind::ALL.map(|kind| world.wire.faults.count(kind));
            (world.wire.trace.to_vec(), wakeup, counts, [requests, silence_violations, collisions])
        });
        prop_assert_eq!(fast, slow);
    }
}
