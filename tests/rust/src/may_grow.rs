//! What may grow cannot be matched, taken apart or put together from outside as if it were whole.
//!
//! Each example stands here twice: with the arm or the dots for what is new it compiles, without it does not.
//! `tests/may_grow.rs` holds that each list of variants is whole, without which the second would prove nothing.

/// A `match` over an enum: its name, its path, and all its variants of today.
macro_rules! matched {
    ($name:ident, $path:literal, $($variant:literal),+) => {
        #[doc = concat!("```\nfn f(value: ", $path, ") { use ", $path, "::*; match value { ", $($variant, " => {}, ",)+ "_ => {} } }\n```")]
        #[doc = concat!("```compile_fail,E0004\nfn f(value: ", $path, ") { use ", $path, "::*; match value { ", $($variant, " => {}, ",)+ "} }\n```")]
        struct $name;
    };
}

/// A struct taken apart: its name, its path, and all its fields of today.
macro_rules! taken_apart {
    ($name:ident, $path:literal, $fields:literal) => {
        #[doc = concat!("```\nfn f(value: ", $path, ") { let ", $path, " { ", $fields, ", .. } = value; }\n```")]
        #[doc = concat!("```compile_fail,E0638\nfn f(value: ", $path, ") { let ", $path, " { ", $fields, " } = value; }\n```")]
        struct $name;
    };
}

matched!(
    Request,
    "drivebus::rtu::Request",
    "Read { .. }",
    "WriteCoil { .. }",
    "WriteSingle { .. }",
    "Echo { .. }",
    "WriteMultiple { .. }",
    "WriteCoils { .. }",
    "ReportServerId",
    "MaskWrite { .. }",
    "ReadWrite { .. }",
    "ReadIdentification { .. }",
    "Huanyang(_)",
    "Custom { .. }"
);
matched!(
    Answer,
    "drivebus::rtu::Answer",
    "Read { .. }",
    "WriteCoil { .. }",
    "WriteSingle { .. }",
    "Echo { .. }",
    "WriteMultiple { .. }",
    "WriteCoils { .. }",
    "ServerId { .. }",
    "MaskWrite { .. }",
    "ReadWrite { .. }",
    "Identification { .. }",
    "Exception { .. }",
    "Custom { .. }"
);
matched!(
    Event,
    "drivebus::rtu::Event",
    "Transmit(_)",
    "Answer(_)",
    "Wrong { .. }",
    "Corrupt { .. }",
    "NoAnswer { .. }",
    "BroadcastDone",
    "Busy"
);
matched!(Attribution, "drivebus::rtu::Attribution", "Certain", "Repeat { .. }", "Wait(_)", "Others(_)");
matched!(Role, "drivebus::rtu::Role", "Request", "Answer", "Late", "Doubtful", "Stray", "Noise(_)");
taken_apart!(Tally, "drivebus::rtu::Tally", "late, foreign, misfit, noise, noise_idle, own_echo, own_remnant");
taken_apart!(Patience, "drivebus::rtu::Patience", "pause, usual");
taken_apart!(
    CallError,
    "drivebus::line::CallError",
    "failure, destination, request, protocol, raw, sent, ended, set_again"
);
taken_apart!(PortError, "drivebus::line::PortError", "kind, port, message");
taken_apart!(Overheard, "drivebus::line::Overheard", "at, direction, bytes");
taken_apart!(Link, "drivebus::line::Link", "good, asked");
taken_apart!(ReadCost, "drivebus::drives::ReadCost", "request, word");
