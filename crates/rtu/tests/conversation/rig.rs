//! A line on paper with one unit behind it that does what a script says, and who carries conversations out on it.

use std::collections::{BTreeMap, VecDeque};

use drivebus_rtu::*;

pub(crate) const UNIT: UnitAddress = UnitAddress::MIN;
pub(crate) const TIMEOUT: Duration = Duration::from_millis(100);
/// How long a request takes on the wire, as far as its sender is told.
const SENDING: Duration = Duration::from_millis(5);
/// What a unit waits before it answers.
const DELAY: Duration = Duration::from_millis(3);
/// More than a call may take.
const MANY: usize = 20_000;

pub(crate) type Line = Known<4, 16>;

pub(crate) const fn ms(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

pub(crate) fn at(millis: u64) -> Instant {
    Instant::ZERO + ms(millis)
}

/// `body` with its CRC.
pub(crate) fn sealed(body: &[u8]) -> Vec<u8> {
    let mut frame = body.to_vec();
    frame.extend(crc16(body).to_le_bytes());
    frame
}

/// A read of holding registers on the wire.
pub(crate) fn read(address: u16, count: u16) -> Vec<u8> {
    request(3, address, count)
}

/// 06H on the wire.
pub(crate) fn write(address: u16, value: u16) -> Vec<u8> {
    request(6, address, value)
}

pub(crate) fn request(function: u8, first: u16, second: u16) -> Vec<u8> {
    let ([a, b], [c, d]) = (first.to_be_bytes(), second.to_be_bytes());
    sealed(&[UNIT.get(), function, a, b, c, d])
}

/// An answer with these words on the wire.
pub(crate) fn words(words: &[u16]) -> Vec<u8> {
    let mut body = vec![UNIT.get(), 3, u8::try_from(2 * words.len()).unwrap()];
    body.extend(words.iter().flat_map(|word| word.to_be_bytes()));
    sealed(&body)
}

/// What the unit does with one request.
#[derive(Debug, Clone)]
pub(crate) enum Does {
    /// As a unit that is well: it reads, writes and returns echoes.
    Right,
    /// Nothing; and nothing is done.
    Nothing,
    /// It does what is asked, and its answer is lost.
    DoneUnsaid,
    /// It answers so much later than the time-out that it is another request's time.
    Late(Duration),
    /// Its answer comes with one bit turned.
    Damaged,
    /// It refuses.
    Refuses(u8),
    /// These bytes come in the place of an answer.
    Says(Vec<u8>),
    /// It answers right, and at once behind that these bytes come.
    And(Vec<u8>),
    /// It answers right, and at once behind that comes what it answered to the request before, once more.
    AndBefore,
}
use Does::{And, AndBefore, Damaged, DoneUnsaid, Late, Nothing, Refuses, Right, Says};

/// What was done with a call, and what it came to.
#[derive(Debug)]
pub(crate) struct Told {
    /// What went out, without the words of echoes.
    pub(crate) sent: Vec<Vec<u8>>,
    /// When each of them did.
    pub(crate) sent_at: Vec<Instant>,
    pub(crate) stood_by: Vec<Instant>,
    pub(crate) exchanges: Vec<Option<Unanswered>>,
    pub(crate) counts: Counts,
    pub(crate) end: End,
    pub(crate) before: bool,
    pub(crate) shows: Vec<u16>,
    pub(crate) raw: Vec<u8>,
    pub(crate) last_sent: Option<Instant>,
}

/// What a call came to, owned.
#[derive(Debug, PartialEq, Eq, Clone)]
pub(crate) enum End {
    Words(Vec<u16>),
    Confirmed,
    /// It is done, and nobody confirmed it.
    Done,
    Failed(Unanswered),
}

/// The line, its unit, the time, and whoever carries conversations out.
pub(crate) struct Rig {
    pub(crate) known: Line,
    pub(crate) fresh: FreshWords,
    pub(crate) now: Instant,
    /// What the unit does with the requests that come next; behind it `then`.
    pub(crate) script: VecDeque<Does>,
    pub(crate) then: Does,
    /// What it refuses and what it is deaf to, by function, before the script is asked.
    pub(crate) always: BTreeMap<u8, Does>,
    /// It gives no more words at once.
    pub(crate) most: u16,
    pub(crate) registers: BTreeMap<u16, u16>,
    /// The adapter sends our own bytes back.
    pub(crate) echoes: bool,
    /// What happens when others may go first, in order; before that nothing, so many times.
    pub(crate) passes: VecDeque<Cut>,
    pub(crate) undisturbed: usize,
    /// What other calls ask then, in order; `None`: this time nobody does.
    pub(crate) meanwhile: VecDeque<Option<Question<'static>>>,
    /// What it said last.
    before: Vec<u8>,
    /// What is on its way.
    wire: VecDeque<(Instant, Vec<u8>)>,
}

impl Rig {
    /// A line that was just opened: another program may have asked before.
    pub(crate) fn opened(line: Opened, echo: OwnEcho) -> Self {
        let mut known = Line::new(SerialFormat::DEFAULT, echo, 7);
        known.opened(Instant::ZERO, &line);
        Self {
            known,
            fresh: FreshWords::beginning_at(0x1234),
            now: Instant::ZERO,
            script: VecDeque::new(),
            then: Right,
            always: BTreeMap::new(),
            most: 125,
            registers: BTreeMap::new(),
            echoes: false,
            passes: VecDeque::new(),
            undisturbed: 0,
            meanwhile: VecDeque::new(),
            before: Vec::new(),
            wire: VecDeque::new(),
        }
    }

    /// A line without an echo on which nothing is in doubt any more.
    pub(crate) fn settled() -> Self {
        let mut rig = Self::opened(Opened::new(), OwnEcho::Absent);
        rig.now = at(5_000);
        rig
    }

    pub(crate) fn does(mut self, script: impl IntoIterator<Item = Does>) -> Self {
        self.script = script.into_iter().collect();
        self
    }

    /// As [`does`](Self::does), on a line in use.
    pub(crate) fn next(&mut self, script: impl IntoIterator<Item = Does>) -> &mut Self {
        self.script = script.into_iter().collect();
        self
    }

    /// The unit leaves `question`, which is asked once, without an answer.
    #[track_caller]
    pub(crate) fn is_silent_on(&mut self, question: Question<'_>) {
        self.next([Nothing]);
        assert_eq!(self.run(question).end, silence(1));
    }

    /// From the start, or for good, it does this with requests of `function`.
    pub(crate) fn always(mut self, function: u8, does: Does) -> Self {
        self.always.insert(function, does);
        self
    }

    /// Bytes come so much later than now, whatever is asked.
    pub(crate) fn comes(&mut self, later: Duration, bytes: Vec<u8>) {
        self.wire.push_back((self.now + later, bytes));
        self.wire.make_contiguous().sort_by_key(|(when, _)| *when);
    }

    pub(crate) fn run(&mut self, question: Question<'_>) -> Told {
        let fresh = FreshWords::beginning_at(0);
        let fresh = std::mem::replace(&mut self.fresh, fresh);
        let mut call = Conversation::new(question, &fresh);
        let told = self.carry_out(&mut call);
        self.fresh = fresh;
        told
    }

    /// Carries `call` out until it is told that nothing came to its request.
    pub(crate) fn meets_silence(&mut self, call: &mut Conversation<'_>) {
        loop {
            match call.next(self.now, &mut self.known) {
                Step::Send(_) => drop(call.sent(&mut self.known, self.now).unwrap()),
                Step::Listen(until) => {
                    self.now = self.now.max(until);
                    call.heard(self.now, &mut self.known, &[]).unwrap();
                }
                Step::Heard(_) => break,
                _ => {}
            }
        }
    }

    pub(crate) fn carry_out(&mut self, call: &mut Conversation<'_>) -> Told {
        let (mut sent, mut sent_at) = (Vec::new(), Vec::new());
        let (mut stood_by, mut exchanges) = (Vec::new(), Vec::new());
        for _ in 0..MANY {
            match call.next(self.now, &mut self.known) {
                Step::LetPass => {
                    if self.undisturbed > 0 {
                        self.undisturbed -= 1;
                    } else if let Some(cut) = self.passes.pop_front() {
                        call.cut_short(self.now, &mut self.known, cut);
                    }
                    if let Some(other) = self.meanwhile.pop_front().flatten() {
                        let rest = std::mem::take(&mut self.meanwhile);
                        self.run(other);
                        self.meanwhile = rest;
                    }
                }
                Step::StandBy(until) => {
                    stood_by.push(until);
                    self.now = self.now.max(until);
                }
                Step::Send(frame) => {
                    let frame = frame.to_vec();
                    let end = self.now + SENDING;
                    sent_at.push(self.now);
                    call.sent(&mut self.known, end).unwrap();
                    self.goes_out(end, &frame);
                    sent.push(if frame[1] == 8 { vec![UNIT.get(), 8] } else { frame });
                }
                Step::Listen(until) => {
                    let due = self.wire.front().map(|(when, _)| *when).filter(|when| *when <= until.max(self.now));
                    self.now = self.now.max(due.unwrap_or(until));
                    let bytes = due.and_then(|_| self.wire.pop_front()).map(|(_, bytes)| bytes).unwrap_or_default();
                    let taken = call.heard(self.now, &mut self.known, &bytes).unwrap();
                    if taken < bytes.len() {
                        self.wire.push_front((self.now, bytes[taken..].to_vec()));
                    }
                }
                Step::Heard(exchange) => exchanges.push(exchange.failure),
                Step::Done(outcome) => {
                    let mut told = Told {
                        sent,
                        sent_at,
                        stood_by,
                        exchanges,
                        counts: Counts::default(),
                        end: End::Done,
                        before: false,
                        shows: Vec::new(),
                        raw: Vec::new(),
                        last_sent: None,
                    };
                    match outcome {
                        Outcome::Answered { answer, times, .. } => {
                            told.last_sent = Some(times.sent);
                            told.end = match answer {
                                Some(Answer::Read { words, .. }) => End::Words(words.iter().collect()),
                                Some(_) => End::Confirmed,
                                None => End::Done,
                            };
                        }
                        Outcome::Failed { why, sent, raw, shows, before, .. } => {
                            told.end = End::Failed(why);
                            told.raw = raw.to_vec();
                            told.shows = shows.map(|words| words.iter().collect()).unwrap_or_default();
                            (told.before, told.last_sent) = (before, sent);
                        }
                        other => panic!("{other:?}"),
                    }
                    told.counts = call.take_counts();
                    return told;
                }
                other => panic!("{other:?}"),
            }
        }
        panic!("a call without an end");
    }

    /// `frame` has left by `end`: its unit does what it does.
    fn goes_out(&mut self, end: Instant, frame: &[u8]) {
        if self.echoes {
            self.wire.push_back((end, frame.to_vec()));
        }
        if frame[0] == 0 {
            return;
        }
        let function = frame[1];
        let does = match self.always.get(&function) {
            Some(does) => does.clone(),
            None => self.script.pop_front().unwrap_or_else(|| self.then.clone()),
        };
        let then = end + DELAY;
        let mut say = |when, bytes| self.wire.push_back((when, bytes));
        match does {
            Nothing => {}
            Refuses(code) => say(then, sealed(&[frame[0], function | 0x80, code])),
            Says(bytes) => say(then, bytes),
            Right | DoneUnsaid | Late(_) | Damaged | And(_) | AndBefore => {
                let mut answer = self.answer(frame);
                let before = std::mem::replace(&mut self.before, answer.clone());
                match does {
                    DoneUnsaid => return,
                    Late(later) => return self.comes(later, answer),
                    Damaged => {
                        if let Some(byte) = answer.get_mut(3) {
                            *byte ^= 1;
                        }
                        self.wire.push_back((then, answer));
                    }
                    And(more) => {
                        self.wire.push_back((then, answer));
                        self.wire.push_back((then, more));
                    }
                    AndBefore => self.wire.extend([(then, answer), (then, before)]),
                    _ => self.wire.push_back((then, answer)),
                }
            }
        }
        self.wire.make_contiguous().sort_by_key(|(when, _)| *when);
    }

    /// What a unit that is well does with `frame`, and says to it.
    fn answer(&mut self, frame: &[u8]) -> Vec<u8> {
        let word = |at: usize| u16::from_be_bytes([frame[at], frame[at + 1]]);
        match frame[1] {
            3 | 4 if word(4) > self.most => sealed(&[frame[0], frame[1] | 0x80, 3]),
            3 | 4 => {
                let (address, count) = (word(2), word(4));
                let mut body = vec![frame[0], frame[1], u8::try_from(2 * count).unwrap()];
                for place in 0..count {
                    let word = self.registers.get(&(address + place)).copied().unwrap_or(address + place);
                    body.extend(word.to_be_bytes());
                }
                sealed(&body)
            }
            1 | 2 => {
                let on = self.registers.get(&word(2)).is_some_and(|on| *on != 0);
                let bytes = word(4).div_ceil(8);
                let mut body = vec![frame[0], frame[1], u8::try_from(bytes).unwrap(), u8::from(on)];
                body.resize(3 + usize::from(bytes), 0);
                sealed(&body)
            }
            5 | 6 => {
                let value = if frame[1] == 5 { u16::from(word(4) == 0xFF00) } else { word(4) };
                self.registers.insert(word(2), value);
                frame.to_vec()
            }
            16 => {
                for place in 0..word(4) {
                    let value = word(7 + 2 * usize::from(place));
                    self.registers.insert(word(2) + place, value);
                }
                sealed(&frame[..6])
            }
            _ => frame.to_vec(),
        }
    }
}

/// `count` words from `address` of the unit.
pub(crate) fn ask(address: u16, count: u16) -> Question<'static> {
    Question::new(UNIT.into(), Request::read(address, count).unwrap(), TIMEOUT)
}

/// `value` to `address` of the unit.
pub(crate) fn set(address: u16, value: u16) -> Question<'static> {
    Question::new(UNIT.into(), Request::write(address, value), TIMEOUT)
}

/// An echo on the wire, whatever its word.
pub(crate) fn echo() -> Vec<u8> {
    vec![UNIT.get(), 8]
}

pub(crate) fn silence(attempts: u32) -> End {
    End::Failed(Unanswered::NoAnswer { timeout: TIMEOUT, attempts })
}
