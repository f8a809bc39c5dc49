//! One port, several buses: each stands for a program of its own, on one pseudo-terminal. What programs of their own add,
//! `tests/python/test_shared_port.py` has.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use drivebus_line::url::{Known, PortOptions, PortUrl};
use drivebus_line::{
    AdapterEcho, Bus, BusOptions, CallError, CallOptions, Done, Errand, ErrorKind, Failure, Poll, PollTarget,
    PortErrorKind, Share,
};
use drivebus_rtu::{
    Answer, AnswerLength, Destination, ExceptionCode, Meaning, Meanings, Request, SerialFormat, UnitAddress,
};
use drivebus_sim::{Options, PtyServer, Refusals, Simulator};

const IDENTIFICATION: u16 = 0x2103;
const GD350: u16 = 0x01A0;
const ACCELERATION: u16 = 0x800B; // P00.11 in RAM

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn line() -> (Simulator, PtyServer) {
    let simulator = Simulator::new([(1, "gd350"), (2, "gd350")], Options::default().realtime(true)).unwrap();
    let served = simulator.serve_pty().unwrap();
    (simulator, served)
}

/// With a time-out that no answer reaches, however busy the machine is.
fn options() -> BusOptions {
    BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent).timeout(Duration::from_secs(5))
}

fn open_as(served: &PtyServer, options: BusOptions) -> Result<Arc<Bus>, Failure> {
    open_at(&served.path(), options)
}

fn open_at(path: &Path, options: BusOptions) -> Result<Arc<Bus>, Failure> {
    let port = PortUrl::parse(path.to_str().unwrap(), &Known::default()).unwrap();
    let key = port.key();
    let opener = port.opener(&PortOptions::new(options.format)).unwrap();
    Bus::open_shared(opener, key, options, &mut || false).map(Arc::new)
}

fn open(served: &PtyServer) -> Arc<Bus> {
    open_as(served, options()).unwrap()
}

fn ask(bus: &Bus, to: u8, request: &Request<'_>) -> Result<(Vec<u16>, Done), Box<CallError>> {
    let mut read = Vec::new();
    let done = bus.call(unit(to).into(), request, CallOptions::new(), &mut || false, &mut |answer| {
        if let Answer::Read { words, .. } = answer {
            read = words.iter().collect();
        }
    })?;
    Ok((read, done))
}

fn identify(bus: &Bus) -> Result<Vec<u16>, Box<CallError>> {
    ask(bus, 1, &Request::read(IDENTIFICATION, 1).unwrap()).map(|(words, _)| words)
}

#[test]
fn every_kind_of_request_goes_through() {
    let (simulator, served) = line();
    let (owner, guest) = (open(&served), open(&served));
    let before = guest.now();
    let (words, done) = ask(&guest, 2, &Request::read(IDENTIFICATION - 1, 2).unwrap()).unwrap();
    assert_eq!(words[1], GD350);
    assert!(before < done.sent && done.sent < done.ended && done.ended <= guest.now(), "one clock for all");
    ask(&guest, 1, &Request::write(ACCELERATION, 11)).unwrap();
    ask(&guest, 1, &Request::write_many(ACCELERATION, &[12, 13]).unwrap()).unwrap();
    ask(&guest, 1, &Request::echo(guest.fresh_word())).unwrap();
    for length in [AnswerLength::Bytes(4), AnswerLength::BySilence] {
        let request = Request::custom(&[3, 0x21, 3, 0, 1], length).unwrap();
        let mut pdu = Vec::new();
        guest
            .call(unit(1).into(), &request, CallOptions::new(), &mut || false, &mut |answer| {
                if let Answer::Custom { pdu: came, .. } = answer {
                    pdu = came.to_vec();
                }
            })
            .unwrap();
        assert_eq!(pdu, [3, 2, 0x01, 0xA0]);
    }
    let everybody = Request::write(ACCELERATION, 14);
    guest.call(Destination::Broadcast, &everybody, CallOptions::new(), &mut || false, &mut |_| ()).unwrap();
    let written = |raw: u8| simulator.drive(raw).unwrap().writes().iter().map(|write| write.value).collect::<Vec<_>>();
    assert_eq!((written(1), written(2)), (vec![11, 12, 13, 14], vec![14]));
    assert_eq!((owner.stats().total, owner.stats().units), (guest.stats().total, guest.stats().units));
    assert_eq!((guest.link(unit(1)), guest.name()), (owner.link(unit(1)), owner.name()));
    let [program] = &owner.stats().programs[..] else { unreachable!("{:?}", owner.stats().programs) };
    assert_eq!((program.process, program.calls, program.answered), (std::process::id(), 7, 7));
}

