//! What is seen of a motor after it was told to stop, and whether that proves that it obeys.
//!
//! A drive that ramps down says "running" until it stands. That its frequency falls proves nothing: it also falls in a
//! reversal, at a limit of the current, behind a controller, to a setpoint that was lowered, or while a turning motor is
//! caught, and each of these may end anywhere or go on through zero. Two things do prove it. One is standstill. The other
//! is a fall that began when the stop was sent, from the setpoint at which the motor ran, along the ramp that is set in
//! the drive. Whether anybody else may have told it to slow down is for who asks.

use std::time::Duration;

use drivebus_rtu::Instant;

/// Time for which a fall is looked at where the ramp is not known; where it is, half as long again as that takes.
const LONGEST: Duration = Duration::from_secs(60);

/// Time of a ramp that has to be seen.
const LONG_ENOUGH: Duration = Duration::from_millis(500);

/// Hertz of a ramp that have to be seen.
const FAR_ENOUGH: f64 = 1.0;

/// Hertz by which the frequency may be off its ramp: some hundredths go up and down where a drive controls its flux.
const WOBBLE: f64 = 0.05;

/// Time before the confirmation of a stop in which its ramp may begin, once the stop was sent.
const EXCHANGE: Duration = Duration::from_millis(100);

/// Time behind the confirmation of a stop in which its ramp may begin.
const DELAY: Duration = Duration::from_millis(100);

/// Time for which a motor that was seen running has to be at rest: one that turns round passes through zero.
const AT_REST: Duration = Duration::from_millis(200);

/// How often a rest is given that time. A state that goes to and fro between rest and motion would be looked at without
/// end, and nothing else be tried.
const RESTS: u32 = 16;

/// One look at a motor, whose frequency was what it is at some moment between two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glimpse {
    /// When the drive was asked.
    pub asked: Instant,
    /// When its answer had come.
    pub answered: Instant,
    /// Its output frequency in Hz, whichever way the motor turns: 0 or more.
    pub hz: f64,
    /// The setpoint in force in Hz, 0 or more; infinite where nobody knows it, and then no fall proves anything.
    pub setpoint: f64,
}

/// What was seen since a stop was sent.
///
/// ```
/// use std::time::Duration;
///
/// use drivebus_drive::{Fall, Glimpse};
/// use drivebus_rtu::Instant;
///
/// // It ran at 50 Hz, is set to lose 5 Hz in a second, and was told to stop at 10 s.
/// let at = |millis: u64| Instant::ZERO + Duration::from_millis(millis);
/// let mut fall = Fall::new(at(10_000), at(10_010), Duration::from_secs(1));
/// for (millis, hz) in [(10_100, 49.5), (10_300, 48.5), (10_500, 47.5), (10_700, 46.5)] {
///     fall.goes_on();
///     fall.see(Glimpse { asked: at(millis), answered: at(millis + 10), hz, setpoint: 50.0 });
/// }
/// assert!(fall.is_worth_asking());
/// assert!(fall.goes_along(5.0));
/// // The ramp of a drive that is set otherwise went elsewhere.
/// assert!(!fall.goes_along(10.0));
/// ```
#[derive(Debug, Clone)]
pub struct Fall {
    /// Until when it is looked at in any case.
    due: Instant,
    until: Instant,
    /// Time in which the frequency must fall.
    patience: Duration,
    /// When even a fall is no longer looked at.
    longest: Instant,
    /// Between which moments the ramp of the stop begins.
    begins: (Instant, Instant),
    confirmed: Instant,
    lowest: f64,
    went_on: bool,
    rests_since: Option<Instant>,
    /// How often it came to rest.
    rests: u32,
    looks: Vec<Glimpse>,
    /// Whether a look was off the ramp: whatever comes later, it was not the stop's.
    is_off: bool,
}

impl Fall {
    /// Time in which the frequency of a motor that stops must fall: even a ramp of an hour takes off a hundredth of a
    /// hertz in that.
    pub const PATIENCE: Duration = Duration::from_secs(1);

    /// Nothing was seen yet.
    ///
    /// `sent` is the moment before the stop was sent, `confirmed` the one when the drive had confirmed it, and for
    /// `within` behind that the motor is looked at in any case.
    pub fn new(sent: Instant, confirmed: Instant, within: Duration) -> Self {
        // Nothing is earlier than the clock's start, and so not earlier than the stop either.
        let earliest = before(confirmed, EXCHANGE).unwrap_or_default().max(sent);
        Self {
            due: confirmed + within,
            until: confirmed + within,
            patience: within.max(Self::PATIENCE),
            longest: confirmed + LONGEST,
            begins: (earliest, confirmed + DELAY),
            confirmed,
            lowest: f64::INFINITY,
            went_on: false,
            rests_since: None,
            rests: 0,
            looks: Vec::new(),
            is_off: false,
        }
    }

