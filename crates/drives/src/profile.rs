//! Profiles: all that is known of one family of drives, and the questions it answers.
//!
//! How a profile comes into being is `load`'s business. Questions that need more than a look into the profile have rooms
//! below: names in `lookup`, what the family calls the things that every family has in `roles`, and so on.

pub(crate) mod counts;
pub(crate) mod lookup;
pub(crate) mod read_plan;
mod reasons;
pub(crate) mod roles;
mod search;
mod synonyms;
mod unlisted;
mod variants;

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::entry::{Access, AccessError, Entry, Kind, Store};
use crate::parts::called::Called;
use crate::parts::command::{Command, CommandCode, Control, StartWord};
use crate::parts::fault::{Exception, Fault};
use crate::parts::identification::{Identification, Signature};
use crate::parts::memory::{Memory, StoreWord};
use crate::parts::rules::{Groups, Requests, UnitKind};
use crate::parts::serial::{SerialDefaults, USUAL_READ_COST};
use crate::parts::setpoint::{Setpoint, SetpointRole};
use crate::parts::state::{State, StateWord};
use crate::parts::unlock::Unlock;
use crate::parts::variant::Variant;
use crate::parts::watchdog::Watchdog;
use crate::place::{Place, Table};
use crate::plan::{ReadRules, ReadSpan, plan_spans};
use crate::profile::roles::Roles;

/// The greatest number of a group or of a parameter in it: codes have two digits for each.
const LAST_NUMBER: u8 = 99;

/// What one family of drives means by its registers.
///
/// Get one by [`Profile::builtin`] or [`Profile::load`]. It never changes afterwards and is the same for every drive of
/// the family.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Profile {
    pub(crate) name: String,
    pub(crate) family: String,
    /// The families whose codes a unit may report, its own first.
    pub(crate) reports_as: Vec<String>,
    pub(crate) title: String,
    pub(crate) called: Called,
    pub(crate) kind: UnitKind,
    pub(crate) version: u32,
    pub(crate) source: String,
    pub(crate) serial: Option<SerialDefaults>,
    pub(crate) requests: Requests,
    pub(crate) memory: Option<Memory>,
    pub(crate) groups: Groups,
    /// Registers first, then parameters, each in address order.
    pub(crate) entries: Vec<Entry>,
    /// Where in `entries` an address is.
    pub(crate) by_address: BTreeMap<Place, usize>,
    pub(crate) roles: Roles,
    pub(crate) identifications: Vec<Identification>,
    pub(crate) signature: Option<Signature>,
    pub(crate) command_address: Option<Place>,
    pub(crate) unlock: Option<Unlock>,
    pub(crate) commands: BTreeMap<Command, CommandCode>,
    /// Codes that the family defines and that have no name here.
    pub(crate) other_commands: BTreeMap<u16, String>,
    /// Why some commands are not verified.
    pub(crate) commands_note: String,
    /// What comes before a word that runs or jogs.
    pub(crate) start_sequence: Vec<StartWord>,
    pub(crate) moving: Vec<Place>,
    pub(crate) state: Option<StateWord>,
    pub(crate) control: Vec<Control>,
    pub(crate) setpoints: BTreeMap<Setpoint, SetpointRole>,
    pub(crate) variants: BTreeMap<String, Variant>,
    /// What was said of the variants.
    pub(crate) chosen: BTreeMap<String, String>,
    pub(crate) monitor: Vec<String>,
    pub(crate) watchdog: Option<Watchdog>,
    pub(crate) fault_history: Vec<String>,
    pub(crate) fault_values: Vec<String>,
    pub(crate) faults: BTreeMap<u16, Fault>,
    pub(crate) exceptions: BTreeMap<u8, Exception>,
}

impl Profile {
    /// Its name in programs: `gd350`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The family: its own name, or for an overlay that of the profile below it.
    pub fn family(&self) -> &str {
        &self.family
    }

    /// The families whose identification codes a unit may report: its own, and where the profile extends another one and
    /// lists no code of its own, those of that one.
    pub fn reports_as(&self) -> &[String] {
        &self.reports_as
    }

    /// Its name for people: `INVT Goodrive350`.
    pub fn title(&self) -> &str {
        &self.title
    }

    /// Who makes its drives, and what they are called beside its name and title.
    pub fn called(&self) -> &Called {
        &self.called
    }

    /// Whether it feeds a motor.
    pub fn kind(&self) -> UnitKind {
        self.kind
    }

    /// The version of the profile itself.
    pub fn version(&self) -> u32 {
        self.version
    }

    /// The document it rests on.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// How the line of a drive fresh from the factory is set, where that is printed.
    pub fn serial(&self) -> Option<&SerialDefaults> {
        self.serial.as_ref()
    }

