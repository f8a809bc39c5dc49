//! What the exceptions of each unit mean: as the specification has them, unless its family is known to mean something else.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use drivebus_rtu::{AnswerError, ExceptionCode, Meaning, Meanings, UnitAddress};

use crate::error::Failure;

/// The meanings by unit; of others those of the specification hold. What another program asks comes with its own.
#[derive(Debug, Default)]
pub(crate) struct UnitMeanings {
    of: Mutex<BTreeMap<UnitAddress, Meanings>>,
    /// Whether any was set: most lines need not be asked.
    is_set: AtomicBool,
}

impl UnitMeanings {
    /// The exceptions of `unit` mean this from now on.
    pub(crate) fn set(&self, unit: UnitAddress, meanings: Meanings) {
        self.lock().insert(unit, meanings);
        self.is_set.store(true, Ordering::Release);
    }

    /// What was set of `unit`, if anything was.
    #[cfg(all(any(unix, windows), feature = "share"))]
    pub(crate) fn set_of(&self, unit: UnitAddress) -> Option<Meanings> {
        self.lock().get(&unit).copied()
    }

    /// What the exceptions of `unit` mean; `own`: what they mean to who asks.
    pub(crate) fn that_hold(&self, unit: Option<UnitAddress>, own: Option<&Meanings>) -> Meanings {
        match (own, unit) {
            (Some(own), _) => *own,
            (None, Some(unit)) if self.is_set.load(Ordering::Acquire) => {
                self.lock().get(&unit).copied().unwrap_or_default()
            }
            _ => Meanings::STANDARD,
        }
    }

    /// Whether `unit` says by `failure` that it could not take a request, this one or one before it, and may the next time.
    pub(crate) fn asks_again(&self, unit: UnitAddress, own: Option<&Meanings>, failure: &Failure) -> bool {
        match *failure {
            Failure::Refused { code, .. } | Failure::Wrong(AnswerError::Refusal { code }) => {
                self.code(unit, own, code) == Meaning::AskAgain
            }
            _ => false,
        }
    }

    fn code(&self, unit: UnitAddress, own: Option<&Meanings>, code: ExceptionCode) -> Meaning {
        if let Some(own) = own {
            return own.of(code);
        }
        self.lock().get(&unit).unwrap_or(&Meanings::STANDARD).of(code)
    }

    /// A thread that panicked cannot have left them half set.
    fn lock(&self) -> MutexGuard<'_, BTreeMap<UnitAddress, Meanings>> {
        self.of.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
