//! Where programs of this computer come in that know serial ports alone: a pseudo-terminal, which one at a time has open.
//! Linux only.

use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::fs::{PermissionsExt as _, chown};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::Instant;
use rustix::event::{PollFd, PollFlags};
use rustix::fs::inotify::{self, CreateFlags, WatchFlags};
use rustix::fs::{Mode, OFlags};
use rustix::termios::{QueueSelector, tcflush};

use crate::gateway::door::Hall;
use crate::gateway::stream::Stream as _;
use crate::gateway::terminal::{Bell, Terminal};
use crate::ports::pty::{PtyLink, open_raw};
use crate::system::clock::{LOOK_UP, monotonic, wait_for_any};
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
    theirs: PathBuf,
    /// Told by the system when a program opens it.
    openings: Kept<OwnedFd>,
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
        let openings = inotify::init(CreateFlags::CLOEXEC | CreateFlags::NONBLOCK)?;
        inotify::add_watch(&openings, &theirs, WatchFlags::OPEN)?;
        let link = PtyLink::new(link.to_owned(), &theirs)?;
        Ok(Self { ours: Arc::new(Kept::new(ours)), theirs, openings: Kept::new(openings), _link: link })
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
        while self.somebody_asks() {
            if let Err(error) = self.serve() {
                self.hall.tell(&error);
                // No file is left to open, most likely: that does not end by being tried at once.
                let _ = wait_for_any(&mut [self.closing.waiting()], far(LOOK_UP));
            }
        }
    }

    /// Waits for a program that writes; false: this is closed.
    fn somebody_asks(&self) -> bool {
        loop {
            match self.wait(NEVER) {
                Heard::Bytes => return true,
                Heard::Closing => return false,
                Heard::Left => self.wait_for_an_opening(),
                Heard::Nothing => {}
            }
        }
    }

    /// Serves the program that has it open until that closes it, or sends what is no request.
    fn serve(&self) -> io::Result<()> {
        self.forget_answers()?;
        let terminal = Arc::new(Terminal::new(Arc::clone(&self.found.ours))?);
        self.hall.let_in(Arc::<Terminal>::clone(&terminal), HERE, self.name.clone())?;
        wait_for_any(&mut [terminal.over(), self.closing.waiting()], far(NEVER))?;
        terminal.end();
        if !terminal.was_left() {
            self.wait_for_a_pause();
        }
        Ok(())
    }

    /// What the last program did not take is not for this one, which has asked and was not answered yet.
    fn forget_answers(&self) -> io::Result<()> {
        let how = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let theirs = rustix::fs::open(&self.found.theirs, how, Mode::empty())?;
        Ok(tcflush(theirs, QueueSelector::IFlush)?)
    }

    /// A program that is still there sent what is no request: what follows is none either, until it pauses.
    fn wait_for_a_pause(&self) {
        let mut lost = [0; 1_024];
        while matches!(self.wait(QUIET), Heard::Bytes) {
            // What cannot be read is not there.
            let _ = rustix::io::read(&**self.found.ours, &mut lost);
        }
    }

    /// Waits until a program opens it, or it is closed. An opening that was told before is waited for no more.
    fn wait_for_an_opening(&self) {
        let openings = PollFd::from_borrowed_fd(self.found.openings.as_fd(), PollFlags::IN);
        // A failure is seen again by who waits for bytes.
        let _ = wait_for_any(&mut [openings, self.closing.waiting()], far(NEVER));
        let mut told = [0; 1_024];
        while rustix::io::read(&*self.found.openings, &mut told).is_ok_and(|bytes| bytes > 0) {}
    }

    fn wait(&self, within: Duration) -> Heard {
        let ours = PollFd::from_borrowed_fd(self.found.ours.as_fd(), PollFlags::IN);
        match wait_for_any(&mut [ours, self.closing.waiting()], far(within)) {
            Ok(Some([_, closing])) if !closing.is_empty() => Heard::Closing,
            Ok(Some([ours, _])) if ours.contains(PollFlags::IN) => Heard::Bytes,
            Ok(Some(_)) => Heard::Left,
            Ok(None) | Err(_) => Heard::Nothing,
        }
    }
}

/// What is there at the door.
enum Heard {
    Bytes,
    /// No program has it open.
    Left,
    Nothing,
    Closing,
}

fn far(within: Duration) -> Instant {
    monotonic() + within
}