#[test]
fn a_failure_says_there_what_it_says_here() {
    let (_simulator, served) = line();
    let (owner, guest) = (open(&served), open(&served));
    let closed = Request::read(0x6300, 1).unwrap();
    let (here, there) = (ask(&owner, 1, &closed).unwrap_err(), ask(&guest, 1, &closed).unwrap_err());
    assert_eq!((here.to_string(), &here.request, &here.raw), (there.to_string(), &there.request, &there.raw));
    assert!(matches!(there.failure, Failure::Refused { .. }) && there.sent < there.ended && there.sent.is_some());
    let absent = Request::read(IDENTIFICATION, 1).unwrap();
    // Asked once: whether there is time left to ask again is the machine's affair.
    let quick = CallOptions::new().timeout(Duration::from_millis(30)).retries(0);
    let ask = |bus: &Bus| bus.call(unit(9).into(), &absent, quick, &mut || false, &mut |_| ()).unwrap_err().to_string();
    assert_eq!(ask(&owner), ask(&guest));
}

#[test]
fn who_gives_up_is_told_at_once_and_nothing_more_of_it_is_sent() {
    let (simulator, served) = line();
    // Nobody answers a broadcast, and the line is kept for as long as units are given to act on it.
    let owner = open_as(&served, options().turnaround(Duration::from_secs(1))).unwrap();
    let guest = open(&served);
    identify(&guest).unwrap();
    let everybody = Request::write(ACCELERATION, 1);
    thread::scope(|scope| {
        let before = simulator.wire().requests();
        let keeping = scope.spawn(|| {
            owner.call(Destination::Broadcast, &everybody, CallOptions::new(), &mut || false, &mut |_| ()).is_ok()
        });
        while simulator.wire().requests() == before {}
        let mut asked = 0;
        let mut give_up = || {
            asked += 1;
            asked > 1
        };
        let write = Request::write(ACCELERATION, 77);
        let options = CallOptions::new();
        let error = guest.call(unit(1).into(), &write, options, &mut give_up, &mut |_| ()).unwrap_err();
        assert_eq!((error.failure, error.sent), (Failure::Interrupted, None));
        assert!(keeping.join().unwrap());
    });
    identify(&guest).unwrap();
    let values: Vec<_> = simulator.drive(1).unwrap().writes().iter().map(|write| write.value).collect();
    assert_eq!(values, [1]);
}

#[test]
fn errands_of_a_guest_are_all_told_and_one_taken_back_is_not_sent() {
    let (simulator, served) = line();
    let (_owner, guest) = (open(&served), open(&served));
    let (tell, told) = channel();
    for number in 0..200 {
        let tell = tell.clone();
        let request = Request::read(IDENTIFICATION, 1).unwrap();
        guest.send(Errand::new(unit(1 + number % 2).into(), &request, CallOptions::new(), move |outcome| {
            tell.send(outcome.map(|reply| reply.pdu)).unwrap();
        }));
    }
    drop(tell);
    let came: Vec<_> = told.iter().collect();
    assert_eq!(came.len(), 200);
    let unlike: Vec<_> = came.iter().filter(|outcome| outcome.as_deref() != Ok(&[3, 2, 0x01, 0xA0][..])).collect();
    assert!(unlike.is_empty(), "{unlike:?}");
    let (tell, told) = channel();
    let running = guest.send(Errand::new(unit(9).into(), &Request::write(1, 1), CallOptions::new(), move |outcome| {
        tell.send(outcome.is_err()).unwrap();
    }));
    running.unwrap().abandon();
    // Whether it was on the wire by then or not: nobody is told that it was done.
    assert_ne!(told.recv().ok(), Some(false));
    assert!(simulator.drive(1).unwrap().writes().is_empty());
}

#[test]
fn a_poll_goes_on_when_the_port_changes_hands() {
    let (_simulator, served) = line();
    let (owner, guest) = (open(&served), open(&served));
    let poll =
        Poll::start(Arc::clone(&guest), vec![PollTarget::new(unit(1), vec![(IDENTIFICATION, 1)])], None, 100).unwrap();
    poll.wait(5, None, &mut || false).unwrap();
    let before = guest.reconnects();
    owner.close();
    let mut after = 0;
    while after < 5 {
        poll.wait(1, None, &mut || false).unwrap();
        after +=
            poll.take(10).iter().filter(|(sample, _)| sample.missing.is_none() && guest.reconnects() > before).count();
    }
    assert_eq!(identify(&open(&served)).unwrap(), [GD350]);
}

