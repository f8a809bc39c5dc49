//! What a thread asks of the system so that its waits end on time.

use std::sync::OnceLock;
use std::time::Duration;

/// How late the kernel may end a wait of a thread that asked for punctuality: on a virtual machine with two cores, half
/// of the waits ended 4 to 19 µs late, nine of ten within 46 µs.
pub(crate) const PUNCTUAL: Duration = Duration::from_micros(20);

/// How late it ends others: the timer slack of Linux is 50 µs, and waking a core takes as much again. Half of the waits
/// ended 22 to 42 µs late with a spin of 60 µs, and 0.6 µs late with one of 100 µs; 130 µs gained nothing more.
const AS_USUAL: Duration = Duration::from_micros(100);

/// Why waits are not punctual, if they are not; known from the first one on.
static REFUSED: OnceLock<Option<String>> = OnceLock::new();

/// What people should know about waits, if the system refused to make them punctual.
pub(crate) fn note() -> Option<String> {
    REFUSED.get().cloned().flatten()
}

/// A wait of this thread, for which it has the least timer slack. Afterwards its earlier settings are restored: threads and
/// programs that it starts inherit its slack, and keep it for good.
#[derive(Debug)]
pub(crate) struct Wait {
    former: Option<slack::Slack>,
}

impl Wait {
    pub(crate) fn begin() -> Self {
        let asked = slack::least();
        REFUSED.get_or_init(|| asked.as_ref().err().cloned());
        Self { former: asked.ok() }
    }

    /// How long before its moment it leaves the kernel and spins.
    pub(crate) fn spin(&self) -> Duration {
        if self.former.is_some() { PUNCTUAL } else { AS_USUAL }
    }
}

impl Drop for Wait {
    fn drop(&mut self) {
        if let Some(former) = self.former.take() {
            slack::put_back(former);
        }
    }
}

#[cfg(target_os = "linux")]
mod slack {
    use std::num::NonZeroU64;

    use rustix::thread::{current_timer_slack, set_current_timer_slack};

    /// Nanoseconds by which waits of the calling thread may end late.
    pub(super) type Slack = u64;

    /// Asks for the least, and returns what it was.
    pub(super) fn least() -> Result<Slack, String> {
        let ask = || {
            let former = current_timer_slack()?;
            set_current_timer_slack(NonZeroU64::new(1)).map(|()| former)
        };
        ask().map_err(|error| {
            format!(
                "waits may end 50 µs late and more processor time is spun away: the system keeps its timer slack \
                 ({error})"
            )
        })
    }

    pub(super) fn put_back(former: Slack) {
        // What was in force before is not refused.
        let _ = set_current_timer_slack(NonZeroU64::new(former));
    }
}

/// Nothing to ask for; how late waits end there is not known.
#[cfg(not(target_os = "linux"))]
mod slack {
    pub(super) type Slack = ();

    pub(super) fn least() -> Result<Slack, String> {
        Err("waits may end late and some processor time is spun away: this system has no timer slack to set".to_owned())
    }

    pub(super) fn put_back((): Slack) {}
}

/// Makes a thread of a bus's own go before the programs around it, as a thread that waits for the wire should.
///
/// Asks for the priority (nice) -10. The error says what was refused and what to do.
#[cfg(target_os = "linux")]
pub(crate) fn go_first() -> Result<(), String> {
    // A thread of its own: on Linux each has a priority, and an id that this call takes for a process's.
    rustix::process::setpriority_process(Some(rustix::thread::gettid()), -10).map_err(|error| {
        format!(
            "the threads of the bus have no priority over other programs: the system refused ({error}); allow it by \
             `ulimit -e 30` or LimitNICE=-10 in the service"
        )
    })
}

/// Nothing is asked for.
#[cfg(not(target_os = "linux"))]
pub(crate) fn go_first() -> Result<(), String> {
    Err("the threads of the bus have no priority over other programs: not asked for on this system".to_owned())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    use crate::system::clock::{monotonic, sleep_until};
    use rustix::thread::current_timer_slack;

    #[test]
    fn a_thread_has_no_slack_while_it_waits_and_its_own_afterwards() {
        std::thread::spawn(|| {
            let own = current_timer_slack().unwrap();
            assert_ne!(own, 1, "this machine starts programs without slack, so nothing is seen here");
            let wait = Wait::begin();
            assert_eq!((current_timer_slack(), wait.spin()), (Ok(1), PUNCTUAL));
            drop(wait);
            assert_eq!(current_timer_slack(), Ok(own));
            sleep_until(monotonic() + Duration::from_millis(1));
            assert_eq!((current_timer_slack(), note()), (Ok(own), None));
        })
        .join()
        .unwrap();
    }
}
