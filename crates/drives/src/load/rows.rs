//! What the cells of the tables mean: registers, parameters and faults, each row by itself.

use std::collections::BTreeMap;

use super::problems::Problems;
use super::table::{self, Columns, Row};
use super::table_cell;
use super::{File, Files, ProfileError};
use crate::decimal::{Counts, Decimal};
use crate::entry::{Access, Entry, Kind};
use crate::evidence::Evidence;
use crate::parts::fault::Fault;
use crate::place::Place;
use crate::quantity::{Quantity, limits};
use crate::scale::Scale;
use crate::text::{parameter_address, parse_address, parse_code};
use crate::value::to_word;

/// An item and the line it came from.
pub(super) struct Located<T> {
    pub(super) line: u64,
    pub(super) item: T,
}

/// Checks every row of every table by itself.
pub(super) fn check(files: &Files, problems: &mut Problems) {
    if let Some(file) = &files.registers {
        registers(file, problems);
    }
    if let Some(file) = &files.parameters {
        parameters(file, false, problems);
    }
    if let Some(file) = &files.faults {
        faults(file, problems);
    }
}

/// The rows of `registers.csv`.
pub(super) fn registers(file: &File, problems: &mut Problems) -> Vec<Located<Entry>> {
    const COLUMNS: Columns = Columns {
        required: &[
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
        ],
        optional: &["table", "words", "order", "variant"],
    };
    table::read(file, &COLUMNS, problems, |row| {
        let name = row.required("name")?;
        let address = match row.text("address") {
            "" => None,
            text => Some(parse_address(text).ok_or_else(|| {
                row.broken(format!("address \"{text}\" must be hex such as 0x3004, or empty if nobody knows it"))
            })?),
        };
        let table = table_cell::table(row)?;
        let quantity = table_cell::quantity(row, table, quantity(row, None, BTreeMap::new())?)?;
        let place = address.map(|address| Place::new(table, address));
        entry(row, Kind::Register, checked_name(row, name)?, None, place, quantity, None)
    })
}

/// The rows of `parameters.csv`. Where the addresses are `listed`, each row has to say its own.
pub(super) fn parameters(file: &File, listed: bool, problems: &mut Problems) -> Vec<Located<Entry>> {
    const COLUMNS: Columns = Columns {
        required: &[
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
        ],
        optional: &["address", "name", "words", "order"],
    };
    table::read(file, &COLUMNS, problems, |row| {
        let (code, address) = place(row, listed)?;
        let quantity = quantity(row, filled(row.text("low_from")), choices(row)?)?;
        let default = bound(row, "default", &quantity)?;
        if default.is_some_and(|default| !within(&quantity, default)) {
            let range = format!("{} to {}", row.text("low"), row.text("high"));
            return Err(row.broken(format!("\"default\" {} is not in the range {range}", row.text("default"))));
        }
        if let Some((word, label)) = quantity.choices.iter().find(|(word, _)| !within(&quantity, i64::from(**word))) {
            let range = format!("{} to {}", row.text("low"), row.text("high"));
            return Err(row.broken(format!("choice {word} ({label}) is not in the range {range}")));
        }
        let default = default.map(to_word);
        let alias = match row.text("name") {
            "" => None,
            name => Some(checked_name(row, name)?),
        };
        entry(row, Kind::Parameter, code, alias, Some(address.into()), quantity, default)
    })
}

/// The code of a parameter and its address: the one that the row says, or the one that follows from the code.
fn place(row: &Row<'_>, listed: bool) -> Result<(String, u16), ProfileError> {
    let code = row.required("code")?;
    let address = match row.text("address") {
        "" if listed => {
            let reason = format!("\"address\" is empty; with address = \"listed\" each row says where {code} is");
            return Err(row.broken(reason));
        }
        "" => None,
        text => Some(
            parse_address(text)
                .ok_or_else(|| row.broken(format!("address \"{text}\" must be hex such as 0x0200 or 0200H")))?,
        ),
    };
    match (parse_code(code), address) {
        (Some((group, index)), _) if !listed => {
            let letter = if code.starts_with(['r', 'R']) { 'r' } else { 'P' };
            let address = address.unwrap_or_else(|| parameter_address(group, index));
            Ok((format!("{letter}{group:02}.{index:02}"), address))
        }
        (_, Some(address)) if is_code(code) => Ok((code.to_owned(), address)),
        (_, Some(_)) => {
            let letters = "2 to 16 letters and digits, with . - or _ between them, and at most one dot";
            Err(row.broken(format!("code \"{code}\" must be {letters}, and no address")))
        }
        (_, None) => {
            let reason = format!("code \"{code}\" must be like P05.06; of any other the row must say the \"address\"");
            Err(row.broken(reason))
        }
    }
}

