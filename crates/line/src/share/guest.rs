//! A program that uses a port through another one: what it wants it says there, and waits for what it is told.
//!
//! Each call under way has a connection of its own, so that none waits behind another here; who goes first is decided
//! where the line is.

mod greeting;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_rtu::Instant;

use crate::share::channel::Channel;
use crate::share::guest::greeting::{Greeted, Greeting, crowded, greet, silence};
use crate::share::message::{Hello, Told, Wish};
use crate::share::place::{Nobody, Place};
use crate::share::secret::Secret;
use crate::system::clock::{LOOK_UP, monotonic};
use crate::system::inherited::Kept;
use crate::system::process::{Life, Process};
use crate::system::sockets::Stream;

/// The longest message of a program that has a port: the statistics of 247 units.
const MOST: usize = 1 << 20;
/// Connections of one program; stops get another one all the same.
const CONNECTIONS: usize = 64;
/// How long it may take to say what became of a call that is not wanted any more.
const LETS_GO: Duration = Duration::from_secs(2);
/// How long it may say nothing, be it to one that knocks or of a call under way, of which it says five times a second that it
/// is still to come: then it hangs. Who wants a stop has less time.
const SILENT: Duration = Duration::from_secs(2);
const SILENT_ON_A_STOP: Duration = Duration::from_secs(1);
/// How long nothing may be heard of a port that is not opened again, until it is listened on: any time would do.
const A_LOOK: Duration = Duration::from_secs(3_600);

/// A port that another program has, as this one uses it.
#[derive(Debug)]
pub(crate) struct Guest {
    place: Place,
    hello: Hello,
    host: Host,
    /// How often this program had seen the port opened again when it came.
    before: u64,
    /// How often the other one had opened it again by then, and by what it said last.
    began: u64,
    seen: AtomicU64,
    /// The program that has the port: gone when it is, whoever has its descriptors.
    life: Arc<Life>,
    /// The secret by which it is known, where there is one: who has another is another program.
    secret: Option<Secret>,
    /// By how many nanoseconds the clock here is ahead of its.
    ahead: i64,
    pool: Mutex<Pool>,
    freed: Condvar,
    gone: AtomicBool,
    made_by: Process,
}

/// The program that has the port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Host {
    pub(crate) program: String,
    pub(crate) process: u32,
    /// Whether the number of its process is one of another container.
    pub(crate) is_elsewhere: bool,
}

impl std::fmt::Display for Host {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self { program, process: 0, .. } => write!(f, "{program} outside of this container"),
            Self { program, process, is_elsewhere: true } => {
                write!(f, "{program} (process {process} of another container)")
            }
            Self { program, process, .. } => write!(f, "{program} (process {process})"),
        }
    }
}

/// A connection over which it is said when the port was opened again. It ends when the program that has the port has closed
/// it, or is gone.
#[derive(Debug)]
pub(crate) struct Vigil {
    channel: Channel,
    /// The other end, where the program that has the port has none: only its life is watched then.
    _own: Option<Kept<Stream>>,
}

/// What came of wanting to wait at the program that has the port.
#[derive(Debug)]
pub(crate) enum Wait {
    Kept(Vigil),
    /// It is gone, or has closed the port: it may have ended before it let this one in.
    Ended,
    /// It lets nobody in, and cannot be watched otherwise.
    Impossible,
}

impl Vigil {
    /// Waits for its end; until then `guest` learns how often the port was opened again.
    pub(crate) fn keep(&mut self, guest: &Guest) {
        loop {
            match self.channel.hear(monotonic() + A_LOOK) {
                Ok(Some(Told::Reconnects(there))) => guest.saw(there),
                Ok(_) => {}
                Err(_) => return,
            }
        }
    }

    /// How to end it from here.
    pub(crate) fn connection(&self) -> Arc<Kept<Stream>> {
        self.channel.end()
    }
}

#[derive(Debug, Default)]
struct Pool {
    idle: Vec<Channel>,
    under_way: usize,
}

/// What came of knocking.
#[derive(Debug)]
pub(crate) enum Knocked {
    /// The port is there to be used.
    Open(Box<Guest>),
    /// No program serves it.
    Absent,
    /// One did, and is gone or about to be.
    Gone,
    /// One does, and does not let this one in: why, in words.
    SentAway(String),
    /// One does, or something else stands in its place, and says nothing: in words.
    Silent(String),
}

