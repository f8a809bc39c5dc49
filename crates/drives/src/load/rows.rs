//! What the cells of the tables mean: registers, parameters and faults, each row by itself.

use std::collections::BTreeMap;

use super::table::{self, Row};
use super::{File, ProfileError};
use crate::decimal::{Counts, Decimal};
use crate::entry::{Access, Entry, Kind};
use crate::fault::Fault;
use crate::lookup::{parameter_address, parse_address, parse_code};
use crate::quantity::{Quantity, to_word, word_limits};

/// An item and the line it came from.
pub(super) struct Located<T> {
    pub(super) line: u64,
    pub(super) item: T,
}

/// The rows of `registers.csv`.
pub(super) fn registers(file: &File) -> Result<Vec<Located<Entry>>, ProfileError> {
    const COLUMNS: [&str; 13] = [
        "address",
        "name",
        "label",
        "unit",
        "scale",
        "signed",
        "low",
        "high",
        "high_from",
        "access",
        "verified",
        "note",
        "source",
    ];
    table::read(file, &COLUMNS, |row| {
        let address = row.required("address")?;
        let address = parse_address(address)
            .ok_or_else(|| row.broken(format!("address \"{address}\" must be hex such as 0x3004")))?;
        let name = row.required("name")?;
        if !is_snake_case(name) {
            return Err(row.broken(format!("name \"{name}\" must be lower-case letters, digits and _, a letter first")));
        }
        let quantity = quantity(row, None, BTreeMap::new())?;
        entry(row, Kind::Register, name.to_owned(), address, quantity, None)
    })
}

/// The rows of `parameters.csv`.
pub(super) fn parameters(file: &File) -> Result<Vec<Located<Entry>>, ProfileError> {
    const COLUMNS: [&str; 15] = [
        "code",
        "label",
        "unit",
        "scale",
        "signed",
        "low",
        "low_from",
        "high",
        "high_from",
        "default",
        "access",
        "choices",
        "verified",
        "note",
        "source",
    ];
    table::read(file, &COLUMNS, |row| {
        let code = row.required("code")?;
        let (group, index) =
            parse_code(code).ok_or_else(|| row.broken(format!("code \"{code}\" must be like P05.06")))?;
        let quantity = quantity(row, filled(row.text("low_from")), choices(row)?)?;
        let default = match row.text("default") {
            "" => None,
            text => Some(to_word(i64::from(count(row, "default", text, &quantity)?))),
        };
        let name = format!("P{group:02}.{index:02}");
        entry(row, Kind::Parameter, name, parameter_address(group, index), quantity, default)
    })
}

/// The rows of `faults.csv`.
pub(super) fn faults(file: &File) -> Result<BTreeMap<u16, Fault>, ProfileError> {
    const COLUMNS: [&str; 8] = ["code", "mnemonic", "label", "cause", "remedy", "verified", "note", "source"];
    let mut faults = BTreeMap::new();
    table::read(file, &COLUMNS, |row| {
        let code = row.required("code")?;
        let code: u16 = code.parse().map_err(|_| row.broken(format!("code \"{code}\" must be 0 to 65535")))?;
        let fault = Fault {
            code,
            mnemonic: row.text("mnemonic").to_owned(),
            label: row.required("label")?.to_owned(),
            cause: row.text("cause").to_owned(),
            remedy: row.text("remedy").to_owned(),
            verified: row.flag("verified")?,
            note: row.text("note").to_owned(),
            source: row.required("source")?.to_owned(),
        };
        match faults.insert(code, fault) {
            None => Ok(()),
            Some(_) => Err(row.broken(format!("fault {code} is there twice"))),
        }
    })?;
    Ok(faults)
}

/// The cells that registers and parameters share.
fn entry(
    row: &Row<'_>,
    kind: Kind,
    name: String,
    address: u16,
    quantity: Quantity,
    default: Option<u16>,
) -> Result<Located<Entry>, ProfileError> {
    let access = row.required("access")?;
    let access = Access::ALL.into_iter().find(|known| known.name() == access).ok_or_else(|| {
        row.broken(format!("access \"{access}\" must be {}", Access::ALL.map(Access::name).join(", ")))
    })?;
    let item = Entry {
        name,
        kind,
        address,
        label: row.required("label")?.to_owned(),
        quantity,
        bits: Vec::new(),
        access,
        default,
        verified: row.flag("verified")?,
        note: row.text("note").to_owned(),
        source: row.required("source")?.to_owned(),
    };
    Ok(Located { line: row.line(), item })
}

