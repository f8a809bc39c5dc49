//! What a bus consists of: its port, and the programs with which it may share that one.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::{Answer, FreshWords};

use crate::ask::Done;
use crate::bus::call::Call;
use crate::bus::errand::Errand;
use crate::bus::figures::Figures;
use crate::bus::openings::Openings;
use crate::bus::port::Port;
use crate::bus::sharing::Sharing;
use crate::bus::spoken;
use crate::bus::wills::Wills;
use crate::error::{CallError, Failure};
use crate::line::Opener;
use crate::options::BusOptions;
use crate::owner::Owner;
use crate::ports::key::PortKey;
use crate::system::clock::monotonic;
use crate::turns::order::Priority;
use crate::turns::queue::Turn;

/// How long the exchange under way may take where the port is to be given up.
const WAITS_TO_STEP_ASIDE: Duration = Duration::from_secs(2);

/// A port, and with whom it is shared.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(super) port: Arc<Port>,
    /// Where the port is of a kind that programs share, and this one does.
    pub(super) sharing: Option<Arc<Sharing>>,
}

impl Shared {
    /// With the line that `opener` opens, or through the program that has the port which `key` tells apart.
    pub(super) fn open(
        opener: Opener,
        key: Option<PortKey>,
        options: BusOptions,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Arc<Self>, Failure> {
        let stats = Arc::default();
        let given = key.as_ref().map(ToString::to_string).unwrap_or_default();
        let openings = Openings::new(&stats);
        let wills = Arc::new(Wills::new(key.clone(), &options));
        let (sharing, opener) = Sharing::around(key, &options, &stats, &openings, openings.counting(opener));
        let opener = wills.finding(opener);
        let mut owner = Owner::new(opener, options.format, options.echo.into(), random(), Arc::clone(&stats));
        match owner.open(give_up) {
            Err(failure) if !sharing.as_ref().is_some_and(|sharing| sharing.is_guest()) => return Err(failure),
            _ => {}
        }
        // Where the words begin is random: another program on this line must not use the same ones.
        let chance = owner.line().and_then(|line| line.chance()).unwrap_or_else(random);
        let [a, b, ..] = chance.to_le_bytes();
        let words = FreshWords::beginning_at(u16::from_le_bytes([a, b]));
        let figures = Figures::new(stats, owner.shared_links());
        let port = Arc::new(Port::new(owner, given, options, figures, words, Arc::clone(&wills)));
        let shared = Arc::new(Self { port, sharing });
        wills.serves(&shared);
        if let Some(sharing) = &shared.sharing {
            shared.port.ends_with(Arc::clone(sharing) as _);
            sharing.serves(&shared.port);
        }
        Ok(shared)
    }

    /// Lets others have the line while `meanwhile` runs.
    pub(crate) fn step_aside(&self, meanwhile: impl FnOnce()) {
        let port = &self.port;
        if port.is_closed() {
            return meanwhile();
        }
        let end = monotonic() + WAITS_TO_STEP_ASIDE;
        // Kept until the end, so that nobody here opens the port again.
        let turn = port.queue.turn((Priority::Stop, None), &mut || monotonic() >= end);
        if turn.is_ok() && !self.sharing.as_ref().is_some_and(|sharing| sharing.is_guest()) {
            port.lock().close();
            port.wills.hand_over();
            if let Some(sharing) = &self.sharing {
                sharing.serves_no_more();
            }
        }
        meanwhile();
    }

    /// `None` where there is nothing to carry out.
    pub(super) fn carry_out_here(
        &self,
        errand: &Errand,
        turn: Turn<'_, Errand>,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Option<Result<Done, Box<CallError>>> {
        let request = errand.request(|| self.port.words.next())?;
        let said = match self.port.said(errand.destination, &request, &errand.options) {
            Ok(said) => said,
            Err(error) => return Some(Err(error)),
        };
        let options = spoken::options_for(&said, errand.options);
        let ask = self.port.ask(errand.destination, &said, &options);
        let mut call = Call::new(&self.port, ask, options).of_program(errand.program).while_wanted(&*errand.wanted);
        let take = &mut |answer: Answer<'_>| spoken::tell(&said, &request, answer, take);
        Some(call.run_in(turn, &mut || self.port.is_shut(), take))
    }

    /// What people should know about the line, and about who shares it.
    pub(super) fn notes(&self) -> Vec<String> {
        if !self.port.is_of_this_process() {
            return Vec::new(); // a thread of the parent's may have held them
        }
        let shared = self.sharing.iter().flat_map(|sharing| sharing.notes());
        self.port.line_notes().into_iter().chain(shared).chain(self.port.system_notes()).collect()
    }
}

/// A number that nobody else can tell.
fn random() -> u64 {
    RandomState::new().build_hasher().finish()
}
