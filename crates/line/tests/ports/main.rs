//! Real ports behind the trait [`Line`]: pseudo-terminals and TCP connections of this machine; and adapters that come and
//! go, with folders that tell of them.
//!
//! Nothing here judges by how long something took: a deadline is only held not to end early, on the line's own clock.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

#[cfg(target_os = "linux")]
mod adapters;
#[cfg(target_os = "linux")]
mod machine;
#[cfg(unix)]
mod pty;
#[cfg(target_os = "linux")]
mod replug;
#[cfg(target_os = "linux")]
mod settings;
mod tcp;

use drivebus_line::{Line, PortErrorKind};
use drivebus_rtu::{DataBits, Duration, Instant, Parity, SerialFormat, Silence, StopBits};

/// Longer than anything here takes; a test that hits it fails by its assertion, not by the clock.
const LONG: Duration = Duration::from_secs(20);

/// 03H to unit 1, two words from 2100H, CRC by the bitwise rule of the specification.
const REQUEST: [u8; 8] = [0x01, 0x03, 0x21, 0x00, 0x00, 0x02, 0xCE, 0x37];

fn format(parity: Parity) -> SerialFormat {
    SerialFormat::new(19_200, DataBits::Eight, parity, StopBits::One, Silence::Spec).unwrap()
}

/// Receives until `count` bytes are there, however they are cut.
fn receive_exactly(line: &mut impl Line, count: usize) -> Vec<u8> {
    let until = line.now() + LONG;
    let mut bytes = Vec::new();
    while bytes.len() < count {
        let mut buffer = [0x80; 256];
        let got = line.receive(&mut buffer, until).unwrap();
        assert_ne!(got, 0, "only {bytes:02X?} of {count} bytes came");
        bytes.extend_from_slice(&buffer[..got]);
    }
    bytes
}

/// The deadline of an empty line is kept, to the nanosecond on the early side.
fn check_deadlines(line: &mut impl Line) {
    let mut buffer = [0; 8];
    for micros in [0, 40, 110, 2_005, 20_000] {
        let until = line.now() + Duration::from_micros(micros);
        assert_eq!(line.receive(&mut buffer, until).unwrap(), 0);
        assert!(line.now() >= until, "receive of {micros} µs came back early");
        let until = line.now() + Duration::from_micros(micros);
        line.sleep(until);
        assert!(line.now() >= until, "sleep of {micros} µs came back early");
    }
    let past = Instant::from_nanos(line.now().as_nanos().saturating_sub(1_000_000));
    assert_eq!(line.receive(&mut buffer, past).unwrap(), 0);
    line.sleep(past);
}

/// The end of what was sent lies behind now by its characters, and behind what was sent before.
fn check_wire_time(line: &mut impl Line, format: &SerialFormat) {
    let before = line.now();
    let first = line.send(&REQUEST).unwrap();
    assert!(first >= before + format.chars(8));
    let second = line.send(&REQUEST).unwrap();
    assert!(second >= first + format.chars(8));
}
