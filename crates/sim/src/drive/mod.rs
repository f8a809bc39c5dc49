//! One simulated drive: a Goodrive350 with a motor and a machine on it.
//!
//! It follows the GD350 operation manual, section 9.4. What the manual leaves open is marked "Assumption:" where it is
//! decided: here, in the files of this folder, and in `motor`. In general:
//!
//! - Assumption: parameters whose access class is not printed can be changed at any time; those whose range is not
//!   printed take any word.
//! - Assumption: baud rate, format and address (P14.00 to P14.02) are stored, and change nothing.

mod addresses;
mod all;
mod bus;
mod machine;
mod map;
mod places;
mod refusal;
mod settings;
mod store;
mod words;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::{Instant, UnitAddress};

use addresses as at;
pub(crate) use all::Drives;
use machine::{Command, Machine, RunState, Settings};
pub(crate) use map::Map;
use store::Store;

/// How many writes a drive remembers.
const WRITES_KEPT: usize = 100_000;
/// Load of a drive nobody has set one for, as a share of rated torque.
const USUAL_LOAD: f64 = 0.3;
/// Number of words from 2000H on.
const CONTROL_WORDS: usize = (at::CONTROL_BLOCK_END - at::CONTROL_COMMAND + 1) as usize;
/// Fault number of a silent bus.
const CE: u16 = 18;

/// A word that the drive took from the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteRecord {
    /// When.
    pub at: Instant,
    /// The address as it was written to, with the RAM bit if it was set.
    pub address: u16,
    /// The word.
    pub value: u16,
}

/// One drive. Time is an argument; nothing in here reads a clock.
#[derive(Debug)]
pub(crate) struct Drive {
    unit: UnitAddress,
    map: Arc<Map>,
    store: Store,
    /// 2000H to 200EH.
    control: [u16; CONTROL_WORDS],
    machine: Machine,
    /// What the machine was last told; compared, so that only a change bends a ramp.
    settings: Settings,
    unlocked: bool,
    /// Digital inputs, bit 0 = S1.
    inputs: u16,
    /// AI1 to AI4 as the registers show them.
    analog: [u16; 4],
    /// The last frame for this unit; `None` until the first one, and after a silence was dealt with.
    last_heard: Option<Instant>,
    writes: VecDeque<WriteRecord>,
    words_written: u64,
}

impl Drive {
    /// A drive fresh from the factory, switched on at `now`.
    pub(crate) fn new(unit: UnitAddress, map: Arc<Map>, now: Instant) -> Self {
        let store = Store::new(map.parameters(), map.factory(unit));
        let control = [0; CONTROL_WORDS];
        let settings = settings::settings(&store, &control);
        Self {
            unit,
            map,
            store,
            control,
            machine: Machine::new(now, USUAL_LOAD),
            settings,
            unlocked: false,
            inputs: 0,
            analog: [0; 4],
            last_heard: None,
            writes: VecDeque::new(),
            words_written: 0,
        }
    }

    /// Lets time pass until `now`.
    pub(crate) fn advance(&mut self, now: Instant) {
        if let Some(timeout) = self.bus_timeout_at()
            && timeout <= now
        {
            self.run_machine(timeout);
            self.last_heard = None;
            self.miss_the_bus();
        }
        self.run_machine(now);
    }

    /// Trips the drive with fault `code`, as a cause from outside that is gone at once.
    pub(crate) fn trip(&mut self, code: u16) {
        self.machine.trip(code);
        self.remember_fault(code);
    }

    /// Trips the drive, and keeps the cause there until [`release_fault`](Self::release_fault).
    pub(crate) fn hold_fault(&mut self, code: u16) {
        self.machine.hold_fault(true);
        self.trip(code);
    }

    /// The cause of the present fault is gone; it can be reset.
    pub(crate) fn release_fault(&mut self) {
        self.machine.hold_fault(false);
    }

    /// Switches the drive off and on at `now`: RAM, the words of the 2000H block and the run state are lost.
    ///
    /// Assumption: a fault does not outlive the power, its place in the history does; a password locks again.
    pub(crate) fn power_cycle(&mut self, now: Instant) {
        self.store.power_cycle();
        self.control = [0; CONTROL_WORDS];
        self.unlocked = false;
        self.last_heard = None;
        self.machine = Machine::new(now, self.machine.load());
        self.settings = settings::settings(&self.store, &self.control);
    }

    pub(crate) fn set_load(&mut self, load: f64) {
        self.machine.set_load(load);
    }

