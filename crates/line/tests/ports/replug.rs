//! A bus whose port is unplugged while it polls: an error at once, no wrong value, and work again when it is back.
#![expect(clippy::panic, reason = "a test may panic")]

use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::{self, JoinHandle};

use drivebus_line::tcp::RtuOverTcp;
use drivebus_line::{Bus, BusOptions, CallError, CallOptions, Failure, Opener, PortError};
use drivebus_rtu::{Answer, Request, UnitAddress, crc16};

use super::machine::{FTDI, Machine};
use super::pty::pair;
use super::*;

/// What register `address` of the slave holds: no two hold the same.
fn word_at(address: u16) -> u16 {
    address ^ 0x5AA5
}

/// A slave that answers `answers` requests and is gone in the middle of the next one.
fn slave(mut far: impl Read + Write + Send + 'static, answers: usize) -> JoinHandle<()> {
    thread::spawn(move || {
        for _ in 0..answers {
            let mut request = [0; 8]; // a read or an echo
            if far.read_exact(&mut request).is_err() {
                return;
            }
            let mut answer = request[..6].to_vec();
            if request[1] == 0x03 {
                answer = vec![request[0], 3, 2 * request[5]];
                for address in (u16::from_be_bytes([request[2], request[3]])..).take(request[5].into()) {
                    answer.extend(word_at(address).to_be_bytes());
                }
            }
            let crc = crc16(&answer);
            answer.extend(crc.to_le_bytes());
            far.write_all(&answer).unwrap();
        }
        let _ = far.read_exact(&mut [0; 4]);
    })
}

fn read(bus: &Bus, address: u16) -> Result<u16, Box<CallError>> {
    read_of(1, bus, address)
}

fn read_of(unit: u8, bus: &Bus, address: u16) -> Result<u16, Box<CallError>> {
    let request = Request::read(address, 1).unwrap();
    let mut word = None;
    bus.call(UnitAddress::new(unit).unwrap().into(), &request, CallOptions::default(), &mut || false, &mut |answer| {
        if let Answer::Read { words, .. } = answer {
            word = words.iter().next();
        }
    })?;
    Ok(word.unwrap())
}

/// Reads until the port is lost. No value may be a wrong one, and only the port may be to blame.
fn poll_until_lost(bus: &Bus) -> PortError {
    poll_of_until_lost(1, bus)
}

fn poll_of_until_lost(unit: u8, bus: &Bus) -> PortError {
    for address in 0x2000.. {
        match read_of(unit, bus, address) {
            Ok(word) => assert_eq!(word, word_at(address), "register {address:04X}H"),
            Err(error) => return port_error(&error),
        }
    }
    unreachable!("the slave answers so many times only")
}

fn port_error(error: &CallError) -> PortError {
    match &error.failure {
        Failure::Port(error) => error.clone(),
        other => panic!("not an error of the port: {other:?}"),
    }
}

/// `opener`, and how often it was asked.
fn counted(mut opener: Opener) -> (Opener, Arc<AtomicU32>) {
    let tries = Arc::new(AtomicU32::new(0));
    let count = Arc::clone(&tries);
    let opener = move || {
        count.fetch_add(1, Ordering::SeqCst);
        opener()
    };
    (Box::new(opener), tries)
}

fn open(opener: Opener) -> Bus {
    let mut options = BusOptions::new(format(Parity::None));
    options.timeout = LONG; // only the port ends a wait
    Bus::open(opener, options, &mut || false).unwrap()
}

/// Plugs in a new pseudo-terminal whose slave answers some requests, as the same adapter.
fn plug_in(machine: &Machine, by_link: bool) -> (String, JoinHandle<()>) {
    let (far, path): (File, String) = pair();
    if by_link {
        machine.link("usb-FTDI_A50285BI-if00-port0", &path);
    } else {
        machine.plug("ttyUSB0", &path, FTDI);
    }
    (path, slave(far, 8))
}

fn pull_out(machine: &Machine, by_link: bool) {
    if by_link {
        machine.unlink("usb-FTDI_A50285BI-if00-port0");
    } else {
        machine.unplug("ttyUSB0");
    }
}

#[test]
fn twenty_times_under_another_name() {
    twenty_times(false);
}

#[test]
fn twenty_times_behind_a_link() {
    twenty_times(true);
}

