//! The line under test: simulated drives with known words in them, a bus, and the clock that ends it all.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus_line::{Bus, BusOptions, CallError, CallOptions, Done, Line};
use drivebus_rtu::{Answer, DataBits, Instant, Parity, Request, SerialFormat, Silence, StopBits, UnitAddress};
use drivebus_sim::{FaultKind, Options, SimulatedLine, Simulator, Transmission};

use crate::Plan;
use crate::chance::Chance;
use crate::hand::Hand;
use crate::journal::Journal;
use crate::verdict::Verdict;

/// The units on the line.
pub const UNITS: [u8; 8] = [1, 2, 3, 4, 5, 6, 7, 8];
/// Short, so that a lost answer costs little; a request and the longest answer at 115 200 bit/s take 7 ms.
const TIMEOUT: Duration = Duration::from_millis(30);
/// Of delayed answers, at most: within the time-out.
const DELAY: Duration = Duration::from_millis(10);
/// Of late answers, at least: beyond the time-out.
const LATE: Duration = Duration::from_millis(35);
/// Of answers that others pass, at least and at most: 1.1 to 4 time-outs.
const OVERTAKEN: (Duration, Duration) = (Duration::from_millis(33), Duration::from_millis(120));
const OUT: Duration = Duration::from_millis(100);
/// Calls until everybody asks another unit.
const FOCUS: u64 = 50;
/// P14.03: how long a unit takes to answer.
const RESPONSE_DELAY: u16 = 0x0E03;
/// What makes a drive obey the bus: P00.01, P00.02 and P00.06; and P00.03 and P00.04, so that every setpoint is allowed.
const OBEY: [(u16, u16); 5] = [(0x0003, 63_000), (0x0004, 63_000), (0x0001, 2), (0x0002, 0), (0x0006, 8)];
/// Words that are written once and then read: their first address and how many follow one another.
pub(crate) const BLOCKS: [(u16, u16); 2] = [(0x2002, 7), (0x0206, 3)];

/// The word that stands at `address` of `unit` in one of the [`BLOCKS`]: no other place has the same.
pub(crate) fn known(unit: u8, address: u16) -> u16 {
    match address {
        // Percentages with one decimal: at most 1000.
        0x2000..=0x20FF => u16::from(unit) * 100 + address % 0x100,
        _ => u16::from(unit) * 0x1000 + address,
    }
}

/// The line under test.
#[derive(Debug)]
pub struct Rig {
    pub(crate) bus: Arc<Bus>,
    pub(crate) journal: Journal,
    simulator: Simulator,
    wire: SimulatedLine,
    hand: Mutex<Hand>,
    end: Instant,
    begin: Instant,
    calls: AtomicU64,
    most_calls: u64,
}

impl Rig {
    /// A line with known words in its drives, and the faults of `plan`.
    pub(crate) fn new(plan: &Plan) -> Result<Self, String> {
        let format = SerialFormat::new(115_200, DataBits::Eight, Parity::None, StopBits::One, Silence::Spec)
            .map_err(|error| error.to_string())?;
        let units = UNITS.map(|unit| (unit, "gd350"));
        let simulator = Simulator::new(units, Options::default().format(format).seed(plan.seed))
            .map_err(|error| error.to_string())?;
        let plugged = simulator.clone();
        let opener = Box::new(move || Ok(Box::new(plugged.open_line()?) as Box<dyn Line>));
        let options = BusOptions::new(format).timeout(TIMEOUT);
        let bus = Bus::open(opener, options, &mut || false).map_err(|error| error.to_string())?;
        let drives = UNITS.iter().filter_map(|&unit| simulator.drive(unit).ok()).collect();
        let wire = simulator.wire();
        let hand = Hand::new(Chance::new(plan.seed ^ 0x4A4D), plan.pull_every, simulator.now());
        let mut rig = Self {
            bus: Arc::new(bus),
            journal: Journal::new(drives),
            wire,
            hand: Mutex::new(hand),
            begin: simulator.now(),
            end: simulator.now() + plan.time,
            simulator,
            calls: AtomicU64::new(0),
            most_calls: plan.calls,
        };
        rig.fill().map_err(|error| error.to_string())?;
        if !plan.whole {
            rig.show_lengths()?;
        }
        rig.begin = rig.simulator.now();
        rig.end = rig.begin + plan.time;
        rig.spoil(plan).map_err(|error| error.to_string())?;
        Ok(rig)
    }

