//! Every family against `tests/vectors/families.toml`, a table typed from the manuals: commands, states, memory,
//! exceptions, identification codes, and worked examples. Python walks the same file in `tests/python/test_families.py`.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::Arc;

use drivebus_drives::{Command, Entry, Evidence, Input, Means, Place, Profile, Store, UnitKind, Value};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    means: BTreeMap<String, String>,
    family: Vec<Family>,
    example: Vec<Example>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Family {
    name: String,
    kind: String,
    functions: Vec<u8>,
    max_words: u16,
    across_groups: bool,
    commands: Commands,
    states: Option<States>,
    memory: Option<Memory>,
    exceptions: BTreeMap<String, String>,
    identification: Identification,
}

/// A number, or "none" where the family has nothing.
#[derive(Deserialize, Clone)]
#[serde(untagged)]
enum Word {
    Is(u32),
    None(String),
}

impl Word {
    fn get(&self) -> Option<u32> {
        match self {
            Self::Is(word) => Some(*word),
            Self::None(text) => {
                assert_eq!(text, "none");
                None
            }
        }
    }
}

#[derive(Deserialize)]
struct Commands {
    source: String,
    register: Word,
    needs_unverified: Vec<String>,
    /// Commands that another register takes.
    #[serde(default)]
    elsewhere: BTreeMap<String, u32>,
    /// What is written before a command: where, and the word.
    #[serde(default)]
    first: BTreeMap<String, (u32, u16)>,
    /// Words that come before a run.
    #[serde(default)]
    sequence: Vec<u16>,
    other: BTreeMap<String, String>,
    moves: Vec<u32>,
    #[serde(flatten)]
    codes: BTreeMap<String, Word>,
}

#[derive(Deserialize)]
struct States {
    source: String,
    /// As a place of a command: in another table it stands above FFFFH.
    register: u32,
    needs_unverified: bool,
    #[serde(flatten)]
    words: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Memory {
    source: String,
    parameter: String,
    ram: Word,
    eeprom: Word,
    store: Option<StoreWord>,
    needs_unverified: bool,
}

/// The word that stores what was written.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoreWord {
    address: u32,
    word: u16,
    idle: Option<u16>,
}