/// Why a wish was not fulfilled.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Lost {
    /// The program that had the port is gone; the wish did not reach it.
    Unsent,
    /// It is gone, and may have done what was wished.
    Unknown,
    /// Who wished gave up before the wish was sent.
    GivenUp,
    /// It does not answer: why, in words. It may have done what was wished.
    Silent(String),
    /// It does not let this one in any more: why, in words.
    SentAway(String),
}

impl Guest {
    /// Asks the program that serves the port at `place` to let this one in, which has seen the port opened again `before`
    /// times.
    pub(crate) fn knock(place: &Place, hello: &Hello, before: u64) -> Knocked {
        let until = monotonic() + SILENT;
        let reached = match place.knock(until) {
            Ok(reached) => reached,
            Err(Nobody::Absent) => return Knocked::Absent,
            Err(Nobody::Gone) => return Knocked::Gone,
            #[cfg(unix)]
            Err(Nobody::NotForUs(why)) => return Knocked::Silent(why),
            Err(Nobody::Crowded) => return Knocked::Silent(crowded(SILENT)),
        };
        let secret = reached.secret.clone();
        match greet(reached, hello, None, SILENT) {
            Ok(Greeted { channel, welcome, life, peer, ahead }) => {
                let process = if peer.process == 0 { welcome.process } else { peer.process };
                let is_elsewhere = cfg!(target_os = "linux") && peer.process == 0;
                let pool = Mutex::new(Pool { idle: vec![channel], under_way: 0 });
                Knocked::Open(Box::new(Self {
                    place: place.clone(),
                    hello: hello.clone(),
                    host: Host { program: readable(&welcome.program), process, is_elsewhere },
                    before,
                    began: welcome.reconnects,
                    seen: AtomicU64::new(welcome.reconnects),
                    life,
                    secret,
                    ahead,
                    pool,
                    freed: Condvar::new(),
                    gone: AtomicBool::new(false),
                    made_by: Process::current(),
                }))
            }
            Err(Greeting::Gone) => Knocked::Gone,
            Err(Greeting::SentAway(why)) => Knocked::SentAway(why),
            Err(Greeting::Silent(why)) => Knocked::Silent(why),
        }
    }

    /// Waits at the program that has the port, over a connection of its own; where that lets no more in, for its end alone.
    pub(crate) fn waits(&self) -> Wait {
        let life = Arc::clone(&self.life);
        match self.connect(&self.hello, SILENT) {
            Ok(mut channel) => match channel.say(&Wish::Reconnects) {
                Ok(()) => Wait::Kept(Vigil { channel, _own: None }),
                Err(_) => Wait::Ended,
            },
            Err(Greeting::Gone) => Wait::Ended,
            Err(Greeting::SentAway(_) | Greeting::Silent(_)) if life.end().is_none() => Wait::Impossible,
            Err(Greeting::SentAway(_) | Greeting::Silent(_)) => {
                let kept = Stream::pair().and_then(|(one, other)| {
                    Ok(Vigil { channel: Channel::new(one, MOST, life)?, _own: Some(Kept::new(other)) })
                });
                kept.map_or(Wait::Impossible, Wait::Kept)
            }
        }
    }

    /// Another connection to the program that has the port.
    fn connect(&self, hello: &Hello, patience: Duration) -> Result<Channel, Greeting> {
        let reached = self.place.knock(monotonic() + patience).map_err(|nobody| match nobody {
            Nobody::Absent | Nobody::Gone => Greeting::Gone,
            Nobody::Crowded => Greeting::Silent(crowded(patience)),
            #[cfg(unix)]
            Nobody::NotForUs(why) => Greeting::SentAway(why),
        })?;
        if reached.secret != self.secret {
            return Err(Greeting::Gone); // another program has the port by now
        }
        greet(reached, hello, Some(&self.life), patience).map(|greeted| greeted.channel)
    }

    /// Where it was met.
    pub(crate) fn place(&self) -> &Place {
        &self.place
    }

    pub(crate) fn host(&self) -> &Host {
        &self.host
    }

