//! Searches lines and says what was found. Exit code 1 when something does not hold, with the shortest run that shows it.

use std::process::ExitCode;

use drivebus_model::{Order, SCENARIOS, Scenario, Search};

const USAGE: &str = "drivebus-model [--deep] [--threads N] [--requests N] [--faults N] [--COUNTER N …] [LINE …]";

/// What to search.
struct Plan {
    deep: bool,
    threads: usize,
    /// What may happen otherwise than the line says: a counter and its value.
    otherwise: Vec<(String, u8)>,
    lines: Vec<&'static Scenario>,
}

#[expect(clippy::print_stderr, reason = "what it is for")]
fn main() -> ExitCode {
    match plan(std::env::args().skip(1)) {
        Ok(plan) if search(&plan) => ExitCode::SUCCESS,
        Ok(_) => ExitCode::FAILURE,
        Err(why) => {
            eprintln!("{why}");
            ExitCode::from(2)
        }
    }
}

fn plan(mut words: impl Iterator<Item = String>) -> Result<Plan, String> {
    let mut plan = Plan { deep: false, threads: 1, otherwise: Vec::new(), lines: Vec::new() };
    while let Some(word) = words.next() {
        if let Some(scenario) = SCENARIOS.iter().find(|scenario| scenario.name == word) {
            plan.lines.push(scenario);
        } else if word == "--deep" {
            plan.deep = true;
        } else if let Some(counter) = word.strip_prefix("--") {
            let count: u8 = words.next().and_then(|count| count.parse().ok()).ok_or(USAGE)?;
            match counter {
                "threads" => plan.threads = usize::from(count.max(1)),
                _ if SCENARIOS[0].small.clone().named(counter).is_some() => {
                    plan.otherwise.push((counter.into(), count));
                }
                _ => return Err(format!("{word} is unknown; {USAGE}")),
            }
        } else {
            return Err(format!("{word} is unknown; {USAGE}"));
        }
    }
    if plan.lines.is_empty() {
        plan.lines.extend(SCENARIOS);
    }
    Ok(plan)
}

/// Searches and prints; whether all holds.
#[expect(clippy::print_stdout, reason = "what it is for")]
fn search(plan: &Plan) -> bool {
    let (mut holds, mut states, mut seconds) = (true, 0, 0.0);
    println!("{:20} {:>10} {:>11} {:>6} {:>8}", "line", "states", "steps", "depth", "seconds");
    for scenario in &plan.lines {
        let mut budget = if plan.deep { scenario.deep } else { scenario.small };
        for (counter, count) in &plan.otherwise {
            budget.named(counter).into_iter().for_each(|left| *left = *count);
        }
        let order = if plan.deep { Order::Deepest } else { Order::Shortest };
        let found = Search::new(scenario, budget).run(order, plan.threads);
        println!(
            "{:20} {:>10} {:>11} {:>6} {:>8.1}",
            scenario.name, found.states, found.steps, found.depth, found.seconds
        );
        states += found.states;
        seconds += found.seconds;
        holds &= found.refuted.is_none() && found.unseen.is_empty();
        match &found.refuted {
            Some(_) if order == Order::Deepest => {
                let shortest = Search::new(scenario, budget).run(Order::Shortest, 1);
                if let Some((_, trace)) = shortest.refuted {
                    print!("{trace}");
                }
            }
            Some((_, trace)) => print!("{trace}"),
            None if !found.unseen.is_empty() => println!("not seen: {:?}", found.unseen),
            None => {}
        }
    }
    println!("{:20} {states:>10} {seconds:>27.1}", "all");
    holds
}
