//! Encode, decode, framer and master, at sizes that occur on the line, beside rmodbus where it has the like.
#![allow(missing_docs, reason = "what criterion's macros make")]
#![allow(clippy::unwrap_used, reason = "a benchmark may panic")]

mod short;

use std::hint::black_box;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use drivebus_rtu::{Adu, Answer, Duration, Event, Frame, Framer, Instant, Master, Request, SerialFormat, UnitAddress};
use rmodbus::ModbusProto;
use rmodbus::client::ModbusRequest;

const SILENCE: Duration = Duration::from_micros(1_750);

fn frames(c: &mut Criterion) {
    let unit = UnitAddress::MIN;
    let words: Vec<u16> = (0..16).map(|n| n * 4_099).collect();
    let mut group = c.benchmark_group("frame, drivebus");
    let mut adu = Adu::new();
    group.bench_function("encode a read", |b| {
        b.iter(|| {
            adu.set_request(black_box(unit).into(), &Request::read(black_box(0x3000), 16).unwrap());
            black_box(adu.as_bytes()).len()
        });
    });
    group.bench_function("encode a write of 16 words", |b| {
        b.iter(|| {
            adu.set_request(black_box(unit).into(), &Request::write_many(0x2000, black_box(&words)).unwrap());
            black_box(adu.as_bytes()).len()
        });
    });
    let answer = Adu::answer(unit, &Answer::read(&words).unwrap());
    let expected = Request::read(0x3000, 16).unwrap().expected();
    let mut target = [0_u16; 16];
    group.bench_function("decode an answer of 16 words", |b| {
        b.iter(|| {
            let frame = Frame::parse(black_box(answer.as_bytes())).unwrap();
            let Ok(Answer::Read { words, .. }) = expected.judge_frame(unit, &frame) else { return 0 };
            words.iter().zip(&mut target).for_each(|(word, place)| *place = word);
            target[15]
        });
    });
}

fn rmodbus(c: &mut Criterion) {
    let words: Vec<u16> = (0..16).map(|n| n * 4_099).collect();
    let mut group = c.benchmark_group("frame, rmodbus");
    let mut request = ModbusRequest::new(1, ModbusProto::Rtu);
    let mut wire = Vec::with_capacity(256);
    group.bench_function("encode a read", |b| {
        b.iter(|| {
            wire.clear();
            request.generate_get_holdings(black_box(0x3000), 16, &mut wire).unwrap();
            wire.len()
        });
    });
    let mut another = ModbusRequest::new(1, ModbusProto::Rtu);
    group.bench_function("encode a write of 16 words", |b| {
        b.iter(|| {
            wire.clear();
            another.generate_set_holdings_bulk(0x2000, black_box(&words), &mut wire).unwrap();
            wire.len()
        });
    });
    let answer = Adu::answer(UnitAddress::MIN, &Answer::read(&words).unwrap());
    let mut target = Vec::with_capacity(16);
    group.bench_function("decode an answer of 16 words", |b| {
        b.iter(|| {
            target.clear();
            request.parse_u16(black_box(answer.as_bytes()), &mut target).unwrap();
            target.len()
        });
    });
}

fn framer(c: &mut Criterion) {
    let unit = UnitAddress::MIN;
    let answer = Adu::answer(unit, &Answer::read(&[7; 16]).unwrap());
    let expected = Request::read(0x3000, 16).unwrap().expected();
    let noisy = [&[0x00, 0xFF][..], answer.as_bytes()].concat();
    let now = Instant::from_nanos(0);
    let mut group = c.benchmark_group("framer, answer of 16 words");
    for (name, wire, cut) in [
        ("whole", answer.as_bytes(), 64),
        ("byte by byte", answer.as_bytes(), 1),
        ("after two bytes of noise", &noisy[..], 64),
    ] {
        group.throughput(Throughput::Bytes(wire.len() as u64));
        group.bench_function(name, |b| {
            let mut framer = Framer::new(SILENCE);
            b.iter(|| {
                framer.expect(unit, expected);
                let mut found = 0;
                for chunk in wire.chunks(cut) {
                    framer.receive(now, black_box(chunk));
                    while let Some(event) = framer.poll(now) {
                        found += usize::from(event.is_ok());
                    }
                }
                found
            });
        });
    }
}

fn master(c: &mut Criterion) {
    let unit = UnitAddress::MIN;
    let answer = Adu::answer(unit, &Answer::read(&[7; 16]).unwrap());
    let request = Request::read(0x3000, 16).unwrap();
    c.bench_function("master, a read of 16 words from begin to answer", |b| {
        b.iter_batched_ref(
            || Master::new(&SerialFormat::DEFAULT),
            |master| {
                let begin = Instant::from_nanos(0);
                master.begin(begin, unit.into(), &request, Duration::from_millis(500)).unwrap();
                let go = master.deadline().unwrap_or(begin);
                assert!(matches!(master.poll(go), Some(Event::Transmit(_))));
                master.sent(go);
                master.receive(go, answer.as_bytes());
                matches!(master.poll(go), Some(Event::Answer(_)))
            },
            BatchSize::SmallInput,
        );
    });
}

criterion_group! {
    name = benches;
    config = short::short();
    targets = frames, rmodbus, framer, master
}
criterion_main!(benches);
