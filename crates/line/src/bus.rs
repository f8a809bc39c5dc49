//! The bus as its callers see it: safe from any thread, one exchange at a time, retries by kind.
//!
//! | room | what is in it |
//! | --- | --- |
//! | `errand` | a request whose caller does not wait in a thread of its own |
//! | `clock`, `openings`, `figures` | the line's time, how often it was opened, and what happened at it |
//! | `wills` | what programs leave to be done when they are gone |
//! | `programs` | the numbers of those who use the line through this program |
//! | `port` | one line, and what all have in common who use it |
//! | `call` | one call from its place in the queue to its end |
//! | `listen` | hearing the line without asking |
//! | `host` | serving other programs |
//! | `sharing` | whether the port is this program's, or another's through which it is used |
//! | `shared` | a port, and with whom it is shared |
//! | `through` | being served by another program |
//! | `halts` | halting what a program ran that is gone |
//! | `halts_told` | how often each unit was told to halt |
//! | `workers` | the threads that carry out errands |

pub(crate) mod call;
mod clock;
pub(crate) mod errand;
mod figures;
#[cfg(all(unix, feature = "share"))]
mod halts;
mod halts_told;
#[cfg(all(any(unix, windows), feature = "share"))]
mod host;
mod listen;
mod openings;
mod port;
#[cfg(any(feature = "tcp", all(any(unix, windows), feature = "share")))]
pub(crate) mod programs;
mod shared;
#[cfg_attr(not(all(any(unix, windows), feature = "share")), path = "bus/no_sharing.rs")]
mod sharing;
mod spoken;
#[cfg_attr(not(all(any(unix, windows), feature = "share")), path = "bus/unshared.rs")]
mod through;
#[cfg_attr(not(all(unix, feature = "share")), path = "bus/no_wills.rs")]
mod wills;
pub(crate) mod workers;

use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::huanyang::Protocol;
use drivebus_rtu::{Answer, Destination, Instant, Meanings, Request, UnitAddress};

use crate::ask::Done;
use crate::bus::call::Call;
use crate::bus::port::Port;
#[cfg(feature = "tcp")]
use crate::bus::programs::Seat;
use crate::bus::shared::Shared;
use crate::error::{CallError, Failure};
use crate::health::link::Link;
use crate::health::stats::Stats;
use crate::line::Opener;
use crate::options::{BusOptions, CallOptions, LastWill, UnitOptions};
use crate::ports::key::PortKey;
use crate::system::punctual;
use crate::trace::Watch;

/// One line and its owner.
///
/// The calling thread works on the line itself when its turn comes; others wait in the order of
/// [`Priority`](crate::Priority). `give_up` is asked about every 50 ms while a call waits, and ends it with
/// [`Failure::Interrupted`].
#[derive(Debug)]
pub struct Bus {
    shared: Arc<Shared>,
}

impl Bus {
    /// Opens a line with `opener`, which is called again whenever the line was lost.
    ///
    /// `opener` runs in a thread of its own, because it may block in the system for seconds; `give_up` is asked about
    /// every 50 ms meanwhile.
    ///
    /// # Errors
    ///
    /// [`Failure::Port`]: the line cannot be opened. [`Failure::Interrupted`]: `give_up` said so first.
    pub fn open(opener: Opener, options: BusOptions, give_up: &mut dyn FnMut() -> bool) -> Result<Self, Failure> {
        Shared::open(opener, None, options, give_up).map(|shared| Self { shared })
    }

