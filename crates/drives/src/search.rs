//! Search: registers and parameters by what somebody remembers of them.

use crate::entry::Entry;
use crate::lookup::names;
use crate::profile::Profile;

impl Profile {
    /// The entries in which all words of `text` occur, the best first: in a name or code before the label, and that
    /// before choices, bits, the unit and notes; `baudrate` finds what is called `baud_rate`. Of equally good ones in the order of [`entries`](Self::entries). At most `limit`.
    pub fn search(&self, text: &str, limit: usize) -> Vec<&Entry> {
        let wanted: Vec<String> = text.to_lowercase().split([' ', '_', '-']).map(str::to_owned).collect();
        let wanted: Vec<&str> = wanted.iter().map(String::as_str).filter(|word| !word.is_empty()).collect();
        if wanted.is_empty() {
            return Vec::new();
        }
        let mut found: Vec<(u32, &Entry)> = self
            .entries()
            .filter_map(|entry| {
                let ranks: Option<Vec<u32>> = wanted.iter().map(|word| rank(entry, word)).collect();
                Some((ranks?.into_iter().sum(), entry))
            })
            .collect();
        found.sort_by_key(|&(rank, _)| rank);
        found.into_iter().map(|(_, entry)| entry).take(limit).collect()
    }
}

/// How far from the name of `entry` the word `word` stands; `None` if it does not occur.
fn rank(entry: &Entry, word: &str) -> Option<u32> {
    let has = |text: &str| text.to_lowercase().contains(word);
    let choices = || entry.quantity().choices().values().any(|label| has(label));
    let bits = || entry.bits().iter().any(|bit| has(bit.name()) || bit.values().values().any(|label| has(label)));
    if names(entry).any(|name| name.eq_ignore_ascii_case(word)) {
        Some(0)
    } else if names(entry).any(|name| has(name) || has(&name.replace('_', ""))) {
        Some(1)
    } else if has(entry.label()) {
        Some(2)
    } else if choices() || bits() || entry.quantity().unit().eq_ignore_ascii_case(word) {
        Some(3)
    } else {
        has(entry.note()).then_some(4)
    }
}
