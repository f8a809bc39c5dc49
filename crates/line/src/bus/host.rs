//! The side of the program that has a port: it lets others of the same user in, and does what they want in its queue.
//!
//! Each connection has a thread of its own, which waits in the queue and works on the line as a caller of this program's
//! would. Whoever is at the other end hears words; whatever comes from there reaches the line only as a request that this
//! program could have made itself.

mod at_door;
mod strangers;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Weak};
use std::time::Duration;

use drivebus_rtu::{Instant, UnitAddress};

use crate::ask::Ask;
use crate::bus::call::{Call, Wanted};
use crate::bus::errand::pdu_of;
use crate::bus::host::strangers::Strangers;
use crate::bus::port::Port;
use crate::bus::programs::{Programs, Seat};
use crate::error::Failure;
use crate::health::stats::{Program as Counted, Stats};
use crate::line::{PortError, PortErrorKind};
use crate::options::UnitOptions;
use crate::share::channel::Channel;
use crate::share::failure::Said;
use crate::share::folder::user_named;
use crate::share::guest::readable;
use crate::share::message::{
    Characters, Figures, GREETING, Hello, LET_IN, Order, SENT_AWAY, Told, VERSION, Welcome, Wish,
};
use crate::share::place::{Door, Place, ReachedBy};
use crate::share::proof;
use crate::system::clock::monotonic;
use crate::system::inherited::Kept;
use crate::system::process::{self, Life, Peer, Process};
use crate::system::sockets::{Shutdown, Stream};
use crate::system::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use crate::system::sync::{Mutex, MutexGuard, PoisonError, thread};
use crate::trace::{Direction, Overheard};
use crate::turns::order::Program;

/// The longest message of a guest: one request with its options.
const MOST: usize = 1_024;
/// How long a guest may take to say hello, or a message that it has begun.
const HURRY: Duration = Duration::from_secs(1);
/// Connections at a time: of all guests, and of one; and those that are kept for the first of a program and for stops. Fewer
/// where this program may not have so many files open.
const CONNECTIONS: usize = 512;
const CONNECTIONS_OF_ONE: usize = 128;
const IN_RESERVE: usize = 128;
/// How often a guest is told that its call is still to come.
const WORD: Duration = Duration::from_millis(200);
/// How long a thread of this program may have the line without a sign that it goes on, until a guest is told so.
const HOLDS_ON: Duration = Duration::from_secs(2);
const HOLDS_ON_TO_A_STOP: Duration = Duration::from_secs(1);
/// Programs that are remembered when they are gone.
const REMEMBERED: usize = 64;

/// An open door, until this is dropped. Who is in by then stays.
#[derive(Debug)]
pub(super) struct Host {
    door: Door,
    /// Its end wakes the thread at the door.
    waker: Kept<Stream>,
    opened_by: Process,
}

/// Who is in.
#[derive(Debug, Default)]
pub(super) struct Guests {
    inside: Mutex<Inside>,
    strangers: Strangers,
    /// Why nobody can come in now.
    kept_out: Mutex<Option<String>>,
}

#[derive(Debug, Default)]
struct Inside {
    connections: u64,
    /// To end them.
    streams: BTreeMap<u64, Arc<Kept<Stream>>>,
    /// To say over them that the port was opened again.
    watching: BTreeMap<u64, Channel>,
    programs: Vec<Arc<Entry>>,
}

/// One program.
#[derive(Debug)]
struct Entry {
    name: String,
    process: u32,
    life: Arc<Life>,
    /// Its number, while it is here.
    seat: Weak<Seat>,
    connections: AtomicUsize,
    calls: AtomicU64,
    answered: AtomicU64,
}

impl Host {
    /// Lets programs in through `door` to the line that `port` is.
    pub(super) fn open(door: Door, guests: Arc<Guests>, port: Weak<Port>) -> io::Result<Self> {
        let (waker, woken) = Stream::pair()?;
        let (waker, woken) = (Kept::new(waker), Kept::new(woken));
        let entrances = Arc::clone(&door.entrances);
        thread::Builder::new().name("drivebus-door".to_owned()).spawn(move || {
            at_door::stand(
                &entrances,
                &woken,
                |refused| guests.keeps_out(refused),
                |stream, reached_by| {
                    let (guests, port) = (Arc::clone(&guests), Weak::clone(&port));
                    // Where the system gives no thread, the guest finds its connection ended.
                    let guest = thread::Builder::new().name("drivebus-guest".to_owned());
                    guest.spawn(move || serve(stream, reached_by, &guests, &port)).map(drop)
                },
            );
        })?;
        Ok(Self { door, waker, opened_by: Process::current() })
    }

