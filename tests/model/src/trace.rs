//! A run of the model in words.

use std::fmt::Write;

use drivebus_rtu::Instant;

use crate::ends;
use crate::frames::{Asker, Coming, Content, Kind};
use crate::scenario::Scenario;
use crate::search::{Action, Heard, How};
use crate::world::{START, State, Wrong};

/// What does not hold after `path`, and how it came to that, a line for each step.
pub fn told(scenario: &Scenario, property: &str, path: Vec<(State, Option<Action>)>) -> String {
    let mut text = format!("not so: {property}\non the line \"{}\": {}\n", scenario.name, scenario.about);
    let coming = path.first().and_then(|(state, _)| state.units.first()).map_or(&[][..], |unit| &unit.coming);
    let strangers: Vec<_> = coming.iter().map(|coming| coming.content).collect();
    if !strangers.is_empty() {
        let _ = writeln!(text, "    0.00 s  the line is opened{}", also_asked(&strangers));
    }
    let began = path.first().map_or(START, |(state, _)| state.now);
    let mut last = None;
    let mut steps = path.into_iter().peekable();
    while let Some((before, Some(action))) = steps.next() {
        if let Some((after, _)) = steps.peek() {
            let _ = writeln!(text, "{}  {}", moment(began, after.now), line(&before, action, after));
            last = Some(after.clone());
        }
    }
    if let Some(state) = last {
        let why = match state.wrong {
            Some(Wrong::Misattributed) => "it was not given to this request",
            Some(Wrong::NotDone) => "it was not given to this request: what is reported did not happen",
            Some(Wrong::Denied) => "it is said not to have gone out",
            Some(Wrong::SentTwice) => "it was to be sent once",
            Some(Wrong::Unended) => "and the unit still is in doubt",
            None => ends::overdue(&state).unwrap_or("what is said does not hold"),
        };
        let _ = writeln!(text, "            WRONG: {why}");
    }
    text
}

fn moment(began: Instant, at: Instant) -> String {
    let since = at.saturating_duration_since(began);
    format!("{:8.2} s", since.as_secs_f64())
}

fn line(before: &State, action: Action, after: &State) -> String {
    let told = [after.told.outcome, after.told.call].into_iter().flatten().collect::<Vec<_>>().join("; ");
    let outcome = if told.is_empty() { String::new() } else { format!(": {told}") };
    match action {
        Action::Ask(unit, kind) => format!("a program is to {} unit {}{outcome}", asked(kind), unit + 1),
        Action::Send(heard) => {
            let what = after.told.sent.map_or("nothing to", asked);
            let unit = before.program.call.as_ref().map_or(0, |call| call.unit + 1);
            format!("request {}: {what} unit {unit}{}{outcome}", after.requests, way(heard))
        }
        Action::Arrive(unit, _, how) => {
            let came = after.told.came.map_or(String::new(), |came| answer(&came));
            let how = match how {
                How::Whole => "arrives",
                How::Twice => "arrives twice at once",
                How::Damaged => "arrives damaged",
                How::Cut => "arrives without its end",
            };
            let taken = match before.program.in_flight() {
                None => ", and nothing is waited for".to_owned(),
                Some(_) if told.is_empty() => ": not taken".to_owned(),
                Some(flight) => format!(", while request {} is waited for{outcome}", flight.number),
            };
            format!("  unit {}: {came} {how}{taken}", unit + 1)
        }
        Action::TimeOut => format!("  request {} times out{outcome}", before.requests),
        Action::Linger => "  half of the time-out is over".to_owned(),
        Action::Abort | Action::Quit => format!("  the call is cut short{outcome}"),
        Action::Wait(_) => format!("nothing is sent until now{outcome}"),
        Action::Open(strangers) => format!("the port is opened again{}", also_asked(strangers)),
        Action::Restart(unit) => format!("unit {} restarts and forgets what it was asked", unit + 1),
        Action::Change => "the registers change".to_owned(),
    }
}

const fn asked(kind: Kind) -> &'static str {
    match kind {
        Kind::Read(1) => "read 1 word of",
        Kind::Read(2) => "read 2 words of",
        Kind::Read(_) => "read more words of",
        Kind::Watch => "read 1 word, to see whether it stands, of",
        Kind::Input => "read 1 input register of",
        Kind::Set => "write a value that can be read back to",
        Kind::Run => "write RUN to",
        Kind::Stop => "write STOP, in doubt or not, to",
        Kind::Echo(_) => "echo a fresh word of",
    }
}

const fn way(heard: Heard) -> &'static str {
    match heard {
        Heard::Answered => "",
        Heard::Refused => ", which refuses it",
        Heard::OtherLength(_) => ", which gives another number of words",
        Heard::Lost => ", which does not hear it",
        Heard::Broken => "; the port is lost while it goes out",
        Heard::BackDamaged => "; the adapter sends it back damaged",
    }
}

fn answer(coming: &Coming) -> String {
    match coming.asker {
        Asker::Stranger => format!("the answer to another program ({})", content(coming.content)),
        Asker::Request(number) => format!("the answer to request {number} ({})", content(coming.content)),
    }
}

fn content(content: Content) -> String {
    match content {
        Content::Words(1, changed) => format!("the words of 1 register{}", if changed { ", changed" } else { "" }),
        Content::Words(count, changed) => {
            format!("the words of {count} registers{}", if changed { ", changed" } else { "" })
        }
        Content::Input(_) => "the word of 1 input register".to_owned(),
        Content::Done(Kind::Set) => "the value was written".to_owned(),
        Content::Done(Kind::Stop) => "STOP was written".to_owned(),
        Content::Done(_) => "RUN was written".to_owned(),
        Content::Echoed(_) => "its word".to_owned(),
        Content::Refused(_) => "a refusal".to_owned(),
    }
}

/// What another program is to be answered.
fn also_asked(strangers: &[Content]) -> String {
    let answers: Vec<_> = strangers.iter().map(|stranger| content(*stranger)).collect();
    if answers.is_empty() {
        String::new()
    } else {
        format!("; another program is to be answered: {}", answers.join(", then "))
    }
}
