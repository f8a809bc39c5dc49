//! Noise costs no seconds: on a line that damages characters, as many right answers as a careful master gets, none wrong, and
//! no call that waits for a clock. All of it in virtual time, so that it is exact.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test may panic")]

mod careful;
mod line;

use std::time::Duration;

use drivebus_line::{AdapterEcho, Bus, BusOptions, CallOptions, Line};
use drivebus_rtu::{Answer, DataBits, FIRST_CONTACT, Parity, Request, SerialFormat, Silence, StopBits, UnitAddress};

use careful::Careful;
use line::{Echoing, Noise, NoisyLine, word};

const TIMEOUT: Duration = Duration::from_millis(100);

/// What a master came to.
#[derive(Debug, Default)]
struct Came {
    right: u32,
    wrong: u32,
    failed: u32,
    slowest: Duration,
    time: Duration,
}

impl Came {
    fn rate(&self) -> f64 {
        f64::from(self.right) / self.time.as_secs_f64()
    }
}

fn reads(count: u32, words: u16, line: &NoisyLine, mut read: impl FnMut(u16) -> Option<Vec<u16>>) -> Came {
    let mut came = Came::default();
    let begin = line.now();
    for number in 0..count {
        let address = u16::try_from(number * 17 % 0x0F00).unwrap();
        let before = line.now();
        match read(address) {
            Some(got) if got == (address..address + words).map(word).collect::<Vec<_>>() => came.right += 1,
            Some(_) => came.wrong += 1,
            None => came.failed += 1,
        }
        came.slowest = came.slowest.max(line.now().saturating_duration_since(before));
    }
    came.time = line.now().saturating_duration_since(begin);
    came
}

fn by_bus(count: u32, words: u16, format: SerialFormat, line: &NoisyLine) -> Came {
    let wired = line.clone();
    let opener = Box::new(move || Ok(Box::new(wired.clone()) as Box<dyn Line>));
    let options = BusOptions::new(format).timeout(TIMEOUT).retries(3).echo(AdapterEcho::Absent);
    let bus = Bus::open(opener, options, &mut || false).unwrap();
    line.0.lock().unwrap().now = line.now() + FIRST_CONTACT;
    reads(count, words, line, |address| {
        let request = Request::read(address, words).unwrap();
        let mut got = None;
        let mut take = |answer: Answer<'_>| {
            if let Answer::Read { words, .. } = answer {
                got = Some(words.iter().collect());
            }
        };
        bus.call(UnitAddress::MIN.into(), &request, CallOptions::new(), &mut || false, &mut take).ok()?;
        got
    })
}

fn by_careful(count: u32, words: u16, format: SerialFormat, line: &NoisyLine) -> Came {
    let mut master = Careful::new(line.clone(), format, TIMEOUT);
    reads(count, words, line, |address| master.read(UnitAddress::MIN, address, words))
}

fn format(bits_per_second: u32) -> SerialFormat {
    SerialFormat::new(bits_per_second, DataBits::Eight, Parity::None, StopBits::One, Silence::Spec).unwrap()
}

/// Right answers for each of the careful master, and how long the slowest call took.
fn beside(noise: Noise, echoing: Echoing, speed: u32, words: u16) -> (f64, Duration) {
    let line = || NoisyLine::new(format(speed), noise, echoing, 11);
    let bus = by_bus(READS, words, format(speed), &line());
    let careful = by_careful(READS, words, format(speed), &line());
    assert_eq!(bus.wrong, 0, "{noise:?}, {echoing:?}, {speed} bit/s, {words} words");
    (bus.rate() / careful.rate(), bus.slowest)
}

const READS: u32 = 400;
/// Bits a second, and words.
const CELLS: [(u32, u16); 9] = [
    (9_600, 1),
    (9_600, 4),
    (9_600, 16),
    (19_200, 1),
    (19_200, 4),
    (19_200, 16),
    (115_200, 1),
    (115_200, 4),
    (115_200, 16),
];
const FLIPPED: Noise = Noise { flipped: 2, ..Noise::NONE };
const LOST: Noise = Noise { lost: 2, ..Noise::NONE };
const LATE: Noise = Noise { late: 2, ..Noise::NONE };
const OVERTAKING: Noise = Noise { overtaking: true, ..LATE };

