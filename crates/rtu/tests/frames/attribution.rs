//! No answer is ever attributed to a request it was not sent for: the master over a model of a hostile line.
//!
//! The units of the model do what the master assumes of them, and no more: they answer in the order they were asked, at
//! most once each, within three seconds or never, and some know no echo. The line loses, flips, doubles at once, delivers
//! in lumps, puts noise around, and lets a late answer through, or garbles it, while the master is sending. When it is
//! opened, every unit may owe another program an answer. Behind a gateway answers come in any order.

use std::collections::{BTreeMap, VecDeque};

use drivebus_rtu::*;
use proptest::prelude::*;

const UNITS: u8 = 3;
const TIMEOUT: Duration = Duration::from_millis(50);
const FORMAT: SerialFormat = SerialFormat::DEFAULT;
/// Registers from here on are refused.
const REGISTERS: u16 = 5;

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
    Read {
        unit: u8,
        address: u16,
        count: u16,
    },
    Write {
        unit: u8,
        address: u16,
        value: u16,
    },
    /// A write that goes out at once, in doubt or not.
    Stop {
        unit: u8,
        address: u16,
    },
}

/// What a stop writes, and others too.
const STOP: u16 = 1;

/// What a unit makes of an echo.
#[derive(Debug, Clone, Copy)]
enum Echo {
    Returned,
    Refused,
    Unheard,
}

/// A unit: register `a` holds a value that only unit and address have, until it is written.
struct Unit {
    echo: Echo,
    written: BTreeMap<u16, u16>,
    /// When its last answer goes out.
    busy_until: Instant,
    taken: Vec<(u16, u16)>,
}

impl Unit {
    fn word(&self, unit: u8, address: u16) -> u16 {
        self.written.get(&address).copied().unwrap_or(u16::from(unit) << 8 | address)
    }

    fn words(&self, unit: u8, first: u16, count: u16) -> Outcome {
        if first + count > REGISTERS {
            return Outcome::Refused;
        }
        Outcome::Words((first..first + count).map(|address| self.word(unit, address)).collect())
    }

    fn answer(&mut self, unit: u8, request: &Request<'_>) -> Option<Adu> {
        let address = UnitAddress::new(unit).unwrap();
        let refused = Answer::exception(request.function(), ExceptionCode::ILLEGAL_ADDRESS);
        Some(match (*request, self.echo) {
            (Request::Read { table: Table::Holding, address: first, count, .. }, _) => {
                match self.words(unit, first, count) {
                    Outcome::Words(words) => Adu::answer(address, &Answer::read(&words).unwrap()),
                    _ => Adu::answer(address, &refused),
                }
            }
            (Request::WriteSingle { address: to, value, .. }, _) => {
                if to >= REGISTERS {
                    return Some(Adu::answer(address, &refused));
                }
                self.written.insert(to, value);
                self.taken.push((to, value));
                Adu::answer(address, &Answer::confirming(request).unwrap())
            }
            (_, Echo::Returned) => Adu::answer(address, &Answer::confirming(request).unwrap()),
            (_, Echo::Refused) => Adu::answer(address, &refused),
            (_, Echo::Unheard) => return None,
        })
    }
}

struct Line<'a> {
    luck: Luck<'a>,
    units: BTreeMap<u8, Unit>,
    /// Whether answers may overtake each other.
    gateway: bool,
    /// Bytes on their way to the master, in the order they arrive.
    coming: VecDeque<(Instant, Vec<u8>)>,
}

