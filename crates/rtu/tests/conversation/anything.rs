//! Whatever is said to a conversation, at whatever moments: it never panics, sends no write twice without having looked, and
//! ends within its bounds.

use drivebus_rtu::*;
use proptest::prelude::*;

use crate::rig::*;

/// Requests that one call may send for each time that it may ask.
const EACH: usize = 8;
/// What a stop may ask beyond that to prepare its question at first contact, in shapes that each come once.
const PREPARED: usize = 20;

const WORDS: [u16; 2] = [5, 6];

/// What is said to it.
#[derive(Debug, Clone)]
enum Said {
    /// What it asks for is done, with these bytes where it listens.
    Right(Vec<u8>),
    Next,
    Sent(i32),
    Heard(i32, Vec<u8>),
    Cut(Cut),
    GiveWay,
    Wanted(bool),
    Expect(Option<u16>),
    Opened(Opened),
    Closed,
    Abort,
    Stray(Vec<u8>),
    /// Another call begins on the same line.
    Another(Box<(u8, bool)>),
}

fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let unit = UNIT.get();
    prop_oneof![
        3 => Just(Vec::new()),
        2 => prop::collection::vec(0..3_u16, 1..=3).prop_map(|all| words(&all)),
        2 => (prop::sample::select(vec![3_u8, 6, 8, 16]), 1..=11_u8)
            .prop_map(move |(function, code)| sealed(&[unit, function | 0x80, code])),
        1 => (8..=10_u16, 4..=6_u16).prop_map(|(address, value)| write(address, value)),
        1 => Just(sealed(&[unit, 16, 0, 9, 0, 2])),
        1 => prop::collection::vec(any::<u8>(), 0..40),
    ]
}

fn said() -> impl Strategy<Value = Said> {
    let lines = (any::<bool>(), any::<bool>(), any::<bool>())
        .prop_map(|(echo, others, gapless)| Opened::new().may_echo(echo).may_have_others(others).gapless(gapless));
    let later = || prop_oneof![9 => 0..200_i32, 1 => -50..0_i32];
    prop_oneof![
        60 => bytes().prop_map(Said::Right),
        2 => Just(Said::Next),
        2 => later().prop_map(Said::Sent),
        2 => (later(), bytes()).prop_map(|(later, bytes)| Said::Heard(later, bytes)),
        2 => prop::sample::select(vec![Cut::Lost, Cut::Unusable, Cut::GivenUp]).prop_map(Said::Cut),
        1 => Just(Said::GiveWay),
        1 => any::<bool>().prop_map(Said::Wanted),
        1 => any::<Option<u16>>().prop_map(Said::Expect),
        1 => lines.prop_map(Said::Opened),
        1 => Just(Said::Closed),
        1 => Just(Said::Abort),
        2 => bytes().prop_map(Said::Stray),
        1 => any::<(u8, bool)>().prop_map(|call| Said::Another(Box::new(call))),
    ]
}

fn question() -> impl Strategy<Value = Question<'static>> {
    let requests = prop::sample::select(vec![
        Request::read(9, 1).unwrap(),
        Request::read(9, 2).unwrap(),
        Request::read_of(Table::Coil, 9, 3).unwrap(),
        Request::write(9, 5),
        Request::write_coil(9, true),
        Request::write_many(9, &WORDS).unwrap(),
        Request::echo(7),
        Request::custom(&[0x41, 1], AnswerLength::BySilence).unwrap(),
    ]);
    let urgency = prop::sample::select(vec![Urgency::Stop, Urgency::Call, Urgency::Poll]);
    let flags = (any::<bool>(), any::<bool>(), any::<bool>(), 0..8_u8);
    (requests, urgency, 0..4_u32, flags).prop_map(|(request, urgency, retries, (doubt, verify, back, to))| {
        let to = if to == 0 { Destination::Broadcast } else { UNIT.into() };
        Question::new(to, request, TIMEOUT)
            .urgency(urgency)
            .retries(retries)
            .in_doubt(doubt)
            .verify(verify)
            .read_back(back.then_some(9))
    })
}

/// What went out, and the time.
struct Run {
    known: Line,
    now: Instant,
    frames: usize,
    writes: usize,
    looked: bool,
    limit: usize,
    question: Question<'static>,
}

