//! What one client has asked and was not answered yet, and when it has to be. Time is an argument, and nothing here blocks.

use std::collections::BTreeMap;
use std::time::Duration;

use drivebus_rtu::{ExceptionCode, Instant};

use crate::error::{CallError, Failure};
use crate::gateway::asked::Asked;
use crate::gateway::framing::Framing;

/// The requests of one client on their way.
#[derive(Debug)]
pub(super) struct Desk {
    within: Duration,
    most: usize,
    framing: Framing,
    numbers: u64,
    open: BTreeMap<u64, Open>,
}

#[derive(Debug)]
struct Open {
    transaction: u16,
    unit: u8,
    function: u8,
    due: Instant,
}

impl Desk {
    /// One whose answers go out `within` that of the request, and which has `most` requests on their way.
    pub(super) const fn new(within: Duration, most: usize, framing: Framing) -> Self {
        Self { within, most, framing, numbers: 0, open: BTreeMap::new() }
    }

    /// The client asks the next one: what it does not wait for any more, where its answer would be taken for that of the next.
    pub(super) fn give_up(&mut self) -> Vec<u64> {
        if self.framing.tells_answers_apart() {
            return Vec::new();
        }
        std::mem::take(&mut self.open).into_keys().collect()
    }

    /// Takes `asked`, which came `at` that moment, and gives its number; `None`: as many are on their way as may.
    pub(super) fn take(&mut self, asked: &Asked, at: Instant) -> Option<u64> {
        if self.open.len() >= self.most {
            return None;
        }
        let function = asked.pdu.first().copied().unwrap_or_default();
        let due = at + self.within;
        self.numbers += 1;
        self.open.insert(self.numbers, Open { transaction: asked.transaction, unit: asked.unit, function, due });
        Some(self.numbers)
    }

    /// The message that answers request `number` by what came of it; `None` where it was answered already.
    pub(super) fn came(&mut self, number: u64, result: Result<&[u8], ExceptionCode>) -> Option<Vec<u8>> {
        let open = self.open.remove(&number)?;
        Some(match result {
            Ok(pdu) => self.framing.message(open.transaction, open.unit, pdu),
            Err(code) => self.refusal(open.transaction, open.unit, open.function, code),
        })
    }

    /// The requests whose time is up `now`, the first one first, each with the message that says so.
    pub(super) fn late(&mut self, now: Instant) -> Vec<(u64, Vec<u8>)> {
        let late: Vec<u64> = self.open.iter().filter(|(_, open)| open.due <= now).map(|(&number, _)| number).collect();
        let silent = ExceptionCode::GATEWAY_TARGET_SILENT;
        late.into_iter().filter_map(|number| Some((number, self.came(number, Err(silent))?))).collect()
    }

    /// When the next one's time is up.
    pub(super) fn due(&self) -> Option<Instant> {
        self.open.values().map(|open| open.due).min()
    }

    /// The message by which `asked` is not carried out.
    pub(super) fn refused(&self, asked: &Asked, code: ExceptionCode) -> Vec<u8> {
        self.refusal(asked.transaction, asked.unit, asked.pdu.first().copied().unwrap_or_default(), code)
    }

    fn refusal(&self, transaction: u16, unit: u8, function: u8, ExceptionCode(code): ExceptionCode) -> Vec<u8> {
        self.framing.message(transaction, unit, &[function | 0x80, code])
    }
}

/// What a client is told of a call that failed, and what is known of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Failed {
    pub(super) code: ExceptionCode,
    /// Whether it is the unit's own word.
    pub(super) is_by_unit: bool,
    pub(super) may_have_acted: bool,
}

impl Failed {
    /// It is known here that it cannot be done.
    pub(super) const fn before(code: ExceptionCode) -> Self {
        Self { code, is_by_unit: false, may_have_acted: false }
    }
}

