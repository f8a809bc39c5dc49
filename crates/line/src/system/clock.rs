//! The clock of real lines, and how they wait on it.
//!
//! The only place of this crate that reads the time. A wait is one system call that ends shortly before its
//! moment, and a spin for the rest: left to the kernel alone a wait ends up to 80 µs late, which is much beside a
//! silence of 334 µs at 115 200 bit/s, and is paid with every frame.

use std::thread;

use drivebus_rtu::{Duration, Instant};

#[cfg(all(unix, any(feature = "serial", feature = "tcp", feature = "share")))]
use crate::system::at_fork;
use crate::system::punctual::{self, PUNCTUAL};

/// How often somebody who waits looks up to see whether it should still wait.
pub(crate) const LOOK_UP: Duration = Duration::from_millis(50);

/// Now, in nanoseconds of the system's monotonic clock.
///
/// On Linux the same clock as Python's `time.monotonic_ns()`, and the same in every process.
#[cfg(unix)]
pub fn monotonic() -> Instant {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    let now = Duration::try_from(now).unwrap_or_default(); // cannot fail: the clock starts at zero and rises
    Instant::ZERO + now
}

/// Now, in nanoseconds since this process first asked; they begin at what the clock on the wall showed then, so that no two
/// processes begin alike.
#[cfg(not(unix))]
pub fn monotonic() -> Instant {
    use std::sync::LazyLock;
    use std::time::{Instant as Moment, SystemTime, UNIX_EPOCH};

    static START: LazyLock<(Moment, Duration)> =
        LazyLock::new(|| (Moment::now(), SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()));
    Instant::ZERO + START.1 + START.0.elapsed()
}

/// Blocks the thread until `until`, and never wakes it earlier.
pub fn sleep_until(until: Instant) {
    let left = until.saturating_duration_since(monotonic());
    if left > PUNCTUAL {
        thread::sleep(left.saturating_sub(spin()));
    }
    spin_until(until);
}

/// How long before its moment a wait of this thread leaves the kernel and spins.
fn spin() -> Duration {
    // A child that is forked while this thread has less slack than its own has that again.
    #[cfg(all(unix, any(feature = "serial", feature = "tcp", feature = "share")))]
    at_fork::give_up_in_children();
    punctual::spin()
}

fn spin_until(until: Instant) {
    while monotonic() < until {
        std::hint::spin_loop();
    }
}

/// Waits until `descriptor` is ready for one of `events` or has failed, and returns what it is ready for.
///
/// `None` means that `until` was reached. A descriptor that is ready already is found so whatever `until` says.
#[cfg(any(all(unix, any(feature = "serial", feature = "tcp")), all(any(unix, windows), feature = "share")))]
pub(crate) fn wait_for(
    descriptor: rustix::fd::BorrowedFd<'_>,
    events: rustix::event::PollFlags,
    until: Instant,
) -> std::io::Result<Option<rustix::event::PollFlags>> {
    let ready = wait_for_any(&mut [rustix::event::PollFd::from_borrowed_fd(descriptor, events)], until)?;
    Ok(ready.map(|[ready]| ready))
}

/// As [`wait_for`], for the first of several that is ready; each says what it is ready for.
#[cfg(any(all(unix, any(feature = "serial", feature = "tcp")), all(any(unix, windows), feature = "share")))]
pub(crate) fn wait_for_any<const COUNT: usize>(
    descriptors: &mut [rustix::event::PollFd<'_>; COUNT],
    until: Instant,
) -> std::io::Result<Option<[rustix::event::PollFlags; COUNT]>> {
    use rustix::event::{Timespec, poll};

    /// Longest single wait in the kernel; a later moment is waited for in turns. Some systems take at most 24 days.
    const TURN: Duration = Duration::from_secs(3_600);

    loop {
        let left = until.saturating_duration_since(monotonic());
        let is_last = left <= PUNCTUAL;
        let in_kernel = if is_last {
            // On the clock alone, and one look at its end: to look all the while would be a system call each time.
            spin_until(until);
            Duration::ZERO
        } else {
            left.saturating_sub(spin()).min(TURN)
        };
        let timeout = Timespec::try_from(in_kernel).unwrap_or_default(); // cannot fail: at most an hour
        match poll(descriptors, Some(&timeout)) {
            Ok(0) if is_last => return Ok(None),
            Ok(0) | Err(rustix::io::Errno::INTR) => {}
            Ok(_) => return Ok(Some(std::array::from_fn(|place| descriptors[place].revents()))),
            Err(error) => return Err(error.into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_rises_and_a_sleep_ends_no_earlier_than_asked() {
        let start = monotonic();
        for micros in [0, 1, 99, 101, 500, 3_000] {
            let until = monotonic() + Duration::from_micros(micros);
            sleep_until(until);
            assert!(monotonic() >= until, "{micros} µs");
        }
        sleep_until(start); // long over: returns
    }
}
