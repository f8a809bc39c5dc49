//! Everything that is simulated: one wire, the units on it, and the masters that listen to it.
//!
//! It reads no clock. Whoever holds it says how far time has come.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use drivebus_rtu::{Destination, Frame, Instant, SerialFormat, UnitAddress};

use crate::drive::{Drive, Drives};
use crate::faults::FaultKind;
use crate::wire::{Step, Wakeup, Wire};

/// Bytes kept for a master that does not read; older ones are lost, as in a serial port.
const INBOX: usize = 65_536;

/// Names one of the masters on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Listener(u64);

/// The simulated world.
#[derive(Debug)]
pub(crate) struct World {
    now: Instant,
    /// The same in nanoseconds, for who only wants to know the time.
    shown: Arc<AtomicU64>,
    pub(crate) wire: Wire,
    drives: Drives,
    inboxes: Vec<(Listener, VecDeque<u8>)>,
    next_listener: u64,
    plug: Plug,
}

/// The adapter between the masters and the wire.
#[derive(Debug)]
struct Plug {
    is_in: bool,
    /// How often it was pulled out: what was opened before is lost for good.
    pulls: u64,
    /// When it comes back by itself.
    back_at: Option<Instant>,
}

impl World {
    pub(crate) fn new(format: SerialFormat, strict_silence: bool, seed: u64, drives: Drives) -> Self {
        Self {
            now: Instant::ZERO,
            shown: Arc::default(),
            wire: Wire::new(format, strict_silence, seed),
            drives,
            inboxes: Vec::new(),
            next_listener: 0,
            plug: Plug { is_in: true, pulls: 0, back_at: None },
        }
    }

    /// How far time has come.
    pub(crate) fn now(&self) -> Instant {
        self.now
    }

