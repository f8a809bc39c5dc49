//! Modbus TCP, served, and RTU over TCP or a pseudo-terminal: programs that speak it read the units of a line, in the queue
//! of the bus that has it.
//!
//! Each connection is a program of the queue: one that asks much takes no more turns than one that asks little, and a stop
//! goes before them all. What cannot be answered in time is answered by 0BH, and never afterwards for that transaction; what
//! is not sent by then, or when the client hangs up, is taken back. Only reads are let pass, unless the rules say otherwise.
//! Whoever commanded motion and is gone or silent has its motor halted.
//!
//! | room | what is in it |
//! | --- | --- |
//! | `asked`, `framing`, `requests` | what clients send, and how they are answered |
//! | `tcp_request`, `rtu_request` | one request, taken out of what comes |
//! | `network`, `rights` | what they may ask |
//! | `wear` | how often they may write what wears a drive |
//! | `commanders`, `silence` | who commanded motion, and is gone or silent: a dead man's switch |
//! | `desk` | what one of them has asked, and when it has to be answered |
//! | `clients` | how many there may be, and who gives way |
//! | `stream`, `terminal`, `openings` | what connects one: over the network, or a pseudo-terminal |
//! | `door`, `terminal_door` | where they come in |
//! | `audit`, `counts` | what they wrote, and what happened |
//! | `together` | reads that wait, and who waits for the same |
//! | `common`, `connection` | what all connections have in common, and one of them |
//! | `writing` | one write on its way |
//! | `mailbox`, `reader`, `clerk` | the two threads of each |
//!
//! Source: *Modbus Messaging on TCP/IP Implementation Guide* V1.0b, §3.1.3 and §4.4.

mod asked;
mod audit;
mod clerk;
mod clients;
mod commanders;
mod common;
mod connection;
mod counts;
mod desk;
mod door;
mod framing;
mod mailbox;
mod network;
#[cfg(target_os = "linux")]
mod openings;
mod reader;
mod requests;
mod rights;
mod rtu_request;
mod silence;
mod stream;
mod tcp_request;
#[cfg(target_os = "linux")]
mod terminal;
#[cfg(target_os = "linux")]
mod terminal_door;
mod together;
mod wear;
mod writing;

use std::fmt;
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, TcpStream, ToSocketAddrs as _};
#[cfg(target_os = "linux")]
use std::path::Path;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

pub use asked::{Asked, NotModbus};
pub use counts::GatewayStats;
pub use framing::Framing;
pub use network::{Network, NoNetwork};
pub use requests::Requests;
pub use rights::{Halts, Means, READS, Rights, Rule, WRITES, Writable};

use crate::bus::Bus;
use crate::gateway::audit::Audit;
use crate::gateway::clients::Clients;
use crate::gateway::commanders::Commanders;
use crate::gateway::common::{Common, Seen};
use crate::gateway::counts::Counts;
use crate::gateway::door::{Hall, TcpDoor};
#[cfg(target_os = "linux")]
use crate::gateway::terminal::Bell;
#[cfg(target_os = "linux")]
use crate::gateway::terminal_door::{Found, TerminalDoor};
use crate::gateway::wear::Wear;
use crate::system::inherited::Kept;
use crate::system::process::Process;

/// How long an answer may take, where nothing else is said.
pub const ANSWER_WITHIN: Duration = Duration::from_secs(1);
/// How long is waited for the connections, and for the thread at the door, when they are told to end.
const TO_END: Duration = Duration::from_secs(1);

/// How a gateway behaves.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct GatewayOptions {
    /// How long an answer may take.
    pub answer_within: Duration,
    /// What clients speak.
    pub framing: Framing,
    /// What clients may do.
    pub rights: Rights,
    /// What becomes of a motor whose client is gone or silent. Has to be said where clients may move one.
    pub dead_man: Option<DeadMan>,
    /// The file to which each write of a client is appended: a line of JSON.
    pub audit: Option<PathBuf>,
}

impl GatewayOptions {
    /// Sets [`answer_within`](Self#structfield.answer_within).
    #[must_use]
    pub fn answer_within(self, answer_within: Duration) -> Self {
        Self { answer_within, ..self }
    }

    /// Sets [`framing`](Self#structfield.framing).
    #[must_use]
    pub fn framing(self, framing: Framing) -> Self {
        Self { framing, ..self }
    }

