//! CSV files: rows of named cells, each row with its line.
//!
//! Knows columns by name, in any order; knows nothing of what a cell means.

use super::problems::Problems;
use super::{File, ProfileError};
use crate::sheet::Sheet;
use crate::text::closest;

/// Most rows of one table.
const MOST_ROWS: usize = 10_000;
/// Most characters in a cell.
const MOST_CHARACTERS: usize = 400;
/// Columns that hold numbers with decimals.
const COUNTED: [&str; 3] = ["low", "high", "default"];

/// The columns that a table must have, and those that it may have.
pub(super) struct Columns {
    pub(super) required: &'static [&'static str],
    pub(super) optional: &'static [&'static str],
}

/// One row of a table.
pub(super) struct Row<'a> {
    file: &'a File,
    headers: &'a [String],
    cells: Vec<String>,
    line: u64,
}

/// Reads `file`, which must have `columns`, and makes an item of every row. Rows that are broken are left out.
pub(super) fn read<T>(
    file: &File,
    columns: &Columns,
    problems: &mut Problems,
    mut item: impl FnMut(&Row<'_>) -> Result<T, ProfileError>,
) -> Vec<T> {
    let sheet = Sheet::read(file.text(), |title| COUNTED.contains(&title));
    let Some(sheet) = problems.keep(sheet.map_err(|error| file.broken(error.line, error.reason))) else {
        return Vec::new();
    };
    let Some(()) = problems.keep(headers(file, columns, &sheet)) else { return Vec::new() };
    let mut items = Vec::new();
    for (index, (line, cells)) in sheet.rows.into_iter().enumerate() {
        let row = Row { file, headers: &sheet.titles, cells, line };
        let row = row.check_length(index).and_then(|()| item(&row));
        items.extend(problems.keep(row));
        if index >= MOST_ROWS {
            break;
        }
    }
    items
}

fn headers(file: &File, columns: &Columns, sheet: &Sheet) -> Result<(), ProfileError> {
    let (headers, line) = (&sheet.titles, sheet.line);
    let all = || columns.required.iter().chain(columns.optional);
    // A file that is no such table may be anybody's: nothing of it is repeated.
    let known = headers.iter().filter(|header| all().any(|column| column == header)).count();
    if known < 2 || 2 * known < headers.len() {
        let columns = columns.required.join(", ");
        return Err(
            file.broken(line, format!("this is not such a table: its first line has to name its columns, {columns}"))
        );
    }
    if let Some(surplus) = headers.iter().find(|header| !all().any(|known| known == header)) {
        let closest = closest(surplus, all().copied()).unwrap_or_default();
        return Err(file.broken(line, format!("unknown column \"{surplus}\"; the closest is \"{closest}\"")));
    }
    let times = |column: &str| headers.iter().filter(|&header| header == column).count();
    if let Some(missing) = columns.required.iter().find(|&&column| times(column) == 0) {
        return Err(file.broken(line, format!("column \"{missing}\" is missing")));
    }
    if let Some(twice) = all().find(|&&column| times(column) > 1) {
        return Err(file.broken(line, format!("column \"{twice}\" is there twice")));
    }
    Ok(())
}

impl Row<'_> {
    /// The cell in `column`; may be empty.
    pub(super) fn text(&self, column: &str) -> &str {
        let index = self.headers.iter().position(|header| header == column);
        index.and_then(|index| self.cells.get(index)).map_or("", String::as_str)
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

    /// Refuses the row at `index` where it, or one of its cells, is too long or too short.
    fn check_length(&self, index: usize) -> Result<(), ProfileError> {
        if index >= MOST_ROWS {
            return Err(self.broken(format!("the table has more than {MOST_ROWS} rows")));
        }
        let (cells, titles) = (self.cells.len(), self.headers.len());
        if cells != titles {
            let reason = format!("{cells} cells where the first line has {titles}; quote cells that hold commas");
            return Err(self.broken(reason));
        }
        let long = self.headers.iter().zip(&self.cells).find(|(_, cell)| cell.chars().count() > MOST_CHARACTERS);
        long.map_or(Ok(()), |(column, cell)| {
            let length = cell.chars().count();
            Err(self.broken(format!("\"{column}\" has {length} characters; {MOST_CHARACTERS} are the most")))
        })
    }
}
