//! Control words: commands that are made of bits, and starts that take several words.
//!
//! The drive does not exist. Its bits are those of CiA 402 (switch on 0, voltage 1, no quick stop 2, operation 3, reset 7) with
//! the reversal at 11; the words beside the tables are computed by hand.

use drivebus_drives::{Command, Profile, State};

use crate::folder::{FAULTS, Folder};

const HEAD: &str = r#"name = "bits"
title = "Bits"
kind = "inverter"
version = 1
source = "Bits manual"
[requests]
functions = [3, 6, 16]
max_words = 16
source = "Bits manual"
[parameters]
address = "listed"
source = "Bits manual"
"#;

const STATE: &str = r#"
[state]
register = "status"
source = "Bits manual"
[[state.when]]
is = "fault"
fields = { fault = 1 }
[[state.when]]
is = "forward"
fields = { ready = 1, on = 1, enabled = 1, reverse = 0 }
[[state.when]]
is = "reverse"
fields = { ready = 1, on = 1, enabled = 1, reverse = 1 }
[[state.when]]
is = "stopped"
fields = { enabled = 0 }
"#;

const BITS: &str = r#"
[bits]
control = [
    { name = "on", bits = [0, 0] },
    { name = "voltage", bits = [1, 1] },
    { name = "no_quick_stop", bits = [2, 2] },
    { name = "enable", bits = [3, 3] },
    { name = "mode", bits = [6, 4] },
    { name = "reset", bits = [7, 7] },
    { name = "reverse", bits = [11, 11] },
]
status = [
    { name = "ready", bits = [0, 0] },
    { name = "on", bits = [1, 1] },
    { name = "enabled", bits = [2, 2] },
    { name = "fault", bits = [3, 3] },
    { name = "reverse", bits = [15, 15] },
]
"#;

const REGISTERS: &str = "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source
0x2000,control,Control word,,1,no,,,,rw,yes,,x
0x2001,speed,Speed,Hz,10,no,0.0,50.0,,rw,yes,,x
0x2002,alarm_reset,Reset,,1,no,,,,wo,yes,,x
0x2100,status,Status word,,1,no,,,,ro,yes,,x
";
const PARAMETERS: &str = "code,address,name,label,unit,scale,signed,low,low_from,high,high_from,default,access,choices,verified,note,source\n";

/// The drive with `[commands]` of these texts: before the codes, the codes, and behind them.
fn folder_of(name: &str, before: &str, codes: &str, behind: &str, state: &str) -> Folder {
    let commands = format!(
        "[commands]\nregister = \"control\"\nmoves = [\"control\", \"alarm_reset\"]\nsource = \"Bits manual\"\n{before}\n\
             [commands.codes]\n{codes}\n{behind}\n"
    );
    let manifest = format!("{HEAD}{commands}{state}{BITS}");
    let files = [
        ("profile.toml", manifest.as_str()),
        ("registers.csv", REGISTERS),
        ("parameters.csv", PARAMETERS),
        ("faults.csv", FAULTS),
    ];
    Folder::new(&format!("bits-{name}"), &files)
}

const CODES: &str = "
run_forward = { on = 1, voltage = 1, no_quick_stop = 1, enable = 1 }
run_reverse = { on = 1, voltage = 1, no_quick_stop = 1, enable = 1, reverse = 1 }
stop = 0x07
coast = {}
";
const SEQUENCE: &str = "
[[commands.sequence]]
word = { voltage = 1, no_quick_stop = 1 }
label = \"shutdown\"
until = { ready = 1, on = 0 }
[[commands.sequence]]
word = 0x07
label = \"switch on\"
until = { ready = 1, on = 1, fault = 0 }
";

#[test]
fn a_word_is_made_of_its_bits_and_those_that_nobody_names_are_0() {
    let profile = folder_of("words", "", CODES, "", STATE).load().unwrap();
    let word = |command| profile.command(command).unwrap();
    assert_eq!(word(Command::RunForward), (0x2000.into(), 0x000F));
    assert_eq!(word(Command::RunReverse), (0x2000.into(), 0x080F));
    assert_eq!(word(Command::Stop), (0x2000.into(), 0x0007));
    assert_eq!(word(Command::Coast), (0x2000.into(), 0x0000));
    assert_eq!(profile.command_of(0x080F), Some(Command::RunReverse));
    assert_eq!(profile.find("control").unwrap().quantity().choices()[&0x080F], "run_reverse");
    assert!(profile.start_sequence().is_empty());
}

#[test]
fn a_base_says_what_each_word_of_bits_has_and_a_number_is_whole_by_itself() {
    // 43CH with bit 6, 7 or 15: Danfoss has such words. Here they stand for no drive.
    let codes = "run_forward = { enable = 1 }\nrun_reverse = { enable = 1, reverse = 1 }\nstop = {}\ncoast = 0x0004";
    for base in ["base = 0x0436", "base = { voltage = 1, no_quick_stop = 1, mode = 3 }"] {
        let profile = folder_of("base", base, codes, "", STATE).load().unwrap();
        // 0436H is 0000 0100 0011 0110; mode = 3 is 30H, voltage and no quick stop are 06H.
        let high = if base.contains("0x") { 0x0400 } else { 0 };
        let word = |command| profile.command(command).unwrap().1;
        assert_eq!(word(Command::RunForward), high | 0x003E);
        assert_eq!(word(Command::RunReverse), high | 0x083E);
        assert_eq!(word(Command::Stop), high | 0x0036);
        assert_eq!(word(Command::Coast), 0x0004);
    }
    // A field of the word itself goes over the base.
    let over = folder_of("over", "base = { mode = 5 }", "stop = { mode = 2 }", "", STATE).load().unwrap();
    assert_eq!(over.command(Command::Stop), Some((0x2000.into(), 0x0020)));
}

