//! One connection: a thread that reads, and one at the desk, which asks the line and writes the answers.

use std::collections::BTreeMap;
use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::{Arc, OnceLock, Weak};
use std::time::Duration;

use drivebus_rtu::{ExceptionCode, Instant};

use crate::bus::Bus;
use crate::bus::errand::Errand;
use crate::bus::programs::Seat;
use crate::bus::workers::Running;
use crate::gateway::clients::{Place, Stream};
use crate::gateway::counts::Counts;
use crate::gateway::desk::{Desk, code_of, refused};
use crate::gateway::mailbox::{Found, Mail, Mailbox};
use crate::gateway::requests::{Asked, Requests};
use crate::gateway::rights::{Judged, judge};
use crate::gateway::together::{Asker, Together};
use crate::options::CallOptions;
use crate::system::clock::monotonic;

/// Requests of one connection on their way to the line.
pub(super) const IN_FLIGHT: usize = 16;
/// How long a request may take to come whole, and a client to take an answer.
const HURRY: Duration = Duration::from_secs(1);
/// How long a connection stays open that asks nothing.
const IDLE: Duration = Duration::from_secs(60);
/// Bytes of answers that the system keeps for a client which does not read: more than those of all its requests on their way.
#[cfg(unix)]
const UNREAD: usize = 16_384;
/// What is read at a time.
const CHUNK: usize = 4_096;

/// What both threads of a connection have.
pub(super) struct Connection {
    pub(super) bus: Weak<Bus>,
    pub(super) seat: Seat,
    pub(super) peer: SocketAddr,
    pub(super) place: Place,
    pub(super) within: Duration,
    pub(super) counts: Arc<Counts>,
    pub(super) together: Arc<Together>,
}

/// Serves the other end of `stream` to its end.
///
/// # Errors
///
/// The system's: it gives no thread.
pub(super) fn serve(connection: Connection, stream: Stream) -> std::io::Result<()> {
    // An answer is one small message, and its client waits for it.
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(HURRY))?;
    #[cfg(unix)]
    rustix::net::sockopt::set_socket_send_buffer_size(&**stream, UNREAD)?;
    let mailbox = Arc::new(Mailbox::default());
    let reader = Arc::clone(&stream);
    let letters = Arc::clone(&mailbox);
    std::thread::Builder::new().name("drivebus-tcp-in".to_owned()).spawn(move || {
        let why = read(&reader, &letters);
        letters.end(why);
    })?;
    let (letters, end) = (Arc::clone(&mailbox), Arc::clone(&stream));
    let desk = std::thread::Builder::new().name("drivebus-tcp".to_owned());
    let spawned = desk.spawn(move || {
        let desk = Desk::new(connection.within, IN_FLIGHT);
        let why = Clerk { connection, desk, on_their_way: BTreeMap::new() }.work(&stream, &letters);
        letters.end(why);
        // The reader waits there.
        let _ = stream.shutdown(Shutdown::Both);
    });
    if spawned.is_err() {
        mailbox.end(String::new());
        let _ = end.shutdown(Shutdown::Both);
    }
    spawned.map(drop)
}

