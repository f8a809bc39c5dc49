//! What a thread asks of the system so that its waits end on time.

use std::cell::Cell;
use std::sync::OnceLock;
use std::time::Duration;

#[cfg(target_os = "linux")]
use crate::system::realtime;

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

/// What became of asking for the least timer slack.
#[derive(Debug, Clone, Copy)]
enum Asked {
    NotYet,
    /// It was granted; the thread had this before.
    Granted(slack::Slack),
    Refused,
}

thread_local! {
    static ASKED: Cell<Asked> = const { Cell::new(Asked::NotYet) };
}

/// How long before its moment a wait of this thread leaves the kernel and spins.
///
/// The first wait of a thread asks for the least timer slack, and the thread keeps it: to ask for each wait and to give it
/// back costs three system calls, and a read has four waits. What the thread sets itself later is left alone. It has its own
/// slack again after [`put_back`], which it calls where it closes a bus; so does a forked child. A thread that it begins, and
/// a program that it runs meanwhile, inherits what it has.
pub(crate) fn spin() -> Duration {
    let asked = match ASKED.get() {
        Asked::NotYet => ask(),
        asked => asked,
    };
    if matches!(asked, Asked::Granted(_)) { PUNCTUAL } else { AS_USUAL }
}

#[cold]
fn ask() -> Asked {
    let answer = slack::least();
    REFUSED.get_or_init(|| answer.as_ref().err().cloned());
    let asked = answer.map_or(Asked::Refused, Asked::Granted);
    ASKED.set(asked);
    asked
}

/// This thread has the slack again that it had before its first wait, until it waits again. It takes no lock and allocates
/// nothing: a forked child begins with it.
pub(crate) fn put_back() {
    if let Asked::Granted(former) = ASKED.replace(Asked::NotYet) {
        slack::put_back(former);
    }
}

#[cfg(target_os = "linux")]
mod slack {
    use std::num::NonZeroU64;

    use rustix::thread::{current_timer_slack, set_current_timer_slack};

    /// Nanoseconds by which waits of the calling thread may end late.
    pub(super) type Slack = u64;

    const LEAST: u64 = 1;

    /// Asks for the least, and returns what it was.
    pub(super) fn least() -> Result<Slack, String> {
        let ask = || {
            let former = current_timer_slack()?;
            set_current_timer_slack(NonZeroU64::new(LEAST)).map(|()| former)
        };
        ask().map_err(|error| {
            format!(
                "waits may end 50 µs late and more processor time is spun away: the system keeps its timer slack \
                 ({error})"
            )
        })
    }

    /// Unless the thread has set another one meanwhile.
    pub(super) fn put_back(former: Slack) {
        if current_timer_slack() == Ok(LEAST) {
            // What was in force before is not refused.
            let _ = set_current_timer_slack(NonZeroU64::new(former));
        }
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
/// Asks for the priority (nice) -10, or in `realtime` for the policy that goes before all priorities. The error says what was
/// refused and what to do.
#[cfg(target_os = "linux")]
pub(crate) fn go_first(realtime: bool) -> Result<(), String> {
    if realtime {
        return realtime::ask().map_err(|error| {
            // Less than was asked for is better than nothing.
            let _ = go_first(false);
            format!(
                "the threads of the bus do not run in real time: the system refused ({error}); allow it by `ulimit -r 10`, \
                 or LimitRTPRIO=10 in the service"
            )
        });
    }
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
pub(crate) fn go_first(_realtime: bool) -> Result<(), String> {
    Err("the threads of the bus have no priority over other programs: not asked for on this system".to_owned())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::num::NonZeroU64;
    use std::thread;

    use rustix::thread::{current_timer_slack, set_current_timer_slack};

    use super::*;
    use crate::system::clock::{monotonic, sleep_until};

    fn wait() {
        sleep_until(monotonic() + Duration::from_millis(1));
    }

    #[test]
    fn a_thread_has_no_slack_from_its_first_wait_on_and_its_own_when_that_is_put_back() {
        thread::spawn(|| {
            let own = current_timer_slack().unwrap();
            assert_ne!(own, 1, "this machine starts programs without slack, so nothing is seen here");
            wait();
            assert_eq!((current_timer_slack(), spin(), note()), (Ok(1), PUNCTUAL, None));
            put_back();
            assert_eq!(current_timer_slack(), Ok(own));
            put_back();
            assert_eq!(current_timer_slack(), Ok(own));
            wait();
            assert_eq!(current_timer_slack(), Ok(1));
        })
        .join()
        .unwrap();
    }

    #[test]
    fn a_thread_is_asked_for_once_and_what_it_sets_itself_is_left_alone() {
        thread::spawn(|| {
            wait();
            set_current_timer_slack(NonZeroU64::new(7_000)).unwrap();
            (0..3).for_each(|_| wait());
            assert_eq!(current_timer_slack(), Ok(7_000));
            put_back();
            assert_eq!(current_timer_slack(), Ok(7_000));
        })
        .join()
        .unwrap();
    }
}
