//! A few minutes of the soak, so that no change leaves it broken.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::time::Duration;

use drivebus_soak::{Plan, run};

/// Enough of everything in 12 000 calls: more faults, and an adapter that is pulled out every few seconds.
fn plan(seed: u64, threads: usize, whole: bool) -> Plan {
    Plan {
        calls: 12_000,
        seed,
        threads,
        whole,
        rate: 0.01,
        unplug_rate: 0.001,
        pull_every: Duration::from_secs(5),
        ..Plan::default()
    }
}

fn is_true(seed: u64, threads: usize) {
    for whole in [false, true] {
        let verdict = run(&plan(seed, threads, whole)).unwrap();
        assert!(verdict.is_good(), "{whole}: {verdict}");
    }
}

#[test]
fn everything_is_true_with_one_thread() {
    is_true(1, 1);
}

#[test]
fn everything_is_true_with_a_thread_for_each() {
    is_true(2, 8);
}
