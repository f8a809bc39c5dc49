//! Every register and parameter row of every family: encoded and decoded at its ends, at zero, at one count, and refused
//! one count beyond each end.
//!
//! What must come out is worked out here, from the text of the tables with plain whole numbers, not by the profile.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use drivebus_drives::{Entry, Input, Profile, ValueError};

/// The cells of one row, by column.
type Row = BTreeMap<String, String>;

fn folder(family: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("profiles").join(family)
}

fn table(family: &str, file: &str) -> Vec<Row> {
    let Ok(mut reader) = csv::Reader::from_path(folder(family).join(file)) else { return Vec::new() };
    let headers = reader.headers().unwrap().clone();
    let row = |record: csv::StringRecord| headers.iter().zip(&record).map(|(k, v)| (k.into(), v.into())).collect();
    reader.records().map(|record| row(record.unwrap())).collect()
}

fn cell<'a>(row: &'a Row, column: &str) -> &'a str {
    row.get(column).map_or("", String::as_str)
}

/// What a row is called, and where it is.
fn place(row: &Row) -> (String, u16) {
    let listed = || u16::from_str_radix(&cell(row, "address")[2..], 16).unwrap();
    match cell(row, "code") {
        "" => (cell(row, "name").to_owned(), listed()),
        // A family whose codes do not tell their addresses lists them.
        code if !cell(row, "address").is_empty() => (code.to_owned(), listed()),
        code => {
            let (group, index) = code[1..].split_once('.').unwrap();
            (code.to_owned(), group.parse::<u16>().unwrap() * 256 + index.parse::<u16>().unwrap())
        }
    }
}

/// The rows of `family`: those of the family that it extends, under its own.
fn rows(family: &str) -> BTreeMap<(String, u16), Row> {
    let manifest = std::fs::read_to_string(folder(family).join("profile.toml")).unwrap();
    let own = |family: &str| -> BTreeMap<(String, u16), Row> {
        let all = ["registers.csv", "parameters.csv"].into_iter().flat_map(|file| table(family, file));
        let mut rows = BTreeMap::new();
        for row in all {
            let mut key = (cell(&row, "table").to_owned(), place(&row).1);
            if rows.contains_key(&key) {
                // A state and a command at one address.
                key.0.push_str(", the other way");
            }
            rows.insert(key, row);
        }
        rows
    };
    let manifest: toml::Table = manifest.parse().unwrap();
    let extended = manifest.get("extends").map(|table| table["profile"].as_str().unwrap());
    let mut rows = extended.map(own).unwrap_or_default();
    if let Some(dropped) = manifest.get("drop") {
        let dropped: Vec<&str> = dropped.as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
        rows.retain(|_, row| !dropped.contains(&cell(row, "code")) && !dropped.contains(&cell(row, "name")));
    }
    rows.extend(own(family));
    rows
}

/// `text` times `scale`, which must be whole. Hex is counts already.
fn counts(text: &str, scale: i128) -> i128 {
    if let Some(digits) = text.strip_prefix("0x") {
        return i128::from_str_radix(digits, 16).unwrap();
    }
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let tens = 10_i128.pow(u32::try_from(fraction.len()).unwrap());
    let magnitude = whole.trim_start_matches('-').parse::<i128>().unwrap() * tens
        + if fraction.is_empty() { 0 } else { fraction.parse::<i128>().unwrap() };
    let scaled = magnitude * scale;
    assert_eq!(scaled % tens, 0, "{text} is no whole number of counts");
    if text.starts_with('-') { -scaled / tens } else { scaled / tens }
}

/// `count` of which `counts` are `units`, with the fewest digits at which every count reads differently: the nearest number,
/// and of two the one farther from zero.
fn share(count: i128, (counts, units): (i128, i128)) -> String {
    let scale = (0..9).map(|digits| 10_i128.pow(digits)).find(|tens| units * tens >= counts).unwrap();
    let steps = (2 * count.abs() * units * scale + counts) / (2 * counts);
    written(if count < 0 { -steps } else { steps }, scale)
}

