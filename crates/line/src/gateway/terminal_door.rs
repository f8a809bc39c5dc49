//! Where programs of this computer come in that know serial ports alone: a pseudo-terminal, which one at a time has open.
//! Linux only.

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::fs::{PermissionsExt as _, chown};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::Instant;
use rustix::event::{PollFd, PollFlags};

use crate::gateway::door::Hall;
use crate::gateway::openings::Openings;
use crate::gateway::stream::Stream as _;
use crate::gateway::terminal::{Bell, Terminal};
use crate::ports::pty::{PtyLink, open_raw};
use crate::system::clock::{LOOK_UP, monotonic, wait_for, wait_for_any};
use crate::system::inherited::Kept;

/// How long nothing comes before what comes next is taken for a request again, after what was none.
const QUIET: Duration = Duration::from_millis(50);
/// Rules for networks see such a program here.
const HERE: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
/// When nothing is due.
const NEVER: Duration = Duration::MAX;

/// A pseudo-terminal, and the name by which programs find it.
#[derive(Debug)]
pub(super) struct Found {
    ours: Arc<Kept<OwnedFd>>,
    openings: Arc<Openings>,
    _link: PtyLink,
}

impl Found {
    /// A new one, for this user's programs and those of `group`.
    pub(super) fn new(link: &Path, baud_rate: u32, group: Option<u32>) -> io::Result<Self> {
        // Their side is not kept open here, so that it is seen whether a program has it.
        let (ours, _, theirs) = open_raw(baud_rate)?;
        let mode = if group.is_some() { 0o660 } else { 0o600 };
        chown(&theirs, None, group)?;
        std::fs::set_permissions(&theirs, std::fs::Permissions::from_mode(mode))?;
        let openings = Arc::new(Openings::of(&theirs)?);
        let link = PtyLink::new(link.to_owned(), &theirs)?;
        Ok(Self { ours: Arc::new(Kept::new(ours)), openings, _link: link })
    }
}

/// The door behind it.
pub(super) struct TerminalDoor {
    pub(super) hall: Hall,
    pub(super) found: Found,
    /// Who comes in, for people: the name of the link.
    pub(super) name: String,
    pub(super) closing: Arc<Bell>,
}

impl TerminalDoor {
    /// Lets one program after the other in, until it is closed.
    pub(super) fn stand(&self) {
        loop {
            match self.wait(NEVER) {
                Heard::Closing => return,
                Heard::Bytes => {
                    if let Err(error) = self.serve() {
                        self.hall.tell(&error);
                        // No file is left to open, most likely: that does not end by being tried at once.
                        let _ = wait_for_any(&mut [self.closing.waiting()], far(LOOK_UP));
                    }
                }
                Heard::Opening => {
                    self.found.openings.closed();
                }
                Heard::Left => {
                    let _ = wait_for_any(&mut [self.found.openings.waiting(), self.closing.waiting()], far(NEVER));
                    self.found.openings.closed();
                }
                Heard::Nothing => {}
            }
        }
    }

    /// Serves the program that has it open until that closes it, or sends what is no request.
    fn serve(&self) -> io::Result<()> {
        let Found { ours, openings, .. } = &self.found;
        // What the last one did not take is not for this one, which has asked and was not answered yet.
        openings.forget_answers()?;
        let closed = openings.closed();
        if self.is_left() {
            self.throw_away();
            return Ok(());
        }
        let terminal = Arc::new(Terminal::new(Arc::clone(ours), Arc::clone(openings), closed)?);
        self.hall.let_in(Arc::<Terminal>::clone(&terminal), HERE, self.name.clone())?;
        wait_for_any(&mut [terminal.over(), self.closing.waiting()], far(NEVER))?;
        terminal.end();
        if terminal.was_left() {
            openings.forget_answers()?;
        } else {
            self.wait_for_a_pause();
        }
        Ok(())
    }

    /// Whether no program has it open.
    fn is_left(&self) -> bool {
        let left = wait_for(self.found.ours.as_fd(), PollFlags::HUP, monotonic());
        left.is_ok_and(|ready| ready.is_some_and(|ready| ready.contains(PollFlags::HUP)))
    }

    /// A program that is still there sent what is no request: what follows is none either, until it pauses.
    fn wait_for_a_pause(&self) {
        let closed = self.found.openings.closed();
        loop {
            match self.wait(QUIET) {
                Heard::Bytes => self.throw_away(),
                Heard::Opening if self.found.openings.closed() == closed => {}
                Heard::Opening | Heard::Left | Heard::Nothing | Heard::Closing => return,
            }
        }
    }

    fn throw_away(&self) {
        let mut lost = [0; 1_024];
        // What cannot be read is not there.
        let _ = rustix::io::read(&**self.found.ours, &mut lost);
    }

    fn wait(&self, within: Duration) -> Heard {
        let ours = PollFd::from_borrowed_fd(self.found.ours.as_fd(), PollFlags::IN);
        match wait_for_any(&mut [ours, self.found.openings.waiting(), self.closing.waiting()], far(within)) {
            Ok(Some([_, _, closing])) if !closing.is_empty() => Heard::Closing,
            Ok(Some([ours, ..])) if ours.contains(PollFlags::IN) => Heard::Bytes,
            Ok(Some([ours, ..])) if !ours.is_empty() => Heard::Left,
            Ok(Some(_)) => Heard::Opening,
            Ok(None) | Err(_) => Heard::Nothing,
        }
    }
}

/// What is there at the door.
enum Heard {
    Bytes,
    /// Somebody opened it, or closed it.
    Opening,
    /// No program has it open.
    Left,
    Nothing,
    Closing,
}

fn far(within: Duration) -> Instant {
    monotonic() + within
}
