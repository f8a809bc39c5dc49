//! The tables of `profile.toml` that stand by themselves or name parameters: each read and checked.

use std::collections::BTreeMap;
use std::time::Duration;

use super::entries::Entries;
use super::manifest::{self, Field, Manifest, line};
use super::placed::Placed;
use super::problems::Problems;
use super::{File, ProfileError};
use crate::bits::BitField;
use crate::decimal::{Counts, Decimal};
use crate::parts::called::{Alias, Called};
use crate::parts::command::{Control, OtherWords};
use crate::parts::fault::{Exception, Means};
use crate::parts::identification::{Identification, Signature};
use crate::parts::memory::{Memory, StoreWord, ToldBy};
use crate::parts::serial::SerialDefaults;
use crate::parts::variant::{Share, Variant, VariantChoice};
use crate::parts::watchdog::Watchdog;
use crate::place::Place;
use crate::profile::Profile;
use crate::quantity::{Quantity, limits};
use crate::scale::Scale;
use crate::text::parse_place;

/// By the specification the code by which a unit says that it took a request. Families that list it mean something else.
const ACKNOWLEDGE: u8 = 0x05;

/// Checks that `low` ≤ `item` ≤ `high`.
pub(super) fn within<T>(file: &File, item: &Placed<T>, low: T, high: T, what: &str) -> Result<T, ProfileError>
where
    T: Copy + PartialOrd + std::fmt::Display,
{
    let value = *item.get_ref();
    if low <= value && value <= high {
        Ok(value)
    } else {
        Err(file.broken(line(file, item), format!("{what} is {value} and must be {low} to {high}")))
    }
}

/// Checks that `quantity` takes `value`, and returns its word.
pub(super) fn check(file: &File, line: u64, quantity: &Quantity, name: &str, value: i64) -> Result<u16, ProfileError> {
    quantity.encode(name, &value.into()).map_err(|error| file.broken(line, error.to_string()))
}

pub(super) fn serial(file: &File, serial: &manifest::Serial) -> Result<SerialDefaults, ProfileError> {
    let format = serial.format.get_ref();
    let (data_bits, parity, stop_bits) = SerialDefaults::parse_format(format).ok_or_else(|| {
        file.broken(
            line(file, &serial.format),
            format!("format \"{format}\" must be like 8E1; Modbus RTU has 8 data bits"),
        )
    })?;
    Ok(SerialDefaults {
        baud_rate: within(file, &serial.baud_rate, 50, 10_000_000, "baud_rate")?,
        data_bits,
        parity,
        stop_bits,
        unit: serial.unit.as_ref().map(|unit| within(file, unit, 1, 247, "unit")).transpose()?,
        response_delay: Duration::from_millis(serial.response_delay_ms.into()),
        verified: serial.verified,
        source: serial.source.clone(),
    })
}

pub(super) fn memory(file: &File, spanned: &Placed<manifest::Memory>) -> Result<Memory, ProfileError> {
    let row = spanned.get_ref();
    if !row.verified && row.note.is_empty() {
        return Err(
            file.broken(line(file, spanned), "a memory rule that is not verified needs a \"note\" that says why")
        );
    }
    let told_by = match (&row.bit, row.means, &row.store) {
        (Some(bit), Some(means), None) => ToldBy::Bit { bit: within(file, bit, 8, 15, "bit")?, means },
        (None, None, Some(store)) => {
            ToldBy::Word(StoreWord { register: store.register.get_ref().clone(), word: store.word, idle: store.idle })
        }
        _ => {
            let reason = "a memory rule has either \"bit\" and \"means\", or \"store\"";
            return Err(file.broken(line(file, spanned), reason));
        }
    };
    Ok(Memory { told_by, verified: row.verified, note: row.note.clone(), source: row.source.clone() })
}

