//! What holds whatever is written, to whatever unit, and whatever comes of it.

use std::collections::BTreeMap;

use drivebus_drives::{Access, Entry, Kind};
use drivebus_rtu::Instant;
use proptest::prelude::*;
use proptest::test_runner::TestRunner;

use super::*;
use crate::answer::Answer;
use crate::scripted::{Reply, UNIT, any_confirmation, any_family, any_reply, call_meant, words_of};
use crate::task::{Read, Write};

/// A unit that answers as it comes, and by what it is asked.
#[derive(Debug, Clone)]
struct Anything {
    family: Arc<Family>,
    /// By which word of these a read is answered; where that is no reply, as the family answers.
    replies: Vec<Option<Reply>>,
    confirms: Vec<Result<(), Fault>>,
    asked: usize,
    told: usize,
}

impl crate::scripted::Unit for Anything {
    fn read(&mut self, read: Read, _: Instant) -> Reply {
        self.asked += 1;
        match &self.replies[self.asked % self.replies.len()] {
            Some(reply) => reply.clone(),
            None => crate::scripted::like(&self.family, &[])(read),
        }
    }

    fn write(&mut self, _: &Write, _: Instant) -> Result<(), Fault> {
        self.told += 1;
        self.confirms[self.told % self.confirms.len()].clone()
    }
}

/// What is to be written, by the places of entries in the profile.
type Picked = Vec<(proptest::sample::Index, Choice)>;

#[derive(Debug, Clone)]
enum Choice {
    Number(i64),
    Float(f64),
    /// Between the bounds of the entry.
    Within(f64),
}

fn any_choice() -> impl Strategy<Value = Choice> {
    prop_oneof![
        1 => any::<i64>().prop_map(Choice::Number),
        2 => (-10_i64..20).prop_map(Choice::Number),
        1 => any::<f64>().prop_map(Choice::Float),
        12 => (0.0..=1.0).prop_map(Choice::Within),
    ]
}

fn value_of(entry: &Entry, choice: &Choice) -> String {
    let quantity = entry.quantity();
    match choice {
        Choice::Number(number) => number.to_string(),
        Choice::Float(number) => format!("{number:?}"),
        Choice::Within(part) => {
            let low = quantity.low().map_or(0.0, drivebus_drives::Value::to_f64);
            let high = quantity.high().map_or(low + 10.0, drivebus_drives::Value::to_f64);
            format!("{:.*}", usize::from(quantity.decimals()), low + (high - low) * part)
        }
    }
}

#[derive(Debug, Clone)]
struct Case {
    unit: Anything,
    picked: Picked,
    store: Store,
    is_trusted: bool,
    /// Whether its name is meant, whatever it says.
    is_meant: bool,
}

/// True, of four cases in three: else little comes so far that something is sent.
fn mostly() -> impl Strategy<Value = bool> {
    proptest::bool::weighted(0.75)
}

fn any_case() -> impl Strategy<Value = Case> {
    let replies = proptest::collection::vec(proptest::option::weighted(0.2, any_reply()), 1..12);
    let confirms = proptest::collection::vec(any_confirmation(), 1..8);
    let picked = proptest::collection::vec((any::<proptest::sample::Index>(), any_choice()), 1..4);
    let store = prop_oneof![Just(Store::Ram), Just(Store::Eeprom)];
    (any_family(), replies, confirms, picked, store, mostly(), mostly()).prop_map(
        |(family, replies, confirms, picked, store, is_trusted, is_meant)| {
            let unit = Anything { family, replies, confirms, asked: 0, told: 0 };
            Case { unit, picked, store, is_trusted, is_meant }
        },
    )
}

/// What was sent, and what came of it.
struct Came {
    script: Script,
    done: Result<(), NotKept<Fault>>,
    /// The one or two words of each value that was sent, by their plain addresses.
    words: Vec<(Place, Vec<u16>)>,
    /// Whether nothing was to be written.
    is_empty: bool,
}

fn carried_out(case: &Case) -> Came {
    let profile = Arc::clone(case.unit.family.profile());
    let writable: Vec<_> = profile.entries().filter(|entry| entry.access() != Access::Ro).collect();
    let mut wanted: BTreeMap<String, String> = BTreeMap::new();
    for (index, choice) in &case.picked {
        // Of some families nothing is known to be writable.
        let Some(entry) = writable.get(index.index(writable.len().max(1))) else { continue };
        wanted.insert(entry.name().to_owned(), value_of(entry, choice));
    }
    let is_empty = wanted.is_empty();
    let record = Record::default();
    let called = if case.is_meant { call_meant } else { call };
    let unit = called(&case.unit.family, &record, case.is_trusted);
    let store = case.store;
    let mut script = Script::new();
    let done = script.carry_out(case.unit.clone(), |line| async move {
        let wanted: Vec<_> = wanted.iter().map(|(name, value)| (name.as_str(), Input::Text(value.as_str()))).collect();
        unit.write_values(&line, Families::shipped(), &wanted, store).await
    });
    let mut words = Vec::new();
    for (_, write) in &script.sent {
        let plain = profile.stored_address(write.place).unwrap_or(write.place.address);
        let (sent, mut at) = (words_of(write), 0);
        while at < sent.len() {
            let place = Place { address: plain + u16::try_from(at).unwrap(), ..write.place };
            let count = profile.written_entry_at(place).map_or(1, |entry| usize::from(entry.words()));
            words.push((place, sent[at..at + count].to_vec()));
            at += count;
        }
    }
    Came { script, done, words, is_empty }
}

