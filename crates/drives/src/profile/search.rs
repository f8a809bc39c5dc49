//! Search: registers and parameters by what somebody remembers of them.

use crate::entry::{Entry, names};
use crate::profile::Profile;
use crate::profile::synonyms::SYNONYMS;
use crate::text::{a_third, one, within};

/// Nobody types more words than this; more only cost time.
const MOST_WORDS: usize = 16;

/// How far from what an entry is called a word stands that was found: the less, the better.
mod rank {
    pub(super) const EXACT: u32 = 0;
    pub(super) const NAME: u32 = 10;
    pub(super) const LABEL: u32 = 20;
    /// Another word for it stands in the name or label; more for a less likely one.
    pub(super) const SYNONYM: u32 = 30;
    pub(super) const CONTENT: u32 = 40;
    pub(super) const SYNONYM_IN_CONTENT: u32 = 45;
    pub(super) const NOTE: u32 = 50;
}

impl Profile {
    /// The entries in which all words of `text` occur, the best first: in a name or code before the label, then what means the
    /// same in the usage of the field (`ramp` finds the acceleration times), then choices, bits and the unit, then notes;
    /// `baudrate` finds what is called `baud_rate`. A word that occurs nowhere is taken for the nearest that does, and a
    /// code or address may be spelt as in `P00-11` or `2103`. Of equally good ones in the order of
    /// [`entries`](Self::entries). At most `limit`.
    pub fn search(&self, text: &str, limit: usize) -> Vec<&Entry> {
        if let Some(entry) = self.find_loosely(text) {
            return std::iter::once(entry).take(limit).collect();
        }
        let corrected: Vec<String> = words(text).take(MOST_WORDS).map(|word| self.corrected(word, a_third)).collect();
        self.search_words(&corrected, limit)
    }

    /// The entries in which all words of `text` occur, but for a wrong letter in each.
    pub(crate) fn search_nearly(&self, text: &str, limit: usize) -> Vec<&Entry> {
        let corrected: Vec<String> = words(text).take(MOST_WORDS).map(|word| self.corrected(word, one)).collect();
        self.search_words(&corrected, limit)
    }

    /// The entries in which all words of `text` occur as they are typed.
    pub(crate) fn search_exactly(&self, text: &str, limit: usize) -> Vec<&Entry> {
        self.search_words(&words(text).take(MOST_WORDS).collect::<Vec<String>>(), limit)
    }

    fn search_words(&self, words: &[String], limit: usize) -> Vec<&Entry> {
        let terms = terms(words);
        if terms.is_empty() {
            return Vec::new();
        }
        let mut found: Vec<(u32, &Entry)> = self
            .entries()
            .filter_map(|entry| {
                let ranks: Option<Vec<u32>> = terms.iter().map(|term| term.rank(entry)).collect();
                Some((ranks?.into_iter().sum(), entry))
            })
            .collect();
        found.sort_by_key(|&(rank, _)| rank);
        found.into_iter().map(|(_, entry)| entry).take(limit).collect()
    }

    /// `word`, or where it occurs nowhere the nearest that does. A code that is not there stands for no other.
    fn corrected(&self, word: String, wrong: fn(usize) -> usize) -> String {
        let typed = || SYNONYMS.iter().flat_map(|&(typed, _)| typed.split(' '));
        if typed().any(|known| known == word) {
            return word;
        }
        if let Some(one) = word.strip_suffix('s').filter(|one| typed().any(|known| known == *one)) {
            return one.to_owned();
        }
        if !word.chars().all(char::is_alphabetic) || self.entries().any(|entry| rank(entry, &word).is_some()) {
            return word;
        }
        let called = self.entries().flat_map(|entry| names(entry).chain([entry.label()]));
        let known: Vec<String> = called.flat_map(words).chain(typed().map(str::to_owned)).collect();
        within(&word, known.iter().map(String::as_str), wrong).map_or_else(|| word.clone(), str::to_owned)
    }
}

/// A part of what is searched for: words as they were typed, and others that mean the same.
struct Term<'a> {
    typed: &'a [String],
    meant: &'static [&'static str],
}

