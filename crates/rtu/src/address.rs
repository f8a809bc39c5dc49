//! Who a frame is for. A unit's address is checked once, here; broadcast is a case of its own.

use core::fmt;

/// The address of one unit on the line: 1..=247, and where somebody asks for it by name any other.
///
/// Source: *Modbus over Serial Line* V1.02, §2.2.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UnitAddress(u8);

impl UnitAddress {
    /// The lowest address a unit has by the specification.
    pub const MIN: Self = Self(1);
    /// The highest address a unit has by the specification.
    pub const MAX: Self = Self(247);

    /// Checks `raw`.
    ///
    /// # Errors
    ///
    /// [`AddressError`]: `raw` is 0 (broadcast) or above 247 (reserved).
    pub const fn new(raw: u8) -> Result<Self, AddressError> {
        match raw {
            1..=247 => Ok(Self(raw)),
            _ => Err(AddressError { raw }),
        }
    }

    /// `raw`, whatever it is, for who asks for it by name: 248..=255, which the specification reserves and some units have, and
    /// 0, by which many a device means itself over Modbus TCP. On a serial line all units take 0 for a broadcast, and so they
    /// do behind a gateway: whether it may be asked there is the caller's to know.
    pub const fn by_name(raw: u8) -> Self {
        Self(raw)
    }

    /// Who answers by `raw`; nobody does by 0 that was asked as one of several.
    pub(crate) const fn of_answer(raw: u8) -> Option<Self> {
        if raw == 0 { None } else { Some(Self(raw)) }
    }

    /// Whether no unit has it by the specification.
    pub const fn is_reserved(self) -> bool {
        !matches!(self.0, 1..=247)
    }

    /// The address as it stands on the wire.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl fmt::Display for UnitAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Who a request is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Destination {
    /// One unit, which answers.
    Unit(UnitAddress),
    /// Every unit; none answers.
    Broadcast,
}

impl Destination {
    /// The destination that `raw` means on the wire.
    ///
    /// # Errors
    ///
    /// [`AddressError`]: `raw` is above 247.
    pub const fn from_wire(raw: u8) -> Result<Self, AddressError> {
        match raw {
            0 => Ok(Self::Broadcast),
            _ => match UnitAddress::new(raw) {
                Ok(unit) => Ok(Self::Unit(unit)),
                Err(error) => Err(error),
            },
        }
    }

    /// The unit that is asked, if it is one.
    pub const fn unit(self) -> Option<UnitAddress> {
        match self {
            Self::Unit(unit) => Some(unit),
            Self::Broadcast => None,
        }
    }

    /// The address byte on the wire.
    pub const fn to_wire(self) -> u8 {
        match self {
            Self::Unit(unit) => unit.get(),
            Self::Broadcast => 0,
        }
    }
}

impl From<UnitAddress> for Destination {
    fn from(unit: UnitAddress) -> Self {
        Self::Unit(unit)
    }
}

/// An address that no unit can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct AddressError {
    /// What was given.
    pub raw: u8,
}

impl fmt::Display for AddressError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unit address {} is not a number from 1 to 247", self.raw)
    }
}

impl core::error::Error for AddressError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wire_byte_survives_the_round_trip_or_is_refused() {
        for raw in 0..=255 {
            match Destination::from_wire(raw) {
                Ok(destination) => assert_eq!(destination.to_wire(), raw),
                Err(error) => assert!(raw > 247 && error == AddressError { raw }),
            }
            assert_eq!(UnitAddress::new(raw).is_ok(), (1..=247).contains(&raw));
            let named = UnitAddress::by_name(raw);
            assert_eq!((named.get(), named.is_reserved()), (raw, UnitAddress::new(raw).is_err()));
            assert_eq!(Destination::Unit(named).to_wire(), raw);
        }
    }
}
