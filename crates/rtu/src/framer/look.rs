//! What may stand at one place of the stream: which lengths a frame beginning there can have, and whether it is worth
//! waiting for its end.

use super::Framer;
use crate::crc::{crc16, update};
use crate::frame::{Frame, FrameError, MAX_ADU, MIN_ADU};
use crate::functions::FrameLength;
use crate::pdu::function::{
    DIAGNOSTICS, EXCEPTION_BIT, READ_COILS, READ_DISCRETE, READ_HOLDING, READ_INPUT, WRITE_COIL, WRITE_MULTIPLE,
    WRITE_SINGLE,
};
use crate::{Instant, UnitAddress};

const HIGHEST_UNIT: u8 = UnitAddress::MAX.get();
/// Address, function code, exception code or byte count, CRC.
pub(crate) const EXCEPTION_ADU: usize = 5;
/// Address, function code, two words, CRC.
const SHORT_ADU: usize = 8;
/// Bytes from which on a beginning is told from noise that happens to look like one: address, function, and a byte that
/// fits.
const TOLD: usize = 3;

/// So many bytes behind an answer of unknown length may be noise, as a driver makes that lets go of the line. Of more, each
/// would be one more place at which a damaged answer could seem to end.
const BEHIND: usize = 8;

/// The most bytes that follow the count in Huanyang's protocol.
const MOST_COUNTED: u8 = 3;

/// What may stand at one place of the stream.
pub(super) enum Look {
    Frame(usize),
    Wait,
    Nothing(Option<FrameError>),
}

impl Framer {
    /// What stands at `start` at `now`. `quiet`: no more bytes will come, unless an answer comes in lumps; `is_over`: not then
    /// either.
    pub(super) fn look(&self, start: usize, now: Instant, (quiet, is_over): (bool, bool)) -> Look {
        let expected = self.is_expected(start);
        // An expected answer may come in lumps; anything else ends where the line fell silent.
        let cut = start < self.ended && !expected;
        let end = if cut { self.ended } else { self.len };
        let closed = cut || quiet;
        let here = &self.bytes[start..end];
        let fresh = start == 0 && !self.overrun;

        if expected && let Some(look) = self.look_for_own(here, is_over) {
            return look;
        }
        // Its own account of its length agrees with what was asked for: nothing shorter can be it. Said before anything is
        // weighed, for who hands bytes over one by one.
        if let [_, READ_COILS..=READ_INPUT, bytes, ..] = *here
            && here.len() < EXCEPTION_ADU + usize::from(bytes)
            && expected
            && !is_over
            && self.answer_len() == Some(EXCEPTION_ADU + usize::from(bytes))
        {
            return Look::Wait;
        }
        let mut error = None;
        let mut incomplete = false;
        for len in self.lengths(here, expected, fresh).into_iter().flatten() {
            match here.get(..len).map(Frame::parse) {
                Some(Ok(_)) => return Look::Frame(len),
                Some(Err(why)) => error = error.or(Some(why)),
                None => incomplete = true,
            }
        }
        if expected && self.patience.is_some() && self.is_open_ended(here) {
            return match self.run(here, start) {
                Some(len) if self.rests(now) => Look::Frame(len),
                _ if !is_over && !self.is_late => Look::Wait,
                _ => Look::Nothing(error.or(Frame::parse(here).err()).filter(|_| here.len() >= TOLD)),
            };
        }
        let by_silence = if expected { self.answer_len().is_none() && !self.is_counted() } else { fresh };
        if closed && by_silence && (MIN_ADU..=MAX_ADU).contains(&here.len()) {
            match Frame::parse(here) {
                Ok(_) => return Look::Frame(here.len()),
                Err(why) => error = error.or(Some(why)),
            }
        }
        let begun = expected && self.is_beginning_of_answer(here);
        if (begun && !is_over) || (incomplete && !closed) {
            return Look::Wait;
        }
        if begun && here.len() >= TOLD {
            match Frame::parse(here) {
                // Whole, and shorter than it may be.
                Ok(_) => return Look::Frame(here.len()),
                Err(why) => error = error.or(Some(why)),
            }
        }
        Look::Nothing(error)
    }

    /// Whether `here` is our own request, sent back to us.
    ///
    /// Told by its bytes, not by its length: eight bytes of a longer answer have a right CRC by chance, once in 65 536.
    /// Like an answer it may come in lumps.
    fn look_for_own(&self, here: &[u8], is_over: bool) -> Option<Look> {
        let own = self.own.as_bytes();
        if own.is_empty() {
            None
        } else if here.starts_with(own) {
            Some(Look::Frame(own.len()))
        } else if own.starts_with(here) && !is_over {
            Some(Look::Wait)
        } else {
            None
        }
    }