    /// Where [`now`](Self::now) is shown, in nanoseconds.
    pub(crate) fn shown(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.shown)
    }

    /// Lets everything happen that is due until `to`.
    pub(crate) fn advance(&mut self, to: Instant) {
        let to = to.max(self.now);
        while let Some(back) = self.plug.back_at.filter(|&back| back <= to) {
            self.run(back);
            // Whoever pulled it out once more meanwhile has said when it comes back.
            if self.plug.back_at == Some(back) {
                self.replug();
            }
        }
        self.run(to);
    }

    fn run(&mut self, to: Instant) {
        while let Some(step) = self.wire.step(to) {
            match step {
                Step::Delivered => self.inboxes.iter_mut().for_each(|(_, inbox)| put(inbox, &self.wire.arrived)),
                Step::Echoed(to, byte) => {
                    if let Some(inbox) = self.inbox_mut(to) {
                        put(inbox, &[byte]);
                    }
                }
                Step::Heard { bytes, silent } => {
                    self.hear(&bytes, silent);
                    self.wire.spare_frame = bytes;
                }
            }
            if !self.plug.is_in {
                self.empty_inboxes();
            }
        }
        self.now = self.now.max(to);
        self.shown.store(self.now.as_nanos(), Ordering::Release);
    }

    /// The master `from` sends at `at`; returns when its last character has left.
    pub(crate) fn transmit(&mut self, from: Listener, at: Instant, bytes: &[u8]) -> Instant {
        self.advance(at);
        self.wire.transmit(from, self.now, bytes)
    }

    /// When to [`advance`](Self::advance) next.
    pub(crate) fn next_wakeup(&self) -> Option<Wakeup> {
        self.wire.next_wakeup()
    }

    /// Pulls the adapter out at `at`, until [`replug`](Self::replug) or, where it is known, until `back_at`.
    pub(crate) fn unplug(&mut self, at: Instant, back_at: Option<Instant>) {
        if self.plug.is_in {
            self.plug.is_in = false;
            self.plug.pulls += 1;
            self.wire.cut_off(at);
            self.empty_inboxes();
        }
        self.plug.back_at = back_at;
    }

    /// Puts the adapter back.
    pub(crate) fn replug(&mut self) {
        self.plug.is_in = true;
        self.plug.back_at = None;
    }

    pub(crate) fn is_plugged(&self) -> bool {
        self.plug.is_in
    }

    /// How often the adapter was pulled out.
    pub(crate) fn pulls(&self) -> u64 {
        self.plug.pulls
    }

    /// The drive with the address `unit`, as it is now.
    pub(crate) fn drive(&mut self, unit: UnitAddress) -> Option<&mut Drive> {
        let drive = self.drives.get_mut(unit)?;
        drive.advance(self.now);
        Some(drive)
    }

    /// A master begins to listen.
    pub(crate) fn attach(&mut self) -> Listener {
        let listener = Listener(self.next_listener);
        self.next_listener += 1;
        self.inboxes.push((listener, VecDeque::new()));
        listener
    }

    /// A master is gone.
    pub(crate) fn detach(&mut self, listener: Listener) {
        self.inboxes.retain(|(name, _)| *name != listener);
    }

    /// Moves what arrived for `listener` into `buffer`; returns how much.
    pub(crate) fn take(&mut self, listener: Listener, buffer: &mut [u8]) -> usize {
        let Some(inbox) = self.inbox_mut(listener) else { return 0 };
        let count = inbox.len().min(buffer.len());
        if count > 0 {
            for (slot, byte) in buffer.iter_mut().zip(inbox.drain(..count)) {
                *slot = byte;
            }
        }
        count
    }

    /// As [`take`](Self::take), but of a run of characters that still goes on only when there are `fifo` of them.
    #[cfg(unix)]
    pub(crate) fn hand_over(&mut self, listener: Listener, buffer: &mut [u8], fifo: usize) -> usize {
        if self.wire.is_amid_run() && self.held(listener) < fifo { 0 } else { self.take(listener, buffer) }
    }

    /// When to [`advance`](Self::advance) next for the sake of [`hand_over`](Self::hand_over).
    #[cfg(unix)]
    pub(crate) fn next_hand_over(&self, listener: Listener, fifo: usize) -> Option<Wakeup> {
        self.wire.next_lump(fifo.saturating_sub(self.held(listener)).max(1))
    }

    /// How much `listener` has not taken.
    #[cfg(unix)]
    fn held(&self, listener: Listener) -> usize {
        self.inboxes.iter().find(|(name, _)| *name == listener).map_or(0, |(_, inbox)| inbox.len())
    }

    fn inbox_mut(&mut self, listener: Listener) -> Option<&mut VecDeque<u8>> {
        self.inboxes.iter_mut().find(|(name, _)| *name == listener).map(|(_, inbox)| inbox)
    }

    fn empty_inboxes(&mut self) {
        self.inboxes.iter_mut().for_each(|(_, inbox)| inbox.clear());
    }

    /// Every unit heard `bytes`; the one they are for answers. What is no frame gets silence.
    fn hear(&mut self, bytes: &[u8], silent: Instant) {
        let Ok(frame) = Frame::parse(bytes) else { return self.drives.iter_mut().for_each(Drive::hear_garbage) };
        match Destination::from_wire(frame.address()) {
            Ok(Destination::Broadcast) => {
                for drive in self.drives.iter_mut() {
                    drive.handle(silent, frame.pdu());
                }
            }
            Ok(Destination::Unit(unit)) => {
                let Some(drive) = self.drives.get_mut(unit) else { return };
                let hits = self.wire.faults.next();
                if hits.has(FaultKind::Deaf) {
                    self.wire.faults.happened(FaultKind::Deaf);
                    return;
                }
                let answer = drive.answer(silent, frame.pdu());
                let ready = silent + drive.response_delay();
                if hits.has(FaultKind::Unplug) && self.plug.is_in {
                    self.wire.faults.happened(FaultKind::Unplug);
                    self.unplug(silent, Some(silent + self.wire.faults.times.replug));
                }
                if let Some(answer) = answer {
                    self.wire.answer(unit.get(), ready, answer.as_bytes(), hits);
                }
            }
            Err(_) => {}
        }
    }
}

/// Bytes arrive.
fn put(inbox: &mut VecDeque<u8>, bytes: &[u8]) {
    inbox.extend(bytes);
    if inbox.len() > INBOX {
        inbox.drain(..inbox.len() - INBOX);
    }
}

#[cfg(all(test, unix))]
mod tests {
    #![expect(clippy::unwrap_used, reason = "a test may panic")]

    use std::collections::BTreeMap;
    use std::time::Duration;

    use drivebus_rtu::{Adu, Request};
    use proptest::prelude::*;

    use super::*;
    use crate::drive::{Family, Map};

    fn world(strict_silence: bool) -> World {
        let map = Arc::new(Map::new(Family::named("gd350").unwrap()).unwrap());
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
        let send =
            (1..=2_u8, 1..=16_u16, 3..30_usize).prop_map(|(unit, count, length)| Act::Send { unit, count, length });
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
        world.wire.faults.script(faults);
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
        prop::sample::select(&FaultKind::ALL[..16])
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
                world.wire.faults.script(&faults);
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
}
