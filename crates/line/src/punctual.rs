//! What a thread asks of the system so that its waits end on time.

use std::cell::OnceCell;
use std::time::Duration;

/// How late the kernel may end a wait of a thread that asked for punctuality: on a virtual machine with two cores, half
/// of the waits ended 4 to 19 µs late, nine of ten within 46 µs.
const PUNCTUAL: Duration = Duration::from_micros(20);

/// How late it ends others: the timer slack of Linux is 50 µs, and waking a core takes as much again. Half of the waits
/// ended 22 to 42 µs late with a spin of 60 µs, and 0.6 µs late with one of 100 µs; 130 µs gained nothing more.
const AS_USUAL: Duration = Duration::from_micros(100);

thread_local! {
    /// Why this thread's waits are not punctual, if they are not; asked once.
    static REFUSED: OnceCell<Option<String>> = const { OnceCell::new() };
}

/// How long before its moment a wait of this thread leaves the kernel and spins.
///
/// Asks for the least timer slack, the first time; it is the thread's own and touches no other.
pub(crate) fn spin() -> Duration {
    REFUSED.with(|refused| if refused.get_or_init(|| ask_for_slack().err()).is_none() { PUNCTUAL } else { AS_USUAL })
}

/// What people should know about the waits of this thread, if the system refused to make them punctual.
pub(crate) fn note() -> Option<String> {
    spin();
    REFUSED.with(|refused| refused.get().cloned().flatten())
}

#[cfg(target_os = "linux")]
fn ask_for_slack() -> Result<(), String> {
    rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1)).map_err(|error| {
        format!(
            "waits may end 50 µs late and more processor time is spun away: the system keeps its timer slack ({error})"
        )
    })
}

/// Nothing to ask for; how late waits end there is not known.
#[cfg(not(target_os = "linux"))]
fn ask_for_slack() -> Result<(), String> {
    Err("waits may end late and some processor time is spun away: this system has no timer slack to set".to_owned())
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

    #[test]
    fn a_thread_that_waits_has_no_slack() {
        std::thread::spawn(|| {
            assert_eq!(spin(), PUNCTUAL);
            assert_eq!(rustix::thread::current_timer_slack(), Ok(1));
            assert_eq!(note(), None);
        })
        .join()
        .unwrap();
    }
}
