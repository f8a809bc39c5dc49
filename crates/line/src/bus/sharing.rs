//! Whether a bus has its port itself, or uses it through another program; and how one becomes the other.
//!
//! The port decides: who opens it has it, and serves the others; who finds it taken looks for the one who serves it. When
//! that one ends, all others do the same again, and one of them has the port.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::thread;
use std::time::Duration;

use crate::bus::host::{Guests, Host};
use crate::bus::openings::Openings;
use crate::bus::port::{Ends, Port};
use crate::bus::wills::is_any;
use crate::health::stats::{Program, Stats};
use crate::line::{Line, Opener, PortError, PortErrorKind};
use crate::options::{BusOptions, Share};
use crate::ports::key::PortKey;
use crate::share::guest::{Guest, Knocked, Vigil, Wait};
use crate::share::message::{Characters, Hello};
use crate::share::place::Place;
use crate::system::clock::monotonic;
use crate::system::inherited::Kept;
use crate::system::process::own_name;
use crate::system::sockets::{Shutdown, Stream};
use crate::turns::order::Priority;

/// How long a port may stay taken whose owner is gone: the system closes what a program that was killed had open, one
/// after the other.
const LETS_GO: Duration = Duration::from_millis(400);
/// How long nothing is sent when a port is taken over: the request of a program that was killed may be on the wire, unheard,
/// and its unit about to answer.
const QUIET: Duration = Duration::from_millis(50);
/// How often it is tried meanwhile.
const STEP: Duration = Duration::from_millis(5);
/// How often it is looked whether somebody runs a motor by the port, where its program has ended and nobody here has asked since.
const LOOKS: Duration = Duration::from_secs(1);

/// What a bus knows of the programs it shares its port with.
#[derive(Debug)]
pub(super) struct Sharing {
    key: PortKey,
    share: Share,
    group: Option<u32>,
    hello: Hello,
    /// The port, once it is made.
    port: OnceLock<Weak<Port>>,
    stats: Arc<Mutex<Stats>>,
    openings: Arc<Openings>,
    is_guest: AtomicBool,
    /// Whether the program through which the port was used is gone, and nobody opened it since.
    takes_over: AtomicBool,
    guest: Mutex<Option<Arc<Guest>>>,
    host: Mutex<Serving>,
    guests: Arc<Guests>,
    /// Pieces of what went over the line that the program which has the port could not tell this one.
    left_out: AtomicU64,
    /// To end the wait for the end of the program that has the port.
    vigil: Mutex<Option<Arc<Kept<Stream>>>>,
}

fn end_vigil(connection: Option<Arc<Kept<Stream>>>) {
    if let Some(connection) = connection {
        // It may have ended already.
        let _ = connection.shutdown(Shutdown::Both);
    }
}