/// Unit, scale and range.
fn quantity(row: &Row<'_>, low_from: Option<String>, choices: BTreeMap<u16, String>) -> Result<Quantity, ProfileError> {
    let decimals = match row.text("scale") {
        "" => None,
        "1" => Some(0),
        "10" => Some(1),
        "100" => Some(2),
        "1000" => Some(3),
        "10000" => Some(4),
        other => {
            return Err(row.broken(format!("scale \"{other}\" must be 1, 10, 100, 1000 or 10000, or empty if unknown")));
        }
    };
    let mut quantity = Quantity {
        unit: row.text("unit").to_owned(),
        decimals,
        signed: row.flag("signed")?,
        low: None,
        high: None,
        low_from,
        high_from: filled(row.text("high_from")),
        choices,
    };
    quantity.low = bound(row, "low", &quantity)?;
    quantity.high = bound(row, "high", &quantity)?;
    match (quantity.low, quantity.high) {
        (Some(low), Some(high)) if low > high => Err(row.broken("\"low\" is above \"high\"")),
        _ => Ok(quantity),
    }
}

fn bound(row: &Row<'_>, column: &str, quantity: &Quantity) -> Result<Option<i32>, ProfileError> {
    match row.text(column) {
        "" => Ok(None),
        text => count(row, column, text, quantity).map(Some),
    }
}

/// The counts that `text` means: a value in the quantity's unit, or hex. It must fit the word.
fn count(row: &Row<'_>, column: &str, text: &str, quantity: &Quantity) -> Result<i32, ProfileError> {
    let counts = match parse_address(text) {
        Some(word) => Some(Counts::Whole(i64::from(word))),
        None => Decimal::parse(text).map(|number| number.counts(quantity.decimals())),
    };
    let (least, most) = word_limits(quantity.signed);
    match counts {
        Some(Counts::Whole(count)) => i32::try_from(count)
            .ok()
            .filter(|count| (least..=most).contains(count))
            .ok_or_else(|| row.broken(format!("\"{column}\" {text} does not fit a word with this scale and sign"))),
        Some(Counts::Above(_)) => Err(row.broken(format!("\"{column}\" {text} has more digits than the scale"))),
        Some(Counts::FarBelow | Counts::FarAbove) => {
            Err(row.broken(format!("\"{column}\" {text} does not fit a word with this scale and sign")))
        }
        None => Err(row.broken(format!("\"{column}\" is \"{text}\", which is no number"))),
    }
}

/// The choices: `0=off;1=on`.
fn choices(row: &Row<'_>) -> Result<BTreeMap<u16, String>, ProfileError> {
    let mut choices = BTreeMap::new();
    for choice in row.text("choices").split(';').filter(|choice| !choice.is_empty()) {
        let parsed = choice.split_once('=').and_then(|(word, label)| Some((word.trim().parse().ok()?, label.trim())));
        let Some((word, label)) = parsed.filter(|(_, label)| !label.is_empty()) else {
            return Err(row.broken(format!("choice \"{choice}\" must be like 2=communication")));
        };
        if choices.insert(word, label.to_owned()).is_some() {
            return Err(row.broken(format!("choice {word} is there twice")));
        }
    }
    // A person who types such a label would get another choice than one who means the number.
    let misleading = |(word, label): &(&u16, &String)| {
        label.parse().is_ok_and(|number| number != **word && choices.contains_key(&number))
    };
    if let Some((word, label)) = choices.iter().find(misleading) {
        return Err(row.broken(format!("choice {word} is labelled \"{label}\", the number of another choice")));
    }
    Ok(choices)
}

fn filled(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}

/// Whether `name` can be a register's name: it is told from codes (`P00.11`) and addresses (`3004H`) by its letters.
fn is_snake_case(name: &str) -> bool {
    let mut bytes = name.bytes();
    bytes.next().is_some_and(|first| first.is_ascii_lowercase())
        && bytes.all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
        && parse_address(name).is_none()
}