    /// Whether others find it at `place`.
    pub(super) fn is_at(&self, place: &Place) -> bool {
        self.opened_by.is_current() && place.has(&self.door)
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // A child that was forked may have the other end too, and is not who ends this.
        if self.opened_by.is_current() {
            let _ = self.waker.shutdown(Shutdown::Both);
        }
    }
}

impl Guests {
    fn lock(&self) -> MutexGuard<'_, Inside> {
        self.inside.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Nobody can come in, since the system refuses what that takes; `None`: they can.
    fn keeps_out(&self, refused: Option<&io::Error>) {
        let why = refused.map(|error| format!("other programs cannot come in to use this port now: {error}"));
        *self.kept_out.lock().unwrap_or_else(PoisonError::into_inner) = why;
    }

    /// Why nobody can come in now, if that is so.
    pub(super) fn note(&self) -> Option<String> {
        self.kept_out.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Hears no more of anybody; what they asked for by now, they are still told about.
    pub(super) fn end(&self) {
        for stream in self.lock().streams.values() {
            // One that is ended already need not be.
            let _ = stream.shutdown(Shutdown::Read);
        }
    }

    /// Tells who wants to know that the port was opened again, `reconnects` times by now. Nobody is waited for: who has left
    /// that much unread is cut off, and comes back.
    pub(super) fn reopened(&self, reconnects: u64) {
        for channel in self.lock().watching.values_mut() {
            if !channel.say_in_passing(&Told::Reconnects(reconnects)).unwrap_or(false) {
                // One that is ended already need not be.
                let _ = channel.end().shutdown(Shutdown::Both);
            }
        }
    }

    /// What each program asked so far.
    pub(super) fn counted(&self) -> Vec<Counted> {
        let inside = self.lock();
        let counted = inside.programs.iter().map(|entry| Counted {
            name: entry.name.clone(),
            process: entry.process,
            here: entry.connections.load(Ordering::Relaxed) > 0,
            calls: entry.calls.load(Ordering::Relaxed),
            answered: entry.answered.load(Ordering::Relaxed),
        });
        counted.collect()
    }

    /// Lets a program in; `Err` says why not.
    fn enter(
        self: &Arc<Self>,
        hello: &Hello,
        peer: &Peer,
        stream: Arc<Kept<Stream>>,
        programs: &Arc<Programs>,
    ) -> Result<Visit, String> {
        let mut inside = self.lock();
        let (name, process) = (readable(&hello.program), peer.process);
        let name = match peer.other_user() {
            Some(user) => format!("{name} of {}", user_named(user)),
            None => name,
        };
        // A process that this one cannot see is told from others by its name alone.
        let is_it = |entry: &&Arc<Entry>| {
            entry.connections.load(Ordering::Relaxed) > 0
                && entry.process == process
                && if process == 0 { entry.name == name } else { !entry.life.is_gone() }
        };
        let known = inside.programs.iter().find(is_it).cloned();
        let files = process::most_files();
        let most = CONNECTIONS.min(files / 2);
        if inside.streams.len() >= (most + IN_RESERVE).min(files / 4 * 3) {
            return Err(format!(
                "{} connections to this port are open already, and no more may be",
                inside.streams.len()
            ));
        }
        if let Some(entry) = known.as_ref().filter(|_| !hello.is_for_a_stop) {
            if inside.streams.len() >= most {
                return Err(format!("{most} connections to this port are open already, and no more may be"));
            }
            if entry.connections.load(Ordering::Relaxed) >= CONNECTIONS_OF_ONE {
                return Err(format!(
                    "this program has {CONNECTIONS_OF_ONE} connections to this port, and no more may be"
                ));
            }
        }
        let seat = known.as_ref().and_then(|entry| entry.seat.upgrade());
        let seat = seat.unwrap_or_else(|| Arc::new(programs.seat()));
        let entry = known.unwrap_or_else(|| {
            let entry = Arc::new(Entry {
                name,
                process,
                life: Arc::new(peer.life()),
                seat: Arc::downgrade(&seat),
                connections: AtomicUsize::new(0),
                calls: AtomicU64::new(0),
                answered: AtomicU64::new(0),
            });
            if inside.programs.len() >= REMEMBERED
                && let Some(gone) =
                    inside.programs.iter().position(|entry| entry.connections.load(Ordering::Relaxed) == 0)
            {
                inside.programs.remove(gone);
            }
            inside.programs.push(Arc::clone(&entry));
            entry
        });
        entry.connections.fetch_add(1, Ordering::Relaxed);
        inside.connections += 1;
        let number = inside.connections;
        inside.streams.insert(number, stream);
        Ok(Visit { guests: Arc::clone(self), entry, seat, number, is_for_a_stop: hello.is_for_a_stop })
    }
}

/// A connection that was let in, until this is dropped.
struct Visit {
    guests: Arc<Guests>,
    entry: Arc<Entry>,
    seat: Arc<Seat>,
    number: u64,
    is_for_a_stop: bool,
}

impl Visit {
    /// From now on it is said over `channel` when the port was opened again; first, how often it was by now.
    fn watches(&self, channel: &Channel, port: &Port) -> Option<()> {
        let mut inside = self.guests.lock();
        let mut voice = channel.voice();
        // Asked under the lock that who opens the port takes after it has counted: no opening falls between.
        let is_said = voice.say_in_passing(&Told::Reconnects(port.figures.reconnects())).ok()?;
        inside.watching.insert(self.number, voice);
        is_said.then_some(())
    }
}

impl Drop for Visit {
    fn drop(&mut self) {
        let mut inside = self.guests.lock();
        inside.streams.remove(&self.number);
        inside.watching.remove(&self.number);
        drop(inside);
        self.entry.connections.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Serves one connection to its end.
fn serve(stream: Stream, reached_by: ReachedBy, guests: &Arc<Guests>, port: &Weak<Port>) {
    let mut peer = process::peer(&stream);
    let is_of_another = peer.other_user().is_some();
    let Ok(mut channel) = Channel::new(stream, MOST, Arc::new(Life::Unknown)) else { return };
    let may_come_in = match reached_by {
        #[cfg(unix)]
        ReachedBy::ThisUser => !is_of_another,
        // The system looked whether it may connect.
        #[cfg(unix)]
        ReachedBy::Group => true,
        #[cfg(unix)]
        ReachedBy::Anybody => peer.user.is_some() && !is_of_another,
        ReachedBy::Strangers(secret) => {
            let _one = guests.strangers.enter(&channel);
            channel.lets_say(proof::MOST);
            // Nothing is said to who does not know the secret: not even that it does not.
            let Some(process) = proof::of_guest(&mut channel, &secret, monotonic() + HURRY) else { return };
            channel.lets_say(MOST);
            peer.process = process;
            !is_of_another
        }
    };
    let let_in = if may_come_in {
        let_in(&mut channel, &peer, guests, port)
    } else {
        Err("this port is open in a program of another user".to_owned())
    };
    match let_in {
        Ok(Some(visit)) => {
            let channel = RefCell::new(channel);
            // It ends when either side does, or where what comes is no wish.
            while next(&channel, &visit, port).is_some() {}
            drop(visit);
            if let Some(port) = port.upgrade() {
                port.wills.look_soon();
            }
        }
        Ok(None) => {}
        Err(why) => {
            // Who is sent away may be gone already.
            let _ = channel.say_bytes(&[&[SENT_AWAY], why.as_bytes()].concat());
        }
    }
}

/// Hears who comes; `Err` says why it cannot come in, `None` that it said nothing.
fn let_in(
    channel: &mut Channel,
    peer: &Peer,
    guests: &Arc<Guests>,
    port: &Weak<Port>,
) -> Result<Option<Visit>, String> {
    let no_greeting = || "this is a port of drivebus, and what came is not its greeting".to_owned();
    let Some(greeting) = channel.hear_bytes(monotonic() + HURRY).map_err(|_| no_greeting())? else { return Ok(None) };
    let own = format!("{} (process {})", process::own_name(), std::process::id());
    let (version, hello) = greeting.strip_prefix(GREETING).and_then(<[u8]>::split_first).ok_or_else(no_greeting)?;
    if *version != VERSION {
        return Err(format!(
            "{own} has the port, and is of another version of drivebus: it speaks version {VERSION} where this program \
             speaks {version}; use the same version, or end one of them"
        ));
    }
    let hello: Hello = postcard::from_bytes(hello).map_err(|_| no_greeting())?;
    let Some(port) = port.upgrade() else { return Ok(None) };
    let ours = Characters::of(&port.options.format);
    if hello.characters != ours {
        return Err(format!(
            "{own} has the port open at {ours}, and {} is asked for; ask for the same, or end that program",
            hello.characters
        ));
    }
    let visit = guests.enter(&hello, peer, channel.end(), &port.programs)?;
    channel.depends_on(Arc::clone(&visit.entry.life));
    let welcome =
        Welcome { program: process::own_name(), process: std::process::id(), reconnects: port.figures.reconnects() };
    let welcome = postcard::to_extend(&welcome, vec![LET_IN]).map_err(|error| error.to_string())?;
    Ok(channel.say_bytes(&welcome).is_ok().then_some(visit))
}

/// Hears one wish and fulfils it; `None` ends the connection.
fn next(channel: &RefCell<Channel>, visit: &Visit, port: &Weak<Port>) -> Option<()> {
    let wish = hear(&mut channel.borrow_mut())?;
    // A bus that is gone ends its connections; one that is about to be is as good as gone.
    let port = port.upgrade()?;
    let told = match wish {
        Wish::Call(order) if visit.is_for_a_stop && !order.is_stop() => return None,
        Wish::Call(order) => {
            visit.entry.calls.fetch_add(1, Ordering::Relaxed);
            let told = call(channel, &port, &order, visit.seat.program)?;
            if matches!(told, Told::Answer { .. }) {
                visit.entry.answered.fetch_add(1, Ordering::Relaxed);
            }
            told
        }
        // It came when what it is about had ended.
        Wish::Cancel => return Some(()),
        _ if visit.is_for_a_stop => return None,
        Wish::Listen(time) => {
            let mut passing = Passing::to(channel);
            let mut hear = |moment: Instant, bytes: &[u8]| {
                passing.say(&Told::Heard { at: moment.as_nanos(), bytes: bytes.to_vec() });
            };
            let ended = port.listen(Duration::from_nanos(time), &mut || is_unwanted(channel, &port), &mut hear);
            passing.end();
            Told::Over(ended.err().as_ref().map(Said::from))
        }
        Wish::Overhear(time) => {
            let mut passing = Passing::to(channel);
            let mut hear = |piece: Overheard| {
                let Overheard { at, direction, bytes } = piece;
                passing.say(&Told::Overheard { at: at.as_nanos(), sent: direction == Direction::Sent, bytes });
            };
            let ended = port.overhear(Duration::from_nanos(time), &mut || is_unwanted(channel, &port), &mut hear);
            passing.end();
            Told::Over(ended.err().as_ref().map(Said::from))
        }
        Wish::Stats => {
            let mut programs = visit.guests.counted();
            programs.extend(port.programs.clients());
            let stats = Stats { programs, ..port.figures.stats() };
            Told::Stats(Box::new(Figures::from(stats)))
        }
        Wish::Link(unit) => {
            let link = port.figures.link(UnitAddress::by_name(unit));
            Told::Link { good: link.good, asked: link.asked }
        }
        Wish::Halts(unit) => Told::Halts(port.halts.of(UnitAddress::by_name(unit))),
        Wish::FreshWord => Told::Word(port.words.next()),
        Wish::Reconnects => {
            visit.watches(&channel.borrow(), &port)?;
            drop(port);
            // Whatever else is said there ends it.
            return hear(&mut channel.borrow_mut()).and(None);
        }
        Wish::Wills => {
            port.wills.look_soon();
            Told::Wills
        }
    };
    if port.is_shut() {
        port.close();
    }
    channel.borrow_mut().say(&told).ok()
}

/// The next wish, for as long as it takes; `None` where none comes any more, or one takes too long.
fn hear(channel: &mut Channel) -> Option<Wish> {
    loop {
        let has_begun = channel.has_begun();
        let until = if has_begun { monotonic() + HURRY } else { monotonic() + Duration::from_secs(3_600) };
        match channel.hear(until) {
            Ok(Some(wish)) => return Some(wish),
            Ok(None) if !has_begun => {}
            _ => return None,
        }
    }
}

/// Whether the guest takes back what is under way, or is gone, or says what it may not say now.
fn is_unwanted(channel: &RefCell<Channel>, port: &Port) -> bool {
    port.is_shut() || !matches!(channel.borrow_mut().hear::<Wish>(Instant::ZERO), Ok(None))
}

/// What is said to a guest that may read it or not: nobody waits for one that does not, least of all who uses the line.
struct Passing<'a> {
    channel: &'a RefCell<Channel>,
    left_out: u64,
}

impl<'a> Passing<'a> {
    fn to(channel: &'a RefCell<Channel>) -> Self {
        Self { channel, left_out: 0 }
    }

