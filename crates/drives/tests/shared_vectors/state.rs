//! What a state word means where several of its rules fit: a motor that runs is never told to rest, in whatever order a
//! profile has its rows.

use std::path::Path;

use drivebus_drives::{Profile, State, StateRule, StateWord};

/// Bits as a VFD500 has them (its manual, p. 96): 0 runs, 1 the direction, 3 a fault.
const RUNNING: u16 = 1;
const REVERSE: u16 = 1 << 1;
const FAULT: u16 = 1 << 3;

const ROWS: [StateRow; 4] = [
    (State::Fault, FAULT, FAULT),
    (State::Stopped, RUNNING, 0),
    (State::Forward, RUNNING | REVERSE, RUNNING),
    (State::Reverse, RUNNING | REVERSE, RUNNING | REVERSE),
];

type StateRow = (State, u16, u16);

fn word(rows: &[StateRow]) -> StateWord {
    let mut word = Profile::builtin("vfd500").unwrap().state_word().unwrap().clone();
    word.rules.resize(rows.len(), word.rules[0]);
    for (rule, &(state, mask, value)) in word.rules.iter_mut().zip(rows) {
        (rule.state, rule.mask, rule.value) = (state, mask, value);
    }
    word
}

/// Every order of `rows`.
fn orders(rows: &[StateRow]) -> Vec<Vec<StateRow>> {
    let Some((&first, rest)) = rows.split_first() else { return vec![Vec::new()] };
    let into = |order: &Vec<StateRow>, place| {
        let mut order = order.clone();
        order.insert(place, first);
        order
    };
    orders(rest).iter().flat_map(|order| (0..=order.len()).map(move |place| into(order, place))).collect()
}

#[test]
fn running_wins_in_whatever_order_the_rows_stand() {
    for rows in orders(&ROWS) {
        let word = word(&rows);
        for raw in 0..=u16::MAX {
            let running = if raw & REVERSE == 0 { State::Forward } else { State::Reverse };
            let state = word.state(raw);
            assert_eq!(state.is_running(), raw & RUNNING != 0, "{rows:?}: {raw:04X}H is {state:?}");
            assert!(!state.is_running() || state == running, "{rows:?}: {raw:04X}H is {state:?}");
            assert_eq!(word.is_in_fault(raw), raw & FAULT != 0, "{rows:?}: {raw:04X}H");
        }
    }
}

/// Of those that do not run the first row holds, as a profile has them.
#[test]
fn at_rest_the_first_row_that_fits_holds() {
    let [fault, stopped, forward, reverse] = ROWS;
    assert_eq!(word(&[fault, stopped, forward, reverse]).state(FAULT), State::Fault);
    assert_eq!(word(&[forward, stopped, fault, reverse]).state(FAULT), State::Stopped);
}

/// A profile that forgets a direction does not let a fault pass for rest while the bit says that the motor runs.
#[test]
fn a_fault_is_no_rest_where_the_bits_are_those_of_a_motor_that_runs() {
    let [fault, stopped, forward, _] = ROWS;
    for rows in orders(&[fault, stopped, forward]) {
        let word = word(&rows);
        for raw in 0..=u16::MAX {
            let state = word.state(raw);
            assert_eq!(state.is_at_rest(), raw & RUNNING == 0, "{rows:?}: {raw:04X}H is {state:?}");
        }
    }
    // What the fault's own row says of running holds, and bits that tell nothing of it do not matter.
    let ready = 1 << 2;
    let said = word(&[(State::Fault, FAULT | RUNNING, FAULT), (State::Stopped, RUNNING | ready, ready), forward]);
    assert_eq!(said.state(FAULT), State::Fault);
    assert_eq!(said.state(FAULT | RUNNING), State::Forward);
}

/// Numbers mean one state each. These four have bits of their own for a run and for a fault.
#[test]
fn of_the_shipped_profiles_only_six_words_say_two_things() {
    for name in Profile::builtin_names() {
        let profile = Profile::builtin(name).unwrap();
        let Some(word) = profile.state_word() else { continue };
        let fits = |raw: u16, rule: &StateRule| raw & rule.mask == rule.value;
        for raw in 0..=u16::MAX {
            let said: Vec<State> = word.rules.iter().filter(|&rule| fits(raw, rule)).map(|rule| rule.state).collect();
            // One that counts hertz has a rule for rest alone.
            let runs = said.iter().any(|state| state.is_running()) || said.is_empty() && word.otherwise.is_running();
            assert_eq!(profile.state(raw).is_running(), runs, "{name}: {raw:04X}H is {said:?}");
            assert!(
                said.len() < 2
                    || [
                        "vfd500",
                        "a1000",
                        "fc51",
                        "fc202",
                        "fr-d700",
                        "frenic",
                        "v20",
                        "acs355",
                        "acs580",
                        "j1000",
                        "vf-s15",
                        "optidrive-e3",
                        "optidrive-p2",
                        "e510",
                        "f510",
                        "cfw500",
                        "vacon10",
                        "dc1",
                        "nowforever",
                        "starvert",
                    ]
                    .contains(&name),
                "{name}: {raw:04X}H is {said:?}"
            );
            assert_eq!(profile.is_in_fault(raw), said.contains(&State::Fault), "{name}: {raw:04X}H");
        }
    }
}

/// One that somebody wrote, with its fault first: bits 0, 1 and 3 as above.
#[test]
fn a_profile_of_ones_own_is_read_alike() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/vectors/profiles/ex9");
    let profile = Profile::load(&folder).unwrap();
    for (raw, state) in [(0, State::Stopped), (8, State::Fault), (9, State::Forward), (0x0B, State::Reverse)] {
        assert_eq!(profile.state(raw), state, "{raw:04X}H");
        assert_eq!(profile.is_in_fault(raw), raw & FAULT != 0, "{raw:04X}H");
    }
}
