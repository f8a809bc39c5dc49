//! What the drive shows: state words, monitor block, fault and identification.

use super::Drive;
use super::addresses as at;
use super::machine::RunState;

/// P09.00 = 6: the PID setpoint comes from 2002H.
const PID_SETPOINT_FROM_BUS: u16 = 6;
/// P09.02 = 4: the PID feedback comes from 2003H.
const PID_FEEDBACK_FROM_BUS: u16 = 4;
/// Bits 11 and 10 of state word 2: the motor model is a V/F one.
const SVPWM: u16 = 0b11 << 10;
/// The inputs that the terminals of 300AH have: HDIB, HDIA, S4 to S1.
const LOCAL_INPUTS: u16 = 0x3F;
/// RO1 in 300BH.
const RELAY_1: u16 = 1 << 2;

impl Drive {
    /// The word at `address`, as 03H would read it; `None` where there is none.
    ///
    /// - Assumption: 2000H reads as the last command. The password (P07.00) reads as 0.
    /// - Assumption: 3005H shows the shaft's speed also while the motor coasts.
    /// - Assumption: power and torque are positive while the motor drives and negative while it brakes, whichever way
    ///   it turns.
    /// - Assumption: relay 1 is on while the motor runs; the other outputs show 200BH.
    pub(super) fn word(&self, address: u16) -> Option<u16> {
        if !self.map.has(address) {
            return None;
        }
        let offset = address.wrapping_sub(at::MONITOR);
        Some(match address {
            at::CONTROL_COMMAND..=at::CONTROL_BLOCK_END => self.control_word(address),
            at::STATUS_WORD_1 => match self.machine.state() {
                RunState::Forward => 1,
                RunState::Reverse => 2,
                RunState::Stopped => 3,
                RunState::Fault => 4,
            },
            at::STATUS_WORD_2 => self.status_word_2(),
            at::FAULT_CODE | at::FAULT_CODE_COMPAT => self.fault(),
            at::IDENTIFICATION => self.map.identification(),
            at::PASSWORD => 0,
            _ if offset <= 0x16 => self.monitor_word(offset),
            _ => self.store.get(address)?,
        })
    }

    fn monitor_word(&self, offset: u16) -> u16 {
        let point = self.machine.working_point();
        match offset {
            0x00 => word(self.machine.frequency().abs() * 100.0),
            0x01 => word(self.settings.setpoint * 100.0),
            0x02 => word(point.bus_volts * 10.0),
            0x03 => word(point.volts),
            0x04 => word(point.amperes * 10.0),
            0x05 => word(self.machine.speed().abs()),
            0x06 => word((point.power * 1_000.0).clamp(-3_000.0, 3_000.0)),
            0x07 => word((point.torque * 1_000.0).clamp(-2_500.0, 2_500.0)),
            0x08 if self.parameter(at::PID_SOURCE) == PID_SETPOINT_FROM_BUS => self.control_word(at::PID_REFERENCE),
            0x08 => self.parameter(at::PID_PRESET),
            0x09 if self.parameter(at::PID_FEEDBACK_SOURCE) == PID_FEEDBACK_FROM_BUS => {
                self.control_word(at::PID_FEEDBACK)
            }
            0x0A => (self.inputs | self.control_word(at::VIRTUAL_INPUT)) & LOCAL_INPUTS,
            0x0B => {
                let relay = if self.machine.is_running() { RELAY_1 } else { 0 };
                self.control_word(at::VIRTUAL_OUTPUT) | relay
            }
            0x0C..=0x0F => self.analog[usize::from(offset - 0x0C)],
            0x15 => self.control_word(at::TORQUE_SETTING),
            0x16 => self.map.identification(),
            // Pulse inputs, multi-step speed, length and count: nothing is connected.
            _ => 0,
        }
    }

    fn status_word_2(&self) -> u16 {
        let ready = u16::from(self.machine.fault().is_none());
        let motor = self.control_word(at::SPECIAL_CONTROL) & 0b11;
        let alarm = u16::from(self.machine.overload_alarm());
        let channel = self.parameter(at::RUN_CHANNEL) & 0b11;
        ready | motor << 1 | alarm << 4 | channel << 5 | SVPWM
    }
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
}