    /// Says `told`, and before it how much was left out since something could be said. A connection that has ended is seen
    /// elsewhere.
    fn say(&mut self, told: &Told) {
        let mut channel = self.channel.borrow_mut();
        if self.left_out > 0 && channel.say_in_passing(&Told::LeftOut(self.left_out)).unwrap_or(true) {
            self.left_out = 0;
        }
        if self.left_out > 0 || !channel.say_in_passing(told).unwrap_or(true) {
            self.left_out += 1;
        }
    }

    /// Nothing more is said: what is left out by now is told, to one that reads.
    fn end(&mut self) {
        if self.left_out > 0 {
            let _ = self.channel.borrow_mut().say(&Told::LeftOut(self.left_out));
        }
    }
}

/// The words to a guest whose call is still to come.
struct Words<'a> {
    channel: &'a RefCell<Channel>,
    said: Instant,
}

impl Words<'_> {
    fn say(&mut self) {
        let now = monotonic();
        if now >= self.said + WORD {
            self.said = now;
            // One that does not read is not there, or does not need it.
            let _ = self.channel.borrow_mut().say_in_passing(&Told::Waiting);
        }
    }
}

/// A guest that has to be there for as long as nothing of its call is on the wire.
struct Here<'a>(&'a RefCell<Channel>);

