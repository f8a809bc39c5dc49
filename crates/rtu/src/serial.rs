//! How characters look on the wire and how long they take: character time, t1.5, t3.5.
//!
//! All integers, in nanoseconds, rounded once and up: a silence that is a fraction too long costs nothing, one that
//! is too short joins two frames.

use core::fmt;
use core::time::Duration;

const NANOS_PER_SECOND: u64 = 1_000_000_000;
/// Above this speed the specification fixes the times, so that they do not overrun the receiver's interrupts.
const FIXED_TIMES_ABOVE: u32 = 19_200;

/// Data bits of a character.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum DataBits {
    /// Seven, as ASCII mode uses. RTU needs eight; some adapters are opened with seven by mistake.
    Seven,
    /// Eight.
    Eight,
}

/// The parity bit of a character.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Parity {
    /// No parity bit.
    None,
    /// Even number of ones.
    Even,
    /// Odd number of ones.
    Odd,
}

/// Stop bits of a character.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum StopBits {
    /// One.
    One,
    /// Two.
    Two,
}

/// How long the line must be silent between two frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Silence {
    /// 3.5 characters; 1.750 ms above 19 200 bit/s.
    #[default]
    Spec,
    /// 3.5 characters at every speed, which is all that many drives ask for.
    Characters,
    /// A fixed time, for a unit that needs longer.
    Fixed(Duration),
}

/// Speed and shape of the characters, and the silence between frames.
///
/// ```
/// use drivebus_rtu::{DataBits, Duration, Parity, SerialFormat, Silence, StopBits};
///
/// let format = SerialFormat::new(19_200, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec)?;
/// assert_eq!(format.bits_per_char(), 11);
/// assert_eq!(format.t35(), Duration::from_nanos(2_005_209)); // 3.5 × 11 bits at 19 200 bit/s, rounded up
/// # Ok::<(), drivebus_rtu::SerialFormatError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct SerialFormat {
    baud_rate: u32,
    data_bits: DataBits,
    parity: Parity,
    stop_bits: StopBits,
    silence: Silence,
}

impl SerialFormat {
    /// Slowest line this crate computes with, in bit/s.
    pub const MIN_BAUD_RATE: u32 = 50;
    /// Fastest line this crate computes with, in bit/s.
    pub const MAX_BAUD_RATE: u32 = 10_000_000;
    /// Longest fixed silence.
    pub const MAX_SILENCE: Duration = Duration::from_secs(1);

    /// 19 200 bit/s, 8E1, silence by the specification: the default of Modbus, and of the INVT families.
    pub const DEFAULT: Self = Self {
        baud_rate: 19_200,
        data_bits: DataBits::Eight,
        parity: Parity::Even,
        stop_bits: StopBits::One,
        silence: Silence::Spec,
    };

    /// Checks and keeps the settings.
    ///
    /// # Errors
    ///
    /// [`SerialFormatError`]: the speed is outside 50..=10 000 000 bit/s, or the fixed silence above one second.
    pub const fn new(
        baud_rate: u32,
        data_bits: DataBits,
        parity: Parity,
        stop_bits: StopBits,
        silence: Silence,
    ) -> Result<Self, SerialFormatError> {
        if baud_rate < Self::MIN_BAUD_RATE || baud_rate > Self::MAX_BAUD_RATE {
            return Err(SerialFormatError::BaudRate { baud_rate });
        }
        if let Silence::Fixed(silence) = silence
            && silence.as_nanos() > Self::MAX_SILENCE.as_nanos()
        {
            return Err(SerialFormatError::Silence { silence });
        }
        Ok(Self { baud_rate, data_bits, parity, stop_bits, silence })
    }

    /// Bits per second.
    pub const fn baud_rate(&self) -> u32 {
        self.baud_rate
    }

    /// Data bits of a character.
    pub const fn data_bits(&self) -> DataBits {
        self.data_bits
    }

    /// The parity bit of a character.
    pub const fn parity(&self) -> Parity {
        self.parity
    }

