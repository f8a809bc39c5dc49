//! Huanyang's own protocol, on the same wires and with the same CRC as Modbus, and none: its frames where others are, too.
//!
//! What is one of its frames, [`drivebus_rtu::huanyang`] tells.

use std::ops::Range;

use drivebus_rtu::huanyang::{AROUND, is_sure};
use drivebus_rtu::{UnitAddress, frames_in as modbus_frames_in};

/// The whole frames in `data`, of Modbus or of this protocol, whatever stands between them.
pub fn frames_in(data: &[u8]) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut at = 0;
    for modbus in modbus_frames_in(data) {
        sure_in(data, at..modbus.start, &mut found);
        at = modbus.end;
        found.push(modbus);
    }
    sure_in(data, at..data.len(), &mut found);
    found
}

/// Adds to `found` the frames that are sure to be of this protocol, whatever stands between them.
fn sure_in(data: &[u8], within: Range<usize>, found: &mut Vec<Range<usize>>) {
    let mut at = within.start;
    while let Some(&[_, _, count, ..]) = data.get(at..within.end) {
        let frame = at..within.end.min(at + AROUND + usize::from(count));
        if data.get(frame.clone()).is_some_and(is_sure) {
            at = frame.end;
            found.push(frame);
        } else {
            at += 1;
        }
    }
}

/// Whether `data`, which came where `unit` was asked, may hold an answer of it, whole or damaged.
///
/// Noise, and what others say, does not: then the unit was as silent as if nothing had come.
pub fn may_be_of(unit: UnitAddress, data: &[u8]) -> bool {
    let frames = frames_in(data);
    if frames.is_empty() {
        return data.split_last().is_some_and(|(_, before)| before.contains(&unit.get()));
    }
    frames.into_iter().any(|frame| data.get(frame.start) == Some(&unit.get()))
}

#[cfg(test)]
mod tests {
    use drivebus_rtu::crc16;

    use super::*;

    /// `bytes` with their CRC behind them.
    fn framed(bytes: &[u8]) -> Vec<u8> {
        [bytes, &crc16(bytes).to_le_bytes()].concat()
    }

    #[test]
    fn frames_are_found_between_noise() {
        let (control, read) = (framed(&[1, 3, 1, 0x08]), framed(&[2, 3, 0x21, 0, 0, 1]));
        let data = [&[0x55][..], &control, &[0xFF, 0xFF], &read, &control, &[1, 3]].concat();
        let found: Vec<_> = frames_in(&data).into_iter().map(|range| data[range].to_vec()).collect();
        assert_eq!(found, [control.clone(), read, control]);
    }

    #[test]
    fn what_others_say_is_no_answer() {
        let (one, two) = (UnitAddress::by_name(1), UnitAddress::by_name(2));
        let answer = framed(&[1, 3, 2, 0, 7]);
        assert!(may_be_of(one, &answer) && !may_be_of(two, &answer));
        // Damaged, it may be anybody's that is in it; of its last byte no answer follows.
        assert!(may_be_of(one, &[1, 3, 2, 0, 7, 0, 0]) && !may_be_of(two, &[1, 3, 2]) && may_be_of(two, &[9, 2, 9]));
        assert!(!may_be_of(one, &[]) && !may_be_of(one, &[1]));
    }
}
