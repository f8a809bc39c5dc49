//! `sim://1=gd350,2=vfd500?clock=virtual&seed=1`: a simulated line in one line of text.

use drivebus_rtu::UnitAddress;

use super::Known;
use super::closest::hint;
use super::error::{UnitError, UrlError};

/// The options of the grammar; the kinds of faults are options too.
const OPTIONS: [&str; 5] = ["clock", "seed", "strict_silence", "echo", "faults"];

/// Digits of the largest number that anything here can be: 2⁶⁴ − 1. Thousands of them are no number that anybody means.
const MOST_DIGITS: usize = 20;

/// A simulated line as its URL asks for it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct SimulatorUrl {
    /// The family on each unit, in the order in which they were given.
    pub units: Vec<(UnitAddress, String)>,
    /// Whether time jumps to what happens next (`clock=virtual`); else it is real.
    pub is_virtual: bool,
    /// Where chance comes from.
    pub seed: u64,
    /// Whether drives ignore requests that come before the silence is over.
    pub strict_silence: bool,
    /// Whether the adapter hands back what it sends.
    pub echo: bool,
    /// The share of answers that each kind of fault hits, as given: whether it is a share, the simulator says. `"all"`
    /// (in a URL: `faults`) is every kind.
    pub faults: Vec<(String, f64)>,
}

impl SimulatorUrl {
    pub(super) fn parse(url: &str, rest: &str, known: &Known<'_>) -> Result<Self, UrlError> {
        let (body, query) = rest.split_once('?').unwrap_or((rest, ""));
        let units = units(url, body, known)?;
        let allowed: Vec<&str> = OPTIONS.iter().chain(known.faults).copied().collect();
        let given = pairs(query);
        let mut faults = Vec::new();
        for (key, value) in &given {
            one_of("simulator option", key, &allowed)?;
            if given.iter().filter(|(other, _)| other == key).count() > 1 {
                return Err(UrlError::OptionTwice { url: url.to_owned(), option: key.clone() });
            }
            if key == "faults" || known.faults.contains(&key.as_str()) {
                let name = if key == "faults" { "all" } else { key };
                faults.push((name.to_owned(), rate(url, key, value)?));
            }
        }
        let option = |key: &str, usual: &'static str| {
            given.iter().find(|(other, _)| other == key).map_or(usual, |(_, value)| value.as_str())
        };
        let seed = option("seed", "0");
        if !is_number(seed) {
            return Err(UrlError::SeedNumber { url: url.to_owned(), seed: seed.to_owned() });
        }
        let strict_silence = is_on("strict_silence", option("strict_silence", "0"))?;
        let echo = is_on("echo", option("echo", "0"))?;
        let is_virtual = one_of("clock", option("clock", "real"), &["real", "virtual"])? == "virtual";
        let seed = seed.parse().map_err(|_| UrlError::Seed { seed: seed.to_owned() })?;
        Ok(Self { units, is_virtual, seed, strict_silence, echo, faults })
    }
}

/// `gd350`, which is unit 1, or `1=gd350,2=vfd500`.
fn units(url: &str, body: &str, known: &Known<'_>) -> Result<Vec<(UnitAddress, String)>, UrlError> {
    let mut units: Vec<(UnitAddress, String)> = Vec::new();
    for part in body.trim_matches('/').split(',') {
        let (unit, family) = part.split_once('=').unwrap_or(("1", part));
        let number = is_number(unit).then(|| unit.parse().unwrap_or(u64::MAX));
        let number = number.ok_or_else(|| UrlError::UnitNumber { url: url.to_owned(), unit: unit.to_owned() })?;
        if units.iter().any(|(other, _)| u64::from(other.get()) == number) {
            return Err(UrlError::UnitTwice { url: url.to_owned(), unit: unit.to_owned() });
        }
        let address = UnitError::check(number)?;
        units.push((address, one_of("profile", family, known.families)?.to_owned()));
    }
    Ok(units)
}

/// `given`, if it is one of `known`.
fn one_of<'a>(what: &'static str, given: &'a str, known: &[&str]) -> Result<&'a str, UrlError> {
    if known.contains(&given) {
        return Ok(given);
    }
    let (given, names) = (given.to_owned(), known.iter().map(|&name| name.to_owned()).collect());
    Err(UrlError::Name { what, hint: hint(&given, known), given, known: names })
}

fn is_on(option: &'static str, text: &str) -> Result<bool, UrlError> {
    let text = text.to_lowercase();
    Ok(matches!(one_of(option, &text, &["0", "1", "false", "true"])?, "1" | "true"))
}

fn rate(url: &str, kind: &str, text: &str) -> Result<f64, UrlError> {
    text.trim().parse().map_err(|_| UrlError::Rate {
        url: url.to_owned(),
        kind: kind.to_owned(),
        rate: text.to_owned(),
    })
}

fn is_number(text: &str) -> bool {
    (1..=MOST_DIGITS).contains(&text.len()) && text.bytes().all(|digit| digit.is_ascii_digit())
}

/// `key=value&key=value`, with `+` for a blank and `%41` for a byte of UTF-8.
fn pairs(query: &str) -> Vec<(String, String)> {
    let parts = query.split('&').filter(|part| !part.is_empty());
    parts
        .map(|part| part.split_once('=').unwrap_or((part, "")))
        .map(|(key, value)| (plain(key), plain(value)))
        .collect()
}

fn plain(text: &str) -> String {
    let text = text.replace('+', " ");
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, others @ ..] = rest {
        let coded = others.get(..2).filter(|_| *first == b'%').and_then(|digits| {
            let hex = |digit: u8| char::from(digit).to_digit(16).and_then(|digit| u8::try_from(digit).ok());
            Some(hex(digits[0])? << 4 | hex(digits[1])?)
        });
        bytes.push(coded.unwrap_or(*first));
        rest = if coded.is_some() { &others[2..] } else { others };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_is_read_as_forms_are() {
        let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        assert_eq!(
            pairs("a=1&&b=%41+%c3%a9&c&d=x=y&e=%zz%4"),
            [pair("a", "1"), pair("b", "A é"), pair("c", ""), pair("d", "x=y"), pair("e", "%zz%4"),]
        );
        assert_eq!(pairs(""), []);
    }
}
