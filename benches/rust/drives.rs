//! 10 000 simulated drives in virtual time on one core: how much faster than real time they run.
//!
//! Every motor ramps all the time, and every line is polled at wire speed (19 200 bit/s, 8E1, answers at once): the state
//! word of one drive after the other. How many requests that makes in a second depends on how many lines the drives are
//! on, so three layouts are measured: full lines, lines of eight, and a line for each drive. "looks" are looks at every
//! shaft from outside, as a simulated plant would take them, a hundred a second beside the polling of full lines.
//!
//! Lines take turns every tenth of a virtual second. Prints JSON.
//!
//! `cargo run --release -p drivebus-benches --example drives [SECONDS_EACH [LAYOUT]]`
#![allow(clippy::unwrap_used, reason = "a benchmark may panic")]
#![allow(clippy::print_stdout, reason = "its result")]

use std::time::Duration;

use drivebus_line::{AdapterEcho, Bus, BusOptions, CallOptions, Line};
use drivebus_rtu::{Destination, FIRST_CONTACT, Instant, Request, SerialFormat, UnitAddress};
use drivebus_sim::{Options, SimulatedDrive, Simulator};

const DRIVES: usize = 10_000;
const STATE: u16 = 0x2100;
const SETPOINT: u16 = 0x2001;
const COMMAND: u16 = 0x2000;
const FORWARD: u16 = 1;
/// The drives obey the bus and answer at once; from 0 to 50 Hz they take 10 s.
const SETTINGS: [(u16, u16); 3] = [(0x0001, 2), (0x0006, 8), (0x0E03, 0)];
/// How long a ramp lasts before it turns round: from 10 Hz to 40 Hz take 6 s.
const RAMP: Duration = Duration::from_secs(6);
const LOOK: Duration = Duration::from_millis(10);
/// How far one line runs before the next does.
const SLICE: Duration = Duration::from_millis(100);

/// A line with its drives and its master.
struct Polled {
    simulator: Simulator,
    bus: Bus,
    units: Vec<UnitAddress>,
    next: usize,
    turn_at: Instant,
    rising: bool,
}

impl Polled {
    fn new(units: u8) -> Self {
        let simulator = Simulator::new((1..=units).map(|unit| (unit, "gd350")), Options::default()).unwrap();
        for unit in 1..=units {
            for (address, word) in SETTINGS {
                simulator.drive(unit).unwrap().set_parameter(address, word).unwrap();
            }
        }
        let mut line: Option<Box<dyn Line>> = Some(Box::new(simulator.line()));
        let options = BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent);
        let bus = Bus::open(Box::new(move || Ok(line.take().unwrap())), options, &mut || false).unwrap();
        bus.sleep(FIRST_CONTACT, &mut || false);
        let units = (1..=units).map(|unit| UnitAddress::new(unit).unwrap()).collect();
        let turn_at = bus.now();
        let polled = Self { simulator, bus, units, next: 0, turn_at, rising: false };
        polled.call(Destination::Broadcast, &Request::write(SETPOINT, 1_000));
        polled.call(Destination::Broadcast, &Request::write(COMMAND, FORWARD));
        polled
    }

    fn call(&self, destination: Destination, request: &Request<'_>) {
        self.bus.call(destination, request, CallOptions::default(), &mut || false, &mut |_| ()).unwrap();
    }

    /// Polls until `until`.
    fn run(&mut self, until: Instant) {
        while self.bus.now() < until {
            self.step();
        }
    }

    /// Polls the next drive; turns the ramps round when it is time.
    fn step(&mut self) {
        if self.bus.now() >= self.turn_at {
            self.turn_at = self.turn_at + RAMP;
            self.rising = !self.rising;
            self.call(Destination::Broadcast, &Request::write(SETPOINT, if self.rising { 4_000 } else { 1_000 }));
        }
        self.call(self.units[self.next].into(), &Request::read(STATE, 1).unwrap());
        self.next = (self.next + 1) % self.units.len();
    }
}

/// What this process has had of a processor.
fn processor_time() -> Duration {
    rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime).try_into().unwrap()
}

/// Runs the layout for about `budget`; says how it went.
fn measure(lines: usize, looks: bool, budget: Duration) -> String {
    let least = DRIVES / lines;
    let more = DRIVES % lines;
    let units = |line: usize| u8::try_from(least + usize::from(line < more)).unwrap();
    let mut polled: Vec<Polled> = (0..lines).map(|line| Polled::new(units(line))).collect();
    let drives: Vec<SimulatedDrive> = polled
        .iter()
        .flat_map(|line| line.units.iter().map(|unit| line.simulator.drive(unit.get()).unwrap()))
        .collect();
    // Each drive is asked for the first time before anything counts.
    for _ in 0..=least {
        polled.iter_mut().for_each(Polled::step);
    }
    let begin = polled.iter().map(|line| line.bus.now()).max().unwrap();
    for line in &mut polled {
        line.run(begin);
    }
    let requests = |polled: &[Polled]| polled.iter().map(|line| line.simulator.wire().requests()).sum::<u64>();
    let asked = requests(&polled);
    let mut until = begin;
    let (mut looked, mut turning) = (0_u64, 0_u64);
    let started = processor_time();
    while processor_time().saturating_sub(started) < budget {
        until = until + if looks { LOOK } else { SLICE };
        for line in &mut polled {
            line.run(until);
        }
        if looks {
            looked += drives.len() as u64;
            turning += drives.iter().filter(|drive| drive.frequency() > 0.0).count() as u64;
        }
    }
    let took = processor_time().saturating_sub(started);
    let ran = until.saturating_duration_since(begin);
    let asked = requests(&polled) - asked;
    assert_eq!(looked, turning, "every motor turns");
    assert!(drives.iter().all(|drive| drive.state() == "forward"));
    let violations: u64 = polled.iter().map(|line| line.simulator.wire().silence_violations()).sum();
    assert_eq!(violations, 0);
    let times = ran.as_secs_f64() / took.as_secs_f64();
    #[expect(clippy::cast_precision_loss, reason = "far from 2^53")]
    let each = took.as_secs_f64() * 1e9 / asked as f64;
    format!(
        "{{\"drives\": {DRIVES}, \"lines\": {lines}, \"looks\": {looks}, \"virtual_seconds\": {:.3}, \"seconds\": {:.3}, \
         \"times_real_time\": {times:.1}, \"requests\": {asked}, \"nanoseconds_each\": {each:.0}, \"looked\": {looked}}}",
        ran.as_secs_f64(),
        took.as_secs_f64(),
    )
}

fn main() {
    let seconds = std::env::args().nth(1).and_then(|seconds| seconds.parse().ok()).unwrap_or(2.0);
    let budget = Duration::from_secs_f64(seconds);
    let layouts = [(41, false), (1_250, false), (DRIVES, false), (41, true)];
    let only: Option<usize> = std::env::args().nth(2).and_then(|place| place.parse().ok());
    let chosen = layouts.iter().enumerate().filter(|&(place, _)| only.is_none_or(|only| only == place));
    let results: Vec<String> = chosen.map(|(_, &(lines, looks))| measure(lines, looks, budget)).collect();
    println!("[\n {}\n]", results.join(",\n "));
}
