//! Scales that are no power of ten, and values of two words whose high one comes first.
//!
//! A share of a range is counted where 16384 counts are 100 % (4000H, Danfoss FC 300 design guide MG33BE02, p. 195) or 20000.
//! What must come out is worked out here, with plain fractions.

use drivebus_drives::{Entry, Input, Profile, ValueError};
use proptest::prelude::*;

use crate::folder::{FAULTS, Folder};

const TOML: &str = r#"
name = "ex5"
title = "Example Drives EX-5"
kind = "inverter"
version = 1
source = "EX-5 manual"
[requests]
functions = [0x03, 0x06]
max_words = 8
source = "p. 9"
[parameters]
address = "listed"
source = "p. 9"
[variants.base_frequency]
parameter = "3-03"
verified = true
source = "p. 10"
[variants.base_frequency.choices]
"50 Hz" = { value = 50000, unit = "Hz", scale = "16384/50", low = 0.0, high = 50.0 }
"60 Hz" = { value = 60000, unit = "Hz", scale = "16384/60", low = 0.0, high = 60.0 }
rpm = { value = 1, unit = "rpm", scale = 10 }
"#;

const REGISTERS: &str =
    "address,name,label,unit,scale,signed,words,order,low,high,high_from,variant,access,verified,note,source\n";

const ROWS: &str = "\
0x0001,percent,Share,%,16384/100,yes,,,-100,100,,,rw,yes,,p. 1
0x0002,plain,Share,%,16384/100,no,1,,,,,,rw,yes,,p. 1
0x0003,abb,Share,%,20000/100,yes,,,,163,,,rw,yes,,p. 1
0x0004,ten,Tenths,Hz,1000/100,no,,,0.0,50.0,,,rw,yes,,p. 1
0x0005,tens,Tens of watts,W,1/10,no,,,,,,,rw,yes,,p. 1
0x0006,speed,Speed,,,no,,,,,,base_frequency,rw,yes,,p. 1
0x0010,energy,Low first,kWh,10,no,2,low first,,,,,ro,yes,,p. 1
0x0012,alarm,High first,,1,no,2,high first,,,,,ro,yes,,p. 1
0x0014,shift,High first,%,16384/100,yes,2,high first,,,,,ro,yes,,p. 1
";

const PARAMETERS: &str = "\
code,address,label,unit,scale,signed,words,order,low,low_from,high,high_from,default,access,choices,verified,note,source
3-03,0x0BD5,Highest reference,Hz,1000,no,2,high first,,,,,50.000,ro,,yes,,p. 2
3-10,0x0C1B,Preset reference,%,16384/100,yes,,,-100,,100,,25,run,,yes,,p. 2
";

fn folder_of(name: &str, toml: &str, rows: &str) -> Folder {
    let files = [
        ("profile.toml", toml),
        ("registers.csv", &format!("{REGISTERS}{rows}")),
        ("parameters.csv", PARAMETERS),
        ("faults.csv", FAULTS),
    ];
    Folder::new(&format!("scales-{name}"), &files)
}

fn load(name: &str) -> Profile {
    folder_of(name, TOML, ROWS).load().unwrap()
}

/// `raw` as a number, and as one of `digits` after the point: the nearest, and of two the one farther from zero.
fn written(raw: u16, signed: bool, (counts, units): (i64, i64), digits: u32) -> String {
    let count = if signed { i64::from(raw.cast_signed()) } else { i64::from(raw) };
    let tens = 10_i64.pow(digits);
    let steps = (2 * count.abs() * units * tens + counts) / (2 * counts);
    let sign = if count < 0 && steps > 0 { "-" } else { "" };
    if digits == 0 {
        return format!("{sign}{steps}");
    }
    format!("{sign}{}.{:0width$}", steps / tens, steps % tens, width = digits as usize)
}

fn encoded(entry: &Entry, text: &str) -> u16 {
    entry.encode(Input::Decimal(text)).unwrap()
}

