//! What a hint says, in plain words: what is seen, what it most likely comes from, what to do.

use std::fmt;
use std::time::Duration;

use drivebus_rtu::UnitAddress;

/// What the figures most likely mean. Displays as a sentence or two for people.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Hint {
    /// Noise that is mostly 00 and FF: nothing holds the line at rest.
    NoBias {
        /// Bytes that belong to no frame.
        noise: u64,
        /// Those of them that are 00 or FF.
        idle: u64,
    },
    /// Noise of other bytes, while answers come.
    Interference {
        /// Bytes that belong to no frame.
        noise: u64,
    },
    /// Bytes come, but not one right answer.
    WrongFormat {
        /// Requests that went out.
        requests: u64,
        /// Bytes that belong to no frame.
        noise: u64,
        /// Answers whose CRC was wrong.
        damaged: u64,
    },
    /// Not one answer from anybody, and little else.
    NobodyAnswers {
        /// Requests that went out.
        requests: u64,
    },
    /// A large share of the answers is damaged.
    Damaged {
        /// Whose; `None`: on the whole line.
        unit: Option<UnitAddress>,
        /// Answers whose CRC was wrong.
        damaged: u64,
        /// All answers, those included.
        answers: u64,
    },
    /// The adapter sends our own bytes back.
    AdapterEcho {
        /// How often.
        echoes: u64,
    },
    /// Whole frames that nobody asked for.
    OtherMaster {
        /// How many.
        frames: u64,
    },
    /// Answers come after the time-out.
    TimeoutTooShort {
        /// Whose.
        unit: UnitAddress,
        /// How many on the line.
        late: u64,
        /// The slowest answer that came in time; zero if none did.
        slowest: Duration,
    },
    /// Requests to a unit are answered by something else than the answer.
    OtherAnswers {
        /// Whose.
        unit: UnitAddress,
        /// How many of them.
        others: u64,
        /// How often it was asked.
        requests: u64,
        /// By what.
        by: By,
    },
    /// Another program changed the settings of the open port.
    SettingsChanged {
        /// How often.
        times: u64,
    },
    /// A unit is silent while others answer.
    SilentUnit {
        /// Which.
        unit: UnitAddress,
        /// How often it was silent.
        timeouts: u64,
        /// How often it was asked.
        requests: u64,
    },
}

/// What comes in the place of answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum By {
    /// Whole frames of the unit, of another function than asked.
    Functions,
    /// Answers under another transaction number than asked.
    Transactions,
    /// Bytes that are no frame.
    Bytes,
}

impl Hint {
    /// What it is called, for programs.
    pub fn name(&self) -> &'static str {
        match self {
            Self::NoBias { .. } => "no_bias",
            Self::Interference { .. } => "interference",
            Self::WrongFormat { .. } => "wrong_format",
            Self::NobodyAnswers { .. } => "nobody_answers",
            Self::Damaged { .. } => "damaged",
            Self::AdapterEcho { .. } => "adapter_echo",
            Self::OtherMaster { .. } => "other_master",
            Self::TimeoutTooShort { .. } => "timeout_too_short",
            Self::OtherAnswers { .. } => "other_answers",
            Self::SettingsChanged { .. } => "settings_changed",
            Self::SilentUnit { .. } => "silent_unit",
        }
    }

    /// The unit it is about; `None`: the whole line.
    pub fn unit(&self) -> Option<UnitAddress> {
        match *self {
            Self::Damaged { unit, .. } => unit,
            Self::TimeoutTooShort { unit, .. } | Self::OtherAnswers { unit, .. } | Self::SilentUnit { unit, .. } => {
                Some(unit)
            }
            Self::NoBias { .. }
            | Self::Interference { .. }
            | Self::WrongFormat { .. }
            | Self::NobodyAnswers { .. }
            | Self::AdapterEcho { .. }
            | Self::SettingsChanged { .. }
            | Self::OtherMaster { .. } => None,
        }
    }
}

impl By {
    const fn in_words(self) -> &'static str {
        match self {
            Self::Functions => {
                "by another function than asked. Either the unit, or a gateway before it, does not know the function and \
                 does not refuse it as it should, or another master asks the same unit"
            }
            Self::Transactions => {
                "under another transaction number than asked, so nothing tells what they answer: the gateway does not give \
                 the number back. Look for newer firmware, or a mode that passes RTU through (socket://)"
            }
            Self::Bytes => {
                "by bytes that are no frame. Its errors show them: what the unit says outside of Modbus, a second unit \
                 with its address, another baud rate or parity, or an adapter that cuts bytes off"
            }
        }
    }
}

