use std::sync::Arc;
use std::time::Duration;

use drivebus_drives::{Command, Place};
use drivebus_rtu::{ExceptionCode, Instant, Meaning};

use crate::families::Families;
use crate::family::Family;
use crate::halt::{Besides, Halt, NotHalted, Order};
use crate::look::Looks;
use crate::record::Record;
use crate::same_unit::{Identity, SameUnit};
use crate::scripted::{Fault, Reply, Script, UNIT, Unit, fails, like, shipped};
use crate::speed::Speeds;
use crate::taken::Taken;
use crate::task::{Cause, Payload, Read, Write};

/// RG-SDMOD (Lenze AC Tech), pp. 6 and 10: 69 at register 19 is a smd, 0 at register 48 unlocks it, and one that is locked refuses by 01.
const FAMILY: (u16, u16) = (19, 69);
const STOP: (u16, u16) = (1, 4);
const UNLOCK: (u16, u16) = (48, 0);

/// A drive that is locked, at rest.
struct Smd {
    family: Arc<Family>,
    /// What it says of its family.
    code: u16,
    is_locked: bool,
    /// Whether its refusals come to nothing.
    is_unheard: bool,
    /// Whether it refuses to be unlocked.
    is_obstinate: bool,
}

impl Smd {
    fn new() -> Self {
        let (_, code) = FAMILY;
        Self { family: shipped("smd"), code, is_locked: true, is_unheard: false, is_obstinate: false }
    }

    fn refuses(&self) -> Result<(), Fault> {
        if self.is_unheard {
            return fails(Cause::NoAnswer);
        }
        fails(Cause::Refused(ExceptionCode(1), Meaning::NotNow))
    }
}

impl Unit for Smd {
    fn read(&mut self, read: Read, _: Instant) -> Reply {
        like(&self.family, &[(FAMILY.0, self.code), (26, 3), (50, 507)])(read)
    }

    fn write(&mut self, write: &Write, _: Instant) -> Result<(), Fault> {
        let unlocks = write.place == Place::from(UNLOCK.0);
        if unlocks && !self.is_obstinate {
            self.is_locked = false;
        }
        if self.is_locked { self.refuses() } else { Ok(()) }
    }
}

/// Where words were to go, and which.
type Sent = Vec<(u16, u16)>;

fn halted(unit: Smd) -> (Sent, Result<(), NotHalted<Fault>>) {
    let family = shipped("smd");
    let same = SameUnit::new(UNIT, &family, &Identity::new(0), false);
    let profile = family.profile();
    let unit_as = Taken::as_named(same, &Arc::new(Looks::new(profile, true)), &Arc::new(Speeds::new(profile, true)));
    let order = Order {
        command: Command::Stop,
        besides: Besides::Nothing,
        within: Duration::from_millis(300),
        confirm: Duration::from_secs(1),
    };
    let mut script = Script::new();
    let mut halt = Halt::new(unit_as, &Record::default(), order, Families::shipped(), Instant::ZERO);
    let done = script.carry_out(unit, |line| async move { halt.carry_out(&line, Families::shipped()).await });
    let word = |payload: &Payload| match payload {
        Payload::Word(word) => *word,
        Payload::Words(words) => words[0],
    };
    (script.sent.iter().map(|(_, write)| (write.place.address, word(&write.payload))).collect(), done)
}

#[test]
fn a_halt_that_is_refused_as_locked_goes_out_again_behind_what_unlocks() {
    let (sent, done) = halted(Smd::new());
    done.unwrap();
    assert_eq!(sent, [STOP, UNLOCK, STOP]);
}

#[test]
fn a_drive_that_is_not_locked_gets_the_halt_alone() {
    let (sent, done) = halted(Smd { is_locked: false, ..Smd::new() });
    done.unwrap();
    assert_eq!(sent, [STOP]);
}

#[test]
fn where_its_refusal_is_lost_it_is_unlocked_before_the_next_halt() {
    let (sent, done) = halted(Smd { is_unheard: true, ..Smd::new() });
    done.unwrap();
    assert_eq!(sent, [STOP, UNLOCK, STOP]);
}

/// 72 is an SMV, which has another password; what another maker's drive has at 0030H, nobody knows.
#[test]
fn a_unit_that_shows_another_word_is_never_unlocked() {
    for code in [0, 72, 507] {
        for is_unheard in [false, true] {
            let (sent, done) = halted(Smd { code, is_unheard, ..Smd::new() });
            assert!(done.is_err(), "{code}");
            assert!(!sent.is_empty() && sent.iter().all(|&word| word == STOP), "{code}: {sent:?}");
        }
    }
}

#[test]
fn a_halt_that_cannot_be_unlocked_is_told_as_refused_and_as_not_taken() {
    let (sent, done) = halted(Smd { is_obstinate: true, ..Smd::new() });
    let not_halted = done.unwrap_err();
    assert!(!not_halted.was_sent, "{not_halted:?}");
    assert!(sent.contains(&UNLOCK) && sent.last().is_some_and(|&word| word == STOP || word == UNLOCK), "{sent:?}");
}

#[test]
fn no_other_exception_unlocks() {
    let smd = shipped("smd");
    let key = |code, meaning| super::key_after(smd.profile(), Cause::Refused(ExceptionCode(code), meaning));
    assert!(key(1, Meaning::NotNow).is_some());
    assert_eq!(key(6, Meaning::AskAgain), None);
    assert_eq!(super::key_after(smd.profile(), Cause::NoAnswer), None);
    assert_eq!(super::key_after(shipped("gd350").profile(), Cause::Refused(ExceptionCode(1), Meaning::NoSuch)), None);
}
