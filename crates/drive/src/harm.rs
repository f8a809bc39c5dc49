//! What a word that is meant for one family does to a unit of another one: derived from all profiles, listed nowhere.
//!
//! At one address a word stops one family, starts another and is a parameter of a third. What stops a motor may be sent
//! to a unit of which nothing is known only where it does none of that to any family.

use std::sync::Arc;

use drivebus_drives::{Access, Command, Entry, Kind, Place};

use crate::families::Families;
use crate::family::Family;

/// What is to be sent to a unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum What {
    /// A command of the family that it was named as.
    Command(Command),
    /// Any word, to this place.
    Word(Place),
}

impl Family {
    /// The command by which its units do what `command` is for; `None` where they have none that halts.
    ///
    /// A family without a jog stop ends a jog by its stop, and one without a coast only has its stop.
    pub fn halt_for(&self, command: Command) -> Option<Command> {
        let known = self.profile().commands();
        [command, Command::Stop, Command::Coast].into_iter().find(|each| known.contains_key(each))
    }

    /// Whether `what`, written to a unit that was named as one of `named`, does harm to one of this family. A command
    /// that `named` does not have does none: there is no word of it.
    pub fn is_harmed_by(&self, what: What, named: &Family) -> bool {
        match what {
            What::Word(place) => self.starts_or_keeps(place),
            What::Command(command) => {
                let words = [named.profile().command_first(command), named.command(command)];
                let is_harm = |word| self.is_harmed_by_word(word, command) || self.may_mean_else(word, named);
                words.into_iter().flatten().any(is_harm)
            }
        }
    }

    /// Whether the same words at the same places halt this family and `other`, whatever their units are set to.
    pub fn halts_like(&self, other: &Family) -> bool {
        self.halts() == other.halts() && self.is_asked_like(other) && other.is_asked_like(self)
    }

    /// Whether `word` may start a unit that is set to take other words, and that was named as one of `named`, by which nobody asks
    /// for that.
    fn may_mean_else(&self, (place, word): (Place, u16), named: &Family) -> bool {
        let mut others = self.deciding().flat_map(|(_, row)| &row.otherwise);
        self.commands_at(place)
            && !self.is_asked_like(named)
            && others.any(|other| other.stop != Some(word) && other.coast != Some(word))
    }

    /// Whether a unit that was named as one of `named` is asked for all that decides which words one of this family takes.
    fn is_asked_like(&self, named: &Family) -> bool {
        self.deciding().all(|(place, _)| named.deciding().any(|(asked, _)| asked == place))
    }

    /// Whether `word`, meant as `command`, starts, reverses or sets anything.
    ///
    /// At a command register whatever is no halt of the family counts: nobody prints what each other code does.
    fn is_harmed_by_word(&self, word: (Place, u16), command: Command) -> bool {
        let (place, _) = word;
        if self.both(place).any(|each| self.commands_at(each)) {
            return match command {
                Command::Stop | Command::Coast | Command::JogStop => !self.halts().contains(&word),
                _ => self.command(command) != Some(word),
            };
        }
        self.row(place).map_or_else(|| self.may_keep_parameter(place), |row| row.access() != Access::Ro)
    }

    /// Whether a word written to `place` may start a unit, or is kept in its EEPROM.
    fn starts_or_keeps(&self, place: Place) -> bool {
        if self.both(place).any(|each| self.commands_at(each)) {
            return true;
        }
        let is_written = |row: &Entry| row.kind() == Kind::Parameter && row.access() != Access::Ro;
        let is_parameter = self.row(place).map_or_else(|| self.may_keep_parameter(place), is_written);
        is_parameter
            && self.profile().memory().is_none_or(|memory| {
                // What stays in RAM is kept by the next word that stores all.
                memory.store_word().is_some() || memory.keeps(place.address & memory.mask() != 0)
            })
    }

    /// `place`, and where it is read if it has the bit that says where a parameter is kept.
    fn both(&self, place: Place) -> impl Iterator<Item = Place> {
        std::iter::once(place).chain(self.profile().stored_address(place).map(Place::from))
    }

    /// What its profile knows to be written at `place`.
    fn row(&self, place: Place) -> Option<&Entry> {
        self.both(place).find_map(|each| self.profile().written_entry_at(each))
    }

    fn may_keep_parameter(&self, place: Place) -> bool {
        self.both(place).last().is_some_and(|plain| self.may_have_parameter(plain))
    }
}

impl Families {
    /// Those that `what` does harm to where it is written to a unit named as one of `named`. None where that has no such
    /// command.
    pub fn harmed(&self, what: What, named: &Arc<Family>) -> Vec<Arc<Family>> {
        let mut found = self.with(named);
        found.retain(|each| !Arc::ptr_eq(each, named) && each.is_harmed_by(what, named));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::family::HALTS;

    fn shipped(name: &str) -> Arc<Family> {
        Families::shipped().iter().find(|family| family.name() == name).cloned().unwrap()
    }

    fn harms(command: Command, named: &str, other: &str) -> bool {
        shipped(other).is_harmed_by(What::Command(command), &shipped(named))
    }

    /// By the manuals, as docs/developers/halts.md has them.
    #[test]
    fn what_halts_one_family_starts_another() {
        // 0005H at 2000H stops a GD350. An EDS300 runs by it, and has its stop where the other one coasts.
        assert!(harms(Command::Stop, "gd350", "eds300"));
        assert!(!harms(Command::Coast, "gd350", "eds300"));
        assert!(!harms(Command::Stop, "gd350", "gd35"));
        // 0000H is where an ACS355 is commanded, and P00.00 of a GD350, which can be set.
        assert!(harms(Command::Stop, "acs355", "gd350"));
        // 7000H is nothing but a VFD500's command.
        let vfd500 = shipped("vfd500");
        assert!(Families::shipped().harmed(What::Command(Command::Stop), &vfd500).is_empty());
        // It has no word that ends a jog.
        assert!(Families::shipped().harmed(What::Command(Command::JogStop), &vfd500).is_empty());
        assert_eq!(vfd500.halt_for(Command::JogStop), Some(Command::Stop));
    }

    /// GD350 manual, section 9.4.4: with bit 15 of the address a parameter is written to RAM only.
    #[test]
    fn what_is_not_kept_does_no_harm() {
        let gd350 = shipped("gd350");
        assert!(gd350.is_harmed_by(What::Word(0x000B.into()), &gd350));
        assert!(!gd350.is_harmed_by(What::Word(0x800B.into()), &gd350));
        assert!(gd350.is_harmed_by(What::Word(0x2000.into()), &gd350));
    }

    /// What halts a unit of a family harms none of that family, by whatever name it goes.
    #[test]
    fn no_halt_harms_its_own_family() {
        for family in Families::shipped().iter() {
            for command in HALTS {
                assert!(!family.is_harmed_by(What::Command(command), family), "{} {command:?}", family.name());
            }
        }
    }
}