/// Recovery is bounded by the number of tries: the first call after the port is back makes one, and it succeeds. When
/// that one is made, the opener's own tests say: a quarter of a second later at the longest.
///
/// Two units are asked in turn: each loss leaves an answer owed, for four time-outs, and from the sixteenth on no length
/// tells those of one unit apart, so that its next read would wait for their end.
fn twenty_times(by_link: bool) {
    let machine = Machine::new();
    let (mut path, mut gone) = plug_in(&machine, by_link);
    let mut adapter = machine.adapter(&path);
    let (opener, tries) = counted(Box::new(move || Ok(Box::new(adapter.open()?))));
    let bus = open(opener);
    let mut unit = 1;
    assert_eq!(read_of(unit, &bus, 0x2103).unwrap(), word_at(0x2103));

    for round in 1..=20 {
        let lost = poll_of_until_lost(unit, &bus);
        assert_eq!((lost.kind, &lost.port), (PortErrorKind::Lost, &path));
        gone.join().unwrap();
        pull_out(&machine, by_link);
        let error = port_error(&read(&bus, 0x2000).unwrap_err());
        assert_eq!(error.kind, PortErrorKind::NotFound, "{error}");
        assert!(error.to_string().contains("A50285BI"), "{error}");

        let before = tries.load(Ordering::SeqCst);
        let old = std::mem::take(&mut path);
        (path, gone) = plug_in(&machine, by_link);
        assert_ne!(path, old);
        unit = 3 - unit;
        assert_eq!(read_of(unit, &bus, 0x2103).unwrap(), word_at(0x2103), "the first call after the port is back");
        assert_eq!(tries.load(Ordering::SeqCst), before + 1);
        assert_eq!(bus.stats().reconnects, round);
    }
    poll_of_until_lost(unit, &bus);
    gone.join().unwrap();
}

#[test]
fn a_lost_port_is_closed_and_found_missing_once_a_call() {
    let machine = Machine::new();
    let (path, gone) = plug_in(&machine, true);
    let mut adapter = machine.adapter(&path);
    let (opener, tries) = counted(Box::new(move || Ok(Box::new(adapter.open()?))));
    let bus = open(opener);
    assert_eq!(times_open(&path), 2);
    poll_until_lost(&bus);
    gone.join().unwrap();
    pull_out(&machine, true);
    assert_eq!(times_open(&path), 1, "only what keeps its name is left");
    let before = tries.load(Ordering::SeqCst);
    for count in 1..=6 {
        port_error(&read(&bus, 0x2000).unwrap_err());
        assert_eq!(tries.load(Ordering::SeqCst), before + count);
    }
}

/// How often this process has it open, whether it is still there or not.
fn times_open(path: &str) -> usize {
    let gone = format!("{path} (deleted)");
    let ours = std::fs::read_dir("/proc/self/fd").unwrap();
    let targets =
        ours.filter_map(|file| std::fs::read_link(file.ok()?.path()).ok()?.into_os_string().into_string().ok());
    targets.filter(|target| target == path || *target == gone).count()
}

#[test]
fn a_server_that_closes_is_connected_to_again() {
    /// Requests on one connection: a look at the adapter and an echo, and four reads.
    const SERVED: usize = 6;
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let (opener, tries) =
        counted(Box::new(move || Ok(Box::new(RtuOverTcp::connect("127.0.0.1", port, &format(Parity::None), LONG)?))));
    let serving = thread::spawn(move || {
        for _ in 0..2 {
            slave(listener.accept().unwrap().0, SERVED).join().unwrap();
        }
        let (last, _) = listener.accept().unwrap();
        drop(listener); // nobody may be let in any more when this one ends
        slave(last, SERVED).join().unwrap();
    });
    let bus = open(opener);
    // A read that was lost with the connection is asked again over the next one: nobody notices.
    for address in 0x2000..0x2006 {
        assert_eq!(read(&bus, address).unwrap(), word_at(address));
    }
    assert_eq!(bus.stats().reconnects, 1);
    poll_until_lost(&bus);
    serving.join().unwrap();
    assert_eq!(bus.stats().reconnects, 2);
    assert_eq!(tries.load(Ordering::SeqCst), 4, "three connections, and one that nobody took");
}