#[test]
fn characters_that_are_turned_over_cost_about_what_they_cost_a_careful_master() {
    for (speed, words) in CELLS {
        let (share, slowest) = beside(FLIPPED, Echoing::Returns, speed, words);
        assert!(share >= 0.9, "{speed} bit/s, {words} words: {share:.2}");
        // Sixteen words are half of them damaged, and a unit that gives no more is asked for them at the line's pace.
        let most = Duration::from_millis(if words == 16 { 1_300 } else { 500 });
        assert!(slowest <= most, "{speed} bit/s, {words} words: {slowest:?}");
    }
}

#[test]
fn characters_that_are_lost_cost_about_what_they_cost_a_careful_master() {
    for (speed, words) in CELLS {
        let (share, slowest) = beside(LOST, Echoing::Returns, speed, words);
        // As above, and what is left of an answer is listened for longer.
        let most = Duration::from_millis(if words == 16 { 1_300 } else { 500 });
        assert!(share >= 0.8 && slowest <= most, "{speed} bit/s, {words} words: {share:.2}, {slowest:?}");
    }
}

/// Nor does it take 08H.
#[test]
fn noise_costs_no_seconds_where_no_echo_comes_back() {
    for (noise, echoing) in
        [FLIPPED, LOST].into_iter().flat_map(|noise| [(noise, Echoing::Refuses), (noise, Echoing::Silent)])
    {
        for speed in [9_600, 115_200] {
            let (_, slowest) = beside(noise, echoing, speed, 1);
            assert!(slowest <= Duration::from_millis(500), "{noise:?}, {echoing:?}, {speed} bit/s: {slowest:?}");
        }
    }
}

#[test]
fn late_answers_cost_about_what_they_cost_a_careful_master() {
    for ((speed, words), noise) in CELLS.into_iter().flat_map(|cell| [LATE, OVERTAKING].map(|noise| (cell, noise))) {
        let (share, slowest) = beside(noise, Echoing::Returns, speed, words);
        // Where sixteen words overtake, nothing but waiting tells them apart, which the careful master does not.
        let least = if words == 16 && noise == OVERTAKING { 0.85 } else { 0.9 };
        assert!(
            share >= least && slowest <= Duration::from_millis(300),
            "{noise:?}, {speed} bit/s, {words} words: {share:.2}, {slowest:?}"
        );
    }
}

#[test]
fn late_answers_of_which_many_are_damaged_cost_about_what_they_cost_a_careful_master() {
    for (speed, words) in CELLS {
        let (share, _) = beside(Noise { flipped: 2, ..OVERTAKING }, Echoing::Returns, speed, words);
        assert!(share >= 0.7, "{speed} bit/s, {words} words: {share:.2}");
    }
}

/// However many of them are damaged, lost and late at once.
#[test]
fn nothing_wrong_is_believed_where_damaged_answers_overtake() {
    let mixed = [
        Noise { flipped: 2, ..OVERTAKING },
        Noise { lost: 2, ..OVERTAKING },
        Noise { flipped: 3, lost: 3, missing: 5, late: 10, overtaking: true },
        Noise { flipped: 1, lost: 1, missing: 1, late: 25, overtaking: true },
    ];
    let kinds = [Echoing::Returns, Echoing::Refuses, Echoing::Silent];
    for ((noise, echoing), seed) in mixed.into_iter().flat_map(|noise| kinds.map(|kind| (noise, kind))).zip(1..) {
        for words in [1, 4, 16] {
            let line = NoisyLine::new(format(19_200), noise, echoing, seed);
            let came = by_bus(READS, words, format(19_200), &line);
            assert_eq!(came.wrong, 0, "{noise:?}, {echoing:?}, {words} words: {came:?}");
        }
    }
}