impl Term<'_> {
    fn rank(&self, entry: &Entry) -> Option<u32> {
        let typed: Option<Vec<u32>> = self.typed.iter().map(|word| rank(entry, word)).collect();
        let meant = (0..).zip(self.meant).filter_map(|(place, phrase)| {
            let ranks: Option<Vec<u32>> = phrase.split(' ').map(|word| rank(entry, word)).collect();
            match ranks?.into_iter().max()? {
                // In a note a word is only mentioned.
                rank::NOTE => None,
                rank::CONTENT => Some(rank::SYNONYM_IN_CONTENT),
                _ => Some(rank::SYNONYM + place),
            }
        });
        typed.map(|ranks| ranks.into_iter().sum()).into_iter().chain(meant).min()
    }
}

/// `words` cut into terms: where several are known to mean something together, they stay together.
fn terms(words: &[String]) -> Vec<Term<'_>> {
    let mut terms = Vec::new();
    let mut rest = words;
    while !rest.is_empty() {
        let known = SYNONYMS
            .iter()
            .filter_map(|&(typed, meant)| {
                let count = typed.split(' ').count();
                let begin = rest.get(..count)?;
                typed.split(' ').eq(begin.iter().map(String::as_str)).then_some((count, meant))
            })
            .max_by_key(|&(count, _)| count);
        let (count, meant) = known.unwrap_or((1, &[]));
        let (typed, behind) = rest.split_at(count);
        terms.push(Term { typed, meant });
        rest = behind;
    }
    terms
}

/// The words of `text`, in lower case.
fn words(text: &str) -> impl Iterator<Item = String> {
    text.split(|letter: char| letter.is_whitespace() || "_-,()".contains(letter))
        .filter(|word| !word.is_empty())
        .map(str::to_lowercase)
}

/// How far from the name of `entry` the word `word` stands; `None` if it does not occur.
fn rank(entry: &Entry, word: &str) -> Option<u32> {
    let has = |text: &str| text.to_lowercase().contains(word);
    let choices = || entry.quantity().choices().values().any(|label| has(label));
    let bits = || entry.bits().iter().any(|bit| has(bit.name()) || bit.values().values().any(|label| has(label)));
    if names(entry).any(|name| name.eq_ignore_ascii_case(word)) {
        Some(rank::EXACT)
    } else if names(entry).any(|name| has(name) || has(&name.replace('_', ""))) {
        Some(rank::NAME)
    } else if has(entry.label()) {
        Some(rank::LABEL)
    } else if choices() || bits() || entry.quantity().unit().eq_ignore_ascii_case(word) {
        Some(rank::CONTENT)
    } else {
        has(entry.note()).then_some(rank::NOTE)
    }
}

#[cfg(test)]
mod tests {
    use super::{rank, terms, words};
    use crate::profile::Profile;
    use crate::profile::synonyms::SYNONYMS;

    #[test]
    fn each_synonym_leads_to_a_row_of_a_shipped_profile() {
        let profiles: Vec<_> = Profile::builtin_names().filter_map(|name| Profile::builtin(name).ok()).collect();
        for (typed, meant) in SYNONYMS {
            for phrase in *meant {
                let mut entries = profiles.iter().flat_map(|profile| profile.entries());
                let leads = entries.any(|entry| {
                    phrase.split(' ').all(|word| rank(entry, word).is_some_and(|rank| rank <= rank::CONTENT))
                });
                assert!(leads, "{typed}: {phrase}");
            }
        }
    }

    #[test]
    fn the_longest_phrase_that_is_known_stays_together() {
        let typed = |text: &str| -> Vec<String> {
            let words: Vec<String> = words(text).collect();
            terms(&words).iter().map(|term| term.typed.join(" ")).collect()
        };
        assert_eq!(typed("Ramp-up time"), ["ramp up", "time"]);
        assert_eq!(typed("motor_1 slave id"), ["motor", "1", "slave id"]);
        assert_eq!(typed(" , "), [""; 0]);
    }
}