#[test]
fn every_word_of_a_share_goes_around_and_reads_differently() {
    let profile = load("words");
    for (name, ratio, digits, low, high) in [
        ("percent", (16_384, 100), 3, -16_384, 16_384),
        ("plain", (16_384, 100), 3, 0, 65_535),
        ("abb", (20_000, 100), 3, -32_768, 32_600),
        ("tens", (1, 10), 0, 0, 65_535),
    ] {
        let entry = profile.find(name).unwrap();
        let signed = entry.quantity().is_signed();
        let mut before = None;
        for count in if signed { i64::from(i16::MIN)..=i64::from(i16::MAX) } else { 0..=i64::from(u16::MAX) } {
            let raw =
                if signed { i16::try_from(count).unwrap().cast_unsigned() } else { u16::try_from(count).unwrap() };
            let value = entry.decode(raw);
            assert_eq!((value.count(), value.to_string()), (count, written(raw, signed, ratio, digits)), "{name}");
            let by = [entry.encode(value.to_f64()), entry.encode(Input::Decimal(&value.to_string()))];
            if low <= count && count <= high {
                assert_eq!(by, [Ok(raw), Ok(raw)], "{name} {count}");
            } else {
                assert!(by.iter().all(|by| matches!(by, Err(ValueError::OutOfRange { .. }))), "{name} {count}");
            }
            assert!(before.is_none_or(|before| before < value.to_f64()), "{name} {count}");
            before = Some(value.to_f64());
        }
    }
}

#[test]
fn a_value_is_the_nearest_count_and_finer_ones_are_refused_with_their_neighbours() {
    let profile = load("nearest");
    let percent = profile.find("percent").unwrap();
    // × 163.84: 8192; 5461.28; 0.4915; 0.6554; -16384.
    for (text, word) in
        [("50", 8_192), ("33.333", 5_461), ("0.003", 0), ("0.004", 1), ("-100.0", 0xC000), ("99.999", 16_384)]
    {
        assert_eq!(encoded(percent, text), word, "{text}");
    }
    let error = |value: &str| percent.encode(value).unwrap_err().to_string();
    assert_eq!(
        error("50.0001"),
        "percent = 50.0001 %: finer than the drive counts; the nearest allowed are 50.000 and 50.006 %"
    );
    assert_eq!(error("100.1"), "percent = 100.1 %: out of range, allowed is -100.000 to 100.000 %");
    assert_eq!(error("100.00001"), "percent = 100.00001 %: out of range, allowed is -100.000 to 100.000 %");
    let tens = profile.find("tens").unwrap();
    assert_eq!([5, 6, 15, 16].map(|watts| tens.encode(watts).unwrap()), [0, 1, 1, 2], "of two as near the smaller");
    assert!(tens.encode("0x10").is_err() && tens.quantity().measures(), "what is measured is not written in hex");
    // A ratio that is a power of ten is that power.
    let ten = profile.find("ten").unwrap();
    assert_eq!(
        (ten.quantity().scale(), ten.quantity().ratio(), ten.quantity().decimals()),
        (Some(10), Some((10, 1)), 1)
    );
    let quantity = percent.quantity();
    assert_eq!((quantity.scale(), quantity.ratio(), quantity.decimals()), (None, Some((4_096, 25)), 3));
    let preset = profile.find("3-10").unwrap();
    assert_eq!((preset.default_raw(), preset.decode(4_096).to_string()), (Some(4_096), "25.000".to_owned()));
}

#[test]
fn a_frequency_is_a_share_of_what_a_parameter_of_the_drive_says() {
    let profile = load("variant");
    assert!(profile.find("speed").unwrap().encode(Input::Decimal("10")).is_err(), "nobody has said of what");
    // 10 Hz of 50 is 3276.8 counts, of 60 Hz 2730.67; full speed is 16384.
    for (choice, hertz, word) in
        [("50 Hz", "10", 3_277), ("50 Hz", "50", 16_384), ("60 Hz", "10", 2_731), ("60 Hz", "60", 16_384)]
    {
        let profile = profile.with_variants([("base_frequency", choice)]).unwrap();
        let speed = profile.find("speed").unwrap();
        assert_eq!((encoded(speed, hertz), speed.quantity().unit()), (word, "Hz"), "{hertz} of {choice}");
        assert!(speed.encode(Input::Decimal("60.1")).is_err());
    }
    let at_50 = profile.with_variants([("base_frequency", "50 Hz")]).unwrap();
    // 3277 × 50 / 16384 = 10.00061.
    assert_eq!(at_50.find("speed").unwrap().decode(3_277).to_string(), "10.001");
}