pub(super) fn identifications(
    file: &File,
    rows: &[Placed<manifest::IdentificationCode>],
    problems: &mut Problems,
) -> Vec<Identification> {
    let mut known: Vec<Identification> = Vec::new();
    for spanned in rows {
        let row = spanned.get_ref();
        if known.iter().any(|other| other.code == row.code) {
            problems.add(file, line(file, spanned), format!("code {:04X}H is there twice", row.code));
            continue;
        }
        known.push(Identification {
            code: row.code,
            family: row.family.clone(),
            title: row.title.clone(),
            shared: row.shared.clone(),
            verified: row.verified,
            note: row.note.clone(),
            source: row.source.clone(),
        });
    }
    known
}

/// What its drives are called: of a profile that adds to another, what that one says where it says nothing itself. A sister
/// family has names of its own.
pub(super) fn called(manifest: &Manifest, base: Option<&Profile>) -> Called {
    let below = base.map(|base| &base.called);
    let same = below.filter(|_| manifest.overlay.is_some());
    let models = manifest.models.as_ref().map(|names| names.iter().map(|name| name.get_ref().clone()).collect());
    let aliases = manifest.aliases.as_ref().map(|rows| {
        let alias = |row: &Placed<manifest::Alias>| {
            let manifest::Alias { name, note, source } = row.get_ref();
            Alias { name: name.clone(), note: note.clone(), source: source.clone() }
        };
        rows.iter().map(alias).collect()
    });
    Called {
        maker: manifest
            .maker
            .as_ref()
            .map(|maker| maker.get_ref().clone())
            .or_else(|| Some(below?.maker.clone()))
            .unwrap_or_default(),
        models: models.or_else(|| Some(same?.models.clone())).unwrap_or_default(),
        aliases: aliases.or_else(|| Some(same?.aliases.clone())).unwrap_or_default(),
    }
}

/// A signature names its words, or gives their addresses: what a unit refuses is nothing that its profile has.
pub(super) fn signature(
    file: &File,
    entries: &Entries,
    row: &manifest::Signature,
    problems: &mut Problems,
) -> Option<Signature> {
    let mut places = |names: &[Placed<String>]| -> Vec<Place> {
        let place = |name: &Placed<String>| match parse_place(name.get_ref()) {
            Some(place) => Some(place),
            None => entries.get(file, name, problems)?.place,
        };
        names.iter().filter_map(place).collect()
    };
    let (answers, refuses) = (places(&row.answers), places(&row.refuses));
    (!answers.is_empty()).then_some(Signature { answers, refuses })
}

pub(super) fn control(
    file: &File,
    entries: &Entries,
    rows: &[Placed<manifest::Control>],
    problems: &mut Problems,
) -> Vec<Control> {
    let mut known = Vec::new();
    for spanned in rows {
        let row = spanned.get_ref();
        let place = spanned.beside(row.code.clone());
        let Some(entry) = entries.get(file, &place, problems) else { continue };
        if !row.verified && row.note.is_empty() {
            problems.add(file, line(file, spanned), "a value that is not verified needs a \"note\" that says why");
        }
        if !row.otherwise.is_empty() && !row.always {
            problems.add(file, line(file, spanned), "what decides the words of commands needs \"always = true\"");
        }
        if let Some([high, low]) = row.bits {
            let has_others = !row.same.is_empty() || !row.otherwise.is_empty();
            if high > 15 || low > high || !row.by_hand || has_others || row.value >> (high - low.min(high) + 1) != 0 {
                let reason = "\"bits\" are [highest, lowest] of 15 to 0, hold \"value\", and need \"by_hand = true\", without \"same\" and \"otherwise\"";
                problems.add(file, line(file, spanned), reason);
                continue;
            }
        }
        let mut word = |line, value| problems.keep(check(file, line, &entry.quantity, &entry.name, value));
        let raw = word(line(file, spanned), row.value);
        let same = row.same.iter().filter_map(|&value| word(line(file, spanned), value)).collect::<Vec<_>>();
        let mut otherwise = Vec::new();
        for spanned in &row.otherwise {
            let other = spanned.get_ref();
            otherwise.extend(word(line(file, spanned), other.value).map(|raw| OtherWords {
                raw,
                means: other.means.clone(),
                stop: other.stop,
                coast: other.coast,
                source: other.source.clone(),
            }));
        }
        let mut seen: Vec<u16> = raw.into_iter().chain(same.iter().copied()).collect();
        for other in &otherwise {
            if seen.contains(&other.raw) {
                let reason = format!("{} = {} is there twice, or both the same and otherwise", entry.name, other.raw);
                problems.add(file, line(file, spanned), reason);
            }
            seen.push(other.raw);
        }
        known.extend(raw.map(|raw| Control {
            code: entry.name.clone(),
            bits: row.bits,
            raw,
            label: row.label.clone(),
            always: row.always,
            by_hand: row.by_hand,
            same,
            otherwise,
            verified: row.verified,
            note: row.note.clone(),
            source: row.source.clone(),
        }));
    }
    known
}

