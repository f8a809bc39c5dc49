//! What a forked child does before anything else: it gives up what its parent has open (`listed`), and has its own timer slack
//! again (`punctual`).
//!
//! One of the four files of this project with `unsafe`: no crate offers `pthread_atfork` in safe Rust, since what runs there is
//! bound as a signal handler is. It takes no lock, allocates nothing, and calls `dup3` and `prctl` alone (elsewhere than on Linux
//! `dup2` and `fcntl`).
//!
//! Whoever forks by `fork` runs it, in C, Python or Rust. Nobody does who asks the system without the library: a bare `clone`, or
//! `_Fork` of glibc, which is there to run no handlers.
#![expect(unsafe_code, reason = "no crate has pthread_atfork in safe Rust")]

use std::os::fd::RawFd;
use std::sync::Once;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::system::{listed, punctual};

static ASKED: Once = Once::new();
/// How many forks were begun, and are over, in this process.
static BEGUN: AtomicU64 = AtomicU64::new(0);
static OVER: AtomicU64 = AtomicU64::new(0);

/// Has every child that this process forks from here on give up what is listed then.
pub(super) fn give_up_in_children() {
    ASKED.call_once(|| {
        // SAFETY: they are there for as long as the process: glibc forgets them when a library is unloaded. They do only what a
        // signal handler may. Where the system has no room for them, a child keeps what it has.
        let _ = unsafe { libc::pthread_atfork(Some(begins), Some(is_over), Some(in_child)) };
    });
}

/// A moment of this process, by its forks.
#[cfg(any(feature = "serial", feature = "tcp", feature = "share"))]
pub(super) struct Forks(u64);

#[cfg(any(feature = "serial", feature = "tcp", feature = "share"))]
impl Forks {
    /// Now, once none is under way.
    pub(super) fn now() -> Self {
        give_up_in_children();
        loop {
            let begun = BEGUN.load(Ordering::SeqCst);
            if OVER.load(Ordering::SeqCst) == begun {
                return Self(begun);
            }
            std::thread::yield_now();
        }
    }

    /// Whether one was begun since.
    pub(super) fn has_one_begun(&self) -> bool {
        BEGUN.load(Ordering::SeqCst) != self.0
    }
}

extern "C" fn begins() {
    BEGUN.fetch_add(1, Ordering::SeqCst);
}

extern "C" fn is_over() {
    OVER.fetch_add(1, Ordering::SeqCst);
}

extern "C" fn in_child() {
    // Of its parent's, those of other threads may be under way for ever.
    OVER.store(BEGUN.load(Ordering::SeqCst), Ordering::SeqCst);
    listed::each(|nothing, number| {
        put(nothing, number);
    });
    punctual::put_back();
}

/// Puts `nothing` in the place of `number`: nothing is unlocked, shut down or said, since that would be done to the parent's.
#[cfg(target_os = "linux")]
fn put(nothing: RawFd, number: RawFd) {
    // SAFETY: a system call on numbers. `number` is this library's own, and what has it here asks nothing of it but to close it.
    unsafe { libc::dup3(nothing, number, libc::O_CLOEXEC) };
}

#[cfg(not(target_os = "linux"))]
fn put(nothing: RawFd, number: RawFd) {
    // SAFETY: as above.
    unsafe {
        if libc::dup2(nothing, number) >= 0 {
            libc::fcntl(number, libc::F_SETFD, libc::FD_CLOEXEC);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::os::fd::AsRawFd;

    use rustix::fs::{FileType, fstat};

    use crate::system::inherited::Kept;

    #[test]
    #[cfg(any(feature = "serial", feature = "tcp", feature = "share"))]
    fn what_a_child_may_have_is_opened_again() {
        let mut opened = Vec::new();
        let kept = Kept::opened(|| {
            let file = File::open("/dev/null")?;
            opened.push(file.as_raw_fd());
            if opened.len() < 3 {
                // SAFETY: the child ends at once; who waits for it is this process, at its end.
                unsafe {
                    if libc::fork() == 0 {
                        libc::_exit(0);
                    }
                }
            }
            Ok(file)
        });
        assert!(kept.is_ok());
        // Other tests of this process fork, too.
        assert!(opened.len() >= 3);
    }

    #[test]
    fn a_child_has_nothing_of_what_is_kept_and_all_of_the_rest() {
        let path = std::env::current_exe().unwrap();
        let (kept, other) = (Kept::new(File::open(&path).unwrap()), File::open(&path).unwrap());
        let is_file = |file: &File| fstat(file).is_ok_and(|found| FileType::from_raw_mode(found.st_mode).is_file());
        // SAFETY: until it ends the child makes system calls only.
        let child = unsafe { libc::fork() };
        if child == 0 {
            let is_right = !is_file(&kept) && kept.as_raw_fd() >= 0 && is_file(&other);
            // SAFETY: it ends without running anything of its parent's.
            unsafe { libc::_exit(if is_right { 7 } else { 1 }) };
        }
        let mut status = 0;
        // SAFETY: it writes one number, which is there.
        assert_eq!(unsafe { libc::waitpid(child, &raw mut status, 0) }, child);
        assert_eq!((libc::WIFEXITED(status), libc::WEXITSTATUS(status)), (true, 7));
        assert!(is_file(&kept), "the parent has it as before");
    }
}