impl Line<'_> {
    /// A `frame` that ends at `end`: the unit hears it or not, and answers some time.
    fn carry(&mut self, frame: &[u8], end: Instant) {
        if self.luck.strikes(15) {
            return;
        }
        let frame = Frame::parse(frame).unwrap();
        let number = frame.address();
        let Some(unit) = self.units.get_mut(&number) else { return };
        // A unit has room for few requests. This keeps its answers within what is assumed of it.
        if unit.busy_until > end + Duration::from_millis(500) {
            return;
        }
        let Some(answer) = unit.answer(number, &Request::parse(frame.pdu()).unwrap()) else { return };
        // Mostly in time, sometimes far beyond the time-out.
        let delay = Duration::from_millis(match self.luck.draw() {
            draw @ 0..=99 => u64::from(draw) * 3,
            _ => 5,
        });
        let mut begin = end + FORMAT.t35() + delay;
        let mut bytes = answer.as_bytes().to_vec();
        if !self.gateway {
            begin = begin.max(unit.busy_until);
            unit.busy_until = begin + FORMAT.chars(u32::try_from(bytes.len()).unwrap());
        }
        if self.luck.strikes(15) {
            return;
        }
        if self.luck.strikes(15) {
            let bit = usize::from(self.luck.draw()) % (8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        let doubled = self.luck.strikes(5);
        if doubled {
            bytes.extend(bytes.clone());
        }
        if self.luck.strikes(10) {
            bytes.insert(0, self.luck.draw());
        }
        if self.luck.strikes(10) {
            bytes.push(self.luck.draw());
        }
        // A second answer that came after the next request went out could not be told from its answer by anybody.
        let whole = doubled || self.gateway || !self.luck.strikes(20);
        let lump = if whole { bytes.len() } else { 1 + usize::from(self.luck.draw() % 6) };
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
    Refused,
    Nothing,
}

/// A program: a master, its line, and the time.
struct Program<'a> {
    master: Master,
    line: Line<'a>,
    now: Instant,
    /// The last word echoed.
    word: u16,
}

impl Program<'_> {
    /// Runs one request to its end; every right answer goes to `agreement`.
    fn exchange(&mut self, unit: UnitAddress, request: &Request<'_>, agreement: &mut Agreement) -> (Outcome, bool) {
        self.master.begin(self.now, unit.into(), request, TIMEOUT).unwrap();
        self.follow(unit, agreement)
    }

    /// Runs the request that was begun to its end.
    fn follow(&mut self, unit: UnitAddress, agreement: &mut Agreement) -> (Outcome, bool) {
        loop {
            match self.master.poll(self.now) {
                Some(Event::Transmit(frame)) => {
                    let (frame, end) = (frame.to_vec(), self.now + FORMAT.chars(u32::try_from(frame.len()).unwrap()));
                    self.master.sent(end);
                    self.line.carry(&frame, end);
                }
                None => {
                    let deadline = self.master.deadline().unwrap();
                    let (next, bytes) = match self.line.coming.front() {
                        Some((at, _)) if *at <= deadline => self.line.coming.pop_front().unwrap(),
                        _ => (deadline, Vec::new()),
                    };
                    self.now = self.now.max(next);
                    assert_eq!(self.master.receive(self.now, &bytes), bytes.len());
                }
                Some(Event::Answer(answer)) => {
                    let agreed = agreement.hear(unit, &answer);
                    let outcome = match answer {
                        Answer::Read { words, .. } => Outcome::Words(words.iter().collect()),
                        Answer::Exception { .. } => Outcome::Refused,
                        _ => Outcome::Confirmed,
                    };
                    return (outcome, agreed);
                }
                Some(_) => return (Outcome::Nothing, false),
            }
        }
    }

    /// Asks nothing until `until`.
    fn listen(&mut self, until: Instant) {
        while self.line.coming.front().is_some_and(|(at, _)| *at <= until) {
            let (at, bytes) = self.line.coming.pop_front().unwrap();
            self.now = self.now.max(at);
            assert_eq!(self.master.receive(self.now, &bytes), bytes.len());
            assert_eq!(self.master.poll(self.now), None);
        }
        self.now = until;
    }

    /// Asks once, whatever it is for.
    fn once(&mut self, unit: UnitAddress, request: &Request<'_>) {
        self.exchange(unit, request, &mut Agreement::new(Attribution::Certain, 1));
    }

    /// Whether the doubt about `unit` could be ended: by echoes, by reads of another length, by time.
    fn clear(&mut self, unit: UnitAddress) -> bool {
        for attempt in 0..20_u16 {
            if !self.master.in_quarantine(self.now, unit) {
                return true;
            }
            self.word += 1;
            self.once(unit, &Request::echo(self.word));
            let other = Request::read(0, 1 + attempt % 4).unwrap();
            if self.master.in_quarantine(self.now, unit) && self.begins(unit, &other) {
                self.once(unit, &other);
            }
            self.listen(self.now + Duration::from_millis(50));
        }
        false
    }

    /// Whether the master would send `request` now.
    fn begins(&self, unit: UnitAddress, request: &Request<'_>) -> bool {
        self.master.clone().begin(self.now, unit.into(), request, TIMEOUT).is_ok()
    }

    /// Asks until it is answered beyond doubt, or fails.
    fn ask(&mut self, unit: UnitAddress, request: &Request<'_>) -> Outcome {
        if !self.clear(unit) {
            return Outcome::Nothing;
        }
        let attribution = self.master.attribution(self.now, unit, request);
        if let Attribution::Wait(until) = attribution {
            self.listen(until);
        }
        let mut agreement = Agreement::new(attribution, 1);
        for _ in 0..agreement.longest() {
            let (outcome, agreed) = self.exchange(unit, request, &mut agreement);
            if agreed || outcome == Outcome::Nothing {
                return outcome;
            }
        }
        Outcome::Nothing
    }
}

