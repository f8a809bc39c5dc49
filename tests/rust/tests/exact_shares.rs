//! The line is idle only when the protocol says so: the bus in virtual time, on the wire's own record, to the nanosecond.
//!
//! The shortest cycle is: the request's characters, 3.5 characters of silence, the answer's characters, 3.5 characters of
//! silence. The figures below are worked out by hand from *Modbus over Serial Line* V1.02, 2.5.1.1: a character of 8E1 has
//! 11 bits, the silence has 38.5 bits up to 19 200 bit/s and lasts 1.75 ms above; each is rounded up to a whole
//! nanosecond. What the code under test says about them is not asked.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use drivebus_line::{AdapterEcho, Bus, BusOptions, CallOptions, Line};
use drivebus_rtu::{
    DataBits, Destination, FIRST_CONTACT, Parity, Request, SerialFormat, Silence, StopBits, UnitAddress,
};
use drivebus_sim::{Options, Side, Simulator};

/// Answers begin as soon as they may: P14.03 is 0.
const RESPONSE_DELAY: u16 = 0x0E03;
const CYCLES: usize = 20;

/// What things take at one speed, in nanoseconds.
struct Speed {
    baud_rate: u32,
    /// 3.5 characters, or 1.75 ms.
    silence: u64,
    /// An answer with one word: 7 characters.
    one_word: u64,
    /// A read, a 06H and its answer, the answer to 10H: 8 characters.
    short_frame: u64,
    /// A 10H with two words: 13 characters.
    write_of_two: u64,
    /// An answer with 16 words: 37 characters.
    sixteen_words: u64,
}

/// 11 bits a character: 7, 8, 13 and 37 characters are 77, 88, 143 and 407 bits.
const SPEEDS: [Speed; 3] = [
    Speed {
        baud_rate: 9_600,
        silence: 4_010_417,
        one_word: 8_020_834,
        short_frame: 9_166_667,
        write_of_two: 14_895_834,
        sixteen_words: 42_395_834,
    },
    Speed {
        baud_rate: 19_200,
        silence: 2_005_209,
        one_word: 4_010_417,
        short_frame: 4_583_334,
        write_of_two: 7_447_917,
        sixteen_words: 21_197_917,
    },
    Speed {
        baud_rate: 115_200,
        silence: 1_750_000,
        one_word: 668_403,
        short_frame: 763_889,
        write_of_two: 1_241_320,
        sixteen_words: 3_532_987,
    },
];

/// A bus on a line with two drives that answer at once; both are known to it.
fn bench(speed: &Speed) -> (Simulator, Bus) {
    let format =
        SerialFormat::new(speed.baud_rate, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec).unwrap();
    let options = Options::default().format(format).strict_silence(true);
    let simulator = Simulator::new([(1, "gd350"), (2, "gd350")], options).unwrap();
    for unit in [1, 2] {
        simulator.drive(unit).unwrap().set_parameter(RESPONSE_DELAY, 0).unwrap();
    }
    let mut line: Option<Box<dyn Line>> = Some(Box::new(simulator.line()));
    let options = BusOptions::new(format).echo(AdapterEcho::Absent);
    let bus = Bus::open(Box::new(move || Ok(line.take().unwrap())), options, &mut || false).unwrap();
    bus.sleep(FIRST_CONTACT, &mut || false);
    for unit in [1, 2] {
        call(&bus, to(unit), &Request::read(0x2100, 1).unwrap());
    }
    (simulator, bus)
}

fn to(unit: u8) -> Destination {
    UnitAddress::new(unit).unwrap().into()
}

fn call(bus: &Bus, destination: Destination, request: &Request<'_>) {
    bus.call(destination, request, CallOptions::default(), &mut || false, &mut |_| ()).unwrap();
}

/// From the first bit of each of the master's last requests to that of the next, in nanoseconds.
fn cycles(simulator: &Simulator) -> Vec<u64> {
    let trace = simulator.wire().trace();
    let begins: Vec<u64> =
        trace.iter().filter(|sent| sent.side == Side::Master).map(|sent| sent.begin.as_nanos()).collect();
    let cycles: Vec<u64> = begins.windows(2).map(|pair| pair[1] - pair[0]).collect();
    cycles[cycles.len() - CYCLES..].to_vec()
}

/// The cycles of `CYCLES` times the same, `turn` by `turn`.
fn measured(speed: &Speed, turn: impl Fn(&Bus, usize)) -> Vec<u64> {
    let (simulator, bus) = bench(speed);
    (0..=CYCLES).for_each(|place| turn(&bus, place));
    assert_eq!(simulator.wire().silence_violations(), 0);
    cycles(&simulator)
}

#[test]
fn reads_of_one_unit() {
    for speed in &SPEEDS {
        for (count, answer) in [(1, speed.one_word), (16, speed.sixteen_words)] {
            let request = Request::read(0x3000, count).unwrap();
            let shortest = speed.short_frame + speed.silence + answer + speed.silence;
            let cycles = measured(speed, |bus, _| call(bus, to(1), &request));
            assert_eq!(cycles, [shortest; CYCLES], "{count} words at {} bit/s", speed.baud_rate);
        }
    }
}

#[test]
fn reads_of_two_units_in_turn() {
    for speed in &SPEEDS {
        let turns = [(to(1), Request::read(0x3000, 1).unwrap()), (to(2), Request::read(0x3000, 16).unwrap())];
        let cycles = measured(speed, |bus, place| call(bus, turns[place % 2].0, &turns[place % 2].1));
        let around = speed.short_frame + speed.silence + speed.silence;
        let expected = [around + speed.one_word, around + speed.sixteen_words];
        assert!(cycles.chunks(2).all(|pair| pair == expected), "{cycles:?} at {} bit/s", speed.baud_rate);
    }
}

#[test]
fn writes() {
    for speed in &SPEEDS {
        let words = [1_000, 500];
        let many = Request::write_many(0x2001, &words).unwrap();
        for (what, request, sent) in
            [("06H", Request::write(0x2001, 1_000), speed.short_frame), ("10H", many, speed.write_of_two)]
        {
            let shortest = sent + speed.silence + speed.short_frame + speed.silence;
            let cycles = measured(speed, |bus, _| call(bus, to(1), &request));
            assert_eq!(cycles, [shortest; CYCLES], "{what} at {} bit/s", speed.baud_rate);
        }
    }
}

/// Units are given 100 ms to act on a broadcast; the silence is over by then.
#[test]
fn a_read_after_each_broadcast() {
    const TURNAROUND: u64 = 100_000_000;
    for speed in &SPEEDS {
        let (write, read) = (Request::write(0x2001, 1_000), Request::read(0x3000, 1).unwrap());
        let cycles = measured(speed, |bus, place| match place % 2 {
            0 => call(bus, Destination::Broadcast, &write),
            _ => call(bus, to(1), &read),
        });
        let broadcast = speed.short_frame + TURNAROUND;
        let shortest = speed.short_frame + speed.silence + speed.one_word + speed.silence;
        assert!(cycles.chunks(2).all(|pair| pair == [broadcast, shortest]), "{cycles:?} at {} bit/s", speed.baud_rate);
    }
}
