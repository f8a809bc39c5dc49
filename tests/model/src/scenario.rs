//! The lines that are assumed, and how far each is searched.

use drivebus_rtu::Duration;

use crate::before::{NOTHING, OTHER_LENGTHS};
use crate::frames::{Content, Kind};
use crate::search::Action;

/// What a unit makes of an echo (08H).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Echoing {
    /// It sends it back.
    Returns,
    /// It refuses it.
    Refuses,
    /// It is silent.
    Silent,
}

/// What the adapter makes of what it is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Adapter {
    /// It is known not to send it back.
    Known,
    /// It does not send it back, which has to be found out.
    Silent,
    /// It sends it back, which has to be found out.
    Echoes,
}

/// What may become of an answer that arrives damaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Damage {
    /// It does not come again, and the master does not wait for it.
    Final,
    /// It does not come again. The master learns from it, and waits no time for it.
    Learned,
    /// It may come again within a second. The master learns from it, and waits no time for it.
    Again,
}

/// How often each thing may happen: with these used up a run is over. The search goes through every order of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Budget {
    /// Requests that the program sends.
    pub requests: u8,
    /// Answers that are damaged, cut or brought twice, and ports that are lost while a request goes out.
    pub faults: u8,
    /// Requests that a unit refuses.
    pub refusals: u8,
    /// Reads that a unit answers with another number of words than was asked for.
    pub lengths: u8,
    /// Calls given up at any time: what is on the wire then, before its time.
    pub aborts: u8,
    /// Calls given up between two of their requests.
    pub quits: u8,
    /// Times that the port is opened again.
    pub openings: u8,
    /// Times that a unit forgets what it was asked.
    pub restarts: u8,
    /// Times that the registers change.
    pub changes: u8,
    /// Times that an answer may come in the middle of the time-out, and not at once.
    pub lingers: u8,
    /// Times that each call may ask its question once more, after silence.
    pub retries: u8,
}

impl Budget {
    /// The counter of this name.
    pub fn named(&mut self, name: &str) -> Option<&mut u8> {
        Some(match name {
            "requests" => &mut self.requests,
            "faults" => &mut self.faults,
            "refusals" => &mut self.refusals,
            "lengths" => &mut self.lengths,
            "aborts" => &mut self.aborts,
            "quits" => &mut self.quits,
            "openings" => &mut self.openings,
            "restarts" => &mut self.restarts,
            "changes" => &mut self.changes,
            "lingers" => &mut self.lingers,
            "retries" => &mut self.retries,
            _ => return None,
        })
    }

    /// Requests of calls that ask once more, and nothing that goes wrong but time.
    pub const fn requests(requests: u8) -> Self {
        Self {
            requests,
            faults: 0,
            refusals: 0,
            lengths: 0,
            aborts: 0,
            quits: 0,
            openings: 0,
            restarts: 0,
            changes: 0,
            lingers: 0,
            retries: 1,
        }
    }
}

/// What has to be seen in a search, or it has searched nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Sight {
    /// One answer was enough for a read.
    ReadAtOnce,
    /// A read was repeated until its answers agreed.
    Agreed,
    /// A command was confirmed.
    Commanded,
    /// A write was seen where it can be read back.
    ReadBack,
    /// A stop was confirmed.
    Stopped,
    /// A refusal was believed.
    Refused,
    /// An answer was told to be late.
    Late,
    /// An echo ended a doubt.
    EndedByEcho,
    /// The refusal of an echo ended a doubt.
    EndedByRefusal,
    /// A read of another length ended a doubt.
    EndedByRead,
    /// Waiting ended a doubt.
    EndedByTime,
    /// A late answer ended a doubt, because nothing else was open.
    EndedBySight,
    /// The adapter was found to send requests back.
    AdapterFound,
    /// An answer of another length than was asked for was told as wrong.
    OtherLength,
    /// A read was answered in two parts.
    InTwo,
}