impl Run {
    /// Does what the call asks for next; whether that was its end.
    fn does(&mut self, call: &mut Conversation<'_>, came: &[u8]) -> bool {
        match call.next(self.now, &mut self.known) {
            Step::Send(frame) => {
                self.frames += 1;
                assert!(self.frames <= self.limit, "{} requests, {} are allowed", self.frames, self.limit);
                match frame[1] {
                    5 | 6 | 16 => {
                        assert!(self.writes == 0 || self.looked, "a write went out twice, and nobody looked");
                        self.writes += 1;
                        self.looked = false;
                        assert!(self.writes <= 1 + 2 * self.question.retries as usize);
                    }
                    1..=4 => self.looked = self.question.read_back.is_some(),
                    _ => {}
                }
                call.sent(&mut self.known, self.now + ms(2)).unwrap();
                self.now = self.now + ms(2);
            }
            Step::Listen(until) => {
                if came.is_empty() {
                    self.now = self.now.max(until);
                }
                call.heard(self.now, &mut self.known, came).unwrap();
            }
            Step::StandBy(until) => self.now = self.now.max(until),
            Step::Done(_) => return true,
            _ => {}
        }
        false
    }

    fn at(&self, later: i32) -> Instant {
        let millis = Duration::from_millis(later.unsigned_abs().into());
        if later < 0 {
            Instant::ZERO + self.now.saturating_duration_since(Instant::ZERO + millis)
        } else {
            self.now + millis
        }
    }

    fn hears(&mut self, call: &mut Conversation<'_>, said: &Said) {
        match said {
            Said::Right(came) => drop(self.does(call, came)),
            Said::Next => drop(call.next(self.now, &mut self.known)),
            Said::Sent(later) => {
                let end = self.at(*later);
                let _ = call.sent(&mut self.known, end);
            }
            Said::Heard(later, bytes) => {
                let at = self.at(*later);
                if call.heard(at, &mut self.known, bytes).is_ok() {
                    self.now = at;
                }
            }
            Said::Cut(cut) => call.cut_short(self.now, &mut self.known, *cut),
            Said::GiveWay => call.give_way(self.now, &mut self.known, ms(20)),
            Said::Wanted(is_wanted) => call.is_wanted(*is_wanted),
            Said::Expect(longest) => call.expect_within(longest.map(|millis| ms(millis.into()))),
            Said::Opened(line) => self.known.opened(self.now, line),
            Said::Closed => self.known.closed(),
            Said::Abort => self.known.abort(self.now),
            Said::Stray(bytes) => self.known.stray(self.now, bytes),
            Said::Another(other) => {
                let (unit, in_doubt) = **other;
                let unit = UnitAddress::new(1 + unit % 6).unwrap();
                let fresh = FreshWords::beginning_at(9);
                let read = Question::new(unit.into(), Request::read(9, 1).unwrap(), TIMEOUT).in_doubt(in_doubt);
                let mut another = Conversation::new(read, &fresh);
                for _ in 0..6 {
                    match another.next(self.now, &mut self.known) {
                        Step::Send(_) => drop(another.sent(&mut self.known, self.now)),
                        Step::Listen(_) => drop(another.heard(self.now, &mut self.known, &[])),
                        _ => {}
                    }
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_is_said_to_a_call_it_ends_within_its_bounds(
        question in question(),
        echo in prop::sample::select(vec![OwnEcho::Unknown, OwnEcho::Present, OwnEcho::Absent]),
        others in any::<bool>(),
        began in prop::sample::select(vec![0, 500, 5_000_u64]),
        all in prop::collection::vec(said(), 0..80),
    ) {
        let mut known = Line::new(SerialFormat::DEFAULT, echo, 7);
        known.opened(Instant::ZERO, &Opened::new().may_have_others(others));
        let prepared = if question.urgency == Urgency::Stop { PREPARED } else { 0 };
        let limit = EACH * (question.retries as usize + 1) + prepared;
        let mut run = Run { known, now: at(began), frames: 0, writes: 0, looked: false, limit, question };
        let fresh = FreshWords::beginning_at(1);
        let mut call = Conversation::new(question, &fresh);
        for said in &all {
            run.hears(&mut call, said);
        }
        // From here on nobody answers.
        let steps = (0..5_000).take_while(|_| !run.does(&mut call, &[])).count();
        prop_assert!(steps < 5_000, "it never ends");
        let (now, frames) = (run.now, run.frames);
        prop_assert!(run.does(&mut call, &[]), "what is over stays over");
        prop_assert_eq!((run.now, run.frames), (now, frames));
    }
}