    /// Stop bits of a character.
    pub const fn stop_bits(&self) -> StopBits {
        self.stop_bits
    }

    /// The rule for the silence between frames.
    pub const fn silence(&self) -> Silence {
        self.silence
    }

    /// Bits of a character on the wire: start, data, parity and stop bits; 9 to 12.
    pub const fn bits_per_char(&self) -> u32 {
        let data = match self.data_bits {
            DataBits::Seven => 7,
            DataBits::Eight => 8,
        };
        let parity = match self.parity {
            Parity::None => 0,
            Parity::Even | Parity::Odd => 1,
        };
        let stop = match self.stop_bits {
            StopBits::One => 1,
            StopBits::Two => 2,
        };
        1 + data + parity + stop
    }

    /// How long `count` characters take without a gap, rounded up to a whole nanosecond; of more than 768 million at least
    /// what those take.
    pub const fn chars(&self, count: u32) -> Duration {
        self.half_chars(count as u64 * 2)
    }

    /// How long one character takes, rounded up to a whole nanosecond.
    pub const fn char_time(&self) -> Duration {
        self.chars(1)
    }

    /// The longest gap allowed inside a frame.
    ///
    /// | line speed      | t1.5                                          |
    /// | --------------- | --------------------------------------------- |
    /// | ≤ 19 200 bit/s  | 1.5 characters, rounded up to a whole ns      |
    /// | > 19 200 bit/s  | 0.750 ms; 1.5 characters with [`Silence::Characters`] |
    ///
    /// Source: *Modbus over Serial Line* V1.02, §2.5.1.1.
    pub const fn t15(&self) -> Duration {
        match self.silence {
            Silence::Spec | Silence::Fixed(_) if self.baud_rate > FIXED_TIMES_ABOVE => Duration::from_micros(750),
            _ => self.half_chars(3),
        }
    }

    /// The shortest silence allowed between frames.
    ///
    /// | line speed      | t3.5                                                          |
    /// | --------------- | ------------------------------------------------------------- |
    /// | ≤ 19 200 bit/s  | 3.5 characters, rounded up to a whole ns                      |
    /// | > 19 200 bit/s  | 1.750 ms; 3.5 characters with [`Silence::Characters`]         |
    /// | any             | the fixed time with [`Silence::Fixed`]                        |
    ///
    /// Source: *Modbus over Serial Line* V1.02, §2.5.1.1.
    pub const fn t35(&self) -> Duration {
        match self.silence {
            Silence::Fixed(silence) => silence,
            Silence::Spec if self.baud_rate > FIXED_TIMES_ABOVE => Duration::from_micros(1_750),
            Silence::Spec | Silence::Characters => self.half_chars(7),
        }
    }

    const fn half_chars(&self, count: u64) -> Duration {
        let bits = count * self.bits_per_char() as u64;
        Duration::from_nanos(bits.saturating_mul(NANOS_PER_SECOND).div_ceil(2 * self.baud_rate as u64))
    }
}

impl Default for SerialFormat {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl fmt::Display for SerialFormat {
    /// As people write it: `19200 8E1`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let data = match self.data_bits {
            DataBits::Seven => 7,
            DataBits::Eight => 8,
        };
        let parity = match self.parity {
            Parity::None => 'N',
            Parity::Even => 'E',
            Parity::Odd => 'O',
        };
        let stop = match self.stop_bits {
            StopBits::One => 1,
            StopBits::Two => 2,
        };
        write!(f, "{} {data}{parity}{stop}", self.baud_rate)
    }
}

/// Settings that no line can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SerialFormatError {
    /// The speed is out of range.
    BaudRate {
        /// What was given, in bit/s.
        baud_rate: u32,
    },
    /// The fixed silence is too long.
    Silence {
        /// What was given.
        silence: Duration,
    },
}

impl fmt::Display for SerialFormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BaudRate { baud_rate } => write!(
                f,
                "baud rate {baud_rate} is not a number from {} to {} bit/s",
                SerialFormat::MIN_BAUD_RATE,
                SerialFormat::MAX_BAUD_RATE
            ),
            Self::Silence { silence } => {
                write!(f, "silence {silence:?} is longer than {:?}", SerialFormat::MAX_SILENCE)
            }
        }
    }
}