#[test]
fn a_port_that_changes_hands_again_and_again_gives_no_wrong_value() {
    let (simulator, served) = line();
    let over = AtomicBool::new(false);
    let mut owner = open(&served);
    let buses: Vec<_> = (0..3).map(|_| open(&served)).collect();
    thread::scope(|scope| {
        for bus in &buses {
            scope.spawn(|| {
                while !over.load(Ordering::Acquire) {
                    // A moment in which nobody has the port is an error; nothing else is.
                    if let Ok(words) = identify(bus) {
                        assert_eq!(words, [GD350]);
                    }
                }
            });
        }
        for _ in 0..5 {
            let before = simulator.wire().requests();
            while simulator.wire().requests() < before + 6 {}
            let next = open(&served);
            owner.close();
            owner = next;
        }
        over.store(true, Ordering::Release);
    });
    owner.close();
    assert!(buses.iter().all(|bus| identify(bus).is_ok() && bus.reconnects() >= 1));
}

#[test]
fn what_was_seen_before_a_port_changed_hands_is_not_written_to() {
    let (simulator, served) = line();
    let (owner, guest) = (open(&served), open(&served));
    identify(&guest).unwrap();
    let seen = guest.reconnects();
    owner.close();
    let write = Request::write(ACCELERATION, 5);
    let options = CallOptions::new().connection(seen);
    let error = guest.call(unit(1).into(), &write, options, &mut || false, &mut |_| ()).unwrap_err();
    // TCP may notice the end of the other program only behind what was said to it: then nobody says that it was not sent.
    if over_loopback() && matches!((&error.failure, error.sent), (Failure::Port(_), Some(_))) {
        return;
    }
    assert_eq!((error.failure, error.sent), (Failure::Reopened, None));
    let options = CallOptions::new().connection(guest.reconnects());
    guest.call(unit(1).into(), &write, options, &mut || false, &mut |_| ()).unwrap();
    assert_eq!(simulator.drive(1).unwrap().writes().len(), 1);
}

#[test]
fn a_cable_that_is_plugged_in_again_is_seen_by_all() {
    // Plugged in again a pseudo-terminal has another number; the link leads there.
    let link = std::env::temp_dir().join(format!("drivebus-shared-{}", std::process::id()));
    let simulator = Simulator::new([(1, "gd350")], Options::default().realtime(true)).unwrap();
    let _served = simulator.serve_pty_linked(&link).unwrap();
    let (owner, guest) = (open_at(&link, options()).unwrap(), open_at(&link, options()).unwrap());
    identify(&guest).unwrap();
    let seen = guest.reconnects();
    simulator.wire().unplug();
    let lost = identify(&guest).unwrap_err();
    assert!(matches!(lost.failure, Failure::Port(_)), "{lost}");
    simulator.wire().replug().unwrap();
    assert!((0..100).any(|_| identify(&guest).is_ok()));
    assert_eq!((owner.reconnects(), guest.reconnects()), (1, 1));
    let write = Request::write(ACCELERATION, 5);
    let options = CallOptions::new().connection(seen);
    let error = guest.call(unit(1).into(), &write, options, &mut || false, &mut |_| ()).unwrap_err();
    assert_eq!(error.failure, Failure::Reopened);
}

#[test]
fn the_line_is_heard_through_another_program() {
    let (_simulator, served) = line();
    let (_owner, guest) = (open(&served), open(&served));
    let mut heard = Vec::new();
    guest.listen(Duration::from_millis(30), &mut || false, &mut |_, bytes| heard.extend_from_slice(bytes)).unwrap();
    assert_eq!(heard, []);
    let given_up = guest.listen(Duration::from_secs(60), &mut || true, &mut |_, _| ());
    assert_eq!(given_up, Err(Failure::Interrupted));
    guest.close();
    assert_eq!(guest.listen(Duration::ZERO, &mut || false, &mut |_, _| ()), Err(Failure::Closed));
}

#[test]
fn who_shares_nothing_is_alone() {
    let (_simulator, served) = line();
    let never = open_as(&served, options().share(Share::Never)).unwrap();
    let busy = open_as(&served, options()).map(drop).unwrap_err();
    assert!(matches!(busy, Failure::Port(error) if error.kind == PortErrorKind::Busy));
    never.close();
    let owner = open(&served);
    let busy = open_as(&served, options().share(Share::Never)).map(drop).unwrap_err();
    assert!(matches!(busy, Failure::Port(error) if error.kind == PortErrorKind::Busy));
    assert_eq!(identify(&owner).unwrap(), [GD350]);
}

