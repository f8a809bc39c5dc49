//! One simulated drive: a drive of some family with a motor and a machine on it.
//!
//! What a family does otherwise than the others stands in `family`. What the manuals leave open is marked "Assumption:"
//! where it is decided: there, in the files of this folder, and in `motor`. In general:
//!
//! - Assumption: every inverter has the same small motor.
//! - Assumption: parameters whose access class is not printed can be changed at any time; those whose range is not
//!   printed take any word.
//! - Assumption: baud rate, format and address (in P14 or P30) are stored, and change nothing.

mod all;
mod bus;
mod family;
mod machine;
mod map;
mod places;
mod refusal;
mod refusing;
mod settings;
mod store;
mod words;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::{ExceptionCode, Instant, Table, UnitAddress};

pub(crate) use all::Drives;
pub(crate) use family::{Family, own, unlisted};
use family::{Kind, OnSilence, Scaled, Silence};
use machine::{Command, Machine, RunState, Settings};
pub(crate) use map::Map;
use refusal::Refusal;
use refusing::Refusing;
pub use refusing::{Asked, Refusals};
use settings::obeys;
use store::Store;

/// How many writes a drive remembers.
const WRITES_KEPT: usize = 100_000;
/// Load of a drive nobody has set one for, as a share of rated torque.
const USUAL_LOAD: f64 = 0.3;

/// A word that the drive took from the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteRecord {
    /// When.
    pub at: Instant,
    /// Where.
    pub table: Table,
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
    /// The words that the bus sets.
    control: Vec<u16>,
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
    frames: Frames,
    /// How many of the words before a run have come.
    led_up: usize,
    /// Whether one of [`Roles::runs_after`](family::Roles::runs_after) has been written.
    may_run: bool,
    /// The run that waits for that.
    waiting: Option<Command>,
    /// What it was told to refuse.
    refusing: Option<Refusing>,
    /// The highest words that it was told to take, by address.
    limits: BTreeMap<u16, u16>,
}

/// Frames counted since the power came, over and over from 65 535.
///
/// Assumption: those that are for this unit or for all, those it answered, and those of anybody with a wrong CRC.
#[derive(Debug, Default)]
struct Frames {
    received: u16,
    sent: u16,
    spoilt: u16,
}

