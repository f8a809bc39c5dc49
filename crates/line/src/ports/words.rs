//! The words by which people say how a bus and a call shall behave: the same in every language.

use std::str::FromStr;

use drivebus_rtu::Request;

use crate::options::{AdapterEcho, CallOptions, Share};
#[cfg(feature = "serial")]
use crate::ports::rs485::{MAX_DELAY_MS, RTS_MARGIN_MS, Rs485, Switch};
use crate::turns::order::Priority;

/// A word that is none of those that there are.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WordError {
    /// Nobody switches the direction so.
    #[cfg(feature = "serial")]
    #[error("rs485: mode {word} is not \"kernel\", \"rts\" or \"auto\"")]
    Switch {
        /// The word as it is shown.
        word: String,
    },
    /// A delay of RS-485 that cannot be kept.
    #[cfg(feature = "serial")]
    #[error("rs485: {which} cannot be {delay}; allowed is 0 to {MAX_DELAY_MS}")]
    Delay {
        /// `delay_before_ms` or `delay_after_ms`.
        which: &'static str,
        /// What was given, in milliseconds.
        delay: u32,
    },
    /// A port is not shared so.
    #[error("share {word:?} is not \"auto\", \"own\" or \"never\"")]
    Share {
        /// The word as given.
        word: String,
    },
    /// An adapter does not echo so.
    #[error("echo {word:?} is not \"auto\", \"yes\" or \"no\"")]
    Echo {
        /// The word as given.
        word: String,
    },
}

#[cfg(feature = "serial")]
impl FromStr for Switch {
    type Err = WordError;

    /// `kernel`, `rts` or `auto`.
    fn from_str(word: &str) -> Result<Self, WordError> {
        match word {
            "kernel" => Ok(Self::Driver),
            "rts" => Ok(Self::Program),
            "auto" => Ok(Self::Either),
            _ => Err(WordError::Switch { word: format!("{word:?}") }),
        }
    }
}

#[cfg(feature = "serial")]
impl Rs485 {
    /// Direction control by `switch`, RTS high while sending, no delays but those that it needs.
    pub fn by(switch: Switch) -> Self {
        let delay_after_ms = if switch == Switch::Program { RTS_MARGIN_MS } else { 0 };
        Self { switch, delay_after_ms, ..Self::default() }
    }

    /// Refuses delays that cannot be kept.
    ///
    /// # Errors
    ///
    /// [`WordError::Delay`]: one is above 100 ms.
    pub fn checked(self) -> Result<Self, WordError> {
        for (which, delay) in [("delay_before_ms", self.delay_before_ms), ("delay_after_ms", self.delay_after_ms)] {
            if delay > MAX_DELAY_MS {
                return Err(WordError::Delay { which, delay });
            }
        }
        Ok(self)
    }
}

#[cfg(feature = "serial")]
impl FromStr for Rs485 {
    type Err = WordError;

    /// A mode of [`Switch`] by its word, with the delays that it needs.
    fn from_str(word: &str) -> Result<Self, WordError> {
        word.parse().map(Self::by)
    }
}

impl FromStr for Share {
    type Err = WordError;

    /// `auto`, `own` or `never`.
    fn from_str(word: &str) -> Result<Self, WordError> {
        match word {
            "auto" => Ok(Self::Auto),
            "own" => Ok(Self::Own),
            "never" => Ok(Self::Never),
            _ => Err(WordError::Share { word: word.to_owned() }),
        }
    }
}

impl FromStr for AdapterEcho {
    type Err = WordError;

    /// `auto`, `yes` or `no`.
    fn from_str(word: &str) -> Result<Self, WordError> {
        match word {
            "auto" => Ok(Self::Auto),
            "yes" => Ok(Self::Present),
            "no" => Ok(Self::Absent),
            _ => Err(WordError::Echo { word: word.to_owned() }),
        }
    }
}

impl CallOptions {
    /// *Urgent*, as a stop and what confirms it are: before all who wait. What changes something also goes out at once,
    /// whatever is in doubt about the unit; a read does not, for it must be sure.
    #[must_use]
    pub fn urgent(self, request: &Request<'_>) -> Self {
        Self { priority: Some(Priority::Stop), in_doubt: request.is_write(), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_word_has_its_meaning() {
        assert_eq!("auto".parse(), Ok(AdapterEcho::Auto));
        assert_eq!("yes".parse(), Ok(AdapterEcho::Present));
        assert_eq!("no".parse(), Ok(AdapterEcho::Absent));
    }

    #[cfg(feature = "serial")]
    #[test]
    fn each_mode_of_rs485_has_the_delays_that_it_needs() {
        assert_eq!("kernel".parse(), Ok(Rs485::default()));
        assert_eq!("rts".parse::<Rs485>().map(|rs485| rs485.delay_after_ms), Ok(RTS_MARGIN_MS));
        assert_eq!("auto".parse::<Rs485>().map(|rs485| rs485.delay_after_ms), Ok(0));
    }

    #[test]
    fn what_is_no_word_is_named() {
        let echo = "maybe".parse::<AdapterEcho>().unwrap_err().to_string();
        assert_eq!(echo, "echo \"maybe\" is not \"auto\", \"yes\" or \"no\"");
    }

    #[cfg(feature = "serial")]
    #[test]
    fn what_no_transceiver_can_is_named() {
        let mode = "driver".parse::<Rs485>().unwrap_err().to_string();
        assert_eq!(mode, "rs485: mode \"driver\" is not \"kernel\", \"rts\" or \"auto\"");
        let late = Rs485 { delay_after_ms: 101, ..Rs485::default() }.checked().unwrap_err().to_string();
        assert_eq!(late, "rs485: delay_after_ms cannot be 101; allowed is 0 to 100");
    }

    #[test]
    fn an_urgent_write_goes_out_in_doubt_and_an_urgent_read_does_not() {
        let options = CallOptions::default();
        let (write, read) = (Request::write(0, 0), Request::read(0, 1).unwrap());
        for (request, in_doubt) in [(write, true), (read, false)] {
            let urgent = options.urgent(&request);
            assert_eq!((urgent.priority, urgent.in_doubt), (Some(Priority::Stop), in_doubt));
        }
    }
}
