//! How a family describes its words: who may write what, and what is read.

use std::borrow::Cow;

use crate::drive::map::Access;

/// A register of the bus.
#[derive(Debug, Clone)]
pub(crate) struct Register {
    /// With its table: [`spot`](crate::drive::places::spot).
    pub(crate) address: u32,
    pub(crate) access: Access,
    pub(crate) range: Range,
    pub(crate) shows: Shows,
}

/// What may be written.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Range {
    /// Words from..=to.
    Words(u16, u16),
    /// From 0 to this word, and not above the parameter at that address.
    UpTo(u16, u16),
    /// Two's complement from..=to.
    Signed(i16, i16),
    /// As a speed in the unit that the drive is set to.
    Speed,
    Within(Bounds),
}

/// What is read.
#[derive(Debug, Clone)]
pub(crate) enum Shows {
    /// What was last written there.
    Written,
    /// What was last written to another register.
    WrittenTo(u32),
    /// What was last written to a register while a parameter has a value, and another parameter otherwise.
    WrittenIf {
        parameter: u16,
        is: u16,
        register: u32,
        otherwise: Option<u16>,
    },
    /// A code each for forward, reverse, stopped and fault, and bits beside it.
    State([u16; 4], Cow<'static, [Bit]>),
    Bits(Cow<'static, [Bit]>),
    /// Counts per unit.
    Measured(Measure, f64),
    Fault,
    Identification,
    /// The digital inputs, together with those that the bus sets at an address.
    Inputs(Option<u32>),
    /// The digital outputs that the bus sets at an address, and relay 1 while the motor runs.
    Outputs(u32),
    /// An analog input, from 0.
    Analog(usize),
    /// Bits 0 to 15 (0) or 16 to 31 (1) of the energy meter.
    Energy(u8),
    Count(Count),
    /// Nothing is connected there.
    Zero,
}

/// Something of the machine.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Measure {
    /// Hz, without sign.
    Frequency,
    /// Hz, below zero in reverse.
    SignedFrequency,
    /// Hz, without sign.
    Setpoint,
    /// V.
    BusVoltage,
    /// V.
    Voltage,
    /// A.
    Current,
    /// rpm, without sign.
    Speed,
    /// Share of the rating.
    Power,
    /// Share of the rating.
    Torque,
}

/// Counted frames.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Count {
    Received,
    Sent,
    Spoilt,
}

/// Something that stands from a bit of a status word on.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Bit {
    /// 1 without a fault.
    Ready(u8),
    /// 1 with a fault.
    NotReady(u8),
    Fault(u8),
    /// The number of the fault, from this bit on; 0 without one.
    FaultNumber(u8),
    Running(u8),
    /// 1 while the output frequency is below zero.
    Reverse(u8),
    /// 1 while the setpoint is below zero.
    ReverseSetpoint(u8),
    Jogging(u8),
    /// Two bits: 0 at a stop, 1 faster, 2 slower, 3 even.
    Ramp(u8),
    OverloadAlarm(u8),
    /// Two bits: who gives the commands.
    Channel(u8),
    /// Two bits: the motor that the low bits of a register choose.
    Motor(u8, u32),
    /// The same bits always.
    Always(u16),
    /// One number, from its lowest bit on, while something is so, and another while it is not.
    Either {
        flag: Flag,
        low: u8,
        yes: u16,
        no: u16,
    },
}

/// Something that is so or is not.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Flag {
    Ready,
    OverloadAlarm,
    /// Commands come from the bus.
    Obeying,
}

/// A parameter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Parameter {
    pub(crate) address: u16,
    pub(crate) access: Access,
    pub(crate) bounds: Bounds,
    pub(crate) factory: u16,
}

/// Which words are in range.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bounds {
    /// In counts; `None` where nothing is printed.
    pub(crate) low: Option<i64>,
    pub(crate) high: Option<i64>,
    /// Parameters that bound it as well, by address.
    pub(crate) low_from: Option<u16>,
    pub(crate) high_from: Option<u16>,
    /// Whether words are two's complement.
    pub(crate) signed: bool,
}

