//! When the figures of a bus are worth a hint. Each threshold stands here with its reason; the words are in `hint`.

use drivebus_rtu::UnitAddress;

use crate::health::hint::{By, Hint};
use crate::health::stats::{Counters, Stats};

/// One default read that brings nothing is three requests; of fewer nothing is said.
const ENOUGH_REQUESTS: u64 = 3;

/// So many of a kind are no accident: a contactor nearby spoils one frame, or two.
const NO_ACCIDENT: u64 = 3;

/// What happened once may have come in one burst, or with a plug; twice is no chance.
const MORE_THAN_ONE: u64 = 2;

/// Noise is worth a word from one byte in so many requests on; a sound line brings none in days.
const REQUESTS_PER_NOISE: u64 = 100;

/// Of bytes that a disturbance makes, two in 256 are 00 or FF; of a line that floats, nearly all are. Half is far from both.
const FLOATING: Share = Share { part: 1, of: 2 };

/// A sound line damages less than one answer in a million. From here on it costs retries all the time.
const DAMAGED: Share = Share { part: 1, of: 100 };

/// A unit that is silent on half of what it is asked is not disturbed now and then.
const SILENT: Share = Share { part: 1, of: 2 };

/// One answer may be late because the unit was storing something; two are its habit.
const LATE: u64 = 2;

/// Frames that come unasked are another master's if there are so many; few are the answers to calls that were cancelled.
const UNASKED: u64 = 10;
const UNASKED_SHARE: Share = Share { part: 1, of: 10 };

impl Stats {
    /// What these figures most likely mean; empty for a line that is sound, or was hardly used.
    pub fn hints(&self) -> Vec<Hint> {
        let total = &self.total;
        let mut hints = Vec::new();
        if self.settings_changed > 0 {
            // No guess: it was seen.
            hints.push(Hint::SettingsChanged { times: self.settings_changed });
        }
        if total.requests < ENOUGH_REQUESTS {
            return hints;
        }
        if total.right() == 0 {
            hints.extend(self.of_no_answer());
        } else {
            hints.extend(self.of_noise().filter(|_| !self.meets_late_answers(total.noise_events)));
            hints.extend(self.of_damage().filter(|_| !self.meets_late_answers(total.crc_errors)));
            hints.extend(self.of_other_answers());
            hints.extend(self.of_silence());
        }
        if total.own_echoes >= MORE_THAN_ONE {
            hints.push(Hint::AdapterEcho { echoes: total.own_echoes });
        }
        let unasked = total.late.saturating_sub(total.left_open());
        let unasked = if unasked >= UNASKED && UNASKED_SHARE.is_reached(unasked, total.requests) { unasked } else { 0 };
        let foreign = total.foreign.saturating_sub(total.other_functions);
        if foreign + unasked >= NO_ACCIDENT {
            hints.push(Hint::OtherMaster { frames: foreign + unasked });
        }
        hints
    }

    /// Not one right answer came.
    fn of_no_answer(&self) -> Vec<Hint> {
        let &Counters { requests, noise_bytes: noise, noise_idle: idle, crc_errors: damaged, .. } = &self.total;
        let floats = FLOATING.is_reached(idle, noise) && damaged == 0;
        let others = self.of_other_answers();
        if others.iter().any(|hint| !matches!(hint, Hint::OtherAnswers { by: By::Bytes, .. })) {
            return others;
        }
        let mut hints = Vec::new();
        let is_noisy = self.total.noise_events >= MORE_THAN_ONE || damaged > 0;
        if is_noisy && noise + damaged >= requests && !floats {
            hints.push(Hint::WrongFormat { requests, noise, damaged });
        } else {
            // Whole frames of others are told by themselves.
            if self.total.foreign < NO_ACCIDENT {
                hints.push(Hint::NobodyAnswers { requests });
            }
            hints.extend(self.of_noise());
        }
        hints
    }

