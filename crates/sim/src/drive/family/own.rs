//! A family of somebody's own: all that its profile says, done by the same machine.
//!
//! Nobody has typed it a second time, so a mistake in the profile agrees with itself here.
//!
//! - Assumption: what a profile has no role for goes by its name and its unit: a word such as `current` or `dc`, and none
//!   such as `rated`; `input_state`; and `acceleration_time_1`, without which a start takes as long as a stop. Other
//!   registers that can only be read are 0.
//! - Assumption: the fault called OL1 is that of an overload, and CE that of a silent bus where the watchdog names none.
//!   Without OL1 an overload does not trip; without a fault of a silent bus the motor coasts.
//! - Assumption: refusals are those of the Modbus specification, and 04H for what the drive does not do now.
//! - Assumption: a jog is as fast, and its ramps take as long, as where no parameter is known.

use std::borrow::Cow;

use drivebus_drives::{
    Access as ProfileAccess, BitField, Command as Told, Control, Entry, Kind as EntryKind, Place, Profile, Quantity,
    Setpoint, State, Table, UnitKind, Value,
};
use drivebus_rtu::huanyang::Protocol;

use super::{
    Absent, Bit, Bounds, Deciding, Family, Faults, Flag, Handshake, Kind, Measure, Memory, OnSilence, Parameter, Range,
    Register, Roles, Scaled, Shows, Silence, Speed, SpeedScale, SpeedUnit, USUAL_DELAY, USUAL_MAX_HZ, register,
};
use crate::drive::machine::{Command, Direction};
use crate::drive::map::{Access, bounds, low_word};
use crate::drive::refusal::by_the_specification;

/// What the bus reads at a register whose name has one of these words, and that has this unit: the first that fits.
const MEASURES: [(&[&str], &str, Measure); 6] = [
    (&["bus", "dc", "link"], "V", Measure::BusVoltage),
    (&["voltage"], "V", Measure::Voltage),
    (&["current"], "A", Measure::Current),
    (&["speed"], "rpm", Measure::Speed),
    (&["power"], "%", Measure::Power),
    (&["torque"], "%", Measure::Torque),
];
/// Words in the names of what does not change as the motor turns.
const NOT_MEASURED: [&str; 8] = ["rated", "set", "setpoint", "reference", "max", "min", "limit", "input"];
const INPUTS: &str = "input_state";
const ACCELERATION: &str = "acceleration_time_1";
const DECELERATION: &str = "deceleration_time_1";
const OVERLOAD: &str = "OL1";
const SILENT_BUS: &str = "CE";

/// The family that `profile` describes, or what a simulation of it lacks, each with its place.
pub(crate) fn family(profile: &Profile) -> Result<Family, Vec<String>> {
    let mut own = Own { profile, missing: Vec::new() };
    let commands = own.commands();
    let states = own.states();
    let speed = if profile.kind() == UnitKind::Inverter { own.speed() } else { None };
    let obeys = own.conditions(profile.control());
    let needs = profile.setpoints().get(&Setpoint::Frequency).map(|setpoint| setpoint.needs.as_slice());
    let needs = own.conditions(needs.unwrap_or_default());
    let [_, _, stopped, _] = states;
    let handshake = Handshake::of(profile, stopped).map_err(|lack| own.missing.push(lack)).unwrap_or_default();
    if !own.missing.is_empty() {
        return Err(own.missing);
    }
    let max_frequency = own.max_frequency();
    let roles = Roles {
        speed_source: (!needs.is_empty()).then(|| obeys.iter().chain(&needs).copied().collect()),
        obeys,
        speed,
        max_frequency,
        handshake,
        reads_single_parameters: profile.requests().single_parameters,
        max_written: Some(profile.requests().max_written),
        absent: profile.requests().absent.map(|word| Absent { word, alone: true }),
        protocol: match profile.requests().protocol {
            drivebus_drives::Protocol::Huanyang => Protocol::Huanyang,
            _ => Protocol::Modbus,
        },
        ..own.roles()
    };
    let delay = profile.serial().map(|serial| u16::try_from(serial.response_delay.as_millis()).unwrap_or(u16::MAX));
    Ok(Family {
        name: Cow::Owned(profile.name().to_owned()),
        kind: match profile.kind() {
            UnitKind::Rectifier => Kind::Rectifier,
            _ => Kind::Inverter,
        },
        functions: profile.functions().to_vec(),
        max_words: profile.max_words(),
        across_groups: profile.requests().across_groups,
        exception: by_the_specification,
        memory: own.memory(),
        identification: own.identification(),
        command: profile.command_address().map(Place::number),
        commands,
        registers: own.registers(states),
        parameters: own.kept_registers().map(Parameter::shown).collect(),
        factory: &[],
        control_word: None,
        elsewhere: own.elsewhere(),
        capped: &[],
        roles,
        delay: delay.unwrap_or(USUAL_DELAY),
        max_hertz: own.highest_hertz().unwrap_or(USUAL_MAX_HZ),
        faults: Faults { overload: own.fault(OVERLOAD), silent_bus: own.silent_bus() },
    })
}

