//! Reasons: why what a family does is not verified, where it is not.

use crate::evidence::Evidence;
use crate::parts::command::Command;
use crate::profile::Profile;

impl Profile {
    /// Why `command` is not verified: its code, the register it is written to, or what is written before it. `None` where
    /// all are, or where there is no such command.
    pub fn command_reason(&self, command: Command) -> Option<&str> {
        let known = self.commands.get(&command)?;
        if !known.verified {
            return Some(&self.commands_note);
        }
        let register = self.written_entry_at(known.elsewhere.or(self.command_address)?)?;
        let before = known.first.and_then(|(place, _)| self.written_entry_at(place));
        let unproven = std::iter::once(register).chain(before).find(|entry| !entry.verified());
        unproven.map(|entry| entry.note.as_str())
    }

    /// Why what the state word means is not verified, or where it is. `None` where both are known, or where no state word
    /// is.
    pub fn state_reason(&self) -> Option<&str> {
        let word = self.state.as_ref()?;
        if !word.verified {
            return Some(&word.note);
        }
        let register = self.entry(&word.register)?;
        (register.evidence == Evidence::Assumed).then_some(&register.note)
    }
}
