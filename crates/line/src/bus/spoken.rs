//! In which protocol each unit is asked: Modbus, unless it is known to speak another one. Then nothing of Modbus goes to it.
//!
//! Callers say the same either way: what stands for what, [`Huanyang`] has. Below this, each request is what goes on the wire.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use drivebus_rtu::huanyang::{Huanyang, Protocol};
use drivebus_rtu::{Adu, Answer, Destination, Frame, Request, UnitAddress};

use crate::error::Failure;
use crate::options::{CallOptions, LastWill};

/// The units that speak Huanyang's own protocol.
#[derive(Debug, Default)]
pub(crate) struct Spoken {
    huanyang: Mutex<BTreeSet<UnitAddress>>,
    /// Whether there was any: most lines need not be asked.
    is_set: AtomicBool,
}

impl Spoken {
    /// `unit` speaks `protocol` from now on.
    pub(super) fn set(&self, unit: UnitAddress, protocol: Protocol) {
        match protocol {
            Protocol::Huanyang => {
                self.lock().insert(unit);
                self.is_set.store(true, Ordering::Release);
            }
            Protocol::Modbus => {
                self.lock().remove(&unit);
            }
        }
    }

    /// What `unit` speaks.
    pub(super) fn by(&self, unit: UnitAddress) -> Protocol {
        let is_huanyang = self.is_set.load(Ordering::Acquire) && self.lock().contains(&unit);
        if is_huanyang { Protocol::Huanyang } else { Protocol::Modbus }
    }

    /// `request` as it goes to `destination`.
    ///
    /// # Errors
    ///
    /// [`Failure::NotSpoken`]: the unit's protocol has nothing for it.
    #[inline]
    pub(super) fn say<'r>(&self, destination: Destination, request: &Request<'r>) -> Result<Request<'r>, Failure> {
        match destination {
            Destination::Unit(unit) if self.is_set.load(Ordering::Acquire) => self.say_to(unit, request),
            _ => Ok(*request),
        }
    }

    #[cold]
    fn say_to<'r>(&self, unit: UnitAddress, request: &Request<'r>) -> Result<Request<'r>, Failure> {
        if self.by(unit) == Protocol::Modbus {
            return Ok(*request);
        }
        Huanyang::of(request).map(Request::Huanyang).ok_or(Failure::NotSpoken { unit: unit.get() })
    }

    /// `will` with what halts its unit as that takes it.
    pub(super) fn will(&self, will: LastWill) -> LastWill {
        if self.by(will.unit) == Protocol::Modbus {
            return will;
        }
        let said = |pdu: &Vec<u8>| {
            let asked = Huanyang::of(&Request::of_either(pdu)?)?;
            let frame = Adu::request(will.unit.into(), &Request::Huanyang(asked));
            Some(Frame::parse(frame.as_bytes()).ok()?.pdu().to_vec())
        };
        let ways = will.ways.iter().map(|way| way.iter().filter_map(said).collect()).collect();
        LastWill { ways, look: None, ..will }
    }
}

impl Spoken {
    /// A thread that panicked cannot have left them half set.
    fn lock(&self) -> MutexGuard<'_, BTreeSet<UnitAddress>> {
        self.huanyang.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// `options` as they hold for `said`: what was written in another protocol is not read back.
pub(super) fn options_for(said: &Request<'_>, options: CallOptions) -> CallOptions {
    match said {
        Request::Huanyang(_) => CallOptions { read_back: None, ..options },
        _ => options,
    }
}

/// Gives `take` the `answer` to `said` as the one to `request`, which said the same.
pub(super) fn tell<'a>(
    said: &Request<'_>,
    request: &Request<'a>,
    answer: Answer<'a>,
    take: &mut dyn FnMut(Answer<'_>),
) {
    match *said {
        Request::Huanyang(asked) => take(asked.as_answered(answer, request, &mut [0])),
        _ => take(answer),
    }
}
