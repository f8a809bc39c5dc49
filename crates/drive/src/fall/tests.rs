//! Motors of the simplest kind: one that ran at its setpoint, and from some moment on loses so many hertz in a second.

use proptest::prelude::*;

use super::*;

const SENT: u64 = 10_000;
const CONFIRMED: u64 = 10_020;

/// So many milliseconds of the line's clock.
fn at(millis: u64) -> Instant {
    Instant::ZERO + Duration::from_millis(millis)
}

fn fall() -> Fall {
    Fall::new(at(SENT), at(CONFIRMED), Duration::from_secs(1))
}

/// Looks at what has the frequency `hz` at a moment in milliseconds, ten times a second from `from` to `to`.
fn watch(fall: &mut Fall, (from, to): (u64, u64), setpoint: f64, hz: impl Fn(f64) -> f64) {
    for asked in (from..=to).step_by(100) {
        let (middle, answered) = (asked + 4, at(asked + 8));
        fall.goes_on();
        fall.see(Glimpse { asked: at(asked), answered, hz: hz(f64::from(u32::try_from(middle).unwrap())), setpoint });
    }
}

/// A motor at 50 Hz that loses 5 Hz in a second from `begin` on, in milliseconds.
fn ramp(begin: f64) -> impl Fn(f64) -> f64 {
    move |now| (50.0 - 5.0 * (now - begin).max(0.0) / 1e3).max(0.0)
}

#[test]
fn a_fall_on_the_ramp_that_began_with_the_stop_proves_it() {
    for begin in [10_000.0, 10_010.0, 10_020.0, 10_100.0] {
        let mut fall = fall();
        watch(&mut fall, (10_100, 10_500), 50.0, ramp(begin));
        assert!(!fall.goes_along(5.0), "half a second is not over");
        watch(&mut fall, (10_600, 10_700), 50.0, ramp(begin));
        assert!(fall.goes_along(5.0), "{begin}");
        assert!(fall.goes_along(5.0), "and does so when it is asked again");
    }
}

#[test]
fn a_fall_that_began_at_another_time_does_not() {
    for begin in [9_000.0, 9_900.0, 9_970.0, 10_160.0, 10_300.0, 11_000.0] {
        let mut fall = fall();
        watch(&mut fall, (10_100, 12_000), 50.0, ramp(begin));
        assert!(!fall.goes_along(5.0), "{begin}");
    }
    // However long ago the stop was sent: a ramp begins when a drive has got it.
    let mut fall = Fall::new(at(9_000), at(CONFIRMED), Duration::from_secs(1));
    watch(&mut fall, (10_100, 12_000), 50.0, ramp(9_850.0));
    assert!(!fall.goes_along(5.0));
}

#[test]
fn a_fall_along_another_slope_does_not() {
    for slope in [2.5, 4.0, 6.0, 50.0] {
        let mut fall = fall();
        watch(&mut fall, (10_100, 12_000), 50.0, ramp(10_010.0));
        assert!(!fall.goes_along(slope), "{slope}");
        assert!(!fall.goes_along(5.0), "what was off its ramp once, stays so");
    }
    for slope in [0.0, -5.0, f64::NAN] {
        let mut fall = fall();
        watch(&mut fall, (10_100, 12_000), 50.0, ramp(10_010.0));
        assert!(!fall.goes_along(slope), "{slope}");
        assert!(fall.goes_along(5.0), "and that tells nothing of the motor");
    }
}

/// It ends at the new setpoint, and goes along the same ramp until then.
#[test]
fn a_fall_to_a_setpoint_that_was_lowered_does_not() {
    let mut lowered = fall();
    watch(&mut lowered, (10_100, 10_700), 20.0, ramp(10_010.0));
    assert!(!lowered.goes_along(5.0));
    let mut meanwhile = fall();
    watch(&mut meanwhile, (10_100, 10_300), 50.0, ramp(10_010.0));
    watch(&mut meanwhile, (10_400, 10_900), 20.0, ramp(10_010.0));
    assert!(!meanwhile.goes_along(5.0));
    // Nobody knows the setpoint.
    let mut unknown = fall();
    watch(&mut unknown, (10_100, 10_900), f64::INFINITY, ramp(10_010.0));
    assert!(!unknown.goes_along(5.0));
}

#[test]
fn a_fall_from_another_speed_than_the_setpoint_does_not() {
    // It was still getting faster, and had come to 30 Hz.
    let mut slower = fall();
    watch(&mut slower, (10_100, 10_900), 50.0, |now| ramp(10_010.0)(now) - 20.0);
    assert!(!slower.goes_along(5.0));
    // A limit had let it be faster.
    let mut faster = fall();
    watch(&mut faster, (10_100, 10_900), 50.0, |now| ramp(10_010.0)(now) + 5.0);
    assert!(!faster.goes_along(5.0));
}