/// By the specification V1.1b3, §7, and for the gateway's two by the guide's §4.4.3.1: 0AH where the line cannot be used, 0BH
/// where the unit did not answer as it must.
impl From<&CallError> for Failed {
    fn from(error: &CallError) -> Self {
        let code = match error.failure {
            Failure::Refused { code, .. } => code,
            Failure::Port(_) | Failure::Closed | Failure::Forked | Failure::Reopened => {
                ExceptionCode::GATEWAY_PATH_UNAVAILABLE
            }
            Failure::QueueFull { .. } => ExceptionCode::BUSY,
            Failure::ReadOnly { .. } | Failure::NotARead { .. } => ExceptionCode::ILLEGAL_FUNCTION,
            _ => ExceptionCode::GATEWAY_TARGET_SILENT,
        };
        let is_by_unit = matches!(error.failure, Failure::Refused { .. });
        Self { code, is_by_unit, may_have_acted: error.may_have_acted() }
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    const WITHIN: Duration = Duration::from_secs(1);

    fn asked(transaction: u16) -> Asked {
        Asked { transaction, unit: 7, pdu: vec![3, 0, 0, 0, 1] }
    }

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    #[test]
    fn what_is_late_is_answered_once_and_never_again() {
        let mut desk = Desk::new(WITHIN, 16, Framing::Tcp);
        let number = desk.take(&asked(0x1234), at(0)).unwrap();
        assert_eq!(desk.due(), Some(at(1000)));
        assert_eq!(desk.late(at(999)), []);
        assert_eq!(desk.late(at(1000)), [(number, vec![0x12, 0x34, 0, 0, 0, 3, 7, 0x83, 0x0B])]);
        assert_eq!(desk.late(at(5000)), []);
        assert_eq!(desk.came(number, Ok(&[3, 2, 0, 1])), None);
        assert!(desk.due().is_none());
    }

    #[test]
    fn more_than_may_be_on_their_way_are_not_taken() {
        let mut desk = Desk::new(WITHIN, 2, Framing::Tcp);
        let numbers = [1, 2, 3].map(|transaction| desk.take(&asked(transaction), at(0)));
        assert_eq!(numbers.map(|number| number.is_some()), [true, true, false]);
        assert!(desk.came(numbers[0].unwrap(), Ok(&[3, 2, 0, 1])).is_some());
        assert!(desk.take(&asked(4), at(1)).is_some());
    }

    #[derive(Debug, Clone)]
    enum Step {
        Ask(u16),
        Answer(prop::sample::Index),
        Wait(u64),
    }

    proptest! {
        /// Whatever happens in whatever order: each transaction is answered once, by its own answer or within its time.
        #[test]
        fn each_is_answered_once(steps in vec(prop_oneof![
            any::<u16>().prop_map(Step::Ask),
            any::<prop::sample::Index>().prop_map(Step::Answer),
            (0_u64..700).prop_map(Step::Wait),
        ], 1..60)) {
            let mut desk = Desk::new(WITHIN, 4, Framing::Tcp);
            let (mut now, mut taken, mut answers) = (0, Vec::new(), Vec::new());
            for step in steps {
                match step {
                    Step::Ask(transaction) => {
                        let number = desk.take(&asked(transaction), at(now));
                        taken.extend(number.map(|number| (number, transaction, now)));
                    }
                    Step::Answer(which) if !taken.is_empty() => {
                        let (number, transaction, _) = *which.get(&taken);
                        if let Some(message) = desk.came(number, Ok(&[3, 2, 0, 1])) {
                            prop_assert_eq!(&message, &Framing::Tcp.message(transaction, 7, &[3, 2, 0, 1]));
                            answers.push(number);
                        }
                    }
                    Step::Answer(_) => {}
                    Step::Wait(millis) => {
                        now += millis;
                        for (number, message) in desk.late(at(now)) {
                            let (_, transaction, asked_at) = *taken.iter().find(|one| one.0 == number).unwrap();
                            prop_assert!(now >= asked_at + 1000);
                            prop_assert_eq!(&message, &Framing::Tcp.message(transaction, 7, &[0x83, 0x0B]));
                            answers.push(number);
                        }
                        prop_assert!(desk.due().is_none_or(|due| due > at(now)));
                    }
                }
            }
            for (number, _) in desk.late(at(now + 1000)) {
                answers.push(number);
            }
            answers.sort_unstable();
            prop_assert_eq!(answers, taken.iter().map(|one| one.0).collect::<Vec<_>>());
            prop_assert!(desk.due().is_none());
        }
    }
}
