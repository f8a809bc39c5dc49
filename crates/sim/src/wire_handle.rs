//! The handle to the wire: what it saw, and what it is told to spoil.

use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::SerialFormat;

use crate::error::SimError;
use crate::faults::FaultKind;
use crate::shared::Shared;
use crate::trace::Transmission;

/// The wire: what it saw, and what it is told to spoil.
#[derive(Debug, Clone)]
pub struct SimulatedLine {
    shared: Arc<Shared>,
}

impl SimulatedLine {
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared }
    }

    /// Transmissions of masters, right or wrong, that silence or the next one has told apart.
    pub fn requests(&self) -> u64 {
        self.shared.present().wire.requests
    }

    /// What the units are set to.
    pub fn format(&self) -> SerialFormat {
        *self.shared.present().wire.format()
    }

    /// Sets every unit to `format`, as at their keypads. What is on its way is lost.
    ///
    /// Ports stay as they are: a pseudo-terminal has the speed that a program set, a TCP port what the simulation began
    /// with. Where that is not what the units are set to, they make nothing of what they are sent. A line in this process
    /// always fits.
    pub fn set_format(&self, format: SerialFormat) {
        self.shared.present().set_format(format);
    }

    /// Requests whose first bit came less than 3.5 characters after the last bit on the wire.
    pub fn silence_violations(&self) -> u64 {
        self.shared.present().wire.silence_violations
    }

    /// Characters that were spoilt because both sides spoke at once.
    pub fn collisions(&self) -> u64 {
        self.shared.present().wire.collisions
    }

    /// The next answer on the line is `bytes` instead, as they are. Several wait in order.
    pub fn answer_with(&self, bytes: &[u8]) {
        self.shared.present().wire.spoil.answer_with(bytes);
    }

    /// The next `count` answers are lost.
    pub fn drop_answers(&self, count: u32) {
        self.shared.present().wire.spoil.drop_answers(count);
    }

    /// The next `count` answers come this much later.
    pub fn delay_answers(&self, delay: Duration, count: u32) {
        self.shared.present().wire.spoil.delay_answers(delay, count);
    }

    /// `bytes` come right before the next `count` answers.
    pub fn noise_before(&self, bytes: &[u8], count: u32) {
        self.shared.present().wire.spoil.noise_before(bytes, count);
    }

    /// `bytes` come right after the next `count` answers.
    pub fn noise_after(&self, bytes: &[u8], count: u32) {
        self.shared.present().wire.spoil.noise_after(bytes, count);
    }

    /// Forgets every fault: those that wait, the rates and the script. An adapter that echoes goes on echoing.
    pub fn clear(&self) {
        let mut world = self.shared.present();
        world.wire.spoil.clear();
        world.wire.faults.clear();
    }

    /// Lets `kind` happen to a share of all answers, each by itself. 0.0 ends it.
    ///
    /// # Errors
    ///
    /// [`SimError::Rate`]: `share` is not in 0.0..=1.0.
    pub fn set_rate(&self, kind: FaultKind, share: f64) -> Result<(), SimError> {
        if !(0.0..=1.0).contains(&share) {
            return Err(SimError::Rate { kind, share });
        }
        self.shared.present().wire.faults.set_rate(kind, share);
        Ok(())
    }

    /// The kinds that have a rate, and the rate.
    pub fn rates(&self) -> Vec<(FaultKind, f64)> {
        let world = self.shared.present();
        let rates = FaultKind::ALL.into_iter().map(|kind| (kind, world.wire.faults.rate(kind)));
        rates.filter(|&(_, rate)| rate > 0.0).collect()
    }

    /// Says which answer is hit by what: answers are counted from now on, and the next one is 1.
    ///
    /// Every request that reaches a unit counts, also where a fault then keeps the answer back. Replaces what was left
    /// of an earlier script; rates go on beside it.
    pub fn script(&self, faults: &[(u64, FaultKind)]) {
        self.script_with(faults, &[]);
    }

    /// As [`script`](Self::script), and says which answer is replaced by which bytes, as they are. What hits such an answer
    /// hits the bytes.
    pub fn script_with(&self, faults: &[(u64, FaultKind)], instead: &[(u64, &[u8])]) {
        self.shared.present().wire.faults.script(faults, instead);
    }

    /// How often `kind` has happened.
    pub fn counts(&self, kind: FaultKind) -> u64 {
        self.shared.present().wire.faults.count(kind)
    }

    /// How much later [`FaultKind::Delay`] lets an answer come, at most; 50 ms if it is not said.
    pub fn set_delay(&self, longest: Duration) {
        self.shared.present().wire.faults.times.delay = longest;
    }

    /// How much later [`FaultKind::Late`] lets an answer come, at least; twice as much at most. 0.6 s if it is not said.
    pub fn set_late(&self, shortest: Duration) {
        self.shared.present().wire.faults.times.late = shortest;
    }

    /// How much later [`FaultKind::Overtaken`] lets an answer come, at least and at most; 0.6 s to 2.4 s if it is not said.
    pub fn set_overtaken(&self, least: Duration, most: Duration) {
        self.shared.present().wire.faults.times.overtaken = (least, most);
    }

    /// How long [`FaultKind::Unplug`] keeps the adapter out; 0.5 s if it is not said.
    pub fn set_replug(&self, time: Duration) {
        self.shared.present().wire.faults.times.replug = time;
    }

    /// Whether the adapter hands every character back to the master that sent it, when it has left.
    pub fn echo(&self) -> bool {
        self.shared.present().wire.echo
    }

    /// Sets whether the adapter echoes, from the next request on.
    pub fn set_echo(&self, echo: bool) {
        self.shared.present().wire.echo = echo;
    }

    /// Pulls the adapter out. What it was sending is cut off, and what units answer nobody hears.
    ///
    /// A line in this process is lost; a pseudo-terminal hangs up; a TCP connection is closed, and the next refused.
    pub fn unplug(&self) {
        let mut world = self.shared.present();
        let now = world.now();
        world.unplug(now, None);
        drop(world);
        self.shared.outlets.unplug();
    }

    /// Puts the adapter back. A pseudo-terminal then has another name.
    ///
    /// # Errors
    ///
    /// [`SimError::Io`]: the system has no port to give, or the TCP port is taken.
    pub fn replug(&self) -> Result<(), SimError> {
        self.shared.outlets.replug()?;
        self.shared.present().replug();
        Ok(())
    }

    /// Whether the adapter is plugged in.
    pub fn is_plugged(&self) -> bool {
        self.shared.present().is_plugged()
    }

    /// The last 1000 transmissions, oldest first.
    pub fn trace(&self) -> Vec<Transmission> {
        self.shared.present().wire.trace.to_vec()
    }
}
