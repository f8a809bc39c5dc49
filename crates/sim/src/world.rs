//! Everything that is simulated: one wire, the units on it, and the masters that listen to it.
//!
//! It reads no clock. Whoever holds it says how far time has come.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use drivebus_rtu::{Destination, Frame, Instant, SerialFormat, UnitAddress};

use crate::drive::{Drive, Drives};
use crate::faults::FaultKind;
use crate::wire::{Listener, Step, Wakeup, Wire};

/// Bytes kept for a master that does not read; older ones are lost, as in a serial port.
const INBOX: usize = 65_536;

/// The simulated world.
#[derive(Debug)]
pub(crate) struct World {
    now: Instant,
    /// The same in nanoseconds, for who only wants to know the time.
    shown: Arc<AtomicU64>,
    pub(crate) wire: Wire,
    drives: Drives,
    masters: Vec<Master>,
    next_listener: u64,
    plug: Plug,
    /// Where chance comes from.
    seed: u64,
}

/// One of those who listen.
#[derive(Debug)]
struct Master {
    name: Listener,
    inbox: VecDeque<u8>,
    /// Whether it hears masters too, and only listens. It is on the wire, and not at the adapter that is pulled out.
    overhears: bool,
    /// What its side of the line is set to; `None`: whatever the units are.
    adapter: Option<SerialFormat>,
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
            masters: Vec::new(),
            next_listener: 0,
            plug: Plug { is_in: true, pulls: 0, back_at: None },
            seed,
        }
    }

    /// Where chance comes from.
    pub(crate) fn seed(&self) -> u64 {
        self.seed
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
                Step::Delivered => {
                    for master in &mut self.masters {
                        match misfit(master.adapter, self.wire.format()) {
                            None => put(&mut master.inbox, &self.wire.arrived),
                            Some(_) => put(&mut master.inbox, &self.wire.misread()),
                        }
                    }
                }
                Step::Passed { from, byte, back } => self.pass(from, byte, back),
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
        let adapter = self.masters.iter().find(|master| master.name == from).and_then(|master| master.adapter);
        self.wire.transmit(from, self.now, bytes, misfit(adapter, self.wire.format()))
    }

    /// A character of `from` has passed; `back` says whether its adapter hands it back.
    fn pass(&mut self, from: Listener, byte: u8, back: bool) {
        let sender = self.masters.iter().find(|master| master.name == from).and_then(|master| master.adapter);
        let sent_as = sender.unwrap_or(*self.wire.format());
        for master in &mut self.masters {
            if master.overhears {
                let fits = misfit(master.adapter, &sent_as).is_none();
                put(&mut master.inbox, &[if fits { byte } else { self.wire.misread_one(byte) }]);
            } else if back && master.name == from {
                put(&mut master.inbox, &[byte]);
            }
        }
    }

    /// Sets the adapter of the master `whose`.
    #[cfg(unix)]
    pub(crate) fn set_adapter(&mut self, whose: Listener, adapter: SerialFormat) {
        if let Some(master) = self.masters.iter_mut().find(|master| master.name == whose) {
            master.adapter = Some(adapter);
        }
    }

    /// Sets every unit to `format`. What is on its way is lost.
    pub(crate) fn set_format(&mut self, format: SerialFormat) {
        self.wire.set_format(self.now, format);
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
        let listener = Listener::new(self.next_listener);
        self.next_listener += 1;
        self.masters.push(Master { name: listener, inbox: VecDeque::new(), overhears: false, adapter: None });
        listener
    }

    /// One begins to listen that hears masters too.
    #[cfg(target_os = "linux")]
    pub(crate) fn attach_ear(&mut self) -> Listener {
        let listener = self.attach();
        self.masters.iter_mut().filter(|master| master.name == listener).for_each(|ear| ear.overhears = true);
        self.wire.ears += 1;
        listener
    }

    /// A master is gone.
    pub(crate) fn detach(&mut self, listener: Listener) {
        self.masters.retain(|master| master.name != listener);
        self.wire.ears = self.masters.iter().filter(|master| master.overhears).count();
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
        let Some(master) = self.masters.iter().find(|master| master.name == listener) else { return 0 };
        let amid_run = self.wire.is_amid_run(self.wire.echo || master.overhears);
        if amid_run && master.inbox.len() < fifo { 0 } else { self.take(listener, buffer) }
    }

    /// When to [`advance`](Self::advance) next for the sake of [`hand_over`](Self::hand_over), to `listener` and to all
    /// that overhear it.
    #[cfg(unix)]
    pub(crate) fn next_hand_over(&self, listener: Listener, fifo: usize) -> Option<Wakeup> {
        let held = self.masters.iter().filter(|master| master.overhears || master.name == listener);
        let lump = |master: &Master| self.wire.next_lump(fifo.saturating_sub(master.inbox.len()).max(1));
        held.filter_map(lump).min_by_key(|wakeup| wakeup.at)
    }

    fn inbox_mut(&mut self, listener: Listener) -> Option<&mut VecDeque<u8>> {
        self.masters.iter_mut().find(|master| master.name == listener).map(|master| &mut master.inbox)
    }

    fn empty_inboxes(&mut self) {
        self.masters.iter_mut().filter(|master| !master.overhears).for_each(|master| master.inbox.clear());
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
                let instead = self.wire.faults.instead();
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
                    self.wire.answer(unit.get(), ready, instead.as_deref().unwrap_or(answer.as_bytes()), hits);
                }
            }
            Err(_) => {}
        }
    }
}

/// What `adapter` is set to, if no unit that is set to `units` can make anything of what it sends.
///
/// Stop bits do not tell: a receiver looks at one of them. Assumption: a UART that samples in the middle of a bit bears
/// 3 % between the two speeds.
fn misfit(adapter: Option<SerialFormat>, units: &SerialFormat) -> Option<SerialFormat> {
    adapter.filter(|adapter| {
        let (theirs, ours) = (u64::from(adapter.baud_rate()), u64::from(units.baud_rate()));
        100 * theirs.abs_diff(ours) > 3 * ours
            || (adapter.parity(), adapter.data_bits()) != (units.parity(), units.data_bits())
    })
}

/// Bytes arrive.
fn put(inbox: &mut VecDeque<u8>, bytes: &[u8]) {
    inbox.extend(bytes);
    if inbox.len() > INBOX {
        inbox.drain(..inbox.len() - INBOX);
    }
}

#[cfg(all(test, unix))]
mod tests;
