//! From four files to one profile: what they say about each other must agree.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use toml::Spanned;

use super::manifest::{self, Field, Manifest, line};
use super::rows::{self, Located};
use super::{File, Files, ProfileError};
use crate::bits::BitField;
use crate::command::{Command, Control};
use crate::entry::{Entry, Kind};
use crate::fault::Exception;
use crate::lookup::{closest, parse_code};
use crate::profile::{Identification, Profile};
use crate::quantity::Quantity;
use crate::serial::SerialDefaults;
use crate::state::State;
use crate::watchdog::Watchdog;

/// Reads and checks all of `files`.
pub(super) fn profile(files: &Files) -> Result<Profile, ProfileError> {
    let file = &files.manifest;
    let manifest = manifest::read(file)?;
    let mut entries = Entries::read(files, &manifest)?;

    for (name, fields) in &manifest.bits {
        let bits = bit_fields(file, fields)?;
        entries.get_mut(file, name)?.bits = bits;
    }
    let command_address = entries.name_choices(
        file,
        &manifest.commands.register,
        manifest.commands.codes.iter().map(|(command, code)| (command.name(), code)),
    )?;
    let state_address = entries.name_choices(
        file,
        &manifest.state.register,
        manifest.state.codes.iter().map(|(state, code)| (state.name(), code)),
    )?;

    let profile = Profile {
        name: name(file, &manifest.name)?,
        serial: serial(file, &manifest.serial)?,
        max_words: within(file, &manifest.requests.max_words, 1, 125, "max_words")?,
        ram_mask: 1 << within(file, &manifest.parameters.ram_bit, 8, 15, "ram_bit")?,
        identification_address: entries.get(file, &manifest.identification.register)?.address,
        identifications: identifications(file, &manifest)?,
        command_address,
        commands: codes::<Command>(&manifest.commands.codes),
        moving: addresses(file, &entries, &manifest.commands.moves)?,
        state_address,
        states: codes::<State>(&manifest.state.codes),
        control: control(file, &entries, &manifest)?,
        monitor: addresses(file, &entries, &manifest.monitor.registers)?,
        acting: addresses(file, &entries, &manifest.parameters.acts)?,
        watchdog: manifest.watchdog.as_ref().map(|row| watchdog(file, &entries, row)).transpose()?,
        fault_history: addresses(file, &entries, &manifest.faults.history)?,
        faults: rows::faults(&files.faults)?,
        exceptions: exceptions(file, &manifest)?,
        by_address: entries.by_address,
        entries: entries.list,
        title: manifest.title,
        source: manifest.source,
        functions: manifest.requests.functions,
        closed_groups: manifest.parameters.closed_groups,
    };
    Ok(profile)
}

/// The registers and parameters, and where each address is.
struct Entries {
    list: Vec<Entry>,
    by_address: BTreeMap<u16, usize>,
}

impl Entries {
    fn read(files: &Files, manifest: &Manifest) -> Result<Self, ProfileError> {
        let mut rows: Vec<(&File, Located<Entry>)> = Vec::new();
        rows.extend(rows::registers(&files.registers)?.into_iter().map(|row| (&files.registers, row)));
        rows.extend(rows::parameters(&files.parameters)?.into_iter().map(|row| (&files.parameters, row)));
        let ram_bit = within(&files.manifest, &manifest.parameters.ram_bit, 8, 15, "ram_bit")?;

        let mut names: BTreeSet<&str> = BTreeSet::new();
        let mut addresses = BTreeMap::new();
        for (file, Located { line, item }) in &rows {
            if !names.insert(&item.name) {
                return Err(file.broken(*line, format!("{} is there twice", item.name)));
            }
            if let Some(other) = addresses.insert(item.address, &item.name) {
                return Err(file.broken(*line, format!("{other} has the address {:04X}H too", item.address)));
            }
            let [group, _] = item.address.to_be_bytes();
            if item.kind == Kind::Parameter && manifest.parameters.closed_groups.contains(&group) {
                return Err(file.broken(*line, format!("{} is in a closed group", item.name)));
            }
            if item.address & (1 << ram_bit) != 0 {
                return Err(file.broken(*line, format!("{} has the bit set that means a write to RAM", item.name)));
            }
        }
        for (file, Located { line, item }) in &rows {
            for bound in [item.quantity.low_from(), item.quantity.high_from()].into_iter().flatten() {
                if parse_code(bound).is_none() || !names.contains(bound) {
                    return Err(file.broken(*line, format!("bound \"{bound}\" is no parameter of this profile")));
                }
            }
        }

        let mut list: Vec<Entry> = rows.into_iter().map(|(_, row)| row.item).collect();
        list.sort_by_key(|entry| (entry.kind, entry.address));
        let by_address = list.iter().enumerate().map(|(index, entry)| (entry.address, index)).collect();
        Ok(Self { list, by_address })
    }

