//! An error says what happened once: its own text, or the error behind it. Who prints the whole chain, as `anyhow` does,
//! reads no sentence twice.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::error::Error;
use std::io;
use std::time::Duration;

use drivebus_drives::Profile;
use drivebus_line::url::{Known, PortUrl, UnitError, UrlError};
use drivebus_line::{Bus, BusOptions, CallError, CallOptions, Failure, Line, PollError, PortError, PortErrorKind};
use drivebus_rtu::{AnswerError, BeginError, ExceptionCode, FrameError, Request, SerialFormat, UnitAddress};
use drivebus_sim::{Options, SimError, Simulator};

/// The texts of `error` and of all behind it, as they are printed one below the other.
fn chain(error: &(dyn Error + 'static)) -> Vec<String> {
    std::iter::successors(Some(error), |&error| error.source()).map(ToString::to_string).collect()
}

#[track_caller]
fn says_it_once(error: impl Error + 'static) {
    let texts = chain(&error);
    for (index, text) in texts.iter().enumerate() {
        let before = texts[..index].iter().find(|before| before.contains(text.as_str()));
        assert_eq!(before, None, "{texts:#?}");
    }
}

fn port() -> PortError {
    PortError::new(PortErrorKind::Busy, "/dev/ttyUSB0", "another program has it")
}

fn failures() -> Vec<Failure> {
    let code = ExceptionCode::ILLEGAL_ADDRESS;
    vec![
        Failure::Port(port()),
        Failure::Reopened,
        Failure::Closed,
        Failure::QueueFull { room: 3 },
        Failure::NotBegun(BeginError::OutOfTurn),
        Failure::NoAnswer { timeout: Duration::MAX, attempts: 3 },
        Failure::Doubtful,
        Failure::NotTaken { times: 2, shows: vec![1, 2] },
        Failure::Acknowledged { code, shows: vec![1] },
        Failure::Wrong(AnswerError::Unit { asked: 1, came: 2 }),
        Failure::Corrupt(FrameError::Crc { computed: 1, received: 2 }),
        Failure::Refused { function: 3, code },
    ]
}

/// The error of a read that nobody answered, as if it had ended in `failure`, after two bytes.
fn call_error(failure: Failure) -> CallError {
    let simulator = Simulator::new([(1, "gd350")], Options::default()).unwrap();
    let opener = Box::new(move || Ok(Box::new(simulator.open_line()?) as Box<dyn Line>));
    let bus = Bus::open(opener, BusOptions::new(SerialFormat::DEFAULT), &mut || false).unwrap();
    let nobody = UnitAddress::new(9).unwrap();
    let read = Request::read(0x2100, 2).unwrap();
    let result = bus.call(nobody.into(), &read, CallOptions::new().retries(0), &mut || false, &mut |_| ());
    let mut error = *result.unwrap_err();
    (error.failure, error.raw) = (failure, vec![1, 2]);
    error
}

#[test]
fn what_became_of_a_call_is_said_once() {
    for failure in failures() {
        says_it_once(failure.clone());
        says_it_once(call_error(failure.clone()));
        says_it_once(PollError::Bus(failure.clone()));
        says_it_once(drivebus::Error::from(failure.clone()));
        let error = drivebus::Error::from(Box::new(call_error(failure.clone())));
        assert_eq!(error.call().unwrap().failure, failure, "what is known of the call is not lost");
        says_it_once(error);
    }
    says_it_once(port());
}

#[test]
fn what_cannot_be_is_said_once() {
    for url in ["", "x://y", "socket://y", "sim://0=gd350", "sim://1=nothing", "sim://x=gd350", "sim://1=gd350?seed=x"]
    {
        let error = PortUrl::parse(url, &Known::default()).unwrap_err();
        says_it_once(drivebus::Error::from(error.clone()));
        says_it_once(error);
    }
    says_it_once(UrlError::Unit(UnitError::Broadcast));
    says_it_once(UnitError::OutOfRange { unit: 300 });
    says_it_once(UnitAddress::new(0).unwrap_err());
    says_it_once(Request::read(0, 0).unwrap_err());
    says_it_once(Profile::builtin("nothing").unwrap_err());
    says_it_once(drivebus::Error::from(Profile::builtin("nothing").unwrap_err()));
}

#[test]
fn why_nothing_is_simulated_is_said_once() {
    says_it_once(SimError::from(io::Error::other("no such folder")));
    says_it_once(SimError::from(UnitAddress::new(0).unwrap_err()));
    says_it_once(drivebus::Error::from(SimError::from(io::Error::other("no such folder"))));
    for units in [vec![(0, "gd350")], vec![(1, "nothing")], vec![(1, "gd350"), (1, "gd350")]] {
        says_it_once(Simulator::new(units, Options::default()).unwrap_err());
    }
    says_it_once(Simulator::new([(1, "gd350")], Options::default()).unwrap().drive(2).unwrap_err());
}