    /// What the drive takes as a request.
    pub fn requests(&self) -> &Requests {
        &self.requests
    }

    /// The function codes that the drive takes.
    pub fn functions(&self) -> &[u8] {
        &self.requests.functions
    }

    /// Most words in one read or write, 1..=125.
    pub fn max_words(&self) -> u16 {
        self.requests.max_words
    }

    /// How the family says where a written parameter is kept; `None` where every write may wear EEPROM.
    pub fn memory(&self) -> Option<&Memory> {
        self.memory.as_ref()
    }

    /// The word that stores all that was set, and where it goes; `None` where the family has none.
    pub fn store_word(&self) -> Option<(&StoreWord, Place)> {
        let word = self.memory.as_ref()?.store_word()?;
        Some((word, self.entry(&word.register)?.place?))
    }

    /// Every register in address order, then every parameter in address order.
    pub fn entries(&self) -> impl Iterator<Item = &Entry> {
        self.entries.iter()
    }

    /// The entry that is read at `place`, or that is only written there; an address alone is that of a holding register.
    pub fn entry_at(&self, place: impl Into<Place>) -> Option<&Entry> {
        self.by_address.get(&place.into()).and_then(|&index| self.entries.get(index))
    }

    /// The entry whose name or code is `name`, letter by letter.
    pub(crate) fn entry(&self, name: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.name == name || entry.alias.as_deref() == Some(name))
    }

    fn entries_of<'a>(&'a self, names: &'a [String]) -> impl Iterator<Item = &'a Entry> {
        names.iter().filter_map(|name| self.entry(name))
    }

    /// The address that reads `entry`.
    ///
    /// # Errors
    ///
    /// [`AccessError::NoAddress`]: nobody knows where it is.
    pub fn read_address(&self, entry: &Entry) -> Result<Place, AccessError> {
        entry.place.ok_or_else(|| AccessError::NoAddress {
            name: entry.name.clone(),
            label: entry.label.clone(),
            note: entry.note.clone(),
        })
    }

    /// The address that writes `entry`, kept where `store` says.
    ///
    /// # Errors
    ///
    /// [`AccessError`]: the entry can only be read, its address is not known, it is a register and EEPROM is asked for,
    /// or the family knows no write to RAM only.
    pub fn write_address(&self, entry: &Entry, store: Store) -> Result<Place, AccessError> {
        let (name, label) = (entry.name.clone(), entry.label.clone());
        let plain = self.read_address(entry)?;
        if entry.access == Access::Ro {
            return Err(AccessError::ReadOnly { name, label });
        }
        if entry.kind == Kind::Register {
            return match store {
                Store::Ram => Ok(plain),
                Store::Eeprom => Err(AccessError::NotStored { name, label }),
            };
        }
        match (&self.memory, store) {
            (None, Store::Ram) => Err(AccessError::NoRam { name, label }),
            (Some(memory), _) if memory.keeps(true) == (store == Store::Eeprom) => {
                Ok(Place { address: plain.address | memory.mask(), ..plain })
            }
            _ => Ok(plain),
        }
    }

    /// Where the word that was written to `entry` can be read, to see whether the drive took it.
    ///
    /// `None` where that would not tell: it cannot be read, or its write does something, so that something else may
    /// stand there afterwards.
    pub fn read_back(&self, entry: &Entry) -> Option<Place> {
        let acts = self.groups.acts.contains(&entry.name);
        entry.place.filter(|&place| entry.access != Access::Wo && !acts && !self.is_command(place))
    }

    /// The bit of a parameter's address that is about memory, and not about where it is; 0 where there is none.
    fn memory_mask(&self) -> u16 {
        self.memory.as_ref().map_or(0, Memory::mask)
    }

    /// The plain address behind one with the memory bit (000BH for 800BH), whether or not something is there. `None` if
    /// `place` is no such address.
    pub fn stored_address(&self, place: impl Into<Place>) -> Option<u16> {
        let Place { table, address } = place.into();
        let has_bit = table == Table::Holding && address & self.memory_mask() != 0;
        has_bit.then_some(address & !self.memory_mask())
    }

    /// `place` without the memory bit.
    fn plain(&self, place: Place) -> Place {
        self.stored_address(place).map_or(place, Place::from)
    }

    /// Whether `place`, or its plain form, is in a parameter group that the maker keeps closed.
    pub fn is_closed(&self, place: impl Into<Place>) -> bool {
        let Place { table, address } = self.plain(place.into());
        let [group, _] = address.to_be_bytes();
        table == Table::Holding && self.groups.closed.contains(&group)
    }

    /// The groups in which a code is its own address: P05.06 is at 0506H. Empty where the profile lists the addresses.
    ///
    /// Left out are those that the maker keeps closed, and those at whose addresses registers stand.
    pub fn parameter_groups(&self) -> impl Iterator<Item = u8> {
        (0..=LAST_NUMBER).filter(|&group| self.is_parameter_group(group))
    }

    /// The high bytes of addresses at which the drive may have a parameter that has no row: those of the rule, and those
    /// of which its file says so.
    pub fn unlisted_groups(&self) -> impl Iterator<Item = u8> {
        self.parameter_groups().chain(self.groups.unlisted.iter().copied())
    }

    /// Whether `group` is one that has the rule.
    pub(crate) fn is_parameter_group(&self, group: u8) -> bool {
        let is_register = |entry: &Entry| {
            let is_there = |place: Place| place.table == Table::Holding && place.address.to_be_bytes()[0] == group;
            entry.kind == Kind::Register && entry.place.is_some_and(is_there)
        };
        group <= LAST_NUMBER
            && !self.groups.listed
            && !self.groups.closed.contains(&group)
            && !self.entries.iter().any(is_register)
    }

    /// What the identification code `code` says; `None` if this profile does not know it.
    pub fn identify(&self, code: u16) -> Option<&Identification> {
        self.identifications.iter().find(|identification| identification.code == code)
    }

    /// Every identification code that this profile knows, of whatever family.
    pub fn identifications(&self) -> &[Identification] {
        &self.identifications
    }

    /// How a unit of this family that has no code can be told by what it answers and refuses.
    pub fn signature(&self) -> Option<&Signature> {
        self.signature.as_ref()
    }

    /// Place and word of a command, whether or not it is verified; `None` if the family has no such command.
    pub fn command(&self, command: Command) -> Option<(Place, u16)> {
        let known = self.commands.get(&command)?;
        Some((known.elsewhere.or(self.command_address)?, known.code))
    }

    /// Place and word of what is written before a command, where one word does not say which way the motor turns.
    pub fn command_first(&self, command: Command) -> Option<(Place, u16)> {
        self.commands.get(&command)?.first
    }

    /// The commands of the family, with their words.
    pub fn commands(&self) -> &BTreeMap<Command, CommandCode> {
        &self.commands
    }

    /// Every word that the family defines at its command register, and what it means.
    pub fn command_codes(&self) -> BTreeMap<u16, &str> {
        let here = self.commands.iter().filter(|(_, known)| known.elsewhere.is_none());
        // Two that another word tells apart share theirs, and the row has both names.
        let label = |code| self.entry_at(self.command_address?)?.quantity.choices.get(&code).map(String::as_str);
        let named = here.map(|(command, known)| (known.code, label(known.code).unwrap_or(command.name())));
        let others = self.other_commands.iter().map(|(&code, label)| (code, label.as_str()));
        // A word of the sequence that stops as well is called a stop.
        let sequence = self.start_sequence.iter().map(|step| (step.word, step.label.as_str()));
        others.chain(sequence).chain(named).collect()
    }

    /// The command that `raw` means at the command register.
    pub fn command_of(&self, raw: u16) -> Option<Command> {
        let is_it = |known: &CommandCode| known.elsewhere.is_none() && known.code == raw;
        self.commands.iter().find(|&(_, known)| is_it(known)).map(|(&command, _)| command)
    }

    /// Every register that takes commands, with the words that the family defines there and what they mean.
    pub fn command_registers(&self) -> BTreeMap<Place, BTreeMap<u16, &str>> {
        let mut registers: BTreeMap<Place, BTreeMap<u16, &str>> = BTreeMap::new();
        registers.extend(self.command_address.map(|address| (address, self.command_codes())));
        for (command, known) in &self.commands {
            if let Some(address) = known.elsewhere {
                registers.entry(address).or_default().entry(known.code).or_insert(command.name());
            }
        }
        registers
    }

    /// The words that come, in this order, before one that runs or jogs a motor at rest; none where that is done by one word.
    pub fn start_sequence(&self) -> &[StartWord] {
        &self.start_sequence
    }

    /// Where commands are written.
    pub fn command_address(&self) -> Option<Place> {
        self.command_address
    }

    /// Whether a write to `place` can start a motor or put current into it. Setpoints cannot: they change the speed of
    /// a motor that runs already.
    pub fn is_command(&self, place: impl Into<Place>) -> bool {
        self.moving.contains(&self.plain(place.into()))
    }

    /// How the family says what its motor does, where that is known.
    pub fn state_word(&self) -> Option<&StateWord> {
        self.state.as_ref()
    }

    /// What the state word `raw` means.
    pub fn state(&self, raw: u16) -> State {
        self.state.as_ref().map_or(State::Unknown, |word| word.state(raw))
    }

    /// Whether the state word `raw` says that the drive is in fault, which it may run in.
    pub fn is_in_fault(&self, raw: u16) -> bool {
        self.state.as_ref().is_some_and(|word| word.is_in_fault(raw))
    }

    /// Whether the state word can say that the drive is in fault. Where it cannot, the fault number alone does.
    pub fn state_tells_fault(&self) -> bool {
        self.state.as_ref().is_some_and(StateWord::tells_fault)
    }

    /// What must be set before the drive obeys the bus, in order.
    pub fn control(&self) -> &[Control] {
        &self.control
    }

    /// What can be given over the bus beside commands.
    pub fn setpoints(&self) -> &BTreeMap<Setpoint, SetpointRole> {
        &self.setpoints
    }

    /// The parameters that decide what some registers mean.
    pub fn variants(&self) -> &BTreeMap<String, Variant> {
        &self.variants
    }

    /// What was [chosen](Self::with_variants) of the variants.
    pub fn chosen(&self) -> &BTreeMap<String, String> {
        &self.chosen
    }

    /// What the drive must be told before it takes any word that is written to it; `None` where it need not.
    pub fn unlock(&self) -> Option<&Unlock> {
        self.unlock.as_ref()
    }

    /// What makes the drive act by itself when the bus falls silent; `None` where the family has no such thing.
    pub fn watchdog(&self) -> Option<&Watchdog> {
        self.watchdog.as_ref()
    }

    /// Where the drive keeps its last faults, the latest first; none where it keeps none.
    pub fn fault_history(&self) -> impl Iterator<Item = &Entry> {
        self.entries_of(&self.fault_history)
    }

    /// Where the drive keeps what it measured when it tripped last; none where it keeps none.
    pub fn fault_values(&self) -> impl Iterator<Item = &Entry> {
        self.entries_of(&self.fault_values)
    }

    /// The registers that a monitor shows when it is not told what to show.
    pub fn monitor(&self) -> impl Iterator<Item = &Entry> {
        self.entries_of(&self.monitor)
    }

    /// The parameters whose write does something and is not simply kept: it tunes the motor, or checks a password.
    pub fn acting(&self) -> impl Iterator<Item = &Entry> {
        self.entries_of(&self.groups.acts)
    }

    /// The parameters that set the line.
    pub fn serial_parameters(&self) -> impl Iterator<Item = &Entry> {
        self.entries_of(&self.groups.serial)
    }

    /// The parameters that describe the motor.
    pub fn motor_parameters(&self) -> impl Iterator<Item = &Entry> {
        self.entries_of(&self.groups.motor)
    }

    /// The parameters that are to be written last of many, in this order.
    pub fn last_parameters(&self) -> impl Iterator<Item = &Entry> {
        self.entries_of(&self.groups.last)
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

    /// Every exception that is documented, by code.
    pub fn exceptions(&self) -> impl Iterator<Item = &Exception> {
        self.exceptions.values()
    }

    /// The cheapest reads that hold all of `entries`, on a line as the factory sets it.
    ///
    /// That is nearly always the smallest number of reads, because a request costs as much as a dozen words or more. A
    /// read runs across what was not asked for only if the profile [knows it to be
    /// readable](Entry::is_known_readable), and into another group only where the family allows that.
    ///
    /// # Errors
    ///
    /// [`AccessError`]: one of them can only be written, or nobody knows where it is.
    pub fn plan<'a>(&self, entries: impl IntoIterator<Item = &'a Entry>) -> Result<Vec<ReadSpan>, AccessError> {
        let (mut wanted, mut alone) = (Vec::new(), Vec::new());
        for entry in entries {
            if entry.access == Access::Wo {
                return Err(AccessError::WriteOnly { name: entry.name.clone(), label: entry.label.clone() });
            }
            let Place { table, address } = self.read_address(entry)?;
            let span = ReadSpan { table, address, count: entry.words() };
            let is_single = self.requests.single_parameters && entry.kind() == Kind::Parameter;
            // Whether there is such a parameter is not known, and a drive refuses a read as a whole.
            if entry.is_listed() && !is_single { &mut wanted } else { &mut alone }.push(span);
        }
        // The second word of a wide entry is nobody's own.
        let covers = |place: Place| {
            let (first, &index) = self.by_address.range(..=place).next_back()?;
            self.entries.get(index).filter(|entry| {
                first.table == place.table
                    && u32::from(place.address) < u32::from(first.address) + u32::from(entry.words())
            })
        };
        let rules = ReadRules {
            max_words: self.requests.max_words,
            across_groups: self.requests.across_groups,
            cost: self.serial.as_ref().map_or(USUAL_READ_COST, SerialDefaults::read_cost),
        };
        let mut reads = plan_spans(&wanted, rules, |place| covers(place).is_some_and(Entry::is_known_readable));
        reads.extend(alone);
        reads.sort_unstable();
        reads.dedup();
        Ok(reads)
    }
}
