//! What a bus does whose port may be another program's: it asks that one, or the line itself, whichever it is by now.

use std::time::Duration;

use drivebus_rtu::{Adu, Answer, Destination, Instant, Request, UnitAddress};

use crate::ask::{Ask, Done};
use crate::bus::call::Call;
use crate::bus::errand::Errand;
use crate::bus::shared::Shared;
use crate::bus::spoken;
use crate::error::{CallError, Failure};
use crate::health::link::Link;
use crate::health::stats::Stats;
use crate::line::{PortError, PortErrorKind};
use crate::options::CallOptions;
use crate::share::failure::Said;
use crate::share::guest::{Guest, Lost};
use crate::share::message::{Order, Told, Wish};
use crate::share::nanos;
use crate::system::clock::monotonic;
use crate::trace::{Direction, Overheard, Traced};
use crate::turns::order::Priority;
use crate::turns::queue::Turn;

/// How often a port may change hands within one call.
const HANDS: u32 = 16;
/// How long something may take that waits for no turn.
const AT_ONCE: Duration = Duration::from_secs(1);

/// Hears a piece of the line, asking now and then whether to go on.
type Hear<'a> = dyn FnMut(&mut dyn FnMut() -> bool, Whose) -> Result<(), Failure> + 'a;

/// Where the line is heard.
enum Whose {
    /// In this program, for so long.
    Ours(Duration),
    /// In another, which tells this.
    Theirs(Told),
}

impl Shared {
    /// What becomes of a call on a port that is shared.
    pub(super) fn call_shared(
        &self,
        destination: Destination,
        request: &Request<'_>,
        options: CallOptions,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        let ask = self.port.ask(destination, request, &options);
        let Some(sharing) = &self.sharing else { return self.call_here(ask, options, give_up, take) };
        let mut retries = options.retries.unwrap_or(self.port.options.retries);
        for _ in 0..HANDS {
            let Some(guest) = sharing.guest() else {
                match self.call_here(ask, options, give_up, take) {
                    Err(error) if is_taken(&error) && sharing.is_guest() => continue,
                    result => return result,
                }
            };
            let began = monotonic();
            match self.call_and_show(&guest, &ask, options, give_up, take) {
                Ok(result) => return result,
                Err(Lost::Unsent) => sharing.lost(&guest),
                Err(Lost::Unknown) => {
                    sharing.lost(&guest);
                    let is_read = match ask.request {
                        Request::Read { .. } => true,
                        Request::Huanyang(asked) => !asked.is_write(),
                        _ => false,
                    };
                    if !is_read || retries == 0 {
                        let why = format!("{}, through which the port was used, ended", guest.host());
                        return Err(self.lost_there(&ask, PortErrorKind::Lost, why, Some(began)));
                    }
                    retries -= 1;
                }
                Err(Lost::GivenUp) => return Err(ask.failed(self.port.given_up(), None, monotonic(), &[])),
                Err(Lost::Silent(why)) => return Err(self.lost_there(&ask, PortErrorKind::Busy, why, Some(began))),
                Err(Lost::SentAway(why)) => return Err(self.lost_there(&ask, PortErrorKind::Busy, why, None)),
            }
        }
        let why = "it goes from one program to another, and none of them keeps it".to_owned();
        Err(self.lost_there(&ask, PortErrorKind::Busy, why, None))
    }

    fn call_here(
        &self,
        ask: Ask<'_>,
        options: CallOptions,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        Call::new(&self.port, ask, options).run(give_up, take)
    }

    fn lost_there(&self, ask: &Ask<'_>, kind: PortErrorKind, why: String, sent: Option<Instant>) -> Box<CallError> {
        ask.failed(Failure::Port(PortError::new(kind, &self.port.name, why)), sent, monotonic(), &[])
    }

    /// As [`call_through`](Self::call_through); who watches this bus is shown what was asked and what came of it.
    fn call_and_show(
        &self,
        guest: &Guest,
        ask: &Ask<'_>,
        options: CallOptions,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Result<Done, Box<CallError>>, Lost> {
        let Some(watch) = self.port.trace.watch() else { return self.call_through(guest, ask, options, give_up, take) };
        let mut came = None;
        let mut keep = |answer: Answer<'_>| {
            if let Destination::Unit(unit) = ask.destination {
                came = Some(Adu::answer(unit, &answer).as_bytes().to_vec());
            }
            take(answer);
        };
        let result = self.call_through(guest, ask, options, give_up, &mut keep)?;
        let (sent, ended) = match &result {
            Ok(done) => (Some(done.sent), Some(done.ended)),
            Err(error) => (error.sent, error.ended),
        };
        if let Some(at) = sent {
            let bytes = ask.frame();
            watch(Traced { at, gap: None, direction: Direction::Sent, bytes, elsewhere: true });
        }
        let raw = result.as_ref().err().map(|error| error.raw.clone()).filter(|raw| !raw.is_empty());
        if let (Some(at), Some(bytes)) = (ended, came.or(raw)) {
            let gap = sent.map(|sent| at.saturating_duration_since(sent));
            watch(Traced { at, gap, direction: Direction::Heard, bytes, elsewhere: true });
        }
        Ok(result)
    }

