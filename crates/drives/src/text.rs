//! Text as people write it: parameter codes, addresses, and the closest match for a misspelt name.

use crate::place::{Place, Table};

/// Reads a parameter's code, `P05.06`, `p5.6` or, as some makers write what can only be read, `r25.00`, as group and
/// index.
pub(crate) fn parse_code(text: &str) -> Option<(u8, u8)> {
    let (group, index) = text.strip_prefix(['P', 'p', 'R', 'r'])?.split_once('.')?;
    let number = |digits: &str| match digits.len() {
        1 | 2 if digits.bytes().all(|digit| digit.is_ascii_digit()) => digits.parse().ok(),
        _ => None,
    };
    Some((number(group)?, number(index)?))
}

/// Reads a code as people type it: `P00-11`, `p 0,11`, `P0011`.
pub(crate) fn parse_loose_code(text: &str) -> Option<(u8, u8)> {
    let text: String = text.split_whitespace().collect();
    let code = text.strip_prefix(['P', 'p', 'R', 'r'])?;
    let (group, index) = match code.split_once(['.', '-', '_', ',', ':', '/']) {
        Some(parts) => parts,
        None if code.len() == 4 => (code.get(..2)?, code.get(2..)?),
        None => return None,
    };
    parse_code(&format!("P{group}.{index}"))
}

/// Reads an address with the name of its table before it, `input 0x0000`; without one it is that of a holding register.
pub(crate) fn parse_place(text: &str) -> Option<Place> {
    let (table, address) = match text.split_once(' ') {
        Some((name, address)) => (Table::named(name)?, address),
        None => (Table::Holding, text),
    };
    parse_address(address).map(|address| Place::new(table, address))
}

/// Reads an address as people type it, also without a sign that it is one: `2103`, `0x 2103`. Only to look
/// for something: what is read or written has to be named.
pub(crate) fn parse_loose_address(text: &str) -> Option<u16> {
    let text: String = text.split_whitespace().collect();
    parse_address(&text).or_else(|| (text.len() == 4).then(|| parse_address(&format!("0x{text}"))).flatten())
}

/// What is left of the name of a drive when case, blanks and signs are not looked at: `VFD-E` and `vfd e` are alike.
pub(crate) fn folded(name: &str) -> String {
    name.chars().filter(|letter| letter.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// The group of a parameter, as its code says it: `P05` of P05.06, `C1` of C1-01, `ACC` of ACC.
pub(crate) fn group(code: &str) -> &str {
    code.split(['.', '-']).next().unwrap_or(code)
}

/// The address of a parameter by the rule group.index: P05.06 is 0506H, P10.01 is 0A01H.
pub(crate) fn parameter_address(group: u8, index: u8) -> u16 {
    u16::from_be_bytes([group, index])
}

/// Reads an address in hex, `0x3004` or `3004H`.
pub(crate) fn parse_address(text: &str) -> Option<u16> {
    let digits =
        text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")).or_else(|| text.strip_suffix(['H', 'h']))?;
    // `from_str_radix` would take a sign.
    if digits.bytes().all(|digit| digit.is_ascii_hexdigit()) { u16::from_str_radix(digits, 16).ok() } else { None }
}

/// The candidate with the fewest edits away from `name`, upper and lower case alike; the first of several.
///
/// One that `name` is only a part of, as `current` of `output_current`, is nearer than one that shares next to nothing.
pub(crate) fn closest<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    // Nobody misspells a name by this much; longer input only costs time.
    let name: Vec<char> = name.to_lowercase().chars().take(64).collect();
    candidates.min_by_key(|candidate| {
        let candidate = candidate.to_lowercase();
        let edits = distance(&name, &candidate);
        let apart = edits * 2 > name.len().max(candidate.chars().count()) && !is_part(&name, &candidate);
        (apart, edits)
    })
}

/// The candidate that `name` is most likely a misspelling of; `None` where none is near.
///
/// As many letters may be wrong as [`a_third`] says.
pub(crate) fn near<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    within(name, candidates, a_third)
}

/// The candidate closest to `name`, if no more letters are wrong than `wrong` says of a word of so many.
pub(crate) fn within<'a>(
    name: &str,
    candidates: impl Iterator<Item = &'a str>,
    wrong: fn(usize) -> usize,
) -> Option<&'a str> {
    let letters: Vec<char> = name.to_lowercase().chars().collect();
    closest(name, candidates).filter(|candidate| distance(&letters, &candidate.to_lowercase()) <= wrong(letters.len()))
}

/// One letter of three may be wrong, and of a word of three none.
pub(crate) fn a_third(letters: usize) -> usize {
    if letters > 3 { (letters + 1) / 3 } else { 0 }
}

/// One letter may be wrong, and of a word of three none.
pub(crate) fn one(letters: usize) -> usize {
    usize::from(letters > 3)
}