impl Wanted for Here<'_> {
    fn is_wanted(&self) -> bool {
        self.0.borrow().is_there()
    }
}

/// Carries out `order`; `None` where it is none.
fn call(channel: &RefCell<Channel>, port: &Port, order: &Order, program: Program) -> Option<Told> {
    let (destination, request, options) = (order.destination(), order.request()?, order.options()?);
    let meanings = order.meanings();
    let ask = port.ask_as(UnitOptions::default(), destination, &request, &options);
    let ask = Ask { meanings: meanings.as_ref(), ..order.times(ask) };
    let here = Here(channel);
    let mut pdu = Vec::new();
    let mut words = Words { channel, said: monotonic() };
    let mut watch = port.queue.watch();
    let mut holds_on = false;
    let patience = if order.is_stop() { HOLDS_ON_TO_A_STOP } else { HOLDS_ON };
    let mut give_up = || {
        words.say();
        holds_on = watch.sees_nothing_move_for(patience);
        holds_on || is_unwanted(channel, port)
    };
    let result = Call::new(port, ask, options)
        .of_program(program)
        .while_wanted(&here)
        .run(&mut give_up, &mut |answer| pdu = pdu_of(destination, &answer));
    let reconnects = port.figures.reconnects();
    Some(match result {
        Ok(done) => Told::Answer { pdu, sent: done.sent.as_nanos(), ended: done.ended.as_nanos(), reconnects },
        Err(mut error) => {
            if error.failure == Failure::Interrupted && holds_on {
                let own = format!("{} (process {})", process::own_name(), std::process::id());
                let why = format!("a thread of {own} holds the port and does not go on: it hangs; end that program");
                error.failure = Failure::Port(PortError::new(PortErrorKind::Busy, &port.name, why));
            }
            // What ends here because this program does is not what the guest gave up.
            if error.failure == Failure::Interrupted && port.is_shut() {
                error.failure = Failure::Closed;
            }
            Told::failed(&error, reconnects)
        }
    })
}
