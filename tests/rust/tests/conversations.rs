//! Whole conversations on a line with every fault: what was asked, what came, and what the caller was told.
//!
//! They are a record, not a judgement: the line is simulated and its chance is seeded, so that a change that is to leave the
//! policy of the line as it is can be held to that. What is right, the other tests say. `tests/vectors/conversations.txt` has a
//! number for each conversation. After a change that is meant to alter them, look at the difference and keep it:
//!
//! ```text
//! DRIVEBUS_CONVERSATIONS=/tmp/before cargo test -p drivebus-tests --test conversations   # texts, of the old code
//! DRIVEBUS_CONVERSATIONS=/tmp/after  cargo test -p drivebus-tests --test conversations   # and of the new; then diff
//! DRIVEBUS_WRITE_CONVERSATIONS=1     cargo test -p drivebus-tests --test conversations   # keeps the numbers
//! ```

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex};
use std::time::Duration;

use drivebus_line::{AdapterEcho, Bus, BusOptions, CallOptions, Direction, Failure, Line, Priority, Traced, Watch};
use drivebus_rtu::{
    AnswerLength, DataBits, Destination, ExceptionCode, Instant, Meaning, Meanings, Parity, Request, SerialFormat,
    Silence, StopBits, Table, UnitAddress,
};
use drivebus_sim::{Asked, FaultKind, Options, Refusals, SimulatedLine, Simulator};

/// Lines, each with its own faults and units.
const LINES: u64 = 200;
/// Calls on each.
const CALLS: u64 = 50;
/// The last of them is on no line.
const UNITS: [(u8, &str); 4] = [(1, "gd350"), (2, "vfd500"), (3, "ms300"), (4, "gd20")];
const NOBODY: u8 = 9;

/// A small generator (SplitMix64).
struct Chance(u64);

impl Chance {
    fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (mixed ^ (mixed >> 31)) % bound
    }

    fn one_of<T: Copy>(&mut self, items: &[T]) -> T {
        items[usize::try_from(self.below(items.len() as u64)).unwrap()]
    }

    fn in_a(&mut self, times: u64) -> bool {
        self.below(times) == 0
    }

    fn word(&mut self, bound: u16) -> u16 {
        u16::try_from(self.below(bound.into())).unwrap()
    }
}

/// What goes over the line.
#[derive(Default)]
struct Record(Mutex<String>);

impl Record {
    fn frame(&self, traced: &Traced) {
        let arrow = if traced.direction == Direction::Sent { "->" } else { "<-" };
        let mut text = self.0.lock().unwrap();
        write!(text, "  {} {arrow}", traced.at.saturating_duration_since(Instant::ZERO).as_micros()).unwrap();
        for byte in &traced.bytes {
            write!(text, " {byte:02X}").unwrap();
        }
        text.push('\n');
    }

    fn take(&self) -> String {
        std::mem::take(&mut *self.0.lock().unwrap())
    }
}

struct Rig {
    bus: Bus,
    simulator: Simulator,
    record: Arc<Record>,
    chance: Chance,
    /// By unit, where registers begin that can be read and written.
    places: &'static [(u8, u16)],
}

/// So many of each unit.
const PLACES: usize = 6;

/// Where registers begin that the drive of `unit` has.
fn places(simulator: &Simulator, unit: u8) -> Vec<(u8, u16)> {
    let drive = simulator.drive(unit).unwrap();
    let has = |place: &u16| drive.register(*place).is_ok() && drive.register(place + 1).is_ok();
    let writes = |place: &u16| drive.register(*place).is_ok_and(|word| drive.set_parameter(*place, word).is_ok());
    let found: Vec<(u8, u16)> =
        (0..0xF000).filter(has).filter(writes).take(PLACES).map(|place| (unit, place)).collect();
    assert!(!found.is_empty(), "unit {unit} has none");
    found
}

/// Of all units, found once.
static PLACES_OF_ALL: LazyLock<Vec<(u8, u16)>> = LazyLock::new(|| {
    let simulator = Simulator::new(UNITS, Options::default()).unwrap();
    UNITS.into_iter().flat_map(|(unit, _)| places(&simulator, unit)).collect()
});

