//! What a read costs above the protocol: the planner, the owner of the bus, the simulated line, and tokio-modbus.
//!
//! The lines have no pace. `Ready` has every answer at once, so what is measured is the bus, or the client, alone.
#![allow(missing_docs, reason = "what criterion's macros make")]
#![allow(clippy::unwrap_used, reason = "a benchmark may panic")]

mod short;

use std::hint::black_box;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};

use criterion::{Criterion, criterion_group, criterion_main};
use drivebus_benches::{Ready, bus_on};
use drivebus_drives::{Entry, Profile};
use drivebus_line::{Bus, CallOptions};
use drivebus_rtu::{Adu, Answer, Request, UnitAddress};
use drivebus_sim::{Options, Simulator};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio_modbus::client::{Reader, rtu};
use tokio_modbus::slave::Slave;

fn read(bus: &Bus) -> u16 {
    let request = Request::read(black_box(0x3000), 16).unwrap();
    let mut last = 0;
    bus.call(UnitAddress::MIN.into(), &request, CallOptions::default(), &mut || false, &mut |answer| {
        if let Answer::Read { words, .. } = answer {
            last = words.iter().last().unwrap_or(0);
        }
    })
    .unwrap();
    last
}

fn buses(c: &mut Criterion) {
    let mut group = c.benchmark_group("read of 16 words");
    let alone = bus_on(Ready::new());
    group.bench_function("drivebus, a line that has the answer", |b| b.iter(|| read(&alone)));
    let simulator = Simulator::new([(1, "gd350")], Options::default()).unwrap();
    let simulated = bus_on(simulator.line());
    group.bench_function("drivebus, the simulated line in virtual time", |b| b.iter(|| read(&simulated)));
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let mut client = rtu::attach_slave(Answering::new(), Slave(1));
    group.bench_function("tokio-modbus, a stream that has the answer", |b| {
        b.iter(|| runtime.block_on(client.read_holding_registers(black_box(0x3000), 16)).unwrap().unwrap().len());
    });
}

fn planner(c: &mut Criterion) {
    let profile = Profile::builtin("gd350").unwrap();
    let entries: Vec<&Entry> = profile.monitor().collect();
    let mut group = c.benchmark_group("monitor list of a GD350");
    group.bench_function("plan", |b| b.iter(|| profile.compile(black_box(&entries)).unwrap()));
    let plan = profile.compile(&entries).unwrap();
    let words = vec![1_234; plan.words()];
    group.bench_function("decode", |b| {
        b.iter(|| {
            for value in plan.values(black_box(&words)) {
                black_box(value);
            }
        });
    });
}

/// For tokio-modbus what `Ready` is for the bus.
#[derive(Debug)]
struct Answering {
    answer: Adu,
    /// How many bytes of the answer are still to be read.
    left: usize,
}

impl Answering {
    fn new() -> Self {
        Self { answer: Adu::answer(UnitAddress::MIN, &Answer::read(&[7; 16]).unwrap()), left: 0 }
    }
}

impl AsyncRead for Answering {
    fn poll_read(mut self: Pin<&mut Self>, _: &mut Context<'_>, buffer: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        if self.left == 0 {
            return Poll::Pending;
        }
        let wire = self.answer.as_bytes();
        let count = self.left.min(buffer.remaining());
        let first = wire.len() - self.left;
        buffer.put_slice(&wire[first..first + count]);
        self.left -= count;
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Answering {
    fn poll_write(mut self: Pin<&mut Self>, _: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        self.left = self.answer.as_bytes().len();
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

criterion_group! {
    name = benches;
    config = short::short();
    targets = buses, planner
}
criterion_main!(benches);