    /// As [`open`](Self::open), of a port that programs may share: `key` tells it from others, and
    /// [`BusOptions::share`] says whether it is shared. Where another program of this user has it, the bus uses it through
    /// that one, in its queue, until that one ends; then one of the others has it.
    ///
    /// # Errors
    ///
    /// Those of [`open`](Self::open). [`Failure::Port`] also where the program that has the port opened it with other
    /// characters, or is of another version.
    pub fn open_shared(
        opener: Opener,
        key: Option<PortKey>,
        options: BusOptions,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Self, Failure> {
        Shared::open(opener, key, options, give_up).map(|shared| Self { shared })
    }

    fn port(&self) -> &Arc<Port> {
        &self.shared.port
    }

    /// The name of the port, for messages.
    pub fn name(&self) -> &str {
        &self.port().name
    }

    /// How the bus behaves.
    pub fn options(&self) -> &BusOptions {
        &self.port().options
    }

    /// Whether the bus was closed, or was opened by another process: by the parent of this forked child.
    pub fn is_closed(&self) -> bool {
        self.port().is_closed()
    }

    /// As [`is_closed`](Self::is_closed), for who is in the process that opened it.
    pub(crate) fn is_shut(&self) -> bool {
        self.port().is_shut()
    }

    /// Whether the line's clock is a simulation's.
    pub fn is_virtual(&self) -> bool {
        self.port().is_virtual()
    }

    /// Closes the line, after the exchange that is under way at most 50 ms later. Closing again does nothing.
    ///
    /// A unit that is being halted for a program that is gone is waited for, a second at most. From inside a `give_up`, the
    /// call that asks it closes the line when it ends.
    pub fn close(&self) {
        if !self.is_closed() && !self.port().queue.has_this_thread() {
            self.port().wills.let_out();
        }
        self.port().close();
    }

    /// Gives the port up for as long as `meanwhile` takes: another program of this port may have it. It is opened again, or
    /// used through that program, when something is asked next; that counts as a reconnect.
    ///
    /// For a program that is about to be held, by Ctrl-Z for instance: nobody could use the line through it, not even for a
    /// stop. Nothing is asked through this bus meanwhile. The exchange under way is waited for, two seconds at most; after
    /// that, or in a forked child, `meanwhile` runs and the port is kept.
    pub fn step_aside(&self, meanwhile: impl FnOnce()) {
        self.shared.step_aside(meanwhile);
    }

    /// Asks `request` of `destination` and gives the answer to `take`.
    ///
    /// A read that brings nothing is asked again by policy, and `take` is called for the answer that counts. A write
    /// and an echo are sent once, unless [`CallOptions::read_back`] says where the words can be read. Before anything is
    /// asked of a unit that may still answer something else, that unit is probed, so that its late answer is never taken
    /// for the new one: it is sent a fresh word to return, or else a read of another length.
    ///
    /// # Errors
    ///
    /// [`CallError`]: with [`sent`](CallError::sent) `None` the request never went out, so nothing was done; after any
    /// other failure but [`Failure::Refused`] the unit may have done what was asked. From inside a `give_up` of the same
    /// thread: [`BeginError::OutOfTurn`](drivebus_rtu::BeginError::OutOfTurn).
    pub fn call(
        &self,
        destination: Destination,
        request: &Request<'_>,
        options: CallOptions,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        if !self.port().is_of_this_process() {
            // What a thread of the parent held when this child was forked, nobody here lets go: nothing is looked up.
            let ask = self.port().ask_as(UnitOptions::default(), destination, request, &options);
            return Err(ask.failed(Failure::Forked, None, None, &[]));
        }
        if let Some(failure) = self.port().options.kept_from(request) {
            return Err(self.port().unsent(destination, request, &options, failure));
        }
        let said = self.port().said(destination, request, &options)?;
        let mut give_up = || self.is_shut() || give_up();
        let options = spoken::options_for(&said, options);
        let take = &mut |answer: Answer<'_>| spoken::tell(&said, request, answer, take);
        let ask = self.port().ask(destination, &said, &options);
        let result = match &self.shared.sharing {
            Some(_) => self.shared.call_shared(destination, &said, options, &mut give_up, take),
            None => Call::new(self.port(), ask, options).run(&mut give_up, take),
        };
        if self.is_shut() {
            self.close();
        }
        result
    }

    /// Sets what `unit` needs otherwise than the bus, for every call from now on.
    ///
    /// In a forked child nothing is set: it makes no calls.
    pub fn configure(&self, unit: UnitAddress, options: UnitOptions) {
        if self.port().is_of_this_process() {
            self.port().units().insert(unit, options);
        }
    }

    /// Says what the exceptions of `unit` mean, for every call from now on: until then those of the specification hold.
    ///
    /// A read that is refused by one that means [`Meaning::AskAgain`](drivebus_rtu::Meaning::AskAgain) is asked again as after
    /// a damaged answer, and so is a write whose words can be read back. In a forked child nothing is set.
    pub fn set_meanings(&self, unit: UnitAddress, meanings: Meanings) {
        if self.port().is_of_this_process() {
            self.port().meanings.set(unit, meanings);
        }
    }

    /// Says which protocol `unit` speaks, for every call from now on: until then it is Modbus.
    ///
    /// To a unit that speaks another one nothing of Modbus is sent, and what that protocol has nothing for is refused
    /// ([`Failure::NotSpoken`]). Callers go on asking for registers: which of them stands for what,
    /// [`Huanyang`](drivebus_rtu::huanyang::Huanyang) says. In a forked child nothing is set.
    pub fn set_protocol(&self, unit: UnitAddress, protocol: Protocol) {
        if self.port().is_of_this_process() {
            self.port().spoken.set(unit, protocol);
        }
    }

    /// Of the last ten exchanges with `unit`, how many brought an answer. Where another program has the port, it is asked, a
    /// second at most; one that does not answer leaves what this bus saw itself.
    pub fn link(&self, unit: UnitAddress) -> Link {
        if !self.port().is_of_this_process() {
            return Link::default(); // a thread of the parent's may have held it
        }
        self.shared.link(unit)
    }

    /// As [`link`](Self::link), for who waits for nobody: `None` where another program has the port, and would be asked.
    pub fn link_if_here(&self, unit: UnitAddress) -> Option<Link> {
        self.told_here(|port| port.figures.link(unit))
    }

    /// A number that is another one each time `unit` is told to halt over this line, by whichever program: by a write that is
    /// a [stop](crate::Priority::Stop). For [`CallOptions::halts`](crate::CallOptions::halts). Where another program has the
    /// port, it is asked, a second at most.
    pub fn halts(&self, unit: UnitAddress) -> u64 {
        if !self.port().is_of_this_process() {
            return 0;
        }
        self.shared.halts(unit)
    }

    /// As [`halts`](Self::halts), for who waits for nobody: `None` where another program has the port, and would be asked.
    pub fn halts_if_here(&self, unit: UnitAddress) -> Option<u64> {
        self.told_here(|port| port.halts.of(unit))
    }

    /// What the port of this program tells; `None` where another program has it. In a forked child it tells nothing.
    fn told_here<T: Default>(&self, tell: impl FnOnce(&Port) -> T) -> Option<T> {
        if !self.port().is_of_this_process() {
            return Some(T::default());
        }
        let is_elsewhere = self.shared.sharing.as_ref().is_some_and(|sharing| sharing.is_guest());
        (!is_elsewhere).then(|| tell(self.port()))
    }

    /// A word that no echo still under way carries: for [`Request::echo`]. Where another program has the port, it is asked, a
    /// second at most; [`Errand::echo`](crate::Errand::echo) does not wait for that.
    pub fn fresh_word(&self) -> u16 {
        self.shared.fresh_word()
    }

    /// Now, on the line's clock; its start in a forked child, where only the line of the parent knows.
    ///
    /// Inside of a watch or a `give_up`, on a virtual line without a [clock](crate::Line::clock): the latest moment that is
    /// known, as nobody can ask the line then.
    pub fn now(&self) -> Instant {
        self.port().now()
    }

    /// Waits on the line's clock; other callers may use the line meanwhile. Ends early when `give_up` says so.
    pub fn sleep(&self, time: Duration, give_up: &mut dyn FnMut() -> bool) {
        self.port().sleep(time, give_up);
    }

    /// Shows each frame that goes over the line to `watch` from now on, or to nobody any more.
    ///
    /// `watch` is called in the thread that uses the line, while it does: what it takes, the next request waits. Where
    /// another program has the port, it is shown what this bus asks there and what comes of it. A bus that nobody ever
    /// watched does nothing for it.
    pub fn watch(&self, watch: Option<Watch>) {
        if self.port().is_of_this_process() {
            self.port().watch(watch);
        }
    }

    /// What has happened so far; nothing in a forked child, whose parent's it is. Where another program has the port, it is
    /// asked, a second at most.
    pub fn stats(&self) -> Stats {
        if !self.port().is_of_this_process() {
            return Stats::default(); // a thread of the parent's may have held it
        }
        #[cfg_attr(
            not(any(feature = "tcp", all(any(unix, windows), feature = "share"))),
            expect(unused_mut, reason = "nobody else is here")
        )]
        let mut stats = self.shared.stats();
        #[cfg(any(feature = "tcp", all(any(unix, windows), feature = "share")))]
        stats.programs.extend(self.port().programs.clients());
        stats
    }

    /// How often the port was opened again after it was lost, or was another program's and changed hands.
    ///
    /// Nobody is asked: another program that has the port says so with each answer, and whenever it opens it again.
    pub fn reconnects(&self) -> u64 {
        if self.port().is_of_this_process() { self.shared.reconnects() } else { 0 }
    }

    /// What the user should know about the line, such as a setting that did not reach the wire.
    ///
    /// While somebody waits on the line, what it said last.
    pub fn notes(&self) -> Vec<String> {
        self.shared.notes()
    }

    /// What this bus did for programs that are gone, and what it could not do, in words: see
    /// [`leave_will`](Self::leave_will).
    pub fn wills(&self) -> Vec<String> {
        if self.port().is_of_this_process() { self.port().wills.notes() } else { Vec::new() }
    }

    /// Leaves a last will: what halts a unit, should this program be gone without a word. Whoever has the port then, or
    /// opens it within five minutes, sends that before anything else to this unit, until the unit takes it. Several of a
    /// program add up, and the newest counts.
    ///
    /// `None` where nobody would find it: the port is of no kind that programs share, or the system gives no place. What
    /// closes the bus leaves it to be carried out.
    pub fn leave_will(&self, will: LastWill) -> Option<u64> {
        let leave = || self.port().wills.leave(self.port().spoken.will(will));
        (self.port().is_of_this_process() && !self.is_shut()).then(leave).flatten()
    }

    /// Takes back the will that [`leave_will`](Self::leave_will) gave this number. In a forked child it stays the parent's.
    pub fn withdraw_will(&self, number: u64) {
        if self.port().is_of_this_process() {
            self.port().wills.withdraw(number);
        }
    }

    /// As [`leave_will`](Self::leave_will), for a client of this program, which [`carry_out_will`](Self::carry_out_will) halts
    /// the unit for; `then` hears whether it took that, and then what shows of it. `None`: nobody could halt it.
    #[cfg(feature = "tcp")]
    pub(crate) fn leave_will_for(
        &self,
        client: String,
        will: LastWill,
        then: impl FnMut(bool, Option<&str>) + Send + 'static,
    ) -> Option<u64> {
        let leave = || self.port().wills.leave_for(client, self.port().spoken.will(will), Box::new(then));
        (!self.is_closed()).then(leave).flatten()
    }

    /// Carries out now the will of this number.
    #[cfg(feature = "tcp")]
    pub(crate) fn carry_out_will(&self, number: u64) {
        if self.port().is_of_this_process() {
            self.port().wills.carry_out_now(number);
        }
    }

    /// To be called by each thread that works for this bus alone: it goes before the programs around it, where the
    /// system allows that; where it does not, [`notes`](Self::notes) says so. In virtual time nothing is asked for.
    pub fn enter_thread(&self) {
        self.port().enter_thread();
    }

    /// A number for one more client that uses the line through this program, counted under `name`.
    #[cfg(feature = "tcp")]
    pub(crate) fn seat_of(&self, name: String) -> Seat {
        self.port().programs.seat_of(name)
    }

    /// Whether frames are told apart by something else than silence.
    pub(crate) fn is_gapless(&self) -> bool {
        self.port().gapless
    }

    /// Whether `unit` could not take a request, as it says by `failure`, and may the next time.
    pub(crate) fn asks_again(&self, unit: UnitAddress, failure: &Failure) -> bool {
        self.port().is_of_this_process() && self.port().meanings.asks_again(unit, None, failure)
    }

    /// The least silence before a request to `unit`.
    pub(crate) fn silence_before(&self, unit: UnitAddress) -> Duration {
        let gap = self.port().units().get(&unit).and_then(|set| set.gap).unwrap_or_default();
        self.port().options.format.t35().max(gap)
    }

    /// Why a bus that [is closed](Self::is_closed) is.
    pub(crate) fn ended(&self) -> Failure {
        if self.is_shut() { Failure::Closed } else { Failure::Forked }
    }
}

impl Drop for Bus {
    /// Whoever still waits for an answer is told that none will come.
    fn drop(&mut self) {
        if self.port().is_of_this_process() {
            self.port().dismiss();
            // Others hold the line too, while they use it.
            if self.shared.sharing.is_some() {
                self.port().close();
            }
            punctual::put_back();
        }
    }
}

#[cfg(test)]
impl Bus {
    /// How many wait for the line.
    pub(crate) fn waiting(&self) -> usize {
        self.port().queue.waiting()
    }
}
