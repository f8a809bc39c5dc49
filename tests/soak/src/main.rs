//! `drivebus-soak --hours 24 --seed 7`: a soak in virtual time, and its verdict. Exit code 1 when anything was wrong.

use std::process::ExitCode;
use std::time::Duration;

use drivebus_soak::{Plan, run};

const USAGE: &str =
    "drivebus-soak [--hours H] [--calls N] [--seed N] [--rate SHARE] [--threads 1..8] [--lengths any|whole]";

#[expect(clippy::print_stdout, clippy::print_stderr, reason = "what it is for")]
fn main() -> ExitCode {
    let verdict = plan(std::env::args().skip(1)).and_then(|plan| run(&plan));
    match verdict {
        Ok(verdict) => {
            print!("{verdict}");
            println!("{}", if verdict.is_good() { "All of it was true." } else { "NOT all of it was true or tried." });
            if verdict.is_good() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
        Err(why) => {
            eprintln!("{why}");
            ExitCode::from(2)
        }
    }
}

fn plan(mut words: impl Iterator<Item = String>) -> Result<Plan, String> {
    let mut plan = Plan::default();
    while let Some(name) = words.next() {
        let value = words.next().ok_or(USAGE)?;
        let mistake = |_| format!("{name} {value} is wrong; {USAGE}");
        match name.as_str() {
            "--hours" => {
                let hours: f64 = value.parse().map_err(|_| USAGE)?;
                plan.time = Duration::try_from_secs_f64(hours * 3_600.0).map_err(|error| error.to_string())?;
            }
            "--rate" => plan.rate = value.parse().map_err(|_| USAGE)?,
            "--calls" => plan.calls = value.parse().map_err(mistake)?,
            "--seed" => plan.seed = value.parse().map_err(mistake)?,
            "--lengths" if value == "any" || value == "whole" => plan.whole = value == "whole",
            "--threads" => plan.threads = value.parse::<usize>().map_err(mistake)?.clamp(1, 8),
            _ => return Err(format!("{name} is unknown; {USAGE}")),
        }
    }
    Ok(plan)
}