fn rig(seed: u64) -> Rig {
    let mut chance = Chance(seed);
    let bits_per_second = chance.one_of(&[9_600, 19_200, 115_200]);
    let format =
        SerialFormat::new(bits_per_second, DataBits::Eight, Parity::None, StopBits::One, Silence::Spec).unwrap();
    let simulator = Simulator::new(UNITS, Options::default().format(format).seed(seed)).unwrap();
    let plugged = simulator.clone();
    let opener = Box::new(move || Ok(Box::new(plugged.open_line()?) as Box<dyn Line>));
    let echoes = chance.in_a(3);
    let echo = match chance.below(3) {
        0 => AdapterEcho::Auto,
        _ if echoes => AdapterEcho::Present,
        1 => AdapterEcho::Auto,
        _ => AdapterEcho::Absent,
    };
    let wire = simulator.wire();
    wire.set_echo(echoes);
    let timeout = Duration::from_millis(chance.one_of(&[60, 100, 500]));
    let options = BusOptions::new(format)
        .timeout(timeout)
        .echo(echo)
        .retries(u32::try_from(chance.below(4)).unwrap())
        .learn_timeout(chance.in_a(4));
    let bus = Bus::open(opener, options, &mut || false).unwrap();
    spoil(&mut chance, &wire);
    if chance.in_a(4) {
        bus.set_meanings(
            UnitAddress::new(2).unwrap(),
            Meanings::STANDARD.with(ExceptionCode(0x04), Meaning::AskAgain).with(ExceptionCode(0x06), Meaning::NotNow),
        );
    }
    let record = Arc::new(Record::default());
    let watched = Arc::clone(&record);
    let watch: Watch = Arc::new(move |traced| watched.frame(&traced));
    bus.watch(Some(watch));
    Rig { bus, simulator, record, chance, places: &PLACES_OF_ALL }
}

/// No fault, some of each, or much of one.
fn spoil(chance: &mut Chance, wire: &SimulatedLine) {
    let rate = chance.one_of(&[0.0, 0.005, 0.02, 0.05]);
    for kind in FaultKind::ALL {
        wire.set_rate(kind, if kind == FaultKind::Unplug { rate / 5.0 } else { rate }).unwrap();
    }
    if chance.in_a(2) {
        wire.set_rate(chance.one_of(&FaultKind::ALL[..FaultKind::ALL.len() - 1]), 0.25).unwrap();
    }
    wire.set_late(Duration::from_millis(chance.one_of(&[70, 300, 600])));
    wire.set_replug(Duration::from_millis(30));
    wire.set_overtaken(Duration::from_millis(50), Duration::from_millis(900));
}

impl Rig {
    /// Something happens beside the line.
    fn meanwhile(&mut self) {
        match self.chance.below(12) {
            0 => {
                let drive = self.simulator.drive(self.chance.one_of(&UNITS).0).unwrap();
                let code = self.chance.one_of(&[0x05, 0x06, 0x06, 0x04, 0x02, 0x0B]);
                let asked = self.chance.one_of(&[Asked::Anything, Asked::Anything, Asked::Writes, Asked::Reads]);
                let mut refusals = Refusals::new(code).of(asked).share(0.7).count(1 + self.chance.below(8));
                if code == 0x05 {
                    refusals = refusals.taken();
                }
                drive.refuse(refusals).unwrap();
            }
            1 => {
                let drive = self.simulator.drive(self.chance.one_of(&UNITS).0).unwrap();
                drive.refuse_no_more();
            }
            2 => self.bus.sleep(Duration::from_millis(self.chance.one_of(&[5, 400, 3_500])), &mut || false),
            _ => {}
        }
    }

