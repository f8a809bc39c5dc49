//! One small drive: a motor with its ramp, and what it shows of that.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use drivebus_drives::{Access, Entry, Kind, Place, Profile, Table};
use drivebus_rtu::Instant;

use crate::models::Model::{Acs355, Atv312, Eds300, Gd20, Gd350, Ms300, Vfd500, Wj200};
use crate::models::{Act, Model};

/// What the motor does, as the drive would say it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Turns {
    Stands,
    Forward,
    Reverse,
    Tripped,
}

/// In Hz a second, up and down.
const SLOPE: f64 = 10.0;

/// One drive.
#[derive(Debug, Clone)]
pub(crate) struct Drive {
    pub(crate) model: Model,
    profile: Arc<Profile>,
    words: BTreeMap<Place, u16>,
    /// Whether the keypad alone commands it.
    pub(crate) by_keypad: bool,
    pub(crate) is_tripped: bool,
    /// Whether it is told to run; in reverse where so.
    pub(crate) runs: Option<bool>,
    is_reverse: bool,
    /// How far it is on its way to a run: 0, 1, 2.
    ready: u8,
    /// The setpoint, in Hz.
    setpoint: f64,
    /// At `since` it turned at `hz`, negative in reverse.
    hz: f64,
    since: Instant,
}

/// What a write did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Took {
    Act(Act),
    /// A register, which it forgets.
    Setpoint,
    /// What it may keep.
    Parameter,
}

impl Drive {
    pub(crate) fn new(model: Model) -> Self {
        let profile = Profile::builtin(model.name()).unwrap();
        let place = |name: &str| profile.find(name).unwrap().place();
        let set = model.settings().iter().map(|&(name, word, _)| (name, word));
        let words = set.chain(model.constants().iter().copied()).filter_map(|(name, word)| Some((place(name)?, word)));
        let words = words.collect();
        Self {
            model,
            profile,
            words,
            by_keypad: false,
            is_tripped: false,
            runs: None,
            is_reverse: false,
            ready: 0,
            setpoint: 10.0,
            hz: 0.0,
            since: Instant::ZERO,
        }
    }

    /// It turns forward at its setpoint.
    pub(crate) fn turning(mut self) -> Self {
        (self.runs, self.ready, self.hz) = (Some(false), 2, self.setpoint);
        self
    }

    /// It tripped.
    pub(crate) fn trip(&mut self) {
        (self.is_tripped, self.runs, self.ready, self.hz) = (true, None, 0, 0.0);
    }

    /// The keypad commands it.
    pub(crate) fn at_keypad(mut self) -> Self {
        self.by_keypad = true;
        for &(name, word, _) in self.model.settings() {
            if let Some(place) = self.profile.find(name).unwrap().place() {
                self.words.insert(place, if word == 0 { 0 } else { word - 1 });
            }
        }
        self
    }

    /// At its output in Hz, negative in reverse.
    pub(crate) fn hz(&self, now: Instant) -> f64 {
        let target = match self.runs {
            None => 0.0,
            Some(is_reverse) => self.setpoint * if is_reverse { -1.0 } else { 1.0 },
        };
        let most = SLOPE * now.saturating_duration_since(self.since).as_secs_f64();
        self.hz + (target - self.hz).clamp(-most, most)
    }

    /// What it does now.
    pub(crate) fn turns(&self, now: Instant) -> Turns {
        let hz = self.hz(now);
        match self.runs {
            _ if self.is_tripped => Turns::Tripped,
            _ if hz > 0.0 => Turns::Forward,
            _ if hz < 0.0 => Turns::Reverse,
            Some(false) => Turns::Forward,
            Some(true) => Turns::Reverse,
            None => Turns::Stands,
        }
    }

    /// Whether nothing drives it any more: it stands, or comes down its ramp.
    pub(crate) const fn is_let_go(&self) -> bool {
        self.runs.is_none()
    }

    /// Whoever may, tells it to stop.
    pub(crate) fn stop(&mut self, now: Instant) {
        self.does(Act::Stop, now);
    }

    fn does(&mut self, act: Act, now: Instant) {
        (self.hz, self.since) = (self.hz(now), now);
        let wants_ready = match self.model {
            Atv312 => 2,
            Acs355 => 1,
            _ => 0,
        };
        match act {
            Act::Reset => self.is_tripped = false,
            _ if self.is_tripped || self.by_keypad => {}
            Act::Run(is_reverse) if self.ready >= wants_ready => {
                (self.runs, self.is_reverse) = (Some(is_reverse), is_reverse);
            }
            Act::Run(_) => {}
            Act::Stop => {
                let was_ready = self.ready;
                self.runs = None;
                self.ready = match self.model {
                    Atv312 => {
                        if was_ready >= 1 {
                            2
                        } else {
                            0
                        }
                    }
                    _ => 1,
                };
            }
            Act::Coast => (self.runs, self.ready, self.hz) = (None, 0, 0.0),
            Act::Ready => (self.runs, self.ready) = (None, 1),
        }
    }

    /// It takes what is written, or refuses by this exception.
    pub(crate) fn take(&mut self, place: Place, words: &[u16], now: Instant) -> Result<Vec<Took>, u8> {
        let mut took = Vec::new();
        for (address, &word) in (place.address..).zip(words) {
            let place = Place { address, ..place };
            took.push(self.take_word(place, word, now)?);
        }
        Ok(took)
    }

