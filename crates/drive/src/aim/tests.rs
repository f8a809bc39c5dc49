use drivebus_drives::Place;
use drivebus_rtu::{ExceptionCode, Meaning, crc16};
use proptest::prelude::*;

use super::*;
use crate::same_unit::Identity;
use crate::scripted::{Fault, Reply, Script, UNIT, any_family, any_reply, fails, like, refuses, shipped};
use crate::task::Cause;

const STOP: What = What::Command(Command::Stop);

/// A place that an EDS300 is commanded at, and a Goodrive.
const COMMANDS: u16 = 0x2000;

struct Aimed {
    same: SameUnit,
    aim: Arc<Aim>,
    script: Script,
}

impl Aimed {
    fn of(family: &str) -> Self {
        Self::at(&shipped(family), false)
    }

    fn at(family: &Arc<Family>, is_trusted: bool) -> Self {
        let same = SameUnit::new(UNIT, family, &Identity::new(0), is_trusted);
        let aim = Arc::new(Aim::new(same.clone(), Families::shipped(), Instant::ZERO));
        Self { same, aim, script: Script::new() }
    }

    fn take(&mut self, command: Command, unit: impl FnMut(Read) -> Reply) -> Result<Option<Target>, NotTaken<Fault>> {
        let aim = Arc::clone(&self.aim);
        self.script.carry_out(unit, |line| async move { aim.take(&line, Families::shipped(), command).await })
    }

    fn stop(&mut self, unit: impl FnMut(Read) -> Reply) -> Option<(String, Command)> {
        let target = self.take(Command::Stop, unit).unwrap()?;
        Some((target.family.name().to_owned(), target.command))
    }

    fn check_harmless(&mut self, what: What, unit: impl FnMut(Read) -> Reply) -> Result<(), NotTaken<Fault>> {
        let same = self.same.clone();
        self.script.carry_out(unit, |line| async move { check_harmless(&line, Families::shipped(), &same, what).await })
    }

    fn at_once(&self, what: What) -> bool {
        goes_out_at_once(&self.same, Families::shipped(), what, self.script.connection)
    }
}

fn gd350(read: Read) -> Reply {
    like(&shipped("gd350"), &[(0x2103, 0x01A0), (0x2100, 3)])(read)
}

/// GD350 manual, chapter 9.4.5: 5 stops it. EDS300 manual, p. 46: 5 runs one.
#[test]
fn a_unit_is_asked_what_it_is_before_a_halt_that_may_start_it() {
    let mut aimed = Aimed::of("gd350");
    assert!(!aimed.at_once(STOP));
    assert_eq!(aimed.stop(gd350), Some(("gd350".to_owned(), Command::Stop)));
    assert_eq!(aimed.script.asked.first().map(|read| read.place), Some(Place::from(0x2103)));
    for read in &aimed.script.asked {
        let how = (read.is_urgent, read.timeout, read.retries, read.count);
        assert_eq!(how, (true, Some(Duration::from_millis(100)), Some(0), 1));
    }
    assert_eq!(aimed.aim.heard(), aimed.script.now);
    // It is asked no second time.
    assert!(aimed.at_once(STOP));
    aimed.stop(|_| panic!("it was identified"));
}

/// What shows another family is halted as that.
#[test]
fn a_unit_is_halted_as_what_it_shows() {
    let mut aimed = Aimed::of("eds300");
    assert_eq!(aimed.stop(gd350), Some(("gd350".to_owned(), Command::Stop)));
    assert!(!aimed.same.identity().is_sure(0));
}

/// 7000H is nothing but a VFD500's command.
#[test]
fn nothing_is_asked_before_what_harms_nobody() {
    let mut aimed = Aimed::of("vfd500");
    assert_eq!(aimed.stop(|_| panic!("no question")), Some(("vfd500".to_owned(), Command::Stop)));
    assert!(aimed.at_once(STOP));
}

