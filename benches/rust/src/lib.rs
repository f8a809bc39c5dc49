//! Lines and buses that the benchmarks share.
#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "a benchmark may panic")]

use drivebus_line::{AdapterEcho, Bus, BusOptions, Line, PortError};
use drivebus_rtu::{Adu, Answer, FIRST_CONTACT, Instant, SerialFormat, UnitAddress};

/// A bus that was open for long enough to trust its unit.
pub fn bus_on(line: impl Line + 'static) -> Bus {
    let mut line: Option<Box<dyn Line>> = Some(Box::new(line));
    let options = BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent);
    let bus = Bus::open(Box::new(move || Ok(line.take().unwrap())), options, &mut || false).unwrap();
    bus.sleep(FIRST_CONTACT, &mut || false);
    bus
}

/// A line that always has the answer of 16 words: what is counted is the bus alone.
#[derive(Debug)]
pub struct Ready {
    now: Instant,
    answer: Adu,
    asked: bool,
}

impl Ready {
    /// A line whose unit 1 answers every request with 16 words.
    pub fn new() -> Self {
        let answer = Adu::answer(UnitAddress::MIN, &Answer::read(&[7; 16]).unwrap());
        Self { now: Instant::ZERO, answer, asked: false }
    }
}

impl Default for Ready {
    fn default() -> Self {
        Self::new()
    }
}

impl Line for Ready {
    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, _: &[u8]) -> Result<Instant, PortError> {
        self.asked = true;
        Ok(self.now)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        if !self.asked {
            self.now = self.now.max(until);
            return Ok(0);
        }
        self.asked = false;
        let bytes = self.answer.as_bytes();
        buffer[..bytes.len()].copy_from_slice(bytes);
        Ok(bytes.len())
    }

    fn sleep(&mut self, until: Instant) {
        self.now = self.now.max(until);
    }

    fn name(&self) -> String {
        String::from("ready")
    }

    fn is_virtual(&self) -> bool {
        true
    }
}
