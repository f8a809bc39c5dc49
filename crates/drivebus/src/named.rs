//! A unit as a program named it, and what may be done with it: operations of the core, for who waits and for who awaits.

mod halts;
mod waits;

use std::sync::Arc;
use std::time::Duration;

use drivebus_drive::task::{Mailbox, Read, Task};
use drivebus_drive::{
    self as drive, Besides, Contradiction, Families, Family, FieldInput, Frequencies, Halt, Identification, Look,
    Looks, NotHalted, NotPrepared, NotSettled, Order, Record, Rule, SameUnit, Setting, Speeds, Start, Taken,
};
use drivebus_drives::{Command, Entry, Fault, Input, OwnedInput, Profile, Setpoint, Store};
use drivebus_rtu::UnitAddress;

pub(crate) use halts::Each;

use crate::checks;
use crate::error::Error;
use crate::given::GivenField;
use crate::halting::Halting;
use crate::operations;
use crate::reading::{Reading, Values};
use crate::status::Status;

/// An operation on its way.
pub(crate) type Work<T> = Task<Result<T, Error>, Error>;

/// How long a fault that was reset may still be shown.
const RESET_SHOWN: Duration = Duration::from_secs(1);

/// How often a motor is stopped whose drive took it and does not show it, before it is told to coast.
const STOPS: u32 = 3;

/// A unit that a program named as one of a family. Clones have one memory of it.
#[derive(Debug, Clone)]
pub(crate) struct Named {
    address: UnitAddress,
    family: Arc<Family>,
    record: Record,
    looks: Arc<Looks>,
    speeds: Arc<Speeds>,
    is_unverified: bool,
    is_trusted: bool,
}

impl Named {
    /// The unit of this address, of which `record` has what was sent to it.
    pub(crate) fn new(address: UnitAddress, profile: &Arc<Profile>, record: Record) -> Self {
        Self {
            address,
            family: Families::shipped().family(profile),
            record,
            looks: Arc::new(Looks::new(profile, false)),
            speeds: Arc::new(Speeds::new(profile, false)),
            is_unverified: false,
            is_trusted: false,
        }
    }

    /// The same, also by what no document of the family proves where that `is_unverified`.
    fn trusting(self, is_unverified: bool) -> Self {
        if is_unverified == self.is_unverified {
            return self;
        }
        let looks = Arc::new(Looks::new(self.family.profile(), is_unverified));
        let speeds = Arc::new(Speeds::new(self.family.profile(), is_unverified));
        Self { looks, speeds, is_unverified, ..self }
    }

    pub(crate) fn unverified(self) -> Self {
        self.trusting(true)
    }

    pub(crate) fn trust_profile(self) -> Self {
        Self { is_trusted: true, ..self }
    }

    pub(crate) fn address(&self) -> UnitAddress {
        self.address
    }

    pub(crate) fn profile(&self) -> &Arc<Profile> {
        self.family.profile()
    }

