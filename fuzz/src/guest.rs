//! Invariant: whatever a program says that comes in to a port of this one, the port stays right for its owner, each write that
//! goes out was wished for and goes out once, a connection that says nothing more ends, and no thread panics.
//!
//! The door is a real socket; the line behind it runs in virtual time, so that no time-out takes any.

use std::io::{Read, Write};
use std::net::Shutdown;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use drivebus_line::url::{Known, PortUrl};
use drivebus_line::{Bus, BusOptions, CallOptions, Line, PortError};
use drivebus_rtu::{Answer, Instant, Request, SerialFormat, UnitAddress};

use crate::oracle::sealed;
use crate::stream::Input;

const FORMAT: SerialFormat = SerialFormat::DEFAULT;
/// What unit 1 answers to every read.
const WORD: u16 = 0x01A0;
/// How long a connection may take to end, in real time: it must not hang. A guest that has begun a message has a second.
const PATIENCE: Duration = Duration::from_secs(30);
/// How long an answer is waited for, in real time, before the next message: there are wishes that last for ever.
const SOON: Duration = Duration::from_millis(200);
/// More messages than this in one input show nothing new.
const MESSAGES: usize = 16;
/// How every greeting begins, and the version. A host of another one lets nobody in, which ends each input that greets.
const GREETING: &[u8] = b"drivebus share \x09";
/// The first byte of the answer to a greeting that is of another version, or wants other characters.
const SENT_AWAY: u8 = 1;
/// The first byte of a wish that takes back what is under way.
const CANCEL: u8 = 8;
/// The first bytes of what is told while more is still to come: pieces of what is heard, that it waits, what was left out.
const MORE_COMES: [u8; 4] = [2, 3, 10, 11];

static PANICS: AtomicUsize = AtomicUsize::new(0);

/// See the file's first lines. The input: whether it is greeted rightly, then messages, each with its length before it; a
/// length of 255 has bytes behind it that are sent as they are. Until such bytes come, each message is answered before the
/// next is said, as a guest has to.
pub fn guest(data: &[u8]) {
    let (bus, wire) = host();
    let mut input = Input::new(data);
    let is_greeted = input.byte() & 1 == 1;
    let before = lock(&wire).writes;
    let mut guest = Guest::come_in();
    if is_greeted {
        guest.say(&framed(&greeting()));
        let told = guest.hear();
        assert!(
            told.is_none_or(|told| told.first() != Some(&SENT_AWAY)),
            "nothing is tried: the greeting is not the right one"
        );
    }
    for _ in 0..MESSAGES {
        if input.is_empty() {
            break;
        }
        match input.byte() {
            255 => {
                let count = usize::from(input.byte());
                guest.say(input.bytes(count));
                guest.in_step = false;
            }
            count => {
                let message = input.bytes(usize::from(count));
                guest.say(&framed(message));
                // Taking something back is not answered, and hearing the line tells something each time until it is over.
                let is_answered = guest.in_step && message.first().is_some_and(|&kind| kind != CANCEL);
                while is_answered
                    && guest.hear().is_some_and(|told| told.first().is_some_and(|kind| MORE_COMES.contains(kind)))
                {
                }
            }
        }
    }
    guest.leave();

    let mut read = None;
    let request = Request::read(0x2103, 1).unwrap_or(Request::echo(0));
    let result = bus.call(UnitAddress::MIN.into(), &request, CallOptions::new(), &mut || false, &mut |answer| {
        if let Answer::Read { words, .. } = answer {
            read = words.get(0);
        }
    });
    assert!(result.is_ok() && read == Some(WORD), "{result:?}: the owner read {read:04X?}");
    let writes = lock(&wire).writes - before;
    assert!(writes <= MESSAGES && (is_greeted || writes <= 1), "{writes} writes went out");
    assert_eq!(PANICS.load(Ordering::SeqCst), 0, "a thread panicked");
}

/// A program that comes in.
struct Guest {
    stream: UnixStream,
    /// Whether all that was said is messages, so that each is answered.
    in_step: bool,
}

impl Guest {
    fn come_in() -> Self {
        let stream = UnixStream::connect(socket()).unwrap_or_else(|error| unreachable!("nobody opens: {error}"));
        assert!(stream.set_read_timeout(Some(SOON)).is_ok());
        Self { stream, in_step: true }
    }

    /// Where the host has ended the connection already, there is nobody to say it to.
    fn say(&mut self, bytes: &[u8]) {
        let _ = self.stream.write_all(bytes);
    }

    /// The next message, `None` where the host ended the connection, or has not answered yet.
    fn hear(&mut self) -> Option<Vec<u8>> {
        let mut length = [0; 4];
        let mut body = Vec::new();
        let heard = self.stream.read_exact(&mut length).and_then(|()| {
            body.resize(usize::try_from(u32::from_le_bytes(length)).unwrap_or(0), 0);
            self.stream.read_exact(&mut body)
        });
        self.in_step &= heard.is_ok();
        heard.ok().map(|()| body)
    }

    /// Says that nothing more comes, and hears the rest.
    fn leave(mut self) {
        assert!(self.stream.set_read_timeout(Some(PATIENCE)).is_ok());
        let _ = self.stream.shutdown(Shutdown::Write);
        let rest = self.stream.read_to_end(&mut Vec::new());
        assert!(!rest.is_err_and(|error| error.kind() == std::io::ErrorKind::WouldBlock), "the connection hangs");
    }
}

/// A message with its length before it.
fn framed(body: &[u8]) -> Vec<u8> {
    let length = u32::try_from(body.len()).unwrap_or(u32::MAX);
    [&length.to_le_bytes(), body].concat()
}