    /// The entry that `name`, in `file`, refers to.
    fn get(&self, file: &File, name: &Spanned<String>) -> Result<&Entry, ProfileError> {
        let wanted = name.get_ref();
        self.list.iter().find(|entry| entry.name == *wanted).ok_or_else(|| {
            let closest = closest(wanted, self.list.iter().map(Entry::name)).unwrap_or("nothing at all");
            file.broken(
                line(file, name),
                format!("no register or parameter \"{wanted}\"; the closest is \"{closest}\""),
            )
        })
    }

    fn get_mut(&mut self, file: &File, name: &Spanned<String>) -> Result<&mut Entry, ProfileError> {
        let address = self.get(file, name)?.address;
        let index = self.by_address.get(&address).copied();
        index
            .and_then(|index| self.list.get_mut(index))
            .ok_or_else(|| file.broken(line(file, name), format!("no register or parameter \"{}\"", name.get_ref())))
    }

    /// Makes `codes` the choices of `register`, and returns its address. Codes must differ and be in range.
    fn name_choices<'a>(
        &mut self,
        file: &File,
        register: &Spanned<String>,
        codes: impl Iterator<Item = (&'static str, &'a Spanned<u16>)>,
    ) -> Result<u16, ProfileError> {
        let entry = self.get_mut(file, register)?;
        for (name, code) in codes {
            let word = *code.get_ref();
            check(file, line(file, code), &entry.quantity, &entry.name, word.into())?;
            if let Some(other) = entry.quantity.choices.insert(word, name.to_owned()) {
                return Err(file.broken(line(file, code), format!("{name} has the code of {other}")));
            }
        }
        Ok(entry.address)
    }
}

/// Checks that `quantity` takes `value`, and returns its word.
fn check(file: &File, line: u64, quantity: &Quantity, name: &str, value: i64) -> Result<u16, ProfileError> {
    quantity.encode(name, &value.into()).map_err(|error| file.broken(line, error.to_string()))
}

fn name(file: &File, name: &Spanned<String>) -> Result<String, ProfileError> {
    let text = name.get_ref();
    let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || matches!(byte, b'-' | b'_');
    if text.is_empty() || !text.bytes().all(plain) {
        return Err(
            file.broken(line(file, name), format!("name \"{text}\" must be lower-case letters, digits, - and _"))
        );
    }
    Ok(text.clone())
}

/// Checks that `low` ≤ `item` ≤ `high`.
fn within<T>(file: &File, item: &Spanned<T>, low: T, high: T, what: &str) -> Result<T, ProfileError>
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

fn serial(file: &File, serial: &manifest::Serial) -> Result<SerialDefaults, ProfileError> {
    let format = serial.format.get_ref();
    let (data_bits, parity, stop_bits) = SerialDefaults::parse_format(format)
        .ok_or_else(|| file.broken(line(file, &serial.format), format!("format \"{format}\" must be like 8E1")))?;
    Ok(SerialDefaults {
        baud_rate: within(file, &serial.baud_rate, 50, 10_000_000, "baud_rate")?,
        data_bits,
        parity,
        stop_bits,
        unit: within(file, &serial.unit, 1, 247, "unit")?,
        response_delay: Duration::from_millis(serial.response_delay_ms.into()),
        verified: serial.verified,
        source: serial.source.clone(),
    })
}

