//! Names: what a register or a parameter may be called, and what is said where nothing has a name.

use crate::entry::{Access, Entry, names};
use crate::place::Place;
use crate::profile::Profile;
use crate::text::{near, parameter_address, parse_address, parse_code, parse_loose_address, parse_loose_code};

/// Why a name means nothing here.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NameError {
    /// Nothing has this name.
    #[error("{profile} has no \"{name}\"{}", hint(name, closest))]
    Unknown {
        /// The profile that was asked.
        profile: String,
        /// The name as given.
        name: String,
        /// The names closest to it, the best first; empty where none is near.
        closest: Vec<String>,
    },
    /// The profile knows nothing at this address.
    #[error("{profile} knows nothing at {address:04X}H; read it by its address without a profile")]
    UnknownAddress {
        /// The profile that was asked.
        profile: String,
        /// The address.
        address: u16,
    },
    /// The parameter is in a group that the maker keeps closed.
    #[error("{name} is in a group that {profile} neither reads nor writes: it is the maker's own")]
    Closed {
        /// The profile that was asked.
        profile: String,
        /// The name as given.
        name: String,
    },
    /// The number behind the point lacks a digit: a spreadsheet makes `P00.1` of `P00.10`.
    #[error("\"{name}\" may be {one} or {other}; write both digits")]
    Unclear {
        /// The name as given.
        name: String,
        /// The parameter whose number begins with 0.
        one: String,
        /// The one whose number ends with 0.
        other: String,
    },
    /// The address is one that says where a written parameter is kept.
    #[error("{address:04X}H only writes {name}, and says where it is kept; name it {name}")]
    WriteForm {
        /// The address.
        address: u16,
        /// The parameter behind it.
        name: String,
    },
}

/// Names that a message offers at most.
const OFFERED: usize = 5;

fn hint(name: &str, closest: &[String]) -> String {
    if let Some(register) = numbered_from_40001(name) {
        return format!("; {} is register {register:04X}H: name it 0x{register:04X}", name.trim());
    }
    match closest {
        [] => String::new(),
        [one] => format!("; the closest is \"{one}\""),
        several => format!("; the closest are \"{}\"", several.join("\", \"")),
    }
}

/// The address of a holding register by its number in the count that begins at 40001, or at 400001.
fn numbered_from_40001(name: &str) -> Option<u16> {
    let digits = name.trim();
    let first = match digits.len() {
        5 => 40_001,
        6 => 400_001,
        _ => return None,
    };
    let number: u32 = digits.bytes().all(|digit| digit.is_ascii_digit()).then(|| digits.parse().ok()).flatten()?;
    u16::try_from(number.checked_sub(first)?).ok()
}

/// That `name` has all the digits of `code` behind its point, or could be no other number with them.
pub(super) fn is_clear(name: &str, code: &str) -> Result<(), NameError> {
    let digits = |text: &str| text.bytes().rev().take_while(u8::is_ascii_digit).count();
    let wanted = name.trim();
    if digits(wanted) >= digits(code) || wanted.ends_with('0') {
        return Ok(());
    }
    let (head, last) = code.split_at_checked(code.len().saturating_sub(1)).unwrap_or((code, ""));
    let other = format!("{}{last}0", head.strip_suffix('0').unwrap_or(head));
    Err(NameError::Unclear { name: name.to_owned(), one: code.to_owned(), other })
}

impl Profile {
    /// The entry that is written at `place`: where that is a command and a read tells a state, the command.
    pub fn written_entry_at(&self, place: impl Into<Place>) -> Option<&Entry> {
        let place = place.into();
        let read = self.entry_at(place)?;
        let is_written = |entry: &&Entry| entry.access == Access::Wo && entry.place == Some(place);
        // Nothing else stands beside what can be written as it is read.
        let other = (read.access == Access::Ro).then(|| self.entries.iter().find(is_written)).flatten();
        Some(other.unwrap_or(read))
    }

    /// The entry with this name: the name of a register or parameter, a parameter's code as people type it
    /// (`p00.11`, `P00-11`), or an address in hex (`0x3004`, `3004H`).
    ///
    /// # Errors
    ///
    /// [`NameError`]: there is no such entry (the closest is named), or it is closed, or the address only writes; or the code
    /// lacks a digit, and may be another.
    pub fn find(&self, name: &str) -> Result<&Entry, NameError> {
        let wanted = name.trim();
        let called = |name: &str| name.eq_ignore_ascii_case(wanted);
        if let Some(entry) = self.entries().find(|entry| called(entry.name()) || entry.alias().is_some_and(called)) {
            return Ok(entry);
        }
        if let Some((group, index)) = parse_loose_code(wanted) {
            let address = parameter_address(group, index);
            if self.is_closed(address) {
                return Err(NameError::Closed { profile: self.name().to_owned(), name: name.to_owned() });
            }
            if let Some(entry) = self.numbered(group, index) {
                return is_clear(name, entry.code().unwrap_or_default()).map(|()| entry);
            }
        }
        if let Some(address) = parse_address(wanted) {
            return self.entry_at(address).ok_or_else(|| self.unknown_address(name, address));
        }
        Err(NameError::Unknown {
            profile: self.name().to_owned(),
            name: name.to_owned(),
            closest: self.closest(wanted),
        })
    }

    /// The parameter whose code has these numbers: of 0 and 1, P00.01. What is at the address that others have for it says
    /// nothing where codes tell no addresses.
    fn numbered(&self, group: u8, index: u8) -> Option<&Entry> {
        self.entries().find(|entry| entry.code().and_then(parse_code) == Some((group, index)))
    }

    /// The entry whose code or address somebody typed, if not as it is printed.
    pub(crate) fn find_loosely(&self, text: &str) -> Option<&Entry> {
        match parse_loose_code(text) {
            Some((group, index)) => self.numbered(group, index),
            None => self.entry_at(parse_loose_address(text)?),
        }
    }

    /// What somebody most likely meant by a name that is none: what has all its words, else one that is spelt like it, else
    /// what a search finds. Empty where none is there: any other would mislead.
    fn closest(&self, name: &str) -> Vec<String> {
        if numbered_from_40001(name).is_some() {
            return Vec::new();
        }
        let mut found = self.search_exactly(name, OFFERED);
        // The label of a measured value may be spelt as the name of a setpoint. One word is in too many labels.
        let says_more = name.contains(['_', ' ']) && !found.is_empty();
        if let Some(near) = near(name, self.entries().flat_map(names)).filter(|_| !says_more) {
            return vec![near.to_owned()];
        }
        // A code that is not there stands for no other.
        if found.is_empty() && !name.bytes().any(|letter| letter.is_ascii_digit()) {
            found = self.search_nearly(name, OFFERED);
        }
        found.into_iter().map(|entry| entry.alias().unwrap_or(entry.name()).to_owned()).collect()
    }

    fn unknown_address(&self, name: &str, address: u16) -> NameError {
        if self.is_closed(address) {
            return NameError::Closed { profile: self.name().to_owned(), name: name.to_owned() };
        }
        match self.stored_address(address).and_then(|stored| self.entry_at(stored)) {
            Some(entry) => NameError::WriteForm { address, name: entry.name().to_owned() },
            None => NameError::UnknownAddress { profile: self.name().to_owned(), address },
        }
    }
}
