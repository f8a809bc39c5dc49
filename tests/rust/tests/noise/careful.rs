//! The master that a careful engineer writes in an afternoon: a gap of 3.5 characters, three repetitions, and after each
//! failure an echo of a fresh word before anything else is asked. It knows nothing of answers that overtake each other.

use std::time::Duration;

use drivebus_rtu::{Adu, Frame, Instant, Request, SerialFormat, UnitAddress};

use super::line::{Chance, NoisyLine};

pub(crate) struct Careful {
    line: NoisyLine,
    format: SerialFormat,
    timeout: Duration,
    words: Chance,
    /// When the last character came or went.
    last: Instant,
    is_dirty: bool,
}

const REPEATS: usize = 3;
const ECHOES: usize = 3;

impl Careful {
    pub(crate) fn new(line: NoisyLine, format: SerialFormat, timeout: Duration) -> Self {
        Self { line, format, timeout, words: Chance(7), last: Instant::ZERO, is_dirty: false }
    }

    /// Lets pass what comes until there is silence.
    fn quiet(&mut self) {
        self.last = self.line.now();
        self.keeps_silence();
    }

    /// The same, from the last character on.
    fn keeps_silence(&mut self) {
        while self.line.next(self.last + self.format.t35()).is_some() {
            self.last = self.line.now();
        }
    }

    fn send(&mut self, request: &[u8]) -> Instant {
        self.keeps_silence();
        self.line.send_now(request)
    }

    /// The answer of `len` bytes, or less where there was silence; `None` where nothing came in time.
    fn receive(&mut self, sent: Instant, len: usize) -> Option<Vec<u8>> {
        let (mut came, limit) = (Vec::new(), sent + self.timeout);
        while came.len() < len && !(came.len() >= 5 && came[1] & 0x80 != 0) {
            let until = if came.is_empty() { limit } else { limit.min(self.last + self.format.t35()) };
            let byte = self.line.next(until)?;
            came.push(byte);
            self.last = self.line.now();
        }
        Some(came)
    }

    fn echoes(&mut self, unit: UnitAddress) -> bool {
        for _ in 0..ECHOES {
            self.quiet();
            let request = Request::echo(self.words.word());
            let adu = Adu::request(unit.into(), &request);
            let sent = self.send(adu.as_bytes());
            let mut came = Vec::new();
            while let Some(byte) = self.line.next(sent + self.timeout) {
                came.push(byte);
                self.last = self.line.now();
                if came.ends_with(adu.as_bytes()) {
                    self.quiet();
                    return true;
                }
            }
        }
        false
    }

    pub(crate) fn read(&mut self, unit: UnitAddress, address: u16, count: u16) -> Option<Vec<u16>> {
        let adu = Adu::request(unit.into(), &Request::read(address, count).unwrap());
        let len = 5 + 2 * usize::from(count);
        for _ in 0..=REPEATS {
            if self.is_dirty && !self.echoes(unit) {
                continue;
            }
            self.is_dirty = false;
            let sent = self.send(adu.as_bytes());
            if let Some(came) = self.receive(sent, len)
                && Frame::parse(&came).is_ok_and(|frame| frame.address() == unit.get() && frame.pdu()[0] == 3)
                && came.len() == len
            {
                return Some(came[3..len - 2].chunks(2).map(|two| u16::from_be_bytes([two[0], two[1]])).collect());
            }
            self.is_dirty = true;
        }
        None
    }
}
