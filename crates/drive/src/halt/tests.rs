use std::collections::VecDeque;

use drivebus_drives::{Entry, Place, State};
use proptest::prelude::*;

use super::*;
use crate::family::Family;
use crate::look::Looks;
use crate::same_unit::{Identity, SameUnit};
use crate::scripted::{
    Fault, Reply, Script, UNIT, Unit, any_confirmation, any_family, any_reply, fails, like, refuses, shipped, zeros_but,
};
use crate::speed::Speeds;
use crate::task::Read;

/// Where a Goodrive takes its commands, and where it tells its state, how it is told to run, and its frequencies.
const COMMANDS: u16 = 0x2000;
const STATE: u16 = 0x2100;
const CHANNEL: u16 = 0x2101;
const CODE: u16 = 0x2103;
const FREQUENCY: u16 = 0x3000;
const SETPOINT: u16 = 0x3001;

/// A GD350 whose motor runs at 50 Hz, and whose ramp is set to 5 Hz in a second.
struct Motor {
    family: Arc<Family>,
    /// What becomes of the first writes; each other one is confirmed.
    confirms: VecDeque<Result<(), Fault>>,
    /// What becomes of every write behind those.
    always: Result<(), Fault>,
    /// In Hz a second, once it was told to stop; zero does not obey.
    slope: f64,
    told: Option<Instant>,
}

impl Motor {
    fn new(slope: f64) -> Self {
        Self { family: shipped("gd350"), confirms: VecDeque::new(), always: Ok(()), slope, told: None }
    }

    fn hz(&self, now: Instant) -> f64 {
        let since = self.told.map_or(Duration::ZERO, |told| now.saturating_duration_since(told));
        (50.0 - self.slope * since.as_secs_f64()).max(0.0)
    }

    /// The word of its status by which the bus alone commands it.
    fn by_bus(&self) -> u16 {
        let words = self.family.profile().status_words();
        let field = words.flat_map(Entry::bits).find(|field| field.name() == "control_channel").unwrap();
        (0..=u16::MAX).find(|&raw| field.meaning(raw) == "communication").unwrap()
    }
}

impl Unit for Motor {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        let hz = self.hz(now);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 5000")]
        let counts = (hz * 100.0).round() as u16;
        let settings = [(0x0001, 2), (0x0002, 0), (0x0006, 8), (0x0003, 5000), (0x000C, 100)];
        let shown = [
            (STATE, if hz > 0.0 { 1 } else { 3 }),
            (CHANNEL, self.by_bus()),
            (CODE, 0x01A0),
            (FREQUENCY, counts),
            (SETPOINT, 5000),
        ];
        like(&self.family, &[&settings[..], &shown[..]].concat())(read)
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        let came = self.confirms.pop_front().unwrap_or_else(|| self.always.clone());
        if came.is_ok() && write.place == Place::from(COMMANDS) {
            self.told.get_or_insert(now);
        }
        came
    }
}

/// One halt, and what is kept of it.
struct Halted {
    script: Script,
    record: Record,
    done: Result<(), NotHalted<Fault>>,
}

pub(super) fn order(command: Command) -> Order {
    Order { command, besides: Besides::Nothing, within: Duration::from_secs(2), confirm: Duration::from_secs(1) }
}

fn halt(family: &Arc<Family>, order: Order, unit: impl Unit) -> Halted {
    halt_over(Script::new(), family, order, unit)
}

fn halt_over(mut script: Script, family: &Arc<Family>, order: Order, unit: impl Unit) -> Halted {
    let record = Record::default();
    let mut halt = of(family, order, &record);
    let done = script.carry_out(unit, |line| async move { halt.carry_out(&line, Families::shipped()).await });
    Halted { script, record, done }
}

pub(super) fn of(family: &Arc<Family>, order: Order, record: &Record) -> Halt<Fault> {
    let same = SameUnit::new(UNIT, family, &Identity::new(0), false);
    let profile = family.profile();
    let unit = Taken::as_named(same, &Arc::new(Looks::new(profile, true)), &Arc::new(Speeds::new(profile, true)));
    Halt::new(unit, record, order, Families::shipped(), Instant::ZERO)
}

