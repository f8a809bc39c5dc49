//! CSV files: rows of named cells, each row with its line.
//!
//! Knows columns by name, in any order; knows nothing of what a cell means.

use csv::StringRecord;

use super::{File, ProfileError};

/// One row of a table.
pub(super) struct Row<'a> {
    file: &'a File,
    headers: &'a StringRecord,
    cells: StringRecord,
    line: u64,
}

/// Reads `file`, which must have exactly `columns`, and makes an item of every row.
pub(super) fn read<T>(
    file: &File,
    columns: &[&str],
    mut item: impl FnMut(&Row<'_>) -> Result<T, ProfileError>,
) -> Result<Vec<T>, ProfileError> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file.text().as_bytes());
    let headers = reader.headers().map_err(|error| broken(file, &error))?.clone();
    if let Some(surplus) = headers.iter().find(|header| !columns.contains(header)) {
        return Err(file.broken(1, format!("unknown column \"{surplus}\"; the columns are {}", columns.join(", "))));
    }
    if let Some(missing) =
        columns.iter().find(|&&column| headers.iter().filter(|&header| header == column).count() != 1)
    {
        return Err(file.broken(1, format!("column \"{missing}\" must be there once")));
    }
    reader
        .records()
        .map(|record| {
            let cells = record.map_err(|error| broken(file, &error))?;
            let line = cells.position().map_or(1, csv::Position::line);
            item(&Row { file, headers: &headers, cells, line })
        })
        .collect()
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
}
