//! Invariant: on a line that does whatever the input says, a call ends within its bounds of time and of requests, a read
//! tells only words that a valid frame carried after the read was last sent, a write goes out at most once, and what is said
//! not to have been sent was not sent.
//!
//! In virtual time. The line answers everything that the bus sends, its own probes included, as the input says.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_line::{Bus, BusOptions, CallOptions, Line, PortError, PortErrorKind};
use drivebus_rtu::{Answer, AnswerLength, Destination, FIRST_CONTACT, Instant, Request, SerialFormat, UnitAddress};

use crate::oracle::{self, Asked, Length, Verdict};
use crate::stream::{Input, Lumps};
use crate::told::{pdu_of, pdu_told};

const FORMAT: SerialFormat = SerialFormat::DEFAULT;
const TIMEOUT: Duration = Duration::from_millis(50);
/// What a call may take beside waiting for what others asked before the line was opened: three attempts of 50 ms, each
/// with an echo, another read and a full line's silence before it.
const WORK: Duration = Duration::from_secs(1);
/// It is also waited for what may still overtake.
const OVERTAKEN: Duration = Duration::from_secs(9);
/// Requests of one call: eight for each of three times that it may ask.
const REQUESTS: usize = 24;

/// See the file's first lines. The input: up to eight calls of six bytes, then what comes after each transmission.
pub fn bus(data: &[u8]) {
    let mut input = Input::new(data);
    let how = input.byte();
    let calls: Vec<[u8; 6]> = (0..=(how & 7)).map(|_| std::array::from_fn(|_| input.byte())).collect();
    let wire = Arc::new(Mutex::new(Wire {
        now: Instant::ZERO,
        busy: Instant::ZERO,
        script: input.bytes(usize::MAX).to_vec(),
        read: 0,
        lumps: Lumps::default(),
        coming: VecDeque::new(),
        sent: Vec::new(),
        heard: Vec::new(),
        lost: false,
        may_echo: how & 8 != 0,
        opened: 0,
    }));
    let line = Scripted(Arc::clone(&wire));
    let opener = Box::new(move || {
        lock(&line.0).opened += 1;
        Ok(Box::new(line.clone()) as Box<dyn Line>)
    });
    let options = BusOptions::new(FORMAT).timeout(TIMEOUT);
    let Ok(bus) = Bus::open(opener, options, &mut || false) else {
        unreachable!("this port always opens");
    };
    for call in calls {
        ask(&bus, &wire, call);
    }
}

fn lock(wire: &Mutex<Wire>) -> MutexGuard<'_, Wire> {
    wire.lock().unwrap_or_else(PoisonError::into_inner)
}

