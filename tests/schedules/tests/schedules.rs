//! Explores every scenario: so many orders of its threads, by chance and by priorities that change at few places.

use drivebus_schedules::scenarios::ALL;

/// Orders of each scenario, of each kind: with 26 scenarios a hundred and fifty-six thousand in all.
const EACH: usize = 3_000;

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
    errands_and_callers,
    an_errand_is_abandoned,
    an_urgent_errand_is_next,
    no_start_follows_a_stop,
    a_bus_is_closed,
    a_bus_is_closed_by_who_waits,
    a_bus_is_dropped,
    programs_come_in,
    a_stop_of_another_program_is_next,
    a_program_goes,
    a_program_takes_back,
    the_system_refuses_for_a_while,
    who_is_in_is_ended,
    a_bus_with_guests_is_closed,
    an_opening_is_told,
}