    /// Sets [`rights`](Self#structfield.rights).
    #[must_use]
    pub fn rights(self, rights: Rights) -> Self {
        Self { rights, ..self }
    }

    /// Sets [`dead_man`](Self#structfield.dead_man).
    #[must_use]
    pub fn dead_man(self, dead_man: DeadMan) -> Self {
        Self { dead_man: Some(dead_man), ..self }
    }

    /// Sets [`audit`](Self#structfield.audit).
    #[must_use]
    pub fn audit(self, audit: impl Into<Option<PathBuf>>) -> Self {
        Self { audit: audit.into(), ..self }
    }
}

/// What becomes of a motor that a client commanded which is gone, or silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum DeadMan {
    /// It is halted when the client has hung up, or has asked nothing for so long.
    After(Duration),
    /// It runs on.
    Off,
}

impl Default for GatewayOptions {
    /// Answers within a second, reads only, no audit.
    fn default() -> Self {
        Self {
            answer_within: ANSWER_WITHIN,
            framing: Framing::Tcp,
            rights: Rights::default(),
            dead_man: None,
            audit: None,
        }
    }
}

/// Where a [`Gateway`] is found.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Address {
    /// Over the network.
    Tcp(SocketAddr),
    /// By programs of this computer: a link to a pseudo-terminal, which they open as a serial port.
    Terminal(PathBuf),
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tcp(address) => address.fmt(f),
            Self::Terminal(link) => link.display().fmt(f),
        }
    }
}

/// A server for Modbus TCP, or for RTU over TCP or a pseudo-terminal, before a [`Bus`], until it is dropped. It keeps the bus
/// from nothing: where that is closed, clients are told 0AH.
///
/// ```no_run
/// # fn example(bus: std::sync::Arc<drivebus_line::Bus>) -> std::io::Result<()> {
/// use drivebus_line::gateway::{Gateway, GatewayOptions};
///
/// let gateway = Gateway::open(&bus, "127.0.0.1:1502", GatewayOptions::default())?;
/// println!("reads are answered at {}", gateway.address());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Gateway {
    address: Address,
    clients: Arc<Clients>,
    counts: Arc<Counts>,
    audit: Arc<Audit>,
    is_closed: Arc<AtomicBool>,
    opened_by: Process,
    /// The thread at the door, until it is told to end.
    door: Mutex<Option<JoinHandle<()>>>,
    #[cfg(target_os = "linux")]
    closing: Option<Arc<Bell>>,
}

impl Gateway {
    /// Listens at `address`, such as `127.0.0.1:1502`; port 0 takes one that is free.
    ///
    /// # Errors
    ///
    /// The system's: the address is not one of this machine, is taken, or may not be listened at; the audit cannot be written.
    /// [`io::ErrorKind::InvalidInput`]: clients may move a motor, and nothing says what becomes of it when they are gone.
    pub fn open(bus: &Arc<Bus>, address: &str, options: GatewayOptions) -> io::Result<Self> {
        let hall = hall(bus, options)?;
        let addresses: Vec<SocketAddr> = address.to_socket_addrs()?.collect();
        let listener = Kept::new(TcpListener::bind(&addresses[..])?);
        let gateway = Self::behind(Address::Tcp(listener.local_addr()?), &hall);
        let door = TcpDoor { hall, listener, is_closed: Arc::clone(&gateway.is_closed) };
        gateway.begin("drivebus-tcp-door", move || door.stand())?;
        Ok(gateway)
    }

    /// Serves who opens a pseudo-terminal, which is found by `link` and speaks RTU whatever the framing of `options`: for
    /// programs that know serial ports alone. One program at a time has it open, of this user or of the group of the bus.
    /// Rules for networks see it at 127.0.0.1. Parity cannot be set on a pseudo-terminal: the program has to use none. Linux
    /// only.
    ///
    /// # Errors
    ///
    /// As of [`open`](Self::open). [`io::ErrorKind::AlreadyExists`]: something stands there that is no link to a
    /// pseudo-terminal.
    #[cfg(target_os = "linux")]
    pub fn open_terminal(bus: &Arc<Bus>, link: &Path, options: GatewayOptions) -> io::Result<Self> {
        let hall = hall(bus, options.framing(Framing::Rtu))?;
        let (group, baud_rate) = (bus.options().group, bus.options().format.baud_rate());
        let found = Found::new(link, baud_rate, group)?;
        let closing = Arc::new(Bell::new()?);
        let mut gateway = Self::behind(Address::Terminal(link.to_owned()), &hall);
        gateway.closing = Some(Arc::clone(&closing));
        let door = TerminalDoor { hall, found, name: link.display().to_string(), closing };
        gateway.begin("drivebus-pty-door", move || door.stand())?;
        Ok(gateway)
    }