#[test]
fn of_two_words_the_high_one_may_come_first() {
    let profile = load("order");
    let value =
        |name: &str, words: [u16; 2]| profile.find(name).unwrap().quantity().decode_words(&words).unwrap().to_string();
    assert_eq!(value("energy", [0x86A0, 0x0001]), "10000.0");
    assert_eq!(value("alarm", [0x0001, 0x86A0]), "100000");
    assert_eq!(value("shift", [0xFFFF, 0xC000]), "-100.000");
    assert_eq!(value("3-03", [0, 50_000]), "50.000");
    let names = ["alarm", "energy", "shift"];
    let entries = names.map(|name| profile.find(name).unwrap());
    let plan = profile.compile(&entries).unwrap();
    assert_eq!(plan.words(), 6, "one read");
    let values = plan.values(&[7, 0, 1, 2, 0, 16_384]).map(|(_, value)| value.unwrap().to_string());
    assert_eq!(values.collect::<Vec<_>>(), ["65538", "0.7", "100.000"]);
}

#[test]
fn a_parameter_of_two_words_is_written_where_one_request_can() {
    let row =
        "3-42,0x0D5B,Ramp,s,100,no,2,high first,,,,,,run,,yes,,p. 2\n3-44,0x0D60,Step,,1,yes,2,,,,,,,run,,yes,,p. 2\n";
    let load = |name: &str, toml: &str, parameters: &str, registers: &str| {
        let folder = folder_of(name, toml, &format!("{ROWS}{registers}"));
        folder.write("parameters.csv", format!("{PARAMETERS}{parameters}"));
        folder.load().map_err(|why| why.to_string())
    };
    let writes = TOML.replace("[0x03, 0x06]", "[0x03, 0x06, 0x10]");
    let profile = load("written", &writes, row, "").unwrap();
    // 70000 hundredths are 0001 1170H; -2 is FFFF FFFEH, whose low word comes first.
    let ramp = profile.find("3-42").unwrap();
    assert_eq!(ramp.encode_words(Input::Decimal("700")), Ok(vec![0x0001, 0x1170]));
    assert_eq!(ramp.quantity().raw(&[0x0001, 0x1170]), 70_000);
    let step = profile.find("3-44").unwrap();
    assert_eq!(step.encode_words(-2), Ok(vec![0xFFFE, 0xFFFF]));
    assert_eq!(step.quantity().raw(&[0xFFFE, 0xFFFF]), 0xFFFF_FFFE);
    assert!(ramp.encode_words(Input::Decimal("42949672.96")).is_err());
    assert!(matches!(ramp.encode(1), Err(ValueError::TwoWords { .. })));

    for (toml, registers, reason) in [
        (TOML, "", "it is written by 0x10 with two words"),
        (&*writes.replace("max_words = 8", "max_words = 1"), "", "it is written by 0x10 with two words"),
        (
            &*writes.replace("max_words = 8", "max_words = 8\nmax_written = 1"),
            "",
            "it is written by 0x10 with two words",
        ),
    ] {
        let said = load("second", toml, row, registers).unwrap_err();
        assert!(said.contains("3-42 has two words and can be written") && said.contains(reason), "{said}");
    }
    let other = "0x0D5C,other,Another,,1,no,,,,,,,rw,yes,,p. 1\n";
    assert!(load("second", &writes, row, other).unwrap_err().contains("3-42 is at 0D5CH, where other is already"));
    let said = load("register", &writes, "", "0x0030,wide,Wide,,1,no,2,,,,,,rw,yes,,p. 1\n").unwrap_err();
    assert!(said.contains("a register of two words can only be read"), "{said}");
}