    /// What may be asked of it.
    pub(crate) fn rule(&self) -> Rule<'_> {
        Rule::of(self.profile(), self.is_unverified)
    }

    /// How often it was started, or was about to be.
    pub(crate) fn starts(&self) -> u64 {
        self.record.sent().starts
    }

    /// What ends what `start` starts.
    pub(crate) fn end_of(&self, start: &Start) -> Command {
        let may = |command| self.rule().command(command).is_ok();
        if start.jogs && may(Command::JogStop) { Command::JogStop } else { Command::Stop }
    }

    pub(crate) fn start(&self, start: &Start) -> Result<Work<()>, Error> {
        checks::time("confirm", start.confirm)?;
        let (named, start) = (self.clone(), *start);
        Ok(Task::new(async move |line| Ok(named.call(&line).start(&line, Families::shipped(), &start).await?)))
    }

    pub(crate) fn reset_fault(&self) -> Work<()> {
        let named = self.clone();
        Task::new(async move |line| Ok(named.call(&line).reset_fault(&line, Families::shipped(), RESET_SHOWN).await?))
    }

    pub(crate) fn set_frequency(&self, hz: f64) -> Work<()> {
        let named = self.clone();
        Task::new(async move |line| {
            let set = named.call(&line).set_frequency(&line, Families::shipped(), hz).await;
            set.map_err(|why| named.tell("frequency", why.into()))
        })
    }

    pub(crate) fn halt(&self, halting: &Halting) -> Result<Work<()>, Error> {
        let (named, order) = (self.clone(), halting.order()?);
        Ok(Task::new(async move |line| Ok(named.halted(&line, order).await?)))
    }

    /// Ends a motion by all means: by `command`, and where that is not taken now and then by a coast; where it is taken
    /// again and again and not proved, by a coast in the end.
    pub(crate) fn end(&self, command: Command) -> Work<()> {
        let named = self.clone();
        Task::new(async move |line| Ok(named.ended(&line, command).await?))
    }

    pub(crate) fn look(&self) -> Work<Look> {
        let named = self.clone();
        Task::new(async move |line| named.looked(&line).await)
    }

    pub(crate) fn status(&self) -> Work<Status> {
        let named = self.clone();
        Task::new(async move |line| {
            let look = named.looked(&line).await?;
            let frequencies = named.measured(&line).await?;
            Ok(Status::new(named.profile(), &look, frequencies))
        })
    }

    pub(crate) fn fault(&self) -> Result<Work<Option<Fault>>, Error> {
        self.looks.fault().map_err(|why| self.not_allowed("present fault", &why.to_string()))?;
        let named = self.clone();
        Ok(Task::new(async move |line| {
            let look = named.looked(&line).await?;
            Ok(look.fault_of(named.profile()).map(std::borrow::Cow::into_owned))
        }))
    }

    pub(crate) fn frequencies(&self) -> Work<Option<Frequencies>> {
        let named = self.clone();
        Task::new(async move |line| named.measured(&line).await)
    }

    pub(crate) fn control(&self) -> Work<Vec<Setting>> {
        let named = self.clone();
        Task::new(async move |line| named.call(&line).control(&line, Setpoint::Frequency).await)
    }

    pub(crate) fn identify(&self) -> Work<Identification> {
        operations::identify(self.address)
    }

    pub(crate) fn contradiction(&self) -> Work<Option<Contradiction>> {
        let named = self.clone();
        Task::new(async move |line| named.same(&line).contradiction(&line, Families::shipped(), false).await)
    }

    pub(crate) fn values<'a>(&self, asked: impl IntoIterator<Item = &'a str>) -> Result<Work<Values>, Error> {
        let asked: Vec<String> = asked.into_iter().map(str::to_owned).collect();
        let (named, planned) = (self.clone(), self.reading(self.profile(), &asked)?);
        Ok(Task::new(async move |line| {
            // What the drive is set to may decide what its words mean.
            let all: Vec<_> = asked.iter().map(String::as_str).collect();
            let settled = named.call(&line).settled(&line, &all).await;
            let settled = settled.map_err(|why| named.tell("values", why.into()))?;
            let is_as_planned = Arc::ptr_eq(settled.profile(), named.profile());
            let reading = if is_as_planned { planned } else { named.reading(settled.profile(), &asked)? };
            let line = line.taken_for(named.address, &named.family);
            let mut words = Vec::with_capacity(reading.words());
            for (place, count) in reading.spans() {
                words.extend(line.read(Read::words(named.address, place, count)).await?);
            }
            Ok(reading.values(&words))
        }))
    }

    pub(crate) fn prepare(&self, setpoint: Setpoint, store: Store) -> Work<Vec<Setting>> {
        let named = self.clone();
        Task::new(async move |line| {
            let prepared = named.call(&line).prepare(&line, Families::shipped(), setpoint, store).await;
            prepared.map_err(|why| match why {
                NotPrepared::NotKept(why) => why.into(),
                why => named.tell("settings", why.into()),
            })
        })
    }

    pub(crate) fn write<'a, V: Into<Input<'a>>>(
        &self,
        values: impl IntoIterator<Item = (&'a str, V)>,
        store: Store,
    ) -> Work<()> {
        let given = |(name, value): (&str, V)| (name.to_owned(), OwnedInput::from(value.into()));
        let given: Vec<_> = values.into_iter().map(given).collect();
        let named = self.clone();
        Task::new(async move |line| {
            let wanted: Vec<_> = given.iter().map(|(name, value)| (name.as_str(), value.input())).collect();
            Ok(named.call(&line).write_values(&line, Families::shipped(), &wanted, store).await?)
        })
    }

    pub(crate) fn give(&self, setpoint: Setpoint, value: Input<'_>) -> Work<()> {
        let (named, value) = (self.clone(), OwnedInput::from(value));
        Task::new(async move |line| {
            let given = named.call(&line).give_setpoint(&line, Families::shipped(), setpoint, value.input()).await;
            given.map_err(|why| named.tell(setpoint.name(), why.into()))
        })
    }

    pub(crate) fn set_bits<'a, V: Into<FieldInput<'a>>>(
        &self,
        setpoint: Setpoint,
        bits: impl IntoIterator<Item = (&'a str, V)>,
    ) -> Result<Work<()>, Error> {
        let given = |(name, value): (&str, V)| Ok((name.to_owned(), GivenField::of(value.into())?));
        let given = bits.into_iter().map(given).collect::<Result<Vec<_>, Error>>()?;
        let named = self.clone();
        Ok(Task::new(async move |line| {
            let bits: Vec<_> = given.iter().map(|(name, value)| (name.as_str(), value.input())).collect();
            let set = named.call(&line).set_bits(&line, Families::shipped(), setpoint, &bits, false).await;
            set.map_err(|why| named.tell(setpoint.name(), why.into()))
        }))
    }

    fn reading(&self, profile: &Profile, asked: &[String]) -> Result<Reading, Error> {
        let asked = asked.iter().map(String::as_str);
        if self.is_unverified { Reading::unverified(profile, asked) } else { Reading::new(profile, asked) }
    }

    async fn looked(&self, line: &Mailbox<Error>) -> Result<Look, Error> {
        self.looks.look(&line.taken_for(self.address, &self.family), self.address, false).await
    }

    /// In Hz, so that a family whose unit nobody knows, or is another one, tells nothing.
    async fn measured(&self, line: &Mailbox<Error>) -> Result<Option<Frequencies>, Error> {
        let rule = self.rule();
        let of_role = |role| self.profile().role(role).filter(|entry| rule.read(entry).is_ok());
        let names: Vec<_> = ["frequency", "setpoint"].into_iter().filter_map(of_role).map(Entry::name).collect();
        let profile = match self.call(line).settled(line, &names).await {
            Ok(settled) => Arc::clone(settled.profile()),
            Err(NotSettled::Failed(error)) => return Err(error),
            Err(_) => return Ok(None),
        };
        if profile.role("frequency").is_none_or(|entry| entry.quantity().unit() != "Hz") {
            return Ok(None);
        }
        let is_as_named = Arc::ptr_eq(&profile, self.profile());
        let speeds = if is_as_named { &self.speeds } else { &Arc::new(Speeds::new(&profile, self.is_unverified)) };
        speeds.frequencies(&line.taken_for(self.address, &self.family), self.address, false).await
    }

    async fn ended(&self, line: &Mailbox<Error>, command: Command) -> Result<(), NotHalted<Error>> {
        let until = line.now() + Order::WITHIN;
        let mut stops = 0;
        let mut failed: Option<NotHalted<Error>> = None;
        loop {
            // What was not taken by then is not waited for so long again.
            let within = until.saturating_duration_since(line.now());
            let command = if stops < STOPS { command } else { Command::Coast };
            let order = Order { command, besides: Besides::Coast, within, confirm: Halting::CONFIRM };
            let Err(why) = self.halted(line, order).await else { return Ok(()) };
            // One that went out says more than a later one that did not.
            let known = failed.take().filter(|known| known.was_sent && !why.was_sent);
            let why = known.unwrap_or(why);
            if stops == STOPS {
                return Err(why);
            }
            stops += 1;
            failed = Some(why);
        }
    }

    async fn halted(&self, line: &Mailbox<Error>, order: Order) -> Result<(), NotHalted<Error>> {
        self.halt_by(line, &order).carry_out(line, Families::shipped()).await
    }

    /// Its halt as `order` says, of which nothing is sent yet.
    fn halt_by(&self, line: &Mailbox<Error>, order: &Order) -> Halt<Error> {
        let named = self.to_halt_by(order.command);
        let can_coast = || named.rule().command(Command::Coast).is_ok();
        let mut order = order.clone();
        if order.besides == Besides::Coast && !can_coast() {
            order.besides = Besides::Nothing;
        }
        Halt::new(named.taken(line), &named.record, order, Families::shipped(), line.now())
    }

    /// The same; where a start was forced on what no document proves, as this halt is, with the same trust.
    fn to_halt_by(&self, command: Command) -> Self {
        let is_forced =
            self.record.sent().started_unverified && Rule::printed(self.profile()).command(command).is_err();
        self.clone().trusting(self.is_unverified || is_forced)
    }

    fn same(&self, line: &Mailbox<Error>) -> SameUnit {
        let identity = self.record.identity(self.family.name(), line.connection());
        SameUnit::new(self.address, &self.family, &identity, self.is_trusted)
    }

    fn taken(&self, line: &Mailbox<Error>) -> Taken {
        Taken::as_named(self.same(line), &self.looks, &self.speeds)
    }

    pub(crate) fn call(&self, line: &Mailbox<Error>) -> drive::Unit {
        drive::Unit::new(self.taken(line), &self.record)
    }

    /// `error`, which may not say yet of whom.
    pub(crate) fn tell(&self, what: &str, error: Error) -> Error {
        error.saying_first(format_args!("{what} of unit {}", self.address.get()))
    }

    fn not_allowed(&self, what: &str, why: &str) -> Error {
        self.tell(what, Error::not_allowed(format_args!("it may not be read: {why}")))
    }
}
