//! Profiles: all that is known of one family of drives, and the questions it answers.
//!
//! How a profile comes into being is `load`'s business, how names are found `lookup`'s.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::command::{Command, Control};
use crate::entry::{Access, AccessError, Entry, Kind, Store};
use crate::fault::{Exception, Fault};
use crate::plan::{ReadSpan, plan_reads};
use crate::serial::SerialDefaults;
use crate::state::State;
use crate::watchdog::Watchdog;

/// What one family of drives means by its registers.
///
/// Get one by [`Profile::builtin`] or [`Profile::load`]. It never changes afterwards and is the same for every drive of
/// the family.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Profile {
    pub(crate) name: String,
    pub(crate) title: String,
    pub(crate) source: String,
    pub(crate) serial: SerialDefaults,
    pub(crate) functions: Vec<u8>,
    pub(crate) max_words: u16,
    pub(crate) ram_mask: u16,
    pub(crate) closed_groups: Vec<u8>,
    /// Where a write does something, and is not simply kept.
    pub(crate) acting: Vec<u16>,
    /// Registers first, then parameters, each in address order.
    pub(crate) entries: Vec<Entry>,
    /// Where in `entries` an address is.
    pub(crate) by_address: BTreeMap<u16, usize>,
    pub(crate) identification_address: u16,
    pub(crate) identifications: Vec<Identification>,
    pub(crate) command_address: u16,
    pub(crate) commands: BTreeMap<Command, u16>,
    pub(crate) moving: Vec<u16>,
    pub(crate) state_address: u16,
    pub(crate) states: BTreeMap<State, u16>,
    pub(crate) control: Vec<Control>,
    pub(crate) monitor: Vec<u16>,
    pub(crate) watchdog: Option<Watchdog>,
    pub(crate) fault_history: Vec<u16>,
    pub(crate) faults: BTreeMap<u16, Fault>,
    pub(crate) exceptions: BTreeMap<u8, Exception>,
}

/// What an identification code says.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Identification {
    /// The word in the identification register.
    pub code: u16,
    /// The family: the name its profile has, whether or not there is one.
    pub family: String,
    /// The series, for people.
    pub title: String,
    /// Whether a manual prints it.
    pub verified: bool,
    /// Where it is printed.
    pub source: String,
}

impl Profile {
    /// Its name in programs: `gd350`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its name for people: `INVT Goodrive350`.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// The document it rests on.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// How the line of a drive fresh from the factory is set.
    pub fn serial(&self) -> &SerialDefaults {
        &self.serial
    }

    /// The function codes that the drive takes.
    pub fn functions(&self) -> &[u8] {
        &self.functions
    }

    /// Most words in one read or write, 1..=125.
    pub fn max_words(&self) -> u16 {
        self.max_words
    }

