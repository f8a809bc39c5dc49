//! Which family a unit that is to be halted may be, from the few words it was asked for, and what is asked next.
//!
//! Answers go in, and the next question or a verdict comes out. Three things are held against each family: what its units
//! answer, what they refuse, and whose code a word is. A family that contradicts an answer is out. One whose code came,
//! or whose whole signature, or whose state is one of its states, is *shown*. Where the named family is shown and nothing
//! is left that its command would do harm to, it is taken; where another is shown and the named one is not, that one is.
//! Where several are left that want different words, nobody is; before that whoever is not ruled out is asked for.

mod likeness;

use std::cmp::Reverse;
use std::sync::Arc;

use drivebus_drives::{Command, Place};

use crate::answer::{Answer, LOCKED};
use crate::families::Families;
use crate::family::Family;
use crate::harm::What;

/// What is to be done.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Verdict {
    /// Ask the unit for the word at this place; how it answers is told to [`Apart::heard`].
    Ask(Place),
    /// Take it for one of this family.
    Take(Arc<Family>),
    /// Nothing more is asked, and it may be any of these. Of none of them, where there are none: it fits no family that
    /// has commands.
    Undecided(Vec<Arc<Family>>),
}

/// The families that one unit may be, told apart by its answers.
///
/// ```
/// use drivebus_drive::{Answer, Apart, Families, Verdict, What};
/// use drivebus_drives::{Command, Place, Profile};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // Somebody calls it a GD350. It says that its code is 01A0H, and that it is stopped.
/// let ask = |place: Place| match place.address {
///     0x2103 => Answer::word_at(place, 0x01A0),
///     0x2100 => Answer::word_at(place, 3),
///     _ => Answer::word_at(place, 0),
/// };
/// let families = Families::shipped();
/// let mut apart = Apart::new(&families.family(&Profile::builtin("gd350")?), families, false);
/// let verdict = loop {
///     match apart.verdict(What::Command(Command::Stop)) {
///         Verdict::Ask(place) => apart.heard(ask(place)),
///         verdict => break verdict,
///     };
/// };
/// assert!(matches!(verdict, Verdict::Take(family) if family.name() == "gd350"));
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct Apart {
    /// What it was named as, and then all others.
    named: Arc<Family>,
    families: Vec<Arc<Family>>,
    is_trusted: bool,
    is_doubted: bool,
    /// The last answer to each question.
    answers: Vec<Answer>,
}

impl Apart {
    /// Nothing is known yet of a unit that was named as one of `named`, and may be one of `families` as well.
    ///
    /// Where `is_trusted`, that name is meant, whatever the unit says: it is taken where nothing else is shown.
    pub fn new(named: &Arc<Family>, families: &Families, is_trusted: bool) -> Self {
        let (families, named) = (families.with(named), Arc::clone(named));
        Self { families, named, is_trusted, is_doubted: false, answers: Vec::new() }
    }

    /// The same for a unit that did not take what harms nobody: what it is has to be asked all the same.
    #[must_use]
    pub fn doubting(self) -> Self {
        Self { is_doubted: true, ..self }
    }

    /// Whether the unit told anything yet.
    pub fn is_asked(&self) -> bool {
        !self.answers.is_empty()
    }

    /// Whether the answers show a unit of what it was named as, and nothing speaks against that.
    pub fn shows_named(&self) -> bool {
        self.is_live(&self.named) && self.is_shown(&self.named)
    }

    /// Takes `answer` into account. Whether it tells anything: a unit that is busy says nothing of what it is.
    pub fn heard(&mut self, answer: Answer) -> bool {
        // That a password locks it is said in the words of one maker.
        if answer.passes() && answer.exception() != Some(LOCKED) {
            return false;
        }
        match self.answers.iter_mut().find(|known| known.place == answer.place) {
            Some(known) => *known = answer,
            None => self.answers.push(answer),
        }
        true
    }

