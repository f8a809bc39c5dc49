//! A soak: a bus, eight simulated drives, several threads and every fault, for days of virtual time.
//!
//! Every word that is read has a value that is known, and every write has a value of its own. So a reply that was taken
//! for the answer to something else shows as a wrong value, and the drives' own logs show what was done, and how often.
//! Some words are changed before each read, so that an answer to an earlier read of the same words shows too.
//!
//! [`run`] does it; `main` prints what came of it. Chance comes from the seed. With more than one thread the order in which
//! they come to the line is the system's; with one, the same plan gives the same run but for the words of probes.

mod assumed;
mod chance;
mod hand;
mod journal;
mod poller;
mod rig;
mod roles;
mod verdict;
mod watcher;

use std::thread;
use std::time::{Duration, Instant};

pub use assumed::ASSUMED;
pub use rig::{Rig, UNITS};
pub use verdict::{Verdict, Wrong};

use chance::Chance;
use poller::Poller;
use roles::{Commander, Reader, Role, Writer};
use watcher::Watcher;

/// What to run.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// How much virtual time, at most.
    pub time: Duration,
    /// How many calls, at most.
    pub calls: u64,
    /// Where chance comes from.
    pub seed: u64,
    /// The share of answers that each kind of fault hits.
    pub rate: f64,
    /// The share of answers after which the adapter falls out.
    pub unplug_rate: f64,
    /// How long between two times that the adapter is pulled out by hand, on average.
    pub pull_every: Duration,
    /// How many threads use the bus, 1..=8.
    pub threads: usize,
    /// Whether all units answer with as many words as they are asked for. Else each has shown before that it does not: the first
    /// such answer comes in its turn ([`ASSUMED`]).
    pub whole: bool,
}

impl Default for Plan {
    /// A day, and three answers in a thousand hit by each kind of fault.
    fn default() -> Self {
        Self {
            time: Duration::from_secs(24 * 3_600),
            calls: u64::MAX,
            seed: 0,
            rate: 0.003,
            unplug_rate: 0.000_05,
            pull_every: Duration::from_secs(60),
            threads: 8,
            whole: false,
        }
    }
}

/// Runs `plan` to its end.
///
/// # Errors
///
/// Why it could not begin, in words.
pub fn run(plan: &Plan) -> Result<Verdict, String> {
    let began = Instant::now();
    let rig = Rig::new(plan)?;
    let mut roles = roles(plan.seed);
    let threads = plan.threads.clamp(1, roles.len());
    let mut shares: Vec<Vec<Box<dyn Role>>> = (0..threads).map(|_| Vec::new()).collect();
    for (index, role) in roles.drain(..).enumerate() {
        let thread = index % shares.len();
        shares[thread].push(role);
    }
    let verdicts: Vec<Verdict> = thread::scope(|scope| {
        let workers: Vec<_> = shares.into_iter().map(|share| scope.spawn(|| work(&rig, share))).collect();
        workers.into_iter().filter_map(|worker| worker.join().ok()).collect()
    });
    let finished = verdicts.len();
    let mut verdict = verdicts.into_iter().fold(Verdict::default(), Verdict::with);
    verdict.panicked = (threads - finished) as u64;
    rig.conclude(&mut verdict);
    verdict.wall = began.elapsed();
    verdict.seed = plan.seed;
    Ok(verdict)
}

/// Three readers, two writers for half of the units each, one who commands all motors, one who polls, and one
/// who reads what moves.
fn roles(seed: u64) -> Vec<Box<dyn Role>> {
    let chance = |number: u64| Chance::new(seed.wrapping_mul(16).wrapping_add(number));
    vec![
        Box::new(Reader::new(chance(1))),
        Box::new(Writer::new(chance(2), &UNITS[..UNITS.len() / 2])),
        Box::new(Commander::new(chance(3))),
        Box::new(Reader::new(chance(4))),
        Box::new(Writer::new(chance(5), &UNITS[UNITS.len() / 2..])),
        Box::new(Reader::new(chance(6))),
        Box::new(Poller::new(chance(7))),
        Box::new(Watcher::new(chance(8))),
    ]
}

/// Lets `roles` take turns until the plan is fulfilled.
fn work(rig: &Rig, mut roles: Vec<Box<dyn Role>>) -> Verdict {
    let mut verdict = Verdict::default();
    'plan: loop {
        for role in &mut roles {
            if !rig.goes_on() {
                break 'plan;
            }
            role.act(rig, &mut verdict);
            rig.tend();
        }
    }
    for role in &mut roles {
        role.settle(rig, &mut verdict);
    }
    verdict
}