    /// What becomes of `ask` where the line is.
    fn call_through(
        &self,
        guest: &Guest,
        ask: &Ask<'_>,
        options: CallOptions,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Result<Done, Box<CallError>>, Lost> {
        let kind = if ask.request.is_write() { Priority::Write } else { Priority::Read };
        let priority = options.priority.unwrap_or(kind);
        let retries = options.retries.unwrap_or(self.port.options.retries);
        let meanings = match ask.destination {
            Destination::Unit(unit) => self.port.meanings.set_of(unit),
            Destination::Broadcast => None,
        };
        let order =
            Order::new(ask, priority, retries, &options).meaning(meanings).over(|here| guest.as_counted_there(here));
        let mut result = Err(Lost::Unknown);
        guest.ask(&Wish::Call(order), priority == Priority::Stop, give_up, &mut |told| {
            result = self.told(guest, ask, told, take);
            true
        })?;
        result
    }

    fn told(
        &self,
        guest: &Guest,
        ask: &Ask<'_>,
        told: Told,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Result<Done, Box<CallError>>, Lost> {
        match told {
            Told::Answer { pdu, sent, ended, reconnects } => {
                guest.saw(reconnects);
                let done = Done { sent: Instant::from_nanos(sent), ended: Instant::from_nanos(ended) };
                if ask.destination == Destination::Broadcast {
                    return Ok(Ok(done));
                }
                // What is taken for the answer is judged here once more.
                Ok(match ask.request.judge(&pdu) {
                    Ok(answer) => {
                        take(answer);
                        Ok(done)
                    }
                    Err(error) => Err(ask.failed(Failure::Wrong(error), Some(done.sent), done.ended, &pdu)),
                })
            }
            // The program that has the port ends.
            Told::Failed { failure: Said::Closed, sent: None, .. } => Err(Lost::Unsent),
            Told::Failed { failure: Said::Closed, .. } => Err(Lost::Unknown),
            Told::Failed { failure, raw, sent, ended, reconnects, set_again } => {
                guest.saw(reconnects);
                let failure = match Failure::from(failure) {
                    Failure::Interrupted => self.port.given_up(),
                    failure => failure,
                };
                let (sent, ended) = (sent.map(Instant::from_nanos), ended.map(Instant::from_nanos));
                let error = ask.failed(failure, sent, ended, &raw);
                Ok(Err(Box::new(CallError { set_again, ..*error })))
            }
            _ => Err(Lost::Unknown),
        }
    }

    /// What became of `errand`, whose turn it is.
    pub(super) fn carry_out(
        &self,
        errand: &Errand,
        turn: Turn<'_, Errand>,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Option<Result<Done, Box<CallError>>> {
        let Some(sharing) = &self.sharing else { return self.carry_out_here(errand, turn, take) };
        if sharing.guest().is_none() {
            match self.carry_out_here(errand, turn, take)? {
                Err(error) if is_taken(&error) && sharing.is_guest() => {}
                result => return Some(result),
            }
        } else {
            // It waits where the line is, and the next one here need not wait for that.
            drop(turn);
        }
        let request = errand.request(|| self.fresh_word())?;
        let said = match self.port.said(errand.destination, &request, &errand.options) {
            Ok(said) => said,
            Err(error) => return Some(Err(error)),
        };
        let options = spoken::options_for(&said, errand.options);
        let mut give_up = || self.port.is_shut() || !errand.is_wanted();
        let take = &mut |answer: Answer<'_>| spoken::tell(&said, &request, answer, take);
        Some(self.call_shared(errand.destination, &said, options, &mut give_up, take))
    }

    pub(super) fn listen(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Instant, &[u8]),
    ) -> Result<(), Failure> {
        self.listen_where_the_line_is(time, Wish::Listen, give_up, &mut |give_up, heard| match heard {
            Whose::Ours(left) => self.port.listen(left, give_up, hear),
            Whose::Theirs(Told::Heard { at, bytes }) => {
                hear(Instant::from_nanos(at), &bytes);
                Ok(())
            }
            Whose::Theirs(_) => Ok(()),
        })
    }

    pub(super) fn overhear(
        &self,
        time: Duration,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut dyn FnMut(Overheard),
    ) -> Result<(), Failure> {
        self.listen_where_the_line_is(time, Wish::Overhear, give_up, &mut |give_up, heard| match heard {
            Whose::Ours(left) => self.port.overhear(left, give_up, hear),
            Whose::Theirs(Told::Overheard { at, sent, bytes }) => {
                let direction = if sent { Direction::Sent } else { Direction::Heard };
                hear(Overheard { at: Instant::from_nanos(at), direction, bytes });
                Ok(())
            }
            Whose::Theirs(_) => Ok(()),
        })
    }

    /// Hears the line for `time` in this program or, by `wish`, in the one that has the port, whoever that is meanwhile.
    fn listen_where_the_line_is(
        &self,
        time: Duration,
        wish: impl Fn(u64) -> Wish,
        give_up: &mut dyn FnMut() -> bool,
        hear: &mut Hear<'_>,
    ) -> Result<(), Failure> {
        let Some(sharing) = &self.sharing else { return hear(give_up, Whose::Ours(time)) };
        let end = self.port.now() + time;
        for _ in 0..HANDS {
            let left = end.saturating_duration_since(self.port.now());
            let Some(guest) = sharing.guest() else {
                match hear(give_up, Whose::Ours(left)) {
                    Err(Failure::Port(_)) if sharing.is_guest() => continue,
                    result => return result,
                }
            };
            let mut ended = None;
            let mut is_over = || self.port.is_shut() || give_up();
            let asked = guest.ask(&wish(nanos(left)), false, &mut is_over, &mut |told| match told {
                Told::Over(why) => {
                    ended = why.map(Failure::from);
                    true
                }
                Told::LeftOut(count) => {
                    sharing.left_out(count);
                    false
                }
                Told::Heard { .. } | Told::Overheard { .. } => hear(&mut || false, Whose::Theirs(told)).is_err(),
                _ => true,
            });
            match (asked, ended) {
                (Ok(()), None) => return Ok(()),
                (Ok(()), Some(Failure::Interrupted)) | (Err(Lost::GivenUp), _) => return Err(self.port.given_up()),
                (Ok(()), Some(Failure::Closed)) | (Err(Lost::Unsent | Lost::Unknown), _) => sharing.lost(&guest),
                (Ok(()), Some(failure)) => return Err(failure),
                (Err(Lost::Silent(why) | Lost::SentAway(why)), _) => {
                    return Err(Failure::Port(PortError::new(PortErrorKind::Busy, &self.port.name, why)));
                }
            }
        }
        Err(Failure::Port(PortError::new(PortErrorKind::Busy, &self.port.name, "it goes from one program to another")))
    }

    /// What the program that has the port says at once, if it is another one's and says so.
    pub(super) fn told_at_once<T>(&self, wish: &Wish, read: impl Fn(&Guest, Told) -> Option<T>) -> Option<T> {
        let sharing = self.sharing.as_ref()?;
        let guest = sharing.guest()?;
        let end = monotonic() + AT_ONCE;
        let mut found = None;
        let asked = guest.ask(wish, false, &mut || monotonic() >= end, &mut |told| {
            found = read(&guest, told);
            true
        });
        if matches!(asked, Err(Lost::Unsent | Lost::Unknown)) {
            sharing.lost(&guest);
        }
        found
    }

    pub(super) fn stats(&self) -> Stats {
        let figures = |guest: &Guest, told| match told {
            Told::Stats(figures) => Some(figures.into_stats(guest.reconnects())),
            _ => None,
        };
        self.told_at_once(&Wish::Stats, figures).unwrap_or_else(|| {
            let mut stats = self.port.figures.stats();
            stats.programs = self.sharing.as_ref().map(|sharing| sharing.programs()).unwrap_or_default();
            stats
        })
    }

    pub(super) fn link(&self, unit: UnitAddress) -> Link {
        let link = |_: &Guest, told| match told {
            Told::Link { good, asked } => Some(Link { good, asked }),
            _ => None,
        };
        self.told_at_once(&Wish::Link(unit.get()), link).unwrap_or_else(|| self.port.figures.link(unit))
    }

    pub(super) fn halts(&self, unit: UnitAddress) -> u64 {
        let halts = |_: &Guest, told| match told {
            Told::Halts(halts) => Some(halts),
            _ => None,
        };
        self.told_at_once(&Wish::Halts(unit.get()), halts).unwrap_or_else(|| self.port.halts.of(unit))
    }

    pub(super) fn fresh_word(&self) -> u16 {
        let word = |_: &Guest, told| match told {
            Told::Word(word) => Some(word),
            _ => None,
        };
        self.told_at_once(&Wish::FreshWord, word).unwrap_or_else(|| self.port.words.next())
    }

    pub(super) fn reconnects(&self) -> u64 {
        let guest = self.sharing.as_ref().and_then(|sharing| sharing.guest());
        guest.map_or_else(|| self.port.figures.reconnects(), |guest| guest.reconnects())
    }
}

/// Whether the port was not there to be used: nothing was sent.
fn is_taken(error: &CallError) -> bool {
    error.sent.is_none() && matches!(error.failure, Failure::Port(_))
}