    pub(crate) fn set_inputs(&mut self, inputs: u16) {
        self.inputs = inputs;
    }

    /// Sets the word of an analog input: `index` 0..=3 for AI1 to AI4.
    pub(crate) fn set_analog(&mut self, index: usize, word: u16) {
        if let Some(analog) = self.analog.get_mut(index) {
            *analog = word;
        }
    }

    pub(crate) fn profile(&self) -> &str {
        self.map.profile()
    }

    pub(crate) fn load(&self) -> f64 {
        self.machine.load()
    }

    pub(crate) fn inputs(&self) -> u16 {
        self.inputs
    }

    /// The state by its name in the profile.
    pub(crate) fn state(&self) -> &'static str {
        match self.machine.state() {
            RunState::Forward => "forward",
            RunState::Reverse => "reverse",
            RunState::Stopped => "stopped",
            RunState::Fault => "fault",
        }
    }

    pub(crate) fn frequency(&self) -> f64 {
        self.machine.frequency()
    }

    pub(crate) fn speed(&self) -> f64 {
        self.machine.speed()
    }

    pub(crate) fn fault(&self) -> u16 {
        self.machine.fault().unwrap_or(0)
    }

    pub(crate) fn eeprom_writes(&self) -> u64 {
        self.store.eeprom_writes()
    }

    pub(crate) fn eeprom_writes_of(&self, address: u16) -> u64 {
        self.store.eeprom_writes_of(address)
    }

    pub(crate) fn writes(&self) -> Vec<WriteRecord> {
        self.writes.iter().copied().collect()
    }

    pub(crate) fn take_writes(&mut self) -> Vec<WriteRecord> {
        std::mem::take(&mut self.writes).into()
    }

    pub(crate) fn words_written(&self) -> u64 {
        self.words_written
    }

    /// How long after a request's silence the answer begins: P14.03, or the drive's own processing time if longer.
    ///
    /// Assumption: the time counts from the end of the silence, because only then is the request received; the
    /// drive's own processing takes no time.
    pub(crate) fn response_delay(&self) -> Duration {
        Duration::from_millis(u64::from(self.parameter(at::RESPONSE_DELAY)))
    }

    /// A parameter's value in force; 0 where the profile does not have it.
    fn parameter(&self, address: u16) -> u16 {
        self.store.get(address).unwrap_or(0)
    }

    fn control_word(&self, address: u16) -> u16 {
        self.control.get(usize::from(address.wrapping_sub(at::CONTROL_COMMAND))).copied().unwrap_or(0)
    }

    /// Tells the machine what a parameter or setpoint now asks of it.
    fn settings_may_have_changed(&mut self) {
        let settings = settings::settings(&self.store, &self.control);
        if settings != self.settings {
            self.settings = settings;
            self.machine.update(&settings);
        }
    }

    fn run_machine(&mut self, to: Instant) {
        if let Some(code) = self.machine.advance(to) {
            self.remember_fault(code);
        }
    }

    /// Assumption: the newest fault stands in P07.27 and stays there after its reset.
    fn remember_fault(&mut self, code: u16) {
        let mut newer = code;
        for address in at::FAULT_HISTORY {
            let older = self.parameter(address);
            self.store.keep(address, newer);
            newer = older;
        }
    }

    /// When P14.04 runs out, if it is set.
    ///
    /// Assumption: only frames for this unit count (broadcasts too), and the time runs from the first one on.
    fn bus_timeout_at(&self) -> Option<Instant> {
        let tenths = self.parameter(at::BUS_TIMEOUT);
        let last = self.last_heard?;
        (tenths > 0).then(|| last + Duration::from_millis(u64::from(tenths) * 100))
    }

    /// What P14.05 says to do about a silent bus: 0 alarm and coast, 1 nothing, 2 and 3 stop without alarm.
    fn miss_the_bus(&mut self) {
        match self.parameter(at::BUS_TIMEOUT_ACTION) {
            0 => self.trip(CE),
            2 if self.obeys_bus() => self.machine.command(Command::Stop, &self.settings),
            3 => self.machine.command(Command::Stop, &self.settings),
            _ => {}
        }
    }

    /// Whether commands at 2000H move the motor.
    ///
    /// Assumption: 0 in P00.02 is Modbus; the digit is not printed.
    fn obeys_bus(&self) -> bool {
        self.parameter(at::RUN_CHANNEL) == 2 && self.parameter(at::RUN_BUS) == 0
    }
}
