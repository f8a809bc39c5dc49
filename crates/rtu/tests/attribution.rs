//! No answer is ever attributed to a request it was not sent for: the master over a model of a hostile line.
//!
//! The units of the model do what the master assumes of them, and no more: they answer in the order they were asked, at
//! most once each, as late as they like. The line loses and flips, delivers in lumps, puts noise around, and lets a late
//! answer through, or garbles it, while the master is sending.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::{BTreeMap, VecDeque};

use drivebus_rtu::*;
use proptest::prelude::*;

const UNITS: u8 = 3;
const TIMEOUT: Duration = Duration::from_millis(50);
const FORMAT: SerialFormat = SerialFormat::DEFAULT;

/// Chances of the line, in a sequence that proptest can shrink; all is well when it is used up.
struct Luck<'a>(std::slice::Iter<'a, u8>);

impl Luck<'_> {
    fn draw(&mut self) -> u8 {
        self.0.next().copied().unwrap_or(u8::MAX)
    }

    /// Happens about `percent` times in a hundred.
    fn strikes(&mut self, percent: u8) -> bool {
        u32::from(self.draw()) * 100 < u32::from(percent) * 256
    }
}

/// What a program asks, in turn.
#[derive(Debug, Clone, Copy)]
enum Wish {
    Read { unit: u8, address: u16, count: u16 },
    Write { unit: u8, address: u16, value: u16 },
}

/// A unit: register `a` holds a value that only unit and address have, until it is written.
#[derive(Default)]
struct Unit {
    written: BTreeMap<u16, u16>,
    /// When its last answer goes out.
    busy_until: Instant,
    taken: Vec<(u16, u16)>,
}

impl Unit {
    fn word(&self, unit: u8, address: u16) -> u16 {
        self.written.get(&address).copied().unwrap_or(u16::from(unit) << 8 | address)
    }

    fn answer(&mut self, unit: u8, request: &Request<'_>) -> Adu {
        let address = UnitAddress::new(unit).unwrap();
        match *request {
            Request::ReadHolding { address: first, count, .. } => {
                let words: Vec<u16> = (first..first + count).map(|a| self.word(unit, a)).collect();
                Adu::answer(address, &Answer::read(&words).unwrap())
            }
            Request::WriteSingle { address: to, value, .. } => {
                self.written.insert(to, value);
                self.taken.push((to, value));
                Adu::answer(address, &Answer::confirming(request).unwrap())
            }
            _ => Adu::answer(address, &Answer::confirming(request).unwrap()),
        }
    }
}

struct Line<'a> {
    luck: Luck<'a>,
    units: BTreeMap<u8, Unit>,
    /// Bytes on their way to the master, in the order they arrive.
    coming: VecDeque<(Instant, Vec<u8>)>,
}