    /// What to ask, or as what to take the unit to which `what` is to be sent.
    ///
    /// As what a unit is taken that any word is written to, matters only for whether that one keeps the word, or starts
    /// by it.
    pub fn verdict(&self, what: What) -> Verdict {
        let named = &self.named;
        let live: Vec<_> = self.families.iter().filter(|family| self.is_live(family)).collect();
        let others: Vec<_> = live.iter().copied().filter(|family| !is_same(family, named)).collect();
        let is_live = others.len() < live.len();
        if is_live && self.is_shown(named) {
            return self.between(named, self.rivals(named, &live, what));
        }
        if let What::Command(command) = what
            && is_live
            && !self.is_doubted
            && let Some(verdict) = self.by_harm(&others, command)
        {
            return verdict;
        }
        if is_live && let Some(place) = self.next_of(named) {
            return Verdict::Ask(place);
        }
        let shown: Vec<_> = others.iter().copied().filter(|family| self.is_shown(family)).collect();
        if !shown.is_empty() {
            return self.one_of(&shown, &live, what);
        }
        // A family that an answer does not fit comes last.
        let mut fitting = others.iter().filter(|family| self.explains_by_rule(family));
        if let Some(place) = fitting.find_map(|family| self.next_of(family)) {
            return Verdict::Ask(place);
        }
        let is_command = matches!(what, What::Command(_));
        let takes_commands = |family: &&Arc<Family>| !family.profile().commands().is_empty();
        let is_all_that_is_left = !named.is_known_by_something() && !others.iter().any(takes_commands);
        if is_live && (self.is_trusted || is_command || self.has_words() || is_all_that_is_left) {
            return Verdict::Take(Arc::clone(named));
        }
        // A drive has more words than its profile lists: before it is halted by no word of its own, whoever is not ruled
        // out is asked for. One that answers anything shows nobody.
        if is_command && self.has_refused() {
            let unasked = others.iter().filter_map(|family| Some((self.words_of(family), self.next_of(family)?)));
            if let Some((_, place)) = unasked.min_by_key(|&(words, _)| Reverse(words)) {
                return Verdict::Ask(place);
            }
        }
        if self.is_trusted {
            return Verdict::Take(Arc::clone(named));
        }
        Verdict::Undecided(live.into_iter().filter(takes_commands).cloned().collect())
    }

    /// The verdict where it takes fewer questions to rule out whom of `others` the `command` would harm than to see what
    /// the unit is.
    ///
    /// Nothing has to show the named family then: a halt that harms nobody is no risk, and what the unit is is asked
    /// behind it.
    fn by_harm(&self, others: &[&Arc<Family>], command: Command) -> Option<Verdict> {
        let named = &self.named;
        // Where there is no word of it, that it harms nobody says nothing.
        named.command(command)?;
        let is_harmed = |family: &&Arc<Family>| family.is_harmed_by(What::Command(command), named);
        let can_tell = others.iter().copied().filter(|family| !family.telling().is_empty());
        let mut in_danger: Vec<_> = can_tell.filter(is_harmed).collect();
        let places = self.unasked(std::iter::once(named).chain(in_danger.iter().copied()));
        let mut asked = Vec::new();
        while !in_danger.is_empty() {
            // Of two that rule out as many the one that tells more of the named family, which stands first.
            let left_by = |place: &Place| -> Vec<_> {
                in_danger.iter().copied().filter(|family| !likeness::rules_out(named, family, *place)).collect()
            };
            let (best, left) =
                places.iter().map(|place| (*place, left_by(place))).min_by_key(|(_, left)| left.len())?;
            if left.len() == in_danger.len() {
                return None;
            }
            asked.push(best);
            in_danger = left;
        }
        if asked.len() + 2 > self.unasked([named]).len() {
            return None;
        }
        match asked.first() {
            Some(&place) => Some(Verdict::Ask(place)),
            None => self.is_asked().then(|| Verdict::Take(Arc::clone(named))),
        }
    }

