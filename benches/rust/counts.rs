//! The hot path, one function a step, for counting its instructions: `tools/count_instructions.py` runs this under
//! callgrind, which counts what happens between entering and leaving each function of `measured`.
//!
//! Instructions do not depend on what else the machine does, so a test can hold them to a bound. Each function does its
//! step `STEPS` times; the tool divides. Nothing here is timed.
#![allow(clippy::unwrap_used, reason = "a benchmark may panic")]

use std::hint::black_box;
use std::sync::Arc;

use drivebus_benches::{Ready, bus_on};
use drivebus_drives::{Entry, Profile, ReadPlan};
use drivebus_line::{Bus, CallOptions};
use drivebus_rtu::{Adu, Answer, Duration, Event, Frame, Framer, Instant, Master, Request, SerialFormat, UnitAddress};
use drivebus_sim::{Options, Simulator};

/// How often each step is done while it is counted. The tool reads this line.
const STEPS: usize = 20;

fn main() {
    let bytes: Vec<u8> = (0..=255).collect();
    for _warm in 0..2 {
        measured::crc_of_8_bytes(&bytes[..8]);
        measured::crc_of_37_bytes(&bytes[..37]);
        measured::crc_of_256_bytes(&bytes);
        measured::encode_a_read(&mut Adu::new());
        let answer = Adu::answer(UnitAddress::MIN, &Answer::read(&[7; 16]).unwrap());
        measured::decode_an_answer_of_16_words(answer.as_bytes());
        measured::find_a_frame_whole(&mut Framer::new(Duration::from_micros(1_750)), answer.as_bytes());
        measured::find_a_frame_byte_by_byte(&mut Framer::new(Duration::from_micros(1_750)), answer.as_bytes());
        measured::master_reads_16_words(&mut Master::new(&SerialFormat::DEFAULT), answer.as_bytes());
        one_exchange_in_its_steps(answer.as_bytes());
        let profile = Profile::builtin("gd350").unwrap();
        let entries: Vec<&Entry> = profile.monitor().collect();
        measured::plan_the_monitor_list(&profile, &entries);
        let plan = profile.compile(&entries).unwrap();
        measured::decode_the_monitor_list(&plan, &vec![1_234; plan.words()]);
    }
    let simulator = Simulator::new([(1, "gd350")], Options::default()).unwrap();
    let (simulated, alone) = (bus_on(simulator.line()), bus_on(Ready::new()));
    for _warm in 0..2 {
        measured::bus_reads_from_the_simulator(&simulated);
        measured::bus_reads_alone(&alone);
    }
}

/// Each call of a master that has a UART and no thread, with a master for each time that it is counted.
fn one_exchange_in_its_steps(wire: &[u8]) {
    let masters = &mut vec![Master::new(&SerialFormat::DEFAULT); STEPS];
    let (last, first) = wire.split_last().unwrap();
    measured::master_begins_a_read(masters);
    measured::master_hands_out_the_request(masters);
    measured::master_polls_in_vain(masters);
    measured::master_takes_36_bytes_one_by_one(masters, first.try_into().unwrap());
    measured::master_takes_the_last_byte(masters, *last);
}

/// What begins and ends with a name of `measured` is counted, so what those functions pass on stands here.
fn read_16_words(bus: &Bus) {
    let request = Request::read(0x3000, 16).unwrap();
    let mut target = [0; 16];
    for _ in 0..STEPS {
        bus.call(UnitAddress::MIN.into(), &request, CallOptions::default(), &mut || false, &mut |answer| {
            copy(&answer, &mut target);
        })
        .unwrap();
        black_box(&target);
    }
}

fn copy(answer: &Answer<'_>, target: &mut [u16; 16]) {
    let Answer::Read { words, .. } = answer else { return };
    words.iter().zip(target).for_each(|(word, place)| *place = word);
}

fn found(framer: &mut Framer, now: Instant) -> usize {
    let mut count = 0;
    while let Some(event) = framer.poll(now) {
        count += usize::from(event.is_ok());
    }
    count
}

/// `black_box(line!())` keeps the compiler from making one function of two that do the same.
mod measured {
    use super::{
        Adu, Arc, Bus, Duration, Entry, Event, Frame, Framer, Instant, Master, Profile, ReadPlan, Request, STEPS,
        UnitAddress, black_box, copy, found, read_16_words,
    };

    const AT: Instant = Instant::from_nanos(0);
    /// The line has been silent for long by then.
    const LATER: Instant = Instant::from_nanos(1_000_000_000);

    #[inline(never)]
    pub(super) fn crc_of_8_bytes(data: &[u8]) {
        black_box(line!());
        for _ in 0..STEPS {
            black_box(drivebus_rtu::crc16(black_box(data)));
        }
    }

    #[inline(never)]
    pub(super) fn crc_of_37_bytes(data: &[u8]) {
        black_box(line!());
        for _ in 0..STEPS {
            black_box(drivebus_rtu::crc16(black_box(data)));
        }
    }