/// Two refusals by 01H, by which an EDS300 says that the request came damaged; the owner of the port was told of no family.
#[test]
fn what_a_programs_profile_says_of_exceptions_holds_for_what_it_asks_through_another() {
    let (simulator, served) = line();
    let (owner, guest) =
        (open_as(&served, options().retries(1)).unwrap(), open_as(&served, options().retries(1)).unwrap());
    let damaged = Meanings::STANDARD.with(ExceptionCode::ILLEGAL_FUNCTION, Meaning::AskAgain);
    guest.set_meanings(unit(1), damaged);
    assert_eq!((identify(&owner).unwrap(), identify(&guest).unwrap()), (vec![GD350], vec![GD350]));
    let refuse = |count| {
        let refusals = Refusals::new(ExceptionCode::ILLEGAL_FUNCTION.0).count(count);
        simulator.drive(1).unwrap().refuse(refusals).unwrap();
    };
    for bus in [&guest, &owner] {
        refuse(2);
        let asked = bus.stats().total.requests;
        let result = identify(bus);
        if Arc::ptr_eq(bus, &guest) {
            assert_eq!(result.map_err(|error| error.failure), Ok(vec![GD350]));
            assert_eq!(bus.stats().total.requests - asked, 3);
        } else {
            assert!(matches!(result.unwrap_err().failure, Failure::Refused { .. }), "each by its own profile");
        }
    }
    // What the owner was told holds for who knows nothing.
    simulator.drive(1).unwrap().refuse_no_more();
    owner.set_meanings(unit(1), damaged);
    let third = open_as(&served, options().retries(1)).unwrap();
    refuse(1);
    assert_eq!(identify(&third).unwrap(), [GD350]);
}

#[test]
fn each_program_keeps_to_its_own_rules() {
    let (simulator, served) = line();
    let (reading, writing) = (open_as(&served, options().read_only(true)).unwrap(), open(&served));
    let write = Request::write(ACCELERATION, 5);
    ask(&writing, 1, &write).unwrap();
    assert!(matches!(ask(&reading, 1, &write).unwrap_err().failure, Failure::ReadOnly { .. }));
    assert_eq!(simulator.drive(1).unwrap().writes().len(), 1);
}

/// Whichever program starts, and whichever stops.
#[test]
fn a_stop_takes_back_what_was_decided_on_before_it() {
    let (simulator, served) = line();
    let (owner, guest) = (open(&served), open(&served));
    let written = || simulator.drive(1).unwrap().writes().len();
    for (starts, stops) in [(&owner, &guest), (&guest, &owner), (&owner, &owner), (&guest, &guest)] {
        let before = starts.halts(unit(1));
        assert_eq!(stops.halts(unit(1)), before, "one number for all");
        let others = starts.halts(unit(2));
        let call = |bus: &Bus, request: &Request<'_>, options: CallOptions| {
            bus.call(unit(1).into(), request, options, &mut || false, &mut |_| ())
        };
        let (start, stop) = (Request::write(0x2000, 1), Request::write(0x2000, 5));
        call(stops, &stop, CallOptions::new().urgent(&stop)).unwrap();
        let count = written();
        let error = call(starts, &start, CallOptions::new().halts(before)).unwrap_err();
        assert_eq!((&error.failure, error.sent), (&Failure::Halted { unit: 1 }, None));
        assert_eq!((error.kind(), error.may_have_acted()), (ErrorKind::NotAllowed, false));
        assert_eq!(written(), count);
        assert_eq!(starts.halts(unit(2)), others);
        // What was decided on since goes out, and a stop in any case.
        call(starts, &stop, CallOptions::new().urgent(&stop).halts(before)).unwrap();
        call(starts, &Request::write(ACCELERATION, 9), CallOptions::new().halts(starts.halts(unit(1)))).unwrap();
        assert_eq!(written(), count + 2);
    }
}

const OVER_LOOPBACK: &str = "DRIVEBUS_TESTS_OVER_LOOPBACK";

/// Whether the programs of this process meet on the loopback.
fn over_loopback() -> bool {
    std::env::var_os(OVER_LOOPBACK).is_some()
}

/// How programs meet is said by their environment, so it is another process that runs all of this again.
#[test]
fn all_of_it_holds_on_the_loopback_too() {
    if over_loopback() {
        return; // this is the other process
    }
    let mut again = Command::new(std::env::current_exe().unwrap());
    let done = again.args(["--test-threads", "2"]).env(OVER_LOOPBACK, "1").output().unwrap();
    let said = [done.stdout, done.stderr].map(|said| String::from_utf8_lossy(&said).into_owned());
    assert!(done.status.success() && said[0].contains(" 0 filtered out"), "{}", said.concat());
}