fn gd350(order: Order, motor: Motor) -> Halted {
    halt(&shipped("gd350"), order, motor)
}

impl Halted {
    /// The words that were written, in their order.
    fn words(&self) -> Vec<u16> {
        let word = |(_, write): &(Instant, Write)| match &write.payload {
            Payload::Word(word) => *word,
            Payload::Words(words) => words[0],
        };
        self.script.sent.iter().map(word).collect()
    }

    fn why(self) -> Why<Fault> {
        self.done.unwrap_err().why
    }
}

/// GD350 operation manual, section 9.4.5: 5 stops it, 6 lets it coast.
#[test]
fn a_unit_that_takes_it_at_once_and_stands_is_halted() {
    let halted = gd350(order(Command::Coast), Motor::new(1000.0));
    assert!(halted.done.is_ok());
    assert_eq!(halted.words(), [6]);
    let (_, write) = &halted.script.sent[0];
    assert_eq!((write.is_urgent, write.is_forced, write.timeout), (true, false, Some(ANSWER_WITHIN)));
    let sent = halted.record.sent();
    assert_eq!((sent.halts_begun, sent.halts), (1, 1));
    assert!(halted.script.told.contains(&Notice::Took(Command::Coast)));
    assert!(matches!(halted.script.told.last(), Some(Notice::Saw(look)) if look.state == State::Stopped));
}

#[test]
fn a_halt_that_is_lost_or_put_off_is_sent_again() {
    // 06H: busy, by the specification.
    for fault in [fails(Cause::NoAnswer), refuses(0x06)] {
        let mut motor = Motor::new(1000.0);
        motor.confirms = [fault.clone(), fault].into();
        let halted = gd350(order(Command::Stop), motor);
        assert!(halted.done.is_ok());
        assert_eq!(halted.words(), [5, 5, 5]);
        let moments: Vec<_> = halted.script.sent.iter().map(|(at, _)| *at).collect();
        assert!(moments.windows(2).all(|pair| pair[1].saturating_duration_since(pair[0]) >= PAUSE));
    }
}

/// A drive that says by 05H that it is at it, by the specification, and shows nothing, is told once more.
#[test]
fn what_is_only_acknowledged_has_to_show() {
    let family = shipped("sunfar-e300");
    let acknowledged = |obeys| halt(&family, order(Command::Stop), Acknowledges::new(&family, obeys));
    let obeys = acknowledged(true);
    assert!(obeys.done.is_ok());
    assert_eq!(obeys.words().len(), 1);
    let ignores = acknowledged(false);
    assert_eq!(ignores.words().len(), 2);
    assert!(matches!(ignores.why(), Why::Unshown(LastLook::Seen { .. })));
}

/// It runs, and says of each write that it is at it.
pub(super) struct Acknowledges {
    family: Arc<Family>,
    obeys: bool,
    was_told: bool,
}

impl Acknowledges {
    pub(super) fn new(family: &Arc<Family>, obeys: bool) -> Self {
        Self { family: Arc::clone(family), obeys, was_told: false }
    }
}

impl Unit for Acknowledges {
    fn read(&mut self, read: Read, _: Instant) -> Reply {
        let profile = self.family.profile();
        let shows = if self.obeys && self.was_told { State::Stopped } else { State::Forward };
        let word = (0..=u16::MAX).find(|&raw| profile.state(raw) == shows && !profile.is_in_fault(raw)).unwrap();
        let place = profile.role("state").and_then(Entry::place).unwrap();
        if read.place == place { Ok(word) } else { like(&self.family, &[])(read) }
    }

    fn write(&mut self, _: &Write, _: Instant) -> Result<(), Fault> {
        self.was_told = true;
        refuses(0x05)
    }
}

