//! The rule: one profile, and how far it is trusted.

use drivebus_drives::{Access, BitField, Command, Entry, Evidence, Kind, Profile, Store, Variant};

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
        Self::of(profile, false)
    }

    /// All that the profile knows may be used, whatever proves it: for who knows the drive, and says so.
    pub const fn trusting(profile: &'p Profile) -> Self {
        Self::of(profile, true)
    }

    /// As [`trusting`](Self::trusting) where it `is_trusted`, else as [`printed`](Self::printed).
    pub const fn of(profile: &'p Profile, is_trusted: bool) -> Self {
        Self { profile, trusts_all: is_trusted }
    }

    /// What is known of the family.
    pub(crate) const fn profile(&self) -> &'p Profile {
        self.profile
    }

    /// Whether all that the profile knows may be used, whatever proves it.
    pub(crate) const fn trusts_all(&self) -> bool {
        self.trusts_all
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

    /// Whether the bits of `field` in a word of `entry` may be set.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NotPrinted`]: where they are.
    pub fn bits(&self, entry: &'p Entry, field: &BitField) -> Result<(), WhyNot<'p>> {
        self.proves(field.verified(), entry.note())
    }

    /// Whether `entry` may be written to where `store` keeps it. Whether there is an
    /// [address](Profile::write_address) for that is not asked here.
    ///
    /// The address of a parameter says where it is kept, or a word that follows. A plain address does not when it is to be kept
    /// for good, and no word follows: it is what anybody writes to who knows of no such rule.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NotPrinted`]: how the family keeps parameters.
    pub fn kept(&self, entry: &Entry, store: Store) -> Result<(), WhyNot<'p>> {
        let Some(memory) = self.profile.memory() else { return Ok(()) };
        let is_plain = || self.profile.write_address(entry, store).ok() == entry.place();
        let by_address = memory.store_word().is_none();
        if entry.kind() != Kind::Parameter || by_address && store == Store::Eeprom && is_plain() {
            return Ok(());
        }
        self.proves(memory.verified, &memory.note)?;
        if store == Store::Eeprom { self.stores() } else { Ok(()) }
    }

    /// Whether the word that stores all that is in RAM may be used.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NotPrinted`]: which register takes it, or which word that is.
    pub fn stores(&self) -> Result<(), WhyNot<'p>> {
        let (memory, word) = (self.profile.memory(), self.profile.store_word());
        let row = word.and_then(|(word, _)| self.profile.find(&word.register).ok());
        let Some((memory, row)) = memory.zip(row) else { return Ok(()) };
        self.proves(memory.verified, &memory.note)?;
        self.proves(row.verified(), row.note())
    }

    /// Whether what a parameter of the drive says of `variant` may be used.
    ///
    /// # Errors
    ///
    /// [`WhyNot::NotPrinted`]: what its words mean.
    pub fn variant(&self, variant: &'p Variant) -> Result<(), WhyNot<'p>> {
        self.proves(variant.verified, &variant.note)
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
        self.read(self.profile.role("fault").ok_or(WhyNot::NoFault)?)?;
        // A number that holds is that of the present fault while the state says so.
        if self.profile.fault_holds() { self.state() } else { Ok(()) }
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

    /// GD350 manual, section 9.4.4: with bit 15 an address is kept in RAM only. No page at hand has that of a GD10, of which
    /// the plain address is as good as with any drive.
    #[test]
    fn where_a_parameter_is_kept_has_to_be_printed() {
        for (name, printed) in [("gd350", true), ("gd10", false), ("gd600", true)] {
            let profile = builtin(name);
            let source = profile.find("P00.01").unwrap();
            let rule = Rule::printed(&profile);
            assert_eq!(rule.kept(source, Store::Eeprom), Ok(()), "{name}");
            assert_eq!(rule.kept(source, Store::Ram).is_ok(), printed, "{name}");
            assert_eq!(Rule::trusting(&profile).kept(source, Store::Ram), Ok(()));
            // A register is kept nowhere.
            let setpoint = profile.role("setpoints.frequency").unwrap();
            assert_eq!(rule.kept(setpoint, Store::Ram), Ok(()), "{name}");
        }
    }

    /// VFD500: by which words of P30.14 a speed is in rpm, no page at hand says; V20: nor where some bits of its control
    /// word are.
    #[test]
    fn what_decides_and_what_is_set_has_to_be_printed() {
        let vfd500 = builtin("vfd500");
        let unit = &vfd500.variants()["speed_unit"];
        assert_eq!(Rule::printed(&vfd500).variant(unit), Err(WhyNot::NotPrinted(&unit.note)));
        assert_eq!(Rule::trusting(&vfd500).variant(unit), Ok(()));

        let v20 = builtin("v20");
        let word = v20.find("control_command").unwrap();
        let may = |rule: Rule<'_>, name: &str| {
            rule.bits(word, word.bits().iter().find(|field| field.name() == name).unwrap()).is_ok()
        };
        assert!(!may(Rule::printed(&v20), "jog_right"));
        assert!(may(Rule::printed(&v20), "on"));
        assert!(may(Rule::trusting(&v20), "jog_right"));
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
