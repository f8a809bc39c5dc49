//! Delta VFD-B: what `vfd_e` does, and its voltages where that has others: one decimal in the current, words at 2108H and 2109H.
//!
//! VFD-B manual of October 2005, pp. 76, 154 and 162 (5-16, 5-94 and 5-102); the bits of 2000H from LinuxCNC's vfdb_vfd.c, which also
//! sends 11H and 21H, and p. 514 of the CP2000 manual; those of 2101H from pp. 440 and 441 of the VFD-ED manual; 02-00 and 02-01 from
//! issue 328 of buildbotics/bbctrl-firmware. Every other address is refused with 02H.
//!
//! - Assumption: bits 3-2 of 2000H are ignored, and bits 5-4 = 0 keep the direction, which is forward here. So 6, by which
//!   a Goodrive coasts, runs it. Jogs (bits 1-0 = 3) and the words with other bits are out of range.
//! - Assumption: 2002H takes 0, which does nothing, and 2, the reset.
//! - Assumption: 02-01 = 3 or 4 obeys the bus, and 3 alone here; 02-00 = 5 takes the frequency from it, and else it is 50 Hz.
//!   Both are 0 from the factory.
//! - Assumption: frequencies count hundredths of a hertz, and voltages tenths of a volt. Words that are not on p. 162 are refused.
//! - Assumption: 20 words in any request; a read of two parameters is refused with 03H; 03H and 06H are its functions.
//! - Assumption: there is no address that RAM alone keeps. 2000H to 2002H cannot be read.
//! - Assumption: 03H for a word out of range, 02H for what can only be read or only be written, 04H for what is not done now.
//! - Assumption: it tells "running" (3) until it stands, and the direction that it was told. In fault it tells "stopped".
//! - Assumption: an overload trips 7, for the list of faults is not at hand. 09-02 and 09-03 are kept and do nothing: a silent bus
//!   trips nothing. Ramps have no parameters in the pages at hand; the times are fixed.

use std::borrow::Cow;

use super::{Bit, Family, Flag, Measure, Parameter, Range, Register, Roles, Shows, vfd_e};

const FREQUENCY_SOURCE: u16 = 0x0200;
const COMMAND_SOURCE: u16 = 0x0201;
const BUS_FORMAT: u16 = 0x0904;

pub(crate) fn vfd_b() -> Family {
    let sister = vfd_e::vfd_e();
    Family {
        name: "vfd-b".into(),
        functions: vec![0x03, 0x06],
        max_words: 20,
        registers: REGISTERS.to_vec(),
        parameters: PARAMETERS.to_vec(),
        roles: Roles { speed_source: Some(vec![(COMMAND_SOURCE, 3), (FREQUENCY_SOURCE, 5)]), ..sister.roles },
        ..sister
    }
}

/// p. 162.
const REGISTERS: &[Register] = &[
    Register::write_only(0x2000, Range::Words(0, 0x22)),
    Register::write_only(0x2001, Range::Speed),
    Register::write_only(0x2002, Range::Words(0, 2)),
    Register::read(0x2100, Shows::Fault),
    Register::read(
        0x2101,
        Shows::State(
            [0b00_0011, 0b01_1011, 0, 0],
            Cow::Borrowed(&[Bit::Either { flag: Flag::Obeying, low: 10, yes: 1, no: 0 }]),
        ),
    ),
    Register::read(0x2102, Shows::Measured(Measure::Setpoint, 100.0)),
    Register::read(0x2103, Shows::Measured(Measure::Frequency, 100.0)),
    Register::read(0x2104, Shows::Measured(Measure::Current, 10.0)),
    Register::read(0x2105, Shows::Measured(Measure::BusVoltage, 10.0)),
    Register::read(0x2106, Shows::Measured(Measure::Voltage, 10.0)),
    Register::read(0x2107, Shows::Zero),
    Register::read(0x2108, Shows::Zero),
    Register::read(0x2109, Shows::Zero),
    Register::read(0x210A, Shows::Zero),
    Register::read(0x210B, Shows::Zero),
    Register::read(0x210C, Shows::Measured(Measure::Speed, 1.0)),
    Register::read(0x210F, Shows::Zero),
    Register::read(0x2200, Shows::Zero),
    Register::read(0x2203, Shows::Zero),
    Register::read(0x2204, Shows::Zero),
    Register::read(0x2205, Shows::Zero),
    Register::read(0x2206, Shows::Zero),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::new(FREQUENCY_SOURCE, 0, 9, 0),
    Parameter::new(COMMAND_SOURCE, 0, 9, 0),
    // It is RTU 8N2 already, or it would not be on the line.
    Parameter::new(BUS_FORMAT, 0, 5, 3),
];