    fn of_noise(&self) -> Option<Hint> {
        let &Counters { requests, noise_bytes: noise, noise_idle: idle, .. } = &self.total;
        let events = self.total.noise_events;
        if noise < NO_ACCIDENT || noise * REQUESTS_PER_NOISE < requests || events < MORE_THAN_ONE {
            return None;
        }
        if FLOATING.is_reached(idle, noise) {
            return Some(Hint::NoBias { noise, idle });
        }
        let in_place_of_answers = |figures: &Counters| figures.noise_events.min(figures.other_answers);
        let told = self.units.values().filter(|figures| figures.says_no_frames()).map(in_place_of_answers).sum::<u64>();
        (events.saturating_sub(told) >= MORE_THAN_ONE).then_some(Hint::Interference { noise })
    }

    /// Units whose requests were answered by something else, each with what it was most often.
    fn of_other_answers(&self) -> Vec<Hint> {
        let by = |figures: &Counters| {
            let &Counters { other_functions: functions, other_transactions: transactions, .. } = figures;
            if transactions >= MORE_THAN_ONE {
                Some((By::Transactions, transactions))
            } else if functions >= MORE_THAN_ONE {
                Some((By::Functions, functions))
            } else {
                figures.says_no_frames().then_some((By::Bytes, figures.other_answers))
            }
        };
        let told = self.units.iter().filter_map(|(&unit, figures)| Some((unit, figures.requests, by(figures)?)));
        told.map(|(unit, requests, (by, others))| Hint::OtherAnswers { unit, others, requests, by }).collect()
    }

    fn of_damage(&self) -> Option<Hint> {
        let is_damaged = |figures: &Counters| {
            figures.crc_errors >= NO_ACCIDENT && DAMAGED.is_reached(figures.crc_errors, figures.came())
        };
        let mut damaged = self.units.iter().filter(|(_, figures)| is_damaged(figures));
        let (unit, figures) = match (damaged.next(), damaged.next()) {
            // One of several: where it is connected matters, not the line.
            (Some((&unit, figures)), None) if figures.came() < self.total.came() => (Some(unit), figures),
            (Some(_), _) => (None, &self.total),
            (None, _) if is_damaged(&self.total) => (None, &self.total),
            (None, _) => return None,
        };
        Some(Hint::Damaged { unit, damaged: figures.crc_errors, answers: figures.came() })
    }

    /// Whether `events` that spoilt bytes are no more than the answers that came late. A late one meets the next request on the
    /// wire, and what both leave is neither interference nor a line that floats.
    fn meets_late_answers(&self, events: u64) -> bool {
        let late = self.late();
        late >= LATE && events <= late && !self.slow_units(late).is_empty()
    }

    /// Answers that came after their time-out.
    fn late(&self) -> u64 {
        self.total.late.min(self.total.left_open())
    }

    /// Units whose answers come too late, and units whose answers do not come while those of others do.
    fn of_silence(&self) -> Vec<Hint> {
        let late = self.late();
        let slow = if late >= LATE { self.slow_units(late) } else { Vec::new() };
        let is_silent = |figures: &Counters| {
            let silent = figures.timeouts.saturating_sub(figures.other_answers);
            silent >= NO_ACCIDENT && SILENT.is_reached(silent, figures.requests)
        };
        let one_answers = self.units.values().any(|figures| figures.right() > 0 && !is_silent(figures));
        let mut hints = Vec::new();
        for (&unit, figures) in &self.units {
            let &Counters { requests, other_answers, .. } = figures;
            let timeouts = figures.timeouts.saturating_sub(other_answers);
            if slow.contains(&unit) {
                hints.push(Hint::TimeoutTooShort { unit, late, slowest: figures.round_trip.max });
            } else if one_answers && is_silent(figures) {
                hints.push(Hint::SilentUnit { unit, timeouts, requests });
            }
        }
        hints
    }

