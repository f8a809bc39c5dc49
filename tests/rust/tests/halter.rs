//! Who knows families halts a unit for a program that is gone: what it is told, and from whom the unit is kept meanwhile.
//! What the families know, `tests/python/test_last_will.py` has, with programs of their own.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fmt;
use std::path::Path;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use drivebus_line::url::{Known, PortOptions, PortUrl};
use drivebus_line::{
    AdapterEcho, Bus, BusOptions, CallError, CallOptions, Failure, HaltLine, Halted, Halter, LastWill, Named,
};
use drivebus_rtu::{Request, SerialFormat, UnitAddress};
use drivebus_sim::{Options, Simulator};

/// What is done while it halts.
type Does = Box<dyn FnMut(&mut dyn HaltLine) -> Halted + Send>;

/// Tells what it was to halt, and within which time.
struct Fake {
    told: Mutex<Sender<(u8, Named, Duration)>>,
    does: Mutex<Does>,
}

impl fmt::Debug for Fake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Fake")
    }
}

impl Halter for Fake {
    fn halt(&self, unit: UnitAddress, named: &Named, within: Duration, line: &mut dyn HaltLine) -> Halted {
        self.told.lock().unwrap().send((unit.get(), named.clone(), within)).unwrap();
        (self.does.lock().unwrap())(line)
    }
}

fn halter(
    does: impl FnMut(&mut dyn HaltLine) -> Halted + Send + 'static,
) -> (&'static dyn Halter, Receiver<(u8, Named, Duration)>) {
    let (told, hears) = channel();
    (Box::leak(Box::new(Fake { told: Mutex::new(told), does: Mutex::new(Box::new(does)) })), hears)
}

fn open(path: &Path, halter: Option<&'static dyn Halter>) -> Bus {
    let port = PortUrl::parse(path.to_str().unwrap(), &Known::default()).unwrap();
    let key = port.key();
    let options = BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent).timeout(Duration::from_secs(5));
    let opener = port.opener(&PortOptions::new(options.format)).unwrap();
    Bus::open_shared(opener, key, options.halter(halter), &mut || false).unwrap()
}

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn read(bus: &Bus, to: u8, within: Duration) -> Result<(), Box<CallError>> {
    let options = CallOptions::new().timeout(within).retries(0);
    bus.call(unit(to).into(), &Request::read(0x2100, 1).unwrap(), options, &mut || false, &mut |_| ()).map(drop)
}

/// What halts a GD350: its stop.
fn will() -> LastWill {
    let named = Named::new("gd350", vec!["stop".to_owned()]).unverified(true);
    LastWill::new(unit(1), vec![vec![vec![0x06, 0x20, 0x00, 0x00, 0x05]]]).named(named)
}

const LONG: Duration = Duration::from_secs(20);

#[test]
fn who_knows_families_halts_the_unit_and_others_are_kept_from_it_until_it_took_that() {
    let simulator = Simulator::new([(1, "gd350"), (2, "gd350")], Options::default().realtime(true)).unwrap();
    let served = simulator.serve_pty().unwrap();
    let ((asked, asks), (go_on, goes_on), (looked, looks)) = (channel(), channel(), channel());
    let (knows, hears) = halter(move |line| {
        assert!(!line.is_closed());
        let request = Request::read(0x2103, 1).unwrap();
        asked.send(line.ask(&request, CallOptions::new(), &mut |_| ())).unwrap();
        goes_on.recv().unwrap();
        line.took();
        looks.recv().unwrap();
        Halted::Took("It stands".to_owned())
    });
    let owner = open(&served.path(), Some(knows));
    let guest = open(&served.path(), None);
    guest.leave_will(will()).unwrap();
    guest.close();

    let (halted, named, within) = hears.recv_timeout(LONG).unwrap();
    assert_eq!((halted, &named), (1, will().named.as_ref().unwrap()));
    assert!(within <= Duration::from_secs(10) && within > Duration::ZERO);
    asks.recv_timeout(LONG).unwrap().unwrap();
    let kept = read(&owner, 1, Duration::from_millis(20)).unwrap_err();
    assert!(matches!(kept.failure, Failure::BeingStopped { unit: 1, .. }), "{kept}");
    read(&owner, 2, Duration::from_secs(5)).unwrap();

    go_on.send(()).unwrap();
    // It waits for that.
    read(&owner, 1, Duration::from_secs(5)).unwrap();
    let [note] = &owner.wills()[..] else { panic!("{:?}", owner.wills()) };
    assert!(note.starts_with("unit 1 was told to halt, and took it: ") && note.ends_with(", which ran it, is gone"));
    looked.send(()).unwrap();
    let at_last = format!("{note}. It stands");
    while owner.wills() != [at_last.clone()] {
        std::thread::yield_now();
    }
    assert!(simulator.drive(1).unwrap().writes().is_empty(), "nothing but what was asked for went out");
}

#[test]
fn of_a_family_that_is_not_known_it_is_halted_frame_by_frame() {
    let simulator = Simulator::new([(1, "gd350")], Options::default().realtime(true)).unwrap();
    let served = simulator.serve_pty().unwrap();
    let (knows, hears) = halter(|_| Halted::Unknown);
    let owner = open(&served.path(), Some(knows));
    let guest = open(&served.path(), None);
    guest.leave_will(will()).unwrap();
    guest.close();
    hears.recv_timeout(LONG).unwrap();
    while owner.wills().is_empty() {
        std::thread::yield_now();
    }
    let written: Vec<_> =
        simulator.drive(1).unwrap().writes().iter().map(|write| (write.address, write.value)).collect();
    assert_eq!(written, [(0x2000, 5)]);
}

#[test]
fn another_unit_at_the_address_is_left_alone() {
    let simulator = Simulator::new([(1, "gd350")], Options::default().realtime(true)).unwrap();
    let served = simulator.serve_pty().unwrap();
    let (knows, _hears) = halter(|_| Halted::Another);
    let owner = open(&served.path(), Some(knows));
    let guest = open(&served.path(), None);
    guest.leave_will(will()).unwrap();
    guest.close();
    while owner.wills().is_empty() {
        std::thread::yield_now();
    }
    assert!(owner.wills()[0].ends_with("and another drive answers at its address now"), "{:?}", owner.wills());
    read(&owner, 1, Duration::from_secs(5)).unwrap();
    assert!(simulator.drive(1).unwrap().writes().is_empty());
}
