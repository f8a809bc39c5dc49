//! What several threads do at one line, and what holds in whatever order they run.
//!
//! In each of them everybody comes to an end: a wake-up that is lost, or two who wait for each other, would keep one of them
//! for ever, and shuttle says so. One at a time has the line (`Line`). What is left to be done is told of once: it was
//! carried out, taken back, or given back (`Told`).

mod bus;
mod door;

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use drivebus_rtu::UnitAddress;
use shuttle::rand::{Rng, thread_rng};
use shuttle::sync::mpsc::{Receiver, Sender, channel};
use shuttle::thread;

use crate::system::clock;
use crate::turns::crew::Employer;
use crate::turns::order::{Claim, Priority, Program, Ticket};
use crate::turns::queue::{NoTurn, Queue, Stops, Turn};

use Priority::{Poll, Read, Stop, Write};

/// Everything that is explored, by name.
pub const ALL: &[(&str, fn())] = &[
    ("callers", callers),
    ("a_stop_is_next", a_stop_is_next),
    ("who_has_the_line_lets_a_stop_pass", who_has_the_line_lets_a_stop_pass),
    ("callers_give_up", callers_give_up),
    ("work_and_callers", work_and_callers),
    ("work_is_taken_back", work_is_taken_back),
    ("who_is_told_takes_long", who_is_told_takes_long),
    ("no_thread_is_given", no_thread_is_given),
    ("work_is_dismissed", work_is_dismissed),
    ("closing", closing),
    ("other_programs", other_programs),
    ("errands_and_callers", bus::errands_and_callers),
    ("an_errand_is_abandoned", bus::an_errand_is_abandoned),
    ("an_urgent_errand_is_next", bus::an_urgent_errand_is_next),
    ("no_start_follows_a_stop", bus::no_start_follows_a_stop),
    ("a_bus_is_closed", bus::a_bus_is_closed),
    ("a_bus_is_closed_by_who_waits", bus::a_bus_is_closed_by_who_waits),
    ("a_bus_is_dropped", bus::a_bus_is_dropped),
    ("programs_come_in", door::programs_come_in),
    ("a_stop_of_another_program_is_next", door::a_stop_of_another_program_is_next),
    ("a_program_goes", door::a_program_goes),
    ("a_program_takes_back", door::a_program_takes_back),
    ("the_system_refuses_for_a_while", door::the_system_refuses_for_a_while),
    ("who_is_in_is_ended", door::who_is_in_is_ended),
    ("a_bus_with_guests_is_closed", door::a_bus_with_guests_is_closed),
    ("an_opening_is_told", door::an_opening_is_told),
];

/// A line that notices when two have it.
#[derive(Debug, Default)]
struct Line {
    users: AtomicUsize,
}

impl Line {
    fn is_used(&self) {
        assert_eq!(self.users.fetch_add(1, Ordering::SeqCst), 0, "two have the line");
        thread::yield_now();
        self.users.fetch_sub(1, Ordering::SeqCst);
    }
}

/// What is left to be done; whoever drops it tells so, as an errand does.
#[derive(Debug)]
struct Told {
    number: usize,
    tell: Sender<usize>,
    /// What has to be told before: who is told takes so long.
    after: Option<Receiver<usize>>,
}

impl Told {
    fn new(number: usize, tell: &Sender<usize>) -> Self {
        Self { number, tell: tell.clone(), after: None }
    }
}

impl Drop for Told {
    fn drop(&mut self) {
        if let Some(after) = &self.after {
            assert!(after.recv().is_ok(), "it is told");
        }
        // Who left it may not want to know any more.
        let _ = self.tell.send(self.number);
    }
}

type Works = Queue<Told>;

/// Everything at one line.
#[derive(Debug, Clone, Default)]
struct Site {
    queue: Arc<Works>,
    line: Arc<Line>,
}

impl Site {
    fn new() -> Self {
        clock::set(false);
        Self::default()
    }

    /// One caller: waits for its turn and uses the line; whether it got it.
    fn call(&self, claim: impl Into<Claim>, give_up: &mut dyn FnMut() -> bool) -> bool {
        let turn = self.queue.turn(claim, give_up);
        if turn.is_ok() {
            self.line.is_used();
        }
        turn.is_ok()
    }

    fn spawn(&self, work: impl FnOnce(&Self) + Send + 'static) -> thread::JoinHandle<()> {
        let site = self.clone();
        thread::spawn(move || work(&site))
    }

    fn leave(&self, claim: impl Into<Claim>, work: Told, gives: Gives) -> Result<Ticket, (Told, NoTurn)> {
        let site = self.clone();
        self.queue.leave_work(claim.into(), work, move || Box::new(Hires { site, gives }))
    }

    /// Until so many wait.
    fn wait_for(&self, count: usize) {
        while self.queue.lock().order.len() < count {
            thread::yield_now();
        }
    }