    /// Whose answers the `late` ones are. One counts for the unit that was asked when it came, which may be the next one:
    /// then it is the unit that left most open, if that many may be its own.
    fn slow_units(&self, late: u64) -> Vec<UnitAddress> {
        let silent = || self.units.iter().filter(|(_, figures)| figures.timeouts > 0);
        let slow: Vec<_> = silent().filter(|(_, figures)| figures.late > 0).map(|(&unit, _)| unit).collect();
        if !slow.is_empty() {
            return slow;
        }
        let most = silent().max_by_key(|(_, figures)| figures.timeouts);
        most.filter(|(_, figures)| late * 2 >= figures.timeouts).map(|(&unit, _)| unit).into_iter().collect()
    }
}

impl Counters {
    /// What the unit said and the line left whole.
    fn right(&self) -> u64 {
        self.answers + self.refusals
    }

    /// All that came as an answer.
    fn came(&self) -> u64 {
        self.right() + self.crc_errors + self.bad_answers
    }

    /// Whether most of what it did not answer brought bytes that are no frame instead, and other ones than an idle line gives.
    fn says_no_frames(&self) -> bool {
        let others = self.other_answers.min(self.noise_events);
        others >= MORE_THAN_ONE
            && SILENT.is_reached(others, self.timeouts)
            && !FLOATING.is_reached(self.noise_idle, self.noise_bytes)
    }

    /// Requests whose answer could still come.
    fn left_open(&self) -> u64 {
        self.timeouts + self.crc_errors + self.bad_answers
    }
}

/// A share of a whole, in whole numbers.
#[derive(Debug, Clone, Copy)]
struct Share {
    part: u64,
    of: u64,
}

