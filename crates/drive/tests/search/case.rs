//! What is called, of which drive, and how that stands; and one run of it, with faults where they were placed.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use drivebus_drive::task::{Mailbox, Step, Task, Wish};
use drivebus_drive::{
    Besides, Families, Halt, Identity, Looks, Order, Record, SameUnit, Speeds, Start, Taken, Unit, identify,
};
use drivebus_drives::Command;
use drivebus_rtu::UnitAddress;

use crate::drives::Drive;
use crate::judge::{Asks, Done, Judge};
use crate::models::Model;
use crate::world::{Failed, Fault, World};

const UNIT: UnitAddress = UnitAddress::by_name(1);

/// Most wishes of a call.
const MOST: usize = 1500;

/// What is called.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Call {
    Run { is_reverse: bool, hz: Option<f64> },
    Jog,
    Reset,
    Stop,
    Coast,
    Identify,
}

impl Call {
    pub(crate) const fn halts(self) -> bool {
        matches!(self, Self::Stop | Self::Coast)
    }

    pub(crate) const fn is_reverse(self) -> bool {
        matches!(self, Self::Run { is_reverse: true, .. })
    }
}

/// How the drive stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stands {
    AtRest,
    /// It turns forward.
    Turning,
    Tripped,
    /// The keypad commands it, and lets it turn where so.
    AtKeypad(bool),
}

/// A call, and of which drive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Case {
    pub(crate) call: Call,
    pub(crate) named: Model,
    /// Whether what no document prints is used.
    pub(crate) is_trusted: bool,
    /// What it is.
    pub(crate) behind: Model,
    /// What may be there when the port is opened again.
    pub(crate) other: Model,
    pub(crate) stands: Stands,
    /// Whether it was asked what it is before the call.
    pub(crate) is_asked_before: bool,
}

impl Case {
    pub(crate) fn new(named: Model, other: Model, call: Call) -> Self {
        let is_trusted = !matches!(named, Model::Gd350 | Model::Gd20 | Model::Atv312 | Model::Eds300);
        Self { call, named, is_trusted, behind: named, other, stands: Stands::AtRest, is_asked_before: false }
    }

    /// Whether the states of its family may be used.
    pub(crate) fn tells(&self) -> bool {
        self.named != Model::Gd20
    }

    fn drive(&self, model: Model) -> Drive {
        let mut drive = Drive::new(model);
        match self.stands {
            Stands::AtRest => {}
            Stands::Turning => drive = drive.turning(),
            Stands::Tripped => drive.trip(),
            Stands::AtKeypad(turns) => {
                let at = drive.at_keypad();
                drive = if turns { at.turning() } else { at };
            }
        }
        drive
    }

    fn task(&self) -> Task<Done, Failed> {
        let families = Families::shipped();
        if self.call == Call::Identify {
            return Task::new(async move |line| Done::Identified(identify(&line, families, UNIT).await.ok()));
        }
        let family = families.named(self.named.name()).unwrap();
        let profile = family.profile();
        let same = SameUnit::new(UNIT, family, &Identity::new(0), false);
        let (looks, speeds) = (Looks::new(profile, self.is_trusted), Speeds::new(profile, self.is_trusted));
        let taken = Taken::as_named(same.clone(), &Arc::new(looks), &Arc::new(speeds));
        let (record, confirm, call) = (Record::default(), Duration::from_millis(100), self.call);
        let is_asked_before = self.is_asked_before;
        Task::new(async move |line: Mailbox<Failed>| {
            if is_asked_before {
                let _ = same.check(&line, families, true, false).await;
            }
            let start = match call {
                Call::Run { is_reverse, hz } => Start::run(is_reverse, hz),
                Call::Jog => Start::jog(false),
                Call::Reset => {
                    let unit = Unit::new(taken, &record);
                    return Done::Commanded(unit.reset_fault(&line, families, confirm).await);
                }
                _ => {
                    let command = if call == Call::Stop { Command::Stop } else { Command::Coast };
                    let order =
                        Order { command, besides: Besides::Nothing, within: Duration::from_millis(150), confirm };
                    let mut halt = Halt::new(taken, &record, order, families, line.now());
                    return Done::Halted(halt.carry_out(&line, families).await);
                }
            };
            let mut start = start;
            start.confirm = confirm;
            Done::Commanded(Unit::new(taken, &record).start(&line, families, &start).await)
        })
    }

    /// One run, with `faults` at the wishes of these numbers.
    pub(crate) fn run(&self, asks: &Arc<Asks>, faults: &[(usize, Fault)], mut trace: Option<&mut Vec<String>>) -> Run {
        let other = (self.other != self.behind).then(|| self.drive(self.other));
        let mut world = World::new(self.drive(self.behind), other, Judge::new(*self, asks));
        let mut task = self.task();
        let (mut outcome, mut wishes, mut here) = (None, Vec::new(), Vec::new());
        let done = loop {
            let wish = match task.step(world.seen(), outcome).unwrap() {
                Step::Done(done) => break Some(done),
                Step::Wish(wish) => wish,
            };
            let number = wishes.len();
            if number == MOST {
                break None;
            }
            here.clear();
            here.extend(faults.iter().filter(|(at, _)| *at == number).map(|(_, fault)| *fault));
            let came = world.outcome_of(&wish, task.taken_for().map(|(_, family)| family), &here);
            if let Some(trace) = &mut trace {
                trace.push(format!("{number} {wish} {here:?} -> {came:?}"));
            }
            outcome = Some(came);
            wishes.push(wish);
        };
        match &done {
            Some(done) => world.judge.ended(done, &world.drive, world.halts),
            None => world.judge.wrong = Some(format!("7: it has {MOST} wishes, and goes on")),
        }
        if let Some(trace) = trace {
            trace.push(match &done {
                Some(Done::Halted(Err(error))) => error.to_string(),
                Some(Done::Commanded(Err(error))) => error.to_string(),
                done => format!("{done:?}"),
            });
        }
        Run { wishes, wrong: world.judge.wrong }
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:?} of {:?} ({:?}), which is {:?}, trusted {}",
            self.call, self.named, self.stands, self.behind, self.is_trusted
        )
    }
}

/// What a run came to.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) wishes: Vec<Wish>,
    pub(crate) wrong: Option<String>,
}