fn holds(case: &Case, outcome: &Came) {
    let profile = case.unit.family.profile();
    let store = profile.store_word().map(|(store, place)| (place, store.word));
    let is_value = |sent: &&(Place, Vec<u16>)| store.is_none_or(|(place, word)| **sent != (place, vec![word]));
    for (place, words) in outcome.words.iter().filter(is_value) {
        let place = *place;
        let entry = profile.written_entry_at(place).unwrap();
        assert!(!profile.is_command(place), "{} can move the motor", entry.name());
        assert!(entry.access() != Access::Ro, "{} can only be read", entry.name());
        assert!(entry.verified() || case.is_trusted, "nothing proves {}", entry.name());
        // What a parameter of the drive decides is within one of the ranges that this may give it.
        let variant = entry.quantity().variant().and_then(|name| profile.variants().get(name));
        let chosen = variant.into_iter().flat_map(|variant| variant.choices.values().map(|choice| &choice.quantity));
        let own = Some(entry.quantity()).filter(|_| variant.is_none());
        let is_within = own.into_iter().chain(chosen).any(|quantity| {
            let value = quantity.decode_words(words).unwrap().to_f64();
            quantity.low().is_none_or(|low| value >= low.to_f64())
                && quantity.high().is_none_or(|high| value <= high.to_f64())
        });
        // A share has its range in counts, of whatever the parameter says.
        let is_share = variant.is_some_and(|variant| variant.share.is_some());
        assert!(is_within || is_share, "{} = {words:?}", entry.name());
    }
    let stores =
        |write: &Write| store.is_some_and(|(place, word)| (write.place, words_of(write)) == (place, vec![word]));
    let first = outcome.script.sent.iter().position(|(_, write)| stores(write)).unwrap_or(outcome.script.sent.len());
    let (before, after) = outcome.script.sent.split_at(first);
    assert!(after.is_empty() || case.store == Store::Eeprom, "it is stored unasked");
    assert!(after.iter().all(|(_, write)| stores(write)) && after.len() <= 5, "it is stored last");
    for (_, write) in before {
        let plain = profile.stored_address(write.place).map_or(write.place, Place::from);
        let entry = profile.written_entry_at(plain).unwrap();
        if entry.kind() == Kind::Parameter {
            // Bit 15 of a VFD500 means that it is kept, and that of an INVT that it is not.
            let has_bit = plain != write.place;
            let is_kept = profile.memory().is_none_or(|memory| memory.keeps(has_bit));
            assert_eq!(is_kept, case.store == Store::Eeprom && store.is_none(), "{} at {}", entry.name(), write.place);
        } else {
            assert_eq!((case.store, write.place), (Store::Ram, plain));
        }
        let times = outcome.script.sent.iter().filter(|(_, other)| other == write).count();
        let acts = profile.acting().any(|acting| acting.name() == entry.name());
        assert!(times <= if acts { 1 } else { 5 }, "{} was sent {times} times", entry.name());
    }
    assert!(outcome.script.sent.iter().all(|(_, write)| write.unit == UNIT && !write.is_forced && !write.is_urgent));
    assert!(
        outcome.done.is_err() || !outcome.script.sent.is_empty() || outcome.is_empty || case.store == Store::Eeprom
    );
}

#[test]
fn whatever_is_written_goes_where_it_may() {
    let sent = std::cell::Cell::new((0, 0));
    let mut runner = TestRunner::new(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2000) });
    let run = runner.run(&any_case(), |case| {
        let outcome = carried_out(&case);
        holds(&case, &outcome);
        let (writes, cases) = sent.get();
        sent.set((writes + outcome.script.sent.len(), cases + usize::from(!outcome.script.sent.is_empty())));
        Ok(())
    });
    run.unwrap();
    // Or it would prove nothing.
    let (writes, cases) = sent.get();
    assert!(writes > 300 && cases > 200, "{writes} writes in {cases} cases");
}

/// A unit that gives the code of another family, whatever it is.
#[test]
fn whatever_contradicts_its_name_gets_nothing() {
    let mut kept_back = 0;
    for family in Families::shipped().iter() {
        let profile = family.profile();
        let Some(place) = family.code_place() else { continue };
        let plain = profile.entries().find(|entry| {
            let moves = entry.place().is_some_and(|place| profile.is_command(place));
            entry.verified() && entry.access() == Access::Rw && !entry.quantity().is_undecided() && !moves
        });
        let Some(register) = plain else { continue };
        let value: &'static str = register.quantity().low().map_or(String::from("0"), |low| low.to_string()).leak();
        let name: &'static str = register.name().to_owned().leak();
        let wanted: &'static Wanted = Box::leak(Box::new([(name, Input::Text(value))]));
        for code in Families::shipped().codes().all() {
            if family.contradiction(&[Answer::word_at(place, code)]).is_none() {
                continue;
            }
            let mut bench = Bench::of(family.name(), &[(place.address, code)]);
            let done = bench.write(wanted, Store::Ram);
            assert_eq!(bench.script.sent, [], "{} says {code:04X}H", family.name());
            let is_told = matches!(*done.unwrap_err().why, Why::NotWritten { why: NotWritten::NotSame(_), .. });
            kept_back += usize::from(is_told);
        }
    }
    assert!(kept_back > 20, "{kept_back}");
}
