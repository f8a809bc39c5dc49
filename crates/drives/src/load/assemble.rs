//! From four files, and perhaps a profile below them, to one profile: what they say about each other must agree.

use std::collections::BTreeMap;

use super::Files;
use super::entries::Entries;
use super::facts;
use super::fit;
use super::manifest::{self, AddressRule, Manifest, line};
use super::motion;
use super::placed::Placed;
use super::problems::Problems;
use super::{File, inherit, rows, sense, sequence, succeed};
use crate::entry::{Access, Entry};
use crate::parts::command::Control;
use crate::parts::rules::{Groups, Requests, UnitKind};
use crate::parts::setpoint::{Setpoint, SetpointRole};
use crate::place::Table;
use crate::profile::Profile;
use crate::profile::roles::Roles;
use crate::text::closest;

/// Reads and checks all of `files`, over `base`. What is wrong goes to `problems`; then there may be no profile.
pub(super) fn profile(
    files: &Files,
    manifest: &Manifest,
    base: Option<Profile>,
    problems: &mut Problems,
) -> Option<Profile> {
    let file = &files.manifest;
    let mut profile = start(file, manifest, base, problems)?;
    if let Some(parameters) = &manifest.parameters {
        profile.groups.listed = parameters.address == AddressRule::Listed;
        if let Some(closed) = &parameters.closed_groups {
            profile.groups.closed.clone_from(closed);
        }
        if let Some(unlisted) = &parameters.unlisted_groups {
            profile.groups.unlisted.clone_from(unlisted);
        }
        if let Some(memory) = &parameters.memory {
            profile.memory = problems.keep(facts::memory(file, memory));
        }
    }
    let mut entries = entries(files, manifest, &mut profile, problems);
    bits(file, manifest, &mut entries, problems);
    memory(file, manifest, &entries, problems);

    if let Some(parameters) = &manifest.parameters {
        let groups = &mut profile.groups;
        for (own, known) in [
            (&parameters.acts, &mut groups.acts),
            (&parameters.serial, &mut groups.serial),
            (&parameters.motor, &mut groups.motor),
            (&parameters.last, &mut groups.last),
        ] {
            if let Some(own) = own {
                *known = entries.parameters(file, own, problems);
            }
        }
    }
    if let Some(serial) = &manifest.serial {
        profile.serial = problems.keep(facts::serial(file, serial));
    }
    variants(file, manifest, &mut profile, &entries, problems);
    motion::commands(file, manifest, &mut profile, &mut entries, problems);
    motion::state(file, manifest, &mut profile, &mut entries, problems);
    motion::unlock(file, manifest, &mut profile, &entries, problems);
    sequence::sequence(file, manifest, &mut profile, &mut entries, problems);
    roles(file, manifest, &mut profile.roles, &entries, problems);
    lists(file, manifest, &mut profile, &entries, problems);
    if let Some(identification) = &manifest.identification {
        profile.identifications = facts::identifications(file, &identification.codes, problems);
        if profile.identifications.iter().any(|row| row.family == profile.family) {
            profile.reports_as.truncate(1);
        }
        let signature = identification.signature.as_ref();
        profile.signature = signature.and_then(|row| facts::signature(file, &entries, row, problems));
    }
    setpoints(file, manifest, profile.kind, &mut profile.setpoints, &entries, problems);
    if let Some(watchdog) = &manifest.watchdog {
        profile.watchdog = facts::watchdog(file, &entries, watchdog, problems);
    }
    profile.exceptions =
        facts::exceptions(file, &manifest.exceptions, std::mem::take(&mut profile.exceptions), problems);
    profile.faults.extend(files.faults.as_ref().map(|faults| rows::faults(faults, problems)).unwrap_or_default());

    sense::check(file, manifest, &entries, problems);
    sense::check_inherited(file, manifest, &profile, problems);

    profile.by_address = entries.by_address;
    profile.entries = entries.list;
    if problems.is_empty() {
        fit::check(file, manifest, &profile, problems);
    }
    Some(profile)
}