    /// Every register in address order, then every parameter in address order.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter()
    }

    /// The entry that is read at `address`.
    pub fn entry_at(&self, address: u16) -> Option<&Entry> {
        self.by_address.get(&address).and_then(|&index| self.entries.get(index))
    }

    /// The address that writes `entry`, kept where `store` says.
    ///
    /// # Errors
    ///
    /// [`AccessError`]: the entry can only be read, or it is a register and EEPROM is asked for.
    pub fn write_address(&self, entry: &Entry, store: Store) -> Result<u16, AccessError> {
        let (name, label) = (entry.name.clone(), entry.label.clone());
        match (entry.access, entry.kind, store) {
            (Access::Ro, _, _) => Err(AccessError::ReadOnly { name, label }),
            (_, Kind::Register, Store::Eeprom) => Err(AccessError::NotStored { name, label }),
            (_, Kind::Register, Store::Ram) | (_, Kind::Parameter, Store::Eeprom) => Ok(entry.address),
            (_, Kind::Parameter, Store::Ram) => Ok(entry.address | self.ram_mask),
        }
    }

    /// Where the word that was written to `entry` can be read, to see whether the drive took it.
    ///
    /// `None` where that would not tell: it cannot be read, or its write does something, so that something else may
    /// stand there afterwards.
    pub fn read_back(&self, entry: &Entry) -> Option<u16> {
        let kept = entry.access != Access::Wo && !self.acting.contains(&entry.address);
        (kept && !self.is_command(entry.address)).then_some(entry.address)
    }

    /// The plain address behind one that writes to RAM only (000BH for 800BH), whether or not something is there.
    /// `None` if `address` is no such address.
    pub fn stored_address(&self, address: u16) -> Option<u16> {
        (address & self.ram_mask != 0).then_some(address & !self.ram_mask)
    }

    /// Whether `address`, or its plain form, is in a parameter group that the maker keeps closed.
    pub fn is_closed(&self, address: u16) -> bool {
        let [group, _] = (address & !self.ram_mask).to_be_bytes();
        self.closed_groups.contains(&group)
    }

    /// Where the drive says what it is.
    pub fn identification_address(&self) -> u16 {
        self.identification_address
    }

    /// What the identification code `code` says; `None` if this profile does not know it.
    pub fn identify(&self, code: u16) -> Option<&Identification> {
        self.identifications.iter().find(|identification| identification.code == code)
    }

    /// Every identification code that this profile knows, of whatever family.
    pub fn identifications(&self) -> &[Identification] {
        &self.identifications
    }

    /// Address and word of a command; `None` if the family has no such command.
    pub fn command(&self, command: Command) -> Option<(u16, u16)> {
        self.commands.get(&command).map(|&code| (self.command_address, code))
    }

    /// The command that `raw` means at the command register.
    pub fn command_of(&self, raw: u16) -> Option<Command> {
        self.commands.iter().find(|&(_, &code)| code == raw).map(|(&command, _)| command)
    }

    /// Whether a write to `address` can start a motor or put current into it. Setpoints cannot: they change the speed of
    /// a motor that runs already.
    pub fn is_command(&self, address: u16) -> bool {
        self.moving.contains(&(address & !self.ram_mask))
    }

    /// Where the drive says what the motor does.
    pub fn state_address(&self) -> u16 {
        self.state_address
    }

    /// What the state word `raw` means.
    pub fn state(&self, raw: u16) -> State {
        self.states.iter().find(|&(_, &code)| code == raw).map_or(State::Unknown, |(&state, _)| state)
    }

    /// The state word for `state`, where the family has one.
    pub fn state_code(&self, state: State) -> Option<u16> {
        self.states.get(&state).copied()
    }

    /// What must be set before the drive obeys the bus, in order.
    pub fn control(&self) -> &[Control] {
        &self.control
    }

    /// What makes the drive act by itself when the bus falls silent; `None` where the family has no such thing.
    pub fn watchdog(&self) -> Option<&Watchdog> {
        self.watchdog.as_ref()
    }

    /// Where the drive keeps its last faults, the latest first; none where it keeps none.
    pub fn fault_history(&self) -> impl Iterator<Item = &Entry> {
        self.fault_history.iter().filter_map(|&address| self.entry_at(address))
    }

    /// The registers that a monitor shows when it is not told what to show.
    pub fn monitor(&self) -> impl Iterator<Item = &Entry> {
        self.monitor.iter().filter_map(|&address| self.entry_at(address))
    }

    /// The fault with the number `code`; one that says so if it is unknown.
    pub fn fault(&self, code: u16) -> Cow<'_, Fault> {
        self.faults.get(&code).map_or_else(|| Cow::Owned(Fault::unknown(code)), Cow::Borrowed)
    }

    /// Every fault, by number; 0, which is none, is among them if the profile lists it.
    pub fn faults(&self) -> impl Iterator<Item = &Fault> {
        self.faults.values()
    }

    /// What the exception code `code` means to this family; an exception that says so if it is unknown.
    pub fn exception(&self, code: u8) -> Cow<'_, Exception> {
        self.exceptions.get(&code).map_or_else(|| Cow::Owned(Exception::unknown(code)), Cow::Borrowed)
    }

    /// The cheapest reads that hold all of `entries`, on a line as the factory sets it.
    ///
    /// That is nearly always the smallest number of reads, because a request costs as much as a dozen words or more. A
    /// read runs across what was not asked for only if the profile [knows it to be
    /// readable](Entry::is_known_readable).
    ///
    /// # Errors
    ///
    /// [`AccessError`]: one of them can only be written.
    pub fn plan<'a>(&self, entries: impl IntoIterator<Item = &'a Entry>) -> Result<Vec<ReadSpan>, AccessError> {
        let wanted = entries
            .into_iter()
            .map(|entry| match entry.access {
                Access::Wo => Err(AccessError::WriteOnly { name: entry.name.clone(), label: entry.label.clone() }),
                _ => Ok(entry.address),
            })
            .collect::<Result<Vec<u16>, AccessError>>()?;
        let readable = |address| self.entry_at(address).is_some_and(Entry::is_known_readable);
        Ok(plan_reads(&wanted, self.max_words, self.serial.read_cost(), readable))
    }
}
