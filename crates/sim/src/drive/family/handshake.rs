//! Words that come before a run: how far a drive has been led up to it, and what its state word shows on the way.
//!
//! - Assumption: a reset, and a stop that is none of the words, lead back to their beginning.

use drivebus_drives::{Profile, State};

/// The words, in the order in which they must come.
#[derive(Debug, Clone)]
pub(crate) struct Handshake {
    /// What the state word shows at rest before any of them came.
    pub(crate) idle: u16,
    /// Each word, and what the state word shows at rest behind it.
    pub(crate) words: Vec<(u16, u16)>,
}

impl Handshake {
    /// What a profile of somebody's own says of it: behind each word stands a word that means stopped and that it waits for, `idle`
    /// where that is one. None where a run needs no words.
    ///
    /// # Errors
    ///
    /// A word behind which nothing would mean stopped, with its place.
    pub(super) fn of(profile: &Profile, idle: u16) -> Result<Option<Self>, String> {
        let rules = profile.state_word().map_or(&[][..], |word| word.rules.as_slice());
        let stopped = || rules.iter().filter(|rule| rule.state == State::Stopped).map(|rule| rule.value);
        let mut words = Vec::new();
        for step in profile.start_sequence() {
            let waited_for = |word| step.until.iter().fold(word, |word, field| (word & !field.mask) | field.value);
            let mut candidates = std::iter::once(idle).chain(stopped()).map(waited_for);
            let shown = candidates.find(|&word| profile.state(word) == State::Stopped).ok_or_else(|| {
                let what = format!("no word that means stopped is what \"{}\" waits for", step.label);
                format!("profile.toml, [[commands.sequence]]: {what}")
            })?;
            words.push((step.word, shown));
        }
        Ok((!words.is_empty()).then_some(Self { idle, words }))
    }

    /// How many words a drive has behind it that had `so_far` and gets `word`, which is not a run. `None`: the word comes out of
    /// its turn and does nothing.
    ///
    /// A word that came already leads back to where it led then; one that is none of them, to the beginning.
    pub(crate) fn after(&self, so_far: usize, word: u16) -> Option<usize> {
        match self.words.iter().position(|&(known, _)| known == word) {
            Some(place) => (place <= so_far).then_some(place + 1),
            None => Some(0),
        }
    }

    /// Whether a run is obeyed.
    pub(crate) fn is_through(&self, so_far: usize) -> bool {
        so_far == self.words.len()
    }

    /// What the state word shows at rest.
    pub(crate) fn shown(&self, so_far: usize) -> u16 {
        let behind = so_far.checked_sub(1).and_then(|place| self.words.get(place));
        behind.map_or(self.idle, |&(_, shown)| shown)
    }
}
