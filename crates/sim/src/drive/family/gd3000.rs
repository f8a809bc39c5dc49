//! Goodrive3000: medium voltage, a VFD and a rectifier unit, each with an address and parameters of its own.
//!
//! 06H is printed and 10H is not (section 8.4 has no place for it), so 10H is refused with 01H. Of the registers only
//! code 1 at 2000H and the address 2100H are printed.
//!
//! - Assumption: the other command codes and the states are those of Goodrive350, and so are 2001H (the speed, in
//!   hundredths of a hertz, while P00.06 = 8), 2102H (the fault), 3000H and 3001H (running and set frequency). Nothing
//!   else of its registers is here.
//! - Assumption: 2 in P00.01 obeys the bus. 0 to 2 are allowed, their meanings are not printed.
//! - Assumption: no address has bit 15; no page tells of a way to RAM over Modbus.
//! - Assumption: P00.04 and P00.05 are the limits they are in sister series (an example reads two words from 0004H), and
//!   the factory settings of P14 are those of the rectifier's P11.
//! - Assumption: a silent bus has fault number 18 and a motor overload 11, as in Goodrive350; only the letters CE are
//!   printed.

use super::gd600::{LOWER_FREQUENCY, MAX_FREQUENCY, PASSWORD, RECTIFIER_REGISTERS, SPEED_SOURCE, UPPER_FREQUENCY};
use super::{
    Family, Faults, Kind, MAX_WORDS, Memory, Parameter, Range, Register, Roles, Scaled, Silence, Speed, USUAL_DELAY,
    USUAL_MAX_HZ, gd350, gd600,
};

const RUN_CHANNEL: u16 = 0x0001;

pub(crate) fn gd3000() -> Family {
    Family {
        name: "gd3000".into(),
        kind: Kind::Inverter,
        functions: vec![0x03, 0x06, 0x08],
        max_words: MAX_WORDS,
        across_groups: true,
        exception: gd350::exception,
        memory: Memory::EepromOnly,
        identification: 0,
        command: Some(0x2000),
        commands: gd350::COMMANDS.to_vec(),
        registers: [
            &[Register::set(0x2000, Range::Words(1, 8)), Register::set(0x2001, Range::UpTo(40_000, MAX_FREQUENCY))],
            gd600::STATE,
        ]
        .concat(),
        parameters: vec![
            Parameter::new(RUN_CHANNEL, 0, 2, 0),
            Parameter::new(MAX_FREQUENCY, 0, 40_000, 5_000).not_below(UPPER_FREQUENCY).at_standstill(),
            Parameter::new(UPPER_FREQUENCY, 0, 40_000, 5_000).not_above(MAX_FREQUENCY),
            Parameter::new(LOWER_FREQUENCY, 0, 40_000, 0).not_above(UPPER_FREQUENCY),
            Parameter::new(SPEED_SOURCE, 0, 15, 0),
            // P01.19, P01.20, P01.21.
            Parameter::new(0x0113, 0, 2, 0),
            Parameter::new(0x0114, 0, 36_000, 0),
            Parameter::new(0x0115, 0, 1, 0),
            Parameter::new(PASSWORD, 0, u16::MAX, 0),
            // P14.00 to P14.04.
            Parameter::new(0x0E00, 1, 247, 1),
            Parameter::new(0x0E01, 0, 6, 4),
            Parameter::new(0x0E02, 0, 5, 1),
            Parameter::new(0x0E03, 0, 200, 5),
            Parameter::new(0x0E04, 0, 600, 0),
        ],
        factory: &[],
        control_word: None,
        elsewhere: Vec::new(),
        capped: &[],
        roles: Roles {
            obeys: vec![(RUN_CHANNEL, 2)],
            speed_source: Some(vec![(SPEED_SOURCE, 8)]),
            speed: Some(Speed::hertz(0x2001)),
            max_frequency: Some(Scaled::hundredths(MAX_FREQUENCY)),
            upper_frequency: Some(Scaled::hundredths(UPPER_FREQUENCY)),
            password: Some(PASSWORD),
            unit_address: Some(0x0E00),
            response_delay: Some(0x0E03),
            bus_timeout: Some(Scaled::tenths(0x0E04)),
            ..Roles::NONE
        },
        delay: USUAL_DELAY,
        max_hertz: USUAL_MAX_HZ,
        faults: Faults { overload: Some(11), silent_bus: Some(18) },
    }
}

/// The rectifier unit: its serial settings are P11.00 to P11.05 (page 214).
///
/// Assumption: 2000H takes the codes of its PROFIBUS command byte, 2100H says how it is, and it obeys the bus always.
pub(crate) fn rectifier() -> Family {
    Family {
        name: "gd3000-rectifier".into(),
        kind: Kind::Rectifier,
        commands: gd600::RECTIFIER_COMMANDS.to_vec(),
        registers: RECTIFIER_REGISTERS.to_vec(),
        parameters: vec![
            Parameter::new(0x0B00, 1, 247, 1),
            Parameter::new(0x0B01, 0, 5, 4),
            Parameter::new(0x0B02, 0, 5, 1),
            Parameter::new(0x0B03, 0, 200, 5),
            Parameter::new(0x0B04, 0, 600, 0),
            Parameter::new(0x0B05, 0, 3, 0),
        ],
        roles: Roles {
            unit_address: Some(0x0B00),
            response_delay: Some(0x0B03),
            bus_timeout: Some(Scaled::tenths(0x0B04)),
            on_silence: Some(Silence::at(0x0B05)),
            ..Roles::NONE
        },
        ..gd3000()
    }
}
