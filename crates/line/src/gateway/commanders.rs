//! Who commanded motion over the network. Whoever did and is gone, or silent, has its motor halted: a dead man's switch.
//!
//! What halts the motor is left as a last will before the command goes out, so that it is carried out though this program is
//! killed. Here it is decided only; `Wills` carries it out.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What is left with the line for a client that moves a motor.
pub(super) trait Wills {
    /// Leaves what halts `unit`; `None`: nobody could halt it.
    fn leave(&self, unit: u8) -> Option<u64>;

    /// It is not needed.
    fn withdraw(&self, will: u64);

    /// It is carried out now.
    fn carry_out(&self, will: u64);
}

/// Which client commanded which unit.
#[derive(Debug, Default)]
pub(super) struct Commanders {
    claims: Mutex<BTreeMap<u8, Vec<Claim>>>,
}

/// What one client has to do with the motion of one unit.
#[derive(Debug)]
struct Claim {
    client: u64,
    will: u64,
    /// Commands whose end is not known yet.
    under_way: usize,
    /// Whether what the motor does may be by its command.
    is_in_force: bool,
}

impl Claim {
    const fn is_needed(&self) -> bool {
        self.is_in_force || self.under_way > 0
    }
}

impl Commanders {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<u8, Vec<Claim>>> {
        self.claims.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// `client` is about to move the motor of `unit`. False: nobody could halt it, and it may not.
    pub(super) fn begins(&self, client: u64, unit: u8, wills: &impl Wills) -> bool {
        let mut claims = self.lock();
        let of_unit = claims.entry(unit).or_default();
        if let Some(claim) = of_unit.iter_mut().find(|claim| claim.client == client) {
            claim.under_way += 1;
            return true;
        }
        let left = wills.leave(unit);
        of_unit.extend(left.map(|will| Claim { client, will, under_way: 1, is_in_force: false }));
        left.is_some()
    }

    /// A command by which it began to ended: whether the unit may `move` by it.
    pub(super) fn ended(&self, client: u64, unit: u8, moves: bool, wills: &impl Wills) {
        self.change(unit, wills, |claims| {
            let Some(place) = claims.iter().position(|claim| claim.client == client) else { return };
            claims[place].under_way = claims[place].under_way.saturating_sub(1);
            if moves {
                // What it does now is by the latest command.
                for claim in claims {
                    claim.is_in_force = claim.client == client;
                }
            }
        });
    }

    /// The unit took a stop.
    pub(super) fn stopped(&self, unit: u8, wills: &impl Wills) {
        self.change(unit, wills, |claims| {
            for claim in claims {
                claim.is_in_force = false;
            }
        });
    }

    fn change(&self, unit: u8, wills: &impl Wills, change: impl FnOnce(&mut Vec<Claim>)) {
        let mut all = self.lock();
        let Some(claims) = all.get_mut(&unit) else { return };
        change(claims);
        claims.retain(|claim| {
            if !claim.is_needed() {
                wills.withdraw(claim.will);
            }
            claim.is_needed()
        });
    }

    /// Whether `client` commanded anything that may still move.
    pub(super) fn has(&self, client: u64) -> bool {
        self.lock().values().flatten().any(|claim| claim.client == client)
    }

    /// `client` is gone or silent: what it commanded is halted. Gives the units.
    pub(super) fn gone(&self, client: u64, wills: &impl Wills) -> Vec<u8> {
        let mut all = self.lock();
        let mut halted = Vec::new();
        for (&unit, claims) in all.iter_mut() {
            claims.retain(|claim| {
                if claim.client == client {
                    wills.carry_out(claim.will);
                    halted.push(unit);
                }
                claim.client != client
            });
        }
        halted
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::collections::BTreeSet;

    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    /// Wills that are left, and the units that were halted.
    #[derive(Debug, Default)]
    struct Line(RefCell<(u64, BTreeMap<u64, u8>, Vec<u8>)>);

    impl Wills for Line {
        fn leave(&self, unit: u8) -> Option<u64> {
            let mut inside = self.0.borrow_mut();
            inside.0 += 1;
            let number = inside.0;
            inside.1.insert(number, unit);
            (unit != 0).then_some(number)
        }

        fn withdraw(&self, will: u64) {
            assert!(self.0.borrow_mut().1.remove(&will).is_some(), "it was taken back before");
        }

        fn carry_out(&self, will: u64) {
            let mut inside = self.0.borrow_mut();
            let unit = inside.1.remove(&will).unwrap();
            inside.2.push(unit);
        }
    }

    #[test]
    fn who_commanded_last_is_who_counts() {
        let (commanders, line) = (Commanders::default(), Line::default());
        for client in [1, 2] {
            assert!(commanders.begins(client, 7, &line));
            commanders.ended(client, 7, true, &line);
        }
        assert!(!commanders.has(1) && commanders.has(2));
        assert_eq!(commanders.gone(1, &line), [0; 0]);
        assert_eq!(commanders.gone(2, &line), [7]);
        assert!(line.0.borrow().1.is_empty());
    }

    #[test]
    fn where_nobody_could_halt_it_nobody_moves_it() {
        let (commanders, line) = (Commanders::default(), Line::default());
        assert!(!commanders.begins(1, 0, &line));
        assert!(!commanders.has(1));
    }

    #[derive(Debug, Clone, Copy)]
    enum Step {
        Begin(u64, u8),
        End(u64, u8, bool),
        Stop(u8),
        Go(u64),
    }

    proptest! {
        /// Against what happened, written down and looked through again each time: a client that goes halts what the last
        /// command in force was its, or what may still come of it; and nothing else is ever left.
        #[test]
        fn what_a_client_moves_is_halted_when_it_goes(steps in vec(prop_oneof![
            (0_u64..3, 1_u8..3).prop_map(|(client, unit)| Step::Begin(client, unit)),
            (0_u64..3, 1_u8..3, any::<bool>()).prop_map(|(client, unit, moves)| Step::End(client, unit, moves)),
            (1_u8..3).prop_map(Step::Stop),
            (0_u64..3).prop_map(Step::Go),
        ], 0..60)) {
            let (commanders, line) = (Commanders::default(), Line::default());
            let (mut open, mut mover) = (Vec::new(), BTreeMap::new());
            for step in steps {
                match step {
                    Step::Begin(client, unit) => {
                        prop_assert!(commanders.begins(client, unit, &line));
                        open.push((client, unit));
                    }
                    Step::End(client, unit, moves) => {
                        let Some(place) = open.iter().position(|one| *one == (client, unit)) else { continue };
                        open.remove(place);
                        commanders.ended(client, unit, moves, &line);
                        if moves {
                            mover.insert(unit, client);
                        }
                    }
                    Step::Stop(unit) => {
                        commanders.stopped(unit, &line);
                        mover.remove(&unit);
                    }
                    Step::Go(client) => {
                        let expected: BTreeSet<u8> = open.iter().map(|&(by, unit)| (unit, by)).chain(mover.clone())
                            .filter(|&(_, by)| by == client).map(|(unit, _)| unit).collect();
                        prop_assert_eq!(commanders.has(client), !expected.is_empty());
                        let halted = commanders.gone(client, &line);
                        prop_assert_eq!(halted, expected.into_iter().collect::<Vec<_>>());
                        open.retain(|&(by, _)| by != client);
                        mover.retain(|_, by| *by != client);
                    }
                }
                let needed: BTreeSet<(u8, u64)> = open.iter().map(|&(by, unit)| (unit, by)).chain(mover.clone()).collect();
                prop_assert_eq!(line.0.borrow().1.len(), needed.len());
            }
        }
    }
}
