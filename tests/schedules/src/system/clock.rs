//! Time that stands still, or passes where somebody waits: as the scenario has it.

use std::cell::Cell;
use std::time::Duration;

use drivebus_rtu::Instant;

pub(crate) const LOOK_UP: Duration = Duration::from_millis(50);

thread_local! {
    static NOW: Cell<Instant> = const { Cell::new(Instant::ZERO) };
    static PASSES: Cell<bool> = const { Cell::new(false) };
}

/// From now on time stands still, or `passes` where somebody waits for it.
pub(crate) fn set(passes: bool) {
    NOW.set(Instant::ZERO);
    PASSES.set(passes);
}

pub(crate) fn passes() -> bool {
    PASSES.get()
}

pub(crate) fn advance(time: Duration) {
    NOW.set(NOW.get() + time);
}

pub(crate) fn sleep_until(until: Instant) {
    NOW.set(NOW.get().max(until));
}

pub(crate) fn monotonic() -> Instant {
    NOW.get()
}
