//! A frequency that moves along straight lines: to zero first where the direction changes, then to its target.

use std::time::Duration;

use drivebus_rtu::Instant;

/// How fast a frequency may rise and fall, in Hz per second; infinite for "at once".
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Slopes {
    pub(crate) rise: f64,
    pub(crate) fall: f64,
}

impl Slopes {
    /// From the times (s) that a drive takes from 0 Hz to `full_scale` Hz and back.
    pub(crate) fn from_times(full_scale: f64, rise: f64, fall: f64) -> Self {
        // Division by zero is meant: a ramp of 0.0 s is infinitely steep.
        Self { rise: full_scale / rise, fall: full_scale / fall }
    }
}

/// One straight line.
#[derive(Debug, Clone, Copy)]
struct Leg {
    from: f64,
    to: f64,
    begin: Instant,
    end: Instant,
}

impl Leg {
    fn new(begin: Instant, from: f64, to: f64, slope: f64) -> Self {
        let seconds = (to - from).abs() / slope;
        // An immobile ramp (0 Hz in no time, or no slope at all) is over at once.
        let time = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::ZERO);
        Self { from, to, begin, end: begin + time }
    }

    fn seconds(&self) -> f64 {
        self.end.saturating_duration_since(self.begin).as_secs_f64()
    }
}

/// A signed frequency in Hz as a function of time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ramp {
    legs: [Leg; 2],
}

impl Ramp {
    /// From `from` to `to`, beginning now.
    pub(crate) fn new(now: Instant, from: f64, to: f64, slopes: Slopes) -> Self {
        let via = if from * to < 0.0 {
            0.0
        } else if to.abs() < from.abs() {
            to
        } else {
            from
        };
        let first = Leg::new(now, from, via, slopes.fall);
        let second = Leg::new(first.end, via, to, slopes.rise);
        Self { legs: [first, second] }
    }

    /// The leg that is being travelled at `now`; `None` once the target is reached.
    fn leg(&self, now: Instant) -> Option<&Leg> {
        self.legs.iter().find(|leg| now < leg.end)
    }

    /// The frequency at `now`.
    pub(crate) fn at(&self, now: Instant) -> f64 {
        let Some(leg) = self.leg(now) else { return self.target() };
        let share = now.saturating_duration_since(leg.begin).as_secs_f64() / leg.seconds();
        leg.from + (leg.to - leg.from) * share
    }

    /// How fast the frequency's amount changes just after `now`: Hz per second, negative while it falls.
    pub(crate) fn slope(&self, now: Instant) -> f64 {
        self.leg(now).map_or(0.0, |leg| (leg.to.abs() - leg.from.abs()) / leg.seconds())
    }

    /// The next moment at which the slope changes.
    pub(crate) fn next_turn(&self, now: Instant) -> Option<Instant> {
        self.leg(now).map(|leg| leg.end)
    }

    /// Where the ramp leads.
    pub(crate) fn target(&self) -> f64 {
        self.legs[1].to
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "the moments are chosen so that the values are exact")]

    use super::*;

    fn at(seconds: f64) -> Instant {
        Instant::ZERO + Duration::from_secs_f64(seconds)
    }

    const SLOPES: Slopes = Slopes { rise: 5.0, fall: 10.0 };

    #[test]
    fn up_takes_the_rise_and_down_the_fall() {
        let up = Ramp::new(at(0.0), 0.0, 10.0, SLOPES);
        assert_eq!([up.at(at(1.0)), up.at(at(2.0)), up.at(at(9.0))], [5.0, 10.0, 10.0]);
        assert_eq!((up.slope(at(1.0)), up.next_turn(at(1.0))), (5.0, Some(at(2.0))));
        assert_eq!((up.slope(at(2.0)), up.next_turn(at(2.0))), (0.0, None));
        let down = Ramp::new(at(1.0), -10.0, -5.0, SLOPES);
        assert_eq!([down.at(at(1.25)), down.at(at(1.5))], [-7.5, -5.0]);
        assert_eq!(down.slope(at(1.25)), -10.0);
    }

    #[test]
    fn a_change_of_direction_passes_through_zero() {
        let turn = Ramp::new(at(0.0), 10.0, -10.0, SLOPES);
        assert_eq!([turn.at(at(0.5)), turn.at(at(1.0)), turn.at(at(2.0)), turn.at(at(3.0))], [5.0, 0.0, -5.0, -10.0]);
        assert_eq!((turn.slope(at(0.5)), turn.slope(at(2.0))), (-10.0, 5.0));
    }

    #[test]
    fn a_ramp_of_no_time_jumps() {
        let slopes = Slopes::from_times(50.0, 0.0, 0.0);
        assert_eq!(Ramp::new(at(3.0), 10.0, 50.0, slopes).at(at(3.0)), 50.0);
        assert_eq!(Ramp::new(at(3.0), 10.0, 0.0, slopes).at(at(3.0)), 0.0);
        assert_eq!(Ramp::new(at(3.0), 0.0, 0.0, slopes).at(at(3.0)), 0.0);
    }
}
