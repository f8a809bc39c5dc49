//! Who has a port: for the error of somebody who finds it busy.
//!
//! Linux lists the locks of all processes, and the open files of those that belong to this user. A program that keeps
//! others out by other means than a lock, and runs as somebody else, is not found; on other systems nobody is.

use std::fmt;
use std::path::Path;

/// More than anybody would read.
#[cfg(target_os = "linux")]
const MOST: usize = 4;

/// A process that has a port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Holder {
    process: u32,
    /// As the system calls it, at most 15 bytes.
    program: String,
}

impl fmt::Display for Holder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (process {})", self.program, self.process)
    }
}

/// Who has the port at `path`, and what to do about it, in words.
pub(crate) fn advice(path: &Path) -> String {
    match &holders(path)[..] {
        [] => "another program has it; close that program (on Linux, `sudo fuser -v` on the port names it)".to_owned(),
        [holder] if holder.process == std::process::id() => {
            format!("this program has it open already: {holder}; share one bus, or close the other first")
        }
        holders => {
            let names: Vec<String> = holders.iter().map(ToString::to_string).collect();
            format!("another program has it: {}; close that first", names.join(", "))
        }
    }
}

/// Those that have locked the port, or else those that have it open.
#[cfg(target_os = "linux")]
pub(crate) fn holders(path: &Path) -> Vec<Holder> {
    let Ok(port) = std::fs::metadata(path) else { return Vec::new() };
    let known = |mut processes: Vec<u32>| -> Vec<Holder> {
        processes.sort_unstable();
        processes.dedup();
        processes.into_iter().filter_map(linux::holder).take(MOST).collect()
    };
    // A lock that outlives who took it is in a child of theirs: that one has the port open.
    let lockers = known(linux::lockers(&port));
    if lockers.is_empty() { known(linux::openers(&port)) } else { lockers }
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn holders(_path: &Path) -> Vec<Holder> {
    Vec::new()
}

#[cfg(target_os = "linux")]
mod linux {
    use std::fs::{self, Metadata};
    use std::io::Read;
    use std::os::unix::fs::{FileTypeExt, MetadataExt};

    use rustix::fs::{major, minor};

    use super::Holder;

    pub(super) fn holder(process: u32) -> Option<Holder> {
        let program = fs::read_to_string(format!("/proc/{process}/comm")).ok()?;
        Some(Holder { process, program: program.trim_end().to_owned() })
    }

    /// Processes with a `flock` on the file. A line of `/proc/locks` is
    /// `1: FLOCK  ADVISORY  WRITE 4711 00:1a:3 0 EOF`: process, then file system in hexadecimal and file in decimal.
    pub(super) fn lockers(file: &Metadata) -> Vec<u32> {
        let place = format!("{:02x}:{:02x}:{}", major(file.dev()), minor(file.dev()), file.ino());
        // A list that comes in pieces may pass one over while other programs let go of theirs.
        (0..3).map(|_| of_locks(&place, &locks())).find(|found| !found.is_empty()).unwrap_or_default()
    }

    /// What the system says of all locks. Read in large pieces: each is true for itself, not two of them together.
    fn locks() -> String {
        let (mut text, mut piece) = (Vec::new(), vec![0; 65_536]);
        if let Ok(mut file) = fs::File::open("/proc/locks") {
            while let Ok(count @ 1..) = file.read(&mut piece) {
                text.extend_from_slice(&piece[..count]);
            }
        }
        String::from_utf8_lossy(&text).into_owned()
    }

    fn of_locks(place: &str, locks: &str) -> Vec<u32> {
        locks
            .lines()
            .filter_map(|line| match line.split_ascii_whitespace().collect::<Vec<_>>()[..] {
                [_, "FLOCK", _, _, process, of, ..] if of == place => process.parse().ok(),
                _ => None,
            })
            .collect()
    }

    /// Other processes that have the same port open.
    pub(super) fn openers(port: &Metadata) -> Vec<u32> {
        let Ok(processes) = fs::read_dir("/proc") else { return Vec::new() };
        processes
            .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok())
            .filter(|&process| process != std::process::id() && has_open(process, port))
            .collect()
    }

    fn has_open(process: u32, port: &Metadata) -> bool {
        let Ok(files) = fs::read_dir(format!("/proc/{process}/fd")) else { return false };
        files.filter_map(|file| Some(file.ok()?.path())).any(|file| {
            // A file behind a network may keep whoever asks about it, so only devices are asked.
            fs::read_link(&file).is_ok_and(|target| target.starts_with("/dev"))
                && fs::metadata(&file).is_ok_and(|open| is_same(&open, port))
        })
    }

    /// By device number, so that a node of another name is seen through. Pseudo-terminals of containers have the same
    /// numbers as ours, on a file system of their own. Source of their numbers: `devices.txt` of Linux.
    fn is_same(open: &Metadata, port: &Metadata) -> bool {
        open.file_type().is_char_device()
            && open.rdev() == port.rdev()
            && (!(136..=143).contains(&major(port.rdev())) || open.dev() == port.dev())
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #![expect(clippy::unwrap_used, reason = "a test may panic")]

    use std::fs::File;
    use std::os::unix::ffi::OsStrExt;
    use std::path::PathBuf;
    use std::process::{Child, Command, Stdio};

    use rustix::fs::{FlockOperation, flock};
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

    use super::*;

    /// The other side of a pseudo-terminal, and its path.
    fn pair() -> (rustix::fd::OwnedFd, PathBuf) {
        let far = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&far).unwrap();
        unlockpt(&far).unwrap();
        let path = ptsname(&far, Vec::new()).unwrap();
        (far, PathBuf::from(std::ffi::OsStr::from_bytes(path.as_bytes())))
    }

    /// `sleep` with `file` as its input; ended when the test is.
    struct Sleeping(Child);

    impl Sleeping {
        fn with(file: File) -> Self {
            Self(Command::new("sleep").arg("600").stdin(file).stdout(Stdio::null()).spawn().unwrap())
        }

        fn holder(&self) -> Holder {
            Holder { process: self.0.id(), program: "sleep".to_owned() }
        }
    }

    impl Drop for Sleeping {
        fn drop(&mut self) {
            self.0.kill().unwrap();
            self.0.wait().unwrap();
        }
    }

    #[test]
    fn who_has_it_open_is_named() {
        let (_far, path) = pair();
        assert_eq!(holders(&path), []);
        let child = Sleeping::with(File::open(&path).unwrap());
        let _ours = File::open(&path).unwrap(); // who finds it busy has it open too
        assert_eq!(holders(&path), [child.holder()]);
        let expected = format!("another program has it: sleep (process {}); close that first", child.0.id());
        assert_eq!(advice(&path), expected);
    }

    #[test]
    fn who_has_locked_it_comes_before_who_has_it_open() {
        let (_far, path) = pair();
        let child = Sleeping::with(File::open(&path).unwrap());
        assert_eq!(holders(&path), [child.holder()]);
        let ours = File::open(&path).unwrap();
        flock(&ours, FlockOperation::NonBlockingLockExclusive).unwrap();
        let [holder] = &holders(&path)[..] else { panic!("{:?}", holders(&path)) };
        assert_eq!(holder.process, std::process::id());
        assert!(advice(&path).starts_with("this program has it open already: "), "{}", advice(&path));
    }

    #[test]
    fn another_port_is_nobodys() {
        let ((_far, path), (_other_far, other)) = (pair(), pair());
        let _child = Sleeping::with(File::open(&path).unwrap());
        assert_eq!(holders(&other), []);
        assert!(advice(Path::new("/dev/ttyNoSuchPort")).contains("fuser"));
    }
}