/// The profile before its tables are read: what `base` has, or nothing; and what every profile says of itself.
fn start(file: &File, manifest: &Manifest, base: Option<Profile>, problems: &mut Problems) -> Option<Profile> {
    let name = name(file, &manifest.name, problems)?;
    let missing = |what: &str| {
        file.broken(
            1,
            format!("\"{what}\" is missing; only a profile that extends another, or an overlay, can do without"),
        )
    };
    let base = base.map(|base| inherit::view(base, file, manifest, problems));
    let requests = match &manifest.requests {
        Some(requests) => problems.keep(read_requests(file, requests)),
        None => problems.keep(base.as_ref().map(|base| base.requests.clone()).ok_or_else(|| missing("requests"))),
    };
    if base.is_none() && manifest.parameters.is_none() {
        problems.add(file, 1, "\"parameters\" is missing; it says how the code of a parameter becomes an address");
    }
    let title = match (&manifest.title, &base) {
        (Some(title), _) => Some(title.clone()),
        (None, Some(base)) => Some(base.title.clone()),
        (None, None) => problems.keep(Err(missing("title"))),
    };
    let called = facts::called(manifest, base.as_ref());
    let kind = manifest.kind.or(base.as_ref().map(|base| base.kind)).ok_or_else(|| missing("kind"));
    let kind = problems.keep(kind);
    if base.is_none() && manifest.version.is_none() {
        problems.add(file, 1, "\"version\" is missing; it is counted up with each change, from 1");
    }
    let version = manifest.version.as_ref().map_or(1, |version| *version.get_ref());
    let family = match (&manifest.overlay, &base) {
        (Some(_), Some(base)) => base.family.clone(),
        _ => name.clone(),
    };
    let mut reports_as = base.as_ref().map(|base| base.reports_as.clone()).unwrap_or_default();
    if reports_as.first() != Some(&family) {
        reports_as.insert(0, family.clone());
    }
    let (requests, title, kind) = (requests?, title?, kind?);
    Some(match base {
        Some(base) => Profile {
            name,
            family,
            reports_as,
            title,
            called,
            kind,
            version,
            requests,
            source: manifest.source.clone(),
            ..base
        },
        None => Profile {
            name,
            family,
            reports_as,
            title,
            called,
            kind,
            version,
            requests,
            source: manifest.source.clone(),
            serial: None,
            memory: None,
            groups: Groups::default(),
            entries: Vec::new(),
            by_address: BTreeMap::new(),
            roles: Roles::default(),
            identifications: Vec::new(),
            signature: None,
            command_address: None,
            unlock: None,
            commands: BTreeMap::new(),
            other_commands: BTreeMap::new(),
            commands_note: String::new(),
            start_sequence: Vec::new(),
            moving: Vec::new(),
            state: None,
            control: Vec::new(),
            setpoints: BTreeMap::new(),
            variants: BTreeMap::new(),
            chosen: BTreeMap::new(),
            monitor: Vec::new(),
            watchdog: None,
            fault_history: Vec::new(),
            fault_values: Vec::new(),
            faults: BTreeMap::new(),
            exceptions: BTreeMap::new(),
        },
    })
}

fn name(file: &File, name: &Placed<String>, problems: &mut Problems) -> Option<String> {
    let text = name.get_ref();
    let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || matches!(byte, b'-' | b'_');
    if text.is_empty() || !text.bytes().all(plain) {
        let reason = format!("name \"{text}\" must be lower-case letters, digits, - and _");
        problems.add(file, line(file, name), reason);
        return None;
    }
    Some(text.clone())
}

