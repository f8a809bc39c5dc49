//! Invariant: whatever the files of a profile hold, loading them gives a profile whose every row encodes and decodes
//! exactly at its ends, or an error that names the file, a line that it has, and a reason.
//!
//! The oracle writes every value itself: digits of the count, and the point put in between them.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::{env, fs, process};

use drivebus_drives::{Access, Command, Entry, Input, Profile, ProfileError, State, Value};

/// The files of a folder, and what stands in them where the input does not say.
const FILES: [(&str, &str); 4] = [
    ("profile.toml", include_str!("profile/profile.toml")),
    ("registers.csv", include_str!("profile/registers.csv")),
    ("parameters.csv", include_str!("profile/parameters.csv")),
    ("faults.csv", include_str!("profile/faults.csv")),
];
/// Before the text of a file, at the beginning of a line; the digit after it says which file.
const MARK: &[u8] = b"=== ";

/// See the file's first lines. The input: files, each after a line `=== N`; the missing ones are the small profile's.
pub fn profile(data: &[u8]) {
    thread_local! { static FOLDER: OnceCell<Folder> = const { OnceCell::new() } }
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(Folder::new);
        let texts = texts(data);
        folder.fill(&texts);
        match Profile::load(&folder.0) {
            Ok(profile) => check_profile(&profile),
            Err(error) => check_error(&error, &folder.0, &texts),
        }
    });
}

/// The four files that `data` says.
fn texts(data: &[u8]) -> [Vec<u8>; 4] {
    let mut texts = FILES.map(|(_, text)| text.as_bytes().to_vec());
    let mut current: Option<usize> = None;
    for line in data.split_inclusive(|&byte| byte == b'\n') {
        match line.strip_prefix(MARK) {
            Some([digit, ..]) => {
                let number = usize::from(*digit) % FILES.len();
                texts[number].clear();
                current = Some(number);
            }
            _ => {
                if let Some(number) = current {
                    texts[number].extend_from_slice(line);
                }
            }
        }
    }
    texts
}

/// A folder of this thread's own, removed when the thread ends.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let memory = Path::new("/dev/shm");
        let parent = if memory.is_dir() { memory.to_owned() } else { env::temp_dir() };
        let folder = parent.join(format!("drivebus-fuzz-{}-{number}", process::id()));
        assert!(fs::create_dir_all(&folder).is_ok(), "cannot make {}", folder.display());
        Self(folder)
    }

    fn fill(&self, texts: &[Vec<u8>; 4]) {
        for ((name, _), text) in FILES.iter().zip(texts) {
            assert!(fs::write(self.0.join(name), text).is_ok(), "cannot write {name}");
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // Left behind it harms nobody.
        drop(fs::remove_dir_all(&self.0));
    }
}

fn check_error(error: &ProfileError, folder: &Path, texts: &[Vec<u8>; 4]) {
    let ours = |file: &str| FILES.iter().any(|(name, _)| *file == folder.join(name).display().to_string());
    let (file, line, reason) = match error {
        ProfileError::Broken { file, line, reason } => (file, line, reason),
        ProfileError::Unreadable { file, reason } if !ours(file) => return assert!(!reason.is_empty(), "{error}"),
        other => unreachable!("{other}: the files can be read"),
    };
    let number = FILES.iter().position(|(name, _)| *file == folder.join(name).display().to_string());
    let lines = number.map(|number| texts[number].split(|&byte| byte == b'\n').count());
    let in_file = lines.is_some_and(|lines| usize::try_from(*line).is_ok_and(|line| (1..=lines).contains(&line)));
    assert!(in_file && !reason.trim().is_empty(), "{error}");
}

fn check_profile(profile: &Profile) {
    for entry in profile.entries() {
        check_entry(entry);
        assert_eq!(profile.find(entry.name()), Ok(entry));
        assert!(entry.alias().is_none_or(|alias| profile.find(alias) == Ok(entry)));
        if let Some(address) = entry.address() {
            let other =
                |access| profile.entries().find(|other| other.address() == Some(address) && other.access() == access);
            let read = if entry.access() == Access::Wo { other(Access::Ro).unwrap_or(entry) } else { entry };
            let written = if entry.access() == Access::Ro { other(Access::Wo).unwrap_or(entry) } else { entry };
            assert_eq!(profile.find(&format!("0x{address:04X}")), Ok(read));
            assert_eq!((profile.entry_at(address), profile.written_entry_at(address)), (Some(read), Some(written)));
        }
    }
    let known = |entry: &&Entry| entry.is_known_readable() && entry.address().is_some();
    let readable: Vec<&Entry> = profile.entries().filter(known).collect();
    let spans = profile.plan(readable.iter().copied());
    let spans = spans.unwrap_or_else(|error| unreachable!("{error}"));
    assert!(spans.iter().all(|span| (1..=profile.max_words()).contains(&span.count) && profile.max_words() <= 125));
    for entry in readable {
        let covers = |first: u16, count: u16| {
            let end = u32::from(first) + u32::from(count);
            entry.address().is_some_and(|own| first <= own && u32::from(own) + u32::from(entry.words()) <= end)
        };
        assert!(spans.iter().any(|span| covers(span.address, span.count)), "{} is read by no span", entry.name());
    }
    for command in Command::ALL {
        if let Some((address, code)) = profile.command(command) {
            let registers = profile.command_registers();
            assert_eq!(registers[&address].get(&code), Some(&command.name()), "{address}");
            assert!(profile.written_entry_at(address).is_some());
        }
    }
    for rule in profile.state_word().iter().flat_map(|word| &word.rules) {
        assert_ne!(profile.state(rule.value), State::Unknown, "{rule:?}");
    }
    for fault in profile.faults() {
        assert_eq!(*profile.fault(fault.code), *fault);
    }
}

