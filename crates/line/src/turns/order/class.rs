//! Who is first among those of one class: programs take turns, of each its units do, and who came first comes first. Kept
//! sorted, so that a turn costs the logarithm of what waits.

use std::collections::{BTreeMap, BTreeSet};

use super::{Number, OVERTAKEN_AT_MOST, UNITS};

/// Whose call it is: of which unit, and of which program.
pub(super) type Kin = (u8, u16);

/// Calls of one kin, by when they came.
type Calls = BTreeSet<Number>;

/// A call that is the first of its kin, behind the last turn of the unit: the lowest is next of its program.
type First = (Number, Number);

/// Those of one class who wait, and when each unit and each program had its last turn in it.
#[derive(Debug)]
pub(super) struct Class {
    /// The number of the last turn of each unit; 0: none yet.
    of_unit: Vec<Number>,
    programs: Vec<Program>,
    /// All who wait.
    numbers: BTreeSet<Number>,
    calls: BTreeMap<Kin, Calls>,
    /// What is next of each program, behind the last turn of the program: the lowest is next. Only those that had no turn
    /// yet have the same, and of them the unit decides.
    next: BTreeSet<(Number, First)>,
    overtaking: Overtaking,
}

/// One program in one class.
#[derive(Debug, Default)]
struct Program {
    /// The number of its last turn; 0: none yet.
    last_turn: Number,
    firsts: BTreeSet<First>,
}

impl Program {
    fn next(&self) -> Option<(Number, First)> {
        self.firsts.first().map(|&first| (self.last_turn, first))
    }
}

impl Default for Class {
    fn default() -> Self {
        Self {
            of_unit: vec![Number::default(); UNITS],
            programs: vec![Program::default()],
            numbers: BTreeSet::new(),
            calls: BTreeMap::new(),
            next: BTreeSet::new(),
            overtaking: Overtaking::default(),
        }
    }
}

impl Class {
    /// There is a program of this number.
    pub(super) fn knows(&mut self, program: u16) {
        let programs = usize::from(program) + 1;
        if self.programs.len() < programs {
            self.programs.resize_with(programs, Program::default);
        }
    }

    /// The call `number` of `kin` waits.
    pub(super) fn wait(&mut self, number: Number, kin: Kin) {
        self.numbers.insert(number);
        self.change(kin, |calls| {
            calls.insert(number);
        });
    }

    /// The call `number` of `kin` waits no longer.
    pub(super) fn leave(&mut self, number: Number, kin: Kin) {
        self.numbers.remove(&number);
        self.change(kin, |calls| {
            calls.remove(&number);
        });
    }

    /// Who is next, were there only this class and nobody late.
    pub(super) fn next(&self) -> Option<Number> {
        self.next.first().map(|&(_, (_, number))| number)
    }

    /// The first of those who were overtaken as often as may be.
    pub(super) fn late(&self) -> Option<Number> {
        self.numbers.first().copied().filter(|&number| self.is_late(number))
    }

    /// Whether who came as `number` was overtaken as often as may be.
    pub(super) fn is_late(&self, number: Number) -> bool {
        self.overtaking.is_late(number)
    }

    /// The call `number` of a higher class has a turn.
    pub(super) fn is_overtaken(&mut self, number: Number) {
        if !self.numbers.is_empty() {
            self.overtaking.by(number);
        }
    }

    /// Whoever came after `number` was overtaken by nobody.
    pub(super) fn forgives(&mut self, number: Number) {
        self.overtaking.forgives(number);
    }

    /// A call of `kin`, which waits no longer, has the turn of this number.
    #[expect(
        clippy::inline_always,
        reason = "it has several callers, and the lone one on the hot path pays for no call"
    )]
    #[inline(always)]
    pub(super) fn count(&mut self, kin: Kin, turn: Number) {
        let (unit, program) = kin;
        if self.calls.is_empty() {
            self.programs[usize::from(program)].last_turn = turn;
        } else {
            self.sort(kin, turn);
        }
        self.of_unit[usize::from(unit)] = turn;
    }

    /// Puts those who wait where they belong when `kin` has this turn.
    fn sort(&mut self, (unit, program): Kin, turn: Number) {
        let before = self.of_unit[usize::from(unit)];
        let of_unit = self.calls.range((unit, 0)..=(unit, u16::MAX));
        for (&(_, program), first) in of_unit.filter_map(|(kin, calls)| Some((kin, *calls.first()?))) {
            change(&mut self.next, &mut self.programs[usize::from(program)], |program| {
                program.firsts.remove(&(before, first));
                program.firsts.insert((turn, first));
            });
        }
        change(&mut self.next, &mut self.programs[usize::from(program)], |program| program.last_turn = turn);
    }

    /// Changes the calls of `kin`, and puts it where its first call belongs.
    fn change(&mut self, kin: Kin, change_calls: impl FnOnce(&mut Calls)) {
        let of_unit = self.of_unit[usize::from(kin.0)];
        let calls = self.calls.entry(kin).or_default();
        let before = calls.first().copied();
        change_calls(calls);
        let first = calls.first().copied();
        if first.is_none() {
            self.calls.remove(&kin);
        }
        if first == before {
            return;
        }
        change(&mut self.next, &mut self.programs[usize::from(kin.1)], |program| {
            if let Some(before) = before {
                program.firsts.remove(&(of_unit, before));
            }
            if let Some(first) = first {
                program.firsts.insert((of_unit, first));
            }
        });
    }
}

/// Changes `program`, and puts it where it belongs among those that are `next`.
fn change(next: &mut BTreeSet<(Number, First)>, program: &mut Program, change: impl FnOnce(&mut Program)) {
    let before = program.next();
    change(program);
    let after = program.next();
    if before == after {
        return;
    }
    if let Some(before) = before {
        next.remove(&before);
    }
    if let Some(after) = after {
        next.insert(after);
    }
}

/// Those who overtook: by how many of them somebody was overtaken is how many came later than that one.
///
/// More than the latest of them, as many as make somebody late, need not be known.
#[derive(Debug, Default)]
struct Overtaking {
    /// When they came, the latest first.
    latest: [Number; OVERTAKEN_AT_MOST as usize],
}

impl Overtaking {
    fn by(&mut self, number: Number) {
        let place = self.latest.partition_point(|&other| other >= number);
        if place < self.latest.len() {
            self.latest[place..].rotate_right(1);
            self.latest[place] = number;
        }
    }

    fn forgives(&mut self, number: Number) {
        for other in &mut self.latest {
            *other = (*other).min(number);
        }
    }

    fn is_late(&self, number: Number) -> bool {
        self.latest.last().is_some_and(|&last| last > number)
    }
}