fn read_requests(file: &File, requests: &manifest::Requests) -> Result<Requests, super::ProfileError> {
    Ok(Requests {
        protocol: requests.protocol,
        functions: requests.functions.clone(),
        max_words: facts::within(file, &requests.max_words, 1, 125, "max_words")?,
        max_written: match &requests.max_written {
            Some(most) => facts::within(file, most, 1, (*requests.max_words.get_ref()).min(123), "max_written")?,
            None => (*requests.max_words.get_ref()).min(123),
        },
        joined: requests.joined.as_ref().map(|source| source.get_ref().clone()),
        across_groups: requests.across_groups,
        single_parameters: requests.single_parameters,
        zeros: requests.zeros.clone(),
        absent: requests.absent,
        verified: requests.verified,
        note: requests.note.clone(),
        source: requests.source.clone(),
    })
}

/// The rows of the tables over those of the profile below.
fn entries(files: &Files, manifest: &Manifest, profile: &mut Profile, problems: &mut Problems) -> Entries {
    let before = problems.len();
    let mut all = Vec::new();
    let mut bounds = Vec::new();
    let mut variants = Vec::new();
    let tables = [
        files.registers.as_ref().map(|file| (file, rows::registers(file, problems))),
        files.parameters.as_ref().map(|file| (file, rows::parameters(file, profile.groups.listed, problems))),
    ];
    let is_missing = profile.entries.is_empty() && tables.iter().any(Option::is_none);
    for (file, rows) in tables.into_iter().flatten() {
        let of_row = |row: &rows::Located<Entry>| {
            let quantity = &row.item.quantity;
            [&quantity.low_from, &quantity.high_from].map(|bound| bound.clone().map(|bound| (row.line, bound)))
        };
        let variant = |row: &rows::Located<Entry>| Some((row.line, row.item.quantity.variant.clone()?));
        variants.push((file, rows.iter().filter_map(variant).collect::<Vec<_>>()));
        bounds.push((file, rows.iter().flat_map(of_row).flatten().collect::<Vec<_>>()));
        all.extend(rows.into_iter().map(|row| (file, row)));
    }
    succeed::succeed(profile, all.iter_mut().map(|(_, row)| &mut row.item));
    let inherited = std::mem::take(&mut profile.entries);
    let mut entries = Entries::merge(inherited, all, &profile.groups.closed, profile.memory.as_ref(), problems);
    entries.incomplete = is_missing || problems.len() > before;
    for (file, bounds) in bounds {
        entries.check_bounds(file, &bounds, problems);
    }
    for (file, wanted) in variants {
        check_variants(file, &wanted, manifest, profile, problems);
    }
    entries
}

/// Checks the register that takes the word which stores parameters.
fn memory(file: &File, manifest: &Manifest, entries: &Entries, problems: &mut Problems) {
    let rule = manifest.parameters.as_ref().and_then(|parameters| parameters.memory.as_ref());
    let Some(store) = rule.and_then(|rule| rule.get_ref().store.as_ref()) else { return };
    let Some(entry) = entries.get(file, &store.register, problems) else { return };
    let is_seen = store.idle.is_none() || entry.access != Access::Wo;
    if entry.words() != 1 || entry.place.is_none_or(|place| place.table != Table::Holding) || !is_seen {
        let reason = format!(
            "{} is to store parameters, so it must be one word among the holding registers, and with \"idle\" one that can be read",
            entry.name
        );
        problems.add(file, line(file, &store.register), reason);
    }
}

fn bits(file: &File, manifest: &Manifest, entries: &mut Entries, problems: &mut Problems) {
    for (name, fields) in &manifest.bits {
        let bits = facts::bit_fields(file, fields, problems);
        if let Some(entry) = entries.get_mut(file, name, problems) {
            entry.bits = bits;
        }
    }
}

/// Checks that the variants that rows of `file` name, with their lines, are known.
fn check_variants(
    file: &File,
    rows: &[(u64, String)],
    manifest: &Manifest,
    profile: &Profile,
    problems: &mut Problems,
) {
    let known =
        || manifest.variants.keys().map(|name| name.get_ref()).chain(profile.variants.keys()).map(String::as_str);
    for (line, wanted) in rows.iter().filter(|(_, wanted)| !known().any(|known| known == wanted)) {
        let closest = closest(wanted, known()).unwrap_or("none");
        let reason = format!("variant \"{wanted}\" has no table in profile.toml; the closest is \"{closest}\"");
        problems.add(file, *line, reason);
    }
}

