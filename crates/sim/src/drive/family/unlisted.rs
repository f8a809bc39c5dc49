//! Parameters that a drive has and no profile lists: what discovery is there to find.
//!
//! Assumption: stand-ins. The manuals at hand print a tenth of a drive's parameters; which ones there are beside those
//! is not at hand, and these only keep a value. They come in the shapes that a search has to get right: runs that are
//! longer than one read, holes of one and of several numbers, a group with one parameter at its end, the last group.

use super::Parameter;
use crate::drive::map::Access;

/// From..=to in a group, whether they can be written, and the factory value of the first; each next has one more.
const RUNS: &[(u8, u8, u8, bool, u16)] = &[
    (5, 0, 20, true, 0),
    (5, 22, 22, true, 7),
    (5, 40, 41, true, 100),
    (9, 3, 17, true, 10),
    (12, 0, 36, true, 500),
    (13, 1, 1, true, 1),
    (13, 3, 3, true, 3),
    (13, 5, 5, true, 5),
    (15, 99, 99, true, 9_999),
    (17, 0, 25, false, 40),
    (98, 0, 3, true, 65_532),
];

/// Those stand-ins.
pub(crate) fn unlisted() -> impl Iterator<Item = Parameter> {
    RUNS.iter().flat_map(|&(group, first, last, writable, factory)| {
        (first..=last).map(move |index| {
            let address = u16::from_be_bytes([group, index]);
            let parameter = Parameter::new(address, 0, u16::MAX, factory + u16::from(index - first));
            Parameter { access: if writable { Access::Always } else { Access::ReadOnly }, ..parameter }
        })
    })
}