#[test]
fn a_silent_unit_is_told_for_as_long_as_was_said_and_no_oftener() {
    let mut motor = Motor::new(0.0);
    motor.always = fails(Cause::NoAnswer);
    let halted = gd350(Order { besides: Besides::Coast, ..order(Command::Stop) }, motor);
    let most = order(Command::Stop).within.as_millis() / PAUSE.as_millis() + 1;
    assert!((2..=most).contains(&(halted.script.sent.len() as u128)));
    // Each fourth frame is a coast.
    assert_eq!(halted.words()[..9], [5, 5, 5, 6, 5, 5, 5, 6, 5]);
    let error = halted.done.unwrap_err();
    assert!(error.was_sent);
    let Why::Unanswered { tries, after: After::Seen(look), .. } = error.why else { panic!("{error}") };
    assert_eq!(tries.told.len(), halted.script.sent.len());
    assert_eq!(look.state, State::Forward);
}

#[test]
fn two_commands_take_turns_until_one_is_taken() {
    let mut motor = Motor::new(1000.0);
    motor.confirms = [refuses(0x03), refuses(0x03), refuses(0x03), Ok(())].into();
    let halted = gd350(Order { besides: Besides::InTurns(Command::Stop), ..order(Command::Coast) }, motor);
    assert_eq!(halted.words(), [6, 5, 6, 5]);
    halted.done.unwrap();
}

#[test]
fn a_port_that_is_lost_is_told_apart_from_a_halt_that_went_out() {
    let mut motor = Motor::new(0.0);
    motor.always = Err(Fault { cause: Cause::Port, raw: Vec::new(), was_sent: false });
    let script = Script { is_closed: true, ..Script::new() };
    let halted = halt_over(script, &shipped("gd350"), order(Command::Stop), motor);
    // The line was closed for good: there is nothing to wait for.
    assert_eq!(halted.script.sent.len(), 1);
    assert_eq!(halted.record.sent().halts, 0);
    let error = halted.done.unwrap_err();
    assert!(!error.was_sent);
    assert!(matches!(error.why, Why::NotSent(_)), "{error}");
}

/// EDS300 manual, p. 46: 5 runs one, which stops a GD350.
#[test]
fn a_unit_that_shows_another_family_is_halted_as_that() {
    let halted = halt(&shipped("eds300"), order(Command::Stop), Motor::new(1000.0));
    assert!(halted.done.is_ok());
    assert_eq!(halted.words(), [5]);
    // The line knows it by its name.
    assert!(halted.script.sent.iter().all(|(_, write)| write.is_forced));
}

#[test]
fn a_state_that_never_shows_it_is_no_proof() {
    let halted = gd350(order(Command::Stop), Motor::new(0.0));
    assert_eq!(halted.words(), [5]);
    let error = halted.done.unwrap_err();
    assert!(error.was_sent);
    assert!(
        matches!(error.why, Why::Unshown(LastLook::Seen { ref look, .. }) if look.state == State::Forward),
        "{error}"
    );
}

/// It is set to lose 5 Hz in a second.
#[test]
fn a_fall_along_its_ramp_proves_a_stop_and_no_other_one_does() {
    let along = gd350(order(Command::Stop), Motor::new(5.0));
    assert!(along.done.is_ok());
    assert!(matches!(along.script.told.last(), Some(Notice::Saw(look)) if look.state == State::Forward));
    assert!(along.script.now < Instant::ZERO + Duration::from_secs(1));
    // Off the ramp, and what coasts has none: looked at until it stands.
    for (command, slope) in [(Command::Stop, 8.0), (Command::Coast, 5.0)] {
        let off = gd350(order(command), Motor::new(slope));
        assert!(off.done.is_ok());
        assert!(matches!(off.script.told.last(), Some(Notice::Saw(look)) if look.state == State::Stopped));
        assert!(off.script.now > Instant::ZERO + Duration::from_secs(6));
    }
}

/// An MS300 that takes its stop; when its state is asked for, the port was opened again and leads to `there`.
struct Exchanged {
    here: Arc<Family>,
    there: Motor,
    is_told: bool,
    is_there: bool,
}

impl Unit for Exchanged {
    fn read(&mut self, read: Read, now: Instant) -> Reply {
        let state = self.here.profile().role("state").and_then(Entry::place);
        self.is_there |= self.is_told && Some(read.place) == state;
        if self.is_there { self.there.read(read, now) } else { like(&self.here, &[])(read) }
    }

