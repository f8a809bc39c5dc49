//! Whose a line is, and which processes there are. A forked child inherits the descriptor, and everything here as it was at
//! that moment; the line, and what its units still owe, stay the parent's.

/// The process that something was made in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Process(u32);

impl Process {
    /// The one that runs this.
    pub(crate) fn current() -> Self {
        Self(std::process::id())
    }

    /// Whether it is the one that runs this: false in a forked child.
    pub(crate) fn is_current(self) -> bool {
        self == Self::current()
    }
}

/// What this program is called: as the system shows it, at most 15 bytes.
#[cfg(all(any(unix, windows), feature = "share"))]
pub(crate) fn own_name() -> String {
    let shown = std::fs::read_to_string("/proc/self/comm").ok().map(|name| name.trim_end().to_owned());
    let named = || {
        let path = std::env::args_os().next()?;
        Some(std::path::Path::new(&path).file_name()?.to_string_lossy().into_owned())
    };
    shown.or_else(named).unwrap_or_else(|| "a program".to_owned())
}

/// Whether a process is held, by Ctrl-Z or a debugger. Only Linux tells.
#[cfg(all(any(unix, windows), feature = "share"))]
pub(crate) fn is_stopped(process: u32) -> bool {
    // `4711 (name) T …`; the name may hold anything.
    let status = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    status.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with(['T', 't']))
}

/// The number of this program's user.
#[cfg(all(unix, feature = "share"))]
pub(crate) fn user() -> u32 {
    rustix::process::geteuid().as_raw()
}

/// Who is at the other end of a socket.
#[cfg(all(any(unix, windows), feature = "share"))]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peer {
    /// 0 where the system does not tell: on systems that have no such question, and of a process that has no number here
    /// because it is outside of this container.
    pub(crate) process: u32,
    /// The number of its user; `None` where the system does not tell.
    pub(crate) user: Option<u32>,
}

#[cfg(all(any(unix, windows), feature = "share"))]
impl Peer {
    /// Nobody whom the system tells.
    pub(crate) const UNKNOWN: Self = Self { process: 0, user: None };

    /// Whether it lives. The system tells that of those whose user it tells: the number of another was only said.
    pub(crate) fn life(&self) -> Life {
        if self.user.is_some() { Life::of(self.process) } else { Life::Unknown }
    }

    /// The number of its user, if that is known to be another one.
    #[cfg_attr(windows, expect(clippy::unused_self, reason = "no numbers are told there"))]
    pub(crate) fn other_user(&self) -> Option<u32> {
        #[cfg(unix)]
        return self.user.filter(|&other| other != user());
        #[cfg(not(unix))]
        None
    }
}

/// Who is at the other end of `stream`, as far as the system tells.
#[cfg(all(any(unix, windows), feature = "share"))]
pub(crate) fn peer(stream: &crate::system::sockets::Stream) -> Peer {
    match stream {
        #[cfg(unix)]
        crate::system::sockets::Stream::Unix(stream) => peer_of(stream),
        crate::system::sockets::Stream::Tcp(_) => Peer::UNKNOWN,
    }
}

/// How many files this program may have open.
#[cfg(all(any(unix, windows), feature = "share"))]
pub(crate) fn most_files() -> usize {
    #[cfg(unix)]
    let most = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    // As many as there is memory for.
    #[cfg(not(unix))]
    let most = None::<u64>;
    most.and_then(|most| usize::try_from(most).ok()).unwrap_or(usize::MAX)
}

/// Who is at the other end of `stream`: who called `connect`, or who called `listen`.
#[cfg(all(target_os = "linux", feature = "share"))]
pub(crate) fn peer_of(stream: &std::os::unix::net::UnixStream) -> Peer {
    match rustix::net::sockopt::socket_peercred(stream) {
        Ok(found) => Peer {
            process: u32::try_from(found.pid.as_raw_nonzero().get()).unwrap_or(0),
            user: Some(found.uid.as_raw()),
        },
        Err(_) => Peer::UNKNOWN,
    }
}

/// Some program: the system does not tell which.
#[cfg(all(unix, not(target_os = "linux"), feature = "share"))]
pub(crate) fn peer_of(_stream: &std::os::unix::net::UnixStream) -> Peer {
    Peer::UNKNOWN
}

/// Whether a process lives, as far as the system tells: whoever else has its descriptors, it is gone when it is.
#[cfg(all(any(unix, windows), feature = "share"))]
#[derive(Debug)]
pub(crate) enum Life {
    /// It can be waited for.
    #[cfg(target_os = "linux")]
    Watched(std::os::fd::OwnedFd),
    #[cfg_attr(not(target_os = "linux"), expect(dead_code, reason = "only Linux is asked"))]
    Gone,
    Unknown,
}

#[cfg(all(any(unix, windows), feature = "share"))]
impl Life {
    /// Of `process` as this one counts them; 0 is nobody that this one knows.
    #[cfg(target_os = "linux")]
    pub(crate) fn of(process: u32) -> Self {
        use rustix::process::{Pid, PidfdFlags, pidfd_open};

        let Some(pid) = i32::try_from(process).ok().and_then(Pid::from_raw) else { return Self::Unknown };
        match pidfd_open(pid, PidfdFlags::empty()) {
            Ok(watched) => Self::Watched(watched),
            Err(rustix::io::Errno::SRCH) => Self::Gone,
            Err(_) => Self::Unknown, // an old kernel, or one that does not let this program ask
        }
    }

    /// Nothing is known of it.
    #[cfg(not(target_os = "linux"))]
    pub(crate) fn of(_process: u32) -> Self {
        Self::Unknown
    }

    /// What is ready to be read once the process is gone, where that can be waited for.
    pub(crate) fn end(&self) -> Option<rustix::fd::BorrowedFd<'_>> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Watched(watched) => Some(std::os::fd::AsFd::as_fd(watched)),
            Self::Gone | Self::Unknown => None,
        }
    }

    /// Whether it is known to be gone.
    pub(crate) fn is_gone(&self) -> bool {
        use rustix::event::{PollFd, PollFlags, Timespec, poll};

        let Some(end) = self.end() else { return matches!(self, Self::Gone) };
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        matches!(poll(&mut [PollFd::from_borrowed_fd(end, PollFlags::IN)], Some(&now)), Ok(1..))
    }
}

#[cfg(all(test, target_os = "linux", feature = "share"))]
mod tests {
    use super::*;

    #[test]
    fn a_process_is_gone_when_it_has_ended_and_not_before() {
        let mut child = std::process::Command::new("cat").stdin(std::process::Stdio::piped()).spawn().unwrap();
        let life = Life::of(child.id());
        assert!(!life.is_gone());
        drop(child.stdin.take());
        let ends = crate::system::clock::wait_for(
            life.end().unwrap(),
            rustix::event::PollFlags::IN,
            crate::system::clock::monotonic() + std::time::Duration::from_secs(60),
        );
        assert!(ends.unwrap().is_some() && life.is_gone());
        child.wait().unwrap();
        assert!(Life::of(child.id()).is_gone());
        assert!(!Life::of(0).is_gone() && !Life::of(std::process::id()).is_gone());
    }
}