    /// Lengths that a frame beginning with `here` can have, shortest first. One that is longer than what is there
    /// means: wait.
    fn lengths(&self, here: &[u8], expected: bool, fresh: bool) -> [Option<usize>; 3] {
        let [first, second] = if expected { self.answer_lengths(here) } else { self.known_lengths(here) };
        // The longest frame is whole only when nothing follows it.
        let more = Some(here.len() + 1).filter(|_| here.len() <= MAX_ADU);
        let asked = match *here {
            [_, function, ..] if expected && function & EXCEPTION_BIT == 0 && !self.is_counted() => {
                self.answer_len().or(more)
            }
            // Only silence can tell where an unknown function ends, and a master that did not ask for it does not
            // care.
            [(..=HIGHEST_UNIT), (1..EXCEPTION_BIT), ..] if fresh && self.expect.is_none() && first.is_none() => more,
            _ => None,
        };
        let mut lengths = [first, second, asked];
        lengths.sort_unstable();
        lengths
    }

    /// Length that the answer looked for has by its own account.
    fn answer_lengths(&self, here: &[u8]) -> [Option<usize>; 2] {
        if self.is_counted() {
            return Self::counted_lengths(here);
        }
        let len = match *here {
            [_, READ_COILS..=READ_INPUT, bytes, ..] => EXCEPTION_ADU + usize::from(bytes),
            [_] | [_, READ_COILS..=READ_INPUT] => here.len() + 1,
            [_, WRITE_COIL | WRITE_SINGLE | DIAGNOSTICS | WRITE_MULTIPLE, ..] => SHORT_ADU,
            [_, function, ..] if function & EXCEPTION_BIT != 0 => EXCEPTION_ADU,
            _ => return [self.told_length(here), None],
        };
        [Some(len).filter(|&len| len <= MAX_ADU), None]
    }

    /// Lengths that an answer has which says so right behind the function, as in Huanyang's protocol. A refusal may be as short as
    /// one of Modbus.
    #[cold]
    fn counted_lengths(here: &[u8]) -> [Option<usize>; 2] {
        match *here {
            [_] | [_, _] => [Some(here.len() + 1), None],
            [_, function, count, ..] => {
                let told = EXCEPTION_ADU + usize::from(count);
                let short = Some(EXCEPTION_ADU).filter(|_| function & EXCEPTION_BIT != 0);
                [Some(told).filter(|_| count <= MOST_COUNTED), short]
            }
            [] => [None, None],
        }
    }

    /// Whether the answer looked for says right behind its function how long it is.
    fn is_counted(&self) -> bool {
        self.expect.is_some_and(|awaited| awaited.counted)
    }

    /// Length that an answer has by its own account of which nobody knows it beforehand.
    #[cold]
    fn told_length(&self, here: &[u8]) -> Option<usize> {
        FrameLength::of_answer(here).bytes().filter(|_| self.expect.is_some_and(|awaited| awaited.tells))
    }

    /// Lengths that a frame of either direction can have whose function is known.
    fn known_lengths(&self, here: &[u8]) -> [Option<usize>; 2] {
        let more = Some(here.len() + 1);
        let lowest = u8::from(self.expect.is_some());
        match *here {
            [address, ..] if !(lowest..=HIGHEST_UNIT).contains(&address) => [None, None],
            [_] | [_, READ_COILS..=READ_INPUT] => [more, None],
            // A request has 8 bytes; an answer begins with its byte count.
            [_, READ_HOLDING | READ_INPUT, bytes @ 2..=250, ..] if bytes % 2 == 0 => {
                [Some(SHORT_ADU), Some(EXCEPTION_ADU + usize::from(bytes))]
            }
            [_, READ_COILS | READ_DISCRETE, bytes @ 1..=250, ..] => {
                [Some(SHORT_ADU), Some(EXCEPTION_ADU + usize::from(bytes))]
            }
            // An answer has 8 bytes; a request has its byte count after address and count.
            [_, WRITE_MULTIPLE, _, _, _, _, bytes @ 2..=246, ..] if bytes % 2 == 0 => {
                [Some(SHORT_ADU), Some(SHORT_ADU + 1 + usize::from(bytes))]
            }
            [_, READ_COILS..=WRITE_SINGLE | DIAGNOSTICS | WRITE_MULTIPLE, ..] => [Some(SHORT_ADU), None],
            [_, function, ..] if function > EXCEPTION_BIT => [Some(EXCEPTION_ADU), None],
            _ => [None, None],
        }
    }

