//! What a master says: what becomes of a request, what was seen beside it, and why it was not begun.

use crate::{Answer, AnswerError, FrameError, UnitAddress};

/// What happens to a request. All but [`Transmit`](Self::Transmit) end it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Event<'a> {
    /// The line was silent long enough: send these bytes in one piece, then call [`crate::Master::sent`].
    Transmit(&'a [u8]),
    /// The unit answered, or refused with [`Answer::Exception`].
    Answer(Answer<'a>),
    /// The unit sent a whole frame that is not the answer. It may have done what was asked.
    Wrong {
        /// What is wrong with it.
        error: AnswerError,
        /// All of it.
        frame: &'a [u8],
    },
    /// An answer began and did not survive the line. The unit may have done what was asked.
    Corrupt {
        /// Why it is no frame.
        error: FrameError,
        /// The bytes, with the noise around them.
        bytes: &'a [u8],
    },
    /// The time is over. The unit may have done what was asked.
    NoAnswer {
        /// The beginning of an answer, or nothing.
        bytes: &'a [u8],
    },
    /// The broadcast was sent and the turnaround delay is over.
    BroadcastDone,
    /// The line was never silent long enough: nothing was sent.
    Busy,
}

/// What was seen on the line beside answers, since [`crate::Master::take_tally`]. Noise counts when its request ends. A count
/// that is full stays full.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub struct Tally {
    /// Whole frames that came when nothing was waited for, or from a unit in quarantine.
    pub late: u32,
    /// Whole frames of other units or functions while an answer was waited for.
    pub foreign: u32,
    /// Those of them that are of the unit that was asked.
    pub misfit: u32,
    /// Bytes that belong to no frame.
    pub noise: u32,
    /// Those of them that are 00H or FFH, as an idle line gives them that nothing pulls to its rest.
    pub noise_idle: u32,
    /// Requests that came back from the adapter itself.
    pub own_echo: u32,
    /// Requests beside whose answer came what may be left of them: then an adapter may have sent them back.
    pub own_remnant: u32,
}

impl Tally {
    pub(crate) const EMPTY: Self =
        Self { late: 0, foreign: 0, misfit: 0, noise: 0, noise_idle: 0, own_echo: 0, own_remnant: 0 };

    pub(crate) const fn add(&mut self, more: &Self) {
        self.late = self.late.saturating_add(more.late);
        self.foreign = self.foreign.saturating_add(more.foreign);
        self.misfit = self.misfit.saturating_add(more.misfit);
        self.noise = self.noise.saturating_add(more.noise);
        self.noise_idle = self.noise_idle.saturating_add(more.noise_idle);
        self.own_echo = self.own_echo.saturating_add(more.own_echo);
        self.own_remnant = self.own_remnant.saturating_add(more.own_remnant);
    }

    pub(crate) fn add_noise(&mut self, bytes: &[u8]) {
        let idle = bytes.iter().filter(|&&byte| byte == 0x00 || byte == 0xFF).count();
        self.noise = self.noise.saturating_add(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        self.noise_idle = self.noise_idle.saturating_add(u32::try_from(idle).unwrap_or(u32::MAX));
    }

    pub(crate) fn add_late(&mut self) {
        self.late = self.late.saturating_add(1);
    }

    pub(crate) fn add_foreign(&mut self) {
        self.foreign = self.foreign.saturating_add(1);
    }

    pub(crate) fn add_misfit(&mut self) {
        self.misfit = self.misfit.saturating_add(1);
    }

    pub(crate) fn add_own_echo(&mut self) {
        self.own_echo = self.own_echo.saturating_add(1);
    }

    pub(crate) fn add_own_remnant(&mut self, is_there: bool) {
        self.own_remnant = self.own_remnant.saturating_add(u32::from(is_there));
    }
}

/// A request that was not begun. Nothing was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BeginError {
    /// Another request is in flight.
    OutOfTurn,
    /// Nobody answers a broadcast, so nothing can be read by one.
    BroadcastRead,
    /// The unit may still answer an earlier request, or another program's: send it an echo first.
    Quarantine {
        /// The unit.
        unit: UnitAddress,
    },
}

impl core::fmt::Display for BeginError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::OutOfTurn => f.write_str("another request is in flight"),
            Self::BroadcastRead => f.write_str("nobody answers a broadcast: only writes can be sent to unit 0"),
            Self::Quarantine { unit } => write!(f, "unit {unit} may still answer an earlier request: echo it first"),
        }
    }
}

impl core::error::Error for BeginError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tally_that_is_full_stays_full() {
        let full = Tally {
            late: u32::MAX,
            foreign: u32::MAX,
            misfit: u32::MAX,
            noise: u32::MAX,
            noise_idle: u32::MAX,
            own_echo: u32::MAX,
            own_remnant: u32::MAX,
        };
        let mut tally = full;
        tally.add_noise(&[0x00, 0x55]);
        tally.add_late();
        tally.add_foreign();
        tally.add_misfit();
        tally.add_own_echo();
        tally.add_own_remnant(true);
        assert_eq!(tally, full);
    }
}