/// A profile that is looked through for what a simulation needs.
struct Own<'a> {
    profile: &'a Profile,
    missing: Vec<String>,
}

impl Own<'_> {
    fn miss(&mut self, place: &str, what: &str) {
        self.missing.push(format!("{place}: {what}"));
    }

    fn address_of(&self, name: &str) -> Option<u16> {
        self.profile.find(name).ok().and_then(Entry::address)
    }

    fn commands(&mut self) -> Vec<(u16, Command)> {
        if self.profile.command_address().is_none() {
            self.miss(
                "profile.toml, [commands]",
                "no register that takes commands, or registers.csv has no address for it",
            );
        }
        let has = |told: Told| self.profile.commands().contains_key(&told);
        let (runs, stops) = (has(Told::RunForward) || has(Told::RunReverse), has(Told::Stop) || has(Told::Coast));
        if !runs {
            self.miss("profile.toml, [commands.codes]", "neither run_forward nor run_reverse");
        }
        if !stops {
            self.miss("profile.toml, [commands.codes]", "neither stop nor coast");
        }
        let others = self.profile.command_codes();
        others.keys().map(|&code| (code, self.profile.command_of(code).map_or(Command::Nothing, done))).collect()
    }

    /// The commands that stand in registers of their own.
    fn elsewhere(&self) -> Vec<(u32, u16, Command)> {
        let known = self.profile.commands().iter();
        known.filter_map(|(&told, known)| Some((known.elsewhere?.number(), known.code, done(told)))).collect()
    }

    /// The word that says which way a run turns, where two commands differ in nothing else.
    fn direction(&self) -> Option<(u32, u16)> {
        self.profile.command_first(Told::RunReverse).map(|(place, word)| (place.number(), word))
    }

    /// The words for forward, reverse, stopped and fault. One that nothing asks for is that of a stopped motor.
    fn states(&mut self) -> [u16; 4] {
        const PLACE: &str = "profile.toml, [state]";
        if self.profile.role("state").and_then(Entry::address).is_none() {
            self.miss(PLACE, "no register that tells the state, or registers.csv has no address for it");
            return [0; 4];
        }
        let stopped = self.word_of(State::Stopped);
        if stopped.is_none() {
            self.miss(PLACE, "no word that means stopped");
        }
        let stopped = stopped.unwrap_or(0);
        let moves = |commands: [Told; 2]| commands.iter().any(|told| self.profile.commands().contains_key(told));
        let (forward, reverse) =
            (moves([Told::RunForward, Told::JogForward]), moves([Told::RunReverse, Told::JogReverse]));
        let mut running = |state: State, wanted: bool| {
            let word = self.word_of(state);
            if wanted && word.is_none() {
                self.miss(PLACE, &format!("no word that means {}", state.name()));
            }
            word
        };
        let (forward, reverse) = (running(State::Forward, forward), running(State::Reverse, reverse));
        let either = forward.or(reverse).unwrap_or(stopped);
        [forward.unwrap_or(either), reverse.unwrap_or(either), stopped, self.word_of(State::Fault).unwrap_or(stopped)]
    }

    /// A word that means `state`: that of a rule, or of two where the bits of one alone leave it open.
    fn word_of(&self, state: State) -> Option<u16> {
        let rules = &self.profile.state_word()?.rules;
        let own = || rules.iter().filter(|rule| rule.state == state);
        let alone = own().map(|rule| rule.value);
        let joined = own().flat_map(|rule| {
            let fits = |other: &u16| other & rule.mask == rule.value;
            rules.iter().map(|other| rule.value | (other.value & !rule.mask)).filter(fits)
        });
        alone.chain(joined).find(|&word| self.profile.state(word) == state)
    }

    fn speed(&mut self) -> Option<Speed> {
        const PLACE: &str = "profile.toml, [setpoints.frequency]";
        let entry = self.profile.role("setpoints.frequency");
        let Some((entry, register)) = entry.and_then(|entry| Some((entry, entry.place()?.number()))) else {
            self.miss(PLACE, "no register that sets the frequency, or registers.csv has no address for it");
            return None;
        };
        let variant = entry.quantity().variant().and_then(|name| self.profile.variants().get(name));
        let choices: Vec<(u16, SpeedScale)> = variant.map_or_else(Vec::new, |variant| {
            let choices = variant.choices.values();
            choices.filter_map(|choice| Some((choice.word, self.scale(&choice.quantity)?))).collect()
        });
        // Of two words the low one tells.
        let decider = variant.and_then(|variant| self.profile.find(&variant.parameter).ok());
        let parameter = decider.and_then(low_word);
        let share = variant.and_then(|variant| variant.share.as_ref()).zip(decider);
        let of_factory = share.map(|(share, decider)| {
            let factory = decider.default_raw().map_or(USUAL_MAX_HZ, |raw| decider.decode(raw).to_f64());
            let bounds = Bounds { signed: share.signed, ..Bounds::NONE };
            SpeedScale { bounds, ..SpeedScale::share(share.counts.into(), factory) }
        });
        let usual = self.scale(entry.quantity()).or_else(|| choices.first().map(|&(_, scale)| scale)).or(of_factory);
        let Some(usual) = usual else {
            let what = format!("{} (registers.csv) is not in Hz, % or rpm, with a scale that is known", entry.name());
            self.miss(PLACE, &what);
            return None;
        };
        let unit = parameter.map(|address| match share {
            Some((share, decider)) => {
                Deciding::Share(Scaled { address, counts: counts(decider.quantity()) }, share.counts.into())
            }
            None => Deciding::Words(address, choices),
        });
        Some(Speed { register, unit, usual })
    }

    /// How `quantity` counts a speed, if it does.
    fn scale(&self, quantity: &Quantity) -> Option<SpeedScale> {
        let unit = match quantity.unit() {
            "Hz" => SpeedUnit::Hertz,
            "%" => SpeedUnit::Percent,
            "rpm" => SpeedUnit::Rpm,
            _ => return None,
        };
        Some(SpeedScale { unit, counts: counts(quantity), bounds: bounds(self.profile, quantity) })
    }

    /// The parameters that must have a value, and which.
    fn conditions(&mut self, rows: &[Control]) -> Vec<(u16, u16)> {
        let mut conditions = Vec::new();
        // Which way its bits go is not known of a drive of one's own.
        for row in rows.iter().filter(|row| row.bits.is_none()) {
            match self.address_of(&row.code) {
                Some(address) => conditions.push((address, row.raw)),
                None => self.miss("parameters.csv", &format!("{} has no address, and must have a value", row.code)),
            }
        }
        conditions
    }

    /// Those that need nothing else of the profile than what they name.
    fn roles(&self) -> Roles {
        let parameter = |name: Option<&str>, unit: &str| {
            let entry = self.profile.find(name?).ok().filter(|entry| entry.quantity().unit() == unit)?;
            Some(Scaled { address: entry.address()?, counts: counts(entry.quantity()) })
        };
        let deceleration = self.profile.role("deceleration").map_or(DECELERATION, Entry::name);
        let deceleration = parameter(Some(deceleration), "s");
        let watchdog = self.profile.watchdog();
        let on_silence = watchdog.and_then(|watchdog| {
            let coast = if watchdog.trip.is_some() { OnSilence::Coast } else { OnSilence::Trip };
            let words = [(watchdog.coast, coast), (watchdog.stop, OnSilence::Stop), (watchdog.trip, OnSilence::Trip)];
            let words = words.into_iter().filter_map(|(word, action)| Some((word?, action))).collect();
            Some(Silence { parameter: self.address_of(watchdog.action.as_deref()?)?, words })
        });
        Roles {
            direction: self.direction(),
            acceleration: parameter(Some(ACCELERATION), "s").or(deceleration),
            deceleration,
            fault_history: self.remembered().filter_map(Entry::address).collect(),
            bus_timeout: on_silence
                .as_ref()
                .and_then(|_| parameter(watchdog.map(|watchdog| watchdog.timeout.as_str()), "s")),
            on_silence,
            ..Roles::NONE
        }
    }

    /// The parameter with the highest frequency: where a stop is counted from, or what bounds the setpoint.
    fn max_frequency(&self) -> Option<Scaled> {
        let bound = || self.profile.role("setpoints.frequency").and_then(|entry| entry.quantity().high_from());
        let name = self.profile.role("ramp_start").map(Entry::name).or_else(bound)?;
        let entry = self.profile.find(name).ok().filter(|entry| entry.quantity().unit() == "Hz")?;
        Some(Scaled { address: entry.address()?, counts: counts(entry.quantity()) })
    }

    /// The same where no parameter says it: the highest setpoint.
    fn highest_hertz(&self) -> Option<f64> {
        let quantity = self.profile.role("setpoints.frequency")?.quantity();
        quantity.high().filter(|_| quantity.unit() == "Hz").map(Value::to_f64)
    }

    fn memory(&self) -> Memory {
        let Some(memory) = self.profile.memory() else { return Memory::EepromOnly };
        match (self.profile.store_word(), memory.keeps(true)) {
            (Some((store, place)), _) => Memory::RamUntil(place.number(), store.word),
            (None, false) => Memory::BitMeansRam(memory.mask()),
            (None, true) => Memory::BitMeansEeprom(memory.mask()),
        }
    }

    /// The code of its own family, or of the one that it reports as.
    fn identification(&self) -> u16 {
        let known = self.profile.identifications();
        let families = self.profile.reports_as().iter();
        let mut own = families.filter_map(|family| known.iter().find(|row| row.family == *family));
        own.next().map_or(0, |row| row.code)
    }

    fn fault(&self, mnemonic: &str) -> Option<u16> {
        self.profile.faults().find(|fault| fault.mnemonic == mnemonic).map(|fault| fault.code)
    }

    fn silent_bus(&self) -> Option<u16> {
        self.profile.watchdog().and_then(|watchdog| watchdog.fault).or_else(|| self.fault(SILENT_BUS))
    }

    /// Where the drive remembers faults, the latest first: what it shows as the present one too, where that holds.
    fn remembered(&self) -> impl Iterator<Item = &Entry> {
        let holding = self.profile.role("fault").filter(|_| self.profile.fault_holds());
        let history = self.profile.fault_history();
        holding.into_iter().chain(history.filter(move |entry| holding.is_none_or(|held| held.name() != entry.name())))
    }

    /// Those of them that are registers.
    fn kept_registers(&self) -> impl Iterator<Item = u16> {
        let is_kept = |entry: &&Entry| entry.kind() == EntryKind::Register && entry.table() == Table::Holding;
        self.remembered().filter(is_kept).filter_map(Entry::address)
    }

    fn registers(&self, states: [u16; 4]) -> Vec<Register> {
        let entries = self.profile.entries().filter(|entry| entry.kind() == EntryKind::Register);
        let kept: Vec<u32> = self.kept_registers().map(u32::from).collect();
        let placed = entries.filter_map(|entry| Some((entry, entry.place()?.number())));
        let placed = placed.filter(|(_, address)| !kept.contains(address));
        let registers = placed
            .flat_map(|(entry, address)| {
                let access = match entry.access() {
                    ProfileAccess::Ro => Access::ReadOnly,
                    ProfileAccess::Wo => Access::WriteOnly,
                    _ => Access::Always,
                };
                let range = match entry.quantity().variant() {
                    Some(_) if self.has_role(entry, "setpoints.frequency") => Range::Speed,
                    _ => Range::Within(bounds(self.profile, entry.quantity())),
                };
                let shows = self.shows(entry, states);
                let beside = entry.place().zip(low_word(entry)).filter(|_| entry.words() == 2);
                let Some((place, low)) = beside else {
                    return vec![Register { address, access, range, shows }];
                };
                // Two words are only read, and nothing that is shown fills the high one.
                let high = if low == place.address { place.address.wrapping_add(1) } else { place.address };
                let at = |address| Place { address, ..place }.number();
                vec![Register::read(at(low), shows), Register::read(at(high), Shows::Zero)]
            })
            .collect();
        register::joined(registers)
    }

    fn has_role(&self, entry: &Entry, role: &str) -> bool {
        self.profile.role(role).is_some_and(|holder| holder.name() == entry.name())
    }

    fn shows(&self, entry: &Entry, states: [u16; 4]) -> Shows {
        let is = |role| self.has_role(entry, role);
        let quantity = entry.quantity();
        let measured = |measure| {
            let share = if matches!(measure, Measure::Power | Measure::Torque) { 100.0 } else { 1.0 };
            Shows::Measured(measure, counts(quantity) * share)
        };
        if is("state") {
            let told =
                self.profile.state_word().map_or(0, |word| word.rules.iter().fold(0, |all, rule| all | rule.mask));
            let beside = entry.bits().iter().filter(|field| field.mask() & told == 0);
            Shows::State(states, beside.filter_map(either).collect())
        } else if is("fault") {
            Shows::Fault
        } else if is("identification") {
            Shows::Identification
        } else if is("frequency") || is("setpoint") {
            match (is("frequency"), quantity.unit()) {
                (true, "Hz") if quantity.is_signed() => measured(Measure::SignedFrequency),
                (true, "Hz") => measured(Measure::Frequency),
                (true, "rpm") => measured(Measure::Speed),
                (false, "Hz") => measured(Measure::Setpoint),
                // A share of a frequency that is read back where it is written.
                (false, _) if entry.access() != ProfileAccess::Ro => Shows::Written,
                _ => Shows::Zero,
            }
        } else if entry.access() != ProfileAccess::Ro {
            Shows::Written
        } else if self.profile.status_words().any(|word| word.name() == entry.name()) {
            Shows::Bits(entry.bits().iter().filter_map(either).collect())
        } else if entry.name() == INPUTS {
            Shows::Inputs(None)
        } else {
            let has = |words: &[&str]| entry.name().split('_').any(|word| words.contains(&word));
            let known = MEASURES.iter().find(|(words, unit, _)| has(words) && *unit == quantity.unit());
            known.filter(|_| !has(&NOT_MEASURED)).map_or(Shows::Zero, |&(_, _, measure)| measured(measure))
        }
    }
}

