//! The rule: one profile, and how far it is trusted.

use drivebus_drives::{Access, Command, Entry, Evidence, Profile};

/// What may be asked of units of one family.
#[derive(Debug, Clone, Copy)]
pub struct Rule<'p> {
    profile: &'p Profile,
    trusts_all: bool,
}

/// Why something may not be asked of a drive. Nothing was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WhyNot<'p> {
    /// Nobody knows where it is; with what is known instead, which may be empty.
    #[error("its address is not known{}", told(.0))]
    NoAddress(&'p str),
    /// It can only be written.
    #[error("it can only be written")]
    OnlyWritten,
    /// Documents of the family do not print it, or not all of it; with why, which may be empty.
    #[error("no document of this family proves it{}", told(.0))]
    NotPrinted(&'p str),
    /// No document prints how far its values go, nor this one.
    #[error("its range is not printed")]
    NoRange,
    /// No such command of the family is known.
    #[error("no such command of this family is known")]
    NoCommand,
    /// No word is known that tells what the drive is doing.
    #[error("no state word of this family is known")]
    NoState,
    /// No register is known that has the present fault.
    #[error("no fault register of this family is known")]
    NoFault,
}

fn told(reason: &str) -> String {
    match reason.trim_end() {
        "" => String::new(),
        reason => format!(": {reason}"),
    }
}

impl<'p> Rule<'p> {
    /// What documents of the family print may be used, and what they print in part may be read.
    pub const fn printed(profile: &'p Profile) -> Self {
        Self { profile, trusts_all: false }
    }

    /// All that the profile knows may be used, whatever proves it: for who knows the drive, and says so.
    pub const fn trusting(profile: &'p Profile) -> Self {
        Self { profile, trusts_all: true }
    }

    /// Whether `entry` may be read.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NoAddress`], [`WhyNot::OnlyWritten`], [`WhyNot::NotPrinted`].
    pub fn read(&self, entry: &'p Entry) -> Result<(), WhyNot<'p>> {
        if entry.address().is_none() {
            return Err(WhyNot::NoAddress(entry.note()));
        }
        if entry.access() == Access::Wo {
            return Err(WhyNot::OnlyWritten);
        }
        self.proves(entry.evidence() != Evidence::Assumed, entry.note())
    }

    /// Whether `entry` may be written. Whether it can be, and with which [word](Self::word), is not asked here.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NoAddress`], [`WhyNot::NotPrinted`].
    pub fn write(&self, entry: &'p Entry) -> Result<(), WhyNot<'p>> {
        if entry.address().is_none() {
            return Err(WhyNot::NoAddress(entry.note()));
        }
        self.proves(entry.verified(), entry.note())
    }

    /// Whether what is printed tells that `entry` takes `word`, which has 32 bits where the entry has two words.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NoRange`].
    pub fn word(&self, entry: &'p Entry, word: u32) -> Result<(), WhyNot<'p>> {
        let quantity = entry.quantity();
        let is_bounded = quantity.high().is_some() || quantity.high_from().is_some() || quantity.variant().is_some();
        if is_bounded || u16::try_from(word).is_ok_and(|word| quantity.choices().contains_key(&word)) || self.trusts_all
        {
            Ok(())
        } else {
            Err(WhyNot::NoRange)
        }
    }

    /// Whether `command` may be given.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NoCommand`], [`WhyNot::NotPrinted`].
    pub fn command(&self, command: Command) -> Result<(), WhyNot<'p>> {
        if self.profile.command(command).is_none() {
            return Err(WhyNot::NoCommand);
        }
        let reason = self.profile.command_reason(command);
        self.proves(reason.is_none(), reason.unwrap_or_default())
    }

    /// Whether the states of the family may be used: the word may be read, and its meanings are printed.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NoState`], and those of [`read`](Self::read).
    pub fn state(&self) -> Result<(), WhyNot<'p>> {
        self.read(self.profile.role("state").ok_or(WhyNot::NoState)?)?;
        let reason = self.profile.state_reason();
        self.proves(reason.is_none(), reason.unwrap_or_default())
    }

    /// Whether the present fault may be read.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NoFault`], and those of [`read`](Self::read).
    pub fn fault(&self) -> Result<(), WhyNot<'p>> {
        self.read(self.profile.role("fault").ok_or(WhyNot::NoFault)?)
    }

    fn proves(&self, is_printed: bool, reason: &'p str) -> Result<(), WhyNot<'p>> {
        if is_printed || self.trusts_all { Ok(()) } else { Err(WhyNot::NotPrinted(reason)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn builtin(name: &str) -> std::sync::Arc<Profile> {
        Profile::builtin(name).unwrap()
    }

    /// By the manuals: what each of the four first families prints, and what none of its documents does.
    #[test]
    fn what_no_document_prints_is_for_who_says_so() {
        // GD600: the address of the output frequency and the codes of its states are on no page at hand.
        let gd600 = builtin("gd600");
        assert!(matches!(Rule::printed(&gd600).state(), Err(WhyNot::NotPrinted(_))));
        assert_eq!(Rule::trusting(&gd600).state(), Ok(()));
        // GD3000: of the commands only the one that runs it is printed.
        let gd3000 = builtin("gd3000");
        let rule = Rule::printed(&gd3000);
        let given = |command: &Command| rule.command(*command).is_ok();
        assert_eq!(Command::ALL.into_iter().filter(given).collect::<Vec<_>>(), [Command::RunForward]);
        // VFD500: the address of its status words is on no page.
        let vfd500 = builtin("vfd500");
        assert!(Rule::printed(&vfd500).state().is_err());
    }

    /// Who trusts more may do more, and never less.
    #[test]
    fn trust_takes_nothing_away() {
        for name in Profile::builtin_names() {
            let profile = builtin(name);
            let (printed, trusting) = (Rule::printed(&profile), Rule::trusting(&profile));
            for entry in profile.entries() {
                assert!(printed.read(entry).is_err() || trusting.read(entry).is_ok(), "{name} {}", entry.name());
                assert!(printed.write(entry).is_err() || trusting.write(entry).is_ok(), "{name} {}", entry.name());
                // What may be written may be read back, unless it can only be written.
                let reads = printed.read(entry);
                assert!(printed.write(entry).is_err() || matches!(reads, Ok(()) | Err(WhyNot::OnlyWritten)));
                assert_eq!(trusting.word(entry, 0xFFFF), Ok(()));
            }
            for command in Command::ALL {
                let known = profile.command(command).is_some();
                assert_eq!(trusting.command(command), if known { Ok(()) } else { Err(WhyNot::NoCommand) });
                assert!(printed.command(command).is_err() || known);
            }
        }
    }

    #[test]
    fn a_reason_is_said_as_the_profile_has_it() {
        assert_eq!(
            WhyNot::NotPrinted("the manual of the GD20 has it ").to_string(),
            "no document of this family proves it: the manual of the GD20 has it"
        );
        assert_eq!(WhyNot::NotPrinted("").to_string(), "no document of this family proves it");
        assert_eq!(WhyNot::NoAddress("").to_string(), "its address is not known");
    }
}
