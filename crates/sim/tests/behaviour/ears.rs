//! A pseudo-terminal that overhears the wire.

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::time::Duration;

use drivebus_line::Line;
use drivebus_line::tty::{Tty, TtyOptions};
use drivebus_rtu::{DataBits, Parity, SerialFormat, Silence, StopBits};
use drivebus_sim::{Options, SimError, Simulator};

use crate::bench::{framed, hex, pdu};

/// An answer to "who are you?".
const GD350: &str = "01 03 02 01 A0 B9 AC";

fn simulator() -> Simulator {
    Simulator::new([(1, "gd350")], Options::default().realtime(true)).unwrap()
}

fn open(path: &Path) -> File {
    OpenOptions::new().read(true).write(true).open(path).unwrap()
}

fn request() -> Vec<u8> {
    framed(1, &pdu(0x03, &[0x2103, 1]))
}

/// Asks who is there and waits for the answer.
fn ask(port: &mut (impl Read + Write)) {
    port.write_all(&request()).unwrap();
    let mut answer = [0; 7];
    port.read_exact(&mut answer).unwrap();
    assert_eq!(answer[..], hex(GD350));
}

/// What the next exchange is at `ear`.
fn exchange_at(ear: &mut impl Read) -> Vec<u8> {
    let mut heard = vec![0; 15];
    ear.read_exact(&mut heard).unwrap();
    heard
}

fn exchange() -> Vec<u8> {
    [request(), hex(GD350)].concat()
}

#[test]
fn an_ear_hears_the_master_and_the_unit_in_their_order() {
    let simulator = simulator();
    let (server, ear) = (simulator.serve_pty().unwrap(), simulator.serve_ear().unwrap());
    let (mut port, mut heard) = (open(&server.path()), open(ear.path()));
    for _ in 0..3 {
        ask(&mut port);
        assert_eq!(exchange_at(&mut heard), exchange());
    }
    assert_eq!(simulator.wire().requests(), 3);
}

#[test]
fn an_ear_hears_what_comes_over_tcp() {
    let simulator = simulator();
    let (server, ear) = (simulator.serve_tcp().unwrap(), simulator.serve_ear().unwrap());
    let (mut port, mut heard) = (TcpStream::connect(server.address()).unwrap(), open(ear.path()));
    ask(&mut port);
    assert_eq!(exchange_at(&mut heard), exchange());
}

#[test]
fn an_ear_hears_a_line_of_this_process() {
    let simulator = simulator();
    let ear = simulator.serve_ear().unwrap();
    let mut heard = open(ear.path());
    let mut line = simulator.line();
    let sent = line.send(&request()).unwrap();
    line.sleep(sent + Duration::from_millis(50));
    assert_eq!(exchange_at(&mut heard), exchange());
}

#[test]
fn an_adapter_that_echoes_is_heard_once() {
    let simulator = simulator();
    simulator.wire().set_echo(true);
    let (server, ear) = (simulator.serve_pty().unwrap(), simulator.serve_ear().unwrap());
    let (mut port, mut heard) = (open(&server.path()), open(ear.path()));
    for _ in 0..2 {
        port.write_all(&request()).unwrap();
        assert_eq!(exchange_at(&mut port), exchange(), "its own request comes back");
        assert_eq!(exchange_at(&mut heard), exchange());
    }
}

#[test]
fn what_is_said_at_an_ear_goes_nowhere() {
    let simulator = simulator();
    let (server, ear) = (simulator.serve_pty().unwrap(), simulator.serve_ear().unwrap());
    let (mut port, mut heard) = (open(&server.path()), open(ear.path()));
    for _ in 0..600 {
        heard.write_all(&[0x55]).unwrap();
    }
    ask(&mut port);
    assert_eq!(exchange_at(&mut heard), exchange());
    assert_eq!(simulator.wire().requests(), 1);
}

/// As fast as a line of characters may be.
fn fast() -> Simulator {
    let format = SerialFormat::new(115_200, DataBits::Eight, Parity::None, StopBits::One, Silence::Spec).unwrap();
    Simulator::new([(1, "gd350")], Options::default().realtime(true).format(format)).unwrap()
}

#[test]
fn an_ear_that_nobody_reads_does_not_stall_the_line() {
    let simulator = fast();
    let (server, ear) = (simulator.serve_pty().unwrap(), simulator.serve_ear().unwrap());
    let mut port = open(&server.path());
    let _idle = open(ear.path());
    // Twice as much as a pseudo-terminal keeps.
    for _ in 0..(2 * 4_096 / 40) {
        port.write_all(&framed(1, &pdu(0x03, &[0x3000, 16]))).unwrap();
        port.read_exact(&mut [0; 37]).unwrap();
    }
}

#[test]
fn who_comes_late_hears_only_what_is_said_from_then_on() {
    let simulator = simulator();
    let (server, ear) = (simulator.serve_pty().unwrap(), simulator.serve_ear().unwrap());
    let mut port = open(&server.path());
    let first = open(ear.path());
    ask(&mut port);
    drop(first);
    port.write_all(&framed(1, &pdu(0x03, &[0x2100, 1]))).unwrap();
    port.read_exact(&mut [0; 7]).unwrap();
    let mut late = open(ear.path());
    ask(&mut port);
    assert_eq!(exchange_at(&mut late), exchange());
}

#[test]
fn an_ear_of_another_speed_hears_as_many_characters_and_none_right() {
    let simulator = simulator();
    let (server, ear) = (simulator.serve_pty().unwrap(), simulator.serve_ear().unwrap());
    let other = SerialFormat::new(9_600, DataBits::Eight, Parity::None, StopBits::One, Silence::Spec).unwrap();
    let mut heard = Tty::open(ear.path().to_str().unwrap(), &other, &TtyOptions::default()).unwrap();
    ask(&mut open(&server.path()));
    let mut came = Vec::new();
    let mut buffer = [0; 64];
    while came.len() < 15 {
        let until = heard.now() + Duration::from_secs(10);
        let count = heard.receive(&mut buffer, until).unwrap();
        assert!(count > 0, "nothing came within ten seconds");
        came.extend_from_slice(&buffer[..count]);
    }
    assert!(came.iter().zip(exchange()).all(|(came, said)| *came != said), "{came:02X?}");
}

#[test]
fn an_ear_stays_when_the_adapter_is_pulled_out() {
    let simulator = simulator();
    let (server, ear) = (simulator.serve_pty().unwrap(), simulator.serve_ear().unwrap());
    let mut heard = open(ear.path());
    simulator.wire().unplug();
    simulator.wire().replug().unwrap();
    ask(&mut open(&server.path()));
    assert_eq!(exchange_at(&mut heard), exchange());
}

#[test]
fn a_link_leads_to_an_ear_until_it_is_dropped() {
    let simulator = simulator();
    let link = std::env::temp_dir().join(format!("drivebus-ear-{}", std::process::id()));
    let ear = simulator.serve_ear_linked(&link).unwrap();
    assert_eq!(fs::read_link(&link).unwrap(), ear.path());
    drop(ear);
    assert!(!link.exists());
}

#[test]
fn virtual_time_has_no_ear() {
    let simulator = Simulator::new([(1, "gd350")], Options::default()).unwrap();
    assert!(matches!(simulator.serve_ear(), Err(SimError::VirtualTime)));
}