/// `count` as a number of units, with every decimal of `scale`.
fn written(count: i128, scale: i128) -> String {
    let sign = if count < 0 { "-" } else { "" };
    let (whole, rest) = (count.abs() / scale, count.abs() % scale);
    if scale == 1 {
        return format!("{sign}{whole}");
    }
    let digits = scale.to_string().len() - 1;
    format!("{sign}{whole}.{rest:0digits$}")
}

/// What a row says of its numbers.
struct Numbers {
    /// So many counts are so many units.
    ratio: (i128, i128),
    words: usize,
    high_first: bool,
    /// The least and the most that the words can hold.
    holds: (i128, i128),
    low: i128,
    high: i128,
}

impl Numbers {
    fn new(scale: &str, signed: bool, words: &str, low: &str, high: &str) -> Self {
        let (counts, units) = scale.split_once('/').unwrap_or((scale, "1"));
        let ratio = (if counts.is_empty() { 1 } else { counts.parse().unwrap() }, units.parse().unwrap());
        let words = if words == "2" { 2 } else { 1 };
        let size = 1_i128 << (16 * words);
        let holds = if signed { (-size / 2, size / 2 - 1) } else { (0, size - 1) };
        // The ranges of shares have whole counts at their ends.
        let bound = |text: &str, end: i128| if text.is_empty() { end } else { self::counts(text, ratio.0) / ratio.1 };
        let (low, high) = (bound(low, holds.0), bound(high, holds.1));
        Self { ratio, words, high_first: false, holds, low, high }
    }

    fn of(row: &Row) -> Self {
        let signed = cell(row, "signed") == "yes";
        // A bit is 0 or 1, and its row says so by its table.
        let (low, high) = match cell(row, "table") {
            "coil" | "discrete" => ("0", "1"),
            _ => (cell(row, "low"), cell(row, "high")),
        };
        let high_first = cell(row, "order") == "high first";
        let numbers = Self::new(cell(row, "scale"), signed, cell(row, "words"), low, high);
        Self { high_first, ..numbers }
    }

    /// The words of `count` as they stand in the drive: two's complement.
    fn wire(&self, count: i128) -> Vec<u16> {
        let bits = count.rem_euclid(1_i128 << (16 * self.words));
        let mut words: Vec<u16> =
            (0..self.words).map(|word| u16::try_from(bits >> (16 * word) & 0xFFFF).unwrap()).collect();
        if self.high_first {
            words.reverse();
        }
        words
    }
}

fn check(what: &str, entry: &Entry, numbers: &Numbers) -> usize {
    let (low, high) = (numbers.low, numbers.high);
    let mut checked = 0;
    for count in [low, high, 0, 1, -1, low - 1, high + 1, low + 1, high - 1] {
        let text = share(count, numbers.ratio);
        if numbers.holds.0 <= count && count <= numbers.holds.1 {
            let value = entry.quantity().decode_words(&numbers.wire(count)).unwrap();
            assert_eq!(value.to_string(), text, "{what}: {count} counts");
            assert_eq!(i128::from(value.count()), count, "{what}");
        }
        let encoded = entry.encode(Input::Decimal(&text));
        match numbers.wire(count)[..] {
            [word] if (low..=high).contains(&count) => {
                assert_eq!(encoded, Ok(word), "{what} = {text}");
                assert_eq!(entry.encode(text.parse::<f64>().unwrap()), Ok(word), "{what} = {text}");
            }
            [_] => assert!(matches!(encoded, Err(ValueError::OutOfRange { .. })), "{what} = {text}: {encoded:?}"),
            ref words if (low..=high).contains(&count) => {
                assert_eq!(entry.encode_words(Input::Decimal(&text)).as_deref(), Ok(words), "{what} = {text}");
                assert!(encoded.is_err(), "{what} = {text}: two words are not one");
            }
            _ => assert!(entry.encode_words(Input::Decimal(&text)).is_err(), "{what} = {text}"),
        }
        checked += 1;
    }
    // A tenth of the last digit is too fine.
    let at_low = share(low, numbers.ratio);
    let finer = format!("{at_low}{}1", if at_low.contains('.') { "" } else { "." });
    assert!(entry.encode(Input::Decimal(&finer)).is_err(), "{what} = {finer}");
    checked
}