    /// Whether `here`, which begins as the answer looked for, is one that only silence ends.
    fn is_open_ended(&self, here: &[u8]) -> bool {
        let is_refusal = matches!(*here, [_, function, ..] if function & EXCEPTION_BIT != 0);
        self.answer_len().is_none() && !is_refusal && !self.is_counted()
    }

    /// Whether an answer that only silence ends has begun, and nothing stands before it.
    pub(crate) fn awaits_its_end(&self) -> bool {
        self.patience.is_some() && self.is_expected(self.taken) && self.is_open_ended(self.pending())
    }

    /// How long the longest run of `here`, which stands at `start`, is whose CRC is right: all of it, or up to where the line had
    /// fallen silent, or but for a few bytes.
    pub(super) fn run(&self, here: &[u8], start: usize) -> Option<usize> {
        let all = here.len().min(MAX_ADU);
        let silent = self.ended.saturating_sub(self.taken + start);
        let ends = (all.saturating_sub(BEHIND)..=all).rev().chain([silent]);
        ends.filter(|len| (MIN_ADU..=all).contains(len)).find(|&len| Frame::parse(&here[..len]).is_ok())
    }

    /// How long the answer looked for is; `None` where only silence tells, or none is looked for.
    fn answer_len(&self) -> Option<usize> {
        self.expect?.len
    }

    /// Whether `here`, which begins as the answer looked for, only lacks its end.
    fn is_beginning_of_answer(&self, here: &[u8]) -> bool {
        if self.is_counted() {
            return match *here {
                [_, _, count, ..] => count <= MOST_COUNTED && here.len() < EXCEPTION_ADU + usize::from(count),
                _ => true,
            };
        }
        match *here {
            [_, function, ..] if function & EXCEPTION_BIT != 0 => here.len() < EXCEPTION_ADU,
            // Another number of words than asked for: no use waiting for the rest of it.
            [_, READ_COILS..=READ_INPUT, bytes, ..]
                if self.answer_len() != Some(EXCEPTION_ADU + usize::from(bytes)) =>
            {
                false
            }
            _ => self.answer_len().is_some_and(|len| here.len() < len),
        }
    }

    /// Whether the answer that is waited for may begin at `start`.
    pub(super) fn is_expected(&self, start: usize) -> bool {
        let Some(awaited) = self.expect else { return false };
        match self.bytes[start..self.len] {
            [address] => address == awaited.unit,
            [address, function, ..] => address == awaited.unit && function & !EXCEPTION_BIT == awaited.function,
            [] => false,
        }
    }

    /// How many bytes the answer looked for, or our own request before it, lacks at least; 0 where nothing of it is
    /// there, or where silence would tell more.
    pub(crate) fn lacks(&self) -> usize {
        let here = self.pending();
        if !self.is_expected(self.taken) {
            return 0;
        }
        let own = self.own.as_bytes();
        let own = own.starts_with(here).then_some(own.len());
        let answer = self.is_beginning_of_answer(here).then(|| match *here {
            // It may be a refusal.
            [_] | [_, _] if self.is_counted() => EXCEPTION_ADU + 1,
            [_, _, count, ..] if self.is_counted() => EXCEPTION_ADU + usize::from(count),
            [_] => EXCEPTION_ADU,
            [_, function, ..] if function & EXCEPTION_BIT != 0 => EXCEPTION_ADU,
            _ => self.answer_len().unwrap_or_default(),
        });
        own.into_iter().chain(answer).min().map_or(0, |len| len.saturating_sub(here.len()))
    }
}

/// Whether `bytes` are the answer of `unit` with this function, `len` bytes long on the wire, that has lost the first byte, the
/// second, or the number of bytes that a read has third.
///
/// All of them are known, so that the CRC tells.
pub(crate) fn lost_its_head(bytes: &[u8], unit: UnitAddress, function: u8, len: usize) -> bool {
    let [head, body @ .., low, high] = bytes else { return false };
    if bytes.len() + 1 != len {
        return false;
    }
    let received = u16::from_le_bytes([*low, *high]);
    let known = [unit.get(), function];
    let is_second = *head == unit.get() || *head == function;
    let is_third = |rest| {
        let count = u8::try_from(len - EXCEPTION_ADU).unwrap_or_default();
        update(crc16(&[unit.get(), function, count]), rest) == received
    };
    (is_second && update(crc16(&known), body) == received)
        || matches!(*body, [second, ref rest @ ..]
            if matches!(function, READ_COILS..=READ_INPUT) && [*head, second] == known && is_third(rest))
}