/// Every word of interest: what it means, and whether it comes back from that.
fn check_entry(entry: &Entry) {
    let quantity = entry.quantity();
    let signed = quantity.is_signed();
    let (least, most): (i64, i64) = match (signed, entry.words()) {
        (true, 1) => (-32_768, 32_767),
        (false, 1) => (0, 65_535),
        (true, _) => (i32::MIN.into(), i32::MAX.into()),
        (false, _) => (0, u32::MAX.into()),
    };
    let low = quantity.low().map_or(least, Value::count);
    let high = quantity.high().map_or(most, Value::count);
    assert!(least <= low && low <= high && high <= most, "{}: {low} to {high}", entry.name());
    assert!(quantity.scale().is_none_or(|scale| scale == 10_u32.pow(quantity.decimals().into())));
    let ratio = quantity.ratio().map_or((1, 1), |(counts, units)| (i128::from(counts), i128::from(units)));
    if entry.words() == 2 {
        assert!(entry.encode(low).is_err(), "{} takes two words", entry.name());
        return;
    }
    if quantity.is_undecided() {
        assert!(entry.encode(low).is_err(), "{} has no unit", entry.name());
        return;
    }
    for count in [least, -1, 0, 1, most, low, high, low - 1, high + 1, i64::midpoint(low, high)] {
        let Some(raw) = word(count, signed) else { continue };
        let value = entry.decode(raw);
        let text = decimal(digits(count, ratio, quantity.decimals()), quantity.decimals().into());
        assert_eq!((value.count(), value.to_string()), (count, text.clone()), "{}", entry.name());
        for input in [Input::Decimal(&text), Input::Float(value.to_f64())] {
            match entry.encode(input) {
                Ok(back) => assert!(back == raw && (low..=high).contains(&count), "{} = {text}: {back}", entry.name()),
                Err(error) => assert!(!(low..=high).contains(&count), "{error}"),
            }
        }
    }
    for (word, label) in quantity.choices() {
        // Two choices may have one label: then it means one of them.
        if let Ok(raw) = entry.encode(Input::Text(label)) {
            let meant = &quantity.choices()[&raw];
            assert!(meant.eq_ignore_ascii_case(label), "{label} ({word}) gives {raw}, {meant}");
        }
    }
}

/// The word that holds `count`; `None` if none does.
fn word(count: i64, signed: bool) -> Option<u16> {
    if signed { i16::try_from(count).ok().map(i16::cast_unsigned) } else { u16::try_from(count).ok() }
}

/// `count`, of which so many counts are so many units, in steps of the last digit: the nearest, and of two the one farther
/// from zero.
fn digits(count: i64, (counts, units): (i128, i128), decimals: u8) -> i64 {
    let exact = i128::from(count).abs() * units * 10_i128.pow(decimals.into());
    let magnitude = i64::try_from(exact / counts + i128::from(exact % counts * 2 >= counts)).unwrap_or(i64::MAX);
    if count < 0 { -magnitude } else { magnitude }
}

/// `count` with a point before its last `decimals` digits.
fn decimal(count: i64, decimals: usize) -> String {
    let digits = format!("{:0>width$}", count.unsigned_abs(), width = decimals + 1);
    let (whole, fraction) = digits.split_at(digits.len() - decimals);
    let sign = if count < 0 { "-" } else { "" };
    let point = if fraction.is_empty() { "" } else { "." };
    format!("{sign}{whole}{point}{fraction}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_an_input_leaves_out_is_a_profile() {
        let folder = Folder::new();
        folder.fill(&texts(b""));
        let profile = Profile::load(&folder.0);
        assert!(profile.as_ref().is_ok_and(|profile| profile.entries().count() == 16), "{profile:?}");
        let texts = texts(b"=== 3\ncode\n");
        assert_eq!(texts[3], b"code\n");
        folder.fill(&texts);
        assert!(Profile::load(&folder.0).is_err());
    }
}
