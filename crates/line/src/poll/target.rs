//! What a poll asks, what cannot be asked so, and how long the wire takes for it.

use std::time::Duration;

use drivebus_rtu::{Request, SerialFormat, Table, UnitAddress};

use crate::error::Failure;

/// What is asked of one unit in each cycle.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct PollTarget {
    /// Who is asked.
    pub unit: UnitAddress,
    /// Table, address and number of words (1..=125) or bits (1..=2000) of each read, in the order in which they are sent.
    pub reads: Vec<(Table, u16, u16)>,
}

impl PollTarget {
    /// `reads` of holding registers of `unit`: address and number of words.
    pub fn new(unit: UnitAddress, reads: Vec<(u16, u16)>) -> Self {
        Self::of_tables(unit, reads.into_iter().map(|(address, count)| (Table::Holding, address, count)).collect())
    }

    /// `reads` of `unit`.
    pub fn of_tables(unit: UnitAddress, reads: Vec<(Table, u16, u16)>) -> Self {
        Self { unit, reads }
    }
}

/// Why a poll cannot be. Nothing was sent.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PollError {
    /// There is nothing to ask.
    #[error("{}", unit.map_or_else(|| "there is nobody to poll".to_owned(), |unit| format!("nothing is asked of unit {unit}")))]
    Nothing {
        /// Whom nothing is asked of; `None`: there is nobody.
        unit: Option<UnitAddress>,
    },
    /// A read has no words, or more than a frame holds.
    #[error("unit {unit} cannot be asked for {count} words from {address:04X}H")]
    Read {
        /// Who would be asked.
        unit: UnitAddress,
        /// The first address.
        address: u16,
        /// How many words.
        count: u16,
    },
    /// The wire cannot carry so much so often.
    #[error(
        "an interval of {} s is shorter than the line can carry: at {format} one cycle of this poll ({reads} reads) takes at \
         least {} s",
        interval.as_secs_f64(),
        rounded_up(*shortest)
    )]
    TooFast {
        /// What was asked for.
        interval: Duration,
        /// The shortest there can be.
        shortest: Duration,
        /// How many requests a cycle has.
        reads: usize,
        /// Characters and silence.
        format: SerialFormat,
    },
    /// The bus cannot be used.
    #[error("{0}")]
    Bus(Failure),
    /// So many samples cannot be kept.
    #[error("there is no memory for {size} samples of {words} words; keep fewer")]
    NoRoom {
        /// How many were to be kept.
        size: usize,
        /// The most words of a sample.
        words: usize,
    },
    /// The system gives no thread.
    #[error("the system gives no thread to poll in: {message}")]
    NoThread {
        /// What the system says.
        message: String,
    },
}

pub(super) fn check(targets: &[PollTarget]) -> Result<(), PollError> {
    if targets.is_empty() {
        return Err(PollError::Nothing { unit: None });
    }
    for &PollTarget { unit, ref reads } in targets {
        if reads.is_empty() {
            return Err(PollError::Nothing { unit: Some(unit) });
        }
        let wrong = reads.iter().find(|&&(table, address, count)| Request::read_of(table, address, count).is_err());
        if let Some(&(_, address, count)) = wrong {
            return Err(PollError::Read { unit, address, count });
        }
    }
    Ok(())
}

/// How long the wire is taken by one cycle, where every unit answers as soon as it may. `silence` is what must come before
/// a request to a unit.
pub(super) fn shortest_cycle(
    format: &SerialFormat,
    targets: &[PollTarget],
    silence: impl Fn(UnitAddress) -> Duration,
) -> Duration {
    let answer = |bytes: usize| 5 + u32::try_from(bytes).unwrap_or(u32::MAX);
    let read = |bytes| format.chars(8) + format.t35() + format.chars(answer(bytes));
    let of = |target: &PollTarget| {
        let bytes = target.reads.iter().map(|&(table, _, count)| table.bytes(count.into()));
        let silence = silence(target.unit);
        bytes.fold(Duration::ZERO, |time, bytes| time.saturating_add(silence).saturating_add(read(bytes)))
    };
    targets.iter().map(of).fold(Duration::ZERO, Duration::saturating_add)
}

/// Seconds in whole microseconds, no fewer than `time` has.
fn rounded_up(time: Duration) -> f64 {
    let micros = u64::try_from(time.as_nanos().div_ceil(1_000)).unwrap_or(u64::MAX);
    Duration::from_micros(micros).as_secs_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target(unit: u8, reads: &[(u16, u16)]) -> PollTarget {
        PollTarget::new(UnitAddress::new(unit).unwrap(), reads.to_vec())
    }

    #[test]
    fn the_shortest_cycle_is_counted_in_characters() {
        // At 19200 8E1 a character takes 11 bits: 8 + 3.5 + 7 + 3.5 = 22 for one word, 52 for 16 words.
        let format = SerialFormat::DEFAULT;
        let targets = [target(1, &[(0x3000, 1)]), target(2, &[(0, 16)])];
        let cycle = shortest_cycle(&format, &targets, |_| format.t35());
        let exact = 74.0 * 11.0 / 19_200.0;
        assert!((cycle.as_secs_f64() - exact).abs() < 1e-7, "{cycle:?} is not {exact}");
        let slow = Duration::from_millis(20);
        let with_gap = shortest_cycle(&format, &targets, |unit| if unit.get() == 2 { slow } else { format.t35() });
        assert_eq!(with_gap + format.t35(), cycle + slow, "a unit that needs a longer gap");
        assert_eq!(shortest_cycle(&format, &targets, |_| Duration::MAX), Duration::MAX, "for ever");
    }

    #[test]
    fn what_cannot_be_asked_is_refused() {
        let unit = UnitAddress::new(2).unwrap();
        assert_eq!(check(&[]), Err(PollError::Nothing { unit: None }));
        assert_eq!(check(&[target(1, &[(0, 1)]), target(2, &[])]), Err(PollError::Nothing { unit: Some(unit) }));
        for (address, count) in [(0, 0), (0, 126), (0xFFFF, 2)] {
            let wrong = check(&[target(2, &[(0, 1), (address, count)])]);
            assert_eq!(wrong, Err(PollError::Read { unit, address, count }));
        }
        assert_eq!(check(&[target(2, &[(0xFFFF, 1), (0, 125)])]), Ok(()));
    }
}
