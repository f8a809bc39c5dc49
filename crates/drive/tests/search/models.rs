//! What each drive does by which word, as its maker prints it. Where the words stand that it shows, its profile says; what they
//! do is written here once more, so that the profile is not its own judge.

use drivebus_drives::{Place, Table};

use self::Model::{Acs355, Atv312, Eds300, Gd20, Gd350, Ms300, Vfd500, Wj200};

/// Which drive it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Model {
    /// Commands and setpoint stand side by side.
    Gd350,
    /// The same, but no document of it proves what its state means.
    Gd20,
    /// What 5 and 6 do is the other way round.
    Vfd500,
    /// The way in which it turns is a word before the command, and both are coils.
    Wj200,
    /// It is started by three words, and its state says that it rests while it slows down.
    Atv312,
    /// It is started by two words; the rest as with the one before.
    Acs355,
    /// Its words stand where those of a GD350 do, and mean other things.
    Ms300,
    /// So do these, and what resets a GD350 runs it.
    Eds300,
}

/// What a word does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Act {
    /// It runs: in reverse where so.
    Run(bool),
    Stop,
    Coast,
    Reset,
    /// It makes it ready to run.
    Ready,
}

impl Model {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Gd350 => "gd350",
            Gd20 => "gd20",
            Vfd500 => "vfd500",
            Wj200 => "wj200",
            Atv312 => "atv312",
            Acs355 => "acs355",
            Ms300 => "ms300",
            Eds300 => "eds300",
        }
    }

    /// Where what it is told goes, and what that does; `is_reverse` is the way in which it was told to turn last.
    pub(crate) fn act(self, place: Place, word: u16, is_reverse: bool) -> Option<Act> {
        let at = |address: u16| place == Place::from(address);
        let coil = |address: u16| place == Place::new(Table::Coil, address);
        match self {
            // GD350 manual, section 9.4.5; GD20 manual, the same chapter.
            Gd350 | Gd20 if at(0x2000) => Some(match word {
                1 | 3 => Act::Run(false),
                2 | 4 => Act::Run(true),
                5 | 8 => Act::Stop,
                6 => Act::Coast,
                7 => Act::Reset,
                _ => return None,
            }),
            // VFD500 manual, p. 135.
            Vfd500 if at(0x7000) => Some(match word {
                1 | 3 => Act::Run(false),
                2 | 4 => Act::Run(true),
                5 => Act::Coast,
                6 => Act::Stop,
                8 => Act::Reset,
                _ => return None,
            }),
            // EDS300 manual, p. 44.
            Eds300 if at(0x2000) => Some(match word {
                1 | 5 => Act::Run(is_reverse),
                3 | 7 => Act::Run(false),
                4 | 8 => Act::Run(true),
                2 | 6 | 10 => Act::Stop,
                9 => Act::Reset,
                _ => return None,
            }),
            // CP2000 manual, p. 514: bits 1-0, and the way in bits 5-4. MS300 manual, p. 798: the reset.
            Ms300 if at(0x2000) => Some(match (word & 3, word >> 4 & 3) {
                (0, _) => return None,
                (1, _) => Act::Stop,
                (_, 1) => Act::Run(false),
                (_, 2) => Act::Run(true),
                (_, 3) => Act::Run(!is_reverse),
                _ => Act::Run(is_reverse),
            }),
            Ms300 if at(0x2002) => (word & 2 != 0).then_some(Act::Reset),
            // WJ200 manual, p. 353. The way is another coil: see `Drive::take`.
            Wj200 if coil(0) => Some(if word != 0 { Act::Run(is_reverse) } else { Act::Stop }),
            Wj200 if coil(3) => (word != 0).then_some(Act::Reset),
            // Altivar 312 manual, pp. 10 and 12.
            Atv312 if at(0x2135) => Some(match word {
                word if word & 0x80 != 0 => Act::Reset,
                word if word & 0x0F == 0x0F => Act::Run(word & 0x800 != 0),
                word if word & 0x07 == 0x07 => Act::Stop,
                word if word & 0x07 == 0x06 => Act::Ready,
                _ => Act::Coast,
            }),
            // ACS355 manual, p. 319.
            Acs355 if at(0x0000) => Some(match word {
                word if word & 0x80 != 0 => Act::Reset,
                word if word & 0x02 == 0 => Act::Coast,
                word if word & 0x09 == 0x09 => Act::Run(false),
                word if word & 0x09 == 0x08 => Act::Stop,
                _ => Act::Ready,
            }),
            _ => None,
        }
    }

    /// Where it takes its frequency, and counts of a hertz there.
    pub(crate) const fn setpoint(self) -> (u16, f64) {
        match self {
            Gd350 | Gd20 | Eds300 | Ms300 => (0x2001, 100.0),
            Vfd500 => (0x7001, 100.0),
            Wj200 => (0x0001, 100.0),
            Atv312 => (0x2136, 10.0),
            Acs355 => (0x0001, 400.0),
        }
    }

    /// Whether it takes its frequency there.
    pub(crate) fn takes_setpoint_at(self, place: Place) -> bool {
        place == Place::from(self.setpoint().0)
    }

    /// What is set in it so that it obeys the bus: each parameter with its word, and whether that is for its speed alone.
    pub(crate) const fn settings(self) -> &'static [(&'static str, u16, bool)] {
        match self {
            Gd350 => &[("P00.01", 2, false), ("P00.02", 0, false), ("P00.06", 8, true)],
            Gd20 => &[("P00.01", 2, false), ("P00.06", 8, true)],
            Vfd500 => &[("P00.02", 2, false)],
            Atv312 => &[("LAC", 2, false), ("Fr1", 164, false)],
            Acs355 => &[("1001", 10, false), ("1103", 8, true)],
            Ms300 => &[("00-21", 2, false), ("00-20", 1, true)],
            Wj200 | Eds300 => &[],
        }
    }

    /// Other words that do not change.
    pub(crate) const fn constants(self) -> &'static [(&'static str, u16)] {
        match self {
            // 50 Hz is its highest frequency, and its ramp takes 5 s for that.
            Gd350 => &[("identification_code", 0x01A0), ("P00.03", 5000), ("P00.12", 50)],
            Gd20 => &[("identification_code", 0x0106), ("P00.03", 5000), ("P00.12", 50)],
            Vfd500 => &[("P30.14", 1)],
            Atv312 => &[("HSP", 500)],
            Acs355 => &[("1105", 500)],
            Wj200 | Ms300 | Eds300 => &[],
        }
    }

    /// Whether it may say by 05H that it is at it, as the specification has it. The others have that code for something else.
    pub(crate) const fn acknowledges(self) -> bool {
        matches!(self, Wj200 | Atv312 | Acs355 | Ms300)
    }

    /// By which exception it says that it has no such address.
    pub(crate) const fn no_such(self) -> u8 {
        if matches!(self, Eds300) { 0x03 } else { 0x02 }
    }
}