fn wishes() -> impl Strategy<Value = Vec<Wish>> {
    let unit = || 1..=UNITS;
    let wish = prop_oneof![
        // Few shapes, so that a late answer fits the next request.
        3 => (unit(), 0..=REGISTERS, 1..=2_u16).prop_map(|(unit, address, count)| Wish::Read { unit, address, count }),
        1 => (unit(), 0..=REGISTERS, 0..3_u16).prop_map(|(unit, address, value)| Wish::Write { unit, address, value }),
        1 => (unit(), 0..=REGISTERS).prop_map(|(unit, address)| Wish::Stop { unit, address }),
    ];
    prop::collection::vec(wish, 1..40)
}

fn program<'a>(luck: &'a [u8], echoes: &[Echo], gateway: bool) -> Program<'a> {
    let units = (1..).zip(echoes).map(|(unit, &echo)| {
        (unit, Unit { echo, written: BTreeMap::new(), busy_until: Instant::ZERO, taken: Vec::new() })
    });
    let line = Line { luck: Luck(luck.iter()), units: units.collect(), gateway, coming: VecDeque::new() };
    let master = Master::new(&FORMAT);
    Program { master, line, now: Instant::ZERO, word: 0 }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3_000, ..ProptestConfig::default() })]

    #[test]
    fn no_answer_is_attributed_to_another_request(
        strangers in prop::collection::vec((1..=UNITS, 0..REGISTERS), 0..3),
        wishes in wishes(),
        echoes in prop::collection::vec(
            prop_oneof![Just(Echo::Returned), Just(Echo::Refused), Just(Echo::Unheard)], usize::from(UNITS)
        ),
        gateway in any::<bool>(),
        luck in prop::collection::vec(any::<u8>(), 0..600),
    ) {
        let mut program = program(&luck, &echoes, gateway);
        // What another program asked last, before it ended and this one opened the line. Behind a gateway nobody knows.
        for (unit, address) in strangers.into_iter().filter(|_| !gateway) {
            let unit = UnitAddress::new(unit).unwrap();
            program.now = program.now + Duration::from_millis(20);
            let frame = Adu::request(unit.into(), &Request::read(address, 1).unwrap());
            program.line.carry(frame.as_bytes(), program.now);
        }
        program.master.opened(program.now);
        for wish in wishes {
            let (Wish::Read { unit, .. } | Wish::Write { unit, .. } | Wish::Stop { unit, .. }) = wish;
            let to = UnitAddress::new(unit).unwrap();
            match wish {
                Wish::Read { address, count, .. } => {
                    let right = program.line.units[&unit].words(unit, address, count);
                    let came = program.ask(to, &Request::read(address, count).unwrap());
                    prop_assert!(came == Outcome::Nothing || came == right, "{came:?}, not {right:?}");
                }
                Wish::Write { address, value, .. } => {
                    let before = program.line.units[&unit].taken.len();
                    let came = program.ask(to, &Request::write(address, value));
                    let taken = &program.line.units[&unit].taken[before..];
                    prop_assert!(came != Outcome::Confirmed || taken == [(address, value)], "{came:?}, {taken:?}");
                    prop_assert!(came != Outcome::Refused || address >= REGISTERS, "refused, and not by the unit");
                }
                Wish::Stop { address, .. } => {
                    let stop = Request::write(address, STOP);
                    program.master.begin_in_doubt(program.now, to.into(), &stop, TIMEOUT).unwrap();
                    let (came, _) = program.follow(to, &mut Agreement::new(Attribution::Certain, 1));
                    // In doubt it may be an earlier one that was confirmed, but of the same kind and never refused.
                    let taken = &program.line.units[&unit].taken;
                    prop_assert!(came != Outcome::Confirmed || taken.contains(&(address, STOP)), "never taken");
                    prop_assert!(came != Outcome::Refused || address >= REGISTERS, "refused, and not by the unit");
                }
            }
        }
    }
}

/// On a line where nothing goes wrong every kind of unit is reached at once or when first contact is over, and each
/// request is answered.
#[test]
fn a_good_line_answers_whatever_the_unit_knows() {
    for gateway in [false, true] {
        let mut program = program(&[], &[Echo::Returned, Echo::Refused, Echo::Unheard], gateway);
        program.master.opened(Instant::ZERO);
        for unit in 1..=UNITS {
            for address in 0..3 {
                let to = UnitAddress::new(unit).unwrap();
                let came = program.ask(to, &Request::read(address, 2).unwrap());
                assert_eq!(came, program.line.units[&unit].words(unit, address, 2), "unit {unit}");
            }
        }
    }
}