impl Share {
    /// Whether `count` of `all` is as much; not of nothing.
    fn is_reached(self, count: u64, all: u64) -> bool {
        all > 0 && count * self.of >= all * self.part
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn unit(raw: u8) -> UnitAddress {
        UnitAddress::new(raw).unwrap()
    }

    /// A bus that asked each unit what these figures say.
    fn bus(units: impl IntoIterator<Item = (u8, Counters)>) -> Stats {
        let mut stats = Stats::default();
        for (raw, figures) in units {
            stats.count(Some(unit(raw)), |counters| {
                counters.requests += figures.requests;
                counters.answers += figures.answers;
                counters.refusals += figures.refusals;
                counters.timeouts += figures.timeouts;
                counters.crc_errors += figures.crc_errors;
                counters.late += figures.late;
                counters.foreign += figures.foreign;
                counters.noise_bytes += figures.noise_bytes;
                counters.noise_idle += figures.noise_idle;
                counters.own_echoes += figures.own_echoes;
                counters.other_answers += figures.other_answers;
                counters.other_functions += figures.other_functions;
                counters.other_transactions += figures.other_transactions;
                counters.noise_events += figures.noise_events;
            });
        }
        stats
    }

    /// A unit that answered all of `requests`.
    fn sound(requests: u64) -> Counters {
        Counters { requests, answers: requests, ..Counters::default() }
    }

    fn silent(requests: u64) -> Counters {
        Counters { requests, timeouts: requests, ..Counters::default() }
    }

    #[test]
    fn a_sound_line_brings_no_hint() {
        assert_eq!(Stats::default().hints(), []);
        assert_eq!(bus([(1, silent(2))]).hints(), [], "too little to judge by");
        // One bad moment among thousands, of every kind.
        let figures = Counters {
            answers: 9_997,
            timeouts: 2,
            crc_errors: 1,
            late: 1,
            foreign: 1,
            noise_bytes: 12,
            noise_idle: 6,
            noise_events: 4,
            ..sound(10_000)
        };
        assert_eq!(bus([(1, figures), (2, sound(10_000))]).hints(), []);
        let refusing = Counters { requests: 50, refusals: 50, ..Counters::default() };
        assert_eq!(bus([(1, refusing)]).hints(), [], "a refusal is an answer");
    }

    #[test]
    fn noise_is_told_by_what_it_is() {
        let figures = |noise_bytes, noise_idle, noise_events| {
            bus([(1, Counters { noise_bytes, noise_idle, noise_events, ..sound(1_000) })]).hints()
        };
        let noisy = |noise_bytes, noise_idle| figures(noise_bytes, noise_idle, 2);
        assert_eq!(noisy(10, 9), [Hint::NoBias { noise: 10, idle: 9 }]);
        assert_eq!(noisy(10, 1), [Hint::Interference { noise: 10 }]);
        assert_eq!(noisy(9, 9), [], "less than one in a hundred requests");
        assert_eq!(figures(10, 9, 1), [], "all at once");
        assert_eq!(figures(90, 2, 1), [], "all at once");
    }

    #[test]
    fn not_one_right_answer_is_told_by_what_came_instead() {
        let none = |figures: Counters| bus([(1, figures)]).hints();
        assert_eq!(none(silent(3)), [Hint::NobodyAnswers { requests: 3 }]);
        let garbled = Counters { noise_bytes: 20, noise_idle: 4, noise_events: 3, ..silent(3) };
        assert_eq!(none(garbled), [Hint::WrongFormat { requests: 3, noise: 20, damaged: 0 }]);
        let damaged = Counters { requests: 3, crc_errors: 3, ..Counters::default() };
        assert_eq!(none(damaged), [Hint::WrongFormat { requests: 3, noise: 0, damaged: 3 }]);
        let floating = Counters { noise_bytes: 3, noise_idle: 3, noise_events: 3, ..silent(3) };
        assert_eq!(none(floating), [Hint::NobodyAnswers { requests: 3 }, Hint::NoBias { noise: 3, idle: 3 }]);
    }

    #[test]
    fn settings_that_another_program_changed_are_told_at_once() {
        let stats = Stats { settings_changed: 1, ..bus([(1, silent(1))]) };
        assert_eq!(stats.hints(), [Hint::SettingsChanged { times: 1 }]);
        let stats = Stats { settings_changed: 2, ..bus([(1, sound(900))]) };
        assert_eq!(stats.hints(), [Hint::SettingsChanged { times: 2 }]);
    }

    #[test]
    fn a_greeting_is_no_wrong_format() {
        let greeted = Counters { noise_bytes: 60, ..silent(3) };
        assert_eq!(bus([(1, greeted)]).hints(), [Hint::NobodyAnswers { requests: 3 }]);
    }

    #[test]
    fn what_comes_in_the_place_of_answers_is_neither_noise_nor_silence() {
        let of = |by| [Hint::OtherAnswers { unit: unit(1), others: 3, requests: 13, by }];
        let others = Counters { requests: 13, answers: 10, timeouts: 3, other_answers: 3, ..Counters::default() };
        let bytes = Counters { noise_bytes: 6, noise_events: 3, ..others.clone() };
        assert_eq!(bus([(1, bytes.clone())]).hints(), of(By::Bytes));
        let functions = Counters { other_functions: 3, foreign: 3, ..others.clone() };
        assert_eq!(bus([(1, functions.clone())]).hints(), of(By::Functions));
        assert_eq!(bus([(1, Counters { other_transactions: 3, ..others.clone() })]).hints(), of(By::Transactions));
        let other_unit = Counters { foreign: 3, ..others };
        assert_eq!(bus([(1, other_unit)]).hints(), [Hint::OtherMaster { frames: 3 }]);
        let all = Counters { requests: 3, answers: 0, ..functions };
        let wanted = [Hint::OtherAnswers { unit: unit(1), others: 3, requests: 3, by: By::Functions }];
        assert_eq!(bus([(1, all)]).hints(), wanted, "somebody answers");
        let beside = Counters { noise_bytes: 40, noise_events: 9, ..sound(100) };
        assert!(bus([(1, bytes), (2, beside)]).hints().contains(&Hint::Interference { noise: 46 }));
    }

    #[test]
    fn damage_is_the_units_or_the_lines() {
        let damaged = |crc_errors| Counters { answers: 100 - crc_errors, crc_errors, ..sound(100) };
        let of = |unit, damaged, answers| [Hint::Damaged { unit, damaged, answers }];
        assert_eq!(bus([(1, damaged(5)), (2, sound(900))]).hints(), of(Some(unit(1)), 5, 100));
        assert_eq!(bus([(1, damaged(5)), (2, damaged(3))]).hints(), of(None, 8, 200));
        assert_eq!(bus([(1, damaged(5))]).hints(), of(None, 5, 100), "one unit is all the line there is");
        assert_eq!(bus([(1, damaged(2)), (2, damaged(2))]).hints(), of(None, 4, 200), "spread thin");
        assert_eq!(bus([(1, damaged(2)), (2, sound(100))]).hints(), []);
    }

    #[test]
    fn late_answers_are_those_of_a_unit_that_left_requests_open() {
        let slow = |unit| [Hint::TimeoutTooShort { unit, late: 3, slowest: Duration::ZERO }];
        let itself = Counters { answers: 97, timeouts: 3, late: 3, ..sound(100) };
        assert_eq!(bus([(1, itself), (2, sound(100))]).hints(), slow(unit(1)));
        // They came while unit 2 was asked.
        let before = Counters { answers: 97, timeouts: 3, ..sound(100) };
        let next = Counters { late: 3, ..sound(100) };
        assert_eq!(bus([(1, before.clone()), (2, next)]).hints(), slow(unit(1)));
        assert_eq!(bus([(1, before), (2, sound(100))]).hints(), [], "silent now and then, and never late");
    }

    #[test]
    fn what_late_answers_spoil_is_no_fault_of_the_line() {
        let slow = |crc_errors, noise_events| Counters {
            answers: 80,
            timeouts: 20 - crc_errors,
            crc_errors,
            late: 18,
            noise_bytes: 90,
            noise_idle: 70,
            noise_events,
            ..sound(100)
        };
        let names = |figures| bus([(1, figures)]).hints().iter().map(Hint::name).collect::<Vec<_>>();
        assert_eq!(names(slow(6, 12)), ["timeout_too_short"]);
        assert_eq!(names(slow(0, 40)), ["no_bias", "timeout_too_short"], "more than they can have met");
    }

    #[test]
    fn a_unit_is_silent_only_beside_others_that_are_not() {
        let of = |timeouts, requests| [Hint::SilentUnit { unit: unit(2), timeouts, requests }];
        assert_eq!(bus([(1, sound(100)), (2, silent(6))]).hints(), of(6, 6));
        let cancelled = Counters { late: 2, ..sound(100) };
        assert_eq!(bus([(1, cancelled), (2, silent(60))]).hints(), of(60, 60), "not what it answers too late");
        let fell_silent = Counters { answers: 40, timeouts: 60, ..sound(100) };
        assert_eq!(bus([(1, sound(100)), (2, fell_silent.clone())]).hints(), of(60, 100));
        assert_eq!(bus([(1, fell_silent.clone()), (2, fell_silent)]).hints(), [], "the power was off");
    }

    #[test]
    fn frames_that_nobody_asked_for_are_anothers() {
        let foreign = Counters { foreign: 3, ..sound(100) };
        assert_eq!(bus([(1, foreign)]).hints(), [Hint::OtherMaster { frames: 3 }]);
        let between = Counters { late: 40, ..sound(100) };
        assert_eq!(bus([(1, between)]).hints(), [Hint::OtherMaster { frames: 40 }]);
        let cancelled = Counters { answers: 91, late: 9, ..sound(100) };
        assert_eq!(bus([(1, cancelled)]).hints(), []);
    }
}