#[test]
fn silence_is_no_evidence() {
    let mut aimed = Aimed::of("gd350");
    assert_eq!(aimed.stop(|_| fails(Cause::NoAnswer)), Some(("gd350".to_owned(), Command::Stop)));
    assert_eq!(aimed.script.asked.len(), 1);
    assert_eq!(aimed.aim.heard(), Instant::ZERO);
    // What was halted in doubt has to say what it is.
    assert!(aimed.aim.doubt(Families::shipped()));
    assert!(!aimed.aim.doubt(Families::shipped()));
    assert_eq!(aimed.stop(|_| fails(Cause::NoAnswer)), None);
    // One that spoke before was lost by the line.
    let mut aimed = Aimed::of("gd350");
    let mut answers = [Ok(0x0199), fails(Cause::NoAnswer)].into_iter();
    assert_eq!(aimed.stop(|_| answers.next().unwrap()), None);
    // Also one that is busy.
    let mut aimed = Aimed::of("gd350");
    assert_eq!(aimed.stop(|_| refuses(0x06)), None);
    assert_eq!(aimed.stop(|_| fails(Cause::NoAnswer)), None);
    // So was one that spoke against its name when it was asked last.
    let mut aimed = Aimed::of("gd350");
    aimed.same.identity().is_another();
    assert_eq!(aimed.stop(|_| fails(Cause::NoAnswer)), None);
}

#[test]
fn a_damaged_answer_may_be_of_the_unit_and_noise_is_not() {
    let damaged = |raw: &[u8]| Err(Fault { cause: Cause::BadAnswer, raw: raw.to_vec(), was_sent: true });
    let mut other = vec![9, 3, 2, 0, 7];
    other.extend(crc16(&other).to_le_bytes());
    for (raw, is_heard) in [(&[UNIT.get(), 3, 2][..], true), (&[0xFF, 0], false), (&other, false)] {
        let mut aimed = Aimed::of("gd350");
        assert_eq!(aimed.stop(|_| damaged(raw)).is_none(), is_heard, "{raw:02X?}");
        assert_eq!(aimed.aim.heard() == aimed.script.now, is_heard, "{raw:02X?}");
    }
}

#[test]
fn one_that_is_busy_did_not_say_yet() {
    let mut aimed = Aimed::of("gd350");
    assert_eq!(aimed.stop(|_| refuses(0x06)), None);
    assert_eq!(aimed.script.asked.len(), 1);
    let lost = aimed.take(Command::Stop, |_| fails(Cause::Port)).unwrap_err();
    assert!(matches!(lost, NotTaken::NotTold(NotTold::Failed(error)) if error.cause == Cause::Port));
}

/// By an exception that no documents list, and the specification neither, it is of none that lists them.
#[test]
fn one_that_fits_nothing_is_not_halted() {
    let mut aimed = Aimed::of("gd350");
    let error = aimed.take(Command::Stop, |_| refuses(0x63)).unwrap_err();
    let NotTaken::MayBe(others) = &error else { panic!("{error}") };
    assert!(others.iter().all(|family| family.name() != "gd350"));
    assert!(error.to_string().starts_with("by what the unit answers it may be "), "{error}");
}

#[test]
fn a_word_is_not_sent_to_one_that_it_would_harm() {
    let word = What::Word(COMMANDS.into());
    let mut aimed = Aimed::of("gd350");
    let eds300 = |read: Read| like(&shipped("eds300"), &[])(read);
    assert!(matches!(aimed.check_harmless(word, eds300), Err(NotTaken::MayBe(_))));
    assert!(aimed.script.asked.iter().all(|read| !read.is_urgent && read.timeout.is_none()));
    // One that shows its name is settled by that, and asked no more.
    aimed.check_harmless(word, gd350).unwrap();
    assert!(aimed.at_once(word) && aimed.at_once(STOP));
    aimed.check_harmless(word, |_| panic!("it is known")).unwrap();
    // Nor is one asked whose name is meant, but for a command.
    let mut trusted = Aimed::at(&shipped("gd350"), true);
    trusted.check_harmless(word, |_| panic!("it is trusted")).unwrap();
    assert!(!trusted.at_once(STOP));
}