impl Bounds {
    /// Every word is.
    pub(crate) const NONE: Self = Self { low: None, high: None, low_from: None, high_from: None, signed: false };

    /// From..=to, in counts.
    pub(crate) const fn new(low: i64, high: i64) -> Self {
        Self { low: Some(low), high: Some(high), ..Self::NONE }
    }

    /// The number in `raw`.
    pub(crate) fn count(self, raw: u16) -> i64 {
        if self.signed { i64::from(raw.cast_signed()) } else { i64::from(raw) }
    }

    /// Whether `raw` is in range; `value_of` tells the parameters that the range depends on.
    pub(crate) fn allows(self, raw: u16, value_of: impl Fn(u16) -> u16) -> bool {
        let value = self.count(raw);
        let bound = |address: Option<u16>| address.map(|address| self.count(value_of(address)));
        let above = [self.low, bound(self.low_from)].into_iter().flatten().all(|low| low <= value);
        let below = [self.high, bound(self.high_from)].into_iter().flatten().all(|high| value <= high);
        above && below
    }
}

impl Register {
    /// One that the bus sets and may read back.
    pub(crate) const fn set(address: u32, range: Range) -> Self {
        Self { address, access: Access::Always, range, shows: Shows::Written }
    }

    /// One that the bus sets and cannot read.
    pub(crate) const fn write_only(address: u32, range: Range) -> Self {
        Self { address, access: Access::WriteOnly, range, shows: Shows::Written }
    }

    /// One that can only be read.
    pub(crate) const fn read(address: u32, shows: Shows) -> Self {
        Self { address, access: Access::ReadOnly, range: Range::Words(0, u16::MAX), shows }
    }
}

impl Shows {
    /// A code each for forward, reverse, stopped and fault, and nothing beside it.
    pub(crate) const fn state(codes: [u16; 4]) -> Self {
        Self::State(codes, Cow::Borrowed(&[]))
    }

    /// Bits that are typed here.
    pub(crate) const fn bits(bits: &'static [Bit]) -> Self {
        Self::Bits(Cow::Borrowed(bits))
    }
}

impl Parameter {
    /// From..=to, in counts, with its factory value; to be changed at any time.
    pub(crate) const fn new(address: u16, low: u16, high: u16, factory: u16) -> Self {
        Self { address, access: Access::Always, bounds: Bounds::new(low as i64, high as i64), factory }
    }

    /// One that only the drive itself changes.
    pub(crate) const fn shown(address: u16) -> Self {
        Self { address, access: Access::ReadOnly, bounds: Bounds::NONE, factory: 0 }
    }

    /// The same, to be changed at standstill only.
    pub(crate) const fn at_standstill(self) -> Self {
        Self { access: Access::Stopped, ..self }
    }

    /// The same, never below another parameter.
    pub(crate) const fn not_below(self, address: u16) -> Self {
        Self { bounds: Bounds { low_from: Some(address), ..self.bounds }, ..self }
    }

    /// The same, never above another parameter.
    pub(crate) const fn not_above(self, address: u16) -> Self {
        Self { bounds: Bounds { high_from: Some(address), ..self.bounds }, ..self }
    }
}

/// `registers`, with one for what is read and what is written at the same address: it is written as one and shows the other.
pub(crate) fn joined(registers: Vec<Register>) -> Vec<Register> {
    let mut all: Vec<Register> = Vec::new();
    for new in registers {
        match all.iter_mut().find(|old| old.address == new.address) {
            Some(old) if old.access == Access::WriteOnly && new.access == Access::ReadOnly => {
                (old.access, old.shows) = (Access::Always, new.shows);
            }
            Some(old) if old.access == Access::ReadOnly && new.access == Access::WriteOnly => {
                (old.access, old.range) = (Access::Always, new.range);
            }
            _ => all.push(new),
        }
    }
    all
}
