//! What came before a search begins: the real conversation and the real line have gone through it.

use crate::frames::Kind;
use crate::judge::Step;
use crate::scenario::{Budget, LONGEST};
use crate::search::{Action, Heard, How, Search};
use crate::world::{State, Told};

/// One way only, on which nothing happened.
pub const NOTHING: &[&[Action]] = &[&[]];

/// A unit gives two words in place of one: while it is asked for that, or later, when nothing is.
pub const OTHER_LENGTHS: &[&[Action]] = &[
    &[Action::Ask(0, Kind::Read(1)), Action::Send(Heard::OtherLength(2)), Action::Arrive(0, 0, How::Whole)],
    &[
        Action::Ask(0, Kind::Read(1)),
        Action::Send(Heard::OtherLength(2)),
        Action::TimeOut,
        Action::Arrive(0, 0, How::Whole),
    ],
];

/// Here may be asked and answered as it likes.
const BUDGET: Budget = Budget { lengths: u8::MAX, retries: 0, ..Budget::requests(u8::MAX) };

impl Search {
    /// `state`, once what came `before` has happened, an echo has come back, and nothing is open any more. `None` where that
    /// cannot happen.
    pub(crate) fn after(&self, before: &[Action], mut state: State) -> Option<State> {
        if before.is_empty() {
            return Some(state);
        }
        state.left = BUDGET;
        let end = [
            Action::Ask(0, Kind::Echo(0)),
            Action::Send(Heard::Answered),
            Action::Arrive(0, 0, How::Whole),
            Action::Wait(state.now + LONGEST + LONGEST),
        ];
        for &action in before.iter().chain(&end) {
            let mut step = Step { scenario: &self.scenario, sights: Vec::new(), doubted: false };
            self.step(&mut step, &mut state, action)?;
        }
        let is_over = state.program.call.is_none() && state.wrong.is_none();
        is_over.then(|| State { left: self.budget, requests: 0, told: Told::default(), ..state })
    }
}

#[cfg(test)]
mod tests {
    use drivebus_rtu::Attribution;
    use stateright::Model;

    use super::*;
    use crate::scenario::SCENARIOS;
    use crate::world::{TICK, address};

    /// How sure the answer to a read of two words is where one of one word is open, in each state that a search begins with.
    fn sure(name: &str) -> Vec<Attribution> {
        let scenario = SCENARIOS.iter().find(|scenario| scenario.name == name).unwrap();
        let states = Search::new(scenario, scenario.small).init_states();
        let sure = |state: State| {
            let (now, unit, mut master) = (state.now, address(0), state.master().clone());
            assert!(!state.is_doubted(0) && state.units[0].coming.is_empty());
            master.still_owed(now, unit, &Kind::Read(1).request(), TICK);
            master.attribution(now, unit, &Kind::Read(2).request())
        };
        states.into_iter().map(sure).collect()
    }

    #[test]
    fn whatever_came_before_the_unit_is_known_for_it() {
        let sure_of = |words| Attribution::Repeat { words, refusal: 2 };
        assert_eq!(sure("other-lengths"), vec![sure_of(2); OTHER_LENGTHS.len()]);
        assert_eq!(sure("overtaking"), [sure_of(1)], "two words are not one");
    }
}
