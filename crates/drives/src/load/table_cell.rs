//! The cell `table` of a row of registers: which of the drive's tables the row is in, and what that says of the rest of it.

use super::ProfileError;
use super::table::Row;
use crate::place::Table;
use crate::quantity::Quantity;
use crate::scale::Scale;

/// The table that `row` is in.
pub(super) fn table(row: &Row<'_>) -> Result<Table, ProfileError> {
    let table = match row.text("table") {
        "" => Table::Holding,
        text => Table::named(text).ok_or_else(|| {
            let known = Table::ALL.map(Table::name).join(", ");
            row.broken(format!("table \"{text}\" must be one of {known}, or empty for holding"))
        })?,
    };
    let access = row.text("access");
    if table.written_by().is_empty() && access != "ro" {
        let reason = format!("table \"{}\" is only read: its \"access\" is {access} and must be ro", table.name());
        return Err(row.broken(reason));
    }
    Ok(table)
}

/// `quantity` as it is in `table`: a bit is 0 or 1, and nothing else.
pub(super) fn quantity(row: &Row<'_>, table: Table, quantity: Quantity) -> Result<Quantity, ProfileError> {
    if !table.is_bits() {
        return Ok(quantity);
    }
    let is_plain = quantity.unit.is_empty()
        && quantity.scale.is_none_or(|scale| scale == Scale::ONE)
        && quantity.high_from.is_none();
    if !is_plain || quantity.signed || quantity.wide || quantity.variant.is_some() {
        return Err(row.broken("a bit has no unit, scale, sign, variant or second word: leave those cells empty"));
    }
    Ok(Quantity { scale: Some(Scale::ONE), low: Some(0), high: Some(1), ..quantity })
}