    /// The verdict on a unit that shows `taken`, where `rivals` could say the same and would take harm.
    fn between(&self, taken: &Arc<Family>, mut rivals: Vec<&Arc<Family>>) -> Verdict {
        for rival in &rivals {
            // Where nothing but a state speaks for it, the other one may show itself.
            let by_itself = || if self.is_told(taken) { None } else { self.next_of(rival) };
            if let Some(place) = self.telling(taken, rival).or_else(by_itself) {
                return Verdict::Ask(place);
            }
        }
        rivals.retain(|rival| self.is_shown(rival));
        if rivals.is_empty() {
            return Verdict::Take(Arc::clone(taken));
        }
        Verdict::Undecided(std::iter::once(taken).chain(rivals).cloned().collect())
    }

    /// The verdict on a unit that does not show what it was named as, and shows the families `shown`.
    fn one_of(&self, shown: &[&Arc<Family>], live: &[&Arc<Family>], what: What) -> Verdict {
        if let [first, second, ..] = shown
            && let Some(place) = self.telling(first, second)
        {
            return Verdict::Ask(place);
        }
        let all = |families: &[&Arc<Family>]| families.iter().copied().cloned().collect();
        let command = match what {
            What::Command(command) => command,
            What::Word(_) => {
                let harmed: Vec<_> =
                    shown.iter().copied().filter(|family| family.is_harmed_by(what, &self.named)).collect();
                return match (harmed.as_slice(), shown) {
                    ([], [first, ..]) => Verdict::Take(Arc::clone(first)),
                    _ => Verdict::Undecided(all(&harmed)),
                };
            }
        };
        for taken in shown {
            let Some(halt) = taken.halt_for(command) else { continue };
            match self.between(taken, self.rivals(taken, live, What::Command(halt))) {
                Verdict::Undecided(_) => {}
                verdict => return verdict,
            }
        }
        Verdict::Undecided(all(shown))
    }

    /// The families that could have answered the same as `taken`, and that `what` is sent to it is not for.
    ///
    /// A code and a signature say which family it is, so that only those count which would take harm. A state alone says
    /// little: whoever halts by other words counts.
    fn rivals<'a>(&self, taken: &Arc<Family>, live: &[&'a Arc<Family>], what: What) -> Vec<&'a Arc<Family>> {
        // A parameter that has no row is as good for a rival as it is for this one; and as good as a state, which alone may
        // be any word.
        let is_strict = self.explains(taken) && self.is_told(taken);
        let fits = |family: &Family| self.explains(family) || !is_strict && self.explains_by_rule(family);
        let others = live.iter().copied().filter(|family| !is_same(family, taken) && fits(family));
        if matches!(what, What::Word(_)) || self.is_told(taken) {
            others.filter(|family| family.is_harmed_by(what, taken)).collect()
        } else {
            others.filter(|family| !family.halts_like(taken)).collect()
        }
    }

    /// The first question by which the unit shows `family`, or not.
    fn next_of(&self, family: &Family) -> Option<Place> {
        family.telling().iter().copied().find(|&place| self.answer(place).is_none())
    }

    /// How many of the words that show `family` were answered.
    fn words_of(&self, family: &Family) -> usize {
        self.answered().filter(|place| family.telling().contains(place)).count()
    }

    /// What to ask to tell `one` from `other`: best what one has and the other is printed to refuse.
    fn telling(&self, one: &Arc<Family>, other: &Arc<Family>) -> Option<Place> {
        let places = self.unasked([other, one]).into_iter();
        let rated = places.map(|place| (likeness::told_apart(one, other, place), place));
        let (how_well, place) = rated.min_by_key(|&(how_well, _)| Reverse(how_well))?;
        (how_well > 0).then_some(place)
    }

    /// What shows these families and was not asked yet, each place once.
    fn unasked<'a>(&self, families: impl IntoIterator<Item = &'a Arc<Family>>) -> Vec<Place> {
        let mut places = Vec::new();
        for &place in families.into_iter().flat_map(|family| family.telling()) {
            if self.answer(place).is_none() && !places.contains(&place) {
                places.push(place);
            }
        }
        places
    }
}

/// Whether both are the very family that was meant; of one name there may be another one.
fn is_same(one: &Arc<Family>, other: &Arc<Family>) -> bool {
    Arc::ptr_eq(one, other)
}

#[cfg(test)]
mod tests;
