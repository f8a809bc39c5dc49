//! How long is listened, and who may end that, on a line on which nobody answers.

use std::sync::Arc;
use std::thread;

use drivebus_rtu::{FreshWords, OwnEcho, Question, Request, SerialFormat, UnitAddress};

use super::*;

use crate::turns::order::Priority;
use crate::turns::queue::Waiter;

/// A queue in which no work is left.
type Queue = crate::turns::queue::Queue<()>;

/// A line on which nobody answers, or somebody says a byte now and then. Time passes only while it is waited on.
#[derive(Debug, Default)]
struct Silent {
    now: Instant,
    noise: Option<Duration>,
    sent: bool,
}

impl Line for Silent {
    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, _: &[u8]) -> Result<Instant, PortError> {
        self.sent = true;
        Ok(self.now)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let before = self.now;
        self.now = self.now.max(until);
        match self.noise {
            Some(each) if self.sent && before + each <= until => {
                (self.now, buffer[0]) = (before + each, 0x55);
                Ok(1)
            }
            _ => Ok(0),
        }
    }

    fn sleep(&mut self, until: Instant) {
        self.now = self.now.max(until);
    }

    fn name(&self) -> String {
        "silent".to_owned()
    }
}

/// What a read over `line` came to, and when.
fn read(line: Silent, timeout: u64, yields: Option<&Queue>, give_up: &mut dyn FnMut() -> bool) -> (Failure, Instant) {
    let request = Request::read(0x2100, 1).unwrap();
    let ask = Ask {
        destination: UnitAddress::new(9).unwrap().into(),
        request: &request,
        timeout: Duration::from_millis(timeout),
        learns: false,
        gap: Duration::ZERO,
        in_doubt: true,
        yields: yields.map(|queue| queue as &dyn Stops),
        meanings: None,
    };
    let mut line: Option<Box<dyn Line>> = Some(Box::new(line));
    let opener = Box::new(move || Ok(line.take().unwrap()));
    let mut owner = Owner::new(opener, SerialFormat::DEFAULT, OwnEcho::Absent, 7, Arc::default());
    owner.open(&mut || false).unwrap();
    let words = FreshWords::beginning_at(7);
    let question = Question::new(ask.destination, request, ask.timeout).in_doubt(true);
    let mut talk = Talk::new(Conversation::new(question, &words), &ask, &|| true);
    loop {
        let now = owner.now();
        if let Then::Done(result) = owner.go_on(&mut talk, now, give_up, &mut |_| ()) {
            return (result.unwrap_err().failure, owner.now());
        }
    }
}

fn queue_with(priority: Priority) -> Queue {
    let queue = Queue::default();
    let mut state = queue.lock();
    let ticket = state.order.ticket((priority, None).into());
    state.order.wait(ticket, Waiter::Thread(thread::current()));
    drop(state);
    queue
}

fn waited(failure: &Failure) -> Duration {
    match failure {
        Failure::NoAnswer { timeout, .. } => *timeout,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_stop_that_waits_waits_no_longer_for_a_silent_unit_than_that_might_take() {
    let cut_short = waited(&read(Silent::default(), 2_000, Some(&queue_with(Priority::Stop)), &mut || false).0);
    assert!((STOP_WAITS..STOP_WAITS + LOOK_UP).contains(&cut_short), "{cut_short:?}");
}

#[test]
fn nothing_else_cuts_a_wait_short() {
    for yields in [None, Some(&queue_with(Priority::Write)), Some(&Queue::default())] {
        let (failure, _) = read(Silent::default(), 2_000, yields, &mut || false);
        assert_eq!(waited(&failure), Duration::from_secs(2));
    }
}

#[test]
fn what_still_comes_is_waited_for() {
    let line = Silent { noise: Some(Duration::from_millis(40)), ..Silent::default() };
    let (_, ended) = read(line, 2_000, Some(&queue_with(Priority::Stop)), &mut || false);
    assert!(ended >= Instant::ZERO + Duration::from_secs(2), "{ended:?}");
}

#[test]
fn who_gives_up_is_heard_after_the_shortest_time_out() {
    let mut asked = 0;
    let mut give_up = || {
        asked += 1;
        true
    };
    assert_eq!(read(Silent::default(), 5, None, &mut give_up).0, Failure::Interrupted);
    assert_eq!(asked, 1);
}

#[test]
fn a_character_may_take_as_long_as_it_likes() {
    for char_time in [Duration::from_nanos(u64::MAX), Duration::MAX] {
        let mut pace = Pace::new(char_time);
        assert_eq!(pace.nearly_whole(Instant::ZERO, 3, 250), Some(Instant::from_nanos(u64::MAX)));
    }
}
