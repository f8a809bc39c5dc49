//! Huanyang's own protocol, on the same wires and with the same CRC as Modbus, and none: what its frames look like.
//!
//! A frame is the unit, a function (01 to 06), how many bytes of data follow, those, and the CRC; request and answer look
//! alike.
//!
//! | function | bytes of data | what |
//! | --- | --- | --- |
//! | 01, 02 | 3; an answer also 2 | reads, writes a parameter: its number, and its word |
//! | 03 | 1 | control: 01 runs forward, 11 in reverse, 08 stops |
//! | 04 | 3; a request also 1 | reads a status: its number, and its word |
//! | 05 | 2 | the frequency, in 0.01 Hz |
//! | 06 | 1 to 3 | reserved |
//!
//! Source: LinuxCNC, `src/hal/user_comps/huanyang-vfd/hy_modbus.c` (functions, lengths and data).

use std::ops::Range;

use drivebus_rtu::{UnitAddress, crc16, frames_in as modbus_frames_in};

/// The most words of one read of Modbus.
///
/// Source: *Modbus Application Protocol* V1.1b3, §6.3.
const MOST_WORDS: u16 = 125;

/// What stands around the data of a frame: unit, function, count and CRC.
const AROUND: usize = 5;

/// Whether `data` is a whole frame of this protocol; some of those are frames of Modbus, too.
pub fn has_form(data: &[u8]) -> bool {
    let [_, function, count, ..] = *data else { return false };
    let may_be = match function {
        1 | 2 => matches!(count, 2 | 3),
        3 => count == 1,
        4 => matches!(count, 1 | 3),
        5 => count == 2,
        6 => matches!(count, 1..=3),
        _ => false,
    };
    may_be
        && data.len() == AROUND + usize::from(count)
        && data.split_last_chunk().is_some_and(|(body, crc)| crc16(body) == u16::from_le_bytes(*crc))
}

/// Whether `data` is a frame of this protocol, and none that Modbus has, whoever sent it.
pub fn is_sure(data: &[u8]) -> bool {
    let [_, function, count, _, rest @ ..] = data else { return false };
    has_form(data)
        && match (function, count) {
            // One byte is no word, and no read is as short. A single write has eight bytes.
            (3 | 5, _) | (4, 1) => true,
            // No words have three bytes; as a read it asks for none, or for more than there may be.
            (4, _) => rest.first_chunk().is_some_and(|word| !(1..=MOST_WORDS).contains(&u16::from_be_bytes(*word))),
            // What reads or writes a parameter may be bits of Modbus.
            _ => *function == 6 && *count != 3,
        }
}

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
    use super::*;

    /// `bytes` with their CRC behind them.
    fn framed(bytes: &[u8]) -> Vec<u8> {
        [bytes, &crc16(bytes).to_le_bytes()].concat()
    }

    /// hy_modbus.c: functions, lengths and data. Modbus: a read of one register, its answer, a single write.
    #[test]
    fn a_frame_that_modbus_has_is_not_surely_of_this_protocol() {
        for (bytes, form, sure) in [
            (&[1, 3, 1, 0x08][..], true, true),
            (&[1, 4, 3, 0, 0, 0], true, true),
            (&[1, 4, 3, 0, 0, 1], true, false),
            (&[1, 4, 3, 0, 0, 125], true, false),
            (&[1, 4, 3, 0, 0, 126], true, true),
            (&[1, 4, 1, 0], true, true),
            (&[1, 5, 2, 0x13, 0x88], true, true),
            (&[1, 6, 2, 0, 0], true, true),
            (&[1, 6, 3, 0, 0, 0], true, false),
            (&[1, 1, 3, 0, 0, 0], true, false),
            (&[1, 2, 2, 0, 0], true, false),
            (&[1, 3, 2, 0, 0], false, false),
            (&[1, 7, 2, 0, 0], false, false),
            (&[1, 3, 0, 0, 0, 1], false, false),
        ] {
            let mut frame = framed(bytes);
            assert_eq!((has_form(&frame), is_sure(&frame)), (form, sure), "{bytes:02X?}");
            frame[0] ^= 1;
            assert!(!has_form(&frame), "{bytes:02X?}");
        }
        assert!(!has_form(&[]) && !is_sure(&[1, 3, 1]));
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
