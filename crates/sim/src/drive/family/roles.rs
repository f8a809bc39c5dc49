//! The parameters and registers at which a family behaves: who is obeyed, how fast, along which ramps.

use drivebus_rtu::huanyang::Protocol;

use super::{Bounds, Handshake};
use crate::drive::machine::Command;

/// The places at which a family behaves, by address; `None` where it has no such parameter or nobody knows which.
#[derive(Debug, Clone)]
pub(crate) struct Roles {
    /// Which protocol it speaks.
    pub(crate) protocol: Protocol,
    /// Commands move something only while each of these parameters has this value.
    pub(crate) obeys: Vec<(u16, u16)>,
    /// Who gives the commands, as status words show it.
    pub(crate) channel: Option<u16>,
    /// The speed comes from the bus while these parameters have these values. Without them: while the bus is obeyed.
    pub(crate) speed_source: Option<Vec<(u16, u16)>>,
    /// The word that says which way a run turns, and what it is for reverse.
    pub(crate) direction: Option<(u32, u16)>,
    /// Where that word cannot be written: the words to the command register that set it, for forward and for reverse.
    pub(crate) direction_words: Option<[u16; 2]>,
    /// What keeps it from taking anything that is written.
    pub(crate) lock: Option<Lock>,
    /// The speed that the bus sets.
    pub(crate) speed: Option<Speed>,
    /// The speed where it does not come from the bus, Hz.
    pub(crate) keypad_frequency: Option<Scaled>,
    pub(crate) max_frequency: Option<Scaled>,
    pub(crate) upper_frequency: Option<Scaled>,
    /// In seconds, as the others.
    pub(crate) acceleration: Option<Scaled>,
    pub(crate) deceleration: Option<Scaled>,
    pub(crate) jog_frequency: Option<Scaled>,
    pub(crate) jog_acceleration: Option<Scaled>,
    pub(crate) jog_deceleration: Option<Scaled>,
    /// "Stop" coasts while this parameter has this value.
    pub(crate) coasts_to_stop: Option<(u16, u16)>,
    pub(crate) password: Option<u16>,
    /// The latest fault first.
    pub(crate) fault_history: Vec<u16>,
    pub(crate) unit_address: Option<u16>,
    /// In milliseconds.
    pub(crate) response_delay: Option<u16>,
    /// In seconds, 0 for never.
    pub(crate) bus_timeout: Option<Scaled>,
    /// What is then done. Without it the drive trips.
    pub(crate) on_silence: Option<Silence>,
    /// The words that the command register must get before a run. `None`: a run is obeyed at once.
    pub(crate) handshake: Option<Handshake>,
    /// A run waits until one of these words has been written since the power came.
    pub(crate) runs_after: &'static [u32],
    /// The other meaning that commands may have.
    pub(crate) other_words: Option<OtherWords>,
    /// Whether a read may have one parameter and no more.
    pub(crate) reads_single_parameters: bool,
    /// Most words in one write, where they are fewer than in a read.
    pub(crate) max_written: Option<u16>,
    /// The word that a read has where the drive has nothing, instead of being refused.
    pub(crate) absent: Option<Absent>,
}

/// A lock on all that is written. The drive is locked from when its power comes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Lock {
    /// Where a word unlocks it that is in range there.
    pub(crate) at: u32,
    /// The bits of the command register that lock it again.
    pub(crate) again: u16,
}

/// What a drive answers where it has nothing.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Absent {
    pub(crate) word: u16,
    /// Whether also where the read has nothing else, which others refuse.
    pub(crate) alone: bool,
}

/// A control profile of the drive in which its commands mean something else, and no words come before a run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OtherWords {
    /// The parameter that decides, and its value for this one.
    pub(crate) set_by: (u16, u16),
    /// What a word does then, by the one before it and itself.
    pub(crate) decode: fn(u16, u16) -> Command,
}

/// A parameter that holds a quantity.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scaled {
    pub(crate) address: u16,
    /// Counts in one unit.
    pub(crate) counts: f64,
}

impl Scaled {
    /// One that counts hundredths.
    pub(crate) const fn hundredths(address: u16) -> Self {
        Self { address, counts: 100.0 }
    }