#[derive(Deserialize)]
struct Identification {
    source: String,
    register: Word,
    #[serde(flatten)]
    codes: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Example {
    family: String,
    name: String,
    variant: Option<String>,
    value: String,
    words: Vec<u16>,
    source: String,
}

fn document() -> Document {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/vectors/families.toml");
    toml::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Every family of the table, with its profile.
fn families() -> impl Iterator<Item = (Family, Arc<Profile>)> {
    document().family.into_iter().map(|family| {
        let profile = Profile::builtin(&family.name).unwrap();
        (family, profile)
    })
}

fn hex(text: &str) -> u16 {
    u16::from_str_radix(text.strip_prefix("0x").unwrap(), 16).unwrap()
}

#[test]
fn the_table_has_every_family_and_every_command() {
    let names: Vec<String> = document().family.into_iter().map(|family| family.name).collect();
    let listed: BTreeSet<&str> = names.iter().map(String::as_str).collect();
    assert_eq!(listed, Profile::builtin_names().collect());
    assert_eq!((names.len(), listed.len()), (55, 55));
    for (family, profile) in families() {
        let commands: BTreeSet<&str> = family.commands.codes.keys().map(String::as_str).collect();
        assert_eq!(commands, Command::ALL.map(Command::name).into(), "{}", family.name);
        assert!(!family.commands.source.is_empty() && !family.identification.source.is_empty(), "{}", family.name);
        let kind = if profile.kind() == UnitKind::Rectifier { "rectifier" } else { "inverter" };
        assert_eq!(kind, family.kind, "{}", family.name);
    }
}

#[test]
fn every_command_of_every_family_is_that_of_the_table() {
    for (family, profile) in families() {
        let (name, table) = (&family.name, &family.commands);
        assert_eq!(profile.command_address().map(Place::number), table.register.get(), "{name}");
        let mut defined: BTreeSet<u16> = BTreeSet::new();
        for command in Command::ALL {
            let code = table.codes[command.name()].get().map(|code| u16::try_from(code).unwrap());
            let elsewhere = table.elsewhere.get(command.name()).copied();
            let expected = code.map(|code| (elsewhere.or(table.register.get()).unwrap(), code));
            let known = profile.command(command).map(|(place, code)| (place.number(), code));
            assert_eq!(known, expected, "{name} {}", command.name());
            let before = profile.command_first(command).map(|(place, code)| (place.number(), code));
            assert_eq!(before, table.first.get(command.name()).copied(), "{name} {}", command.name());
            let in_doubt = profile.command_reason(command).is_some();
            assert_eq!(
                in_doubt,
                table.needs_unverified.iter().any(|name| name == command.name()),
                "{name} {command:?}"
            );
            if let (Some(code), None) = (code, elsewhere) {
                // Two that another word tells apart have one word.
                let shares = |other: &Command| table.first.contains_key(other.name());
                let named = Command::ALL.into_iter().find(shares).filter(|_| shares(&command)).unwrap_or(command);
                assert_eq!(profile.command_of(code), Some(named), "{name} {code}");
                defined.insert(code);
            }
        }
        for (code, label) in &table.other {
            let code = code.parse().unwrap();
            assert_eq!(profile.command_codes().get(&code), Some(&label.as_str()), "{name} {code}");
            defined.insert(code);
        }
        let sequence: Vec<u16> = profile.start_sequence().iter().map(|step| step.word).collect();
        assert_eq!(sequence, table.sequence, "{name}");
        assert_eq!(profile.command_codes().keys().copied().collect::<BTreeSet<u16>>(), defined, "{name}");
        let is_plain = |place: &Place| profile.stored_address(*place).is_none();
        let places = (0..0x5_0000).filter_map(Place::of_number).filter(is_plain);
        let moving: Vec<u32> = places.filter(|&place| profile.is_command(place)).map(Place::number).collect();
        assert_eq!(moving, table.moves, "{name}");
    }
}

/// What is dangerous to mix up, in words: one family's stop must never be the other's.
#[test]
fn the_vfd500_has_habits_of_its_own() {
    let code = |family, command| Profile::builtin(family).unwrap().command(command).map(|(_, code)| code);
    assert_eq!((code("gd350", Command::Stop), code("vfd500", Command::Stop)), (Some(5), Some(6)));
    assert_eq!((code("gd350", Command::Coast), code("vfd500", Command::Coast)), (Some(6), Some(5)));
    assert_eq!((code("gd350", Command::ResetFault), code("vfd500", Command::ResetFault)), (Some(7), Some(8)));
    assert_eq!((code("gd350", Command::JogStop), code("vfd500", Command::JogStop)), (Some(8), None));
}

#[test]
fn every_state_of_every_family_is_that_of_the_table() {
    for (family, profile) in families() {
        let Some(table) = family.states else {
            assert!(profile.state_word().is_none(), "{}", family.name);
            continue;
        };
        let word = profile.state_word().unwrap();
        let register = profile.find(&word.register).unwrap();
        assert_eq!(register.place().map(Place::number), Some(table.register), "{}", family.name);
        let in_doubt = profile.state_reason().is_some();
        assert_eq!(in_doubt, table.needs_unverified, "{}: {}", family.name, table.source);
        for (raw, state) in &table.words {
            assert_eq!(profile.state(hex(raw)).name(), state, "{} {raw}", family.name);
        }
    }
}

#[test]
fn every_family_reaches_ram_and_eeprom_by_its_own_rule() {
    for (family, profile) in families() {
        let Some(table) = family.memory else {
            assert!(profile.entries().all(|entry| entry.code().is_none()), "{}", family.name);
            continue;
        };
        let entry = profile.find(&table.parameter).unwrap();
        let ram = profile.write_address(entry, Store::Ram);
        assert_eq!(ram.as_ref().ok().copied().map(Place::number), table.ram.get(), "{}: {ram:?}", family.name);
        let eeprom = profile.write_address(entry, Store::Eeprom).ok().map(Place::number);
        assert_eq!(eeprom, table.eeprom.get(), "{}: {}", family.name, table.source);
        let in_doubt = profile.memory().is_some_and(|memory| !memory.verified);
        assert_eq!(in_doubt, table.needs_unverified, "{}", family.name);
        assert_eq!(profile.memory().is_some(), table.ram.get().is_some(), "{}", family.name);
        let told = profile.store_word();
        let store =
            told.map(|(store, place)| StoreWord { address: place.number(), word: store.word, idle: store.idle });
        assert_eq!(store, table.store, "{}", family.name);
    }
}

/// The bit is about parameters: no register gets it, whatever the family.
#[test]
fn the_memory_bit_is_never_set_on_a_register() {
    for (family, profile) in families() {
        for entry in profile.entries().filter(|entry| entry.code().is_none()) {
            if let Ok(place) = profile.write_address(entry, Store::Ram) {
                assert_eq!(Some(place), entry.place(), "{} {}", family.name, entry.name());
            }
            assert!(profile.write_address(entry, Store::Eeprom).is_err(), "{} {}", family.name, entry.name());
        }
    }
}

#[test]
fn requests_and_exceptions_are_those_of_the_table() {
    let document = document();
    for (family, profile) in families() {
        assert_eq!(profile.functions(), family.functions, "{}", family.name);
        assert_eq!(profile.max_words(), family.max_words, "{}", family.name);
        assert_eq!(profile.requests().across_groups, family.across_groups, "{}", family.name);
        let listed = family.exceptions.iter().filter(|(code, _)| *code != "source");
        let mut known = 0;
        for (code, name) in listed {
            let exception = profile.exception(u8::try_from(hex(code)).unwrap());
            assert_eq!(&exception.name, name, "{} {code}", family.name);
            assert!(!exception.meaning.is_empty(), "{} {code}", family.name);
            let means = exception.means.map(|means| match means {
                Means::NoSuch => "no_such",
                Means::NotNow => "not_now",
                Means::AskAgain => "ask_again",
                Means::Taken => "taken",
            });
            assert_eq!(means, document.means.get(name).map(String::as_str), "{} {code}", family.name);
            known += usize::from(name != "unknown");
        }
        assert_eq!(profile.exceptions().count(), known, "{}", family.name);
    }
}

#[test]
fn every_identification_code_stands_once() {
    let mut seen: BTreeMap<u16, String> = BTreeMap::new();
    for (family, profile) in families() {
        let listed: BTreeMap<u16, &str> =
            family.identification.codes.iter().map(|(code, name)| (hex(code), name.as_str())).collect();
        let known = profile.identifications().iter().map(|row| (row.code, row.family.as_str()));
        assert_eq!(known.collect::<BTreeMap<u16, &str>>(), listed, "{}", family.name);
        if family.identification.register.get().is_none() {
            assert!(listed.is_empty(), "{}", family.name);
        }
        for (code, _) in listed {
            let twice = seen.insert(code, family.name.clone());
            assert_eq!(twice, None, "{code:04X}");
        }
        for row in profile.identifications() {
            let own = Profile::builtin(&row.family).is_ok();
            assert!(!own || row.family == family.name, "{:04X} stands in {}", row.code, family.name);
        }
    }
    assert_eq!(seen.len(), 12);
    let gd300 = Profile::builtin("gd300").unwrap();
    let shared = &gd300.identify(0x010A).unwrap().shared;
    assert_eq!(*shared, ["Goodrive300L lift drive", "Goodrive310-UL"]);
}

#[test]
fn values_are_those_of_the_worked_examples() {
    for example in document().example {
        let mut profile = (*Profile::builtin(&example.family).unwrap()).clone();
        if let Some(variant) = &example.variant {
            let name = profile.variants().keys().next().unwrap().clone();
            profile = profile.with_variants([(name.as_str(), variant.as_str())]).unwrap();
        }
        let entry = profile.find(&example.name).unwrap();
        let what = format!("{} {} = {} ({})", example.family, example.name, example.value, example.source);
        assert_eq!(usize::from(entry.words()), example.words.len(), "{what}");
        let value = entry.quantity().decode_words(&example.words).unwrap();
        assert_eq!(value.to_string(), example.value, "{what}");
        if let [word] = example.words[..] {
            assert_eq!(entry.encode(Input::Decimal(&example.value)), Ok(word), "{what}");
        }
    }
}

/// A family takes nothing over unsaid: what is not its own says why it may be used, and is never taken for documented.
#[test]
fn what_is_taken_over_says_so() {
    for (name, own) in [("gd35", 9), ("gd35-h1", 0), ("gd300", 30)] {
        let profile = Profile::builtin(name).unwrap();
        let base = Profile::builtin("gd350").unwrap();
        for entry in profile.entries() {
            assert!(entry.verified() || !entry.note().is_empty(), "{name} {}", entry.name());
            if entry.verified() {
                let title = name.to_uppercase();
                assert!(entry.source().contains(&title), "{name} {}: {}", entry.name(), entry.source());
            }
        }
        assert_eq!(profile.entries().filter(|entry| entry.verified()).count(), own, "{name}");
        assert_eq!(profile.entries().count(), base.entries().count(), "{name}");
        assert!(!profile.faults().any(|fault| fault.evidence == Evidence::Verified), "{name}");
    }
}

/// 2101H bit 0: 1 is ready on GD350 and GD300, 0 is ready on GD35, and on GD35-H1 nobody knows.
#[test]
fn ready_is_told_as_each_family_tells_it() {
    let ready = |family: &str, raw| {
        let profile = Profile::builtin(family).unwrap();
        let word = profile.find("status_word_2").unwrap();
        word.bits().iter().find(|bit| bit.name() == "ready").map(|bit| bit.meaning(raw).into_owned())
    };
    for (family, zero, one) in
        [("gd350", "not ready", "ready"), ("gd300", "not ready", "ready"), ("gd35", "ready", "not ready")]
    {
        assert_eq!((ready(family, 0).as_deref(), ready(family, 1).as_deref()), (Some(zero), Some(one)), "{family}");
    }
    assert_eq!(ready("gd35-h1", 0), None);
    let inputs = |family: &str| {
        let profile = Profile::builtin(family).unwrap();
        profile.find("virtual_input").unwrap().quantity().high().map(Value::count)
    };
    assert_eq!(["gd350", "gd35", "gd35-h1", "gd300"].map(inputs), [0x3FF, 0x1FF, 0x1FF, 0x1FF].map(Some));
}

#[test]
fn every_row_of_every_family_names_its_source_or_its_reason() {
    for name in Profile::builtin_names() {
        let profile = Profile::builtin(name).unwrap();
        let says = |what: &str, evidence: Evidence, source: &str, note: &str| {
            assert!(!source.is_empty() || evidence == Evidence::Assumed, "{name} {what} has no source");
            assert!(!note.is_empty() || evidence == Evidence::Verified, "{name} {what} has no reason");
        };
        for entry in profile.entries() {
            says(entry.name(), entry.evidence(), entry.source(), entry.note());
        }
        for fault in profile.faults() {
            says(&format!("fault {}", fault.code), fault.evidence, &fault.source, &fault.note);
        }
        for item in profile.control().iter().chain(profile.setpoints().values().flat_map(|role| &role.needs)) {
            assert!(item.verified || !item.note.is_empty(), "{name} {}", item.code);
        }
        // A setpoint and the list of what must be set say the same of the same parameter.
        for need in profile.setpoints().values().flat_map(|role| &role.needs) {
            for same in profile.control().iter().filter(|item| item.code == need.code) {
                assert_eq!((same.raw, same.verified), (need.raw, need.verified), "{name} {}", need.code);
            }
        }
        let serial: Vec<&str> = profile.serial_parameters().map(Entry::name).collect();
        assert!(profile.last_parameters().all(|entry| !serial.contains(&entry.name())), "{name}");
    }
}
