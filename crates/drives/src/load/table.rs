//! CSV files: rows of named cells, each row with its line.
//!
//! Knows columns by name, in any order; knows nothing of what a cell means.

use csv::StringRecord;

use super::problems::Problems;
use super::{File, ProfileError};
use crate::text::closest;

/// Most rows of one table.
const MOST_ROWS: usize = 10_000;
/// Most characters in a cell.
const MOST_CHARACTERS: usize = 400;

/// The columns that a table must have, and those that it may have.
pub(super) struct Columns {
    pub(super) required: &'static [&'static str],
    pub(super) optional: &'static [&'static str],
}

/// One row of a table.
pub(super) struct Row<'a> {
    file: &'a File,
    headers: &'a StringRecord,
    cells: StringRecord,
    line: u64,
}

/// Reads `file`, which must have `columns`, and makes an item of every row. Rows that are broken are left out.
pub(super) fn read<T>(
    file: &File,
    columns: &Columns,
    problems: &mut Problems,
    mut item: impl FnMut(&Row<'_>) -> Result<T, ProfileError>,
) -> Vec<T> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file.text().as_bytes());
    let Some(headers) = problems.keep(headers(file, columns, &mut reader)) else { return Vec::new() };
    let mut items = Vec::new();
    for (index, record) in reader.records().enumerate() {
        let row = record.map_err(|error| broken(file, &error)).and_then(|cells| {
            let line = cells.position().map_or(1, csv::Position::line);
            let row = Row { file, headers: &headers, cells, line };
            row.check_length()?;
            if index >= MOST_ROWS {
                return Err(row.broken(format!("the table has more than {MOST_ROWS} rows")));
            }
            item(&row)
        });
        items.extend(problems.keep(row));
        if index >= MOST_ROWS {
            break;
        }
    }
    items
}

fn headers(file: &File, columns: &Columns, reader: &mut csv::Reader<&[u8]>) -> Result<StringRecord, ProfileError> {
    let headers = reader.headers().map_err(|error| broken(file, &error))?.clone();
    let all = || columns.required.iter().chain(columns.optional);
    let only = if headers.len() == 1 { &headers[0] } else { "" };
    if let Some(divider) = only.chars().find(|letter| [';', '\t'].contains(letter)) {
        let by = if divider == ';' { "semicolons" } else { "tabs" };
        return Err(file.broken(1, format!("the columns are divided by {by}; save the table with commas between them")));
    }
    // A file that is no such table may be anybody's: nothing of it is repeated.
    let known = headers.iter().filter(|header| all().any(|column| column == header)).count();
    if known < 2 || 2 * known < headers.len() {
        let columns = columns.required.join(", ");
        return Err(
            file.broken(1, format!("this is not such a table: its first line has to name its columns, {columns}"))
        );
    }
    if let Some(surplus) = headers.iter().find(|header| !all().any(|known| known == header)) {
        let closest = closest(surplus, all().copied()).unwrap_or_default();
        return Err(file.broken(1, format!("unknown column \"{surplus}\"; the closest is \"{closest}\"")));
    }
    let times = |column: &str| headers.iter().filter(|&header| header == column).count();
    if let Some(missing) = columns.required.iter().find(|&&column| times(column) == 0) {
        return Err(file.broken(1, format!("column \"{missing}\" is missing")));
    }
    if let Some(twice) = all().find(|&&column| times(column) > 1) {
        return Err(file.broken(1, format!("column \"{twice}\" is there twice")));
    }
    Ok(headers)
}

/// What the CSV reader has against `file`.
fn broken(file: &File, error: &csv::Error) -> ProfileError {
    let line = error.position().map_or(1, csv::Position::line);
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => file
            .broken(line, format!("{len} cells where the first line has {expected_len}; quote cells that hold commas")),
        _ => file.broken(line, error.to_string()),
    }
}

impl Row<'_> {
    /// The cell in `column`; may be empty.
    pub(super) fn text(&self, column: &str) -> &str {
        let index = self.headers.iter().position(|header| header == column);
        index.and_then(|index| self.cells.get(index)).unwrap_or_default()
    }

    /// The cell in `column`, which must not be empty.
    pub(super) fn required(&self, column: &str) -> Result<&str, ProfileError> {
        match self.text(column) {
            "" => Err(self.broken(format!("\"{column}\" is empty"))),
            text => Ok(text),
        }
    }

    /// The cell in `column`: `yes` or `no`.
    pub(super) fn flag(&self, column: &str) -> Result<bool, ProfileError> {
        match self.text(column) {
            "yes" => Ok(true),
            "no" => Ok(false),
            other => Err(self.broken(format!("\"{column}\" is \"{other}\" and must be yes or no"))),
        }
    }

    /// The line, from 1, in which the row begins.
    pub(super) fn line(&self) -> u64 {
        self.line
    }

    /// The error that this row causes.
    pub(super) fn broken(&self, reason: impl Into<String>) -> ProfileError {
        self.file.broken(self.line, reason)
    }

    fn check_length(&self) -> Result<(), ProfileError> {
        let long = self.headers.iter().zip(&self.cells).find(|(_, cell)| cell.chars().count() > MOST_CHARACTERS);
        long.map_or(Ok(()), |(column, cell)| {
            let length = cell.chars().count();
            Err(self.broken(format!("\"{column}\" has {length} characters; {MOST_CHARACTERS} are the most")))
        })
    }
}