    #[inline(never)]
    pub(super) fn crc_of_256_bytes(data: &[u8]) {
        black_box(line!());
        for _ in 0..STEPS {
            black_box(drivebus_rtu::crc16(black_box(data)));
        }
    }

    #[inline(never)]
    pub(super) fn encode_a_read(adu: &mut Adu) {
        black_box(line!());
        for _ in 0..STEPS {
            adu.set_request(black_box(UnitAddress::MIN).into(), &Request::read(black_box(0x3000), 16).unwrap());
            black_box(adu.as_bytes());
        }
    }

    #[inline(never)]
    pub(super) fn decode_an_answer_of_16_words(wire: &[u8]) {
        black_box(line!());
        let expected = Request::read(0x3000, 16).unwrap().expected();
        let mut words = [0; 16];
        for _ in 0..STEPS {
            let frame = Frame::parse(black_box(wire)).unwrap();
            copy(&expected.judge_frame(UnitAddress::MIN, &frame).unwrap(), &mut words);
            black_box(&words);
        }
    }

    #[inline(never)]
    pub(super) fn find_a_frame_whole(framer: &mut Framer, wire: &[u8]) {
        black_box(line!());
        let expected = Request::read(0x3000, 16).unwrap().expected();
        let now = Instant::from_nanos(0);
        for _ in 0..STEPS {
            framer.expect(UnitAddress::MIN, expected);
            framer.receive(now, black_box(wire));
            assert_eq!(found(framer, now), 1);
        }
    }

    #[inline(never)]
    pub(super) fn find_a_frame_byte_by_byte(framer: &mut Framer, wire: &[u8]) {
        black_box(line!());
        let expected = Request::read(0x3000, 16).unwrap().expected();
        let now = Instant::from_nanos(0);
        for _ in 0..STEPS {
            framer.expect(UnitAddress::MIN, expected);
            let mut count = 0;
            for byte in wire.chunks(1) {
                framer.receive(now, black_box(byte));
                count += found(framer, now);
            }
            assert_eq!(count, 1);
        }
    }

    #[inline(never)]
    pub(super) fn master_reads_16_words(master: &mut Master, wire: &[u8]) {
        black_box(line!());
        let request = Request::read(0x3000, 16).unwrap();
        let mut now = Instant::from_nanos(0);
        for _ in 0..STEPS {
            master.begin(now, UnitAddress::MIN.into(), &request, Duration::from_millis(500)).unwrap();
            now = master.deadline().unwrap_or(now);
            assert!(matches!(master.poll(now), Some(Event::Transmit(_))));
            master.sent(now);
            master.receive(now, black_box(wire));
            assert!(matches!(master.poll(now), Some(Event::Answer(_))));
        }
    }

    #[inline(never)]
    pub(super) fn master_begins_a_read(masters: &mut [Master]) {
        black_box(line!());
        for master in masters {
            let request = Request::read(black_box(0x3000), 16).unwrap();
            master.begin(AT, UnitAddress::MIN.into(), &request, Duration::from_millis(500)).unwrap();
        }
    }

    #[inline(never)]
    pub(super) fn master_hands_out_the_request(masters: &mut [Master]) {
        black_box(line!());
        for master in masters {
            assert!(matches!(master.poll(LATER), Some(Event::Transmit(_))));
            master.sent(LATER);
        }
    }

    #[inline(never)]
    pub(super) fn master_polls_in_vain(masters: &mut [Master]) {
        black_box(line!());
        for master in masters {
            assert!(black_box(master.poll(black_box(LATER))).is_none());
        }
    }

    #[inline(never)]
    pub(super) fn master_takes_36_bytes_one_by_one(masters: &mut [Master], bytes: &[u8; 36]) {
        black_box(line!());
        for master in masters {
            for byte in bytes.chunks(1) {
                master.receive(LATER, black_box(byte));
                assert!(black_box(master.poll(LATER)).is_none());
            }
        }
    }

    #[inline(never)]
    pub(super) fn master_takes_the_last_byte(masters: &mut [Master], byte: u8) {
        black_box(line!());
        for master in masters {
            master.receive(LATER, black_box(&[byte]));
            assert!(matches!(master.poll(LATER), Some(Event::Answer(_))));
        }
    }

    #[inline(never)]
    pub(super) fn plan_the_monitor_list(profile: &Arc<Profile>, entries: &[&Entry]) {
        black_box(line!());
        for _ in 0..STEPS {
            black_box(profile.compile(black_box(entries)).unwrap());
        }
    }

    #[inline(never)]
    pub(super) fn decode_the_monitor_list(plan: &ReadPlan, words: &[u16]) {
        black_box(line!());
        for _ in 0..STEPS {
            for value in plan.values(black_box(words)) {
                black_box(value);
            }
        }
    }

    #[inline(never)]
    pub(super) fn bus_reads_from_the_simulator(bus: &Bus) {
        black_box(line!());
        read_16_words(bus);
    }

    #[inline(never)]
    pub(super) fn bus_reads_alone(bus: &Bus) {
        black_box(line!());
        read_16_words(bus);
    }
}
