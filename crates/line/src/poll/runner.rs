//! What a poll does: asks whom its schedule names, and puts what came where it is waited for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use drivebus_rtu::{Answer, Instant, Request, UnitAddress};

use crate::ask::Done;
use crate::bus::Bus;
use crate::error::{CallError, Failure};
use crate::options::CallOptions;
use crate::poll::ring::PollSample;
use crate::poll::samples::Samples;
use crate::poll::schedule::{Schedule, Step};
use crate::poll::target::PollTarget;
use crate::turns::order::Priority;

/// What came of going on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Progress {
    /// A target was asked, or a beat was waited for.
    Asked,
    /// Who waits gave up.
    GivenUp,
    /// The bus was closed.
    Over,
}

/// Who asks.
#[derive(Debug)]
pub(crate) struct Runner {
    bus: Arc<Bus>,
    targets: Vec<PollTarget>,
    schedule: Schedule,
    words: Vec<u16>,
}

impl Runner {
    pub(crate) fn new(bus: Arc<Bus>, targets: Vec<PollTarget>, interval: Option<Duration>) -> Self {
        let schedule = Schedule::new(targets.len(), interval);
        let mut runner = Self { bus, targets, schedule, words: Vec::new() };
        runner.words.reserve(runner.most_words());
        runner
    }

    /// The most words that one target brings.
    pub(crate) fn most_words(&self) -> usize {
        let words = |target: &PollTarget| target.reads.iter().map(|&(.., count)| usize::from(count)).sum();
        self.targets.iter().map(words).max().unwrap_or(0)
    }

    /// Asks in a thread of its own until `stop` is set or the bus is closed.
    pub(crate) fn spawn(mut self, samples: Arc<Samples>, stop: Arc<AtomicBool>) -> std::io::Result<JoinHandle<()>> {
        thread::Builder::new().name("drivebus poll".to_owned()).spawn(move || {
            // However this ends: nobody waits for what never comes.
            let samples = EndsWith(samples);
            self.bus.enter_thread();
            let samples = &*samples.0;
            while !stop.load(Ordering::Acquire) && !self.bus.is_shut() {
                match self.schedule.step(self.bus.now()) {
                    Step::Pause(until) => samples.pause(&self.bus, until),
                    Step::Ask(target) => {
                        if self.ask(target, samples, &mut || stop.load(Ordering::Acquire)) != Progress::Asked {
                            break;
                        }
                    }
                }
            }
        })
    }

    /// Asks the next target, or waits on the line's clock for when it is to be asked, not beyond `deadline`.
    pub(crate) fn go_on(
        &mut self,
        samples: &Samples,
        deadline: Option<Instant>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Progress {
        let now = self.bus.now();
        match self.schedule.step(now) {
            Step::Ask(target) => self.ask(target, samples, give_up),
            Step::Pause(until) => {
                let until = deadline.map_or(until, |deadline| deadline.min(until));
                let mut ended = false;
                self.bus.sleep(until.saturating_duration_since(now), &mut || {
                    ended = give_up();
                    ended
                });
                match (self.bus.is_closed(), ended) {
                    (true, _) => Progress::Over,
                    (_, true) => Progress::GivenUp,
                    // The clock went away with a port that was lost; asking is what opens it again.
                    _ if self.bus.now() <= now => self.ask(self.schedule.next(), samples, give_up),
                    _ => Progress::Asked,
                }
            }
        }
    }

    /// Asks `target` for all its words; the first read that fails ends it.
    fn ask(&mut self, target: usize, samples: &Samples, give_up: &mut dyn FnMut() -> bool) -> Progress {
        let PollTarget { unit, reads } = &self.targets[target];
        self.words.clear();
        let late = self.schedule.missed();
        let mut sample = PollSample { target, sent: Instant::ZERO, ended: Instant::ZERO, late, missing: None };
        let mut heard = true;
        for (index, &(table, address, count)) in reads.iter().enumerate() {
            let Ok(request) = Request::read_of(table, address, count) else {
                continue; // checked when the poll began
            };
            let result = self.bus.ask_polled(*unit, &request, &mut self.words, give_up);
            let (sent, ended) = match &result {
                Ok(done) => (done.sent, done.ended),
                Err(error) => {
                    let ended = error.ended.unwrap_or_else(|| self.bus.now());
                    (error.sent.unwrap_or(ended), ended)
                }
            };
            sample.sent = if index == 0 { sent } else { sample.sent };
            sample.ended = ended;
            if let Err(error) = result {
                match error.failure {
                    Failure::Closed | Failure::Forked => return Progress::Over,
                    Failure::Interrupted => return Progress::GivenUp,
                    Failure::NotAsked { .. } | Failure::Port(_) | Failure::NotBegun(_) | Failure::QueueFull { .. } => {
                        heard = index > 0;
                    }
                    _ => {}
                }
                sample.missing = Some(error);
                break;
            }
        }
        self.schedule.asked(self.bus.now(), heard);
        samples.put(sample, &self.words, &self.schedule);
        Progress::Asked
    }
}

impl Bus {
    /// Asks `unit` for `words`. What does not come is asked for in the next cycle: repeating it now would keep the others
    /// waiting. A refusal by which the unit decides nothing comes at once, so that one is: within the bus's retries, and as
    /// a call of its own each time, which whatever is more urgent goes before.
    fn ask_polled(
        &self,
        unit: UnitAddress,
        request: &Request<'_>,
        words: &mut Vec<u16>,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Done, Box<CallError>> {
        let options = CallOptions { priority: Some(Priority::Poll), retries: Some(0), ..CallOptions::default() };
        let most = self.options().retries.saturating_mul(2).saturating_add(1);
        let mut attempts = 1;
        loop {
            let result = self.call(unit.into(), request, options, give_up, &mut |answer| {
                if let Answer::Read { words: came, .. } = answer {
                    words.extend(came.iter());
                }
            });
            let mut error = match result {
                Err(error) if self.asks_again(unit, &error.failure) => error,
                result => return result,
            };
            if attempts >= most {
                if let Failure::Refused { code, .. } = error.failure {
                    error.failure = Failure::Unheard { code, attempts };
                }
                return Err(error);
            }
            attempts += 1;
        }
    }
}

/// Ends the samples when it goes.
struct EndsWith(Arc<Samples>);

impl Drop for EndsWith {
    fn drop(&mut self) {
        self.0.end();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, Sender, channel};

