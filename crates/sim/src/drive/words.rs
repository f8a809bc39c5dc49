//! What the drive shows: state words, measured values, fault and identification.

use super::Drive;
use super::family::{Bit, Count, Flag, Measure, Shows};
use super::machine::RunState;
use super::map::{Access, Word};
use super::refusal::Refusal;

/// The inputs that a drive has terminals for: HDIB, HDIA, S4 to S1.
const LOCAL_INPUTS: u16 = 0x3F;
/// Relay 1 among the digital outputs.
const RELAY_1: u16 = 1 << 2;

impl Drive {
    /// The word at `address`, as the function of its table would read it.
    ///
    /// Assumption: a password reads as 0.
    pub(super) fn word(&self, address: u32) -> Result<u16, Refusal> {
        match self.map.word(address) {
            None => Err(Refusal::Address),
            Some(Word::Register(register)) if register.access == Access::WriteOnly => Err(Refusal::Unreadable),
            Some(Word::Register(register)) => Ok(self.shown(register.address, &register.shows)),
            Some(Word::Parameter(_)) if self.is_password(address) => Ok(0),
            Some(Word::Parameter(parameter)) => self.store.get(parameter.address).ok_or(Refusal::Address),
        }
    }

    fn shown(&self, address: u32, shows: &Shows) -> u16 {
        match *shows {
            Shows::Written => self.control_word(address),
            Shows::WrittenTo(register) => self.control_word(register),
            Shows::WrittenIf { parameter, is, register, otherwise } => {
                if self.store.get(parameter) == Some(is) {
                    self.control_word(register)
                } else {
                    otherwise.map_or(0, |parameter| self.parameter(parameter))
                }
            }
            Shows::State([forward, reverse, stopped, fault], ref bits) => {
                let code = match self.machine.state() {
                    RunState::Forward => forward,
                    RunState::Reverse => reverse,
                    RunState::Stopped => {
                        self.family().roles.handshake.as_ref().map_or(stopped, |words| words.shown(self.led_up))
                    }
                    RunState::Fault => fault,
                };
                code | self.bits(bits)
            }
            Shows::Bits(ref bits) => self.bits(bits),
            Shows::Measured(measure, counts) => word(self.measured(measure) * counts),
            Shows::Fault => self.fault(),
            Shows::Identification => self.family().identification,
            Shows::Inputs(set) => (self.inputs | set.map_or(0, |set| self.control_word(set))) & LOCAL_INPUTS,
            Shows::Outputs(set) => {
                let relay = if self.machine.is_running() { RELAY_1 } else { 0 };
                self.control_word(set) | relay
            }
            Shows::Analog(index) => self.analog.get(index).copied().unwrap_or(0),
            Shows::Energy(half) => half_of(self.machine.energy(), half),
            Shows::Count(Count::Received) => self.frames.received,
            Shows::Count(Count::Sent) => self.frames.sent,
            Shows::Count(Count::Spoilt) => self.frames.spoilt,
            Shows::Zero => 0,
        }
    }

    fn measured(&self, measure: Measure) -> f64 {
        let point = || self.machine.working_point();
        match measure {
            Measure::Frequency => self.machine.frequency().abs(),
            Measure::SignedFrequency => self.machine.frequency(),
            Measure::Setpoint => self.settings.setpoint.abs(),
            Measure::BusVoltage => point().bus_volts,
            Measure::Voltage => point().volts,
            Measure::Current => point().amperes,
            Measure::Speed => self.machine.speed().abs(),
            Measure::Power => point().power.clamp(-3.0, 3.0),
            Measure::Torque => point().torque.clamp(-2.5, 2.5),
        }
    }

    fn bits(&self, bits: &[Bit]) -> u16 {
        bits.iter().fold(0, |word, &bit| word | self.bit(bit))
    }

    fn is(&self, flag: Flag) -> bool {
        match flag {
            Flag::Ready => self.machine.fault().is_none(),
            Flag::OverloadAlarm => self.machine.overload_alarm(),
            Flag::Obeying => self.obeys_bus(),
        }
    }

    fn bit(&self, bit: Bit) -> u16 {
        let machine = &self.machine;
        let (value, place) = match bit {
            Bit::Ready(place) => (u16::from(machine.fault().is_none()), place),
            Bit::NotReady(place) | Bit::Fault(place) => (u16::from(machine.fault().is_some()), place),
            Bit::FaultNumber(place) => (machine.fault().unwrap_or(0), place),
            Bit::Running(place) => (u16::from(machine.is_running()), place),
            // At no frequency the command says which way it will turn.
            Bit::Reverse(place) => {
                (u16::from(machine.frequency() < 0.0 || machine.state() == RunState::Reverse), place)
            }
            Bit::ReverseSetpoint(place) => (u16::from(self.settings.setpoint < 0.0), place),
            Bit::Jogging(place) => (u16::from(machine.is_jogging()), place),
            Bit::Ramp(place) => (machine.ramping() as u16, place),
            Bit::OverloadAlarm(place) => (u16::from(machine.overload_alarm()), place),
            Bit::Channel(place) => {
                (self.family().roles.channel.map_or(0, |channel| self.parameter(channel)) & 0b11, place)
            }
            Bit::Motor(place, register) => (self.control_word(register) & 0b11, place),
            Bit::Always(bits) => (bits, 0),
            Bit::Either { flag, low, yes, no } => (if self.is(flag) { yes } else { no }, low),
        };
        value << place
    }
}

/// Bits 0 to 15 (0) or 16 to 31 (1) of a meter of 32 bits.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a meter wraps; it never runs backwards")]
fn half_of(counts: f64, half: u8) -> u16 {
    (counts as u64 >> (16 * u32::from(half))) as u16
}

/// The nearest word to `counts`; negative ones as two's complement, those that do not fit as the nearest that does.
fn word(counts: f64) -> u16 {
    #[expect(clippy::cast_possible_truncation, reason = "clamped to what fits")]
    let counts = counts.round().clamp(f64::from(i16::MIN), f64::from(u16::MAX)) as i32;
    let [.., high, low] = counts.to_be_bytes();
    u16::from_be_bytes([high, low])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_rounded_and_kept_in_range() {
        let table = [(10.4, 10), (10.5, 11), (-1.0, 0xFFFF), (-300.0, 0xFED4), (-40_000.0, 0x8000), (70_000.0, 0xFFFF)];
        for (counts, expected) in table {
            assert_eq!(word(counts), expected, "{counts}");
        }
    }

    #[test]
    fn a_meter_shows_its_low_word_and_its_high_word() {
        for (counts, low, high) in [(0.0, 0, 0), (65_535.9, 0xFFFF, 0), (100_000.0, 0x86A0, 1), (4_294_967_297.0, 1, 0)]
        {
            assert_eq!((half_of(counts, 0), half_of(counts, 1)), (low, high), "{counts}");
        }
    }
}
