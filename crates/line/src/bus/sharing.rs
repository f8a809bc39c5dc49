//! Whether a bus has its port itself, or uses it through another program; and how one becomes the other.
//!
//! The port decides: who opens it has it, and serves the others; who finds it taken looks for the one who serves it. When
//! that one ends, all others do the same again, and one of them has the port.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::thread;
use std::time::Duration;

use crate::bus::host::{Guests, Host};
use crate::bus::openings::Openings;
use crate::bus::shared::Shared;
use crate::health::stats::{Program, Stats};
use crate::line::{Line, Opener, PortError, PortErrorKind};
use crate::options::{BusOptions, Share};
use crate::ports::key::PortKey;
use crate::share::guest::{Guest, Knocked};
use crate::share::message::{Characters, Hello};
use crate::share::place::Place;
use crate::system::clock::monotonic;
use crate::system::process::own_name;

/// How long a port may stay taken whose owner is gone: the system closes what a program that was killed had open, one
/// after the other.
const LETS_GO: Duration = Duration::from_millis(400);
/// How long nothing is sent when a port is taken over: the request of a program that was killed may be on the wire, unheard,
/// and its unit about to answer.
const QUIET: Duration = Duration::from_millis(50);
/// How often it is tried meanwhile.
const STEP: Duration = Duration::from_millis(5);

/// What a bus knows of the programs it shares its port with.
#[derive(Debug)]
pub(super) struct Sharing {
    key: PortKey,
    share: Share,
    hello: Hello,
    /// The bus, once it is made.
    bus: OnceLock<Weak<Shared>>,
    stats: Arc<Mutex<Stats>>,
    openings: Arc<Openings>,
    is_guest: AtomicBool,
    /// Whether the program through which the port was used is gone, and nobody opened it since.
    takes_over: AtomicBool,
    guest: Mutex<Option<Arc<Guest>>>,
    host: Mutex<Serving>,
    guests: Arc<Guests>,
}

#[derive(Debug, Default)]
struct Serving {
    host: Option<Host>,
    /// Where the door shall be, as soon as there is a bus behind it.
    at: Option<(Place, crate::share::place::Door)>,
    /// Why others cannot come in.
    refused: Option<String>,
}

impl Sharing {
    /// With what opens the port, or finds who has it; none where the port is not shared, and `opener` as it was.
    pub(super) fn around(
        key: Option<PortKey>,
        options: &BusOptions,
        stats: &Arc<Mutex<Stats>>,
        openings: &Arc<Openings>,
        opener: Opener,
    ) -> (Option<Arc<Self>>, Opener) {
        let Some(key) = key.filter(|_| options.share != Share::Never) else { return (None, opener) };
        let sharing = Arc::new(Self::new(key, options, stats, openings));
        let opener = sharing.opener(opener);
        (Some(sharing), opener)
    }

    fn new(key: PortKey, options: &BusOptions, stats: &Arc<Mutex<Stats>>, openings: &Arc<Openings>) -> Self {
        Self {
            key,
            share: options.share,
            hello: Hello { program: own_name(), characters: Characters::of(&options.format) },
            bus: OnceLock::new(),
            stats: Arc::clone(stats),
            openings: Arc::clone(openings),
            is_guest: AtomicBool::new(false),
            takes_over: AtomicBool::new(false),
            guest: Mutex::default(),
            host: Mutex::default(),
            guests: Arc::default(),
        }
    }

    /// Opens the port by `open`, or finds who has it.
    fn opener(self: &Arc<Self>, mut open: Opener) -> Opener {
        let sharing = Arc::clone(self);
        Box::new(move || sharing.open(&mut open))
    }

    /// The line; or an error, and a [`guest`](Self::guest) where another program serves the port.
    fn open(&self, open: &mut Opener) -> Result<Box<dyn Line>, PortError> {
        let place = match Place::of(&self.key) {
            Ok(Some(place)) => place,
            Ok(None) => return open(), // it says what is wrong with the port
            Err(error) => return self.open_alone(open, &error),
        };
        let _turn = match place.turn() {
            Ok(turn) => turn,
            Err(error) => return self.open_alone(open, &error),
        };
        let end = monotonic() + LETS_GO;
        // What does not keep others out by itself is asked for first.
        let mut taken = (!self.key.locks()).then(|| PortError::new(PortErrorKind::Busy, "port", "it is taken"));
        loop {
            let error = match taken.take() {
                Some(error) => error,
                None => match open() {
                    Ok(line) => {
                        self.has_opened(place);
                        return Ok(line);
                    }
                    Err(error) if error.kind == PortErrorKind::Busy => error,
                    Err(error) => return Err(error),
                },
            };
            match Guest::knock(&place, &self.hello, self.openings.with_one_now()) {
                Knocked::Open(guest) => {
                    self.comes_in(guest);
                    return Err(error);
                }
                Knocked::SentAway(why) => return Err(PortError { message: why, ..error }),
                Knocked::Gone if monotonic() < end => thread::sleep(STEP),
                Knocked::Absent | Knocked::Gone if self.key.locks() => return Err(error),
                Knocked::Absent | Knocked::Gone => {
                    // Nobody serves it.
                    let line = open()?;
                    self.has_opened(place);
                    return Ok(line);
                }
            }
            if !self.key.locks() {
                taken = Some(error);
            }
        }
    }