    fn write(&mut self, write: &Write, now: Instant) -> Result<(), Fault> {
        if write.connection != Some(self.reopened()) {
            return Err(Fault { cause: Cause::Port, raw: Vec::new(), was_sent: false });
        }
        self.is_told = true;
        if self.is_there { self.there.write(write, now) } else { Ok(()) }
    }

    fn reopened(&self) -> u64 {
        self.is_there.into()
    }
}

/// 2101H is the state of an MS300; a GD350 that runs has 0 there, by which an MS300 stands.
#[test]
fn what_shows_a_halt_behind_a_port_that_was_opened_again_says_what_it_is() {
    let here = shipped("ms300");
    let unit = Exchanged { here: Arc::clone(&here), there: Motor::new(1000.0), is_told: false, is_there: false };
    let halted = halt(&here, order(Command::Stop), unit);
    assert!(halted.done.is_ok(), "{:?}", halted.done);
    assert_eq!(halted.words().last(), Some(&5), "it stops as a GD350");
}

/// What turns the other way than it was started may be on its way through zero.
#[test]
fn a_fall_of_what_was_started_otherwise_proves_nothing() {
    let record = Record::default();
    record.note(|sent| sent.started_as = Some(State::Reverse));
    let mut halt = of(&shipped("gd350"), order(Command::Stop), &record);
    let mut script = Script::new();
    let operation = |line| async move { halt.carry_out(&line, Families::shipped()).await };
    assert!(script.carry_out(Motor::new(5.0), operation).is_ok());
    assert!(script.now > Instant::ZERO + Duration::from_secs(9));
}

#[test]
fn nothing_is_sent_where_it_may_start_the_motor() {
    // One that has zeros everywhere fits no family.
    let halted = halt(&shipped("eds300"), order(Command::Stop), Mute(zeros_but(&[])));
    let error = halted.done.unwrap_err();
    assert!(halted.script.sent.is_empty() && !error.was_sent);
    assert!(matches!(error.why, Why::Undecided { wanted: Command::Stop, .. }), "{error}");
    // One that is always busy never says what it is, and is asked for two seconds.
    let halted =
        halt(&shipped("eds300"), Order { within: Duration::ZERO, ..order(Command::Stop) }, Mute(|_| refuses(6)));
    assert!(halted.script.sent.is_empty());
    assert!(halted.script.now >= Instant::ZERO + TO_SAY);
    assert!(matches!(halted.why(), Why::Unsaid));
}

/// It answers reads, and nobody may write to it.
struct Mute<F>(F);

impl<F: FnMut(Read) -> Reply> Unit for Mute<F> {
    fn read(&mut self, read: Read, _: Instant) -> Reply {
        self.0(read)
    }

    fn write(&mut self, write: &Write, _: Instant) -> Result<(), Fault> {
        panic!("{write} was not to be sent")
    }
}

/// A unit that answers whatever comes next, from the first again behind the last.
pub(super) struct Whatever {
    replies: Vec<Reply>,
    confirms: Vec<Result<(), Fault>>,
    asked: usize,
    sent: usize,
}

impl Whatever {
    pub(super) fn new(replies: Vec<Reply>, confirms: Vec<Result<(), Fault>>) -> Self {
        Self { replies, confirms, asked: 0, sent: 0 }
    }
}

impl Unit for Whatever {
    fn read(&mut self, _: Read, _: Instant) -> Reply {
        self.asked += 1;
        self.replies[self.asked % self.replies.len()].clone()
    }

    fn write(&mut self, _: &Write, _: Instant) -> Result<(), Fault> {
        self.sent += 1;
        self.confirms[self.sent % self.confirms.len()].clone()
    }
}

/// It is at it, as it says, and no line knows how that request went out; what else it says is any of `replies`.
fn at_it(family: &str, within: u64, replies: Vec<Reply>) -> Halted {
    let acknowledged = refuses(0x05).map_err(|fault: Fault| Fault { was_sent: false, ..fault });
    let (confirm, within) = (Duration::from_millis(300), Duration::from_millis(within));
    let unit = Whatever::new(replies, vec![acknowledged]);
    halt(&shipped(family), Order { within, confirm, ..order(Command::Stop) }, unit)
}