/// Whether `text` can be the code of a parameter whose address does not follow from it: `C1-01`, `22.02`, `ACC`.
///
/// In a backup it is a key of TOML, in which a dot divides.
fn is_code(text: &str) -> bool {
    let inner = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'_');
    let bytes = text.as_bytes();
    (2..=16).contains(&bytes.len())
        && bytes.iter().all(|&byte| inner(byte))
        && [bytes.first(), bytes.last()].into_iter().flatten().all(u8::is_ascii_alphanumeric)
        && text.matches('.').nth(1).is_none()
        && parse_address(text).is_none()
}

/// The rows of `faults.csv`.
pub(super) fn faults(file: &File, problems: &mut Problems) -> BTreeMap<u16, Fault> {
    const COLUMNS: Columns = Columns {
        required: &["code", "mnemonic", "label", "cause", "remedy", "verified", "note", "source"],
        optional: &[],
    };
    let mut faults = BTreeMap::new();
    table::read(file, &COLUMNS, problems, |row| {
        let code = row.required("code")?;
        let code: u16 = code.parse().map_err(|_| row.broken(format!("code \"{code}\" must be 0 to 65535")))?;
        let (evidence, note, source) = evidence(row)?;
        let fault = Fault {
            code,
            mnemonic: row.text("mnemonic").to_owned(),
            label: row.required("label")?.to_owned(),
            cause: row.text("cause").to_owned(),
            remedy: row.text("remedy").to_owned(),
            evidence,
            note,
            source,
        };
        match faults.insert(code, fault) {
            None => Ok(()),
            Some(_) => Err(row.broken(format!("fault {code} is there twice"))),
        }
    });
    faults
}

/// How well a row is documented: its evidence, its note and its source. What is not verified says why.
fn evidence(row: &Row<'_>) -> Result<(Evidence, String, String), ProfileError> {
    let cell = row.required("verified")?;
    let evidence = Evidence::ALL
        .into_iter()
        .find(|known| known.cell() == cell)
        .ok_or_else(|| row.broken(format!("\"verified\" is \"{cell}\" and must be yes, no or assumed")))?;
    let (note, source) = (row.text("note"), row.text("source"));
    if evidence != Evidence::Verified && note.is_empty() {
        return Err(row.broken(format!("\"note\" is empty; where \"verified\" is {cell} it says what is missing")));
    }
    if evidence != Evidence::Assumed && source.is_empty() {
        return Err(row.broken("\"source\" is empty; name the document and the page, or say that the row is assumed"));
    }
    Ok((evidence, note.to_owned(), source.to_owned()))
}

/// `name`, if it can be one: it is told from codes (`P00.11`) and addresses (`3004H`) by its letters.
fn checked_name(row: &Row<'_>, name: &str) -> Result<String, ProfileError> {
    if is_snake_case(name) {
        Ok(name.to_owned())
    } else {
        Err(row.broken(format!("name \"{name}\" must be lower-case letters, digits and _, a letter first")))
    }
}

/// The cells that registers and parameters share.
fn entry(
    row: &Row<'_>,
    kind: Kind,
    name: String,
    alias: Option<String>,
    place: Option<Place>,
    quantity: Quantity,
    default: Option<u16>,
) -> Result<Located<Entry>, ProfileError> {
    let access = row.required("access")?;
    let access = Access::ALL.into_iter().find(|known| known.name() == access).ok_or_else(|| {
        row.broken(format!("access \"{access}\" must be {}", Access::ALL.map(Access::name).join(", ")))
    })?;
    if quantity.wide && access != Access::Ro && kind == Kind::Register {
        return Err(row.broken("a register of two words can only be read: its \"access\" must be ro"));
    }
    if quantity.wide && place.is_some_and(|place| place.address == u16::MAX) {
        return Err(row.broken("a value of two words does not fit at the last address"));
    }
    let (evidence, note, source) = evidence(row)?;
    let item = Entry {
        name,
        alias,
        kind,
        place,
        label: row.required("label")?.to_owned(),
        quantity,
        bits: Vec::new(),
        access,
        default,
        evidence,
        note,
        source,
        listed: true,
    };
    Ok(Located { line: row.line(), item })
}

