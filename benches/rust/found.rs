//! How often a right answer is found on a line in trouble, with how many requests, and how quickly: in virtual time, so that
//! the figures are those of the protocol and not of a machine.
//!
//! `cargo run --release -p drivebus-benches --example found`
//!
//! Each row is a trouble that every answer has; each cell asks twenty times for two words, then writes once. A call that
//! sends more than 400 requests is given up.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a measurement may panic, and prints")]

use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus_line::{Bus, BusOptions, CallOptions, Line, LineClock, PortError};
use drivebus_rtu::{Adu, Answer, ExceptionCode, Frame, Instant, Request, SerialFormat, UnitAddress};

const FORMAT: SerialFormat = SerialFormat::DEFAULT;
const READS: u16 = 20;
const MOST: usize = 400;

/// What a unit makes of 08H.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Echo {
    Returned,
    Refused,
    Unheard,
}

/// What becomes of a right answer: pieces, and how long after the earliest moment each is there.
type Trouble = fn(&mut Chance, Vec<u8>) -> Vec<(Duration, Vec<u8>)>;

/// Numbers that are the same in each run.
struct Chance(u32);

impl Chance {
    fn next(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0 >> 8
    }

    fn below(&mut self, limit: usize) -> usize {
        usize::try_from(self.next()).unwrap() % limit
    }

    fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.next().to_le_bytes()[0]).collect()
    }
}

fn at_once(bytes: Vec<u8>) -> Vec<(Duration, Vec<u8>)> {
    vec![(Duration::ZERO, bytes)]
}

fn behind(noise: Vec<u8>, answer: Vec<u8>) -> Vec<(Duration, Vec<u8>)> {
    at_once([noise, answer].concat())
}

fn followed(spoilt: Vec<u8>, right: Vec<u8>) -> Vec<(Duration, Vec<u8>)> {
    let after = FORMAT.chars(u32::try_from(spoilt.len()).unwrap()) + Duration::from_millis(5);
    vec![(Duration::ZERO, spoilt), (after, right)]
}

const TROUBLES: [(&str, Trouble); 13] = [
    ("none", |_, answer| at_once(answer)),
    ("3 bytes 00 before", |_, answer| behind(vec![0; 3], answer)),
    ("30 bytes FF before", |_, answer| behind(vec![0xFF; 30], answer)),
    ("3 random bytes before", |chance, answer| behind(chance.bytes(3), answer)),
    ("10 random bytes before", |chance, answer| behind(chance.bytes(10), answer)),
    ("30 random bytes before", |chance, answer| behind(chance.bytes(30), answer)),
    ("01 03 01 03 before", |_, answer| behind(vec![1, 3, 1, 3], answer)),
    ("01 03 04 00 01 before", |_, answer| behind(vec![1, 3, 4, 0, 1], answer)),
    ("one byte lost, always", |chance, mut answer| {
        answer.remove(chance.below(answer.len()));
        at_once(answer)
    }),
    ("2 % of the bytes lost", |chance, mut answer| {
        answer.retain(|_| chance.below(100) >= 2);
        at_once(answer)
    }),
    ("damaged, right 5 ms behind", |_, answer| {
        let mut damaged = answer.clone();
        damaged[3] ^= 1;
        followed(damaged, answer)
    }),
    ("two bytes more, right 5 ms behind", |_, answer| {
        let (body, crc) = answer.split_at(answer.len() - 2);
        followed([body, &[0x55, 0xAA], crc].concat(), answer)
    }),
    ("words too many, right 5 ms behind", |_, answer| {
        let long = Adu::answer(UnitAddress::MIN, &Answer::read(&[7; 9]).unwrap());
        followed(long.as_bytes().to_vec(), answer)
    }),
];

/// A line whose one unit has that trouble; register *a* holds *a*.
struct Wire {
    now: Instant,
    coming: Vec<(Instant, Vec<u8>)>,
    sent: usize,
    echo: Echo,
    trouble: Trouble,
    chance: Chance,
}

#[derive(Clone)]
struct Troubled(Arc<Mutex<Wire>>);

impl std::fmt::Debug for Troubled {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Troubled")
    }
}

fn answer(echo: Echo, request: &[u8]) -> Option<Vec<u8>> {
    let request = Request::parse(Frame::parse(request).unwrap().pdu()).unwrap();
    let words: Vec<u16>;
    let answer = match (request, echo) {
        (Request::Echo { .. }, Echo::Unheard) => return None,
        (Request::Echo { .. }, Echo::Refused) => Answer::exception(8, ExceptionCode::ILLEGAL_FUNCTION),
        (Request::Read { address, count, .. }, _) => {
            words = (address..address + count).collect();
            Answer::read(&words).unwrap()
        }
        _ => Answer::confirming(&request).unwrap(),
    };
    Some(Adu::answer(UnitAddress::MIN, &answer).as_bytes().to_vec())
}