#[test]
fn what_is_acknowledged_went_out() {
    let halted = at_it("chf100a", 0, vec![fails(Cause::NoAnswer), Ok(1), Ok(0)]);
    assert!(!halted.script.sent.is_empty());
    assert!(halted.done.unwrap_err().was_sent);
}

/// An EDS300 whose first answer is lost, and that is busy then; EDS300 manual, p. 46: 6 stops it.
#[test]
fn one_that_is_busy_has_not_said_what_it_is() {
    struct Busy(Arc<Family>, usize);

    impl Unit for Busy {
        fn read(&mut self, read: Read, _: Instant) -> Reply {
            self.1 += 1;
            match self.1 {
                1 => fails(Cause::NoAnswer),
                2 => refuses(0x06),
                _ => like(&self.0, &[(0x2100, 1)])(read),
            }
        }

        fn write(&mut self, _: &Write, _: Instant) -> Result<(), Fault> {
            Ok(())
        }
    }

    let halted = halt(&shipped("gd20"), order(Command::Stop), Busy(shipped("eds300"), 0));
    assert_eq!(halted.words(), [5, 6]);
}

#[test]
fn what_is_refused_each_time_was_not_taken() {
    let unit = Whatever::new(vec![Ok(1)], vec![refuses(0x04)]);
    let halted = halt(&shipped("gd350"), Order { within: Duration::from_millis(300), ..order(Command::Stop) }, unit);
    assert!(halted.script.sent.len() > 1);
    let error = halted.done.unwrap_err();
    assert!(matches!(error.why, Why::Refused { .. }) && !error.was_sent, "{error}");
}

#[test]
fn what_speaks_against_its_name_without_end_is_not_told_without_end() {
    let mut replies = vec![fails(Cause::NoAnswer), refuses(0x0C)];
    replies.extend([257, 1, 1, 3].map(Ok));
    assert!(at_it("md500", 361, replies).done.unwrap_err().was_sent);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever comes, it ends, what it says of what was sent is so, and what was seen to run last is not proved to stop.
    #[test]
    fn no_answers_prove_a_stop_of_what_runs(
        family in any_family(),
        replies in proptest::collection::vec(any_reply(), 1..12),
        confirms in proptest::collection::vec(any_confirmation(), 1..6),
        command in proptest::sample::select(vec![Command::Stop, Command::Coast, Command::JogStop]),
        within in 0u64..1500,
        besides in proptest::sample::select(vec![Besides::Nothing, Besides::Coast, Besides::InTurns(Command::Coast)]),
        is_closed: bool,
    ) {
        let confirm = Duration::from_millis(300);
        let order = Order { command, besides, within: Duration::from_millis(within), confirm };
        let script = Script { is_closed, ..Script::new() };
        let may_act = |fault: &Fault| fault.was_sent() && !fault.cause().is_refusal();
        let went_out = confirms.iter().all(|each| each.as_ref().map_or_else(may_act, |()| true));
        let unit = Whatever::new(replies, confirms);
        let halted = halt_over(script, &family, order, unit);
        let seen = halted.script.told.iter().rev().find_map(|notice| match notice {
            Notice::Saw(look) => Some(look.state),
            Notice::Took(_)
            | Notice::TookOther { .. }
            | Notice::Shows(_)
            | Notice::Starts(_)
            | Notice::Stored { .. } => None,
        });
        let sent = halted.record.sent();
        prop_assert!(sent.halts <= sent.halts_begun && sent.halts_begun <= halted.script.sent.len() as u64);
        match halted.done {
            Ok(()) => prop_assert!(sent.halts > 0 && !seen.is_some_and(State::is_running)),
            Err(error) => {
                prop_assert!(!error.was_sent || sent.halts > 0);
                prop_assert!(!went_out || error.was_sent != halted.script.sent.is_empty());
            }
        }
    }
}