    /// Until when it is worth another look.
    pub fn until(&self) -> Instant {
        self.until
    }

    /// The frequency that was seen last, in Hz; `None` if none was.
    pub fn frequency(&self) -> Option<f64> {
        self.looks.last().map(|look| look.hz)
    }

    /// When that was; when the drive had confirmed the stop if none was seen.
    pub fn seen_at(&self) -> Instant {
        self.looks.last().map_or(self.confirmed, |look| look.answered)
    }

    /// For `time` nobody looked, because something else was asked: that does not count.
    pub fn wait(&mut self, time: Duration) {
        self.until = self.until + time;
    }

    /// It is not at rest.
    pub fn goes_on(&mut self) {
        self.went_on = true;
        self.rests_since = None;
    }

    /// It is at rest. Whether that is its standstill, and no passage through zero.
    pub fn rests(&mut self, now: Instant) -> bool {
        let since = *self.rests_since.get_or_insert_with(|| {
            self.rests += 1;
            if self.rests <= RESTS {
                self.until = self.until.max(now + 2 * AT_REST);
            }
            now
        });
        !self.went_on || now.saturating_duration_since(since) >= AT_REST
    }

    /// Takes one more `look` into account.
    pub fn see(&mut self, look: Glimpse) {
        if look.hz < self.lowest && !self.looks.is_empty() {
            self.until = (look.answered + self.patience).min(self.longest).max(self.due);
        }
        self.lowest = self.lowest.min(look.hz);
        self.looks.push(look);
    }

    /// Whether so much of it was seen that it is worth asking the drive for its ramp.
    pub fn is_worth_asking(&self) -> bool {
        self.is_seen_for(LONG_ENOUGH, 2.0 * WOBBLE)
    }

    /// Whether enough was seen, and all of it where a ramp of `slope` Hz/s goes that began with the stop.
    ///
    /// What was off such a ramp once, proves nothing later either. No slope that is not more than 0 is a ramp's.
    pub fn goes_along(&mut self, slope: f64) -> bool {
        let Some(&first) = self.looks.first() else { return false };
        if slope.is_nan() || slope <= 0.0 {
            return false;
        }
        let (_, latest) = self.begins;
        self.longest = self.longest.max(latest + seconds(1.5 * first.hz / slope));
        if self.is_off || !self.is_seen_for(LONG_ENOUGH, FAR_ENOUGH) {
            return false;
        }
        self.is_off = !self.began_with_the_stop(first.setpoint, slope);
        !self.is_off
    }

    /// Whether a ramp from `setpoint` of `slope` Hz/s, that began with the stop, goes by every look.
    ///
    /// By how far the motor has fallen each look tells when the ramp began: between two moments, as nobody knows when in
    /// the exchange the drive looked, and as it wobbles. There has to be a moment that fits all of them.
    fn began_with_the_stop(&self, setpoint: f64, slope: f64) -> bool {
        let (mut earliest, mut latest) = self.begins;
        for look in &self.looks {
            let fallen = look.setpoint - look.hz;
            #[expect(clippy::float_cmp, reason = "it is what a drive says again and again, and nobody's arithmetic")]
            let is_another = look.setpoint != setpoint;
            if is_another || fallen.is_nan() || fallen < -WOBBLE {
                return false;
            }
            if let Some(began) = before(look.asked, seconds((fallen + WOBBLE) / slope)) {
                earliest = earliest.max(began);
            }
            if fallen > WOBBLE {
                let Some(began) = before(look.answered, seconds((fallen - WOBBLE) / slope)) else {
                    return false;
                };
                latest = latest.min(began);
            }
        }
        earliest <= latest
    }

    fn is_seen_for(&self, time: Duration, hz: f64) -> bool {
        let (Some(first), Some(last)) = (self.looks.first(), self.looks.last()) else { return false };
        last.asked.saturating_duration_since(first.answered) >= time && first.hz - last.hz >= hz
    }
}

/// The moment `time` before `at`; `None` where the clock had not begun.
fn before(at: Instant, time: Duration) -> Option<Instant> {
    let since_start = at.saturating_duration_since(Instant::ZERO);
    Some(Instant::ZERO + since_start.checked_sub(time)?)
}

/// So many seconds, or as near as a duration comes: none where they are less, and the longest where they are more.
fn seconds(seconds: f64) -> Duration {
    let nearest = if seconds > 0.0 { Duration::MAX } else { Duration::ZERO };
    Duration::try_from_secs_f64(seconds).unwrap_or(nearest)
}

#[cfg(test)]
mod tests;