impl Drive {
    /// A drive fresh from the factory, switched on at `now`.
    pub(crate) fn new(unit: UnitAddress, map: Arc<Map>, now: Instant) -> Self {
        let store = Store::new(map.parameters(), map.factory(unit));
        let control = vec![0; map.control_words()];
        let family = map.family();
        let settings = settings::settings(family, &store, 0);
        let load = if family.kind == Kind::Inverter { USUAL_LOAD } else { 0.0 };
        Self {
            unit,
            store,
            control,
            machine: Machine::new(now, load, family.faults.overload),
            map,
            settings,
            unlocked: false,
            inputs: 0,
            analog: [0; 4],
            last_heard: None,
            writes: VecDeque::new(),
            words_written: 0,
            frames: Frames::default(),
            led_up: 0,
            may_run: false,
            waiting: None,
            refusing: None,
            limits: BTreeMap::new(),
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
        self.has_tripped(code);
    }

    /// A fault ends what was begun of a start, and is remembered.
    fn has_tripped(&mut self, code: u16) {
        self.led_up = 0;
        self.waiting = None;
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

    /// Switches the drive off and on at `now`: RAM, the words that the bus set and the run state are lost.
    ///
    /// Assumption: a fault does not outlive the power, its place in the history does; a password locks again.
    pub(crate) fn power_cycle(&mut self, now: Instant) {
        self.store.power_cycle();
        self.control.fill(0);
        self.unlocked = false;
        self.last_heard = None;
        self.frames = Frames::default();
        self.led_up = 0;
        (self.may_run, self.waiting) = (false, None);
        self.machine = self.machine.after_power_loss(now);
        self.settings = settings::settings(self.map.family(), &self.store, 0);
    }

    /// Gives every parameter its factory value, as the keypad does; a password goes too. Nothing else changes.
    ///
    /// Assumption: the unit's address on the line and the history of its faults stay. False, and nothing done, while
    /// the motor is fed.
    pub(crate) fn factory_reset(&mut self) -> bool {
        if self.machine.is_running() {
            return false;
        }
        let history = &self.family().roles.fault_history;
        let kept: Vec<(u16, u16)> = history.iter().map(|&address| (address, self.parameter(address))).collect();
        self.store.reset(self.map.factory(self.unit));
        for (address, word) in kept {
            self.store.keep(address, word);
        }
        self.unlocked = false;
        self.settings_may_have_changed();
        true
    }

    /// Refuses what `refusals` say, from `now` on, and nothing that it was told to refuse before.
    pub(crate) fn refuse(&mut self, now: Instant, refusals: Refusals, seed: u64) {
        self.refusing = Some(Refusing::new(refusals, now, seed));
    }

    /// Refuses only what its family refuses.
    pub(crate) fn refuse_no_more(&mut self) {
        self.refusing = None;
    }

    /// Takes no more than `highest` at `address` by 06H, and says so in its answer.
    pub(crate) fn limit(&mut self, address: u16, highest: u16) {
        self.limits.insert(address, highest);
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

    /// What is typed of its family; its name is that of the profile.
    pub(crate) fn family(&self) -> &Family {
        self.map.family()
    }

    pub(crate) fn has_motor(&self) -> bool {
        self.family().kind == Kind::Inverter
    }

    pub(crate) fn load(&self) -> f64 {
        self.machine.load()
    }

    pub(crate) fn inputs(&self) -> u16 {
        self.inputs
    }

    /// The state by its name in profiles.
    pub(crate) fn state(&self) -> &'static str {
        match self.machine.state() {
            RunState::Forward if !self.has_motor() => "running",
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
        self.store.eeprom_writes_of(places::table_of(self.plain(address.into())).1)
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

    /// How long after a request's silence the answer begins: what its parameter says, or the drive's own processing
    /// time if longer.
    ///
    /// Assumption: the time counts from the end of the silence, because only then is the request received; the
    /// drive's own processing takes no time.
    pub(crate) fn response_delay(&self) -> Duration {
        let delay = self.family().roles.response_delay;
        Duration::from_millis(u64::from(delay.map_or(self.family().delay, |delay| self.parameter(delay))))
    }

    /// Something was on the line that is no frame.
    pub(crate) fn hear_garbage(&mut self) {
        self.frames.spoilt = self.frames.spoilt.wrapping_add(1);
    }

    fn exception(&self, refusal: Refusal) -> ExceptionCode {
        ExceptionCode((self.family().exception)(refusal))
    }

    /// A parameter's value in force; 0 where there is none.
    fn parameter(&self, address: u16) -> u16 {
        self.store.get(address).unwrap_or(0)
    }

    /// The value in force of a parameter that not every family has; 0 where there is none.
    fn role(&self, address: Option<u16>) -> u16 {
        address.map_or(0, |address| self.parameter(address))
    }

    fn control_word(&self, address: u32) -> u16 {
        self.map.control(address).and_then(|place| self.control.get(place)).copied().unwrap_or(0)
    }

    /// Tells the machine what a parameter or setpoint now asks of it.
    fn settings_may_have_changed(&mut self) {
        let speed = self.family().roles.speed.as_ref().map_or(0, |speed| self.control_word(speed.register));
        let settings = settings::settings(self.family(), &self.store, speed);
        if settings != self.settings {
            self.settings = settings;
            self.machine.update(&settings);
        }
    }

    fn run_machine(&mut self, to: Instant) {
        if let Some(code) = self.machine.advance(to) {
            self.has_tripped(code);
        }
    }

    /// Assumption: the newest fault stands first in the history and stays there after its reset.
    fn remember_fault(&mut self, code: u16) {
        let mut newer = code;
        for &address in &self.map.family().roles.fault_history {
            let older = self.store.get(address).unwrap_or(0);
            self.store.keep(address, newer);
            newer = older;
        }
    }

    /// When the time for a silent bus runs out, if it is set.
    ///
    /// Assumption: only frames for this unit count (broadcasts too), and the time runs from the first one on.
    fn bus_timeout_at(&self) -> Option<Instant> {
        let last = self.last_heard?;
        let Scaled { address, counts } = self.family().roles.bus_timeout?;
        let word = self.parameter(address);
        (word > 0).then(|| last + Duration::from_secs_f64(f64::from(word) / counts))
    }

    /// What is set to be done about a silent bus.
    ///
    /// Assumption: where a run waits for a word, it does so again behind a silence.
    fn miss_the_bus(&mut self) {
        (self.may_run, self.waiting) = (false, None);
        let family = self.family();
        let action = match &family.roles.on_silence {
            None => Some(OnSilence::Trip),
            Some(Silence { parameter, words }) => {
                let set = self.parameter(*parameter);
                words.iter().find(|&&(word, _)| word == set).map(|&(_, action)| action)
            }
        };
        match (action, family.faults.silent_bus) {
            (Some(OnSilence::Trip), Some(code)) => self.trip(code),
            (Some(OnSilence::Trip), None) | (Some(OnSilence::Coast), _) => {
                self.machine.command(Command::Coast, &self.settings);
            }
            (Some(OnSilence::StopIfObeyed), _) if !self.obeys_bus() => {}
            (Some(OnSilence::StopIfObeyed | OnSilence::Stop), _) => self.machine.command(Command::Stop, &self.settings),
            (None, _) => {}
        }
    }

    /// Whether commands from the bus move the motor.
    fn obeys_bus(&self) -> bool {
        obeys(self.family(), &self.store)
    }
}
