//! Who has the port, who uses it through that one, and what becomes of it when that one is gone.

use std::io::{BufRead, BufReader, Write};
use std::sync::Arc;
use std::sync::mpsc::channel;
use std::thread;
use std::time::Duration;

use drivebus_line::{BusOptions, Failure, LastWill, Share};
use drivebus_rtu::{DataBits, Parity, SerialFormat, Silence, StopBits, UnitAddress};

use crate::port::{open, open_as, options, read, sent};
use crate::{another_program, files, in_each_way, on_loopback};

#[test]
fn each_gets_its_own_answers() {
    in_each_way("sharing::each_gets_its_own_answers", |_| {
        let buses: Vec<_> = (0..4).map(|_| open()).collect();
        thread::scope(|scope| {
            for (number, bus) in (0_u16..).zip(&buses) {
                scope.spawn(move || {
                    for address in (1_000 * number..).take(50) {
                        assert_eq!(read(bus, address).unwrap(), address);
                    }
                });
            }
        });
        assert_eq!(sent(), 200);
        let programs = buses[0].stats().programs;
        let counts: Vec<_> = programs.iter().map(|program| (program.process, program.calls)).collect();
        assert_eq!(counts, [(std::process::id(), 150)], "they are one program, which says its number");
    });
}

#[test]
fn when_a_bus_is_closed_another_has_the_port() {
    in_each_way("sharing::when_a_bus_is_closed_another_has_the_port", |folder| {
        let (first, second) = (open(), open());
        assert_eq!((read(&second, 1).unwrap(), second.reconnects()), (1, 0));
        first.close();
        assert_eq!((read(&second, 2).unwrap(), second.reconnects()), (2, 1));
        let third = open();
        assert_eq!(read(&third, 3).unwrap(), 3);
        drop(third);
        second.close();
        assert!(files(folder, "tcp").is_empty() && files(folder, "sock").is_empty());
    });
}

/// Has the port until it is killed: the other program of [`when_a_program_is_killed_another_has_the_port`].
#[test]
fn has_the_port() {
    if std::env::var_os(crate::FOLDER).is_none() {
        return; // it is nobody's other program
    }
    let bus = open();
    assert_eq!(read(&bus, 1).unwrap(), 1);
    std::io::stdout().write_all(b"\nit is open\n").unwrap();
    let mut line = String::new();
    std::io::stdin().read_line(&mut line).unwrap();
}

#[test]
fn when_a_program_is_killed_another_has_the_port() {
    in_each_way("sharing::when_a_program_is_killed_another_has_the_port", |folder| {
        for has_guest in [true, false] {
            let mut owner = another_program("sharing::has_the_port");
            let said = BufReader::new(owner.stdout.take().unwrap()).lines();
            assert!(said.map(Result::unwrap).any(|line| line == "it is open"));
            let guest = has_guest.then(open);
            if let Some(guest) = &guest {
                assert_eq!((read(guest, 2).unwrap(), sent()), (2, 0), "through the other program");
                assert!(guest.notes()[0].contains(&format!("process {}", owner.id())), "{:?}", guest.notes());
            }
            owner.kill().unwrap();
            owner.wait().unwrap();
            let before: Vec<_> = files(folder, "tcp").iter().map(|path| std::fs::read(path).unwrap()).collect();
            let heir = guest.unwrap_or_else(open);
            assert_eq!(read(&heir, 3).unwrap(), 3);
            assert_eq!(heir.reconnects(), u64::from(has_guest));
            let after: Vec<_> = files(folder, "tcp").iter().map(|path| std::fs::read(path).unwrap()).collect();
            assert!(before.len() == after.len() && before.iter().zip(&after).all(|(before, after)| before != after));
            assert_eq!(read(&open(), 4).unwrap(), 4, "others come in behind the one that took it over");
            heir.close();
        }
    });
}

#[test]
fn what_differs_is_told() {
    in_each_way("sharing::what_differs_is_told", |_| {
        let owner = open();
        let format = SerialFormat::new(38_400, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec).unwrap();
        let error = open_as(BusOptions::new(format)).unwrap_err().to_string();
        assert!(error.contains("has the port open at") && error.contains("38400 8E1 is asked for"), "{error}");
        let error = open_as(options().share(Share::Never)).unwrap_err();
        assert!(matches!(error, Failure::Port(_)), "{error}");
        assert_eq!(read(&owner, 1).unwrap(), 1);
    });
}

#[test]
fn the_secret_is_on_the_loopback_alone() {
    on_loopback("sharing::the_secret_is_on_the_loopback_alone", |folder| {
        let _owner = open();
        assert_eq!((files(folder, "tcp").len(), files(folder, "sock").len()), (1, 0));
    });
}

/// Where a lock does not tell that a program is gone, nobody would carry out a will.
#[test]
fn a_will_is_left_where_somebody_would_carry_it_out() {
    in_each_way("sharing::a_will_is_left_where_somebody_would_carry_it_out", |_| {
        let (owner, guest) = (open(), open());
        let will = || LastWill::new(UnitAddress::new(1).unwrap(), vec![vec![vec![6, 0x20, 0, 0, 5]]]);
        for bus in [&owner, &guest] {
            let left = bus.leave_will(will());
            assert_eq!(left.is_some(), cfg!(unix));
            if let Some(number) = left {
                bus.withdraw_will(number);
            }
        }
    });
}

#[test]
fn who_waits_for_the_port_is_told_when_it_was_closed() {
    in_each_way("sharing::who_waits_for_the_port_is_told_when_it_was_closed", |_| {
        let (owner, guest) = (open(), open());
        let listening = Arc::clone(&guest);
        let (began, begins) = channel::<()>();
        let listener = thread::spawn(move || {
            let mut began = Some(began);
            let mut give_up = || {
                began.take();
                false
            };
            listening.listen(Duration::from_secs(3_600), &mut give_up, &mut |_, _| ())
        });
        assert!(begins.recv().is_err(), "it listens");
        owner.close();
        // It has the port now, and hears the line itself, until it is closed.
        assert_eq!(read(&open(), 1).unwrap(), 1);
        guest.close();
        assert!(listener.join().unwrap().is_err());
    });
}
