//! Moments and durations at their ends: whatever a caller gives, time never runs over, and nothing panics.

use drivebus_rtu::*;
use proptest::prelude::*;

fn duration() -> impl Strategy<Value = Duration> {
    prop::sample::select(vec![
        Duration::ZERO,
        Duration::from_nanos(1),
        Duration::from_millis(500),
        Duration::from_nanos(u64::MAX),
        Duration::from_secs(u64::MAX),
        Duration::MAX,
    ])
}

fn moment() -> impl Strategy<Value = Instant> {
    prop::sample::select(vec![0, 1, 1_000_000_000, u64::MAX - 1, u64::MAX]).prop_map(Instant::from_nanos)
}

fn piece() -> impl Strategy<Value = Vec<u8>> {
    let answer = Adu::answer(UnitAddress::MIN, &Answer::read(&[7, 8]).unwrap()).as_bytes().to_vec();
    prop::sample::select(vec![answer.clone(), answer[..4].to_vec(), answer[4..].to_vec(), vec![0xFF; 300]])
}

proptest! {
    #[test]
    fn a_master_takes_any_moment_and_any_time(
        asks in prop::collection::vec((moment(), duration(), duration(), moment(), any::<bool>()), 1..6),
        pieces in prop::collection::vec((moment(), piece()), 0..6),
    ) {
        let mut master = Master::new(&SerialFormat::DEFAULT);
        let request = Request::read(0, 2).unwrap();
        for (now, timeout, gap, end, in_doubt) in asks {
            master.keep_gap(gap);
            let unit = Destination::from(UnitAddress::MIN);
            let _ = if in_doubt {
                master.begin_in_doubt(now, unit, &request, timeout)
            } else {
                master.begin(now, unit, &request, timeout)
            };
            let _ = master.poll(now);
            master.sent(end);
            for (at, bytes) in &pieces {
                master.receive(*at, bytes);
                let _ = (master.deadline(), master.poll(*at).is_some());
            }
            master.still_owed(now, UnitAddress::MIN, &request, timeout);
            let _ = (master.in_quarantine(end, UnitAddress::MIN), master.attribution(end, UnitAddress::MIN, &request));
            master.abort(end);
            master.opened(now);
        }
    }

    #[test]
    fn a_framer_takes_any_silence_and_any_pause(
        silence in duration(),
        pieces in prop::collection::vec((moment(), piece(), duration(), moment()), 1..8),
    ) {
        let mut framer = Framer::new(silence);
        for (now, bytes, pause, least) in pieces {
            framer.receive(now, &bytes);
            framer.wait_for_the_rest(pause, least);
            let _ = (framer.deadline(), framer.poll(now).is_some());
        }
    }
}