/// One call, judged by what was on the wire.
fn ask(bus: &Bus, wire: &Mutex<Wire>, [kind, unit, a1, a0, v1, v0]: [u8; 6]) {
    let (address, value) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([v1, v0]));
    let words: Vec<u16> = (0..=value % 8).map(|n| n ^ address).collect();
    let custom = [0x41, a0];
    let request = match kind & 7 {
        0..=2 => Request::read(address, 1 + value % 8),
        3 => Ok(Request::write(address, value)),
        4 => Request::write_many(address, &words),
        5 => Ok(Request::echo(value)),
        6 => Request::custom(&custom, AnswerLength::BySilence),
        _ => Request::custom(&custom, AnswerLength::Bytes(2)),
    };
    let (Ok(request), Ok(unit)) = (request, UnitAddress::new(1 + unit % 3)) else { return };
    let destination = if kind & 0xF0 == 0xF0 { Destination::Broadcast } else { Destination::Unit(unit) };
    let twice = kind & 8 != 0 && destination != Destination::Broadcast;
    let is_read = kind & 7 < 3;
    let read_back = (twice && matches!(kind & 7, 3 | 4)).then_some(address);
    let options = CallOptions::new().in_doubt(kind & 0xF0 == 0xE0).verify(twice && is_read).read_back(read_back);
    let length = match kind & 7 {
        6 => Length::Any,
        7 => Length::Given(2),
        _ => Length::Named,
    };
    let asked = Asked { pdu: pdu_of(&request), length };
    let frame = oracle::sealed(&[&[destination.to_wire()], &asked.pdu[..]].concat());
    let (start, before, opened) = {
        let wire = lock(wire);
        (wire.now, wire.sent.len(), wire.opened)
    };
    let in_time = |wire: &Wire| {
        let bound = FIRST_CONTACT * (1 + wire.opened - opened) + WORK + OVERTAKEN;
        assert!(wire.now < start + bound, "no end to {asked:?}");
    };
    let mut give_up = || {
        in_time(&lock(wire));
        false
    };
    let mut told = Vec::new();
    let result = bus.call(destination, &request, options, &mut give_up, &mut |answer: Answer<'_>| {
        told.push(pdu_told(&answer));
    });

    let wire = lock(wire);
    in_time(&wire);
    assert!(wire.sent.len() - before <= REQUESTS, "{} requests for {asked:?}", wire.sent.len() - before);
    // A read may be put in a longer form.
    let is_mine = |sent: &[u8]| sent == frame || (is_read && is_longer(sent, &frame));
    let copies: Vec<usize> =
        wire.sent[before..].iter().filter(|(sent, _)| is_mine(sent)).map(|(_, heard)| *heard).collect();
    // An echo is what the bus sends by itself too, and a read is how it looks whether an adapter echoes.
    let its_own = is_read || kind & 7 == 5;
    // What a request in doubt told is taken back where the adapter turns out to have sent it.
    assert!(told.len() <= 1 || options.in_doubt, "{told:02X?}: an answer is told once");
    match (&result, destination, told.last()) {
        (Ok(_), Destination::Broadcast, told) => assert!(told.is_none() && !copies.is_empty()),
        (Ok(_), Destination::Unit(unit), told) => {
            let came = |pdu: &[u8]| wire.came(&oracle::sealed(&[&[unit.get()], pdu].concat()), copies.last());
            let data = written(&request);
            let shown = [&[3, u8::try_from(data.len()).unwrap_or(0)], &data[..]].concat();
            // What is read back may be asked for in a longer form too.
            let is_shown = read_back.is_some() && (came(&shown) || wire.came_longer(unit, &shown, copies.last()));
            let is_told = |pdu: &[u8]| came(pdu) || (is_read && wire.came_longer(unit, pdu, copies.last()));
            assert!(is_shown || told.is_some_and(|pdu| is_told(pdu)), "{told:02X?} told, {:02X?} came", wire.heard);
            assert!(told.is_none_or(|pdu| asked.judge(pdu) == Verdict::Right), "{told:02X?} is no answer");
            assert!(!options.verify || copies.len() > 1, "{told:02X?} told, and asked once");
        }
        (Err(error), _, told) => {
            assert!(!error.to_string().is_empty() && (told.is_none() || options.in_doubt), "{error}: {told:02X?} told");
            assert!(error.sent.is_some() || copies.is_empty() || its_own, "{error}: it was sent");
            assert!(error.sent.is_none() || !copies.is_empty(), "{error}: it was not sent");
        }
    }
    assert!(copies.len() <= 1 || its_own || read_back.is_some(), "{} times {frame:02X?}", copies.len());
    // A write is repeated only where the unit showed other words since.
    if !its_own {
        let mine = written(&request);
        let others = |pair: &[usize]| wire.shows_other(unit, &mine, pair[0], pair[1]);
        assert!(copies.windows(2).all(others), "{frame:02X?} repeated blindly");
    }
}

/// Whether `sent` reads from the same register of the same unit as `frame`, and more words.
fn is_longer(sent: &[u8], frame: &[u8]) -> bool {
    sent.len() == frame.len() && sent[..4] == frame[..4] && sent[4..6] > frame[4..6]
}

/// The data of the answer that shows what `request` writes.
fn written(request: &Request<'_>) -> Vec<u8> {
    match *request {
        Request::WriteSingle { value, .. } => value.to_be_bytes().to_vec(),
        Request::WriteMultiple { words, .. } => words.iter().flat_map(u16::to_be_bytes).collect(),
        _ => Vec::new(),
    }
}

/// What is on the wire, and when.
struct Wire {
    now: Instant,
    busy: Instant,
    script: Vec<u8>,
    read: usize,
    lumps: Lumps,
    coming: VecDeque<(Instant, Vec<u8>)>,
    /// What the bus sent, and how much it had heard by then.
    sent: Vec<(Vec<u8>, usize)>,
    heard: Vec<u8>,
    /// The next receiving finds the port gone.
    lost: bool,
    may_echo: bool,
    /// How often the line was opened.
    opened: u32,
}

