//! A port that one process at a time can open, on every system, and a unit behind it whose words are their own addresses.

use std::env;
use std::net::{Ipv4Addr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use drivebus_line::clock::{monotonic, sleep_until};
use drivebus_line::url::{Known, PortUrl};
use drivebus_line::{
    AdapterEcho, Bus, BusOptions, CallError, CallOptions, Failure, Line, Opener, PortError, PortErrorKind,
};
use drivebus_rtu::{Answer, Instant, Request, SerialFormat, UnitAddress, crc16};

/// Says at which address whoever has the port listens: the system gives it to one, until that one is gone.
pub(crate) const PORT: &str = "DRIVEBUS_TESTS_PORT";
/// A device of this name is there, and nobody opens it.
const NAME: &str = if cfg!(windows) { "COM250" } else { "/dev/null" };
/// How many reads this process sent.
static SENT: AtomicUsize = AtomicUsize::new(0);

/// An address at which nobody listens.
pub(crate) fn unused() -> u16 {
    TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap().port()
}

/// How many reads this process has sent.
pub(crate) fn sent() -> usize {
    SENT.load(Ordering::SeqCst)
}

#[derive(Debug)]
struct Addresses {
    _taken: TcpListener,
    answer: Vec<u8>,
}

impl Line for Addresses {
    fn now(&self) -> Instant {
        monotonic()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let &[unit, 3, high, low, _, count, ..] = bytes else {
            // Something else than a read: what is only written, and echoes.
            self.answer = bytes.to_vec();
            return Ok(monotonic());
        };
        SENT.fetch_add(1, Ordering::SeqCst);
        let first = u16::from_be_bytes([high, low]);
        let words = (first..).take(usize::from(count)).flat_map(u16::to_be_bytes);
        let body: Vec<u8> = [unit, 3, 2 * count].into_iter().chain(words).collect();
        self.answer = [&body[..], &crc16(&body).to_le_bytes()].concat();
        Ok(monotonic())
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        if self.answer.is_empty() {
            sleep_until(until);
        }
        let count = self.answer.len().min(buffer.len());
        buffer[..count].copy_from_slice(&self.answer[..count]);
        self.answer.drain(..count);
        Ok(count)
    }

    fn sleep(&mut self, until: Instant) {
        sleep_until(until);
    }

    fn name(&self) -> String {
        NAME.to_owned()
    }
}

fn opener() -> Opener {
    let port: u16 = env::var(PORT).unwrap().parse().unwrap();
    Box::new(move || {
        let taken = TcpListener::bind((Ipv4Addr::LOCALHOST, port));
        let taken = taken.map_err(|error| PortError::new(PortErrorKind::Busy, NAME, error.to_string()))?;
        Ok(Box::new(Addresses { _taken: taken, answer: Vec::new() }))
    })
}

pub(crate) fn options() -> BusOptions {
    BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent).timeout(Duration::from_secs(20))
}

pub(crate) fn open_as(options: BusOptions) -> Result<Arc<Bus>, Failure> {
    let key = PortUrl::parse(NAME, &Known::default()).unwrap().key();
    Bus::open_shared(opener(), key, options, &mut || false).map(Arc::new)
}

pub(crate) fn open() -> Arc<Bus> {
    open_as(options()).unwrap()
}

/// The word at `address`.
pub(crate) fn read(bus: &Bus, address: u16) -> Result<u16, Box<CallError>> {
    let mut word = None;
    let unit = UnitAddress::new(1).unwrap();
    let request = Request::read(address, 1).unwrap();
    bus.call(unit.into(), &request, CallOptions::new(), &mut || false, &mut |answer| {
        if let Answer::Read { words, .. } = answer {
            word = words.iter().next();
        }
    })?;
    Ok(word.unwrap())
}