#[test]
fn a_sequence_is_kept_in_its_order_with_what_it_waits_for() {
    let profile = folder_of("order", "", CODES, SEQUENCE, STATE).load().unwrap();
    let [shutdown, switch_on] = profile.start_sequence() else { panic!("two words") };
    assert_eq!((shutdown.word, shutdown.label.as_str()), (0x0006, "shutdown"));
    let until: Vec<_> = shutdown.until.iter().map(|until| (until.field.as_str(), until.mask, until.value)).collect();
    assert_eq!(until, [("on", 0x0002, 0), ("ready", 0x0001, 0x0001)]);
    assert_eq!((switch_on.word, switch_on.label.as_str()), (0x0007, "switch on"));
    let until: Vec<_> = switch_on.until.iter().map(|until| (until.field.as_str(), until.mask, until.value)).collect();
    assert_eq!(until, [("fault", 0x0008, 0), ("on", 0x0002, 0x0002), ("ready", 0x0001, 0x0001)]);
    // Its words are words of the command register. 07H stops as well, and is called that.
    let codes = profile.command_codes();
    assert_eq!(codes.keys().copied().collect::<Vec<_>>(), [0x0000, 0x0006, 0x0007, 0x000F, 0x080F]);
    assert_eq!((codes[&6], codes[&7]), ("shutdown", "stop"));
    assert_eq!(profile.command_registers()[&0x2000.into()], codes);
    assert_eq!(profile.command_of(6), None);
    assert_eq!(profile.state(0x8037), State::Reverse);
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let wrong = |name: &str, before: &str, codes: &str, behind: &str, state: &str, says: &[&str]| {
        let folder = folder_of(name, before, codes, behind, state);
        let reasons = folder.reasons();
        assert_eq!(reasons.len(), says.len(), "{name}: {reasons:?}");
        for (reason, says) in reasons.iter().zip(says) {
            assert!(reason.contains(says), "{name}: \"{says}\" in {reason}");
        }
    };
    wrong(
        "same",
        "",
        "stop = 7\ncoast = { on = 1, voltage = 1, no_quick_stop = 1 }",
        "",
        STATE,
        &["has the code of stop"],
    );
    wrong("field", "", "stop = { onn = 1 }", "", STATE, &["control has no bit field \"onn\"; the closest is \"on\""]);
    wrong("fit", "", "stop = { mode = 8 }", "", STATE, &["8 does not fit the 3 bits of \"mode\""]);
    wrong("base", "base = { up = 1 }", "stop = {}", SEQUENCE, STATE, &["control has no bit field \"up\""]);
    wrong("text", "", "stop = \"7\"", "", STATE, &["expected a number, 0 to 65535, or a table of bit fields"]);
    wrong("large", "", "stop = 65536", "", STATE, &["expected a number, 0 to 65535"]);
    wrong("below", "", "stop = -1", "", STATE, &["expected a number, 0 to 65535"]);
    wrong(
        "elsewhere",
        "",
        CODES,
        "[commands.elsewhere]\nreset_fault = { register = \"alarm_reset\", code = { reset = 1 } }",
        STATE,
        &["alarm_reset has no bit field \"reset\""],
    );
    let step =
        |word: &str, until: &str| format!("[[commands.sequence]]\nword = {word}\nlabel = \"step\"\nuntil = {until}\n");
    wrong("run", "", CODES, &step("15", "{ ready = 1 }"), STATE, &["15 has the code of run_forward"]);
    wrong("never", "", CODES, &step("6", "{}"), STATE, &["\"until\" is empty"]);
    wrong("unknown", "", CODES, &step("6", "{ red = 1 }"), STATE, &["status has no bit field \"red\""]);
    wrong("stateless", "", CODES, &step("6", "{ ready = 1 }"), "", &["there is no [state]"]);
    let twice = format!("{SEQUENCE}{}", step("6", "{ ready = 1 }"));
    wrong("twice", "", CODES, &twice, STATE, &["6 is in the sequence already"]);
    let other = format!("[commands.other]\n\"0x0006\" = \"hum\"\n{}", step("6", "{ ready = 1 }"));
    wrong("other", "", CODES, &other, STATE, &["6 has the code of \"hum\""]);
    let unnamed = step("6", "{ ready = 1 }").replace("\"step\"", "\"\"");
    wrong("unnamed", "", CODES, &unnamed, STATE, &["\"label\" is empty"]);
    let unfinished = "[[commands.sequence]]\nword = 6\nlabel = \"step\"\n";
    wrong("unfinished", "", CODES, unfinished, STATE, &["\"until\" is missing"]);
}

#[test]
fn another_state_word_needs_another_sequence() {
    let below = folder_of("below-state", "", CODES, SEQUENCE, STATE);
    let name = below.0.file_name().unwrap().to_str().unwrap().to_owned();
    let above = folder_of("above-state", "", CODES, "", STATE);
    let table = "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source
0x2200,other_status,Another,,1,no,,,,ro,yes,,x\n";
    above.write("registers.csv", table);
    let manifest = format!(
        "name = \"over\"\nsource = \"x\"\n[overlay]\nprofile = \"../{name}\"\n[state]\nregister = \"other_status\"\n\
         source = \"x\"\n[state.codes]\nforward = 1\nstopped = 2\n"
    );
    above.write("profile.toml", &manifest);
    let said = Profile::check(&above.0).iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    assert!(said.contains("\"shutdown\" waits for on of other_status"), "{said}");
    // Without a change of state the sequence is taken over.
    let manifest = format!("name = \"over\"\nsource = \"x\"\n[overlay]\nprofile = \"../{name}\"\n");
    above.write("profile.toml", manifest);
    assert_eq!(above.load().unwrap().start_sequence().len(), 2);
}