    /// Opens the port where nobody could be met over it.
    fn open_alone(&self, open: &mut Opener, why: &std::io::Error) -> Result<Box<dyn Line>, PortError> {
        self.serving().refused = Some(format!("other programs cannot use this port through this one: {why}"));
        open()
    }

    fn comes_in(&self, guest: Guest) {
        self.serves_no_more();
        self.openings.open_elsewhere();
        self.takes_over.store(false, Ordering::Release);
        *self.guest.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(guest));
        self.is_guest.store(true, Ordering::Release);
    }

    fn has_opened(&self, place: Place) {
        self.open_door(place);
        if self.takes_over.swap(false, Ordering::AcqRel) {
            thread::sleep(QUIET);
        }
    }

    fn open_door(&self, place: Place) {
        let mut serving = self.serving();
        if self.share != Share::Auto || serving.host.as_ref().is_some_and(|host| host.is_at(&place)) {
            return;
        }
        serving.host = None;
        serving.at = match place.open_door() {
            Ok(door) => Some((place, door)),
            Err(error) => {
                serving.refused = Some(format!("other programs cannot use this port through this one: {error}"));
                None
            }
        };
        self.begin_to_serve(&mut serving);
    }

    /// The bus is made: others may come in.
    pub(super) fn serves(&self, bus: &Arc<Shared>) {
        self.bus.get_or_init(|| Arc::downgrade(bus));
        self.begin_to_serve(&mut self.serving());
    }

    fn begin_to_serve(&self, serving: &mut Serving) {
        let Some(bus) = self.bus.get() else { return };
        let Some((_, door)) = serving.at.take() else { return };
        match Host::open(door, Arc::clone(&self.guests), Weak::clone(bus)) {
            Ok(host) => serving.host = Some(host),
            Err(error) => {
                serving.refused = Some(format!("other programs cannot use this port through this one: {error}"));
            }
        }
    }

    /// The program through which the port is used, if it is another one's.
    pub(super) fn guest(&self) -> Option<Arc<Guest>> {
        if !self.is_guest() {
            return None;
        }
        self.guest.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether the port is another program's.
    pub(super) fn is_guest(&self) -> bool {
        self.is_guest.load(Ordering::Acquire)
    }

    /// The program through which the port was used is gone.
    pub(super) fn lost(&self, gone: &Arc<Guest>) {
        let mut guest = self.guest.lock().unwrap_or_else(PoisonError::into_inner);
        if guest.as_ref().is_some_and(|guest| Arc::ptr_eq(guest, gone)) {
            self.stats.lock().unwrap_or_else(PoisonError::into_inner).reconnects = gone.reconnects();
            self.takes_over.store(true, Ordering::Release);
            self.is_guest.store(false, Ordering::Release);
            *guest = None;
        }
    }

    /// Nobody is let in any more, and who is in is told so. The port is closed by now.
    pub(super) fn end(&self) {
        self.serves_no_more();
        self.is_guest.store(false, Ordering::Release);
        *self.guest.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    fn serves_no_more(&self) {
        let mut serving = self.serving();
        (serving.host, serving.at) = (None, None);
        drop(serving);
        self.guests.end();
    }

    /// What the programs that come in through this one asked so far.
    pub(super) fn programs(&self) -> Vec<Program> {
        self.guests.counted()
    }

    /// What the user should know about it.
    pub(super) fn note(&self) -> Option<String> {
        match self.guest() {
            Some(guest) => Some(format!("{} has the port; requests go through it", guest.host())),
            None => self.serving().refused.clone(),
        }
    }

    fn serving(&self) -> MutexGuard<'_, Serving> {
        self.host.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
