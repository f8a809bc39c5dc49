//! Parameters without a row: the drive has many more than any manual at hand prints, and their codes tell where they are.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::entry::{Access, Entry, Kind, names};
use crate::evidence::Evidence;
use crate::profile::Profile;
use crate::profile::lookup::{NameError, is_clear};
use crate::quantity::Quantity;
use crate::text::{parameter_address, parse_code, parse_loose_code};

const LABEL: &str = "not listed: only its word is known";
const NOTE: &str = "No page at hand prints it. Its address follows from its code; what its word means is not known.";
const ONLY_READ: &str =
    "No page at hand prints it, nor where this family takes its commands, which might be here: it is only read.";

impl Profile {
    /// As [`find`](Self::find), and beyond it what a code of the family's own form means that no row lists: the raw word
    /// at the address that the code tells, not verified, and so written only by who says that it may be.
    ///
    /// # Errors
    ///
    /// [`NameError`]: as for [`find`](Self::find). A code is unknown where codes tell no addresses, and where registers
    /// stand at its address.
    pub fn resolve(&self, name: &str) -> Result<Cow<'_, Entry>, NameError> {
        // A row may be called what looks like a code. Who is not found is searched for, which takes its time: that is last.
        let is_called = |entry: &Entry| names(entry).any(|known| known.eq_ignore_ascii_case(name.trim()));
        match self.unlisted(name) {
            Some(entry) if !self.entries().any(is_called) => is_clear(name, entry.name()).map(|()| Cow::Owned(entry)),
            _ => self.find(name).map(Cow::Borrowed),
        }
    }

    /// The parameter that `code` means by its numbers alone; `None` where they mean none.
    fn unlisted(&self, code: &str) -> Option<Entry> {
        let (group, index) = parse_loose_code(code.trim())?;
        let address = parameter_address(group, index);
        if self.groups.dropped.iter().any(|code| parse_code(code) == Some((group, index))) {
            return None;
        }
        // The second word of a number that takes two is no parameter by itself.
        let is_second = |first: &Entry| first.words() > 1;
        let taken = address.checked_sub(1).and_then(|before| self.entry_at(before)).is_some_and(is_second);
        (self.is_parameter_group(group) && self.entry_at(address).is_none() && !taken)
            .then(|| raw_word(format!("P{group:02}.{index:02}"), address, self.command_address().is_some()))
    }
}

/// An entry of which nothing is known but where it is, and whether it may be written because it is no command.
fn raw_word(code: String, address: u16, is_no_command: bool) -> Entry {
    let (access, note) = if is_no_command { (Access::Unknown, NOTE) } else { (Access::Ro, ONLY_READ) };
    Entry {
        name: code,
        alias: None,
        kind: Kind::Parameter,
        place: Some(address.into()),
        label: LABEL.to_owned(),
        quantity: Quantity {
            unit: String::new(),
            scale: None,
            signed: false,
            wide: false,
            high_first: false,
            low: None,
            high: None,
            low_from: None,
            high_from: None,
            choices: BTreeMap::new(),
            variant: None,
        },
        bits: Vec::new(),
        access,
        default: None,
        evidence: Evidence::Unverified,
        note: note.to_owned(),
        source: String::new(),
        listed: false,
    }
}
