//! The kinds of faults, and what each of them is on a wire.

use std::fmt;
use std::str::FromStr;

use crate::error::SimError;

/// What can go wrong with one answer, or on the way to it.
///
/// Each kind has a rate, drawn for every request that reaches a unit, and they may meet in one answer. A fault is a
/// fact of the wire: drives never know. Broadcasts are not answered and not spoilt. (An adapter that echoes does so
/// always or never: [`set_echo`](crate::SimulatedLine::set_echo).)
///
/// What is damaged never has a right CRC by chance, because nobody could tell it from an answer then; the fault is drawn
/// again. On a real line one damage in 65 536 has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum FaultKind {
    /// One bit of the answer arrives turned over.
    FlipBit,
    /// One character of the answer does not arrive; those after it come in its time.
    LoseByte,
    /// One character of the answer arrives twice.
    DoubleByte,
    /// 1 to 8 characters right before the answer: 00H, FFH or anything.
    NoiseBefore,
    /// 1 to 8 characters right after the answer: 00H, FFH or anything.
    NoiseAfter,
    /// 1 to 3 characters somewhere between the first and the last of the answer: 00H, FFH or anything.
    NoiseInside,
    /// The answer comes up to 50 ms later, or what was set: still within a usual time-out.
    Delay,
    /// The answer comes 0.6 s to 1.2 s later, or what was set: after the time-out, perhaps during a later request. The
    /// unit answers in the order it was asked, so it holds back those after it.
    Late,
    /// The answer is held back for 0.6 s to 2.4 s, or what was set, and later answers of the same unit pass it, as behind a
    /// gateway that serves several requests at a time. It comes after those that were due before it all the same.
    Overtaken,
    /// The unit has done what it was asked, and its answer is lost.
    Silence,
    /// The request is lost or spoilt on the way: the unit does nothing and says nothing.
    Deaf,
    /// The answer comes in two to four pieces with 16 ms between them, as adapters hand it over.
    Split,
    /// A whole good frame of another unit, of the same function and length, then the silence, then the answer. No unit that
    /// has answered on the line has its address: nobody could tell such a frame from its answer.
    Foreign,
    /// A whole good frame of this unit for another function (04H for 03H), with other data: half of them before the answer,
    /// with the silence between, half of them instead of it.
    WrongFunction,
    /// Instead of the answer a frame with good CRC that carries fewer words than asked for; of a write's answer only the
    /// address, of a refusal no code. The right answer never comes.
    Short,
    /// Instead of the answer a frame with good CRC that carries 1 to 4 words more. The right answer never comes.
    Long,
    /// Another one talks over the answer: two or more characters in a row arrive as neither sent them.
    Collision,
    /// The adapter is pulled out after the request has left: the unit does what it was asked, nobody hears the answer,
    /// and the port is gone for half a second, or what was set. By rate or script only where the line is used in
    /// process.
    Unplug,
}

impl FaultKind {
    /// All of them.
    pub const ALL: [Self; 18] = [
        Self::FlipBit,
        Self::LoseByte,
        Self::DoubleByte,
        Self::NoiseBefore,
        Self::NoiseAfter,
        Self::NoiseInside,
        Self::Delay,
        Self::Late,
        Self::Overtaken,
        Self::Silence,
        Self::Deaf,
        Self::Split,
        Self::Foreign,
        Self::WrongFunction,
        Self::Short,
        Self::Long,
        Self::Collision,
        Self::Unplug,
    ];

    /// As people write it: `flip_bit`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FlipBit => "flip_bit",
            Self::LoseByte => "lose_byte",
            Self::DoubleByte => "double_byte",
            Self::NoiseBefore => "noise_before",
            Self::NoiseAfter => "noise_after",
            Self::NoiseInside => "noise_inside",
            Self::Delay => "delay",
            Self::Late => "late",
            Self::Overtaken => "overtaken",
            Self::Silence => "silence",
            Self::Deaf => "deaf",
            Self::Split => "split",
            Self::Foreign => "foreign",
            Self::WrongFunction => "wrong_function",
            Self::Short => "short",
            Self::Long => "long",
            Self::Collision => "collision",
            Self::Unplug => "unplug",
        }
    }

    /// Its place in [`ALL`](Self::ALL).
    pub(crate) const fn index(self) -> usize {
        self as usize
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FaultKind {
    type Err = SimError;

    fn from_str(name: &str) -> Result<Self, SimError> {
        let named = Self::ALL.into_iter().find(|kind| kind.name() == name);
        named.ok_or_else(|| SimError::Fault { name: name.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_stands_in_its_place_and_is_found_by_its_name() {
        for (place, kind) in FaultKind::ALL.into_iter().enumerate() {
            assert_eq!(kind.index(), place, "{kind}");
            assert_eq!(kind.name().parse::<FaultKind>().unwrap(), kind);
        }
        let unknown = "flipbit".parse::<FaultKind>().unwrap_err().to_string();
        assert!(unknown.starts_with("fault \"flipbit\" is unknown; there are flip_bit, "), "{unknown}");
    }
}
