//! What a thread asks of the system so that it goes before all programs that did not ask for that.
//!
//! One of the four files of this project with `unsafe`: no crate that is used here offers `pthread_setschedparam`.
#![expect(unsafe_code, reason = "no crate here has pthread_setschedparam in safe Rust")]

use std::io;

/// Of 1..=99: above threads that asked for nothing in particular, and below those of the kernel, which have 50.
const PRIORITY: i32 = 10;

/// Has the calling thread, and those that it begins, run as soon as they can: by `SCHED_FIFO`.
///
/// # Errors
///
/// The system's: without `CAP_SYS_NICE` or a limit (`RLIMIT_RTPRIO`) that allows it, it refuses.
pub(super) fn ask() -> io::Result<()> {
    // SAFETY: all zeros is one of these; the fields that musl has beside the priority are not used.
    let mut asked: libc::sched_param = unsafe { std::mem::zeroed() };
    asked.sched_priority = PRIORITY;
    // SAFETY: a thread that runs is there, and the parameter is read before the call returns.
    match unsafe { libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_FIFO, &raw const asked) } {
        0 => Ok(()),
        error => Err(io::Error::from_raw_os_error(error)),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// What the kernel says of the thread: field 41 of its line is the policy, and 1 is `SCHED_FIFO` (proc(5)).
    fn policy() -> String {
        let told = fs::read_to_string("/proc/thread-self/stat").unwrap();
        told.rsplit(')').next().unwrap().split_whitespace().nth(41 - 3).unwrap().to_owned()
    }

    #[test]
    fn a_thread_runs_in_real_time_or_is_told_why_not() {
        std::thread::spawn(|| {
            assert_eq!(policy(), "0");
            match ask() {
                Ok(()) => assert_eq!(policy(), "1"),
                Err(error) => assert_eq!((error.kind(), &*policy()), (io::ErrorKind::PermissionDenied, "0")),
            }
        })
        .join()
        .unwrap();
    }
}
