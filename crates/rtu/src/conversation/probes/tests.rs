//! What is sent to a unit in quarantine, attempt by attempt, as the unit makes itself known: on paper, without a line.

use std::collections::BTreeSet;
use std::vec::Vec;

use super::*;
use crate::{Duration, FreshWords, SerialFormat};

const UNIT: UnitAddress = UnitAddress::MIN;

/// A unit that left reads of these lengths open, and what is known of it.
struct Doubt {
    master: Master,
    probing: Probing,
    tried: Tried,
}

/// A read of so many words from an address.
const fn other_read(address: u16, count: u16) -> Probe {
    Probe::OtherRead { address, count }
}

const ECHO: Probe = Probe::Echo;

/// Whether a unit refused the echo that it answered.
const RETURNED: bool = false;
const REFUSED: bool = true;

impl Doubt {
    fn about(counts: impl IntoIterator<Item = u16>) -> Self {
        let mut master = Master::new(&SerialFormat::DEFAULT);
        for count in counts {
            let open = Request::read(7, count).unwrap();
            master.still_owed(Instant::ZERO, UNIT, &open, Duration::ZERO);
        }
        Self { master, probing: Probing::default(), tried: Tried::default() }
    }

    /// One that answered a read of register 7 before.
    fn about_one_that_lives() -> Self {
        let mut doubt = Self::about([1]);
        doubt.probing.answered(&Request::read(7, 1).unwrap(), false);
        doubt
    }

    fn echoed(mut self, refused: bool) -> Self {
        self.probing.answered(&Request::echo(1), refused);
        self
    }

    /// The next attempt of a call begins.
    fn again(&mut self) -> &mut Self {
        self.tried = Tried::default();
        self
    }

    /// What goes out before `request`, of which nothing comes.
    fn before(&mut self, request: &Request<'_>, in_time: bool) -> Option<Probe> {
        let probe = self.probing.probe(&self.master, Instant::ZERO, UNIT, request, &self.tried, in_time)?;
        self.tried.note(probe);
        if probe == Probe::Echo {
            self.probing.silent_on_echo();
        }
        Some(probe)
    }

    /// All that goes out in one attempt before a read of register 100, while the unit is silent.
    fn attempt(&mut self) -> Vec<Probe> {
        self.attempt_before(&Request::read(100, 1).unwrap(), true)
    }

    fn attempt_before(&mut self, request: &Request<'_>, in_time: bool) -> Vec<Probe> {
        self.again();
        // More than one attempt ever sends.
        (0..10).map_while(|_| self.before(request, in_time)).collect()
    }
}

#[test]
fn no_word_comes_twice_before_all_have_come() {
    let fresh = FreshWords::beginning_at(0x3A17);
    let words: BTreeSet<u16> = (0..=u16::MAX).map(|_| fresh.next()).collect();
    assert_eq!(words.len(), 65_536);
}

#[test]
fn only_the_word_that_was_given_out_last_is_the_latest() {
    let fresh = FreshWords::beginning_at(0x3A17);
    let words = [fresh.next(), fresh.next()];
    assert_eq!(words.map(|word| fresh.is_latest(word)), [false, true]);
    let all = (0..=u16::MAX).filter(|&word| fresh.is_latest(word)).count();
    assert_eq!(all, 1);
}

#[test]
fn an_echo_is_known_to_have_gone_out() {
    let mut tried = Tried::default();
    tried.note(Probe::OtherRead { address: 7, count: 2 });
    assert!(!tried.has_echoed());
    tried.note(Probe::Echo);
    assert!(tried.has_echoed());
    tried.note(Probe::Echo);
    assert!(tried.has_echoed());
}

/// Where silence is all that is known, an attempt costs one time-out before the question: an echo, then a read, in turn.
#[test]
fn a_unit_that_never_answered_is_sent_one_probe_an_attempt() {
    let mut doubt = Doubt::about([1]);
    assert_eq!(doubt.attempt(), [ECHO]);
    assert_eq!(doubt.attempt(), [other_read(100, 2)], "from where the caller reads");
    assert_eq!(doubt.attempt(), [ECHO]);
    assert_eq!(doubt.attempt(), [other_read(100, 2)]);
    // Two reads are what the doubt is worth.
    assert_eq!(doubt.attempt(), [ECHO]);
    assert_eq!(doubt.attempt(), [ECHO]);
    doubt.probing.is_sure();
    assert_eq!(doubt.attempt(), [other_read(100, 2)]);
}

/// No register of it is known, and a write names none that may be read.
#[test]
fn a_unit_that_never_answered_is_sent_no_read_before_a_write() {
    let mut doubt = Doubt::about([1]);
    for _ in 0..4 {
        assert_eq!(doubt.attempt_before(&Request::write(100, 5), true), [ECHO]);
    }
}

/// An echo that came back damaged was no silence.
#[test]
fn a_unit_that_was_not_silent_on_an_echo_is_echoed_again() {
    let mut doubt = Doubt::about([1]);
    for _ in 0..3 {
        doubt.again();
        let probe = doubt.probing.probe(
            &doubt.master,
            Instant::ZERO,
            UNIT,
            &Request::read(100, 1).unwrap(),
            &doubt.tried,
            true,
        );
        assert_eq!(probe, Some(ECHO));
    }
}