/// Both parameters must exist, the values must be theirs, and there must be something that the drive can do.
pub(super) fn watchdog(
    file: &File,
    entries: &Entries,
    spanned: &Placed<manifest::Watchdog>,
    problems: &mut Problems,
) -> Option<Watchdog> {
    let row = spanned.get_ref();
    let timeout = entries.get(file, &row.timeout, problems).map(|entry| entry.name.clone());
    let action = row.action.as_ref().map(|action| entries.get(file, action, problems));
    let (mut coast, mut stop, mut trip, mut name) = (None, None, None, None);
    let says_what = [&row.coast, &row.stop, &row.trip].into_iter().any(Option::is_some);
    match action {
        // The name that it is given is not known, which was noted.
        Some(None) => return None,
        Some(Some(action)) => {
            let mut word = |value: &Option<Placed<i64>>| {
                let value = value.as_ref()?;
                problems.keep(check(file, line(file, value), &action.quantity, &action.name, *value.get_ref()))
            };
            (coast, stop, trip) = (word(&row.coast), word(&row.stop), word(&row.trip));
            if !says_what {
                let reason = "a watchdog needs the value of \"coast\", \"stop\" or \"trip\"";
                problems.add(file, line(file, spanned), reason);
            }
            name = Some(action.name.clone());
        }
        None if says_what => {
            problems.add(
                file,
                line(file, spanned),
                "\"coast\", \"stop\" and \"trip\" are values of \"action\", which is missing",
            );
        }
        None => {}
    }
    Some(Watchdog {
        timeout: timeout?,
        action: name,
        coast,
        stop,
        trip,
        fault: row.fault,
        verified: row.verified,
        note: row.note.clone(),
        source: row.source.clone(),
    })
}

/// The exceptions of `rows` over those of `known`.
pub(super) fn exceptions(
    file: &File,
    rows: &[Placed<manifest::Exception>],
    mut known: BTreeMap<u8, Exception>,
    problems: &mut Problems,
) -> BTreeMap<u8, Exception> {
    let mut own = Vec::new();
    for spanned in rows {
        let row = spanned.get_ref();
        if own.contains(&row.code) {
            problems.add(file, line(file, spanned), format!("exception {:02X}H is there twice", row.code));
        }
        own.push(row.code);
        let exception = Exception {
            code: row.code,
            name: row.name.clone(),
            meaning: row.meaning.clone(),
            means: row.means.or((row.code == ACKNOWLEDGE).then_some(Means::NotNow)),
            source: row.source.clone(),
        };
        known.insert(row.code, exception);
    }
    known
}

pub(super) fn variant(
    file: &File,
    entries: &Entries,
    spanned: &Placed<manifest::Variant>,
    problems: &mut Problems,
) -> Option<Variant> {
    let row = spanned.get_ref();
    if !row.verified && row.note.is_empty() {
        problems.add(file, line(file, spanned), "a variant that is not verified needs a \"note\" that says why");
    }
    let parameter = entries.get(file, &row.parameter, problems)?;
    if row.share.is_some() != row.choices.is_empty() {
        problems.add(file, line(file, spanned), "a variant has either \"choices\" or a \"share\"");
    }
    let share = row.share.as_ref().and_then(|spanned| {
        let share = variant_share(spanned.get_ref(), &parameter.quantity);
        problems.keep(share.map_err(|why| file.broken(line(file, spanned), why)))
    });
    let parameter = parameter.name.clone();
    let mut choices: BTreeMap<String, VariantChoice> = BTreeMap::new();
    for (name, spanned) in &row.choices {
        let choice = spanned.get_ref();
        if choices.values().any(|other| other.word == choice.value) {
            problems.add(file, line(file, spanned), format!("the value {} is there twice", choice.value));
        }
        let quantity = problems.keep(variant_quantity(choice).map_err(|why| file.broken(line(file, spanned), why)));
        choices.extend(quantity.map(|quantity| (name.clone(), VariantChoice { word: choice.value, quantity })));
    }
    let (verified, note, source) = (row.verified, row.note.clone(), row.source.clone());
    Some(Variant { parameter, choices, share, verified, note, source })
}