    use drivebus_rtu::{Adu, SerialFormat, UnitAddress};

    use super::*;
    use crate::line::{Line, PortError};
    use crate::options::BusOptions;
    use crate::poll::Poll;
    use crate::system::clock::{monotonic, sleep_until};

    /// A unit that has zero everywhere. It says what it hears, and answers the first request only when it is told to.
    #[derive(Debug)]
    struct Slow {
        heard: Sender<Vec<u8>>,
        go: Option<Receiver<()>>,
        answer: Vec<u8>,
    }

    impl Line for Slow {
        fn now(&self) -> Instant {
            monotonic()
        }

        fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
            self.answer = match bytes[1] {
                3 => {
                    let words = vec![0; usize::from(bytes[5])];
                    Adu::answer(UnitAddress::new(bytes[0]).unwrap(), &Answer::read(&words).unwrap()).as_bytes().to_vec()
                }
                _ => bytes.to_vec(),
            };
            let _ = self.heard.send(bytes.to_vec());
            Ok(monotonic())
        }

        fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
            if self.answer.is_empty() {
                sleep_until(until);
                return Ok(0);
            }
            if let Some(go) = self.go.take() {
                go.recv().unwrap();
            }
            let count = self.answer.len();
            buffer[..count].copy_from_slice(&self.answer);
            self.answer.clear();
            Ok(count)
        }

        fn sleep(&mut self, until: Instant) {
            sleep_until(until);
        }

        fn name(&self) -> String {
            "slow".to_owned()
        }

        fn gapless(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_stop_is_the_next_request_and_a_read_comes_before_the_poll_goes_on() {
        let ((heard, requests), (go, told)) = (channel(), channel());
        let mut line = Some(Slow { heard, go: Some(told), answer: Vec::new() });
        let opener = move || -> Result<Box<dyn Line>, PortError> { Ok(Box::new(line.take().unwrap())) };
        let options = BusOptions { timeout: Duration::from_secs(60), ..BusOptions::new(SerialFormat::DEFAULT) };
        let bus = Arc::new(Bus::open(Box::new(opener), options, &mut || false).unwrap());
        let unit = UnitAddress::new(1).unwrap();
        let targets = vec![PollTarget::new(unit, vec![(0x3000, 16), (0x3010, 7)])];
        let poll = Poll::start(Arc::clone(&bus), targets, None, 9).unwrap();
        assert_eq!(requests.recv().unwrap()[..4], [1, 3, 0x30, 0]);
        thread::scope(|scope| {
            let stop = CallOptions { priority: Some(Priority::Stop), in_doubt: true, ..CallOptions::default() };
            for (waiting, request, options) in
                [(1, Request::read(0x2100, 1).unwrap(), CallOptions::default()), (2, Request::write(0x2000, 5), stop)]
            {
                let bus = &bus;
                scope.spawn(move || {
                    bus.call(unit.into(), &request, options, &mut || false, &mut |_| ()).unwrap();
                });
                while bus.waiting() < waiting {
                    thread::yield_now();
                }
            }
            go.send(()).unwrap();
            let next: Vec<_> = requests.iter().take(3).map(|frame| frame[1..4].to_vec()).collect();
            assert_eq!(next, [[6, 0x20, 0], [3, 0x21, 0], [3, 0x30, 0x10]]);
        });
        poll.close();
        assert!(poll.is_over());
        assert_eq!(poll.counts().missing, 0);
    }
}