    /// One that counts tenths.
    pub(crate) const fn tenths(address: u16) -> Self {
        Self { address, counts: 10.0 }
    }
}

/// How the bus sets a speed.
#[derive(Debug, Clone)]
pub(crate) struct Speed {
    pub(crate) register: u32,
    /// The parameter that decides what the register counts.
    pub(crate) unit: Option<Deciding>,
    /// What it counts otherwise.
    pub(crate) usual: SpeedScale,
}

/// How a parameter decides what a speed is counted in.
#[derive(Debug, Clone)]
pub(crate) enum Deciding {
    /// By its words, and what each of them decides.
    Words(u16, Vec<(u16, SpeedScale)>),
    /// So many counts are as many hertz as it says, whatever that is.
    Share(Scaled, f64),
}

/// What a speed is counted in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpeedScale {
    pub(crate) unit: SpeedUnit,
    /// Counts in one unit.
    pub(crate) counts: f64,
    pub(crate) bounds: Bounds,
}

impl SpeedScale {
    /// Hertz of which `reference` are `counts`; below zero it turns the other way.
    pub(crate) const fn share(counts: f64, reference: f64) -> Self {
        Self {
            unit: SpeedUnit::Hertz,
            counts: counts / reference,
            bounds: Bounds { signed: true, ..Bounds::new(-0x7FFF, 0x7FFF) },
        }
    }
}

/// A unit of speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SpeedUnit {
    Hertz,
    /// Of the maximum frequency (assumed).
    Percent,
    Rpm,
}

impl Speed {
    /// Hundredths of a hertz, always.
    pub(crate) const fn hertz(register: u32) -> Self {
        let usual = SpeedScale { unit: SpeedUnit::Hertz, counts: 100.0, bounds: Bounds::NONE };
        Self { register, unit: None, usual }
    }

    /// The scale in force, where `value_of` tells the values of parameters.
    pub(crate) fn scale(&self, value_of: impl Fn(u16) -> Option<u16>) -> SpeedScale {
        let decided = self.unit.as_ref().and_then(|deciding| match deciding {
            Deciding::Words(parameter, choices) => {
                let word = value_of(*parameter)?;
                choices.iter().find(|&&(choice, _)| choice == word).map(|&(_, scale)| scale)
            }
            Deciding::Share(parameter, counts) => {
                let hertz = f64::from(value_of(parameter.address)?) / parameter.counts;
                (hertz > 0.0).then(|| SpeedScale { bounds: self.usual.bounds, ..SpeedScale::share(*counts, hertz) })
            }
        });
        decided.unwrap_or(self.usual)
    }
}

/// What a parameter's words say is to be done about a silent bus; words that are not here say nothing.
#[derive(Debug, Clone)]
pub(crate) struct Silence {
    pub(crate) parameter: u16,
    pub(crate) words: Vec<(u16, OnSilence)>,
}

/// What is done about a silent bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OnSilence {
    Trip,
    /// Only while the bus is obeyed.
    StopIfObeyed,
    Stop,
    /// The motor coasts, and no fault is shown.
    Coast,
}

impl Silence {
    /// 0 trips, 1 does nothing, 2 stops if the bus is obeyed, 3 stops.
    pub(crate) fn at(parameter: u16) -> Self {
        Self { parameter, words: vec![(0, OnSilence::Trip), (2, OnSilence::StopIfObeyed), (3, OnSilence::Stop)] }
    }
}

impl Roles {
    /// None of them.
    pub(crate) const NONE: Self = Self {
        protocol: Protocol::Modbus,
        obeys: Vec::new(),
        channel: None,
        speed_source: None,
        direction: None,
        direction_words: None,
        lock: None,
        speed: None,
        keypad_frequency: None,
        max_frequency: None,
        upper_frequency: None,
        acceleration: None,
        deceleration: None,
        jog_frequency: None,
        jog_acceleration: None,
        jog_deceleration: None,
        coasts_to_stop: None,
        password: None,
        fault_history: Vec::new(),
        unit_address: None,
        response_delay: None,
        bus_timeout: None,
        on_silence: None,
        handshake: None,
        runs_after: &[],
        other_words: None,
        reads_single_parameters: false,
        absent: None,
        max_written: None,
    };
}