#[test]
fn what_is_wrong_is_said() {
    let scale = "must be 1, 10, 100, 1000 or 10000, a ratio such as 16384/100, or empty if unknown";
    for (row, reason) in [
        ("0x0020,new,New,%,16384,no,,,,,,,rw,yes,,p. 1", format!("scale \"16384\" {scale}")),
        ("0x0020,new,New,%,16384/0,no,,,,,,,rw,yes,,p. 1", format!("scale \"16384/0\" {scale}")),
        ("0x0020,new,New,%,65536/100,no,,,,,,,rw,yes,,p. 1", format!("scale \"65536/100\" {scale}")),
        ("0x0020,new,New,%,163.84/1,no,,,,,,,rw,yes,,p. 1", format!("scale \"163.84/1\" {scale}")),
        (
            "0x0020,new,New,%,16384/100,no,,,,50.0001,,,rw,yes,,p. 1",
            "\"high\" 50.0001 has more digits than the scale".into(),
        ),
        ("0x0020,new,New,%,16384/100,yes,,,,200,,,rw,yes,,p. 1", "\"high\" 200 does not fit a word".into()),
        ("0x0020,new,New,%,16384/100,yes,,,50.003,50,,,rw,yes,,p. 1", "\"low\" 50.003 is above \"high\" 50".into()),
        (
            "0x0020,new,New,,1,no,,high first,,,,,ro,yes,,p. 1",
            "\"order\" is \"high first\", and only two words have an order: leave it empty".into(),
        ),
        (
            "0x0020,new,New,,1,no,2,big,,,,,ro,yes,,p. 1",
            "\"order\" is \"big\" and must be low first or high first".into(),
        ),
    ] {
        let folder = folder_of("wrong", TOML, &format!("{ROWS}{row}\n"));
        let reasons = folder.reasons();
        // 50.003 % is the same count as 50 %, so that range is one value.
        if row.contains("50.003") {
            assert_eq!(reasons, Vec::<String>::new());
            continue;
        }
        let [only] = reasons.try_into().unwrap();
        assert!(only.contains("registers.csv, line 11: ") && only.contains(&reason), "{only}");
    }
    for (scale, reason) in [
        ("\"16384/x\"", "scale \"16384/x\" must be 1, 10, 100, 1000 or 10000, or a ratio such as \"16384/100\""),
        ("16384", "scale 16384 must be 1, 10, 100, 1000 or 10000, or a ratio such as \"16384/100\""),
        ("true", "scale must be a number, or a ratio as text such as \"16384/100\""),
    ] {
        let folder = folder_of("table", &TOML.replace("\"16384/50\"", scale), ROWS);
        let [only] = Profile::check(&folder.0).try_into().unwrap();
        assert!(only.to_string().contains(reason), "{only}");
    }
}

proptest! {
    /// However many counts are however many units: every word goes around, and no value is more than half a count off.
    #[test]
    fn any_ratio_goes_around(
        counts in 1_i64..=65_535, units in 1_i64..=65_535, signed: bool, raw: u16, thousandths in -40_000_000_i64..40_000_000,
    ) {
        let row = format!(
            "0x0020,any,Any,%,{counts}/{units},{},,,,,,,rw,yes,,p. 1\n", if signed { "yes" } else { "no" }
        );
        let profile = folder_of("any", TOML, &row).load().unwrap();
        let any = profile.find("any").unwrap();
        let value = any.decode(raw);
        prop_assert_eq!(any.encode(value.to_f64()), Ok(raw));
        prop_assert_eq!(encoded(any, &value.to_string()), raw);
        // A value with as many digits as the scale has, in the middle of what a word holds.
        let digits = u32::from(any.quantity().decimals());
        let least = if signed { -32_768 } else { 0 };
        let most = if signed { 32_767 } else { 65_535 };
        let tens = 10_i64.pow(digits);
        let steps = thousandths.rem_euclid((most - least) * units * tens / counts + 1) + least * units * tens / counts;
        let text = format!("{}{}e-{digits}", if steps < 0 { "-" } else { "" }, steps.abs());
        match any.encode(Input::Decimal(&text)) {
            Ok(word) => {
                let count = if signed { i64::from(word.cast_signed()) } else { i64::from(word) };
                // |steps / tens - count × units / counts| ≤ units / counts / 2
                let off = i128::from(steps) * i128::from(counts) - i128::from(count) * i128::from(units * tens);
                prop_assert!(2 * off.abs() <= i128::from(units * tens), "{text}: {count}");
            }
            // Only at the very ends: half a count beyond them.
            Err(error) => prop_assert!(matches!(error, ValueError::OutOfRange { .. }), "{error}"),
        }
    }
}

