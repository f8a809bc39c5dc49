//! A table of text as people leave it: as a program wrote it, or as a spreadsheet saved it again.
//!
//! Knows the mark before the text, UTF-16, what divides the cells, rows that hold nothing, and the comma in a number. Where two
//! readings are possible it says so and takes none.

use std::borrow::Cow;
use std::fmt::Display;

/// What may divide cells.
const DIVIDERS: [char; 3] = [',', ';', '\t'];

/// A table: the titles of its columns, and its rows.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Sheet {
    /// The titles, without columns behind the last that has one.
    pub titles: Vec<String>,
    /// The line of the titles, from 1.
    pub line: u64,
    /// Each row that holds something: its line, from 1, and its cells, without the blanks around them. Empty cells behind the last
    /// title are left out; a row may have fewer cells than there are titles, or more.
    pub rows: Vec<(u64, Vec<String>)>,
}

/// Why text is no table.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
#[non_exhaustive]
pub struct SheetError {
    /// The line, from 1.
    pub line: u64,
    /// What is wrong with it, and what would be right.
    pub reason: String,
}

fn wrong<T>(line: u64, reason: impl Display) -> Result<T, SheetError> {
    Err(SheetError { line, reason: reason.to_string() })
}

/// The text in `bytes`: UTF-8, or UTF-16 that has its mark; without the mark.
///
/// # Errors
///
/// [`SheetError`]: it is neither, from this line on.
pub fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, SheetError> {
    let wide = |from: fn([u8; 2]) -> u16| {
        let (pairs, rest) = bytes.as_chunks::<2>();
        let words: Vec<u16> = pairs.iter().skip(1).map(|pair| from(*pair)).collect();
        let text: String = char::decode_utf16(words.iter().copied()).map_while(Result::ok).collect();
        if text.encode_utf16().count() < words.len() || !rest.is_empty() {
            return wrong(lines(&text), "the text is cut off, or no UTF-16 as its mark says; save the file as UTF-8");
        }
        Ok(Cow::Owned(text))
    };
    match bytes {
        [0xFF, 0xFE, ..] => return wide(u16::from_le_bytes),
        [0xFE, 0xFF, ..] => return wide(u16::from_be_bytes),
        _ => {}
    }
    let (text, is_whole) = match str::from_utf8(bytes) {
        Ok(text) => (text, true),
        Err(error) => (str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(), false),
    };
    if let Some((before, _)) = text.split_once('\0') {
        return wrong(lines(before), "there is a zero byte, as in UTF-16 without its mark; save the file as UTF-8");
    }
    if !is_whole {
        return wrong(lines(text), "not UTF-8; save the file in this encoding");
    }
    Ok(Cow::Borrowed(text.strip_prefix('\u{feff}').unwrap_or(text)))
}

/// `bytes` to the last end of a line: what stands behind it was cut off while it was written.
pub fn whole_lines(bytes: &[u8]) -> &[u8] {
    let wide = |end: [u8; 2]| bytes.as_chunks::<2>().0.iter().rposition(|pair| *pair == end).map_or(0, |at| 2 * at + 2);
    let end = match bytes {
        [0xFF, 0xFE, ..] => wide([b'\n', 0]),
        [0xFE, 0xFF, ..] => wide([0, b'\n']),
        _ => bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |at| at + 1),
    };
    &bytes[..end]
}

/// The line in which the text behind `before` begins.
fn lines(before: &str) -> u64 {
    before.bytes().filter(|&byte| byte == b'\n').fold(1, |line, _| line + 1)
}

impl Sheet {
    /// Reads `text`. In a column for which `counts` says so, a decimal comma becomes a point.
    ///
    /// Cells are divided by what a first line such as `sep=;` says, or else by the comma, semicolon or tab that the line of the
    /// titles has most of. Rows that hold nothing are left out.
    ///
    /// # Errors
    ///
    /// [`SheetError`]: it says that something else divides its cells; or a number may mean two things, as 1,234 does where nothing
    /// else in the table has a decimal comma.
    pub fn read(text: &str, counts: impl Fn(&str) -> bool) -> Result<Self, SheetError> {
        let (text, skipped, said) = said(text)?;
        let divider = said.unwrap_or_else(|| divider(text));
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .delimiter(u8::try_from(divider).unwrap_or(b','))
            .from_reader(text.as_bytes());
        let mut sheet = Self { titles: Vec::new(), line: skipped + 1, rows: Vec::new() };
        let (mut line, mut at) = (skipped + 1, 0);
        for record in reader.records() {
            let record = record.or_else(|error| wrong(line, error))?;
            // The reader counts the second half of CRLF to the row behind it.
            let begins = record.position().map_or(at, |place| usize::try_from(place.byte()).unwrap_or(at));
            let before = text.get(at..).unwrap_or_default();
            let ends = text.get(begins..).unwrap_or_default();
            let row = begins + (ends.len() - ends.trim_start_matches(['\r', '\n']).len());
            line += lines(before.get(..row.saturating_sub(at)).unwrap_or_default()) - 1;
            at = row;
            let mut cells: Vec<String> = record.iter().map(str::to_owned).collect();
            if cells.iter().all(String::is_empty) {
                continue;
            }
            if sheet.titles.is_empty() {
                let last = cells.iter().rposition(|cell| !cell.is_empty()).unwrap_or_default();
                cells.truncate(last + 1);
                (sheet.titles, sheet.line) = (cells, line);
            } else {
                while cells.len() > sheet.titles.len() && cells.last().is_some_and(String::is_empty) {
                    cells.pop();
                }
                sheet.rows.push((line, cells));
            }
        }
        sheet.settle(&counts)?;
        Ok(sheet)
    }

