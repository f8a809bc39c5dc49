//! Serial ports, on the pseudo-terminals of this machine.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;

use drivebus_line::rs485::{Rs485, Switch};
use drivebus_line::tty::{Tty, TtyOptions};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{ControlModes, tcgetattr};

use super::*;

/// Not every system takes it of a pseudo-terminal that programs shall not inherit it.
#[cfg(target_os = "linux")]
const OWN: OpenptFlags = OpenptFlags::CLOEXEC;
#[cfg(not(target_os = "linux"))]
const OWN: OpenptFlags = OpenptFlags::empty();

/// The other side of a pseudo-terminal, and the path to open.
///
/// The path stays its own until the program ends, also when the other side is closed: the system would give it to the next
/// who asks for a pseudo-terminal, which may be another test, and what was lost would seem to be there.
pub(crate) fn pair() -> (File, String) {
    let far: OwnedFd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OWN).unwrap();
    grantpt(&far).unwrap();
    unlockpt(&far).unwrap();
    let path = ptsname(&far, Vec::new()).unwrap().into_string().unwrap();
    let held = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty()).unwrap();
    std::mem::forget(held);
    (far.into(), path)
}

fn open(path: &str, parity: Parity) -> Tty {
    Tty::open(path, &format(parity), &TtyOptions::default()).unwrap()
}

fn kind_of(path: &str) -> PortErrorKind {
    Tty::open(path, &format(Parity::Even), &TtyOptions::default()).unwrap_err().kind
}

/// What the system calls this program.
fn program() -> String {
    std::fs::read_to_string("/proc/self/comm").unwrap().trim_end().to_owned()
}

#[test]
fn every_byte_goes_both_ways_unchanged() {
    let (mut far, path) = pair();
    let mut line = open(&path, Parity::Even);
    assert_eq!(line.name(), path);
    assert!(!line.gapless());
    let all: Vec<u8> = (0..=255).collect();

    line.send(&all).unwrap();
    let mut there = vec![0x80; 256];
    far.read_exact(&mut there).unwrap();
    assert_eq!(there, all);

    far.write_all(&all).unwrap();
    assert_eq!(receive_exactly(&mut line, 256), all);
}

#[test]
fn a_frame_in_lumps_and_a_small_buffer_lose_nothing() {
    let (mut far, path) = pair();
    let mut line = open(&path, Parity::None);
    let mut bytes = Vec::new();
    for lump in REQUEST.chunks(3) {
        far.write_all(lump).unwrap();
        bytes.extend(receive_exactly(&mut line, lump.len()));
    }
    assert_eq!(bytes, REQUEST);

    far.write_all(&REQUEST).unwrap();
    let until = line.now() + LONG;
    let mut bytes = Vec::new();
    while bytes.len() < REQUEST.len() {
        let mut one = [0x80];
        assert_eq!(line.receive(&mut one, until).unwrap(), 1);
        bytes.push(one[0]);
    }
    assert_eq!(bytes, REQUEST);
}

#[test]
fn bytes_that_come_during_the_wait_end_it() {
    let (mut far, path) = pair();
    let mut line = open(&path, Parity::Even);
    let answering = std::thread::spawn(move || {
        let mut request = [0; 8];
        far.read_exact(&mut request).unwrap();
        far.write_all(&request).unwrap();
        far // kept open until the answer was taken
    });
    line.send(&REQUEST).unwrap();
    assert_eq!(receive_exactly(&mut line, 8), REQUEST);
    answering.join().unwrap();
}

#[test]
fn parity_is_left_away_kept_in_the_timing_and_noted() {
    let (far, path) = pair();
    let even = open(&path, Parity::Even);
    assert_eq!(even.notes().len(), 1);
    assert!(even.notes()[0].starts_with("parity is not on the wire"), "{:?}", even.notes());
    assert!(even.notes()[0].contains("19200 8E1"), "{:?}", even.notes());
    drop(even);

    let none = open(&path, Parity::None);
    assert!(none.notes().is_empty(), "{:?}", none.notes());
    drop(none);

    let seven = SerialFormat::new(9_600, DataBits::Seven, Parity::Odd, StopBits::Two, Silence::Characters).unwrap();
    let seven = Tty::open(&path, &seven, &TtyOptions::default()).unwrap();
    assert_eq!(seven.notes().len(), 2);
    let settings = tcgetattr(&far).unwrap();
    assert!(settings.control_modes.contains(ControlModes::CSTOPB));
    assert_eq!(settings.control_modes & ControlModes::CSIZE, ControlModes::CS8);
}

#[test]
fn any_speed_is_set() {
    let (far, path) = pair();
    for baud_rate in [1_200, 9_600, 115_200, 187_500, 250_000] {
        let format = SerialFormat::new(baud_rate, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec).unwrap();
        let mut line = Tty::open(&path, &format, &TtyOptions::default()).unwrap();
        assert_eq!(tcgetattr(&far).unwrap().output_speed(), baud_rate);
        check_wire_time(&mut line, &format);
    }
}