#[test]
fn who_does_not_say_what_it_is_is_not_written_to() {
    let word = What::Word(COMMANDS.into());
    let mut aimed = Aimed::of("gd350");
    for cause in [Cause::NoAnswer, Cause::BadAnswer, Cause::Port, Cause::Other] {
        let error = aimed.check_harmless(word, |_| fails(cause)).unwrap_err();
        assert!(matches!(error, NotTaken::NotTold(NotTold::Failed(error)) if error.cause == cause));
    }
    let busy = aimed.check_harmless(word, |_| refuses(0x06)).unwrap_err();
    assert!(busy.to_string().contains("busy"), "{busy}");
    assert!(matches!(busy, NotTaken::NotTold(NotTold::Busy { times: 5, .. })));
    // By another maker's word for a decision it says no more.
    let later = || fails(Cause::Refused(ExceptionCode(6), Meaning::NotNow));
    assert!(matches!(aimed.check_harmless(word, |_| later()), Err(NotTaken::MayBe(none)) if none.is_empty()));
}

proptest! {
    /// Whatever comes, it ends, and what is halted is halted by a command that the family has.
    #[test]
    fn it_ends(
        family in any_family(),
        is_trusted: bool,
        replies in proptest::collection::vec(any_reply(), 1..60),
        calls in proptest::collection::vec((0u8..4, any::<u16>()), 1..6),
    ) {
        let mut replies = replies.iter().cycle();
        let mut aimed = Aimed::at(&family, is_trusted);
        for (call, address) in calls {
            let mut unit = |_: Read| replies.next().unwrap().clone();
            match call {
                0 => {
                    aimed.aim.doubt(Families::shipped());
                }
                1 => {
                    // Each is asked five times at most.
                    let _ = aimed.check_harmless(What::Word(address.into()), &mut unit);
                    prop_assert!(aimed.script.asked.len() <= 5 * QUESTIONS);
                }
                _ => {
                    if let Ok(Some(target)) = aimed.take(Command::Coast, &mut unit) {
                        let has = target.family.profile().commands().contains_key(&target.command);
                        prop_assert!(has || Arc::ptr_eq(&target.family, &family));
                    }
                    prop_assert!(aimed.script.asked.len() <= QUESTIONS);
                }
            }
        }
    }
}

/// Altivar 312 CANopen manual: 2135H is where it is commanded, and no other family's, so that its stop harms nobody.
#[test]
fn one_that_did_not_take_what_harms_nobody_has_to_say_what_it_is() {
    let mut aimed = Aimed::of("atv312");
    assert_eq!(aimed.stop(gd350), Some(("atv312".to_owned(), Command::Stop)));
    assert!(aimed.aim.doubt(Families::shipped()));
    assert_eq!(aimed.stop(gd350), Some(("gd350".to_owned(), Command::Stop)));
}

#[test]
fn what_was_answered_before_the_port_was_lost_says_nothing_of_who_is_there_now() {
    let mut aimed = Aimed::of("gd350");
    aimed.stop(gd350);
    let asked = aimed.script.places();
    let mut aimed = Aimed::of("gd350");
    let mut answers = [gd350(Read::word(UNIT, Place::from(0x2103))), fails(Cause::Port)].into_iter();
    aimed.take(Command::Stop, |_| answers.next().unwrap()).unwrap_err();
    aimed.script.connection = 1;
    aimed.stop(gd350);
    assert_eq!(aimed.script.places(), asked);
}

/// An Altivar 600 whose CHCF, at 8401, is as `chcf` says. EAV64332, V3.7: 3 is the I/O profile, in which bit 0 of CMD runs the motor.
fn atv600(chcf: Reply) -> impl FnMut(Read) -> Reply {
    let family = shipped("atv600");
    move |read| if read.place == Place::from(8401) { chcf.clone() } else { like(&family, &[(3201, 0x0233)])(read) }
}

fn words(target: Option<Target>) -> Vec<(Place, u16)> {
    target.unwrap().words().collect()
}