    /// Turns decimal commas into points.
    fn settle(&mut self, counts: &impl Fn(&str) -> bool) -> Result<(), SheetError> {
        let numeric: Vec<bool> = self.titles.iter().map(|title| counts(title)).collect();
        let is_numeric = |at: usize| numeric.get(at).copied().unwrap_or(false);
        let mut known: [Option<(u64, String)>; 2] = [None, None];
        for (line, cells) in &self.rows {
            for (_, cell) in cells.iter().enumerate().filter(|(at, _)| is_numeric(*at)) {
                let place = match Written::of(cell) {
                    Written::Comma => 0,
                    Written::Point => 1,
                    _ => continue,
                };
                known[place].get_or_insert_with(|| (*line, cell.clone()));
            }
        }
        let [comma, point] = known;
        for (line, cells) in &mut self.rows {
            for (_, cell) in cells.iter_mut().enumerate().filter(|(at, _)| is_numeric(*at)) {
                if let Some(plain) =
                    plain(cell, comma.as_ref(), point.as_ref()).or_else(|reason| wrong(*line, reason))?
                {
                    *cell = plain;
                }
            }
        }
        Ok(())
    }
}

/// `cell` with a point, where it has a comma; None where it stays. What its neighbours prove stands in `comma` and `point`.
fn plain(cell: &str, comma: Option<&(u64, String)>, point: Option<&(u64, String)>) -> Result<Option<String>, String> {
    let both = |other: &(u64, String)| {
        format!(
            "\"{cell}\", and \"{}\" in line {}: which of the two divides the decimals is not told",
            other.1, other.0
        )
    };
    match (Written::of(cell), comma, point) {
        (Written::Text, ..) | (Written::Point | Written::PointOrThousands, None, _) => Ok(None),
        (Written::Comma, _, None) | (Written::CommaOrThousands, Some(_), None) => Ok(Some(cell.replace(',', "."))),
        (Written::Grouped, ..) => Err(format!("\"{cell}\" has its thousands apart: write the number without that")),
        (Written::Point | Written::PointOrThousands, Some(other), _)
        | (Written::Comma | Written::CommaOrThousands, _, Some(other)) => Err(both(other)),
        (Written::CommaOrThousands, None, None) => {
            let whole = cell.replace(',', "");
            Err(format!("\"{cell}\" may be {} or {whole}: write it as one of them", cell.replace(',', ".")))
        }
    }
}

/// How a cell is written, if it is a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Written {
    /// No number with a comma or a point in it.
    Text,
    /// A decimal comma: `1,5`, `0,125`.
    Comma,
    /// `1,234`.
    CommaOrThousands,
    /// A decimal point.
    Point,
    /// `1.234`.
    PointOrThousands,
    /// `1.234,5`, `1,234,567`.
    Grouped,
}

impl Written {
    fn of(cell: &str) -> Self {
        let digits = cell.strip_prefix(['-', '+']).unwrap_or(cell);
        let parts: Vec<&str> = digits.split([',', '.']).collect();
        let is_number = parts.iter().all(|part| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit()));
        if !is_number || parts.len() == 1 {
            return Self::Text;
        }
        if parts.len() > 2 {
            return Self::Grouped;
        }
        let may_group = parts[1].len() == 3 && parts[0].len() <= 3 && !parts[0].starts_with('0');
        match (digits.contains(','), may_group) {
            (true, true) => Self::CommaOrThousands,
            (true, false) => Self::Comma,
            (false, true) => Self::PointOrThousands,
            (false, false) => Self::Point,
        }
    }
}