#[test]
fn some_hundredths_of_a_hertz_are_no_other_ramp() {
    let wobble = |by: f64| move |now: f64| ramp(10_010.0)(now) + by * (now / 70.0).sin();
    let mut flux = fall();
    watch(&mut flux, (10_100, 10_900), 50.0, wobble(0.04));
    assert!(flux.goes_along(5.0));
    let mut hunting = fall();
    watch(&mut hunting, (10_100, 10_900), 50.0, wobble(2.0));
    assert!(!hunting.goes_along(5.0));
}

#[test]
fn so_much_has_to_be_seen() {
    let mut none = fall();
    assert!(!none.goes_along(5.0) && !none.is_worth_asking());
    assert_eq!((none.frequency(), none.seen_at()), (None, at(CONFIRMED)));
    // A tenth of a hertz in half a second: of a slow ramp that is something, but no hertz yet.
    let slow = |now: f64| 50.0 - 0.25 * (now - 10_010.0) / 1e3;
    let mut slowly = fall();
    watch(&mut slowly, (10_100, 10_600), 50.0, slow);
    assert!(!slowly.is_worth_asking());
    watch(&mut slowly, (10_700, 10_700), 50.0, slow);
    assert!(slowly.is_worth_asking() && !slowly.goes_along(0.25));
    watch(&mut slowly, (10_800, 14_300), 50.0, slow);
    assert!(slowly.goes_along(0.25));
    assert_eq!(slowly.seen_at(), at(14_308));
}

/// A motor that turns round passes through zero, where it is at rest for a moment, and was not told to stop there.
#[test]
fn a_passage_through_zero_is_no_standstill() {
    let mut turned = fall();
    turned.goes_on();
    assert!(!turned.rests(at(11_000)));
    assert!(!turned.rests(at(11_199)));
    turned.goes_on();
    assert!(!turned.rests(at(11_300)), "its rest begins anew");
    assert!(!turned.rests(at(11_499)));
    assert!(turned.rests(at(11_500)));
    let mut never_seen_to_turn = fall();
    assert!(never_seen_to_turn.rests(at(10_030)));
}

/// Two looks at rest are to be had, also where the first comes late.
#[test]
fn a_rest_is_worth_two_looks() {
    let mut fall = fall();
    fall.goes_on();
    assert_eq!(fall.until(), at(11_020));
    fall.rests(at(11_000));
    assert_eq!(fall.until(), at(11_400));
    fall.rests(at(11_300));
    assert_eq!(fall.until(), at(11_400));
}

#[test]
fn a_fall_is_looked_at_as_long_as_it_goes_on() {
    let slow = |now: f64| 50.0 - 0.4 * (now - 10_010.0) / 1e3;
    let mut falls = fall();
    watch(&mut falls, (10_100, 10_100), 50.0, slow);
    assert_eq!(falls.until(), at(11_020), "one look is no fall");
    watch(&mut falls, (10_500, 10_500), 50.0, slow);
    assert_eq!(falls.until(), at(11_508));
    watch(&mut falls, (10_600, 10_600), 50.0, |_| slow(10_504.0));
    assert_eq!(falls.until(), at(11_508), "it falls no further");
    falls.wait(Duration::from_millis(30));
    assert_eq!(falls.until(), at(11_538), "others were looked at");
    // A minute, where nobody knows its ramp.
    watch(&mut falls, (69_900, 69_900), 50.0, slow);
    assert_eq!(falls.until(), at(70_020));
    // Where it is known, half as long again as that takes: 50 Hz at 0.4 Hz/s are 125 s.
    falls.goes_along(0.4);
    watch(&mut falls, (70_000, 70_000), 50.0, slow);
    assert_eq!(falls.until(), at(71_008));
}

#[test]
fn no_number_is_too_odd() {
    let odd = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, 0.0, f64::MIN_POSITIVE, f64::MAX];
    for (hz, setpoint, slope) in odd.iter().flat_map(|&a| odd.iter().flat_map(move |&b| odd.map(|c| (a, b, c)))) {
        for now in [Instant::ZERO, Instant::from_nanos(u64::MAX)] {
            let mut fall = Fall::new(now, Instant::ZERO, Duration::MAX);
            for asked in [now, Instant::ZERO, Instant::from_nanos(u64::MAX)] {
                fall.see(Glimpse { asked, answered: now, hz, setpoint });
                fall.wait(Duration::MAX);
                assert!(!fall.goes_along(slope), "{hz} {setpoint} {slope}");
            }
        }
    }
}

