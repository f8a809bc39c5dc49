//! The role that reads what moves: the words are other ones before each read, so that an answer of before shows as wrong.

use crate::chance::Chance;
use crate::rig::{Rig, UNITS};
use crate::roles::{Role, read, some_unit};
use crate::verdict::Verdict;

/// P08.06 to P08.08, the jog's, which nobody else reads or writes.
const FIRST: u16 = 0x0806;
const LENGTH: u16 = 3;
/// Turns until the same words come again; the first of them, a frequency, is at most 63 000.
const TURNS: u16 = 20_000;

/// Turns the same words of a unit at its keypad and reads them, again and again.
#[derive(Debug)]
pub(crate) struct Watcher {
    chance: Chance,
    turn: u16,
}

impl Watcher {
    pub(crate) fn new(chance: Chance) -> Self {
        Self { chance, turn: 0 }
    }
}

impl Role for Watcher {
    fn act(&mut self, rig: &Rig, verdict: &mut Verdict) {
        let Some(unit) = some_unit(rig, &mut self.chance, &UNITS) else { return };
        self.turn = (self.turn + 1) % TURNS;
        // No two of them are alike within a turn, nor those of turns that follow one another.
        let words: Vec<u16> = (0..LENGTH).map(|place| self.turn * LENGTH + place).collect();
        if let Err(code) = rig.set(unit, FIRST, &words) {
            verdict.wrong_values += 1;
            return verdict.blame(format!("unit {unit}: the keypad refuses {words:?} with {code}"), rig.trace());
        }
        let count = 1 + usize::from(self.chance.below(LENGTH));
        let retries = (self.chance.below(2) == 0).then_some(0);
        read(rig, unit, FIRST, &words[..count], retries, verdict);
    }
}
