//! Invariant: a sniffer accounts for every byte, once and in order; what it calls a frame has a right CRC; an answer is of
//! the unit and the function of the request told last, which no other answer was; and it never waits for a moment that is
//! past.

use drivebus_rtu::{Instant, Request, Role, SerialFormat, Sniffer};

use crate::oracle;
use crate::stream::{Arrival, Input, arrivals};

/// See the file's first lines. The input: a stream.
pub fn sniffer(data: &[u8]) {
    let stream = arrivals(&mut Input::new(data));
    let mut ear = Ear { sniffer: Sniffer::new(&SerialFormat::DEFAULT), told: Vec::new(), asked: None };
    let mut now = Instant::ZERO;
    for Arrival { gap, bytes } in &stream {
        let next = now + *gap;
        ear.wait(next);
        now = next;
        let mut rest = &bytes[..];
        while !rest.is_empty() {
            let count = ear.sniffer.receive(now, rest);
            assert!(count > 0, "no room after looking");
            rest = &rest[count..];
            ear.look(now);
        }
    }
    ear.wait(Instant::from_nanos(u64::MAX));
    assert_eq!(ear.sniffer.pending(), [], "silence ends everything");
    assert_eq!(ear.told, stream.iter().flat_map(|arrival| arrival.bytes.clone()).collect::<Vec<u8>>());
}

struct Ear {
    sniffer: Sniffer,
    told: Vec<u8>,
    /// The request told last, if nothing has answered it.
    asked: Option<Vec<u8>>,
}

impl Ear {
    fn wait(&mut self, next: Instant) {
        while let Some(deadline) = self.sniffer.deadline().filter(|&deadline| deadline <= next) {
            self.look(deadline);
            assert!(self.sniffer.deadline().is_none_or(|later| later > deadline), "a deadline in the past for ever");
        }
    }

    fn look(&mut self, now: Instant) {
        while let Some(heard) = self.sniffer.poll(now) {
            assert!(!heard.bytes.is_empty() && heard.began <= heard.ended && heard.ended <= now);
            self.told.extend_from_slice(heard.bytes);
            assert_eq!(heard.frame().is_some(), !matches!(heard.role, Role::Noise(_)));
            if heard.frame().is_some() {
                assert!(oracle::frame(heard.bytes).is_some(), "{:02X?} is not a frame", heard.bytes);
            }
            match heard.role {
                Role::Request => {
                    assert!(
                        heard.bytes[1] & 0x80 == 0 && Request::parse(&heard.bytes[1..heard.bytes.len() - 2]).is_ok()
                    );
                    self.asked = Some(heard.bytes.to_vec());
                }
                Role::Answer => {
                    let asked = self.asked.take().unwrap_or_default();
                    assert_eq!(Some(&heard.bytes[0]), asked.first(), "of another unit");
                    assert_eq!(Some(heard.bytes[1] & 0x7F), asked.get(1).copied(), "of another function");
                    assert!(heard.turnaround.is_some());
                }
                _ => {}
            }
        }
        assert!(self.sniffer.poll(now).is_none(), "nothing has changed since");
    }
}
