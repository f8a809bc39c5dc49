//! How well each unit could be reached lately: whether a motor should be started over such a link.

use drivebus_rtu::UnitAddress;

use crate::by_unit::ByUnit;
use crate::error::Failure;
use crate::line::PortErrorKind;

/// Of the last 10 exchanges with one unit, how many brought an answer; of fewer, while there were fewer.
///
/// An answer is good, a refusal too. Silence, a damaged or a wrong answer, and a port that was lost are not. What was
/// never sent, or given up by the caller, says nothing about the link and is not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Link {
    /// Exchanges that brought an answer.
    pub good: u32,
    /// Exchanges, 10 at most.
    pub asked: u32,
}

/// How many exchanges are remembered: enough to tell a bad link from one bad moment, and few enough that a link which
/// was repaired is good again after a second of polling.
const REMEMBERED: u32 = 10;

/// The links of a line.
#[derive(Debug, Default)]
pub(crate) struct Links(ByUnit<Ring>);

/// The last outcomes; the latest is the lowest bit, and 1 is good.
#[derive(Debug, Default)]
struct Ring {
    bits: u16,
    asked: u32,
}

impl Links {
    /// Keeps what became of one exchange with `unit`: an answer, or `failure`. Whether it was good, where that says anything of
    /// the link.
    pub(crate) fn note(&mut self, unit: UnitAddress, failure: Option<&Failure>) -> Option<bool> {
        let good = failure.map_or(Some(true), good);
        if let Some(good) = good {
            self.0.of(unit).push(good);
        }
        good
    }

    /// How well `unit` could be reached; nothing asked if it never was.
    pub(crate) fn of(&self, unit: UnitAddress) -> Link {
        self.0.get(unit).map(Ring::link).unwrap_or_default()
    }
}

impl Ring {
    fn push(&mut self, good: bool) {
        self.bits = (self.bits << 1 | u16::from(good)) & ((1 << REMEMBERED) - 1);
        self.asked = (self.asked + 1).min(REMEMBERED);
    }

    fn link(&self) -> Link {
        Link { good: self.bits.count_ones(), asked: self.asked }
    }
}

/// What `failure` says about the link, if anything.
fn good(failure: &Failure) -> Option<bool> {
    match failure {
        Failure::Refused { .. } => Some(true),
        Failure::NoAnswer { .. } | Failure::Unreached | Failure::Wrong(_) | Failure::Corrupt(_) => Some(false),
        Failure::Port(error) => (error.kind == PortErrorKind::Lost).then_some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use drivebus_rtu::{BeginError, ExceptionCode, FrameError};

    use crate::line::PortError;

    use super::*;

    fn unit(raw: u8) -> UnitAddress {
        UnitAddress::new(raw).unwrap()
    }

    const SILENCE: Failure = Failure::NoAnswer { timeout: Duration::from_millis(500), attempts: 1 };

    #[test]
    fn ten_are_remembered() {
        let mut links = Links::default();
        assert_eq!(links.of(unit(1)), Link { good: 0, asked: 0 });
        for asked in 1..=3 {
            links.note(unit(1), Some(&SILENCE));
            assert_eq!(links.of(unit(1)), Link { good: 0, asked });
        }
        // The three bad ones are forgotten one by one, after seven good ones.
        for (good, asked) in [(1, 4), (2, 5), (3, 6), (4, 7), (5, 8), (6, 9), (7, 10), (8, 10), (9, 10), (10, 10)] {
            links.note(unit(1), None);
            assert_eq!(links.of(unit(1)), Link { good, asked });
        }
        links.note(unit(1), Some(&SILENCE));
        assert_eq!(links.of(unit(1)), Link { good: 9, asked: 10 });
        assert_eq!(links.of(unit(2)), Link { good: 0, asked: 0 }, "each unit has its own");
    }

    #[test]
    fn what_says_nothing_about_the_link_is_not_counted() {
        let port = |kind| Failure::Port(PortError::new(kind, "line", "for a test"));
        let cases = [
            (Failure::Refused { function: 3, code: ExceptionCode(2) }, Some(true)),
            (Failure::NoAnswer { timeout: Duration::ZERO, attempts: 1 }, Some(false)),
            (Failure::Corrupt(FrameError::Crc { computed: 0, received: 1 }), Some(false)),
            (port(PortErrorKind::Lost), Some(false)),
            (port(PortErrorKind::NotFound), None),
            (Failure::NotBegun(BeginError::OutOfTurn), None),
            (Failure::ReadOnly { function: 6 }, None),
            (Failure::Busy { timeout: Duration::ZERO }, None),
            (Failure::Interrupted, None),
            (Failure::Closed, None),
        ];
        for (failure, expected) in cases {
            let mut links = Links::default();
            let name = format!("{failure:?}");
            links.note(unit(1), Some(&failure));
            let link = links.of(unit(1));
            let seen = (link.asked > 0).then_some(link.good == 1);
            assert_eq!(seen, expected, "{name}");
        }
    }
}