/// Counts in one unit of `quantity`.
fn counts(quantity: &Quantity) -> f64 {
    let (counts, units) = quantity.ratio().unwrap_or((1, 1));
    f64::from(counts) / f64::from(units)
}

/// What a command does to the motor.
fn done(told: Told) -> Command {
    match told {
        Told::RunForward => Command::Run(Direction::Forward),
        Told::RunReverse => Command::Run(Direction::Reverse),
        Told::JogForward => Command::Jog(Direction::Forward),
        Told::JogReverse => Command::Jog(Direction::Reverse),
        Told::Stop => Command::Stop,
        Told::Coast => Command::Coast,
        Told::ResetFault => Command::ResetFault,
        Told::JogStop => Command::JogStop,
        _ => Command::Nothing,
    }
}

/// The bits of a status word that programs know by name, if `field` has the labels that they look for.
fn either(field: &BitField) -> Option<Bit> {
    let labelled = |label: &str| field.values().iter().find(|(_, known)| *known == label).map(|(&value, _)| value);
    let other_than = |value: u16| field.values().keys().copied().find(|&other| other != value);
    let (flag, yes, no) = match field.name() {
        "ready" => {
            let yes = labelled("ready")?;
            (Flag::Ready, yes, other_than(yes)?)
        }
        "overload_alarm" => {
            let no = labelled("none")?;
            (Flag::OverloadAlarm, other_than(no)?, no)
        }
        "control_channel" => {
            let yes = labelled("communication")?;
            (Flag::Obeying, yes, labelled("keypad").or_else(|| other_than(yes))?)
        }
        _ => return None,
    };
    Some(Bit::Either { flag, low: field.low(), yes, no })
}