fn not_through_this(why: &std::io::Error) -> String {
    format!("other programs cannot use this port through this one: {why}")
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
            group: options.group,
            hello: Hello { program: own_name(), characters: Characters::of(&options.format), is_for_a_stop: false },
            port: OnceLock::new(),
            stats: Arc::clone(stats),
            openings: Arc::clone(openings),
            is_guest: AtomicBool::new(false),
            takes_over: AtomicBool::new(false),
            guest: Mutex::default(),
            host: Mutex::default(),
            guests: Arc::default(),
            left_out: AtomicU64::new(0),
            vigil: Mutex::default(),
        }
    }

    /// Opens the port by `open`, or finds who has it.
    fn opener(self: &Arc<Self>, open: Opener) -> Opener {
        let sharing = Arc::clone(self);
        let mut open = self.telling(open);
        Box::new(move || sharing.open(&mut open))
    }

    /// `open`, which tells who is in that the port was opened again, before anything is asked over it.
    fn telling(self: &Arc<Self>, mut open: Opener) -> Opener {
        let sharing = Arc::clone(self);
        Box::new(move || {
            let line = open()?;
            let reconnects = sharing.stats.lock().unwrap_or_else(PoisonError::into_inner).reconnects;
            sharing.guests.reopened(reconnects);
            Ok(line)
        })
    }

    /// The line; or an error, and a [`guest`](Self::guest) where another program serves the port.
    ///
    /// Who serves it is asked for before the port is opened: what keeps others out is not known everywhere. A container has a
    /// node of its own for a device, whose lock is another one; and a serial server may serve one client only, the last.
    fn open(self: &Arc<Self>, open: &mut Opener) -> Result<Box<dyn Line>, PortError> {
        let places = match Place::all(self.key.names(), self.group) {
            Ok(places) if places.is_empty() => return open(), // it says what is wrong with the port
            Ok(places) => places,
            Err(error) => return self.open_alone(open, &error),
        };
        let turns: std::io::Result<Vec<_>> = places.iter().map(Place::turn).collect();
        let _turns = match turns {
            Ok(turns) => turns,
            Err(error) => return self.open_alone(open, &error),
        };
        let end = monotonic() + LETS_GO;
        loop {
            let before = self.openings.with_one_now();
            // Behind a door of this bus's own stands this bus, which has lost the port.
            let others = places.iter().filter(|place| !self.serves_at(place));
            let knocked = others.map(|place| Guest::knock(place, &self.hello, before));
            let mut is_going = false;
            let mut silent = None;
            for knocked in knocked {
                match knocked {
                    Knocked::Open(guest) => {
                        self.comes_in(*guest);
                        return Err(self.busy("it is taken".to_owned()));
                    }
                    Knocked::SentAway(why) => return Err(self.busy(why)),
                    Knocked::Silent(why) => silent = Some(why),
                    Knocked::Gone => is_going = true,
                    Knocked::Absent => {}
                }
            }
            // Without a lock nobody else would say that the port is taken.
            if let Some(why) = silent.take_if(|_| !self.key.locks()) {
                return Err(self.busy(why));
            }
            match open() {
                Ok(line) => {
                    self.has_opened(line.connected_to());
                    return Ok(line);
                }
                Err(error) if matches!(error.kind, PortErrorKind::Busy | PortErrorKind::Denied) => match silent {
                    Some(message) => return Err(PortError { message, ..error }),
                    None if is_going && monotonic() < end => thread::sleep(STEP),
                    None => return Err(error),
                },
                Err(error) => return Err(error),
            }
        }
    }

    fn serves_at(&self, place: &Place) -> bool {
        self.serving().host.as_ref().is_some_and(|host| host.is_at(place))
    }

    fn busy(&self, why: String) -> PortError {
        PortError::new(PortErrorKind::Busy, self.key.to_string(), why)
    }

    /// Opens the port where nobody could be met over it.
    fn open_alone(&self, open: &mut Opener, why: &std::io::Error) -> Result<Box<dyn Line>, PortError> {
        self.serving().refused = Some(not_through_this(why));
        open()
    }

    fn comes_in(self: &Arc<Self>, guest: Guest) {
        self.serves_no_more();
        self.openings.open_elsewhere();
        self.takes_over.store(false, Ordering::Release);
        *self.guest.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(guest));
        self.is_guest.store(true, Ordering::Release);
        self.begin_to_wait();
    }

    /// Waits for the end of the program that has the port, in a thread of its own: who asks for nothing would not notice it,
    /// and nobody might halt what that program ran.
    fn begin_to_wait(self: &Arc<Self>) {
        let (Some(port), Some(guest)) = (self.port.get(), self.guest()) else { return };
        let (port, sharing) = (Weak::clone(port), Arc::downgrade(self));
        let both = move || Some((port.upgrade()?, sharing.upgrade()?));
        // Without a thread the next request notices it.
        let _ = thread::Builder::new().name("drivebus-waits".to_owned()).spawn(move || {
            loop {
                match guest.waits() {
                    Wait::Kept(mut vigil) => {
                        if !both().is_some_and(|(_, sharing)| sharing.keeps(&vigil, &guest)) {
                            return;
                        }
                        vigil.keep(&guest);
                    }
                    Wait::Ended => {}
                    Wait::Impossible => return,
                }
                if !both().is_some_and(|(port, sharing)| sharing.inherit(&port, &guest)) {
                    return;
                }
                thread::sleep(LOOKS);
            }
        });
    }

    /// Whether `vigil` at the program of `guest` is to be kept, until this bus ends it.
    fn keeps(&self, vigil: &Vigil, guest: &Arc<Guest>) -> bool {
        let mut kept = self.vigil.lock().unwrap_or_else(PoisonError::into_inner);
        let is_wanted = self.guest().is_some_and(|now| Arc::ptr_eq(&now, guest));
        if is_wanted {
            end_vigil(kept.replace(vigil.connection()));
        }
        is_wanted
    }

    /// The port is open, and a connection to it ends at `peer` if it has such an end: that says which of its names it has.
    fn has_opened(&self, peer: Option<SocketAddr>) {
        match Place::own(self.key.name_of(peer).into_iter().collect(), self.group) {
            Ok(places) => places.into_iter().for_each(|place| self.open_door(place)),
            Err(error) => self.serving().refused = Some(not_through_this(&error)),
        }
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
                serving.refused = Some(not_through_this(&error));
                None
            }
        };
        self.begin_to_serve(&mut serving);
    }

    /// The port is made: others may come in.
    pub(super) fn serves(self: &Arc<Self>, port: &Arc<Port>) {
        self.port.get_or_init(|| Arc::downgrade(port));
        self.begin_to_serve(&mut self.serving());
        self.begin_to_wait();
    }

    fn begin_to_serve(&self, serving: &mut Serving) {
        let Some(port) = self.port.get() else { return };
        let Some((_, door)) = serving.at.take() else { return };
        match Host::open(door, Arc::clone(&self.guests), Weak::clone(port)) {
            Ok(host) => serving.host = Some(host),
            Err(error) => {
                serving.refused = Some(not_through_this(&error));
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

    /// Whether `gone` is the program through which the port was used last, and nobody opened it since.
    fn is_left_by(&self, gone: &Arc<Guest>) -> bool {
        match self.guest() {
            Some(guest) => Arc::ptr_eq(&guest, gone),
            None => self.takes_over.load(Ordering::Acquire),
        }
    }

    /// Takes the port over from a program that is gone or has closed it, if somebody has left a will: whose program is gone is
    /// halted, and whose program lives may have to be. Who asks for the port next would do that, and perhaps nobody does.
    ///
    /// Whether it is to be tried again later: nobody has left one yet, or the port cannot be opened.
    fn inherit(&self, port: &Port, gone: &Arc<Guest>) -> bool {
        if port.is_closed() || !self.is_left_by(gone) {
            return false;
        }
        if !is_any(gone.place()) {
            return true;
        }
        self.lost(gone);
        let Ok(turn) = port.queue.turn((Priority::Stop, None), &mut || port.is_shut()) else { return false };
        // Whoever was quicker has the port, and halts it: then this one is its guest.
        let opened = port.lock().prepare(&mut || port.is_shut());
        drop(turn);
        opened.is_err() && !self.is_guest()
    }

    /// Nobody is let in any more until the port is opened again, and who is in is told so. The port is closed by now.
    pub(super) fn serves_no_more(&self) {
        let mut serving = self.serving();
        (serving.host, serving.at) = (None, None);
        drop(serving);
        self.guests.end();
    }

    /// What the programs that come in through this one asked so far.
    pub(super) fn programs(&self) -> Vec<Program> {
        self.guests.counted()
    }

    /// So many pieces of what went over the line more were left out, since this program did not take them.
    pub(super) fn left_out(&self, count: u64) {
        self.left_out.fetch_add(count, Ordering::Relaxed);
    }

    /// What the user should know about it.
    pub(super) fn notes(&self) -> Vec<String> {
        let whose = match self.guest() {
            Some(guest) => Some(format!("{} has the port; requests go through it", guest.host())),
            None => self.serving().refused.clone(),
        };
        let left_out = self.left_out.load(Ordering::Relaxed);
        let gaps = (left_out > 0).then(|| {
            format!(
                "{left_out} pieces of what went over the line were not heard: this program did not take them in time"
            )
        });
        whose.into_iter().chain(self.guests.note()).chain(gaps).collect()
    }

    fn serving(&self) -> MutexGuard<'_, Serving> {
        self.host.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Ends for Sharing {
    fn end(&self) {
        self.serves_no_more();
        self.is_guest.store(false, Ordering::Release);
        *self.guest.lock().unwrap_or_else(PoisonError::into_inner) = None;
        end_vigil(self.vigil.lock().unwrap_or_else(PoisonError::into_inner).take());
    }
}