/// Unit, scale and range.
fn quantity(row: &Row<'_>, low_from: Option<String>, choices: BTreeMap<u16, String>) -> Result<Quantity, ProfileError> {
    let variant = filled(row.text("variant"));
    if variant.is_some() {
        if ["unit", "scale", "low", "high", "high_from"].iter().any(|column| !row.text(column).is_empty()) {
            let reason = "where there is a \"variant\", it says unit, scale and range: leave those cells empty";
            return Err(row.broken(reason));
        }
        if row.text("words") == "2" {
            return Err(row.broken("what has a \"variant\" has one word"));
        }
    }
    let scale = match row.text("scale") {
        "" => None,
        text => Some(Scale::parse(text).ok_or_else(|| {
            let right = "1, 10, 100, 1000 or 10000, a ratio such as 16384/100, or empty if unknown";
            row.broken(format!("scale \"{text}\" must be {right}"))
        })?),
    };
    let wide = match row.text("words") {
        "" | "1" => false,
        "2" => true,
        other => return Err(row.broken(format!("\"words\" is \"{other}\" and must be 1 or 2"))),
    };
    let mut quantity = Quantity {
        unit: row.text("unit").to_owned(),
        scale,
        signed: row.flag("signed")?,
        wide,
        high_first: high_first(row, wide)?,
        low: None,
        high: None,
        low_from,
        high_from: filled(row.text("high_from")),
        choices,
        variant,
    };
    quantity.low = bound(row, "low", &quantity)?;
    quantity.high = bound(row, "high", &quantity)?;
    match (quantity.low, quantity.high) {
        (Some(low), Some(high)) if low > high => {
            Err(row.broken(format!("\"low\" {} is above \"high\" {}", row.text("low"), row.text("high"))))
        }
        _ => Ok(quantity),
    }
}

/// Which of two words comes first.
fn high_first(row: &Row<'_>, wide: bool) -> Result<bool, ProfileError> {
    match row.text("order") {
        "" => Ok(false),
        order if !wide => {
            Err(row.broken(format!("\"order\" is \"{order}\", and only two words have an order: leave it empty")))
        }
        "low first" => Ok(false),
        "high first" => Ok(true),
        other => Err(row.broken(format!("\"order\" is \"{other}\" and must be low first or high first"))),
    }
}

/// Whether the range of `quantity`, as far as it is known, holds `count`.
fn within(quantity: &Quantity, count: i64) -> bool {
    quantity.low.is_none_or(|low| low <= count) && quantity.high.is_none_or(|high| count <= high)
}

fn bound(row: &Row<'_>, column: &str, quantity: &Quantity) -> Result<Option<i64>, ProfileError> {
    match row.text(column) {
        "" => Ok(None),
        text => count(row, column, text, quantity).map(Some),
    }
}

/// The counts that `text` means: a value in the quantity's unit, or hex. It must fit the word.
fn count(row: &Row<'_>, column: &str, text: &str, quantity: &Quantity) -> Result<i64, ProfileError> {
    let counts = match parse_address(text) {
        Some(word) => Some(Counts::Whole(i64::from(word))),
        None => Decimal::parse(text).map(|number| quantity.counts_of(&number)),
    };
    let (least, most) = limits(quantity.signed, quantity.wide);
    match counts {
        Some(Counts::Whole(count)) if (least..=most).contains(&count) => Ok(count),
        Some(Counts::Whole(_) | Counts::FarBelow | Counts::FarAbove) => {
            Err(row.broken(format!("\"{column}\" {text} does not fit a word with this scale and sign")))
        }
        Some(Counts::Above(_)) => Err(row.broken(format!("\"{column}\" {text} has more digits than the scale"))),
        None => Err(row.broken(format!("\"{column}\" is \"{text}\", which is not a number"))),
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
        if label
            .split(',')
            .skip(1)
            .any(|part| part.split_once('=').is_some_and(|(word, _)| word.trim().parse::<u16>().is_ok()))
        {
            return Err(row.broken(format!("choice \"{choice}\" holds another one: divide choices by semicolons")));
        }
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