#[test]
fn every_row_of_every_family_goes_around_and_keeps_its_range() {
    let mut all = BTreeMap::new();
    for family in Profile::builtin_names() {
        let profile: Arc<Profile> = Profile::builtin(family).unwrap();
        let rows = rows(family);
        assert_eq!(profile.entries().count(), rows.len(), "{family}");
        let mut checked = 0;
        for ((_, address), row) in rows {
            let (name, _) = place(&row);
            let entry = profile.find(&name).unwrap();
            assert_eq!(entry.address(), Some(address), "{family} {name}");
            if cell(&row, "variant").is_empty() {
                checked += check(&format!("{family} {name}"), entry, &Numbers::of(&row));
            }
        }
        all.insert(family, checked / 9);
    }
    // Rows without those of a variant, counted in the tables by hand.
    let expected = [
        ("a1000", 24),
        ("acs355", 16),
        ("atv12", 50),
        ("atv312", 34),
        ("atv600", 61),
        ("atv71", 66),
        ("atv320", 66),
        ("acs580", 16),
        ("chf100a", 27),
        ("wj200", 20),
        ("h100", 173),
        ("gs2", 43),
        ("gs4", 54),
        ("vfd-b", 32),
        ("vacon10", 37),
        ("j1000", 17),
        ("cfw500", 29),
        ("nowforever", 18),
        ("chv100", 24),
        ("e510", 68),
        ("f510", 129),
        ("smd", 12),
        ("starvert", 20),
        ("eds300", 17),
        ("fc51", 23),
        ("fr-d700", 39),
        ("frenic", 12),
        ("fc202", 14),
        ("gd10", 81),
        ("gd100", 94),
        ("gd20", 92),
        ("gd200a", 96),
        ("gd300", 97),
        ("gd3000", 19),
        ("gd3000-rectifier", 6),
        ("gd35", 97),
        ("gd35-h1", 97),
        ("gd350", 97),
        ("gd600", 15),
        ("gd600-rectifier", 0),
        ("huanyang-hy", 30),
        ("md500", 26),
        ("ms300", 23),
        ("optidrive-e3", 17),
        ("optidrive-p2", 18),
        ("dc1", 22),
        ("saj8000m", 14),
        ("sj200", 23),
        ("x200", 22),
        ("sunfar-e300", 6),
        ("v20", 19),
        ("vf-s15", 9),
        ("vfd-e", 23),
        ("vfd500", 47),
        ("yl620", 33),
    ];
    assert_eq!(all, expected.into());
}

/// VFD500 manual, p. 135: 0.01 % from -100.00 to 100.00, 0.01 Hz from 0 to 600.00, or 1 rpm from 0 to 65535.
#[test]
fn a_variant_decides_what_its_rows_are() {
    let vfd500 = Profile::builtin("vfd500").unwrap();
    let varying: Vec<Row> = rows("vfd500").into_values().filter(|row| !cell(row, "variant").is_empty()).collect();
    assert_eq!(varying.iter().map(|row| place(row).1).collect::<Vec<u16>>(), [0x7001, 0x7003, 0x7004]);
    for (choice, scale, signed, low, high) in [
        ("%", "100", true, "-100.00", "100.00"),
        ("Hz", "100", false, "0.00", "600.00"),
        ("rpm", "1", false, "0", "65535"),
    ] {
        let profile = vfd500.with_variants([("speed_unit", choice)]).unwrap();
        for row in &varying {
            let (name, _) = place(row);
            let entry = profile.find(&name).unwrap();
            assert_eq!(entry.quantity().unit(), choice, "{name}");
            check(&format!("{name} in {choice}"), entry, &Numbers::new(scale, signed, "", low, high));
        }
    }
    // As long as nobody says which unit it is, there is no value to write.
    for row in &varying {
        assert!(vfd500.find(&place(row).0).unwrap().encode(Input::Decimal("10")).is_err());
    }
}