/// Reads requests until the connection ends; why it does, for people, empty where the client ended it.
fn read(stream: &TcpStream, mailbox: &Mailbox) -> String {
    let mut requests = Requests::default();
    let mut bytes = [0; CHUNK];
    // When what is there began: the request that is not whole, or the time without one.
    let mut since = monotonic();
    loop {
        let limit = if requests.has_begun() { HURRY } else { IDLE };
        let left = (since + limit).saturating_duration_since(monotonic());
        let came = if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { read_within(stream, left, &mut bytes) };
        match came {
            Ok(0) => return String::new(),
            Ok(count) => {
                let now = monotonic();
                let had_begun = requests.has_begun();
                let mut asked_any = false;
                let mut is_heard = true;
                let taken = requests.take(&bytes[..count], |asked| {
                    asked_any = true;
                    is_heard = is_heard && mailbox.ask(asked, now);
                });
                if let Err(wrong) = taken {
                    return wrong.to_string();
                }
                if !is_heard {
                    return String::new();
                }
                if asked_any || !had_begun {
                    // From when this is read on: what the client had to wait for room is not its delay.
                    since = monotonic();
                }
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                if monotonic() < since + limit {
                    continue;
                }
                return if requests.has_begun() {
                    format!("a request that was not whole within {} s", HURRY.as_secs())
                } else {
                    format!("no request for {} s", IDLE.as_secs())
                };
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return String::new(),
        }
    }
}

fn read_within(mut stream: &TcpStream, left: Duration, bytes: &mut [u8]) -> std::io::Result<usize> {
    // The system takes no time-out below its own grain.
    stream.set_read_timeout(Some(left.max(Duration::from_millis(1))))?;
    stream.read(bytes)
}

/// Who is at the desk.
struct Clerk {
    connection: Connection,
    desk: Desk,
    on_their_way: BTreeMap<u64, OnItsWay>,
}

/// A request on its way to the line.
struct OnItsWay {
    asker: Arc<Asker>,
    /// `None`: it has ended already.
    running: Option<Running>,
}

impl Clerk {
    /// Asks and answers until the connection ends; why it does.
    fn work(mut self, stream: &TcpStream, mailbox: &Arc<Mailbox>) -> String {
        let why = loop {
            let message = match mailbox.next(self.desk.due()) {
                Found::Over(why) => break why,
                Found::Nothing => None,
                Found::Mail(Mail::Asked(asked, at)) => self.ask(&asked, at, mailbox),
                Found::Mail(Mail::Came(number, result)) => self.came(number, result.as_deref().map_err(|&code| code)),
            };
            let late = self.desk.late(monotonic());
            for (number, _) in &late {
                self.connection.counts.late();
                if let Some(way) = self.on_their_way.remove(number) {
                    self.take_back(&way);
                }
            }
            let mut all = message.into_iter().chain(late.into_iter().map(|(_, message)| message));
            if let Some(why) = all.find_map(|message| write(stream, &message).err()) {
                break why;
            }
        };
        for way in self.on_their_way.values() {
            self.take_back(way);
        }
        if !why.is_empty() {
            self.connection.counts.cut_off(self.connection.peer, &why);
        }
        why
    }

    /// Asks the line, or answers at once.
    fn ask(&mut self, asked: &Asked, at: Instant, mailbox: &Arc<Mailbox>) -> Option<Vec<u8>> {
        self.connection.place.asks(at);
        self.connection.counts.asked();
        let (destination, request) = match judge(asked.unit, &asked.pdu) {
            Judged::Asked(destination, request) => (destination, request),
            Judged::Wrong(code) => return Some(refused(asked, code)),
            Judged::Refused => {
                self.connection.counts.refused(self.connection.peer, asked);
                return Some(refused(asked, ExceptionCode::ILLEGAL_FUNCTION));
            }
        };
        let Some(bus) = self.connection.bus.upgrade().filter(|bus| !bus.is_closed()) else {
            return Some(refused(asked, ExceptionCode::GATEWAY_PATH_UNAVAILABLE));
        };
        let Some(number) = self.desk.take(asked, at) else {
            self.connection.counts.busy();
            return Some(refused(asked, ExceptionCode::BUSY));
        };
        let (together, counts) = (Arc::clone(&self.connection.together), Arc::clone(&self.connection.counts));
        let itself = together.wait((asked.unit, asked.pdu.clone()), Arc::clone(mailbox), number);
        // Who gets what this one reads, from when it has begun.
        let others: Arc<OnceLock<Vec<Arc<Asker>>>> = Arc::default();
        let (who, told, waiting) = (Arc::clone(&itself), Arc::clone(&others), Arc::clone(&together));
        let errand = Errand::new(destination, &request, CallOptions::new(), move |result| {
            let answered = result.map(|reply| reply.pdu).map_err(|error| code_of(&error));
            match told.get() {
                Some(askers) => askers.iter().for_each(|one| one.hear(answered.clone())),
                // It ended before its turn came.
                None if waiting.take_back(&who) => who.hear(answered),
                None => {}
            }
        });
        let (who, wanted) = (Arc::clone(&itself), errand.wanted());
        let errand = errand.of_program(self.connection.seat.program).beginning(move || {
            let askers = together.begin(&who, &wanted);
            counts.together(askers.len());
            !askers.is_empty() && others.set(askers).is_ok()
        });
        let running = bus.send(errand);
        self.on_their_way.insert(number, OnItsWay { asker: itself, running });
        None
    }

    /// What has not been sent is not sent any more.
    fn take_back(&self, way: &OnItsWay) {
        if self.connection.together.take_back(&way.asker)
            && let Some(running) = &way.running
        {
            running.abandon();
        }
    }

    /// The answer by what came; none where the client was answered before.
    fn came(&mut self, number: u64, result: Result<&[u8], ExceptionCode>) -> Option<Vec<u8>> {
        self.on_their_way.remove(&number);
        let message = self.desk.came(number, result)?;
        self.connection.counts.answered(result.is_ok());
        Some(message)
    }
}

/// Writes `message`; the error is why the connection ends.
fn write(mut stream: &TcpStream, message: &[u8]) -> Result<(), String> {
    stream.write_all(message).map_err(|error| match error.kind() {
        ErrorKind::WouldBlock | ErrorKind::TimedOut => {
            format!("an answer that was not taken within {} s", HURRY.as_secs())
        }
        // It has hung up.
        _ => String::new(),
    })
}