/// Whether the letters of `part` stand in `whole` in their order; two of them say nothing.
fn is_part(part: &[char], whole: &str) -> bool {
    let mut rest = whole.chars();
    part.len() > 2 && part.iter().all(|&wanted| rest.any(|letter| letter == wanted))
}

/// Levenshtein's distance: how many characters to insert, drop or replace.
fn distance(from: &[char], to: &str) -> usize {
    let mut row: Vec<usize> = (0..=from.len()).collect();
    for (line, letter) in to.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = line + 1;
        for (column, &other) in from.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != other);
            diagonal = row[column + 1];
            row[column + 1] = replaced.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[from.len()]
}

#[cfg(test)]
mod tests {
    use super::{
        closest, distance, near, parse_address, parse_code, parse_loose_address, parse_loose_code, parse_place,
    };
    use crate::place::{Place, Table};

    #[test]
    fn a_place_has_the_name_of_its_table_before_it() {
        assert_eq!(parse_place("0x2103"), Some(Place::from(0x2103)));
        for (text, table) in
            [("input 0x000A", Table::Input), ("coil 000AH", Table::Coil), ("holding 0x000A", Table::Holding)]
        {
            assert_eq!(parse_place(text), Some(Place::new(table, 0x000A)), "{text}");
        }
        for text in ["inputs 0x000A", "input  0x000A", "input 10", "input", "", "0x000A input"] {
            assert_eq!(parse_place(text), None, "{text:?}");
        }
    }

    #[test]
    fn distances_are_levenshteins() {
        for (from, to, edits) in
            [("", "", 0), ("", "abc", 3), ("abc", "", 3), ("kitten", "sitting", 3), ("flaw", "lawn", 2)]
        {
            assert_eq!(distance(&from.chars().collect::<Vec<_>>(), to), edits, "{from} {to}");
        }
        assert_eq!(closest("OUTPUT_CURENT", ["output_voltage", "output_current"].into_iter()), Some("output_current"));
        assert_eq!(closest("anything", std::iter::empty()), None);
    }

    #[test]
    fn a_part_of_a_long_name_is_nearer_than_any_short_one() {
        let known = || ["P00.01", "control_command", "output_current"].into_iter();
        assert_eq!(closest("current", known()), Some("output_current"));
        assert_eq!(closest("contrl", known()), Some("control_command"));
        assert_eq!(closest("P00.02", known()), Some("P00.01"));
        assert_eq!(closest("nope", ["gd350", "gd600-rectifier"].into_iter()), Some("gd350"));
    }

    #[test]
    fn only_what_is_spelt_like_it_is_near() {
        let known = || ["ramp", "current", "acceleration", "brake"].into_iter();
        for (typed, meant) in
            [("curent", "current"), ("acelleration", "acceleration"), ("Rampe", "ramp"), ("brkae", "brake")]
        {
            assert_eq!(near(typed, known()), Some(meant), "{typed}");
        }
        for typed in ["ram", "cur", "frobnicate", ""] {
            assert_eq!(near(typed, known()), None, "{typed}");
        }
    }

    #[test]
    fn codes_and_addresses_are_looked_for_as_people_type_them() {
        for text in ["P00-11", "p00.11", "P0.11", "p 00,11", "P0011", "r00:11"] {
            assert_eq!(parse_loose_code(text), Some((0, 11)), "{text}");
        }
        for text in ["", "p", "P00", "P001", "P00110", "00.11", "ramp", "power", "P00.1.1", "päöü", "pééé"] {
            assert_eq!(parse_loose_code(text), None, "{text}");
        }
        for text in ["2103", "2103h", "2103 H", "0x2103", "0x 2103"] {
            assert_eq!(parse_loose_address(text), Some(0x2103), "{text}");
        }
        for text in ["", "210", "21033", "ramp", "+103", "ééé"] {
            assert_eq!(parse_loose_address(text), None, "{text}");
        }
    }

    #[test]
    fn codes_and_addresses_are_read_strictly() {
        assert_eq!(parse_code("P05.06"), Some((5, 6)));
        assert_eq!(parse_code("p10.1"), Some((10, 1)));
        for text in ["05.06", "P05", "P.06", "P05.", "P005.06", "P-1.06", "P05.+6", "P05.06.07"] {
            assert_eq!(parse_code(text), None, "{text}");
        }
        assert_eq!(parse_address("0x3004"), Some(0x3004));
        assert_eq!(parse_address("3004H"), Some(0x3004));
        assert_eq!(parse_address("ah"), Some(0x000A));
        for text in ["3004", "0x", "H", "0x13004", "0x+304", "-4H", "0x30H"] {
            assert_eq!(parse_address(text), None, "{text}");
        }
    }
}