impl core::error::Error for SerialFormatError {}

#[cfg(test)]
mod tests {
    use super::*;

    fn format(baud_rate: u32, parity: Parity, silence: Silence) -> SerialFormat {
        SerialFormat::new(baud_rate, DataBits::Eight, parity, StopBits::One, silence).unwrap()
    }

    #[test]
    fn times_by_hand() {
        #[rustfmt::skip]
        let table = [
            // bit/s, parity, rule, character, t1.5, t3.5 in ns; computed by hand: n × bits / speed, rounded up
            (1_200,   Parity::Even, Silence::Spec,       9_166_667, 13_750_000, 32_083_334),
            (9_600,   Parity::None, Silence::Spec,       1_041_667,  1_562_500,  3_645_834),
            (9_600,   Parity::Even, Silence::Spec,       1_145_834,  1_718_750,  4_010_417),
            (19_200,  Parity::Even, Silence::Spec,         572_917,    859_375,  2_005_209),
            (19_201,  Parity::Even, Silence::Spec,         572_887,    750_000,  1_750_000),
            (115_200, Parity::Even, Silence::Spec,          95_487,    750_000,  1_750_000),
            (115_200, Parity::Even, Silence::Characters,    95_487,    143_230,    334_202),
            (19_200,  Parity::Odd,  Silence::Characters,   572_917,    859_375,  2_005_209),
            (9_600,   Parity::Odd,  Silence::Fixed(Duration::from_millis(7)), 1_145_834, 1_718_750, 7_000_000),
        ];
        for (baud_rate, parity, silence, char_time, t15, t35) in table {
            let format = format(baud_rate, parity, silence);
            assert_eq!(format.char_time(), Duration::from_nanos(char_time), "{format} {silence:?}");
            assert_eq!(format.t15(), Duration::from_nanos(t15), "{format} {silence:?}");
            assert_eq!(format.t35(), Duration::from_nanos(t35), "{format} {silence:?}");
        }
    }

    #[test]
    fn many_characters_are_rounded_once() {
        // 256 × 11 bits / 115 200 bit/s = 24.444444… ms
        assert_eq!(format(115_200, Parity::Even, Silence::Spec).chars(256), Duration::from_nanos(24_444_445));
    }

    #[test]
    fn no_count_of_characters_overflows() {
        let longest = SerialFormat::new(50, DataBits::Eight, Parity::Odd, StopBits::Two, Silence::Spec).unwrap();
        assert_eq!(longest.chars(768_000_000), Duration::from_secs(184_320_000)); // × 12 bits / 50 bit/s
        assert!(longest.chars(u32::MAX) >= longest.chars(768_000_000));
    }

    #[test]
    fn every_shape_of_a_character_has_its_bits() {
        use {DataBits::*, StopBits::*};
        for (data, parity, stop, bits) in [
            (Seven, Parity::None, One, 9),
            (Eight, Parity::None, One, 10),
            (Eight, Parity::Even, One, 11),
            (Eight, Parity::None, Two, 11),
            (Eight, Parity::Odd, Two, 12),
        ] {
            let format = SerialFormat::new(9_600, data, parity, stop, Silence::Spec).unwrap();
            assert_eq!(format.bits_per_char(), bits);
        }
    }

    #[test]
    fn impossible_settings_are_refused() {
        for baud_rate in [0, 49, 10_000_001] {
            assert_eq!(
                SerialFormat::new(baud_rate, DataBits::Eight, Parity::None, StopBits::One, Silence::Spec),
                Err(SerialFormatError::BaudRate { baud_rate })
            );
        }
        let silence = Duration::from_millis(1_001);
        assert_eq!(
            SerialFormat::new(9_600, DataBits::Eight, Parity::None, StopBits::One, Silence::Fixed(silence)),
            Err(SerialFormatError::Silence { silence })
        );
    }
}