impl Line<'_> {
    /// The master's `frame` ends at `end`: the unit hears it or not, and answers some time.
    fn carry(&mut self, frame: &[u8], end: Instant) {
        if self.luck.strikes(15) {
            return;
        }
        let frame = Frame::parse(frame).unwrap();
        let number = frame.address();
        let Some(unit) = self.units.get_mut(&number) else { return };
        let answer = unit.answer(number, &Request::parse(frame.pdu()).unwrap());
        // Mostly in time, sometimes far beyond the time-out.
        let delay = Duration::from_millis(match self.luck.draw() {
            draw @ 0..=99 => u64::from(draw) * 3,
            _ => 5,
        });
        let begin = unit.busy_until.max(end + FORMAT.t35() + delay);
        let mut bytes = answer.as_bytes().to_vec();
        unit.busy_until = begin + FORMAT.chars(u32::try_from(bytes.len()).unwrap());
        if self.luck.strikes(15) {
            return;
        }
        if self.luck.strikes(15) {
            let bit = usize::from(self.luck.draw()) % (8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        if self.luck.strikes(10) {
            bytes.insert(0, self.luck.draw());
        }
        if self.luck.strikes(10) {
            bytes.push(self.luck.draw());
        }
        let lump = if self.luck.strikes(20) { 1 + usize::from(self.luck.draw() % 6) } else { bytes.len() };
        for (index, piece) in bytes.chunks(lump).enumerate() {
            let arrives = unit_end(begin, index);
            let place = self.coming.partition_point(|(at, _)| *at <= arrives);
            self.coming.insert(place, (arrives, piece.to_vec()));
        }
    }
}

/// When the lump `index` of an answer that begins at `begin` is delivered.
fn unit_end(begin: Instant, index: usize) -> Instant {
    begin + Duration::from_millis(4) + Duration::from_millis(7) * u32::try_from(index).unwrap()
}

#[derive(Debug, PartialEq)]
enum Outcome {
    Words(Vec<u16>),
    Confirmed,
    Nothing,
}

/// Runs one request to its end.
fn ask(master: &mut Master, line: &mut Line<'_>, now: &mut Instant, unit: u8, request: &Request<'_>) -> Outcome {
    let unit = UnitAddress::new(unit).unwrap();
    master.begin(*now, unit.into(), request, TIMEOUT).unwrap();
    loop {
        let outcome = match master.poll(*now) {
            Some(Event::Transmit(frame)) => {
                let (frame, end) = (frame.to_vec(), *now + FORMAT.chars(u32::try_from(frame.len()).unwrap()));
                master.sent(end);
                line.carry(&frame, end);
                continue;
            }
            None => {
                let deadline = master.deadline().unwrap();
                let (next, bytes) = match line.coming.front() {
                    Some((at, _)) if *at <= deadline => line.coming.pop_front().unwrap(),
                    _ => (deadline, Vec::new()),
                };
                *now = (*now).max(next);
                assert_eq!(master.receive(*now, &bytes), bytes.len());
                continue;
            }
            Some(Event::Answer(Answer::Read { words, .. })) => Outcome::Words(words.iter().collect()),
            Some(Event::Answer(Answer::WriteSingle { .. } | Answer::Echo { .. })) => Outcome::Confirmed,
            Some(_) => Outcome::Nothing,
        };
        return outcome;
    }
}

fn wishes() -> impl Strategy<Value = Vec<Wish>> {
    let unit = || 1..=UNITS;
    let wish = prop_oneof![
        // Few shapes, so that a late answer fits the next request.
        3 => (unit(), 0..4_u16, 1..=2_u16).prop_map(|(unit, address, count)| Wish::Read { unit, address, count }),
        1 => (unit(), 0..4_u16, 0..3_u16).prop_map(|(unit, address, value)| Wish::Write { unit, address, value }),
    ];
    prop::collection::vec(wish, 1..40)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn no_answer_is_attributed_to_another_request(wishes in wishes(), luck in prop::collection::vec(any::<u8>(), 0..600)) {
        let mut line = Line {
            luck: Luck(luck.iter()),
            units: (1..=UNITS).map(|unit| (unit, Unit::default())).collect(),
            coming: VecDeque::new(),
        };
        let mut master = Master::new(&FORMAT);
        let mut now = Instant::ZERO;
        let mut word = 0_u16;
        for wish in wishes {
            let (Wish::Read { unit, .. } | Wish::Write { unit, .. }) = wish;
            let address = UnitAddress::new(unit).unwrap();
            for _ in 0..20 {
                if !master.in_quarantine(address) {
                    break;
                }
                word += 1;
                ask(&mut master, &mut line, &mut now, unit, &Request::echo(word));
            }
            if master.in_quarantine(address) {
                continue;
            }
            match wish {
                Wish::Read { address, count, .. } => {
                    let before: Vec<u16> = (address..address + count).map(|a| line.units[&unit].word(unit, a)).collect();
                    let came = ask(&mut master, &mut line, &mut now, unit, &Request::read(address, count).unwrap());
                    prop_assert!(came == Outcome::Nothing || came == Outcome::Words(before), "{came:?}");
                }
                Wish::Write { address, value, .. } => {
                    let before = line.units[&unit].taken.len();
                    let came = ask(&mut master, &mut line, &mut now, unit, &Request::write(address, value));
                    let taken = &line.units[&unit].taken[before..];
                    prop_assert!(came == Outcome::Nothing || taken == [(address, value)], "{came:?}, {taken:?}");
                }
            }
        }
    }
}
