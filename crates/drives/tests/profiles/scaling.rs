//! Scaling is exact: every word of every scale, and every value that is no word.

use std::collections::BTreeSet;

use drivebus_drives::{Entry, Input, Profile, Value, ValueError};
use proptest::prelude::*;

/// The number that `raw` means in counts, worked out beside the code under test.
fn counts(entry: &Entry, raw: u16) -> i64 {
    let count = i64::from(raw);
    if entry.quantity().is_signed() && count >= 0x8000 { count - 0x1_0000 } else { count }
}

fn is_allowed(entry: &Entry, count: i64) -> bool {
    let quantity = entry.quantity();
    quantity.low().is_none_or(|low| low.count() <= count) && quantity.high().is_none_or(|high| count <= high.count())
}

/// Every word for the first entry of a scale and a sign. For others of them those at and around the bounds, and every 251st:
/// what differs is where the bounds are.
fn words(entry: &Entry, is_first: bool) -> impl Iterator<Item = u16> {
    let quantity = entry.quantity();
    let word = |bound: Value| u16::try_from(bound.count().rem_euclid(0x1_0000)).unwrap();
    let bounds = [quantity.low(), quantity.high()].map(|bound| bound.map_or(0, word));
    let edges = [0, 0x7FFF, 0x8000, u16::MAX].into_iter().chain(bounds);
    let step = if is_first { 1 } else { 251 };
    (0..=u16::MAX).step_by(step).chain(edges.flat_map(|edge| [edge.wrapping_sub(1), edge, edge.wrapping_add(1)]))
}

#[test]
fn every_word_of_every_scale_goes_around() {
    let profile = Profile::builtin("gd350").unwrap();
    let mut seen = BTreeSet::new();
    for entry in profile.entries() {
        let is_first = seen.insert((entry.quantity().ratio(), entry.quantity().is_signed()));
        for raw in words(entry, is_first) {
            let value = entry.decode(raw);
            assert_eq!(value.count(), counts(entry, raw));
            // By a float, and by the printed digits.
            let by_float = entry.encode(value.to_f64());
            let by_text = entry.encode(Input::Decimal(&value.to_string()));
            if is_allowed(entry, value.count()) {
                assert_eq!((by_float, by_text), (Ok(raw), Ok(raw)), "{} {raw:04X}", entry.name());
            } else {
                for refused in [by_float, by_text] {
                    assert!(matches!(refused, Err(ValueError::OutOfRange { .. })), "{} {raw:04X}", entry.name());
                }
            }
        }
    }
}

#[test]
fn a_float_prints_as_the_value_it_is() {
    let profile = Profile::builtin("gd350").unwrap();
    let frequency = profile.find("set_frequency").unwrap();
    for raw in 0..=u16::MAX {
        let exact = frequency.decode(raw).to_string();
        let float = frequency.decode(raw).to_f64();
        assert_eq!(format!("{float:.2}"), exact);
        assert!(float.to_string().len() <= exact.len(), "{float} is {exact}");
    }
}

#[test]
fn errors_name_value_unit_and_what_is_allowed() {
    let profile = Profile::builtin("gd350").unwrap();
    let error = |name: &str, value: &str| profile.find(name).unwrap().encode(value).unwrap_err().to_string();
    assert_eq!(
        error("set_frequency", "700"),
        "set_frequency = 700 Hz: out of range, allowed is 0.00 to 630.00 Hz, and not above P00.03"
    );
    assert_eq!(
        error("P00.03", "9.99"),
        "P00.03 = 9.99 Hz: out of range, allowed is 10.00 to 630.00 Hz, and not below P00.04"
    );
    assert_eq!(
        error("set_frequency", "10.005"),
        "set_frequency = 10.005 Hz: finer than the drive counts; the nearest allowed are 10.00 and 10.01 Hz"
    );
    assert_eq!(
        error("torque_setting", "-0.05"),
        "torque_setting = -0.05 %: finer than the drive counts; the nearest allowed are -0.1 and 0.0 %"
    );
    assert_eq!(error("set_frequency", "fast"), "set_frequency = fast: not a number; give it in Hz");
    assert_eq!(error("P00.01", "3"), "P00.01 = 3: out of range, allowed is 0 to 2");
    assert_eq!(
        error("P14.02", "7E1x"),
        "P14.02 = 7E1x: neither a number nor a known choice; known: 0 = 8N1, 1 = 8E1, 2 = 8O1, 3 = 8N2, 4 = 8E2, 5 = 8O2"
    );
    assert!(error("set_frequency", &"x".repeat(1_000_000)).len() < 200);
}