    /// Whether the program that had the port is known to be gone.
    pub(crate) fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Acquire)
    }

    /// How often this program has seen the port opened again: known without asking, for it is told.
    pub(crate) fn reconnects(&self) -> u64 {
        self.before + self.seen.load(Ordering::Acquire).saturating_sub(self.began)
    }

    /// The count of the program that has the port, where this one's is `reconnects`. What was before it came is like no
    /// count of that one.
    pub(crate) fn as_counted_there(&self, reconnects: u64) -> u64 {
        reconnects.checked_sub(self.before).map_or(u64::MAX, |since| self.began + since)
    }

    /// So often has the program that has the port opened it again by now.
    pub(crate) fn saw(&self, reconnects: u64) {
        self.seen.fetch_max(reconnects, Ordering::AcqRel);
    }

    /// Says `wish` and gives what it is told to `hear`, until that says that it was the last. A stop waits for no other wish.
    ///
    /// `give_up` is asked every 50 ms. Where it says so, what is under way is taken back, and what became of it is heard.
    pub(crate) fn ask(
        &self,
        wish: &Wish,
        is_stop: bool,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Told) -> bool,
    ) -> Result<(), Lost> {
        let (mut channel, is_for_all) = self.take(is_stop, give_up)?;
        let silent = if is_stop { SILENT_ON_A_STOP } else { SILENT };
        let result = self.ask_on(&mut channel, wish, silent, give_up, hear);
        let mut pool = self.lock();
        pool.under_way -= 1;
        match &result {
            Ok(()) if is_for_all => pool.idle.push(channel),
            Err(Lost::Unsent | Lost::Unknown) => {
                self.gone.store(true, Ordering::Release);
                pool.idle.clear();
            }
            _ => {}
        }
        drop(pool);
        self.freed.notify_one();
        result
    }

    fn ask_on(
        &self,
        channel: &mut Channel,
        wish: &Wish,
        silent: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Told) -> bool,
    ) -> Result<(), Lost> {
        channel.say(wish).map_err(|_| Lost::Unsent)?;
        let mut taken_back: Option<Instant> = None;
        let (mut heard, mut looked) = (monotonic(), monotonic());
        loop {
            match channel.hear::<Told>(monotonic() + LOOK_UP) {
                Ok(Some(told)) => {
                    heard = monotonic();
                    if !matches!(told, Told::Waiting) && hear(told.by_clock_ahead(self.ahead)) {
                        return Ok(());
                    }
                    // Where much is told, it is not asked each time.
                    if heard < looked + LOOK_UP {
                        continue;
                    }
                }
                Ok(None) => {}
                Err(_) => return Err(Lost::Unknown),
            }
            let now = monotonic();
            looked = now;
            if taken_back.is_none() && give_up() {
                taken_back = Some(now);
                channel.say(&Wish::Cancel).map_err(|_| Lost::Unknown)?;
            }
            if taken_back.is_some_and(|moment| now >= moment + LETS_GO) {
                return Err(Lost::Silent(format!("{} has the port and does not answer", self.host)));
            }
            if now >= heard + silent {
                return Err(Lost::Silent(silence(&self.host, silent)));
            }
        }
    }

    /// A connection for one wish, and whether it is for others too: one that was made for a stop is for nothing else.
    fn take(&self, is_stop: bool, give_up: &mut dyn FnMut() -> bool) -> Result<(Channel, bool), Lost> {
        let mut pool = self.lock();
        loop {
            if self.is_gone() || !self.made_by.is_current() {
                return Err(Lost::Unsent);
            }
            if let Some(channel) = pool.idle.pop() {
                pool.under_way += 1;
                return Ok((channel, true));
            }
            if is_stop || pool.under_way < CONNECTIONS {
                break;
            }
            pool = self.freed.wait_timeout(pool, LOOK_UP).unwrap_or_else(PoisonError::into_inner).0;
            drop(pool);
            if give_up() {
                return Err(Lost::GivenUp);
            }
            pool = self.lock();
        }
        pool.under_way += 1;
        drop(pool);
        let silent = if is_stop { SILENT_ON_A_STOP } else { SILENT };
        let hello = Hello { is_for_a_stop: is_stop, ..self.hello.clone() };
        self.connect(&hello, silent).map(|channel| (channel, !is_stop)).map_err(|why| {
            self.lock().under_way -= 1;
            match why {
                Greeting::Gone => {
                    self.gone.store(true, Ordering::Release);
                    Lost::Unsent
                }
                Greeting::SentAway(why) | Greeting::Silent(why) => Lost::SentAway(why),
            }
        })
    }

    fn lock(&self) -> MutexGuard<'_, Pool> {
        self.pool.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What another program says, without anything that a terminal would obey.
pub(crate) fn readable(text: &str) -> String {
    text.chars().filter(|letter| !letter.is_control()).take(300).collect()
}
