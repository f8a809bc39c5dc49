//! What an exception means: whether it is a decision, and whether the request was carried out.
//!
//! The specification says it of its own codes. Families of drives use some of them otherwise; who knows the family says so
//! by [`Meanings`].

use crate::ExceptionCode;

/// What a unit says by an exception.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Meaning {
    /// There is no such function, address, count or value: a decision, and the next answer will be the same.
    NoSuch,
    /// It is not allowed or not possible now: a decision that another state of the unit may change.
    NotNow,
    /// The unit is busy, or the request reached it damaged: it was not carried out, and may be the next time.
    AskAgain,
    /// The unit took the request and is still at it.
    Taken,
}

impl Meaning {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::NoSuch, Self::NotNow, Self::AskAgain, Self::Taken];

    /// As programs write it: `no_such`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoSuch => "no_such",
            Self::NotNow => "not_now",
            Self::AskAgain => "ask_again",
            Self::Taken => "taken",
        }
    }

    /// Whether the unit has decided that it does not do it.
    pub const fn is_decision(self) -> bool {
        matches!(self, Self::NoSuch | Self::NotNow)
    }
}

impl ExceptionCode {
    /// What the code means by the specification; a family of drives may mean something else by it.
    ///
    /// | code | meaning |
    /// | --- | --- |
    /// | 01H, 02H, 03H | there is no such function, address or value |
    /// | 05H | taken, and still at work |
    /// | 06H | busy: ask again |
    /// | 0AH, 0BH | a gateway did not reach the unit: ask again |
    /// | 04H, 08H, and those that it does not know | not now |
    ///
    /// Source: *Modbus Application Protocol* V1.1b3, §7.
    pub const fn meaning(self) -> Meaning {
        match self.0 {
            0x01..=0x03 => Meaning::NoSuch,
            0x05 => Meaning::Taken,
            0x06 | 0x0A | 0x0B => Meaning::AskAgain,
            _ => Meaning::NotNow,
        }
    }
}

/// How many words hold two bits for each of 256 codes.
const WORDS: usize = 8;

/// What each exception of one unit means: that of the specification, where nothing else is said.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Meanings([u64; WORDS]);

impl Meanings {
    /// Those of the specification.
    pub const STANDARD: Self = {
        let mut meanings = Self([0; WORDS]);
        let mut code = 0_u16;
        while code <= 0xFF {
            #[expect(clippy::cast_possible_truncation, reason = "at most FFH")]
            let of = ExceptionCode(code as u8);
            meanings = meanings.with(of, of.meaning());
            code += 1;
        }
        meanings
    };

    /// The same, but that `code` means this.
    #[must_use]
    pub const fn with(mut self, code: ExceptionCode, meaning: Meaning) -> Self {
        let (word, shift) = place(code);
        let bits = match meaning {
            Meaning::NoSuch => 0,
            Meaning::NotNow => 1,
            Meaning::AskAgain => 2,
            Meaning::Taken => 3,
        };
        self.0[word] = self.0[word] & !(0b11 << shift) | bits << shift;
        self
    }

    /// What `code` means.
    pub const fn of(&self, code: ExceptionCode) -> Meaning {
        let (word, shift) = place(code);
        match self.0[word] >> shift & 0b11 {
            0 => Meaning::NoSuch,
            1 => Meaning::NotNow,
            2 => Meaning::AskAgain,
            _ => Meaning::Taken,
        }
    }
}

impl Default for Meanings {
    fn default() -> Self {
        Self::STANDARD
    }
}

/// Which word has the bits of `code`, and where in it they begin.
const fn place(code: ExceptionCode) -> (usize, u32) {
    ((code.0 / 32) as usize, 2 * (code.0 % 32) as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_said_of_one_code_holds_for_that_one_alone() {
        for code in 0..=0xFF {
            assert_eq!(Meanings::STANDARD.of(ExceptionCode(code)), ExceptionCode(code).meaning(), "{code:02X}H");
            for meaning in Meaning::ALL {
                let meanings = Meanings::STANDARD.with(ExceptionCode(code), meaning);
                let others = (0..=0xFF).filter(|&other| other != code).map(ExceptionCode);
                assert_eq!(meanings.of(ExceptionCode(code)), meaning);
                assert!(others.into_iter().all(|other| meanings.of(other) == other.meaning()));
            }
        }
    }

    /// *Modbus Application Protocol* V1.1b3, §7: acknowledge, server device busy, the gateway's two.
    #[test]
    fn the_specification_has_one_that_takes_and_three_that_pass() {
        let of = |meaning| (0..=0xFF).filter(move |&code| ExceptionCode(code).meaning() == meaning);
        assert!(of(Meaning::NoSuch).eq([0x01, 0x02, 0x03]));
        assert!(of(Meaning::Taken).eq([0x05]));
        assert!(of(Meaning::AskAgain).eq([0x06, 0x0A, 0x0B]));
    }
}
