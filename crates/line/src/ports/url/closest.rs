//! The name that somebody most likely meant, by the share of letters that two names have in common.
//!
//! The measure is that of Ratcliff and Obershelp, which Python's `difflib` uses too: 2 × common / both, where common are
//! the longest common run and, by the same rule, what is common left and right of it.

/// Names less alike than this are not meant.
const ALIKE: f64 = 0.5;

/// `; did you mean "seed"?` for a misspelt `name`, or nothing where nothing is near.
pub(super) fn hint(name: &str, known: &[&str]) -> String {
    closest(name, known).map_or_else(String::new, |meant| format!("; did you mean \"{meant}\"?"))
}

fn closest<'a>(name: &str, known: &[&'a str]) -> Option<&'a str> {
    let wanted: Vec<char> = name.to_lowercase().chars().collect();
    let rated = known.iter().filter_map(|&candidate| {
        let lower = candidate.to_lowercase();
        let letters: Vec<char> = lower.chars().collect();
        let share = share(&letters, &wanted);
        (share >= ALIKE).then_some((share, lower, candidate))
    });
    // Of equally good ones the last in the alphabet.
    rated.max_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1))).map(|(_, _, candidate)| candidate)
}

fn share(a: &[char], b: &[char]) -> f64 {
    let both = a.len() + b.len();
    let of_both = |common: usize| {
        #[expect(clippy::cast_precision_loss, reason = "names are short")]
        let share = 2.0 * common as f64 / both as f64;
        share
    };
    // What is too long to be meant is not compared: that would take the square of its length.
    if both == 0 || of_both(a.len().min(b.len())) < ALIKE { 0.0 } else { of_both(common(a, b)) }
}

fn common(a: &[char], b: &[char]) -> usize {
    let (mut at, mut in_b, mut length) = (0, 0, 0);
    for i in 0..a.len() {
        for j in 0..b.len() {
            let run = a[i..].iter().zip(&b[j..]).take_while(|(x, y)| x == y).count();
            if run > length {
                (at, in_b, length) = (i, j, run);
            }
        }
    }
    match length {
        0 => 0,
        _ => length + common(&a[..at], &b[..in_b]) + common(&a[at + length..], &b[in_b + length..]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_that_was_meant() {
        for (name, known, meant) in [
            ("sede", &["clock", "seed", "echo"][..], Some("seed")),
            ("sock", &["socket", "tcp", "sim"], Some("socket")),
            ("SEED", &["clock", "seed"], Some("seed")),
            ("x", &["clock", "seed"], None),
            ("", &["clock"], None),
            // Both have three of four letters in common.
            ("abcx", &["abcd", "abce"], Some("abce")),
        ] {
            assert_eq!(closest(name, known), meant, "{name}");
        }
    }
}
