//! A port whose settings another program changes while it is open.

use std::fs::File;
use std::os::fd::OwnedFd;

use drivebus_line::tty::{Tty, TtyOptions};
use rustix::fs::{Mode, OFlags};
use rustix::termios::{
    InputModes, LocalModes, OptionalActions, OutputModes, SpecialCodeIndex, Termios, tcgetattr, tcsetattr,
};

use super::*;
use crate::pty::pair;

/// A port of 19200 bit/s, the other side of it, and another program that has it open, too.
fn three() -> (Tty, File, OwnedFd) {
    let (far, path) = pair();
    let line = Tty::open(&path, &format(Parity::None), &TtyOptions::default()).unwrap();
    let other = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty()).unwrap();
    (line, far, other)
}

fn change(other: &OwnedFd, change: impl FnOnce(&mut Termios)) {
    let mut settings = tcgetattr(other).unwrap();
    change(&mut settings);
    tcsetattr(other, OptionalActions::Now, &settings).unwrap();
}

/// What a program sees that looks at the settings.
fn shown(other: &OwnedFd) -> (u32, u32, InputModes, OutputModes, LocalModes, u8, u8) {
    let found = tcgetattr(other).unwrap();
    let [least, wait] = [SpecialCodeIndex::VMIN, SpecialCodeIndex::VTIME].map(|index| found.special_codes[index]);
    (found.input_speed(), found.output_speed(), found.input_modes, found.output_modes, found.local_modes, least, wait)
}

/// What the other program does, and what is said of it.
type Change = (fn(&mut Termios), &'static str);

#[test]
fn what_another_program_changed_is_set_again_and_told() {
    let (mut line, _far, other) = three();
    let ours = shown(&other);
    let changes: [Change; 9] = [
        (|settings| settings.set_speed(9_600).unwrap(), "9600 bit/s instead of 19200"),
        (|settings| settings.set_speed(187_500).unwrap(), "187500 bit/s instead of 19200"),
        (|settings| settings.input_modes.insert(InputModes::ISTRIP), "ISTRIP on"),
        (|settings| settings.input_modes.insert(InputModes::IXON | InputModes::ICRNL), "ICRNL on, IXON on"),
        (|settings| settings.input_modes.remove(InputModes::IGNBRK), "IGNBRK off"),
        (|settings| settings.output_modes.insert(OutputModes::OPOST), "OPOST on"),
        (|settings| settings.local_modes.insert(LocalModes::ICANON | LocalModes::ECHO), "ICANON on, ECHO on"),
        (|settings| settings.special_codes[SpecialCodeIndex::VMIN] = 200, "VMIN 200 instead of 1"),
        (|settings| settings.special_codes[SpecialCodeIndex::VTIME] = 7, "VTIME 7 instead of 0"),
    ];
    for (by, words) in changes {
        change(&other, by);
        assert_ne!(shown(&other), ours, "{words}: it was changed");
        let told = line.set_again().unwrap();
        assert!(told.contains(&format!("({words})")) && told.contains("set again"), "{told}");
        assert_eq!(shown(&other), ours, "{words}");
        assert_eq!(line.set_again(), None, "{words}: told once");
    }
    let notes = line.notes();
    assert!(notes.iter().any(|note| note.contains("9 times") && note.contains("VTIME 7")), "{notes:?}");
}

#[test]
fn a_port_that_nobody_changed_has_nothing_to_tell() {
    // A pseudo-terminal takes neither parity nor seven data bits: what it shows from the beginning is no change.
    let (_far, path) = pair();
    let seven = SerialFormat::new(187_500, DataBits::Seven, Parity::Odd, StopBits::Two, Silence::Characters).unwrap();
    let mut line = Tty::open(&path, &seven, &TtyOptions::default()).unwrap();
    let notes = line.notes();
    for _ in 0..3 {
        assert_eq!(line.set_again(), None);
    }
    assert_eq!(line.notes(), notes);
}

#[test]
fn what_makes_no_difference_to_the_bytes_is_not_told() {
    let (mut line, _far, other) = three();
    change(&other, |settings| {
        settings.special_codes[SpecialCodeIndex::VINTR] = 7;
        settings.local_modes.insert(LocalModes::TOSTOP);
        settings.output_modes.insert(OutputModes::ONLCR); // without OPOST nothing is translated
    });
    assert_eq!(line.set_again(), None);
}

#[test]
fn a_port_that_reads_nothing_where_nothing_is_there_is_not_gone() {
    let (mut line, mut far, other) = three();
    change(&other, |settings| settings.special_codes[SpecialCodeIndex::VMIN] = 0);
    // With VMIN 0 a read of nothing looks like the end of the port.
    assert_eq!(line.receive(&mut [0; 8], Instant::ZERO).unwrap(), 0);
    std::io::Write::write_all(&mut far, &REQUEST).unwrap();
    assert_eq!(receive_exactly(&mut line, 8), REQUEST);
    let told = line.set_again().unwrap();
    assert!(told.contains("VMIN 0 instead of 1"), "{told}");
    assert_eq!(line.set_again(), None);
}

#[test]
fn a_port_that_is_gone_is_gone_and_nothing_else() {
    let (mut line, far, other) = three();
    change(&other, |settings| settings.set_speed(9_600).unwrap());
    drop((far, other));
    assert_eq!(line.receive(&mut [0; 8], Instant::ZERO).unwrap_err().kind, PortErrorKind::Lost);
}
