//! CRC-16/MODBUS beside other crates, at sizes that occur on the line.
//!
//! 6 bytes are the body of a request, 8 a short frame, 11 the body of an answer with 4 words, 37 a frame with 16, 256 the
//! longest there is; 64 KiB is a capture. `crc-fast` multiplies without carries where the processor can.
#![allow(missing_docs, reason = "what criterion's macros make")]

mod short;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use drivebus_rtu::crc::{START, crc16, update_bitwise};

type Engine = fn(&[u8]) -> u16;

fn bitwise(data: &[u8]) -> u16 {
    data.iter().fold(START, |crc, &byte| update_bitwise(crc, byte))
}

fn by_crc_crate(data: &[u8]) -> u16 {
    const MODBUS: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS);
    MODBUS.checksum(data)
}

fn by_crc_crate_with_more_tables(data: &[u8]) -> u16 {
    const MODBUS: crc::Crc<u16, crc::Table<16>> = crc::Crc::<u16, crc::Table<16>>::new(&crc::CRC_16_MODBUS);
    MODBUS.checksum(data)
}

#[expect(clippy::cast_possible_truncation, reason = "a CRC of 16 bits")]
fn by_crc_fast(data: &[u8]) -> u16 {
    crc_fast::checksum(crc_fast::CrcAlgorithm::Crc16Modbus, data) as u16
}

fn checksum(c: &mut Criterion) {
    let engines: [(&str, Engine); 5] = [
        ("drivebus", crc16),
        ("crc", by_crc_crate),
        ("crc, 16 tables", by_crc_crate_with_more_tables),
        ("crc-fast", by_crc_fast),
        ("bit by bit", bitwise),
    ];
    let data: Vec<u8> = (0..65_536_u32).map(|n| n.wrapping_mul(0x9E37_79B9).to_le_bytes()[3]).collect();
    let mut group = c.benchmark_group("crc");
    for len in [6, 8, 11, 37, 256, 65_536] {
        group.throughput(Throughput::Bytes(len as u64));
        for (name, engine) in engines {
            assert_eq!(engine(&data[..len]), bitwise(&data[..len]), "{name}, {len} bytes");
            group.bench_with_input(BenchmarkId::new(name, len), &data[..len], |b, data| {
                b.iter(|| engine(black_box(data)));
            });
        }
    }
}

criterion_group! {
    name = benches;
    config = short::short();
    targets = checksum
}
criterion_main!(benches);