fn identifications(file: &File, manifest: &Manifest) -> Result<Vec<Identification>, ProfileError> {
    let mut known: Vec<Identification> = Vec::new();
    for spanned in &manifest.identification.codes {
        let row = spanned.get_ref();
        if known.iter().any(|other| other.code == row.code) {
            return Err(file.broken(line(file, spanned), format!("code {:04X}H is there twice", row.code)));
        }
        known.push(Identification {
            code: row.code,
            family: row.family.clone(),
            title: row.title.clone(),
            verified: row.verified,
            source: row.source.clone(),
        });
    }
    Ok(known)
}

fn codes<K: Copy + Ord>(codes: &BTreeMap<K, Spanned<u16>>) -> BTreeMap<K, u16> {
    codes.iter().map(|(&key, code)| (key, *code.get_ref())).collect()
}

fn addresses(file: &File, entries: &Entries, names: &[Spanned<String>]) -> Result<Vec<u16>, ProfileError> {
    names.iter().map(|name| entries.get(file, name).map(|entry| entry.address)).collect()
}

fn control(file: &File, entries: &Entries, manifest: &Manifest) -> Result<Vec<Control>, ProfileError> {
    let rows = manifest.control.iter().map(|spanned| {
        let row = spanned.get_ref();
        let entry = entries.get(file, &Spanned::new(spanned.span(), row.code.clone()))?;
        Ok(Control {
            code: entry.name.clone(),
            raw: check(file, line(file, spanned), &entry.quantity, &entry.name, row.value)?,
            label: row.label.clone(),
            verified: row.verified,
            note: row.note.clone(),
            source: row.source.clone(),
        })
    });
    rows.collect()
}

/// Both parameters must exist, the values must be theirs, and there must be something that the drive can do.
fn watchdog(file: &File, entries: &Entries, spanned: &Spanned<manifest::Watchdog>) -> Result<Watchdog, ProfileError> {
    let row = spanned.get_ref();
    let timeout = entries.get(file, &row.timeout)?;
    let action = entries.get(file, &row.action)?;
    let word = |value: &Option<Spanned<i64>>| {
        let checked =
            |value: &Spanned<i64>| check(file, line(file, value), &action.quantity, &action.name, *value.get_ref());
        value.as_ref().map(checked).transpose()
    };
    let (coast, stop) = (word(&row.coast)?, word(&row.stop)?);
    if coast.is_none() && stop.is_none() {
        return Err(file.broken(line(file, spanned), "a watchdog needs the value of \"coast\" or of \"stop\""));
    }
    Ok(Watchdog {
        timeout: timeout.name.clone(),
        action: action.name.clone(),
        coast,
        stop,
        verified: row.verified,
        source: row.source.clone(),
    })
}

fn exceptions(file: &File, manifest: &Manifest) -> Result<BTreeMap<u8, Exception>, ProfileError> {
    let mut exceptions = BTreeMap::new();
    for spanned in &manifest.exceptions {
        let row = spanned.get_ref();
        let exception = Exception {
            code: row.code,
            name: row.name.clone(),
            meaning: row.meaning.clone(),
            source: row.source.clone(),
        };
        if exceptions.insert(row.code, exception).is_some() {
            return Err(file.broken(line(file, spanned), format!("exception {:02X}H is there twice", row.code)));
        }
    }
    Ok(exceptions)
}

/// The bit fields of one word, lowest first. They must not overlap, and their names must differ.
fn bit_fields(file: &File, fields: &[Spanned<Field>]) -> Result<Vec<BitField>, ProfileError> {
    let mut known: Vec<BitField> = Vec::new();
    for spanned in fields {
        let field = bit_field(spanned.get_ref()).map_err(|reason| file.broken(line(file, spanned), reason))?;
        if let Some(other) = known.iter().find(|other| other.name == field.name || other.mask() & field.mask() != 0) {
            let reason = format!("\"{}\" has the name or a bit of \"{}\"", field.name, other.name);
            return Err(file.broken(line(file, spanned), reason));
        }
        known.push(field);
    }
    known.sort_by_key(|field| field.low);
    Ok(known)
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
        None => field.values.extend([(0, "off".to_owned()), (1, "on".to_owned())]),
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