    /// One call, and all that is told of it.
    fn call(&mut self) -> String {
        self.meanwhile();
        let chance = &mut self.chance;
        let unit = if chance.in_a(12) { NOBODY } else { chance.one_of(&[1, 1, 1, 2, 3, 4]) };
        let mut to = Destination::Unit(UnitAddress::new(unit).unwrap());
        let mut options = CallOptions::new();
        let value = chance.word(50);
        let places = self.places.iter().filter(|(of, _)| *of == unit || unit == NOBODY);
        let places: Vec<u16> = places.map(|&(_, place)| place).collect();
        // Now and then one that is not there.
        let place = if chance.in_a(20) { 0xFFF0 } else { chance.one_of(&places) };
        let (words, pdu) = ([value, value + 1], [0x03, 0x21, 0x00, 0x00, 0x01]);
        let count = chance.one_of(&[1, 1, 1, 2, 2, 3, 4, 7]);
        let request = match chance.below(16) {
            0..=7 => Request::read(place, count).unwrap(),
            8 if chance.in_a(3) => Request::read_of(Table::Input, place, count).unwrap(),
            9 => Request::echo(self.bus.fresh_word()),
            10 => Request::write_many(place, &words).unwrap(),
            11 => Request::custom(&pdu, AnswerLength::BySilence).unwrap(),
            12 => {
                to = Destination::Broadcast;
                Request::write(place, value)
            }
            _ => Request::write(place, value),
        };
        if request.is_write() && !chance.in_a(3) && to != Destination::Broadcast {
            options = options.read_back(place);
        }
        match chance.below(16) {
            0 | 1 => options = options.in_doubt(true).priority(Priority::Stop),
            2 => options = options.priority(Priority::Stop),
            3 => options = options.priority(Priority::Poll),
            _ => {}
        }
        if chance.in_a(6) {
            options = options.verify(true);
        }
        if chance.in_a(6) {
            options = options.retries(u32::try_from(chance.below(4)).unwrap());
        }
        if chance.in_a(10) {
            options = options.connection(self.bus.reconnects());
        }
        let mut text = String::new();
        // Nothing here is told to be for before a stop only; the record is older than that option.
        let told = format!("{options:?}").replace(", halts: None", "");
        writeln!(text, "{to:?} {request:?} {told}").unwrap();
        let mut came = String::new();
        let result =
            self.bus.call(to, &request, options, &mut || false, &mut |answer| write!(came, "{answer:?}").unwrap());
        text.push_str(&self.record.take());
        if result.as_ref().is_err_and(|error| matches!(error.failure, Failure::Port(_))) {
            // Nothing takes time while the adapter is out.
            self.bus.sleep(Duration::from_millis(self.chance.one_of(&[2, 40])), &mut || false);
        }
        // What was taken before a call failed counts for nothing.
        let came = if result.is_ok() { came } else { String::new() };
        // The settings of a port, which this line has not, are no policy; nor is the protocol that all units here speak.
        let result = format!("{result:?}").replace(", set_again: None", "").replace(", protocol: Modbus", "");
        writeln!(text, "{result} {came}").unwrap();
        let stats = self.bus.stats().total;
        writeln!(
            text,
            "{} requests, {} resyncs, {} verified, {} retries, {} late, {} foreign, {} not asked, {} time-outs",
            stats.requests,
            stats.resyncs,
            stats.verified,
            stats.retries,
            stats.late,
            stats.foreign,
            stats.not_asked,
            stats.timeouts
        )
        .unwrap();
        text
    }
}

/// FNV-1a.
fn number(text: &str) -> u64 {
    text.bytes().fold(0xCBF2_9CE4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3))
}

fn conversations(seed: u64) -> Vec<String> {
    let mut rig = rig(seed);
    (0..CALLS).map(|_| rig.call()).collect()
}

fn vectors() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../vectors/conversations.txt")
}

#[test]
fn ten_thousand_conversations_are_what_they_were() {
    let all: Vec<Vec<String>> = (0..LINES).map(conversations).collect();
    if let Some(folder) = std::env::var_os("DRIVEBUS_CONVERSATIONS") {
        std::fs::create_dir_all(&folder).unwrap();
        for (seed, texts) in all.iter().enumerate() {
            std::fs::write(Path::new(&folder).join(format!("{seed:03}.txt")), texts.join("\n")).unwrap();
        }
    }
    let mut numbers = String::new();
    for (seed, texts) in all.iter().enumerate() {
        write!(numbers, "{seed}").unwrap();
        for text in texts {
            write!(numbers, " {:08x}", number(text) >> 32).unwrap();
        }
        numbers.push('\n');
    }
    if std::env::var_os("DRIVEBUS_WRITE_CONVERSATIONS").is_some() {
        std::fs::write(vectors(), &numbers).unwrap();
    }
    let kept = std::fs::read_to_string(vectors()).unwrap();
    let differ = kept.lines().zip(numbers.lines()).filter(|(kept, now)| kept != now);
    let lines: Vec<&str> = differ.filter_map(|(kept, _)| kept.split(' ').next()).collect();
    assert_eq!(kept.lines().count(), numbers.lines().count());
    assert!(lines.is_empty(), "conversations on lines {lines:?} are not what they were: see the head of this file");
}