#[test]
fn choices_go_by_label_or_number_and_words_also_by_hex() {
    let profile = Profile::builtin("gd350").unwrap();
    let raw = |name: &str, value: &str| profile.find(name).unwrap().encode(value);
    assert_eq!(raw("P00.01", "Communication"), Ok(2));
    assert_eq!(raw("P00.01", " 2 "), Ok(2));
    assert_eq!(raw("P00.06", "modbus"), Ok(8));
    assert_eq!(raw("control_command", "coast"), Ok(6));
    assert_eq!(raw("virtual_input", "0x3F"), Ok(0x3F));
    assert!(raw("set_frequency", "0x3F").is_err(), "a measure is no bit pattern");
    // A label may look like a number: 8E1 is 80 to a parser. Only text can be a label.
    assert_eq!(raw("P14.02", "8e1"), Ok(1));
    assert_eq!(raw("P14.01", "19200"), Ok(4));
    assert_eq!(raw("P14.01", "4"), Ok(4));
    let baud_rate = profile.find("P14.01").unwrap();
    assert!(baud_rate.encode(19_200).is_err());
    assert!(baud_rate.encode(Input::Decimal("19200")).is_err());
    assert_eq!(baud_rate.encode(Input::Decimal("4.00")), Ok(4));
}

#[test]
fn floats_that_are_no_value_are_refused() {
    let profile = Profile::builtin("gd350").unwrap();
    for entry in profile.entries() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN, 1e17, -1e17] {
            assert!(entry.encode(value).is_err(), "{} {value}", entry.name());
        }
        for value in [i64::MAX, i64::MIN] {
            assert!(entry.encode(value).is_err(), "{} {value}", entry.name());
        }
        assert!(entry.encode(f64::MIN_POSITIVE).is_err(), "{}", entry.name());
    }
    assert_eq!(profile.find("set_frequency").unwrap().encode(-0.0), Ok(0));
}

/// The value of `thousandths`, written out.
fn written(thousandths: i64) -> String {
    let sign = if thousandths < 0 { "-" } else { "" };
    format!("{sign}{}.{:03}", thousandths.unsigned_abs() / 1000, thousandths.unsigned_abs() % 1000)
}

proptest! {
    /// Thousandths are finer than every scale of the profile, so integers tell what must happen.
    #[test]
    fn any_number_is_a_word_or_is_refused_with_its_neighbours(entry in 0_usize..97, thousandths in -70_000_000_i64..70_000_000) {
        let profile = Profile::builtin("gd350").unwrap();
        let entry = profile.entries().nth(entry).unwrap();
        let quantity = entry.quantity();
        let step = 1000 / i64::from(quantity.scale().unwrap_or(1));
        let (least, most) = if quantity.is_signed() { (-32_768, 32_767) } else { (0, 65_535) };
        let low = step * quantity.low().map_or(least, Value::count);
        let high = step * quantity.high().map_or(most, Value::count);

        let text = written(thousandths);
        let by_text = entry.encode(text.as_str());
        prop_assert_eq!(&by_text.clone().ok(), &entry.encode(text.parse::<f64>().unwrap()).ok());
        match by_text {
            Ok(raw) => {
                prop_assert!(low <= thousandths && thousandths <= high);
                prop_assert_eq!(counts(entry, raw) * step, thousandths);
            }
            Err(ValueError::OutOfRange { limits, .. }) => {
                prop_assert!(thousandths < low || high < thousandths);
                prop_assert_eq!(limits.low.count() * step, low);
                prop_assert_eq!(limits.high.count() * step, high);
            }
            Err(ValueError::SurplusDigits { below, above, .. }) => {
                let steps = |value: Value| value.count() * step;
                prop_assert!(low <= steps(below) && steps(below) < thousandths);
                prop_assert!(thousandths < steps(above) && steps(above) <= high);
                prop_assert_eq!(steps(above) - steps(below), step);
            }
            Err(other) => prop_assert!(false, "{}", other),
        }
    }

    #[test]
    fn no_text_panics(entry in 0_usize..97, text in ".*") {
        let profile = Profile::builtin("gd350").unwrap();
        let entry = profile.entries().nth(entry).unwrap();
        if let Err(error) = entry.encode(text.as_str()) {
            prop_assert!(error.to_string().starts_with(entry.name()));
        }
    }
}