fn variants(file: &File, manifest: &Manifest, profile: &mut Profile, entries: &Entries, problems: &mut Problems) {
    for (name, row) in &manifest.variants {
        let variant = facts::variant(file, entries, row, problems);
        profile.variants.extend(variant.map(|variant| (name.get_ref().clone(), variant)));
    }
}

fn roles(file: &File, manifest: &Manifest, roles: &mut Roles, entries: &Entries, problems: &mut Problems) {
    let mut own = |wanted: &Option<Placed<String>>, role: &mut Option<String>| {
        if let Some(wanted) = wanted {
            *role = entries.get(file, wanted, problems).map(|entry| entry.name.clone());
        }
    };
    if let Some(identification) = &manifest.identification {
        own(&identification.register, &mut roles.identification);
    }
    if let Some(status) = &manifest.status {
        own(&status.fault, &mut roles.fault);
        if let Some(holds) = &status.fault_holds {
            roles.fault_holds = *holds.get_ref();
        }
        own(&status.frequency, &mut roles.frequency);
        own(&status.setpoint, &mut roles.setpoint);
        roles.status_words = entries.names(file, &status.words, problems);
    }
    if let Some(ramp) = &manifest.ramp {
        roles.deceleration = in_unit(file, entries, &ramp.deceleration, "s", problems);
        roles.ramp_start = in_unit(file, entries, &ramp.start, "Hz", problems);
    }
}

/// The name of what is `wanted`, if it counts in `unit`.
fn in_unit(
    file: &File,
    entries: &Entries,
    wanted: &Placed<String>,
    unit: &str,
    problems: &mut Problems,
) -> Option<String> {
    let entry = entries.get(file, wanted, problems)?;
    if entry.quantity.unit != unit || entry.quantity.scale.is_none() {
        let reason = format!("{} must be in {unit}, with a scale that is known", wanted.get_ref());
        problems.add(file, line(file, wanted), reason);
    }
    Some(entry.name.clone())
}

fn lists(file: &File, manifest: &Manifest, profile: &mut Profile, entries: &Entries, problems: &mut Problems) {
    if let Some(control) = &manifest.control {
        profile.control = facts::control(file, entries, control, problems);
        let halts = |row: &Control| row.otherwise.iter().any(|other| other.stop.or(other.coast).is_some());
        // What the state says then, nobody knows.
        if profile.control.iter().any(halts) && !profile.state_word().is_some_and(|word| word.rest_by_frequency) {
            let reason = "a word that halts with other words needs \"rest_by_frequency = true\" in [state]";
            problems.add(file, control.first().map_or(1, |row| line(file, row)), reason);
        }
    }
    if let Some(monitor) = &manifest.monitor {
        profile.monitor = entries.names(file, &monitor.registers, problems);
    }
    if let Some(faults) = &manifest.faults {
        profile.fault_history = entries.names(file, &faults.history, problems);
        profile.fault_values = entries.names(file, &faults.values, problems);
    }
}

fn setpoints(
    file: &File,
    manifest: &Manifest,
    kind: UnitKind,
    known: &mut BTreeMap<Setpoint, SetpointRole>,
    entries: &Entries,
    problems: &mut Problems,
) {
    for (&setpoint, row) in &manifest.setpoints {
        if kind == UnitKind::Rectifier && setpoint == Setpoint::Frequency {
            problems.add(file, line(file, &row.register), "a rectifier feeds no motor: it has no frequency");
        }
        let needs = facts::control(file, entries, &row.needs, problems);
        if needs.iter().any(Control::decides_words) {
            problems.add(file, line(file, &row.register), "\"otherwise\" is for [[control]], not for a setpoint");
        }
        let register = entries.get(file, &row.register, problems).map(|entry| entry.name.clone());
        known.extend(register.map(|register| (setpoint, SetpointRole { register, needs })));
    }
}