    fn behind(address: Address, hall: &Hall) -> Self {
        Self {
            address,
            clients: Arc::clone(&hall.clients),
            counts: Arc::clone(&hall.common.counts),
            audit: Arc::clone(&hall.common.audit),
            is_closed: Arc::default(),
            opened_by: Process::current(),
            door: Mutex::default(),
            #[cfg(target_os = "linux")]
            closing: None,
        }
    }

    fn begin(&self, name: &str, stand: impl FnOnce() + Send + 'static) -> io::Result<()> {
        let standing = thread::Builder::new().name(name.to_owned()).spawn(stand)?;
        *self.door.lock().unwrap_or_else(PoisonError::into_inner) = Some(standing);
        Ok(())
    }

    /// Where it is found.
    pub const fn address(&self) -> &Address {
        &self.address
    }

    /// What has happened so far.
    pub fn stats(&self) -> GatewayStats {
        self.counts.stats(self.clients.count())
    }

    /// What was refused or cut off since this was asked last, in words: the latest 256.
    pub fn take_told(&self) -> Vec<String> {
        self.counts.take_told()
    }

    /// Ends all connections, and listens no more. What clients asked and is not sent is taken back. Closing again does nothing.
    pub fn close(&self) {
        // In a forked child none of it is there.
        if self.opened_by.is_current() && !self.is_closed.swap(true, Ordering::AcqRel) {
            self.clients.close(TO_END);
            let standing = self.door.lock().unwrap_or_else(PoisonError::into_inner).take();
            if self.is_heard_at_the_door()
                && let Some(standing) = standing
            {
                // One that panicked stands there no more either.
                let _ = standing.join();
            }
            // Whoever closes it reads what its clients wrote.
            self.audit.settle(TO_END);
        }
    }

    /// Wakes who stands at the door; false: that cannot be, and nobody has to be kept out.
    fn is_heard_at_the_door(&self) -> bool {
        #[cfg(target_os = "linux")]
        if let Some(closing) = &self.closing {
            closing.ring();
            return true;
        }
        match self.address {
            Address::Tcp(address) => TcpStream::connect_timeout(&reachable(address), TO_END).is_ok(),
            Address::Terminal(_) => false,
        }
    }
}

impl Drop for Gateway {
    fn drop(&mut self) {
        self.close();
    }
}

/// What is behind the door of a gateway that behaves as `options` say.
fn hall(bus: &Arc<Bus>, options: GatewayOptions) -> io::Result<Hall> {
    let GatewayOptions { answer_within: within, framing, rights, dead_man, audit } = options;
    if rights.moves_any() && dead_man.is_none() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "clients may move a motor, and nothing says what becomes of it when they are gone",
        ));
    }
    let counts = Arc::<Counts>::default();
    let tells = Arc::clone(&counts);
    let audit = audit.map(|path| Audit::open(&path, move |why| tells.tell(why))).transpose()?.unwrap_or_default();
    let common = Common {
        bus: Arc::downgrade(bus),
        within,
        framing,
        rights,
        dead_man: match dead_man {
            Some(DeadMan::After(silence)) => Some(silence),
            Some(DeadMan::Off) | None => None,
        },
        audit: Arc::new(audit),
        counts,
        together: Arc::default(),
        wear: Wear::default(),
        commanders: Commanders::default(),
        seen: Seen::default(),
    };
    Ok(Hall { common: Arc::new(common), clients: Arc::default() })
}

/// Where this machine reaches what listens at `address`.
fn reachable(address: SocketAddr) -> SocketAddr {
    let ip = match address.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => Ipv4Addr::LOCALHOST.into(),
        IpAddr::V6(ip) if ip.is_unspecified() => Ipv6Addr::LOCALHOST.into(),
        ip => ip,
    };
    SocketAddr::new(ip, address.port())
}
