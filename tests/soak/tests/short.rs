//! A few minutes of the soak, so that no change leaves it broken.

use std::time::Duration;

use drivebus_soak::{Plan, run};

/// Enough of everything in 20 000 calls: more faults, and an adapter that is pulled out every few seconds.
fn plan(seed: u64, threads: usize) -> Plan {
    Plan {
        calls: 20_000,
        seed,
        threads,
        rate: 0.01,
        unplug_rate: 0.001,
        pull_every: Duration::from_secs(5),
        ..Plan::default()
    }
}

#[test]
fn everything_is_true_with_one_thread() {
    let verdict = run(&plan(1, 1)).unwrap();
    assert!(verdict.is_good(), "{verdict}");
}

#[test]
fn everything_is_true_with_a_thread_for_each() {
    let verdict = run(&plan(2, 8)).unwrap();
    assert!(verdict.is_good(), "{verdict}");
}
