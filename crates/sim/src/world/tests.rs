//! What may happen in a world, and what a master may not notice of how that is worked out.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::BTreeMap;
use std::time::Duration;

use drivebus_rtu::{Adu, Request};
use proptest::prelude::*;

use super::*;
use crate::model::Model;

fn world(strict_silence: bool) -> World {
    let map = Arc::new(Model::from("gd350").map().unwrap());
    let drive = |unit| (unit, Drive::new(UnitAddress::new(unit).unwrap(), Arc::clone(&map), Instant::ZERO));
    World::new(SerialFormat::default(), strict_silence, 7, Drives::new(BTreeMap::from([1, 2].map(drive))))
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
