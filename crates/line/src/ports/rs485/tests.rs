//! What is asked of a driver, and what it makes of that.

use std::cell::RefCell;

use super::*;

/// A driver on paper: what it makes of what it is asked, and what RTS was told.
struct Driver {
    make: fn(Taken) -> Option<Taken>,
    mode: RefCell<Option<Taken>>,
    rts: RefCell<Vec<bool>>,
    has: (bool, bool),
}

impl Driver {
    fn new(has_mode: bool, has_rts: bool, make: fn(Taken) -> Option<Taken>) -> Self {
        Self { make, mode: RefCell::default(), rts: RefCell::default(), has: (has_mode, has_rts) }
    }
}

impl Transceiver for Driver {
    fn ask(&self, wanted: Option<Taken>) -> io::Result<()> {
        if !self.has.0 {
            return Err(io::Error::other("no such mode"));
        }
        *self.mode.borrow_mut() = wanted.and_then(self.make);
        Ok(())
    }

    fn taken(&self) -> io::Result<Option<Taken>> {
        if self.has.0 { Ok(*self.mode.borrow()) } else { Err(io::Error::other("no such mode")) }
    }

    fn set_rts(&self, high: bool) -> io::Result<()> {
        if !self.has.1 {
            return Err(io::Error::other("no such line"));
        }
        self.rts.borrow_mut().push(high);
        Ok(())
    }
}

const ASKED: Rs485 =
    Rs485 { enabled: true, switch: Switch::Driver, rts_on_send: true, delay_before_ms: 2, delay_after_ms: 3 };

#[test]
fn a_driver_that_does_as_asked_leaves_nothing_to_say() {
    let driver = Driver::new(true, true, Some);
    let in_force = ASKED.apply(&driver, "port").unwrap();
    assert_eq!(in_force.driver_before, Duration::from_millis(2));
    assert_eq!((in_force.by_program, in_force.note), (None, None));
    assert!(driver.rts.borrow().is_empty(), "RTS is the driver's");
}

#[test]
fn what_the_driver_made_of_the_delays_counts() {
    let driver = Driver::new(true, true, |asked| Some(Taken { before_ms: 1, after_ms: 0, ..asked }));
    let in_force = ASKED.apply(&driver, "port").unwrap();
    assert_eq!(in_force.driver_before, Duration::from_millis(1));
    let note = in_force.note.unwrap();
    assert!(note.contains("1 ms before and 0 ms after") && note.contains("asked for were 2 and 3 ms"), "{note}");
}

#[test]
fn a_wrong_level_is_no_half_success() {
    let driver = Driver::new(true, true, |asked| Some(Taken { rts_on_send: false, ..asked }));
    let error = ASKED.apply(&driver, "port").unwrap_err();
    assert_eq!(error.kind, PortErrorKind::Unsupported);
    assert_eq!(*driver.mode.borrow(), None, "the driver is not left holding the line");
    // A driver that takes the request and does nothing.
    let driver = Driver::new(true, true, |_| None);
    assert!(ASKED.apply(&driver, "port").is_err());
}

#[test]
fn without_the_mode_this_program_may_take_over() {
    let driver = Driver::new(false, true, Some);
    let error = ASKED.apply(&driver, "port").unwrap_err().to_string();
    assert!(error.contains("no such mode") && error.contains("mode \"rts\""), "{error}");

    let either = Rs485 { switch: Switch::Either, delay_after_ms: 0, ..ASKED };
    let in_force = either.apply(&driver, "port").unwrap();
    assert_eq!(*driver.rts.borrow(), [false], "the line is let go first");
    let by_program = in_force.by_program.unwrap();
    assert_eq!((by_program.before, by_program.after), (Duration::from_millis(2), Duration::from_millis(1)));
    assert!(in_force.note.unwrap().contains("no such mode"));

    let low = Rs485 { switch: Switch::Program, rts_on_send: false, ..ASKED };
    let in_force = low.apply(&driver, "port").unwrap();
    assert_eq!(*driver.rts.borrow(), [false, true]);
    assert_eq!((in_force.by_program.unwrap().after, in_force.note), (Duration::from_millis(3), None));
}

#[test]
fn a_port_without_rts_is_refused() {
    let driver = Driver::new(false, false, Some);
    for switch in [Switch::Program, Switch::Either] {
        let error = Rs485 { switch, ..ASKED }.apply(&driver, "port").unwrap_err();
        assert_eq!(error.kind, PortErrorKind::Unsupported);
        assert!(error.to_string().contains("RTS cannot be moved (no such line)"), "{error}");
    }
}

#[test]
fn turned_off_is_off_with_or_without_the_mode() {
    let off = Rs485 { enabled: false, ..ASKED };
    for has_mode in [true, false] {
        assert_eq!(off.apply(&Driver::new(has_mode, true, Some), "port").unwrap(), InForce::default());
    }
}

#[test]
fn a_mode_that_nobody_here_asked_for_is_left_and_counted() {
    let driver = Driver::new(true, true, Some);
    assert_eq!(found(&driver), InForce::default());
    driver.ask(Some(Taken { rts_on_send: true, before_ms: 4, after_ms: 1 })).unwrap();
    let in_force = found(&driver);
    assert_eq!(in_force.driver_before, Duration::from_millis(4));
    assert!(in_force.note.unwrap().contains("4 ms before and 1 ms after"));
    assert!(driver.mode.borrow().is_some());
    assert_eq!(found(&Driver::new(false, true, Some)), InForce::default());
}

/// A wire that takes a millisecond for a byte, and a diary.
#[derive(Default)]
struct Paper {
    now: Instant,
    diary: Vec<(u64, String)>,
    breaks: bool,
}

impl Paper {
    fn note(&mut self, what: String) {
        let millis = self.now.saturating_duration_since(Instant::ZERO).as_millis();
        self.diary.push((u64::try_from(millis).unwrap(), what));
    }
}

impl Wire for Paper {
    fn now(&self) -> Instant {
        self.now
    }

    fn sleep_until(&mut self, until: Instant) {
        self.now = self.now.max(until);
    }

    fn set_rts(&mut self, high: bool) -> io::Result<()> {
        self.note(format!("rts {high}"));
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<Instant> {
        self.note(format!("write {}", bytes.len()));
        if self.breaks {
            return Err(io::Error::other("unplugged"));
        }
        Ok(self.now + Duration::from_millis(u64::try_from(bytes.len()).unwrap()))
    }
}

#[test]
fn rts_rises_before_the_first_bit_and_falls_after_the_last() {
    let (before, after) = (Duration::from_millis(2), Duration::from_millis(3));
    for rts_on_send in [true, false] {
        let mut wire = Paper::default();
        let end = ByProgram { rts_on_send, before, after }.send(&mut wire, &[0; 8]).unwrap();
        assert_eq!(end, Instant::ZERO + Duration::from_millis(10));
        let expected =
            [(0, format!("rts {rts_on_send}")), (2, "write 8".to_owned()), (13, format!("rts {}", !rts_on_send))];
        assert_eq!(wire.diary, expected);
    }
}

#[test]
fn a_write_that_fails_lets_go_of_the_line() {
    let mut wire = Paper { breaks: true, ..Paper::default() };
    let by_program = ByProgram { rts_on_send: true, before: Duration::ZERO, after: Duration::from_millis(3) };
    assert!(by_program.send(&mut wire, &[0; 8]).is_err());
    assert_eq!(wire.diary.last().unwrap(), &(0, "rts false".to_owned()));
}