const SHARE_TOML: &str = "[variants.base_frequency.share]\ncounts = 16384\nsigned = true\nlow = 1.0\nhigh = 400.0\n";

/// The profile above, whose `speed` counts a share of 3-03, whatever that is.
fn sharing(name: &str) -> Profile {
    let toml = TOML.split_once("[variants.base_frequency.choices]").unwrap().0.to_owned() + SHARE_TOML;
    folder_of(name, &toml, ROWS).load().unwrap()
}

#[test]
fn a_share_of_any_value_of_a_parameter() {
    let profile = sharing("any");
    // 3-03 counts thousandths of a hertz. 16384 × 10 / 87 = 1883.2; 16384 × 10 / 87.5 = 1872.5, of which 1872 is the smaller.
    for (raw, choice, hz, word) in [
        (50_000, "50 Hz", "10", 3_277),
        (60_000, "60 Hz", "10", 2_731),
        (87_000, "87 Hz", "10", 1_883),
        (87_500, "87.5 Hz", "10", 1_872),
        (400_000, "400 Hz", "400", 16_384),
        (1_000, "1 Hz", "0.5", 8_192),
    ] {
        assert_eq!(profile.choice_of("base_frequency", raw).as_deref(), Some(choice));
        let chosen = profile.with_variants([("base_frequency", choice)]).unwrap();
        assert_eq!(chosen.chosen()["base_frequency"], choice);
        let speed = chosen.find("speed").unwrap();
        assert_eq!(speed.encode(Input::Decimal(hz)), Ok(word), "{hz} of {choice}");
        assert_eq!((speed.quantity().unit(), speed.quantity().high().unwrap().to_f64()), ("Hz", f64::from(raw) / 1e3));
    }
    for raw in [0, 999, 400_001, u32::MAX] {
        assert_eq!(profile.choice_of("base_frequency", raw), None, "{raw}");
    }
    for same in ["87Hz", " 87.000 hz ", "87", "8.7e1"] {
        assert_eq!(profile.with_variants([("base_frequency", same)]).unwrap().chosen()["base_frequency"], "87 Hz");
    }
    for wrong in ["", "Hz", "rpm", "0.5 Hz", "401", "87.0001 Hz", "-50 Hz", "nan", "50 Hz Hz"] {
        let why = profile.with_variants([("base_frequency", wrong)]).unwrap_err().to_string();
        assert!(why.contains("ex5") && why.contains("1 Hz to 400 Hz"), "{wrong}: {why}");
    }
    assert_eq!(
        profile.share_between(&profile.variants()["base_frequency"]),
        Some(("1 Hz".to_owned(), "400 Hz".to_owned()))
    );
}

proptest! {
    /// Held to fractions: a word is at most half a count away from what was asked, and the whole is the whole.
    #[test]
    fn a_share_is_as_much_of_the_whole(raw in 1_000_u32..=400_000, part in 0_u32..=1_000) {
        let profile = sharing("parts");
        let choice = profile.choice_of("base_frequency", raw).unwrap();
        let chosen = profile.with_variants([("base_frequency", choice.as_str())]).unwrap();
        let speed = chosen.find("speed").unwrap();
        let whole = (speed.decode(16_384).to_f64() * 1e3 - f64::from(raw)).abs();
        prop_assert!(whole * 2.0 <= 10_f64.powi(3 - i32::from(speed.quantity().decimals())) + 1e-6, "{}", whole);
        // In thousandths of a hertz, rounded down: no more digits than the register reads with.
        let asked = u64::from(raw) * u64::from(part) / 1_000;
        let decimals = u32::from(speed.quantity().decimals());
        let step = 10_u64.pow(3_u32.saturating_sub(decimals));
        let asked = asked / step * step;
        let text = format!("{}.{:03}", asked / 1_000, asked % 1_000);
        let word = u64::from(speed.encode(Input::Decimal(&text)).unwrap());
        let off = (word * u64::from(raw)).abs_diff(asked * 16_384);
        prop_assert!(off * 2 <= u64::from(raw), "{} of {}: {}", text, choice, word);
    }
}