impl Wire {
    /// Whether `frame` came since `since` bytes had been heard; not if that was never.
    fn came(&self, frame: &[u8], since: Option<&usize>) -> bool {
        since.is_some_and(|&since| self.heard[since..].windows(frame.len()).any(|part| part == frame))
    }

    /// Whether a longer answer of `unit` came since then that begins with the words of `pdu`.
    fn came_longer(&self, unit: UnitAddress, pdu: &[u8], since: Option<&usize>) -> bool {
        let words = pdu.get(2..).unwrap_or_default();
        let begins = |part: &[u8]| {
            matches!(*part, [from, 3, count, ref rest @ ..] if from == unit.get() && rest.starts_with(words)
                && part.get(..usize::from(count) + 5).is_some_and(|whole| oracle::frame(whole).is_some()))
        };
        since.is_some_and(|&since| (since..self.heard.len()).any(|from| begins(&self.heard[from..])))
    }

    /// Whether `unit` showed as many bytes of registers as `data` has or more, but others, between two moments.
    fn shows_other(&self, unit: UnitAddress, data: &[u8], from: usize, to: usize) -> bool {
        let shows = |part: &[u8]| match *part {
            [by, 3, count, ref rest @ ..] if by == unit.get() && usize::from(count) >= data.len() => {
                part.get(..usize::from(count) + 5).is_some_and(|whole| oracle::frame(whole).is_some())
                    && !rest.starts_with(data)
            }
            _ => false,
        };
        (from..to).any(|start| shows(&self.heard[start..to]))
    }

    /// What comes after a transmission that ends at `end`.
    fn plan(&mut self, end: Instant) {
        let mut input = Input::new(&self.script[self.read..]);
        let sent: Vec<Vec<u8>> = self.sent.iter().map(|(frame, _)| frame.clone()).collect();
        let head = input.byte();
        self.lost = head >= 0xF8;
        let mut at = end;
        for _ in 0..head & 3 {
            for arrival in self.lumps.next(&mut input, &sent) {
                at = at + arrival.gap;
                let place = self.coming.partition_point(|(other, _)| *other <= at);
                self.coming.insert(place, (at, arrival.bytes));
            }
        }
        self.read = self.script.len() - input.len();
    }
}

/// A line on a wire that the target holds too.
#[derive(Clone)]
struct Scripted(Arc<Mutex<Wire>>);

impl std::fmt::Debug for Scripted {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Scripted")
    }
}

impl Line for Scripted {
    fn now(&self) -> Instant {
        lock(&self.0).now
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let mut wire = lock(&self.0);
        assert!(oracle::frame(bytes).is_some(), "{bytes:02X?} sent");
        let unread = wire.coming.iter().any(|(at, bytes)| *at <= wire.now && !bytes.is_empty());
        assert!(!unread && wire.now >= wire.busy + FORMAT.t35(), "silence was broken at {:?}", wire.now);
        let end = wire.now + FORMAT.chars(u32::try_from(bytes.len()).unwrap_or(0));
        let heard = wire.heard.len();
        wire.busy = end;
        wire.sent.push((bytes.to_vec(), heard));
        wire.plan(end);
        Ok(end)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let mut wire = lock(&self.0);
        if std::mem::take(&mut wire.lost) {
            wire.coming.clear();
            return Err(PortError::new(PortErrorKind::Lost, "script", "pulled out"));
        }
        while let Some((at, mut bytes)) = wire.coming.pop_front() {
            if at > until.max(wire.now) {
                wire.coming.push_front((at, bytes));
                break;
            }
            wire.now = wire.now.max(at);
            if bytes.is_empty() {
                continue;
            }
            // What comes while the bus sends shows, on a line that nobody paces, that the request has left already.
            wire.busy = wire.now;
            let rest = bytes.split_off(bytes.len().min(buffer.len()));
            buffer[..bytes.len()].copy_from_slice(&bytes);
            wire.heard.extend_from_slice(&bytes);
            if !rest.is_empty() {
                wire.coming.push_front((at, rest));
            }
            return Ok(bytes.len());
        }
        wire.now = wire.now.max(until);
        Ok(0)
    }

    fn sleep(&mut self, until: Instant) {
        let mut wire = lock(&self.0);
        wire.now = wire.now.max(until);
    }

    fn name(&self) -> String {
        String::from("script")
    }

    fn is_virtual(&self) -> bool {
        true
    }

    fn may_echo(&self) -> bool {
        lock(&self.0).may_echo
    }
}
