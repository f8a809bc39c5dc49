//! What faults make of an answer: other characters, pauses between them, a later beginning.

use std::time::Duration;

use drivebus_rtu::function::{EXCEPTION_BIT, READ_HOLDING};
use drivebus_rtu::{Frame, crc16};

use super::{ADDRESSES, FaultKind, Faults, Hits};
use crate::random::Random;

/// Between the pieces of a split answer: the latency timer of common USB adapters.
const PIECE_PAUSE: Duration = Duration::from_millis(16);
/// How often a damage is drawn again that happens to have a right CRC. One draw in 65 536 does.
const DRAWS: u32 = 16;
/// 04H, as that of the frames that look like an answer to 03H.
const READ_INPUT: u8 = READ_HOLDING + 1;
/// Most cuts of a split answer.
const MOST_CUTS: usize = 3;
/// Address, function, code and CRC.
const EXCEPTION: usize = 5;
/// Most bytes that one answer carries as data.
const MOST_DATA: usize = 250;

/// What goes onto the wire where an answer was meant to.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(crate) struct Outgoing {
    pub(crate) bytes: Vec<u8>,
    /// Which characters are held back, and how long after the one before them; in order.
    pub(crate) pauses: Vec<(usize, Duration)>,
    /// How much later than the unit would it begins.
    pub(crate) delay: Duration,
    /// Whether later answers of the same unit may come before it.
    pub(crate) may_be_passed: bool,
}

impl Faults {
    /// What becomes of `outgoing`, hit by `hits`; `None` where nothing arrives.
    pub(crate) fn apply(&mut self, hits: Hits, outgoing: Outgoing) -> Option<Outgoing> {
        if let [unit, ..] = outgoing.bytes[..] {
            self.present[usize::from(unit)] = true;
        }
        if hits.is_empty() {
            return Some(outgoing);
        }
        if hits.has(FaultKind::Silence) {
            self.happened(FaultKind::Silence);
            return None;
        }
        let drawn = (0..DRAWS).find_map(|_| {
            let drawn = Draw::new(&mut self.random, &self.present, hits).damage(&outgoing.bytes, self.silence);
            (!is_forged(&outgoing.bytes, &drawn.outgoing.bytes)).then_some(drawn)
        });
        let Drawn { outgoing: mut damaged, did } = drawn?;
        for kind in FaultKind::ALL {
            if did.has(kind) {
                self.happened(kind);
            }
        }
        let mut delay = damaged.delay.saturating_add(outgoing.delay);
        if hits.has(FaultKind::Delay) {
            delay = delay.saturating_add(self.random.up_to(self.times.delay));
            self.happened(FaultKind::Delay);
        }
        if hits.has(FaultKind::Late) {
            delay = delay.saturating_add(self.times.late).saturating_add(self.random.up_to(self.times.late));
            self.happened(FaultKind::Late);
        }
        if hits.has(FaultKind::Overtaken) {
            let (least, most) = self.times.overtaken;
            delay = delay.saturating_add(least).saturating_add(self.random.up_to(most.saturating_sub(least)));
            damaged.may_be_passed = true;
            self.happened(FaultKind::Overtaken);
        }
        damaged.delay = delay;
        Some(damaged)
    }
}

/// Whether a receiver could find in `arrives` a frame that looks like the answer and is not.
fn is_forged(answer: &[u8], arrives: &[u8]) -> bool {
    let [unit, function, ..] = *answer else { return false };
    (0..arrives.len()).any(|begin| {
        let [address, came, ..] = arrives[begin..] else { return false };
        let length = if came & EXCEPTION_BIT == 0 { answer.len() } else { EXCEPTION };
        address == unit
            && came & !EXCEPTION_BIT == function & !EXCEPTION_BIT
            && arrives.get(begin..begin + length).is_some_and(|frame| frame != answer && Frame::parse(frame).is_ok())
    })
}

struct Drawn {
    outgoing: Outgoing,
    /// What was done: of kinds that replace the answer only one can be.
    did: Hits,
}

/// One try at damaging an answer.
struct Draw<'a> {
    random: &'a mut Random,
    present: &'a [bool; ADDRESSES],
    hits: Hits,
    did: Hits,
}