impl fmt::Display for Hint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.unit() {
            Some(unit) => write!(f, "unit {unit}: ")?,
            None => f.write_str("line: ")?,
        }
        match self {
            Self::NoBias { noise, idle } => write!(
                f,
                "{idle} of {noise} bytes of noise are 00 or FF, so nothing seems to hold the line at rest between \
                 frames. Add bias at one place, best at the master: 450 to 650 ohm from + (D1) to 5 V and from - (D0) \
                 to common"
            ),
            Self::Interference { noise } => write!(
                f,
                "{noise} bytes of noise between right answers: most likely interference. Keep the cable away from motor \
                 cables, earth its shield, connect the common of all units"
            ),
            Self::WrongFormat { requests, noise, damaged } => write!(
                f,
                "not one right answer to {requests} requests, but {noise} bytes of noise and {damaged} damaged answers: \
                 most likely a wrong baud rate or parity. Compare them with the units' (INVT: P14.01, P14.02); + and - \
                 may also be swapped"
            ),
            Self::NobodyAnswers { requests } => write!(
                f,
                "not one answer to {requests} requests. Check the power of the units, whether + and - are swapped, the \
                 unit addresses, the baud rate and the parity"
            ),
            Self::Damaged { unit, damaged, answers } => write!(
                f,
                "{damaged} of {answers} answers were damaged: most likely reflections or interference. Check {}that there \
                 is a terminator of 120 ohm at both ends of the line and nowhere else, that stubs are short, that the \
                 shield is earthed and motor cables are far",
                if unit.is_some() {
                    "its connectors, its stub and that no other unit has its address; then "
                } else {
                    ""
                }
            ),
            Self::AdapterEcho { echoes } => {
                write!(f, "the adapter sent our own bytes back {echoes} times: harmless, they are taken off")
            }
            Self::OtherMaster { frames } => write!(
                f,
                "{frames} whole frames came that nobody asked for: another master uses the line, or a unit answers to an \
                 address that is not its own. A line has one master, and each address one unit"
            ),
            Self::TimeoutTooShort { late, slowest, .. } => {
                write!(f, "{late} answers came after the time-out")?;
                if !slowest.is_zero() {
                    write!(f, ", while none of the others took longer than {:.1} ms", slowest.as_secs_f64() * 1e3)?;
                }
                f.write_str(
                    ": at times the unit takes longer than it is given. Wait longer, or lower its response delay \
                     (INVT: P14.03)",
                )
            }
            Self::OtherAnswers { others, requests, by, .. } => {
                write!(f, "{others} of {requests} requests were answered, but {}", by.in_words())
            }
            Self::SettingsChanged { times } => write!(
                f,
                "another program changed the settings of the open port {}, and they were set again. See who else has it \
                 open (`sudo fuser -v` and the port; a container that was given the device), and keep that off this line",
                if *times == 1 { "once".to_owned() } else { format!("{times} times") }
            ),
            Self::SilentUnit { timeouts, requests, .. } => write!(
                f,
                "silent on {timeouts} of {requests} requests, while others answer. Check its address (INVT: P14.00), its \
                 baud rate and parity, its power and its wiring"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(raw: u8) -> UnitAddress {
        UnitAddress::new(raw).unwrap()
    }

    #[test]
    fn a_hint_says_who_what_and_what_to_do() {
        let other = |by| Hint::OtherAnswers { unit: unit(4), others: 2, requests: 9, by };
        let hints = [
            (Hint::NoBias { noise: 10, idle: 9 }, "line: 9 of 10 bytes", "Add bias"),
            (Hint::Interference { noise: 7 }, "line: 7 bytes", "motor cables"),
            (Hint::WrongFormat { requests: 3, noise: 20, damaged: 1 }, "line: not one right answer", "parity"),
            (Hint::NobodyAnswers { requests: 3 }, "line: not one answer to 3", "power"),
            (Hint::Damaged { unit: Some(unit(4)), damaged: 5, answers: 9 }, "unit 4: 5 of 9", "terminator"),
            (Hint::Damaged { unit: None, damaged: 5, answers: 9 }, "line: 5 of 9", "terminator"),
            (Hint::AdapterEcho { echoes: 2 }, "line: the adapter", "harmless"),
            (Hint::OtherMaster { frames: 3 }, "line: 3 whole frames", "another master"),
            (
                Hint::TimeoutTooShort { unit: unit(4), late: 2, slowest: Duration::from_micros(480_500) },
                "unit 4: 2 answers",
                "480.5 ms",
            ),
            (other(By::Functions), "unit 4: 2 of 9 requests", "another function"),
            (other(By::Transactions), "unit 4: 2 of 9 requests", "transaction number"),
            (other(By::Bytes), "unit 4: 2 of 9 requests", "no frame"),
            (Hint::SettingsChanged { times: 2 }, "line: another program changed", "2 times"),
            (Hint::SilentUnit { unit: unit(4), timeouts: 3, requests: 3 }, "unit 4: silent", "P14.00"),
        ];
        for (hint, beginning, advice) in hints {
            let text = hint.to_string();
            assert!(text.starts_with(beginning) && text.contains(advice), "{text}");
        }
    }
}