/// A ramp, how it is looked at, and how far each look is off: moments in nanoseconds.
#[derive(Debug, Clone)]
struct Scene {
    sent: u64,
    exchange: u64,
    begin: i64,
    slope: f64,
    setpoint: f64,
    /// Pause before each look, how long it takes, when within that the drive looked, and how far off that is.
    looks: Vec<(u64, u64, f64, f64)>,
}

prop_compose! {
    fn scene()(
        sent in 500_000_000..10_000_000_000_u64,
        exchange in 1_000_000..300_000_000_u64,
        begin in -400_000_000..800_000_000_i64,
        slope in 0.2..200.0_f64,
        setpoint in 5.0..400.0_f64,
        looks in prop::collection::vec(
            (0..150_000_000_u64, 1_000_000..60_000_000_u64, 0.0..1.0_f64, -0.049..0.049_f64), 2..30
        ),
    ) -> Scene {
        Scene { sent, exchange, begin, slope, setpoint, looks }
    }
}

#[expect(clippy::cast_precision_loss, reason = "some seconds in nanoseconds are exact")]
fn float(nanos: i64) -> f64 {
    nanos as f64 / 1e9
}

fn nanos(moment: u64) -> i64 {
    i64::try_from(moment).unwrap()
}

proptest! {
    /// The oracle knows when the ramp began: `begin` behind the stop. What began in the window is proved once enough of
    /// it was seen, and what is proved began there, as nearly as looks and wobble tell.
    #[test]
    fn what_is_proved_began_with_the_stop(scene in scene()) {
        let Scene { sent, exchange, begin, slope, setpoint, looks } = scene;
        let confirmed = sent + exchange;
        let mut fall = Fall::new(Instant::from_nanos(sent), Instant::from_nanos(confirmed), Duration::from_secs(1));
        let (mut now, mut seen) = (confirmed, Vec::new());
        for (pause, takes, part, off) in looks {
            let (asked, answered) = (now + pause, now + pause + takes);
            let middle = float(nanos(asked)) + part * float(nanos(takes));
            let along = (middle - float(nanos(sent) + begin)).max(0.0) * slope;
            // The ramp goes on below zero here, where a motor would stand: nobody looks at that any more.
            let hz = setpoint - along + off;
            fall.see(Glimpse { asked: Instant::from_nanos(asked), answered: Instant::from_nanos(answered), hz, setpoint });
            seen.push((asked, answered, hz));
            now = answered;
        }
        let proved = fall.goes_along(slope);

        let (first, last) = (seen[0], seen[seen.len() - 1]);
        let is_enough = last.0.saturating_sub(first.1) >= 500_000_000 && first.2 - last.2 >= 1.0;
        let began = float(nanos(sent) + begin);
        let earliest = float(nanos(sent.max(confirmed - 100_000_000.min(exchange))));
        let latest = float(nanos(confirmed + 100_000_000));
        let longest = seen.iter().map(|look| look.1 - look.0).max().unwrap();
        let blur = float(nanos(longest)) + 0.1 / slope + 1e-6;
        if is_enough && (earliest..=latest).contains(&began) {
            prop_assert!(proved, "it began in time, at {began}");
        }
        if proved {
            prop_assert!(is_enough);
            prop_assert!(earliest - blur <= began && began <= latest + blur, "{earliest} {began} {latest} {blur}");
        }
    }

    /// A stop of which nothing was seen but a motor that runs on, or falls as it likes, is not proved by that.
    #[test]
    fn what_goes_nowhere_proves_nothing(
        hz in prop::collection::vec(0.0..60.0_f64, 1..20),
        slope in 0.1..100.0_f64,
    ) {
        let mut fall = fall();
        let (mut now, mut last) = (CONFIRMED, 0.0);
        for each in hz {
            (now, last) = (now + 100, each);
            fall.see(Glimpse { asked: at(now), answered: at(now + 5), hz: each, setpoint: 60.0 });
        }
        // Where the ramp of the stop would be by now, at its fastest and its slowest.
        let since = |begun: u64| f64::from(u32::try_from(now - begun).unwrap()) / 1e3;
        let (low, high) = (60.0 - since(SENT) * slope - 0.005 * slope - 0.1, 60.0 - since(10_120) * slope + 0.1);
        let is_on_it = (low..=high.max(low)).contains(&last);
        prop_assert!(is_on_it || !fall.goes_along(slope));
    }
}

#[test]
fn a_state_that_goes_to_and_fro_is_not_looked_at_without_end() {
    let at = |millis: u64| Instant::ZERO + Duration::from_millis(millis);
    let mut fall = Fall::new(at(0), at(0), Duration::from_secs(1));
    let mut now = at(0);
    while now < fall.until() {
        fall.goes_on();
        assert!(!fall.rests(now));
        now = now + Duration::from_millis(100);
        assert!(now < at(60_000));
    }
}