impl<'a> Draw<'a> {
    fn new(random: &'a mut Random, present: &'a [bool; ADDRESSES], hits: Hits) -> Self {
        Self { random, present, hits, did: Hits::default() }
    }

    fn damage(mut self, answer: &[u8], silence: Duration) -> Drawn {
        let mut first = Vec::new();
        let mut frame = answer.to_vec();
        if let [address, function, data @ .., _, _] = answer {
            first.extend(self.takes(FaultKind::Foreign).then(|| self.foreign(*address, *function, data)));
            if self.takes(FaultKind::WrongFunction) {
                let wrong = self.look_alike(*address, other_function(*function), data);
                if self.random.happens(0.5) {
                    first.push(wrong);
                } else {
                    frame = wrong;
                }
            }
            if frame == answer && self.takes(FaultKind::Short) {
                frame = self.short(*address, *function, data);
            }
            if frame == answer && self.takes(FaultKind::Long) {
                frame = self.long(*address, *function, data);
            }
        }
        self.spoil(&mut frame);
        let mut outgoing = Outgoing::default();
        for before in first {
            outgoing.bytes.extend(before);
            outgoing.pauses.push((outgoing.bytes.len(), silence));
        }
        let begin = outgoing.bytes.len();
        outgoing.bytes.extend(frame);
        if outgoing.bytes.len() > begin + 1 && self.takes(FaultKind::Split) {
            let mut cuts: Vec<usize> =
                (0..=self.random.below(MOST_CUTS)).map(|_| self.inside(&outgoing, begin)).collect();
            cuts.sort_unstable();
            cuts.dedup();
            outgoing.pauses.extend(cuts.into_iter().map(|cut| (cut, PIECE_PAUSE)));
        }
        Drawn { outgoing, did: self.did }
    }

    /// Whether `kind` hits; it has happened then.
    fn takes(&mut self, kind: FaultKind) -> bool {
        let hit = self.hits.has(kind);
        if hit {
            self.did.add(kind);
        }
        hit
    }

    /// A place after the first character from `begin` on and not after the last.
    fn inside(&mut self, outgoing: &Outgoing, begin: usize) -> usize {
        begin + 1 + self.random.below(outgoing.bytes.len() - begin - 1)
    }

    fn foreign(&mut self, address: u8, function: u8, data: &[u8]) -> Vec<u8> {
        // Any of the other 246 addresses, but none of this line: held back, its frame would be a forged answer of that unit.
        let first = u8::try_from((usize::from(address) + self.random.below(246)) % 247 + 1).unwrap_or(1);
        let from_first = (first..=247).chain(1..first);
        let other = from_first.into_iter().find(|&other| !self.present[usize::from(other)]).unwrap_or(first);
        self.look_alike(other, function, data)
    }

    /// A good frame that differs from the answer in its data, and in whatever else is said.
    fn look_alike(&mut self, address: u8, function: u8, data: &[u8]) -> Vec<u8> {
        let mut body = vec![address, function];
        let kept = usize::from(carries_count(function, data));
        body.extend_from_slice(&data[..kept]);
        body.extend((kept..data.len()).map(|_| self.random.byte()));
        sealed(body)
    }

    fn short(&mut self, address: u8, function: u8, data: &[u8]) -> Vec<u8> {
        let mut body = vec![address, function];
        if carries_count(function, data) {
            let words = self.random.below((data.len() - 1) / 2);
            body.push(u8::try_from(2 * words).unwrap_or(0));
            body.extend_from_slice(&data[1..=2 * words]);
        } else {
            body.extend_from_slice(&data[..data.len().saturating_sub(2)]);
        }
        sealed(body)
    }

    fn long(&mut self, address: u8, function: u8, data: &[u8]) -> Vec<u8> {
        let mut body = vec![address, function];
        body.extend_from_slice(data);
        let room = MOST_DATA.saturating_sub(data.len()) & !1;
        let more = (2 + 2 * self.random.below(4)).min(room);
        body.extend((0..more).map(|_| self.random.byte()));
        if carries_count(function, data) {
            body[2] = u8::try_from(data.len() - 1 + more).unwrap_or(u8::MAX);
        }
        sealed(body)
    }

