//! What came beside an answer, and whether it may be what is left of the request: an adapter that sends back what it is
//! given may lose bytes of it.
//!
//! Noise is told from that by its bytes, however much of it there is. A rest of the request has three bytes of it in a row,
//! or four and more in their order. 00H and FFH count only beside others: they are in many requests, and they are what an
//! idle line gives that nothing pulls to its rest.

/// Bytes that are looked at.
const CAPACITY: usize = 64;
/// So many in a row are no chance: noise of 30 bytes has them once in a hundred thousand times.
const IN_A_ROW: usize = 3;
/// Nor are so many in their order, with any others between.
const IN_ORDER: u8 = 4;

/// Whether `request` may have come back in what `came` beside its answer, and lost something on its way.
pub(super) fn may_be_left_of(came: &[u8], request: &[u8]) -> bool {
    // An adapter sends back before any unit answers.
    let came = &came[..came.len().min(CAPACITY)];
    came.len() >= IN_A_ROW && is_left_of(came, &request[..request.len().min(CAPACITY)])
}

#[cold]
fn is_left_of(came: &[u8], request: &[u8]) -> bool {
    has_in_a_row(came, request) || count_in_order(came, request) >= IN_ORDER
}

fn is_idle(byte: u8) -> bool {
    byte == 0x00 || byte == 0xFF
}

fn has_in_a_row(came: &[u8], request: &[u8]) -> bool {
    let tells = |part: &&[u8]| part.iter().filter(|&&byte| !is_idle(byte)).count() >= 2;
    request.windows(IN_A_ROW).filter(tells).any(|part| came.windows(IN_A_ROW).any(|there| there == part))
}

/// How many bytes of `request` stand in `came` in their order, at most: the longest common subsequence.
fn count_in_order(came: &[u8], request: &[u8]) -> u8 {
    let mut row = [0_u8; CAPACITY + 1];
    for &byte in came.iter().filter(|&&byte| !is_idle(byte)) {
        let mut before = 0;
        for (index, &own) in request.iter().enumerate() {
            let above = row[index + 1];
            row[index + 1] = if own == byte { before + 1 } else { above.max(row[index]) };
            before = above;
        }
    }
    row[request.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    const READ: [u8; 8] = [0x01, 0x03, 0x21, 0x00, 0x00, 0x01, 0x8E, 0x36];
    const READ_OF_0: [u8; 8] = [0x01, 0x03, 0x00, 0x00, 0x00, 0x01, 0x84, 0x0A];

    fn looks_own(request: &[u8], came: &[u8]) -> bool {
        may_be_left_of(came, request)
    }

    #[test]
    fn a_request_that_lost_a_byte_is_known_and_one_that_lost_two_unless_little_else_tells() {
        for request in [READ, READ_OF_0] {
            let pairs = (0..8).flat_map(|first| (0..8).map(move |second| (first, second)));
            for (first, second) in pairs.filter(|(first, second)| request == READ || first == second) {
                let (mut left, mut len) = ([0; 8], 0);
                for at in (0..8).filter(|at| ![first, second].contains(at)) {
                    left[len] = request[at];
                    len += 1;
                }
                assert!(looks_own(&request, &left[..len]), "{request:02X?} without {first} and {second}");
            }
        }
    }

    #[test]
    fn any_end_and_any_beginning_of_three_bytes_is_known() {
        for cut in IN_A_ROW..=8 {
            for request in [READ, READ_OF_0] {
                assert!(
                    looks_own(&request, &request[..cut]) && looks_own(&request, &request[8 - cut..]),
                    "{cut} bytes"
                );
            }
        }
    }

    #[test]
    fn idle_bytes_and_other_frames_are_not_taken_for_it() {
        for came in [
            &[0x00; 30][..],
            &[0xFF; 30],
            &[0x01, 0x03, 0x02, 0x00, 0x01],
            &[0x01, 0x03, 0x01, 0x03, 0x01, 0x03, 0x01, 0x03],
            &[0x01, 0x03, 0x04, 0x00, 0x01, 0x00, 0x01, 0x6A],
            &[0x01, 0x08, 0x00, 0x00, 0x01, 0x08, 0x00, 0x00],
            &[0x01, 0x03],
            &[],
        ] {
            assert!(!looks_own(&READ, came) && !looks_own(&READ_OF_0, came), "{came:02X?}");
        }
    }

    #[test]
    fn of_a_long_request_the_first_bytes_are_looked_for() {
        let request: [u8; 2 * CAPACITY] = core::array::from_fn(|at| u8::try_from(at + 1).unwrap());
        let with_others_between = |last: usize| [10, 30, 50, last].map(|at| [request[at], 0xEE]).concat();
        assert!(looks_own(&request, &with_others_between(CAPACITY - 1)));
        assert!(!looks_own(&request, &with_others_between(CAPACITY)));
        assert!(looks_own(&request, &request[CAPACITY - IN_A_ROW..]));
        assert!(!looks_own(&request, &request[CAPACITY - IN_A_ROW + 1..]));
    }
}