#[test]
fn which_words_a_unit_takes_is_asked_before_a_halt_and_not_again() {
    let mut aimed = Aimed::of("atv600");
    assert_eq!(words(aimed.take(Command::Stop, atv600(Ok(1))).unwrap()), [(8501.into(), 7)]);
    let last = aimed.script.asked.last().unwrap();
    assert_eq!((last.place, last.is_urgent, last.retries), (8401.into(), true, Some(0)));
    assert_eq!(words(aimed.take(Command::Stop, |_| panic!("it said so")).unwrap()), [(8501.into(), 7)]);
    // Behind a port that was opened again another one may answer.
    aimed.script.connection += 1;
    assert_eq!(words(aimed.take(Command::Stop, atv600(Ok(3))).unwrap()), [(8501.into(), 0)]);
}

#[test]
fn one_that_takes_others_is_halted_by_those_and_asked_each_time() {
    let mut aimed = Aimed::of("atv600");
    for command in [Command::Stop, Command::Coast] {
        let target = aimed.take(command, atv600(Ok(3))).unwrap();
        assert_eq!(words(target), [(8501.into(), 0)]);
    }
    assert!(!aimed.at_once(STOP));
    let error = aimed.take(Command::Stop, atv600(Ok(9))).unwrap_err();
    assert!(matches!(&error, NotTaken::SetOtherwise(found) if found.raw == 9 && found.means().is_empty()), "{error}");
    // It is put right.
    assert_eq!(words(aimed.take(Command::Stop, atv600(Ok(2))).unwrap()), [(8501.into(), 7)]);
}

/// As with what a unit is: silence and a refusal are no evidence, and one that is busy did not say yet.
#[test]
fn one_that_does_not_say_which_words_it_takes_is_halted_as_named() {
    let mut aimed = Aimed::of("atv600");
    assert!(aimed.take(Command::Stop, atv600(refuses(0x06))).unwrap().is_none());
    // It spoke before, so that the line lost this one.
    assert!(aimed.take(Command::Stop, atv600(fails(Cause::NoAnswer))).unwrap().is_none());
    assert_eq!(words(aimed.take(Command::Stop, atv600(refuses(0x02))).unwrap()), [(8501.into(), 7)]);
    // Nothing at all comes: one question tells that.
    let mut aimed = Aimed::of("atv600");
    assert_eq!(words(aimed.take(Command::Stop, |_| fails(Cause::NoAnswer)).unwrap()), [(8501.into(), 7)]);
    assert_eq!(aimed.script.asked.len(), 1);
}

#[test]
fn no_other_command_goes_to_one_that_takes_other_words() {
    for what in [What::Command(Command::ResetFault), What::Word(8501.into())] {
        let mut aimed = Aimed::of("atv600");
        let error = aimed.check_harmless(what, atv600(Ok(3))).unwrap_err();
        let said = "the command words of the unit mean something else: CHCF is 3 (the I/O profile: bits 0 and 1 run the motor), and \
                    must be 1 (the words are those of CiA 402, and commands come from where the setpoint does)";
        assert_eq!(error.to_string(), said);
        aimed.check_harmless(what, atv600(Ok(1))).unwrap();
        let asked = |aimed: &Aimed| aimed.script.asked.iter().filter(|read| read.place == Place::from(8401)).count();
        assert_eq!(asked(&aimed), 1);
        aimed.check_harmless(what, atv600(Ok(1))).unwrap();
        assert_eq!(asked(&aimed), 0, "it said so");
    }
    // A value is no command: it can be put right over the bus.
    Aimed::of("atv600").check_harmless(What::Word(8401.into()), atv600(Ok(3))).unwrap();
}

/// ACS355 manual, p. 313: it has no such profile at its register. By its name nobody would ask an ACS580.
#[test]
fn a_sister_with_the_same_words_counts_as_harmed_where_it_may_take_others() {
    let harmed = |named: &str, command| {
        let harmed = Families::shipped().harmed(What::Command(command), &shipped(named));
        harmed.iter().map(|family| family.name().to_owned()).collect::<Vec<_>>()
    };
    assert!(harmed("acs355", Command::Stop).contains(&"acs580".to_owned()));
    assert!(harmed("atv312", Command::Stop).contains(&"atv600".to_owned()));
    // 0 stops in each of its profiles.
    assert!(!harmed("atv312", Command::Coast).contains(&"atv600".to_owned()));
    assert!(!harmed("acs580", Command::Stop).contains(&"acs355".to_owned()));
}
