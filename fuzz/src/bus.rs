//! Invariant: on a line that does whatever the input says, a call ends within its bound, a read tells only words that a
//! valid frame carried after the read was last sent, a write goes out at most once, and what is said not to have been
//! sent was not sent.
//!
//! In virtual time. The line answers everything that the bus sends, its own probes included, as the input says.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_line::{Bus, BusOptions, CallOptions, Line, PortError, PortErrorKind};
use drivebus_rtu::{Answer, AnswerLength, Destination, Instant, Request, SerialFormat, UnitAddress};

use crate::master::{pdu_of, pdu_told};
use crate::oracle::{self, Asked, Length, Verdict};
use crate::stream::{Input, Lumps};

const FORMAT: SerialFormat = SerialFormat::DEFAULT;
const TIMEOUT: Duration = Duration::from_millis(50);
/// No call may take longer: three attempts, each with probes before it, on a line that is busy all the time.
const BOUND: Duration = Duration::from_secs(10);

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
    }));
    let line = Scripted(Arc::clone(&wire));
    let opener = Box::new(move || Ok(Box::new(line.clone()) as Box<dyn Line>));
    let options = BusOptions { timeout: TIMEOUT, ..BusOptions::new(FORMAT) };
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
    let asked = Asked {
        pdu: pdu_of(&request),
        length: match kind & 7 {
            6 => Length::Any,
            7 => Length::Given(2),
            _ => Length::Named,
        },
    };
    let frame = oracle::sealed(&[&[destination.to_wire()], &asked.pdu[..]].concat());
    let (start, before) = {
        let wire = lock(wire);
        (wire.now, wire.sent.len())
    };
    let mut give_up = || {
        assert!(lock(wire).now < start + BOUND, "no end to {asked:?}");
        false
    };
    let mut told = Vec::new();
    let options = CallOptions::default();
    let result = bus.call(destination, &request, options, &mut give_up, &mut |answer: Answer<'_>| {
        told.push(pdu_told(&answer));
    });

    let wire = lock(wire);
    assert!(wire.now < start + BOUND, "late: {asked:?}");
    let copies: Vec<usize> =
        wire.sent[before..].iter().filter(|(sent, _)| *sent == frame).map(|(_, heard)| *heard).collect();
    // An echo is what the bus sends by itself too, and a read of one word is how it looks for an adapter's echo.
    let its_own = matches!(kind & 7, 0..=2 | 5);
    match (&result, destination) {
        (Ok(_), Destination::Broadcast) => assert!(told.is_empty() && !copies.is_empty()),
        (Ok(_), Destination::Unit(unit)) => {
            let [pdu] = &told[..] else {
                unreachable!("{told:02X?}: an answer is told once");
            };
            assert_eq!(asked.judge(pdu), Verdict::Right);
            let answer = oracle::sealed(&[&[unit.get()], &pdu[..]].concat());
            let since = copies.last().copied().unwrap_or(wire.heard.len());
            let heard = &wire.heard[since..];
            assert!(heard.windows(answer.len()).any(|part| part == answer), "{answer:02X?} told, {heard:02X?} came");
        }
        (Err(error), _) => {
            assert!(!error.to_string().is_empty() && told.is_empty());
            assert!(error.sent.is_some() || copies.is_empty() || its_own, "{error}: it was sent");
            assert!(error.sent.is_none() || !copies.is_empty(), "{error}: it was not sent");
        }
    }
    assert!(copies.len() <= 1 || its_own, "{} times {frame:02X?}", copies.len());
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
}

impl Wire {
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
