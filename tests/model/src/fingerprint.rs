//! States that behave alike are one state: moments count by how far they lie from now, and what is long past counts alike.
//!
//! The master shows all that it holds when it is printed for debugging, so its text is what is compared: whatever field is
//! added to it, is compared too. What its framer leaves out of that text, no state of this model differs in alone.

use std::fmt::{self, Debug, Write};

use drivebus_rtu::Instant;

/// Longer ago than any rule looks back.
const LONG_AGO: i64 = 20_000_000_000;

/// How far `at` lies from `now`, in nanoseconds.
pub fn offset(now: Instant, at: Instant) -> i64 {
    let ahead = at.saturating_duration_since(now).as_nanos();
    let behind = now.saturating_duration_since(at).as_nanos();
    let offset = i64::try_from(ahead).unwrap_or(i64::MAX) - i64::try_from(behind).unwrap_or(i64::MAX);
    offset.max(-LONG_AGO)
}

/// Takes in a text in which each `Instant(…)` is told as its offset from `now`.
struct Relative<'a> {
    now: Instant,
    /// Fields of which it makes no difference when it was.
    timeless: &'a [&'a str],
    number: u64,
    /// How many pieces of `Instant(` were written last.
    pieces: u8,
    /// Whether the field is one of these.
    is_timeless: bool,
}

impl Relative<'_> {
    /// Takes in eight bytes more: multiplied out to twice the width, so that each bit reaches all others.
    fn take(&mut self, word: u64) {
        let product = u128::from(self.number ^ word) * 0x9E37_79B9_7F4A_7C15;
        let ([low @ .., _, _, _, _, _, _, _, _], [_, _, _, _, _, _, _, _, high @ ..]) =
            (product.to_le_bytes(), product.to_le_bytes());
        self.number = u64::from_le_bytes(low).rotate_left(29) ^ u64::from_le_bytes(high) ^ word.rotate_left(17);
    }
}

impl Write for Relative<'_> {
    fn write_str(&mut self, piece: &str) -> fmt::Result {
        // Names and numbers tell all; what stands between them follows from them.
        let Some(first) = piece.bytes().next().filter(u8::is_ascii_alphanumeric) else {
            self.pieces = if self.pieces == 1 && piece == "(" { 2 } else { 0 };
            return Ok(());
        };
        if self.pieces == 2
            && let Ok(nanos) = piece.parse()
        {
            let offset = if self.is_timeless { 0 } else { offset(self.now, Instant::from_nanos(nanos)) };
            self.take(offset.cast_unsigned());
            self.pieces = 0;
            return Ok(());
        }
        self.pieces = u8::from(piece == "Instant");
        // The name of a field is small.
        if first.is_ascii_lowercase() {
            self.is_timeless = self.timeless.contains(&piece);
        }
        let (words, rest) = piece.as_bytes().as_chunks::<8>();
        for word in words {
            self.take(u64::from_le_bytes(*word));
        }
        let mut last = [0; 8];
        last[..rest.len()].copy_from_slice(rest);
        // The length tells pieces from each other that differ in where they end.
        self.take(u64::from_le_bytes(last) ^ (piece.len() as u64) << 56);
        Ok(())
    }
}

/// A number for all that `thing` shows at `now`, but when it was what the fields hold that are `timeless`.
pub fn of(now: Instant, thing: &dyn Debug, timeless: &[&str]) -> u64 {
    let mut relative = Relative { now, timeless, number: 0, pieces: 0, is_timeless: false };
    // Nothing here fails.
    let _ = write!(relative, "{thing:?}");
    relative.number
}

#[cfg(test)]
mod tests {
    use drivebus_rtu::{Destination, Duration, Master, OVERTAKING, Request, UnitAddress};

    use super::*;

    /// A master that was opened at `start` and left a read open half a second later.
    fn master(start: Instant) -> Master {
        let mut master = Master::with_silence(Duration::ZERO);
        master.opened(start);
        let to = Destination::Unit(UnitAddress::MIN);
        master.begin_in_doubt(start, to, &Request::read(0, 1).unwrap(), Duration::from_millis(500)).unwrap();
        assert!(master.poll(start).is_some());
        master.sent(start);
        assert!(master.poll(start + Duration::from_millis(500)).is_some());
        master
    }

    #[test]
    fn only_the_time_since_counts() {
        let (early, late) = (Instant::from_nanos(100_000_000_000), Instant::from_nanos(107_000_000_000));
        let second = Duration::from_secs(1);
        assert_eq!(of(early + second, &master(early), &[]), of(late + second, &master(late), &[]));
        assert_ne!(of(early + second, &master(early), &[]), of(early + second + second, &master(early), &[]));
    }

    #[test]
    fn what_is_long_past_counts_alike() {
        let start = Instant::from_nanos(100_000_000_000);
        let later = start + 20 * OVERTAKING;
        assert_eq!(of(later, &master(start), &[]), of(later + OVERTAKING, &master(start), &[]));
    }

    #[derive(Debug)]
    #[expect(dead_code, reason = "only what is printed of them counts")]
    struct Fields {
        busy: Option<Instant>,
        until: Instant,
    }

    #[test]
    fn when_it_was_counts_but_in_the_fields_that_are_named() {
        let [now, sooner, later] = [9, 7, 8].map(|seconds| Instant::from_nanos(seconds * 1_000_000_000));
        let number = |busy, until, timeless| of(now, &Fields { busy, until }, timeless);
        assert_eq!(number(Some(sooner), later, &["busy"]), number(Some(later), later, &["busy"]));
        assert_ne!(number(Some(sooner), later, &["busy"]), number(None, later, &["busy"]));
        assert_ne!(number(Some(sooner), later, &["busy"]), number(Some(sooner), sooner, &["busy"]));
        assert_ne!(number(Some(sooner), later, &["until"]), number(Some(later), later, &["until"]));
    }
}
