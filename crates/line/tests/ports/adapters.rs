//! An adapter that was unplugged is found again as the same one, whatever its name is now, and no other is taken for it.

use std::fs;
use std::path::Path;

use drivebus_line::PortError;
use drivebus_line::tty::{Adapter, Tty, TtyOptions};

use super::machine::{FTDI, Machine, Usb, point};
use super::pty::pair;
use super::*;

/// What kind of trouble it is, and that the message says all of `parts`.
fn refused(adapter: &mut Adapter, parts: &[&str]) {
    let error: PortError = adapter.open().unwrap_err();
    assert_eq!(error.kind, PortErrorKind::NotFound, "{error}");
    for part in parts {
        assert!(error.to_string().contains(part), "{part:?} is not in: {error}");
    }
}

#[test]
fn by_its_link_under_another_name() {
    let machine = Machine::new();
    let ((first_far, first), (_far, second)) = (pair(), pair());
    machine.link("usb-FTDI_A50285BI-if00-port0", &first);
    let mut adapter = machine.adapter(&first);
    assert_eq!(adapter.open().unwrap().name(), first);
    assert_eq!(adapter.open().unwrap().name(), first, "it is still there");

    drop(first_far);
    refused(&mut adapter, &[&first, "not plugged in", "usb-FTDI_A50285BI-if00-port0"]);
    machine.unlink("usb-FTDI_A50285BI-if00-port0");
    refused(&mut adapter, &[&first, "not plugged in", "usb-FTDI_A50285BI-if00-port0"]);
    machine.link("usb-another-one", &second);
    refused(&mut adapter, &["not plugged in"]);

    machine.unlink("usb-another-one");
    machine.link("usb-FTDI_A50285BI-if00-port0", &second);
    assert_eq!(adapter.open().unwrap().name(), second);
}

#[test]
fn by_what_it_says_of_itself_where_there_is_no_link() {
    let machine = Machine::new();
    let ((_far, first), (_second_far, second), (_third_far, third)) = (pair(), pair(), pair());
    machine.plug("ttyUSB0", &first, FTDI);
    machine.plug("ttyUSB1", &second, Usb { serial: Some("B7"), socket: "1-1.3", ..FTDI });
    let mut adapter = machine.adapter(&first);
    adapter.open().unwrap();

    machine.unplug("ttyUSB0");
    refused(&mut adapter, &["not plugged in", "USB 0403:6001, serial number A50285BI, interface 00"]);
    machine.plug("ttyUSB7", &third, Usb { socket: "1-1.4", ..FTDI });
    assert_eq!(adapter.open().unwrap().name(), third, "in another socket, by its serial number");
}

#[test]
fn its_own_link_as_the_name_stays_the_name() {
    let machine = Machine::new();
    let ((_far, first), (_second_far, second)) = (pair(), pair());
    machine.plug("ttyUSB0", &first, FTDI);
    machine.link("usb-FTDI", &first);
    let name = machine.places().by_id.join("usb-FTDI");
    let mut adapter = machine.adapter(&name);
    adapter.open().unwrap();
    machine.unplug("ttyUSB0");
    machine.plug("ttyUSB1", &second, FTDI);
    // The link is not made yet: the adapter is there all the same.
    machine.unlink("usb-FTDI");
    assert_eq!(adapter.open().unwrap().name(), second);
    machine.link("usb-FTDI", &second);
    assert_eq!(adapter.open().unwrap().name(), name.to_str().unwrap());
}

#[test]
fn another_adapter_that_has_its_name_now_is_left_alone() {
    let machine = Machine::new();
    let ((_far, first), (_second_far, second)) = (pair(), pair());
    let name = machine.path("ttyUSB0");
    point(&name, &first);
    machine.plug("ttyUSB0", &first, FTDI);
    let mut adapter = machine.adapter(&name);
    adapter.open().unwrap();

    machine.unplug("ttyUSB0");
    machine.plug("ttyUSB0", &second, Usb { serial: Some("B7"), ..FTDI });
    point(&name, &second);
    refused(&mut adapter, &["another adapter now", "expected", "A50285BI", "found", "serial number B7"]);
    // Who has no identity is another one too: this may be anybody's terminal.
    machine.unplug("ttyUSB0");
    refused(&mut adapter, &["not plugged in", "A50285BI"]);

    // Neither was locked, nor kept.
    machine.adapter(&second).open().unwrap();
}

#[test]
fn where_nothing_is_known_the_name_counts() {
    let machine = Machine::new();
    let ((first_far, first), (_second_far, second)) = (pair(), pair());
    let name = machine.path("bus");
    point(&name, &first);
    let mut adapter = machine.adapter(&name);
    adapter.open().unwrap();
    drop(first_far);
    fs::remove_file(&name).unwrap();
    refused(&mut adapter, &["there is no such port"]);
    point(&name, &second);
    let mut line = adapter.open().unwrap();
    assert_eq!(line.name(), name.to_str().unwrap());
    line.send(&REQUEST).unwrap();
}

#[test]
fn without_a_serial_number_only_the_socket_tells() {
    let machine = Machine::new();
    let ((_far, first), (_second_far, second), (_third_far, third)) = (pair(), pair(), pair());
    let nameless = Usb { serial: None, ..FTDI };
    machine.plug("ttyUSB0", &first, nameless);
    machine.plug("ttyUSB1", &second, Usb { socket: "1-1.3", ..nameless });
    machine.link("usb-1a86_USB_Serial-if00-port0", &first);
    let mut adapter = machine.adapter(&first);
    adapter.open().unwrap();

    // Its link goes to the other one, as udev leads it when the first is gone.
    machine.unplug("ttyUSB0");
    machine.link("usb-1a86_USB_Serial-if00-port0", &second);
    refused(&mut adapter, &["not plugged in", "no serial number", "USB socket 1-1.2"]);
    machine.plug("ttyUSB0", &third, nameless);
    assert_eq!(adapter.open().unwrap().name(), third);
}