/// The right greeting: a program called "f" that wants 19200 8E1.
fn greeting() -> Vec<u8> {
    let baud_rate = FORMAT.baud_rate();
    let varint = [(baud_rate & 0x7F | 0x80).to_le_bytes()[0], (baud_rate >> 7 & 0x7F | 0x80).to_le_bytes()[0]];
    let last = (baud_rate >> 14).to_le_bytes()[0];
    [GREETING, b"\x01f", &varint, &[last, 8, b'E', 1, 0]].concat()
}

/// The bus that all inputs come in to, and its line.
fn host() -> (Arc<Bus>, Arc<Mutex<Wire>>) {
    static HOST: OnceLock<(Arc<Bus>, Arc<Mutex<Wire>>)> = OnceLock::new();
    let (bus, wire) = HOST.get_or_init(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            PANICS.fetch_add(1, Ordering::SeqCst);
            before(info);
        }));
        let wire = Arc::new(Mutex::new(Wire::default()));
        let line = Answering(Arc::clone(&wire));
        let opener = Box::new(move || Ok(Box::new(line.clone()) as Box<dyn Line>));
        let key = PortUrl::parse(&format!("socket://{}", name()), &Known::default()).ok().and_then(|url| url.key());
        let bus = Bus::open_shared(opener, key, BusOptions::new(FORMAT), &mut || false);
        (Arc::new(bus.unwrap_or_else(|failure| unreachable!("this port always opens: {failure}"))), wire)
    });
    (Arc::clone(bus), Arc::clone(wire))
}

/// A server that no other process names.
fn name() -> String {
    format!("fuzz-{}:1", std::process::id())
}

/// Where programs come in: docs/sharing.md.
fn socket() -> PathBuf {
    let file = format!("server-{}.sock", name().replace(':', "-"));
    let run_time =
        std::env::var_os("DRIVEBUS_RUNTIME_DIR").map(|folder| PathBuf::from(folder).join("drivebus").join(&file));
    let others = std::fs::read_dir("/tmp").into_iter().flatten().flatten().map(|entry| entry.path().join(&file));
    run_time
        .into_iter()
        .chain(others)
        .find(|path| path.exists())
        .unwrap_or_else(|| unreachable!("the host has put {file} there"))
}

fn lock(wire: &Mutex<Wire>) -> std::sync::MutexGuard<'_, Wire> {
    wire.lock().unwrap_or_else(PoisonError::into_inner)
}

#[derive(Debug, Default)]
struct Wire {
    now: Instant,
    coming: Vec<u8>,
    writes: usize,
}

/// A line with unit 1, which answers reads and echoes, and takes writes.
#[derive(Debug, Clone)]
struct Answering(Arc<Mutex<Wire>>);

impl Line for Answering {
    fn now(&self) -> Instant {
        lock(&self.0).now
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let mut wire = lock(&self.0);
        wire.coming = match *bytes {
            [1, 3, _, _, high, low, ..] => {
                let count = u16::from_be_bytes([high, low]).min(125);
                let words = (0..count).flat_map(|_| WORD.to_be_bytes());
                let head = [1, 3, u8::try_from(2 * count).unwrap_or(0)];
                sealed(&head.into_iter().chain(words).collect::<Vec<u8>>())
            }
            [1, 6 | 8, ..] if bytes.len() == 8 => bytes.to_vec(),
            [1, 16, a, b, c, d, ..] => sealed(&[1, 16, a, b, c, d]),
            _ => Vec::new(),
        };
        wire.writes += usize::from(matches!(bytes.get(1), Some(6 | 16)));
        wire.now = wire.now + FORMAT.chars(u32::try_from(bytes.len()).unwrap_or(0));
        Ok(wire.now)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let mut wire = lock(&self.0);
        let came = std::mem::take(&mut wire.coming);
        if came.is_empty() {
            wire.now = wire.now.max(until);
            return Ok(0);
        }
        wire.now = wire.now + Duration::from_millis(1);
        buffer[..came.len()].copy_from_slice(&came);
        Ok(came.len())
    }

    fn sleep(&mut self, until: Instant) {
        let mut wire = lock(&self.0);
        wire.now = wire.now.max(until);
    }

    fn name(&self) -> String {
        String::from("answering")
    }

    fn is_virtual(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a guest that was let in is told first when it says `wish`.
    fn told(wish: &[u8]) -> Option<u8> {
        let (_bus, _wire) = host();
        let mut guest = Guest::come_in();
        assert!(guest.stream.set_read_timeout(Some(PATIENCE)).is_ok());
        guest.say(&framed(&greeting()));
        assert_eq!(guest.hear().and_then(|told| told.first().copied()), Some(0), "it is let in");
        guest.say(&framed(wish));
        let told = guest.hear().and_then(|told| told.first().copied());
        guest.leave();
        told
    }

    /// Wishes and what is told of them, by their places in the lists of crates/line/src/share/message.rs.
    #[test]
    fn what_the_seeds_say_is_understood() {
        let read = [0, 1, 5, 3, 0x21, 3, 0, 1, 0, 0x80, 0x94, 0xEB, 0xDC, 3, 0, 0, 0, 2, 2, 0, 0, 0, 0, 0];
        let [stats, link, word, reconnects, halts] = [3, 4, 5, 6, 9];
        assert_eq!(told(&read), Some(0), "an answer");
        assert_eq!(told(&[stats]), Some(5));
        assert_eq!(told(&[link, 1]), Some(6));
        assert_eq!(told(&[word]), Some(7));
        assert_eq!(told(&[reconnects]), Some(8));
        assert_eq!(told(&[halts, 1]), Some(12));
        assert_eq!(told(&[1, 1]), Some(4), "nothing was heard in a billionth of a second");
    }
}