/// `text` behind a first line that says what divides its cells: how many lines that took, and the divider.
fn said(text: &str) -> Result<(&str, u64, Option<char>), SheetError> {
    let (first, rest) = text.split_once('\n').unwrap_or((text, ""));
    let first = first.trim_end_matches('\r');
    let bare = first.trim_matches(|letter| letter == '"' || letter == ' ');
    let Some(divider) = bare.get(..4).filter(|start| start.eq_ignore_ascii_case("sep=")).map(|_| &bare[4..]) else {
        return Ok((text, 0, None));
    };
    // A table that was saved once more has its own dividers behind it.
    let mut letters = divider.chars();
    match letters.next() {
        Some(divider)
            if DIVIDERS.contains(&divider) && letters.all(|letter| DIVIDERS.contains(&letter) || letter == '"') =>
        {
            Ok((rest, 1, Some(divider)))
        }
        _ => wrong(1, "what stands behind \"sep=\" is no divider that is known: a comma, a semicolon or a tab"),
    }
}

/// What the first line of `text` that holds something has most of, outside of quotes; a comma where it has none.
fn divider(text: &str) -> char {
    let Some(first) = text.lines().find(|line| !line.trim_matches([',', ';', '\t', ' ', '"']).is_empty()) else {
        return ',';
    };
    let outside: String = first.split('"').step_by(2).collect();
    let count = |divider: char| outside.chars().filter(|&letter| letter == divider).count();
    // Of two that are there as often the earlier one.
    DIVIDERS
        .into_iter()
        .rev()
        .max_by_key(|&divider| count(divider))
        .filter(|&divider| count(divider) > 0)
        .unwrap_or(',')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(text: &str) -> Vec<Vec<String>> {
        let sheet = Sheet::read(text, |title| title != "name").unwrap();
        std::iter::once(sheet.titles).chain(sheet.rows.into_iter().map(|(_, cells)| cells)).collect()
    }

    #[test]
    fn what_a_spreadsheet_does_to_a_table_changes_nothing() {
        let plain = cells("name,low,high\na,0.5,10\n\"b, c\",1.25,\n");
        for text in [
            "name;low;high\r\na;0,5;10\r\nb, c;1,25;\r\n",
            "sep=;\r\nname;low;high\r\na;0,5;10\r\n\"b, c\";1,25;\r\n",
            "\"sep=;\"\r\nname;low;high\r\na;0,5;10\r\n\"b, c\";1,25;\r\n",
            "name\tlow\thigh\na\t0.5\t10\nb, c\t1.25\t\n",
            "name;low;high;;\n;;;;\na;0,5;10;;\n\nb, c;1,25;;;\n;;;;\n   \n",
            "\n;;;;\n\"name\";\"low\";\"high\"\n\"a\";\"0,5\";\"10\"\n\"b, c\";\"1,25\";\"\"\n",
            "name,low,high\na,\"0,5\",10\n\"b, c\",\"1,25\",\n",
        ] {
            assert_eq!(cells(text), plain, "{text}");
        }
    }

    #[test]
    fn a_number_that_may_be_two_is_none() {
        let told = |text: &str| Sheet::read(text, |title| title != "name").unwrap_err();
        assert_eq!(told("name;low\na;1,234\n").reason, "\"1,234\" may be 1.234 or 1234: write it as one of them");
        assert_eq!(told("name;low\n\na;1,234\n").line, 3);
        assert!(told("name;low\na;1,5\nb;2.5\n").reason.contains("\"1,5\", and \"2.5\" in line 3"));
        assert!(told("name;low\na;1,5\nb;1.234\n").reason.contains("\"1.234\", and \"1,5\" in line 2"));
        assert!(told("name;low\na;1.234,5\n").reason.contains("thousands"));
        assert!(told("sep=|\nname|low\n").reason.contains("no divider that is known"));
        // A comma that another number proves, and one that no thousands have.
        assert_eq!(cells("name;low\na;1,234\nb;1,5\n")[1], ["a", "1.234"]);
        assert_eq!(cells("name;low\na;0,125\nb;-12,3456\n")[1..], [["a", "0.125"], ["b", "-12.3456"]]);
        assert_eq!(cells("name;low\na;1.234\n1,234;7\n")[1..], [["a", "1.234"], ["1,234", "7"]]);
    }

    #[test]
    fn text_has_its_mark_or_is_utf_8() {
        let text = "name;unit\r\na;°C\r\n";
        let little: Vec<u8> = "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
        let big: Vec<u8> = "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_be_bytes).collect();
        let marked = format!("\u{feff}{text}");
        for bytes in [text.as_bytes(), marked.as_bytes(), &little, &big] {
            assert_eq!(decode(bytes).unwrap(), text);
        }
        assert!(decode(&little[2..]).unwrap_err().reason.contains("UTF-16 without its mark"));
        assert_eq!(decode(&little[..little.len() - 1]).unwrap_err().line, 2);
        let latin = decode(b"name;unit\r\na;\xB0C\r\n").unwrap_err();
        assert_eq!((latin.line, latin.reason.as_str()), (2, "not UTF-8; save the file in this encoding"));
    }
}