#[test]
fn a_serial_number_that_two_have_is_none() {
    let machine = Machine::new();
    let ((_far, first), (_second_far, second)) = (pair(), pair());
    let same = Usb { serial: Some("0001"), ..FTDI };
    machine.plug("ttyUSB0", &first, same);
    machine.plug("ttyUSB1", &second, Usb { socket: "1-1.3", ..same });
    let mut adapter = machine.adapter(&first);
    adapter.open().unwrap();
    machine.unplug("ttyUSB0");
    refused(&mut adapter, &["not plugged in", "0001"]);
    machine.plug("ttyUSB0", &first, same);
    assert_eq!(adapter.open().unwrap().name(), first);
}

#[test]
fn of_two_that_came_instead_neither_is_taken() {
    let machine = Machine::new();
    let ((_far, first), (_second_far, second), (_third_far, third)) = (pair(), pair(), pair());
    machine.plug("ttyUSB0", &first, FTDI);
    let mut adapter = machine.adapter(&first);
    adapter.open().unwrap();
    machine.unplug("ttyUSB0");
    machine.plug("ttyUSB1", &second, Usb { socket: "1-1.3", ..FTDI });
    machine.plug("ttyUSB2", &third, Usb { socket: "1-1.4", ..FTDI });
    refused(&mut adapter, &[&second, &third, "only one"]);
    machine.unplug("ttyUSB1");
    assert_eq!(adapter.open().unwrap().name(), third);
}

#[test]
fn the_ports_of_one_adapter_are_told_apart() {
    for other in [Usb { interface: "01", ..FTDI }, Usb { port: "1", ..FTDI }] {
        let machine = Machine::new();
        let ((_far, first), (_second_far, second)) = (pair(), pair());
        let (_new_first_far, new_first) = pair();
        machine.plug("ttyUSB0", &first, FTDI);
        machine.plug("ttyUSB1", &second, other);
        let mut adapter = machine.adapter(&first);
        adapter.open().unwrap();
        machine.unplug("ttyUSB0");
        refused(&mut adapter, &["not plugged in"]);
        machine.plug("ttyUSB2", &new_first, FTDI);
        assert_eq!(adapter.open().unwrap().name(), new_first);
    }
}

#[test]
fn what_is_no_port_is_no_adapter() {
    let machine = Machine::new();
    let mut adapter = machine.adapter("/dev/ttyNoSuchPort");
    refused(&mut adapter, &["there is no such port"]);
    let (_far, path) = pair();
    machine.link("usb-broken", "/nowhere");
    fs::write(machine.places().by_id.join("usb-a-file"), "").unwrap();
    fs::create_dir(machine.places().tty_class.join("ttyEmpty")).unwrap();
    let mut adapter = machine.adapter(&path);
    adapter.open().unwrap();
    adapter.open().unwrap();
}

#[test]
fn its_latency_timer_is_short_while_it_is_open() {
    let machine = Machine::new();
    let (_far, port) = pair();
    machine.plug("ttyUSB0", &port, FTDI);
    let timer = machine.latency_timer("ttyUSB0");
    let shown = || fs::read_to_string(&timer).unwrap().trim().to_owned();
    fs::write(&timer, "16\n").unwrap();

    let line = machine.adapter(&port).open().unwrap();
    assert_eq!((shown().as_str(), line.latency()), ("1", Duration::from_millis(1)));
    assert_eq!(line.char_time(), None, "it hands over lumps");
    assert!(line.notes()[0].contains("it was 16 ms"), "{:?}", line.notes());
    drop(line);
    assert_eq!(shown(), "16");

    let options = TtyOptions::default().low_latency(false);
    let line = Tty::open_within(&port, &format(Parity::None), &options, &machine.places()).unwrap();
    assert_eq!((shown().as_str(), line.notes().len()), ("16", 0));
    drop(line);

    fs::remove_file(&timer).unwrap();
    let line = machine.adapter(&port).open().unwrap();
    assert_eq!((line.latency(), line.notes().len()), (Duration::ZERO, 0));
    assert!(line.char_time().is_some());
}

#[test]
fn the_system_tells_of_a_port_without_opening_it() {
    let machine = Machine::new();
    let (_far, port) = pair();
    machine.plug("ttyUSB0", &port, FTDI);
    fs::write(machine.latency_timer("ttyUSB0"), "16\n").unwrap();
    let driver = machine.path("ftdi_sio");
    fs::create_dir(&driver).unwrap();
    point(&machine.latency_timer("ttyUSB0").with_file_name("driver"), driver);

    let facts = machine.places().facts(Path::new(&port));
    assert_eq!((facts.driver.as_deref(), facts.latency_timer_ms), (Some("ftdi_sio"), Some(16)));
    assert!(facts.adapter.unwrap().contains("serial number A50285BI"));
    assert!(facts.latency_rule.unwrap().contains("latency_timer"));
    assert!(facts.holders.is_empty());

    let _line = machine.adapter(&port).open().unwrap();
    let facts = machine.places().facts(Path::new(&port));
    assert_eq!((facts.latency_timer_ms, facts.latency_rule), (Some(1), None));
    assert_eq!(facts.holders.len(), 1);
}