    /// As a bus is closed: no work is taken any more, and the exchange under way is waited for.
    fn close(&self) {
        drop(self.queue.dismiss());
        assert!(self.call((Stop, None), &mut || false));
    }
}

/// Whether the system gives threads.
#[derive(Debug, Clone, Copy)]
enum Gives {
    Always,
    Sometimes,
}

/// Hires as a bus does.
#[derive(Debug)]
struct Hires {
    site: Site,
    gives: Gives,
}

impl Employer for Hires {
    fn is_there(&self) -> bool {
        true
    }

    fn hire(&self) -> bool {
        if matches!(self.gives, Gives::Sometimes) && thread_rng().r#gen() {
            return false;
        }
        let Site { queue, line } = self.site.clone();
        thread::spawn(move || queue.serve(|turn: Turn<'_, Told>, work| does(&line, turn, work)));
        true
    }
}

fn does(line: &Line, turn: Turn<'_, Told>, work: Told) {
    line.is_used();
    drop(turn);
    drop(work);
}

fn unit(raw: u8) -> Option<UnitAddress> {
    UnitAddress::new(raw).ok()
}

fn join(threads: impl IntoIterator<Item = thread::JoinHandle<()>>) {
    for one in threads {
        assert!(one.join().is_ok());
    }
}

/// Callers of every class: each has the line once.
fn callers() {
    let site = Site::new();
    let all = [(Poll, 1), (Read, 1), (Write, 2), (Stop, 2)];
    join(all.map(|(priority, raw)| site.spawn(move |site| assert!(site.call((priority, unit(raw)), &mut || false)))));
}

/// A stop that waits when the line comes free has it next, whoever waits besides.
fn a_stop_is_next() {
    let site = Site::new();
    let (tell, told) = channel();
    let Ok(first) = site.queue.turn((Read, unit(1)), &mut || false) else { return };
    let order = Arc::new(AtomicUsize::new(0));
    let others = [(Write, 1), (Stop, 2), (Read, 3)];
    let threads = others.map(|(priority, raw)| {
        let order = Arc::clone(&order);
        site.spawn(move |site| {
            let turn = site.queue.turn((priority, unit(raw)), &mut || false);
            let place = order.fetch_add(1, Ordering::SeqCst);
            assert_eq!(priority == Stop, place == 0, "a stop is next");
            site.line.is_used();
            drop(turn);
        })
    });
    assert!(site.leave((Write, unit(4)), Told::new(0, &tell), Gives::Always).is_ok());
    site.wait_for(others.len() + 1);
    drop(first);
    assert_eq!(told.recv(), Ok(0));
    join(threads);
    site.close();
}

/// Who has the line for several exchanges lets each stop go first that waits between two of them.
fn who_has_the_line_lets_a_stop_pass() {
    let site = Site::new();
    let stopped = Arc::new(AtomicUsize::new(0));
    let stop = {
        let stopped = Arc::clone(&stopped);
        site.spawn(move |site| {
            let turn = site.queue.turn((Stop, unit(1)), &mut || false);
            stopped.store(1, Ordering::SeqCst);
            site.line.is_used();
            drop(turn);
        })
    };
    let reads = site.spawn(|site| assert!(site.call((Read, unit(3)), &mut || false)));
    if let Ok(mut turn) = site.queue.turn((Write, unit(2)), &mut || false) {
        for _ in 0..2 {
            site.line.is_used();
            let waits = site.queue.has_stop();
            assert!(turn.let_pass(&mut || false));
            assert!(!waits || stopped.load(Ordering::SeqCst) == 1, "a stop was let pass");
        }
    }
    join([stop, reads]);
}

/// Who gives up is no loss to the others, also where it had been called already.
fn callers_give_up() {
    let site = Site::new();
    clock::set(true);
    let patient = [(Poll, 1), (Stop, 2)];
    let mut threads: Vec<_> = patient
        .into_iter()
        .map(|(priority, raw)| site.spawn(move |site| assert!(site.call((priority, unit(raw)), &mut || false))))
        .collect();
    threads.extend([(Read, 3), (Write, 4)].map(|(priority, raw)| {
        site.spawn(move |site| {
            site.call((priority, unit(raw)), &mut || thread_rng().r#gen());
        })
    }));
    join(threads);
}

/// Work of two programs' threads, and a caller that waits in its own: all is done.
fn work_and_callers() {
    let site = Site::new();
    let (tell, told) = channel();
    let leaves = [(Poll, 1), (Write, 2)].map(|(priority, raw)| {
        let tell = tell.clone();
        site.spawn(move |site| {
            for number in 0..2 {
                let work = Told::new(number, &tell);
                assert!(site.leave((priority, unit(raw)), work, Gives::Always).is_ok());
            }
        })
    });
    drop(tell);
    assert!(site.call((Read, unit(3)), &mut || false));
    assert_eq!((0..4).filter(|_| told.recv().is_ok()).count(), 4);
    join(leaves);
    site.close();
    assert!(told.recv().is_err(), "told once");
}

/// Work that nobody wants any more is taken back or done, and what waits behind it has its turn.
fn work_is_taken_back() {
    let site = Site::new();
    let (tell, told) = channel();
    let count = thread_rng().gen_range(1..=2);
    let tickets: Vec<_> = (0..count)
        .filter_map(|number| site.leave((Write, unit(1)), Told::new(number, &tell), Gives::Always).ok())
        .collect();
    drop(tell);
    let first = tickets[0];
    let taker = site.spawn(move |site| drop(site.queue.take_back(first)));
    assert!(site.call((Read, unit(2)), &mut || false));
    let mut numbers: Vec<_> = (0..count).filter_map(|_| told.recv().ok()).collect();
    numbers.sort_unstable();
    assert_eq!(numbers, (0..count).collect::<Vec<_>>());
    join([taker]);
    site.close();
    assert!(told.recv().is_err(), "told once");
}

/// Who is told what came of its work may take long: nobody counts on the thread that tells it.
fn who_is_told_takes_long() {
    let site = Site::new();
    let (tell, told) = channel();
    // When this is told, the one who did it may wait for work, or not yet.
    assert!(site.leave((Write, unit(1)), Told::new(0, &tell), Gives::Always).is_ok());
    assert_eq!(told.recv(), Ok(0));
    let (done, is_done) = channel();
    let first = Told { number: 1, tell, after: Some(is_done) };
    assert!(site.leave((Write, unit(1)), first, Gives::Always).is_ok());
    assert!(site.leave((Read, unit(1)), Told::new(2, &done), Gives::Always).is_ok());
    assert_eq!(told.recv(), Ok(1));
    site.close();
}

/// Where the system gives no thread, who left work is told so, and callers have the line, also those that waited behind it.
fn no_thread_is_given() {
    let site = Site::new();
    let (tell, told) = channel();
    let first = site.queue.turn((Read, unit(4)), &mut || false);
    let leaves = [(Stop, 1), (Write, 2)].map(|(priority, raw)| {
        let tell = tell.clone();
        site.spawn(move |site| {
            drop(site.leave((priority, unit(raw)), Told::new(0, &tell), Gives::Sometimes));
        })
    });
    drop(tell);
    let reads = site.spawn(|site| assert!(site.call((Read, unit(3)), &mut || false)));
    thread::yield_now();
    drop(first);
    assert_eq!((0..2).filter(|_| told.recv().is_ok()).count(), 2);
    join(leaves.into_iter().chain([reads]));
    site.close();
    assert!(told.recv().is_err(), "told once");
}

/// Work is given back and none is taken any more: who waits in its own thread has its turn all the same.
fn work_is_dismissed() {
    let site = Site::new();
    let (tell, told) = channel();
    assert!(site.leave((Write, unit(1)), Told::new(0, &tell), Gives::Always).is_ok());
    drop(tell);
    let dismisses = site.spawn(|site| drop(site.queue.dismiss()));
    assert!(site.call((Read, unit(2)), &mut || false));
    assert_eq!(told.recv(), Ok(0));
    join([dismisses]);
    assert!(told.recv().is_err(), "told once");
}

/// A bus that is closed while it is at work: whatever was left is told, callers come to their end, and nothing is taken then.
fn closing() {
    let site = Site::new();
    let (tell, told) = channel();
    let leaves = {
        let tell = tell.clone();
        site.spawn(move |site| {
            for number in 0..2 {
                drop(site.leave((Write, unit(1)), Told::new(number, &tell), Gives::Always));
            }
        })
    };
    let reads = site.spawn(|site| assert!(site.call((Read, unit(2)), &mut || false)));
    site.close();
    join([leaves, reads]);
    assert_eq!((0..2).filter(|_| told.recv().is_ok()).count(), 2);
    let refused = site.leave((Write, unit(1)), Told::new(9, &tell), Gives::Always);
    assert!(matches!(refused, Err((_, NoTurn::GivenUp))));
}

/// Calls of programs that use the line through this one: each waits in the queue as a caller does, looks whether the line
/// goes from hand to hand, and ends where the program is gone.
fn other_programs() {
    let site = Site::new();
    clock::set(true);
    let stays = (1..=2).map(|number| {
        site.spawn(move |site| {
            let mut watch = site.queue.watch();
            let claim = Claim { priority: Read, unit: unit(1), program: Program(number) };
            let mut looks = || watch.sees_nothing_move_for(std::time::Duration::from_secs(3_600));
            assert!(site.call(claim, &mut looks));
        })
    });
    let goes = site.spawn(|site| {
        let claim = Claim { priority: Write, unit: unit(1), program: Program(3) };
        site.call(claim, &mut || thread_rng().r#gen());
    });
    let threads: Vec<_> = stays.chain([goes]).collect();
    assert!(site.call((Stop, None), &mut || false));
    join(threads);
}