#[test]
fn a_unit_that_returns_echoes_is_echoed_twice_an_attempt_and_once_when_time_is_over() {
    let mut doubt = Doubt::about_one_that_lives().echoed(RETURNED);
    assert!(!doubt.probing.knows_no_echo() && !doubt.probing.refuses_echoes());
    assert_eq!(doubt.attempt(), [ECHO, ECHO]);
    doubt = doubt.echoed(RETURNED);
    assert_eq!(doubt.attempt_before(&Request::write(100, 5), true), [ECHO, ECHO]);
    assert_eq!(doubt.attempt_before(&Request::read(100, 1).unwrap(), false), [ECHO]);
}

/// Another unit may have its address after five silences in a row.
#[test]
fn a_unit_that_returned_echoes_is_asked_a_read_after_five_silences() {
    let mut doubt = Doubt::about_one_that_lives().echoed(RETURNED);
    for _ in 0..4 {
        doubt.probing.silent_on_echo();
    }
    doubt = doubt.echoed(RETURNED);
    for _ in 0..4 {
        assert!(!doubt.probing.knows_no_echo(), "four in a row are not enough");
        doubt.probing.silent_on_echo();
    }
    assert!(!doubt.probing.knows_no_echo());
    doubt.probing.silent_on_echo();
    assert!(doubt.probing.knows_no_echo());
    assert_eq!(doubt.attempt(), [other_read(7, 2), ECHO]);
    assert!(!doubt.echoed(RETURNED).probing.knows_no_echo());
}

/// Units that know no echo are ordinary: one silence, and a read comes first.
#[test]
fn a_unit_that_lives_and_never_returned_an_echo_is_asked_a_read() {
    let mut doubt = Doubt::about_one_that_lives();
    assert!(!doubt.probing.knows_no_echo());
    assert_eq!(doubt.attempt(), [ECHO, other_read(7, 2)], "the register that is known to be readable");
    assert!(doubt.probing.knows_no_echo() && !doubt.probing.refuses_echoes());
    assert_eq!(doubt.attempt(), [other_read(7, 2), ECHO]);
    assert_eq!(doubt.attempt(), [ECHO], "two reads are what a doubt is worth");
    doubt.probing.is_sure();
    assert_eq!(doubt.attempt_before(&Request::write(100, 5), true), [other_read(7, 2), ECHO]);
}

/// It answers an echo, by a refusal, and may have caught up by that; what it says of one it says of each.
#[test]
fn a_unit_that_refuses_echoes_is_echoed_once_and_then_asked_a_read() {
    let mut doubt = Doubt::about_one_that_lives().echoed(REFUSED);
    assert!(doubt.probing.knows_no_echo() && doubt.probing.refuses_echoes());
    assert_eq!(doubt.attempt(), [ECHO, other_read(7, 2)]);
    assert_eq!(doubt.attempt(), [ECHO, other_read(7, 2)]);
    assert_eq!(doubt.attempt(), [ECHO]);
    let doubt = doubt.echoed(RETURNED);
    assert!(!doubt.probing.knows_no_echo() && !doubt.probing.refuses_echoes());
}

#[test]
fn what_is_not_known_is_not_said() {
    let probing = Probing::default();
    assert!(!probing.knows_no_echo() && !probing.refuses_echoes());
}

/// The shortest that no open answer could pass for, 16 words at the most, from a register that is known to be there.
#[test]
fn the_other_read_has_a_length_that_no_open_answer_has() {
    let silent = |counts: std::ops::RangeInclusive<u16>| {
        let mut doubt = Doubt::about(counts);
        doubt.probing.silent_on_echo();
        doubt
    };
    let lives = |doubt: &mut Doubt, request: &Request<'_>, refused| doubt.probing.answered(request, refused);

    let mut doubt = silent(1..=3);
    lives(&mut doubt, &Request::write(200, 1), false);
    assert_eq!(doubt.attempt(), [other_read(100, 4), ECHO], "no register of it is known");
    let mut doubt = silent(1..=3);
    lives(&mut doubt, &Request::write(200, 1), false);
    assert_eq!(doubt.attempt_before(&Request::write(300, 1), true), [ECHO]);
    let mut doubt = silent(1..=3);
    lives(&mut doubt, &Request::read(50, 1).unwrap(), true);
    assert_eq!(doubt.attempt(), [other_read(100, 4), ECHO], "what was refused is not readable");
    let mut doubt = silent(15..=15);
    lives(&mut doubt, &Request::read(50, 1).unwrap(), false);
    assert_eq!(doubt.attempt(), [other_read(50, 16), ECHO]);
    let mut doubt = silent(16..=16);
    lives(&mut doubt, &Request::read(50, 1).unwrap(), false);
    assert_eq!(doubt.attempt(), [ECHO], "no unit known here gives more");
}

/// A unit that was busy, or got an echo damaged, may know echoes all the same; one that says so each time is taken at its word.
#[test]
fn an_echo_that_a_unit_could_not_take_does_not_tell_that_it_knows_none() {
    let echo = Request::echo(7);
    let mut probing = Probing::default();
    for _ in 1..BUSY_FOR_GOOD {
        probing.was_busy(&echo);
        assert!(!probing.knows_no_echo() && !probing.refuses_echoes());
    }
    probing.answered(&echo, false);
    for refuses in [false, false, true] {
        probing.was_busy(&echo);
        assert_eq!(probing.refuses_echoes(), refuses);
    }
    probing.answered(&echo, false);
    assert!(!probing.refuses_echoes(), "it has returned one since");
}