#[test]
fn what_was_queued_before_the_opening_is_discarded() {
    let (mut far, path) = pair();
    let first = open(&path, Parity::Even);
    far.write_all(b"stale\n").unwrap();
    drop(first);
    let mut line = open(&path, Parity::Even);
    far.write_all(&REQUEST).unwrap();
    assert_eq!(receive_exactly(&mut line, 8), REQUEST);
}

#[test]
fn deadlines_are_kept() {
    let (_far, path) = pair();
    check_deadlines(&mut open(&path, Parity::Even));
}

#[test]
fn a_receive_into_nothing_is_a_wait_and_no_loss() {
    let (mut far, path) = pair();
    let mut line = open(&path, Parity::Even);
    far.write_all(&REQUEST).unwrap();
    let until = line.now() + Duration::from_millis(1);
    assert_eq!(line.receive(&mut [], until).unwrap(), 0);
    assert!(line.now() >= until);
    assert_eq!(receive_exactly(&mut line, 8), REQUEST);
}

#[test]
fn a_second_opening_is_refused_until_the_first_is_closed() {
    let (_far, path) = pair();
    let first = open(&path, Parity::Even);
    let error = Tty::open(&path, &format(Parity::Even), &TtyOptions::default()).unwrap_err();
    assert_eq!(error.kind, PortErrorKind::Busy);
    assert!(error.to_string().starts_with(&path), "{error}");
    if cfg!(target_os = "linux") {
        let holder = format!("this program has it open already: {} (process {})", program(), std::process::id());
        assert!(error.to_string().contains(&holder), "{error}");
    }
    let shared = TtyOptions::default().exclusive(false);
    assert!(Tty::open(&path, &format(Parity::Even), &shared).is_ok());
    drop(first);
    open(&path, Parity::Even);
}

#[test]
fn a_lock_of_another_program_is_respected() {
    let (_far, path) = pair();
    let other = File::open(&path).unwrap();
    rustix::fs::flock(&other, rustix::fs::FlockOperation::NonBlockingLockExclusive).unwrap();
    assert_eq!(kind_of(&path), PortErrorKind::Busy);
}

#[test]
fn what_is_no_serial_port_is_refused() {
    assert_eq!(kind_of("/dev/ttyNoSuchPort"), PortErrorKind::NotFound);
    assert_eq!(kind_of(""), PortErrorKind::NotFound);
    assert_eq!(kind_of("/dev/null"), PortErrorKind::Unsupported);
    assert_eq!(kind_of(env!("CARGO_MANIFEST_DIR")), PortErrorKind::Unsupported);
    let with_zero = Tty::open("/dev/tty\0", &format(Parity::Even), &TtyOptions::default()).unwrap_err();
    assert_eq!(with_zero.kind, PortErrorKind::NotFound);
}

#[test]
fn a_closed_far_side_is_a_lost_port_every_time() {
    let (mut far, path) = pair();
    let mut line = open(&path, Parity::Even);
    far.write_all(&REQUEST).unwrap();
    assert_eq!(receive_exactly(&mut line, 8), REQUEST);
    drop(far);
    let until = line.now() + LONG;
    for _ in 0..3 {
        let error = line.receive(&mut [0; 8], until).unwrap_err();
        assert_eq!(error.kind, PortErrorKind::Lost);
        assert!(error.to_string().starts_with(&format!("{path}: the port is gone")), "{error}");
        assert_eq!(line.send(&REQUEST).unwrap_err().kind, PortErrorKind::Lost);
    }
    assert!(line.now() < until, "the loss ended the wait");
}

#[test]
fn a_far_side_that_takes_nothing_is_a_lost_port_in_the_end() {
    let (_far, path) = pair();
    let mut line = open(&path, Parity::None);
    // A pseudo-terminal holds some kilobytes; a megabyte that nobody reads cannot fit.
    let error = (0..4_096).find_map(|_| line.send(&[0x55; 256]).err()).unwrap();
    assert_eq!(error.kind, PortErrorKind::Lost);
    assert!(error.to_string().contains("takes no more bytes"), "{error}");
}

#[test]
fn rs485_mode_is_refused_where_there_is_none() {
    let (_far, path) = pair();
    let refused = |rs485| {
        let options = TtyOptions::default().rs485(rs485);
        Tty::open(&path, &format(Parity::Even), &options).unwrap_err()
    };
    let error = refused(Rs485::default());
    assert_eq!(error.kind, PortErrorKind::Unsupported);
    assert!(error.to_string().contains("RS-485"), "{error}");
    let error = refused(Rs485::default().delay_after_ms(101));
    assert!(error.to_string().contains("101 ms") && error.to_string().contains("0 to 100 ms"), "{error}");
    // A pseudo-terminal has no modem lines either.
    for switch in [Switch::Program, Switch::Either] {
        let error = refused(Rs485::default().switch(switch));
        assert_eq!(error.kind, PortErrorKind::Unsupported);
        assert!(error.to_string().contains("RTS cannot be moved"), "{error}");
    }
    open(&path, Parity::Even); // the refusals left nothing locked
    let off = TtyOptions::default().rs485(Rs485::default().enabled(false));
    Tty::open(&path, &format(Parity::Even), &off).unwrap(); // a driver without the mode has it off
}
