//! The bus on a line that hands over every character at its own moment, as a serial port does: it looks for an answer
//! when it may be whole, and has it at its last character all the same.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use drivebus_line::{AdapterEcho, Bus, BusOptions, CallOptions, Line, PortError};
use drivebus_rtu::{
    Adu, Answer, DataBits, ExceptionCode, Instant, Parity, Request, SerialFormat, Silence, StopBits, UnitAddress,
};

/// Answers every request after 5 ms, character by character, in virtual time.
#[derive(Debug)]
struct Paced {
    format: SerialFormat,
    now: Instant,
    answer: Vec<u8>,
    coming: VecDeque<(Instant, u8)>,
    /// How often bytes were handed over, and when the last one was due.
    looks: Arc<AtomicU32>,
    last: Arc<std::sync::Mutex<Instant>>,
}

impl Line for Paced {
    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let end = self.now + self.format.chars(u32::try_from(bytes.len()).unwrap());
        let begin = end + Duration::from_millis(5);
        self.coming = (1..).zip(&self.answer).map(|(count, &byte)| (begin + self.format.chars(count), byte)).collect();
        *self.last.lock().unwrap() = self.coming.back().unwrap().0;
        Ok(end)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let next = self.coming.front().map_or(until, |&(at, _)| at.min(until));
        self.now = self.now.max(next);
        let count = self.coming.iter().take_while(|&&(at, _)| at <= self.now).count();
        for (slot, (_, byte)) in buffer.iter_mut().zip(self.coming.drain(..count)) {
            *slot = byte;
        }
        self.looks.fetch_add(u32::from(count > 0), Ordering::Relaxed);
        Ok(count)
    }

    fn sleep(&mut self, until: Instant) {
        self.now = self.now.max(until);
    }

    fn char_time(&self) -> Option<Duration> {
        Some(self.format.chars(1))
    }

    fn name(&self) -> String {
        "a line with a pace".to_owned()
    }

    fn is_virtual(&self) -> bool {
        true
    }
}

#[test]
fn an_answer_is_there_at_its_last_character_after_few_looks() {
    let unit = UnitAddress::new(1).unwrap();
    for (baud, words, looks_at_most) in
        [(9_600, 1, 7), (9_600, 16, 9), (115_200, 1, 7), (115_200, 16, 9), (115_200, 125, 9), (9_600, 0, 5)]
    {
        let format = SerialFormat::new(baud, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec).unwrap();
        let values = vec![0x1234; words];
        let answer = match words {
            0 => Answer::exception(3, ExceptionCode::ILLEGAL_ADDRESS),
            _ => Answer::read(&values).unwrap(),
        };
        let (looks, last) = (Arc::new(AtomicU32::new(0)), Arc::default());
        let mut line = Some(Paced {
            format,
            now: Instant::ZERO,
            answer: Adu::answer(unit, &answer).as_bytes().to_vec(),
            coming: VecDeque::new(),
            looks: Arc::clone(&looks),
            last: Arc::clone(&last),
        });
        let options = BusOptions::new(format).echo(AdapterEcho::Absent);
        let opener = Box::new(move || Ok(Box::new(line.take().unwrap()) as Box<dyn Line>));
        let bus = Bus::open(opener, options, &mut || false).unwrap();
        // Past first contact, which would ask for an echo that this unit does not know.
        bus.sleep(Duration::from_secs(2), &mut || false);
        let request = Request::read(0x3000, u16::try_from(words.max(1)).unwrap()).unwrap();
        let mut read = 0;
        let result = bus.call(unit.into(), &request, CallOptions::default(), &mut || false, &mut |answer| {
            if let Answer::Read { words, .. } = answer {
                read = words.iter().count();
            }
        });
        let ended = result.map_or_else(|error| error.ended.unwrap(), |done| done.ended);
        assert_eq!((read, ended), (words, *last.lock().unwrap()), "{baud} bit/s, {words} words");
        let looks = looks.load(Ordering::Relaxed);
        assert!(looks <= looks_at_most, "{looks} looks at {words} words");
    }
}