impl Line for Troubled {
    fn now(&self) -> Instant {
        self.0.lock().unwrap().now
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let mut wire = self.0.lock().unwrap();
        wire.sent += 1;
        let end = wire.now + FORMAT.chars(u32::try_from(bytes.len()).unwrap());
        if let Some(right) = answer(wire.echo, bytes) {
            let trouble = wire.trouble;
            for (after, piece) in trouble(&mut wire.chance, right) {
                let at = end + FORMAT.t35() + FORMAT.chars(u32::try_from(piece.len()).unwrap()) + after;
                let place = wire.coming.partition_point(|(other, _)| *other <= at);
                wire.coming.insert(place, (at, piece));
            }
        }
        Ok(end)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let mut wire = self.0.lock().unwrap();
        let Some((at, _)) = wire.coming.first().filter(|(at, _)| *at <= until.max(wire.now)) else {
            wire.now = wire.now.max(until);
            return Ok(0);
        };
        wire.now = wire.now.max(*at);
        let (_, bytes) = wire.coming.remove(0);
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }

    fn sleep(&mut self, until: Instant) {
        let mut wire = self.0.lock().unwrap();
        wire.now = wire.now.max(until);
    }

    fn name(&self) -> String {
        "troubled".to_owned()
    }

    fn is_virtual(&self) -> bool {
        true
    }

    fn clock(&self) -> Option<LineClock> {
        let wire = Arc::clone(&self.0);
        Some(Arc::new(move || wire.lock().unwrap().now))
    }

    fn may_echo(&self) -> bool {
        true
    }
}

/// Right reads of [`READS`], requests for each, milliseconds for each, and whether the write was confirmed.
fn measure(trouble: Trouble, echo: Echo, fresh: bool, retries: u32) -> String {
    let wire = Wire { now: Instant::ZERO, coming: Vec::new(), sent: 0, echo, trouble, chance: Chance(0x9E37_79B9) };
    let wire = Arc::new(Mutex::new(wire));
    let line = Troubled(Arc::clone(&wire));
    let opener = move || Ok(Box::new(line.clone()) as Box<dyn Line>);
    let options = BusOptions::new(FORMAT).retries(retries);
    let bus = Bus::open(Box::new(opener), options, &mut || false).unwrap();
    if !fresh {
        wire.lock().unwrap().now = Instant::from_nanos(2_000_000_000);
        wire.lock().unwrap().trouble = TROUBLES[0].1;
        for address in 0..10 {
            ask(&bus, &wire, &Request::read(address, 2).unwrap());
        }
        ask(&bus, &wire, &Request::write(7, 7));
        wire.lock().unwrap().trouble = trouble;
    }
    let (began, before) = at(&wire);
    let right = (0..READS).filter(|&n| {
        let address = 0x3000 + 2 * n;
        ask(&bus, &wire, &Request::read(address, 2).unwrap()) == Some(vec![address, address + 1])
    });
    let right = right.count();
    let (now, sent) = at(&wire);
    let each = f64::from(READS);
    let millis = now.saturating_duration_since(began).as_secs_f64() * 1e3 / each;
    #[expect(clippy::cast_precision_loss, reason = "a few thousand")]
    let requests = (sent - before) as f64 / each;
    let written = ask(&bus, &wire, &Request::write(7, 8)).map_or("no", |_| "yes");
    format!("{right} / {requests:.1} / {millis:.0} / {written}")
}

/// Now, and how many requests were sent.
fn at(wire: &Mutex<Wire>) -> (Instant, usize) {
    let wire = wire.lock().unwrap();
    (wire.now, wire.sent)
}

/// The words read, or none for a write.
fn ask(bus: &Bus, wire: &Mutex<Wire>, request: &Request<'_>) -> Option<Vec<u16>> {
    let before = wire.lock().unwrap().sent;
    let mut came = Vec::new();
    let mut give_up = || wire.lock().unwrap().sent > before + MOST;
    let mut take = |answer: Answer<'_>| {
        if let Answer::Read { words, .. } = answer {
            came = words.iter().collect();
        }
    };
    bus.call(UnitAddress::MIN.into(), request, CallOptions::default(), &mut give_up, &mut take).ok()?;
    Some(came)
}

fn main() {
    println!(
        "right reads of {READS} / requests for each / ms for each / write confirmed; 08H returned, refused, silent"
    );
    for (fresh, retries) in [(true, 0), (true, 2), (false, 0), (false, 2)] {
        println!("\n{} port, {retries} retries", if fresh { "fresh" } else { "settled" });
        for (what, trouble) in TROUBLES {
            let cells =
                [Echo::Returned, Echo::Refused, Echo::Unheard].map(|echo| measure(trouble, echo, fresh, retries));
            println!("{what:<34} {:<24} {:<24} {}", cells[0], cells[1], cells[2]);
        }
    }
}