    /// What happens to single characters.
    fn spoil(&mut self, frame: &mut Vec<u8>) {
        if frame.len() < 2 {
            return;
        }
        if self.takes(FaultKind::FlipBit) {
            let place = self.random.below(frame.len());
            frame[place] ^= 1 << self.random.below(8);
        }
        if self.takes(FaultKind::LoseByte) {
            let place = self.random.below(frame.len());
            frame.remove(place);
        }
        if self.takes(FaultKind::DoubleByte) {
            let place = self.random.below(frame.len());
            frame.insert(place, frame[place]);
        }
        if self.takes(FaultKind::NoiseInside) {
            let place = 1 + self.random.below(frame.len() - 1);
            let noise = self.noise(3);
            frame.splice(place..place, noise);
        }
        if frame.len() > 1 && self.takes(FaultKind::Collision) {
            let begin = self.random.below(frame.len() - 1);
            let end = begin + 2 + self.random.below(frame.len() - begin - 1);
            for character in &mut frame[begin..end] {
                *character ^= self.random.next_nonzero();
            }
        }
        if self.takes(FaultKind::NoiseBefore) {
            let noise = self.noise(8);
            frame.splice(0..0, noise);
        }
        if self.takes(FaultKind::NoiseAfter) {
            let noise = self.noise(8);
            frame.extend(noise);
        }
    }

    /// 1 to `most` characters: of a line without bias, of one that is pulled high, or of any interference.
    fn noise(&mut self, most: usize) -> Vec<u8> {
        let length = 1 + self.random.below(most);
        let character = |random: &mut Random| match random.below(3) {
            0 => 0x00,
            1 => 0xFF,
            _ => random.byte(),
        };
        (0..length).map(|_| character(self.random)).collect()
    }
}

/// Whether an answer's data begin with their own length, as those of reads do.
fn carries_count(function: u8, data: &[u8]) -> bool {
    let fits = matches!(data, [count, words @ ..] if usize::from(*count) == words.len() && !words.is_empty());
    fits && matches!(function, READ_HOLDING | READ_INPUT)
}

/// A function whose answers are alike: 04H for 03H, 05H for 06H.
fn other_function(function: u8) -> u8 {
    match function & !EXCEPTION_BIT {
        READ_HOLDING => READ_INPUT | function & EXCEPTION_BIT,
        _ => function.wrapping_sub(1),
    }
}

/// `body` with its CRC.
fn sealed(mut body: Vec<u8>) -> Vec<u8> {
    let crc = crc16(&body);
    body.extend(crc.to_le_bytes());
    body
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(body: &[u8]) -> Vec<u8> {
        sealed(body.to_vec())
    }

    #[test]
    fn a_frame_that_could_pass_for_the_answer_is_noticed_wherever_it_stands() {
        let answer = frame(&[1, 0x03, 2, 0x12, 0x34]);
        let other_words = frame(&[1, 0x03, 2, 0x12, 0x35]);
        let refusal = frame(&[1, 0x83, 0x02]);
        for passes in [other_words, refusal] {
            for noise in [&[][..], &[0x00], &[1, 0x03], &[1, 0x83]] {
                let arrives = [noise, &passes, &[0xFF]].concat();
                assert!(is_forged(&answer, &arrives), "{arrives:02X?}");
            }
        }
    }

    #[test]
    fn the_answer_and_frames_that_everybody_can_tell_from_it_pass() {
        let answer = frame(&[1, 0x03, 2, 0x12, 0x34]);
        let others = [
            answer.clone(),
            frame(&[2, 0x03, 2, 0x12, 0x35]),
            frame(&[1, 0x04, 2, 0x12, 0x35]),
            frame(&[1, 0x03, 0]),
            frame(&[1, 0x03, 4, 0x12, 0x34, 0x12, 0x34]),
            vec![1, 0x03, 2, 0x12, 0x35, 0x00, 0x00],
        ];
        for arrives in others {
            assert!(!is_forged(&answer, &arrives), "{arrives:02X?}");
        }
    }
}
