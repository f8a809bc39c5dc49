//! When the next request goes out: the silence that is kept before it, and from when that counts.

use crate::asker::*;
use drivebus_rtu::*;

const SILENCE: Duration = Duration::from_millis(2);
const WRITE: Request<'_> = Request::write(0x2000, 5);

/// The request that is begun at `now` goes out at `go` and not before.
fn goes_out(master: &mut Master, now: Instant, request: &Request<'_>, go: Instant) {
    master.begin_in_doubt(now, unit(1).into(), request, TIMEOUT).unwrap();
    assert_eq!(master.deadline(), Some(go));
    assert_eq!(master.poll(before(go)), None);
    assert!(matches!(master.poll(go), Some(Event::Transmit(_))));
}

#[test]
fn a_gap_is_kept_where_it_is_longer_than_the_silence() {
    for (gap, quiet) in [(0, 2), (1, 2), (2, 2), (3, 3), (20, 20)] {
        let mut master = Master::with_silence(SILENCE);
        master.keep_gap(Duration::from_millis(gap));
        goes_out(&mut master, ms(100), &read(1), ms(100 + quiet));
        master.sent(ms(130));
        assert!(matches!(master.poll(ms(130) + TIMEOUT), Some(Event::NoAnswer { .. })));
        goes_out(&mut master, ms(131), &read(1), ms(130 + quiet));
    }
}

/// The answer proves that the request has left the wire, even if it was computed to take longer. A late one proves nothing.
#[test]
fn the_silence_counts_from_the_answer_unless_that_may_be_late() {
    for is_open in [false, true] {
        let mut master = Master::with_silence(SILENCE);
        if is_open {
            goes_out(&mut master, ms(10), &WRITE, ms(12));
            master.sent(ms(100));
            master.abort(ms(100));
        }
        goes_out(&mut master, ms(100), &WRITE, ms(102));
        master.sent(ms(150));
        master.receive(ms(120), confirms(unit(1), &WRITE).as_bytes());
        assert!(matches!(master.poll(ms(120)), Some(Event::Answer(_))));
        let go = if is_open { ms(150) } else { ms(120) } + SILENCE;
        goes_out(&mut master, ms(121), &WRITE, go);
    }
    // What could not be mistaken is not late, whatever else is owed.
    let mut master = Master::with_silence(SILENCE);
    goes_out(&mut master, ms(10), &read(1), ms(12));
    master.sent(ms(100));
    master.abort(ms(100));
    goes_out(&mut master, ms(100), &read(2), ms(102));
    master.sent(ms(150));
    master.receive(ms(120), words(unit(1), 2, 7).as_bytes());
    assert!(matches!(master.poll(ms(120)), Some(Event::Answer(_))));
    goes_out(&mut master, ms(121), &WRITE, ms(120) + SILENCE);
}