fn variant_share(row: &manifest::VariantShare, parameter: &Quantity) -> Result<Share, String> {
    let (_, most) = limits(row.signed, false);
    if !(1..=most).contains(&i64::from(row.counts)) {
        return Err(format!("counts = {} must be 1 to {most}", row.counts));
    }
    if parameter.scale.is_none() || parameter.unit.is_empty() || parameter.signed {
        return Err("a share needs a parameter with a unit and a scale, and without a sign".to_owned());
    }
    let (low, high) = Share::bounds(parameter, row.low, row.high)?;
    Ok(Share { counts: row.counts, signed: row.signed, low, high })
}

fn variant_quantity(row: &manifest::VariantChoice) -> Result<Quantity, String> {
    let scale = match &row.scale {
        manifest::Scale::Number(counts) => Scale::decimal(*counts),
        manifest::Scale::Ratio(text) => Scale::parse(text),
    };
    let right = "1, 10, 100, 1000 or 10000, or a ratio such as \"16384/100\"";
    let scale = scale.ok_or_else(|| format!("scale {} must be {right}", row.scale))?;
    let (least, most) = limits(row.signed, false);
    let bound = |value: Option<f64>| {
        let Some(value) = value else { return Ok(None) };
        match Decimal::of_float(value).map(|number| scale.count(&number)) {
            Some(Counts::Whole(count)) if (least..=most).contains(&count) => Ok(Some(count)),
            _ => Err(format!("{value} does not fit a word with this scale and sign")),
        }
    };
    Ok(Quantity {
        unit: row.unit.clone(),
        scale: Some(scale),
        signed: row.signed,
        wide: false,
        high_first: false,
        low: bound(row.low)?,
        high: bound(row.high)?,
        low_from: None,
        high_from: None,
        choices: BTreeMap::new(),
        variant: None,
    })
}

/// The bit fields of one word, lowest first. They must not overlap, and their names must differ.
pub(super) fn bit_fields(file: &File, fields: &[Placed<Field>], problems: &mut Problems) -> Vec<BitField> {
    let mut known: Vec<BitField> = Vec::new();
    for spanned in fields {
        let field = bit_field(spanned.get_ref()).map_err(|reason| file.broken(line(file, spanned), reason));
        let Some(field) = problems.keep(field) else { continue };
        if let Some(other) = known.iter().find(|other| other.name == field.name || other.mask() & field.mask() != 0) {
            let reason = format!("\"{}\" has the name or a bit of \"{}\"", field.name, other.name);
            problems.add(file, line(file, spanned), reason);
        }
        known.push(field);
    }
    known.sort_by_key(|field| field.low);
    known
}

fn bit_field(row: &Field) -> Result<BitField, String> {
    let [high, low] = row.bits;
    if high > 15 || low > high {
        return Err(format!("bits [{high}, {low}] must be the highest and the lowest bit, 0 to 15"));
    }
    let mut field = BitField {
        name: row.name.clone(),
        low,
        width: high - low + 1,
        values: BTreeMap::new(),
        verified: row.verified,
    };
    match &row.values {
        None if high == low => field.values.extend([(0, "off".to_owned()), (1, "on".to_owned())]),
        None => {}
        Some(values) => {
            for (key, label) in values {
                let value: u16 = key.parse().map_err(|_| format!("value \"{key}\" must be a number"))?;
                if field.extract(field.insert(0, value)) != value {
                    return Err(format!("value {value} does not fit bits [{high}, {low}]"));
                }
                field.values.insert(value, label.clone());
            }
        }
    }
    Ok(field)
}