/// A line, what happens on it, and how far it is searched.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// By which it is asked for.
    pub name: &'static str,
    /// What is special about it.
    pub about: &'static str,
    /// The units, one or two.
    pub units: &'static [Echoing],
    /// Whether answers may overtake each other.
    pub overtaking: bool,
    /// The adapter.
    pub adapter: Adapter,
    /// What another program may be answered that asked before the line was opened. Empty: no other program was there.
    pub strangers: &'static [&'static [Content]],
    /// What a unit that restarts makes of an echo from then on; `None`: what it made before.
    pub replaced_by: Option<Echoing>,
    /// Whether the program asks only what the master says can be told.
    pub heeds: bool,
    /// What may become of an answer that arrives damaged.
    pub damage: Damage,
    /// What came before, in one way or another. None of it is open any more when the search begins.
    pub before: &'static [&'static [Action]],
    /// What the program asks.
    pub kinds: &'static [Kind],
    /// The most words that a unit gives at once; more it refuses.
    pub longest: u16,
    /// How long an answer is waited for.
    pub timeout: Duration,
    /// How far `make test` searches.
    pub small: Budget,
    /// How far `make model` searches.
    pub deep: Budget,
    /// What has to be seen in both.
    pub sights: &'static [Sight],
}

impl Scenario {
    /// How long after it was given up an answer may still come, if `echoed`: the unit has returned an echo. `None`: for ever.
    pub const fn may_come_for(&self, echoed: bool) -> Option<Duration> {
        if echoed && !self.overtaking { None } else { Some(PATIENCE) }
    }
}

// What is assumed and promised, in numbers of its own: those of the code shall not be judged by themselves.

/// How long after the line was opened the answer to another program's question may come.
pub const STRANGERS_COME_FOR: Duration = Duration::from_secs(1);

/// How long after it was given up an answer may come, and how long a doubt lasts while nothing is asked.
pub const PATIENCE: Duration = Duration::from_secs(3);

/// How long after the last request was given up a doubt may last, whatever is answered meanwhile.
pub const LONGEST: Duration = Duration::from_secs(9);

/// How long after it arrived damaged an answer may come again.
pub const AGAIN: Duration = Duration::from_secs(1);

/// A unit that returned echoes and was then silent on so many is one that may never have returned any.
pub const MUTE: u8 = 5;

const HALF_A_SECOND: Duration = Duration::from_millis(500);
const NOBODY: &[&[Content]] = &[];
const SOMEBODY: &[&[Content]] = &[
    &[],
    &[Content::Words(1, false)],
    &[Content::Done(Kind::Run)],
    &[Content::Refused(Kind::Echo(0)), Content::Words(1, false)],
];
/// Two questions of a program that asks one at a time: the one that it gave up, and the one behind it.
const TWO_READS: &[&[Content]] = &[&[Content::Words(1, false), Content::Words(2, false)]];
const READS: &[Kind] = &[Kind::Echo(0), Kind::Read(1), Kind::Read(2)];
const COMMANDS: &[Kind] = &[Kind::Read(1), Kind::Run, Kind::Stop];

/// A line on which nothing is special: one unit, which returns echoes and answers in order.
const LINE: Scenario = Scenario {
    name: "",
    about: "",
    units: &[Echoing::Returns],
    overtaking: false,
    adapter: Adapter::Known,
    strangers: NOBODY,
    replaced_by: None,
    heeds: true,
    damage: Damage::Final,
    before: NOTHING,
    kinds: READS,
    longest: 16,
    timeout: HALF_A_SECOND,
    small: Budget::requests(0),
    deep: Budget::requests(0),
    sights: &[],
};