    /// Writes the known words, on a line that is still good.
    fn fill(&self) -> Result<(), Box<CallError>> {
        for unit in UNITS {
            let blocks = BLOCKS.into_iter().flat_map(|(first, count)| first..first + count);
            let words = blocks.map(|address| (address, known(unit, address)));
            for (address, value) in [(RESPONSE_DELAY, 0)].into_iter().chain(OBEY).chain(words) {
                self.ask(unit, &Request::write(address, value), CallOptions::default(), &mut |_| ())?;
            }
            self.journal.forget(unit);
        }
        self.calls.store(0, Ordering::Relaxed);
        Ok(())
    }

    /// Each unit answers once with another number of words than it was asked for, on a line that is still good.
    fn show_lengths(&self) -> Result<(), String> {
        for unit in UNITS {
            self.wire.script(&[(1, FaultKind::Long)]);
            let read = Request::read(BLOCKS[0].0, 1).map_err(|error| error.to_string())?;
            if self.ask(unit, &read, CallOptions::default().retries(0), &mut |_| ()).is_ok() {
                return Err(format!("unit {unit} gave as many words as it was asked for"));
            }
        }
        self.calls.store(0, Ordering::Relaxed);
        Ok(())
    }

    fn spoil(&self, plan: &Plan) -> Result<(), drivebus_sim::SimError> {
        for kind in FaultKind::ALL {
            let rate = match kind {
                FaultKind::Unplug => plan.unplug_rate,
                FaultKind::Short | FaultKind::Long if plan.whole => 0.0,
                _ => plan.rate,
            };
            self.wire.set_rate(kind, rate)?;
        }
        self.wire.set_delay(DELAY);
        self.wire.set_late(LATE);
        self.wire.set_overtaken(OVERTAKEN.0, OVERTAKEN.1);
        self.wire.set_replug(OUT);
        Ok(())
    }

    /// Whether there is more to do.
    pub(crate) fn goes_on(&self) -> bool {
        self.calls.load(Ordering::Relaxed) < self.most_calls && self.simulator.now() < self.end
    }

    /// The unit that everybody asks now: a reply is most easily taken for another one's while its unit is asked again.
    pub(crate) fn focus(&self) -> u8 {
        let turn = self.calls.load(Ordering::Relaxed) / FOCUS;
        usize::try_from(turn).ok().and_then(|turn| UNITS.get(turn % UNITS.len())).copied().unwrap_or(1)
    }

    /// One call of the bus.
    pub(crate) fn ask(
        &self,
        unit: u8,
        request: &Request<'_>,
        options: CallOptions,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        self.calls.fetch_add(1, Ordering::Relaxed);
        // All units of the rig are 1..=8.
        let unit = UnitAddress::new(unit).unwrap_or(UnitAddress::MIN);
        self.bus.call(unit.into(), request, options, &mut || false, take)
    }

    /// Sets `words` from `first` on at the keypad of `unit`.
    pub(crate) fn set(&self, unit: u8, first: u16, words: &[u16]) -> Result<(), String> {
        let drive = self.simulator.drive(unit).map_err(|error| error.to_string())?;
        let mut set = (first..).zip(words).map(|(address, &word)| drive.set_parameter(address, word));
        set.try_for_each(|done| done.map_err(|code| format!("{code:?}")))
    }

    /// So many calls were made by the bus itself.
    pub(crate) fn called(&self, times: usize) {
        self.calls.fetch_add(times as u64, Ordering::Relaxed);
    }

    /// Lets the hand do what is due, unless another thread does.
    pub(crate) fn tend(&self) {
        if let Ok(mut hand) = self.hand.try_lock() {
            hand.act(&self.wire, self.simulator.now());
        }
    }

    pub(crate) fn now(&self) -> Instant {
        self.simulator.now()
    }

    /// The last transmissions on the wire.
    pub(crate) fn trace(&self) -> Vec<Transmission> {
        self.wire.trace()
    }

    /// What is known of the whole run.
    pub(crate) fn conclude(&self, verdict: &mut Verdict) {
        let stats = self.bus.stats();
        verdict.requests = stats.total.requests;
        verdict.reconnects = stats.reconnects;
        verdict.late_frames = stats.total.late;
        verdict.silence_violations = self.wire.silence_violations();
        verdict.calls = self.calls.load(Ordering::Relaxed);
        verdict.simulated = self.simulator.now().saturating_duration_since(self.begin);
        let kinds = self.wire.rates().into_iter().map(|(kind, _)| (kind.name(), self.wire.counts(kind)));
        verdict.faults = kinds.collect();
        let pulls = self.hand.lock().map_or(0, |hand| hand.pulls);
        verdict.faults.push(("pulled out by hand", pulls));
        verdict.faults.push(("requests echoed", stats.total.own_echoes));
        verdict.words_lost = self.journal.words_lost();
    }
}