    fn take_word(&mut self, place: Place, word: u16, now: Instant) -> Result<Took, u8> {
        let (setpoint, counts) = self.model.setpoint();
        if self.model == Wj200 && place == Place::new(Table::Coil, 1) {
            self.is_reverse = word != 0;
            if self.runs.is_none() {
                return Ok(Took::Act(Act::Ready));
            }
            self.does(Act::Run(self.is_reverse), now);
            return Ok(Took::Act(Act::Run(self.is_reverse)));
        }
        if place == Place::from(setpoint) {
            (self.hz, self.since) = (self.hz(now), now);
            self.setpoint = f64::from(word) / counts;
            return Ok(Took::Setpoint);
        }
        if let Some(act) = self.model.act(place, word, self.is_reverse) {
            self.does(act, now);
            return Ok(Took::Act(act));
        }
        let stored = self.profile.stored_address(place).map_or(place, Place::from);
        if let Some(entry) = self.profile.written_entry_at(stored).filter(|_| place.table == Table::Holding) {
            return Ok(if entry.kind() == Kind::Parameter { Took::Parameter } else { Took::Setpoint });
        }
        Err(if place.table == Table::Holding { self.model.no_such() } else { 0x01 })
    }

    /// The words that it has there, or the exception by which it refuses.
    pub(crate) fn words(&self, place: Place, count: u16, now: Instant) -> Result<Vec<u16>, u8> {
        if self.model == Eds300 && count > 1 {
            return Err(0x06);
        }
        (place.address..).take(count.into()).map(|address| self.word(Place { address, ..place }, now)).collect()
    }

    fn word(&self, place: Place, now: Instant) -> Result<u16, u8> {
        let refuses = self.profile.signature().is_some_and(|known| known.refuses.contains(&place));
        let entry = self.profile.entry_at(place).filter(|entry| !refuses && entry.access() != Access::Wo);
        let Some(entry) = entry else { return Err(self.model.no_such()) };
        if let Some(&word) = self.words.get(&place) {
            return Ok(word);
        }
        let is = |role: &str| self.profile.role(role).is_some_and(|known| known.place() == Some(place));
        let counted = |hz: f64| {
            let scale = if self.model == Atv312 || self.model == Acs355 { 10.0 } else { 100.0 };
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 5000")]
            let counts = (hz.abs() * scale).round() as u16;
            counts
        };
        Ok(match () {
            () if is("state") => self.state(now),
            () if is("fault") => u16::from(self.is_tripped),
            () if is("frequency") => counted(self.hz(now)),
            () if is("setpoint") => counted(self.setpoint),
            // Where it takes its commands from: 2 is the bus, 0 the keypad.
            () if entry.name() == "status_word_2" => {
                self.channel() << if matches!(self.model, Gd350 | Gd20) { 5 } else { 0 }
            }
            () => 0,
        })
    }

    const fn channel(&self) -> u16 {
        if self.by_keypad { 0 } else { 2 }
    }

    fn state(&self, now: Instant) -> u16 {
        let turns = self.turns(now);
        match self.model {
            Gd350 | Gd20 | Eds300 => match turns {
                Turns::Forward => 1,
                Turns::Reverse => 2,
                Turns::Stands => 3,
                Turns::Tripped => 4,
            },
            // Bits 0, 1, 3: runs, in reverse, fault.
            Vfd500 => match turns {
                Turns::Forward => 1,
                Turns::Reverse => 3,
                Turns::Stands => 0,
                Turns::Tripped => 8,
            },
            Wj200 => match turns {
                Turns::Forward => 1,
                Turns::Reverse => 2,
                Turns::Stands | Turns::Tripped => 0,
            },
            // Bits 1-0: 3 runs, 1 stops; bit 3 in reverse; bit 10 where the bus commands it.
            Ms300 => {
                let runs = match turns {
                    Turns::Stands | Turns::Tripped => 0,
                    _ if self.runs.is_none() => 1,
                    _ => 3,
                };
                runs | u16::from(turns == Turns::Reverse) << 3 | u16::from(!self.by_keypad) << 10
            }
            // 40H switch on disabled, 21H ready, 23H switched on, 27H operation enabled; 08H is a fault, bit 15 reverse.
            Atv312 => match (turns, self.runs, self.ready) {
                (Turns::Tripped, ..) => 0x08,
                (_, Some(is_reverse), _) => 0x27 | u16::from(is_reverse) << 15,
                (_, None, 0) => 0x40,
                (_, None, 1) => 0x21,
                (_, None, _) => 0x23,
            },
            // Bits 0, 2, 3: ready, operation enabled, tripped.
            Acs355 => match (turns, self.runs) {
                (Turns::Tripped, _) => 0x08,
                (_, Some(_)) => 0x07,
                (_, None) => u16::from(self.ready > 0),
            },
        }
    }

    /// Whether its output frequency is there.
    pub(crate) fn tells_frequency_at(&self, place: Place) -> bool {
        self.profile.role("frequency").and_then(Entry::place) == Some(place)
    }

    /// Whether what is read there has the word of its state.
    pub(crate) fn tells_state_at(&self, place: Place, count: u16) -> bool {
        let state = self.profile.role("state").and_then(Entry::place);
        state.is_some_and(|state| {
            state.table == place.table && (place.address..).take(count.into()).any(|address| address == state.address)
        })
    }
}

/// Time that a request takes.
pub(crate) const TAKES: Duration = Duration::from_millis(50);
