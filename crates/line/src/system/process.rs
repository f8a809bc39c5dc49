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
#[cfg(feature = "share")]
pub(crate) fn own_name() -> String {
    let shown = std::fs::read_to_string("/proc/self/comm").ok().map(|name| name.trim_end().to_owned());
    let named = || {
        let path = std::env::args_os().next()?;
        Some(std::path::Path::new(&path).file_name()?.to_string_lossy().into_owned())
    };
    shown.or_else(named).unwrap_or_else(|| "a program".to_owned())
}

/// Whether a process is held, by Ctrl-Z or a debugger. Only Linux tells.
#[cfg(feature = "share")]
pub(crate) fn is_stopped(process: u32) -> bool {
    // `4711 (name) T …`; the name may hold anything.
    let status = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    status.rsplit_once(") ").is_some_and(|(_, rest)| rest.starts_with(['T', 't']))
}

/// Who is at the other end of a socket.
#[cfg(all(unix, feature = "share"))]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Peer {
    /// 0 where the system does not tell.
    pub(crate) process: u32,
    pub(crate) is_this_user: bool,
}

/// Who is at the other end of `stream`.
#[cfg(all(target_os = "linux", feature = "share"))]
pub(crate) fn peer(stream: &std::os::unix::net::UnixStream) -> Peer {
    let Ok(found) = rustix::net::sockopt::socket_peercred(stream) else {
        return Peer { process: 0, is_this_user: false };
    };
    let process = u32::try_from(found.pid.as_raw_nonzero().get()).unwrap_or(0);
    Peer { process, is_this_user: found.uid == rustix::process::geteuid() }
}

/// Some program of this user's: the system does not tell which, and the folder that the socket stands in keeps others out.
#[cfg(all(unix, not(target_os = "linux"), feature = "share"))]
pub(crate) fn peer(_stream: &std::os::unix::net::UnixStream) -> Peer {
    Peer { process: 0, is_this_user: true }
}