/// All of them.
pub const SCENARIOS: &[Scenario] = &[
    Scenario {
        name: "in-order",
        about: "a unit that echoes and answers in order, damage, aborts, restarts",
        small: Budget { faults: 1, lingers: 1, ..Budget::requests(3) },
        deep: Budget { faults: 1, aborts: 1, restarts: 1, lingers: 1, ..Budget::requests(3) },
        sights: &[Sight::ReadAtOnce, Sight::Late, Sight::EndedByEcho, Sight::EndedByRead, Sight::EndedBySight],
        ..LINE
    },
    Scenario {
        name: "in-order-commands",
        about: "the same with commands, stops and refusals",
        kinds: COMMANDS,
        small: Budget { refusals: 1, ..Budget::requests(3) },
        deep: Budget { faults: 1, refusals: 1, lingers: 1, ..Budget::requests(3) },
        sights: &[Sight::Commanded, Sight::Stopped, Sight::Refused, Sight::EndedByEcho],
        ..LINE
    },
    Scenario {
        name: "first-contact",
        about: "another program's question is open when the line is opened, for the first time and again",
        strangers: SOMEBODY,
        kinds: COMMANDS,
        small: Budget { openings: 1, ..Budget::requests(2) },
        deep: Budget { openings: 1, refusals: 1, ..Budget::requests(2) },
        sights: &[Sight::ReadAtOnce, Sight::Commanded, Sight::EndedByEcho, Sight::EndedByTime],
        ..LINE
    },
    Scenario {
        name: "refuses-08H",
        about: "a unit that refuses echoes",
        units: &[Echoing::Refuses],
        strangers: SOMEBODY,
        small: Budget { retries: 0, ..Budget::requests(3) },
        deep: Budget { faults: 1, refusals: 1, retries: 0, ..Budget::requests(3) },
        sights: &[Sight::ReadAtOnce, Sight::EndedByRefusal, Sight::EndedByRead, Sight::EndedByTime],
        ..LINE
    },
    Scenario {
        name: "silent-on-08H",
        about: "a unit that is silent on echoes",
        units: &[Echoing::Silent],
        strangers: SOMEBODY,
        small: Budget { lingers: 1, retries: 0, ..Budget::requests(3) },
        deep: Budget { faults: 1, refusals: 1, retries: 0, ..Budget::requests(3) },
        sights: &[Sight::ReadAtOnce, Sight::EndedByRead, Sight::EndedByTime],
        ..LINE
    },
    Scenario {
        name: "overtaking",
        about: "a line on which answers overtake each other",
        overtaking: true,
        small: Budget::requests(4),
        deep: Budget { faults: 1, ..Budget::requests(4) },
        sights: &[Sight::ReadAtOnce, Sight::Late, Sight::EndedByEcho],
        ..LINE
    },
    Scenario {
        name: "overtaking-one",
        about: "the same, and the unit gives one word at a time, so that reads have to be repeated",
        overtaking: true,
        longest: 1,
        kinds: &[Kind::Read(1)],
        small: Budget { retries: 0, ..Budget::requests(5) },
        deep: Budget { faults: 1, retries: 0, ..Budget::requests(5) },
        sights: &[Sight::ReadAtOnce, Sight::Agreed, Sight::Late, Sight::EndedByEcho],
        ..LINE
    },
    Scenario {
        name: "overtaking-sixteen",
        about: "the same, and as many words are read as a unit gives at once: it is asked for them in two parts",
        overtaking: true,
        kinds: &[Kind::Read(16)],
        small: Budget { retries: 0, ..Budget::requests(5) },
        deep: Budget { faults: 1, retries: 0, ..Budget::requests(6) },
        sights: &[Sight::ReadAtOnce, Sight::InTwo, Sight::Late, Sight::EndedByEcho],
        ..LINE
    },
    Scenario {
        name: "overtaking-commands",
        about: "the same with commands, stops and refusals",
        overtaking: true,
        kinds: COMMANDS,
        small: Budget { refusals: 1, ..Budget::requests(3) },
        deep: Budget { refusals: 1, lingers: 1, ..Budget::requests(3) },
        sights: &[Sight::Commanded, Sight::Stopped, Sight::Refused, Sight::EndedByEcho],
        ..LINE
    },
    Scenario {
        name: "overtaking-no-echo",
        about: "the same with a unit that is silent on echoes, and a stranger before",
        units: &[Echoing::Silent],
        overtaking: true,
        strangers: SOMEBODY,
        small: Budget { faults: 1, ..Budget::requests(3) },
        deep: Budget { refusals: 1, openings: 1, ..Budget::requests(2) },
        sights: &[Sight::ReadAtOnce, Sight::EndedByTime],
        ..LINE
    },
    Scenario {
        name: "other-lengths",
        about: "the same, and the unit, which has done so before, answers reads with another number of words",
        overtaking: true,
        before: OTHER_LENGTHS,
        kinds: &[Kind::Read(1), Kind::Read(2)],
        small: Budget { lengths: 1, retries: 0, ..Budget::requests(4) },
        deep: Budget { lengths: 2, quits: 1, retries: 0, ..Budget::requests(5) },
        sights: &[Sight::ReadAtOnce, Sight::Agreed, Sight::EndedByEcho, Sight::OtherLength],
        ..LINE
    },
    Scenario {
        name: "read-back",
        about: "a value that can be read back is written; answers overtake each other, and somebody else writes, too",
        overtaking: true,
        kinds: &[Kind::Set, Kind::Read(1)],
        small: Budget { aborts: 1, changes: 1, ..Budget::requests(3) },
        deep: Budget { aborts: 1, changes: 1, refusals: 1, ..Budget::requests(3) },
        sights: &[Sight::Commanded, Sight::ReadBack],
        ..LINE
    },
    Scenario {
        name: "stop-reads",
        about: "is the motor at rest? asked of a unit that is silent on echoes, while another program's questions are open",
        units: &[Echoing::Silent],
        strangers: TWO_READS,
        kinds: &[Kind::Watch],
        small: Budget { retries: 0, ..Budget::requests(4) },
        deep: Budget { faults: 1, refusals: 1, retries: 0, ..Budget::requests(4) },
        sights: &[Sight::ReadAtOnce],
        ..LINE
    },
    Scenario {
        name: "two-units",
        about: "two units with equal registers",
        units: &[Echoing::Returns, Echoing::Refuses],
        kinds: &[Kind::Read(1), Kind::Run],
        small: Budget::requests(3),
        deep: Budget { faults: 1, refusals: 1, ..Budget::requests(3) },
        sights: &[Sight::ReadAtOnce, Sight::Commanded, Sight::Late, Sight::EndedByEcho, Sight::EndedByRefusal],
        ..LINE
    },
    Scenario {
        name: "adapter-echoes",
        about: "an adapter that sends requests back, which nobody knows yet",
        overtaking: true,
        adapter: Adapter::Echoes,
        kinds: COMMANDS,
        small: Budget { faults: 1, ..Budget::requests(3) },
        deep: Budget { faults: 1, refusals: 1, ..Budget::requests(3) },
        sights: &[Sight::ReadAtOnce, Sight::Commanded, Sight::Stopped, Sight::AdapterFound],
        ..LINE
    },
    Scenario {
        name: "adapter-unknown",
        about: "an adapter that sends nothing back, which nobody knows yet",
        adapter: Adapter::Silent,
        kinds: COMMANDS,
        small: Budget { faults: 1, ..Budget::requests(3) },
        deep: Budget { faults: 1, refusals: 1, ..Budget::requests(3) },
        sights: &[Sight::ReadAtOnce, Sight::Commanded, Sight::Stopped],
        ..LINE
    },
    Scenario {
        name: "replaced",
        about: "a unit that returned echoes, in whose place another stands that is silent on them",
        replaced_by: Some(Echoing::Silent),
        kinds: &[Kind::Echo(0)],
        small: Budget { restarts: 1, ..Budget::requests(6) },
        deep: Budget { restarts: 1, ..Budget::requests(8) },
        sights: &[Sight::EndedByEcho],
        ..LINE
    },
    Scenario {
        name: "damaged-once",
        about: "answers overtake each other, and one that is damaged never comes again",
        overtaking: true,
        damage: Damage::Learned,
        small: Budget { faults: 2, ..Budget::requests(3) },
        deep: Budget { faults: 2, refusals: 1, ..Budget::requests(3) },
        sights: &[Sight::ReadAtOnce, Sight::Late, Sight::EndedByEcho],
        ..LINE
    },
    Scenario {
        name: "damaged-again",
        about: "the same, and what is damaged may come again within a second",
        overtaking: true,
        damage: Damage::Again,
        small: Budget { faults: 1, ..Budget::requests(3) },
        deep: Budget { faults: 2, ..Budget::requests(3) },
        sights: &[Sight::ReadAtOnce, Sight::Late],
        ..LINE
    },
    Scenario {
        name: "damaged-again-one",
        about: "the same, and the unit gives one word at a time, so that reads have to be repeated",
        overtaking: true,
        damage: Damage::Again,
        longest: 1,
        kinds: &[Kind::Watch],
        small: Budget { faults: 1, retries: 0, ..Budget::requests(4) },
        deep: Budget { faults: 1, retries: 0, ..Budget::requests(5) },
        sights: &[Sight::ReadAtOnce, Sight::Agreed, Sight::Late],
        ..LINE
    },
];
