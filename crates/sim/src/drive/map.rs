//! What a profile says about each word of a drive, with factory values where the manuals print none.

use std::collections::BTreeMap;
use std::sync::Arc;

use drivebus_drives::{Access as ProfileAccess, Entry, Kind, Profile, ProfileError, Quantity, Value};
use drivebus_rtu::UnitAddress;

use super::addresses as at;
use super::places::Places;

/// When a word may be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    Always,
    Stopped,
    ReadOnly,
}

/// One word: who may write what into it.
#[derive(Debug)]
struct Word {
    access: Access,
    parameter: bool,
    factory: u16,
    /// In counts; `None` where nothing is printed.
    low: Option<i32>,
    high: Option<i32>,
    /// Parameters that bound it as well, by address.
    low_from: Option<u16>,
    high_from: Option<u16>,
    quantity: Quantity,
}

/// Every word of one family's drives. Shared by the drives of a family.
#[derive(Debug)]
pub(crate) struct Map {
    profile: String,
    identification: u16,
    /// By address.
    words: Vec<(u16, Word)>,
    places: Places,
    /// Where the parameters stand among the parameters, by address.
    parameters: Arc<Places>,
}

impl Map {
    /// The words of the shipped profile `name`.
    pub(crate) fn builtin(name: &str) -> Result<Self, ProfileError> {
        let profile = Profile::builtin(name)?;
        let words: BTreeMap<u16, Word> =
            profile.entries().map(|entry| (entry.address(), word(&profile, entry))).collect();
        // A profile lists its siblings' codes too; the first of its own name is the plain model.
        let own = profile.identifications().iter().find(|listed| listed.family == profile.name());
        let identification = own.map_or(0, |listed| listed.code);
        let places = Places::new(words.keys().copied());
        let of_parameters = words.iter().filter(|(_, word)| word.parameter).map(|(&address, _)| address);
        let parameters = Arc::new(Places::new(of_parameters));
        let words = words.into_iter().collect();
        Ok(Self { profile: profile.name().to_owned(), identification, words, places, parameters })
    }

    fn word(&self, address: u16) -> Option<&Word> {
        self.places.of(address).and_then(|place| self.words.get(place)).map(|(_, word)| word)
    }

    /// Where each parameter stands in [`factory`](Self::factory).
    pub(crate) fn parameters(&self) -> Arc<Places> {
        Arc::clone(&self.parameters)
    }

    pub(crate) fn profile(&self) -> &str {
        &self.profile
    }

    /// What 2103H says.
    pub(crate) fn identification(&self) -> u16 {
        self.identification
    }

    pub(crate) fn has(&self, address: u16) -> bool {
        self.places.of(address).is_some()
    }

    pub(crate) fn is_parameter(&self, address: u16) -> bool {
        self.word(address).is_some_and(|word| word.parameter)
    }

    pub(crate) fn access(&self, address: u16) -> Access {
        self.word(address).map_or(Access::ReadOnly, |word| word.access)
    }

    /// Whether `raw` is in range; `parameter` tells the parameters that the range depends on.
    pub(crate) fn allows(&self, address: u16, raw: u16, parameter: impl Fn(u16) -> u16) -> bool {
        let Some(word) = self.word(address) else { return false };
        let count = |raw| word.quantity.decode(raw).count();
        let value = count(raw);
        let bound = |address: Option<u16>| address.map(|address| count(parameter(address)));
        let above = [word.low, bound(word.low_from)].into_iter().flatten().all(|low| low <= value);
        let below = [word.high, bound(word.high_from)].into_iter().flatten().all(|high| value <= high);
        above && below
    }

    /// The factory value of every parameter, in a drive with the address `unit`.
    pub(crate) fn factory(&self, unit: UnitAddress) -> impl Iterator<Item = u16> {
        self.words.iter().filter(|(_, word)| word.parameter).map(move |(address, word)| match *address {
            at::UNIT_ADDRESS => u16::from(unit.get()),
            _ => word.factory,
        })
    }
}

fn word(profile: &Profile, entry: &Entry) -> Word {
    let quantity = entry.quantity().clone();
    let address_of = |code: &str| profile.find(code).ok().map(Entry::address);
    let low = quantity.low().map(Value::count);
    let lowest = low.and_then(|low| u16::try_from(low).ok()).unwrap_or(0);
    Word {
        access: match entry.access() {
            ProfileAccess::Ro => Access::ReadOnly,
            ProfileAccess::Stop => Access::Stopped,
            _ => Access::Always,
        },
        parameter: entry.kind() == Kind::Parameter,
        factory: entry.default_raw().or_else(|| assumed_factory_value(entry.address())).unwrap_or(lowest),
        low,
        high: quantity.high().map(Value::count),
        low_from: quantity.low_from().and_then(address_of),
        high_from: quantity.high_from().and_then(address_of).or_else(|| assumed_ceiling(entry.address())),
        quantity,
    }
}

/// Factory values that no manual at hand prints.
///
/// Assumption: all of them, and the lowest value (mostly 0) for whatever is not named here. P00.01, P00.02 and P00.06
/// are 0, so a drive fresh from the factory obeys its keypad; P00.11 and P00.12 depend on the model.
///
/// | parameter | value |
/// | --- | --- |
/// | P00.04, P00.10 | 50.00 Hz |
/// | P00.11, P00.12 | 10.0 s |
/// | P00.14 | 4.0 kHz |
/// | P02.01 | 4.0 kW |
/// | P05.26 | 10.00 V |
/// | P08.06 | 500, taken as 5.00 Hz |
/// | P08.07, P08.08 | 100, taken as 10.0 s |
fn assumed_factory_value(address: u16) -> Option<u16> {
    Some(match address {
        at::UPPER_FREQUENCY | at::KEYPAD_FREQUENCY => 5_000,
        at::ACCELERATION_TIME | at::DECELERATION_TIME | at::JOG_ACCELERATION | at::JOG_DECELERATION => 100,
        at::CARRIER_FREQUENCY | at::MOTOR_POWER => 40,
        at::AI1_UPPER => 1_000,
        at::JOG_FREQUENCY => 500,
        _ => return None,
    })
}

/// Assumption: no frequency can be set above P00.03, whether or not its row in the manual says so.
fn assumed_ceiling(address: u16) -> Option<u16> {
    match address {
        at::UPPER_FREQUENCY | at::KEYPAD_FREQUENCY | at::JOG_FREQUENCY | at::FORWARD_CEILING | at::REVERSE_CEILING => {
            Some(at::MAX_FREQUENCY)
        }
        _ => None,
    }
}
