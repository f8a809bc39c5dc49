//! Explores every scenario: so many orders of its threads, by chance and by priorities that change at few places.

use drivebus_schedules::scenarios::ALL;

/// Orders of each scenario, of each kind: with eleven scenarios two hundred and twenty thousand in all.
const EACH: usize = 10_000;

/// As many as are asked for (`DRIVEBUS_SCHEDULES`), or else [`EACH`].
fn each() -> usize {
    std::env::var("DRIVEBUS_SCHEDULES").ok().and_then(|count| count.parse().ok()).unwrap_or(EACH)
}

/// At so many places of an order priorities change (`shuttle::check_pct`).
const CHANGES: usize = 3;

/// Each scenario in a test of its own, so that they run side by side and a failure says where.
macro_rules! explored {
    ($($name:ident),* $(,)?) => {
        $(
            #[test]
            fn $name() {
                let (_, scenario) = ALL.iter().find(|(name, _)| *name == stringify!($name)).unwrap();
                shuttle::check_random(scenario, each());
                shuttle::check_pct(scenario, each(), CHANGES);
            }
        )*

        #[test]
        fn all_are_explored() {
            assert_eq!(ALL.iter().map(|(name, _)| *name).collect::<Vec<_>>(), [$(stringify!($name)),*]);
        }
    };
}

explored! {
    callers,
    a_stop_is_next,
    who_has_the_line_lets_a_stop_pass,
    callers_give_up,
    work_and_callers,
    work_is_taken_back,
    who_is_told_takes_long,
    no_thread_is_given,
    work_is_dismissed,
    closing,
    other_programs,
}
