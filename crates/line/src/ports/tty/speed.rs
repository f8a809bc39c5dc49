//! Whether a driver makes the speed it was asked for: it has a clock to divide, and takes what comes nearest.
//!
//! Linux tells what a driver made of it where the driver tells Linux (`termios2`); many only repeat what they were asked.

use serial2::SerialPort;

/// How far the two ends of a line may be apart, in thousandths: of ten bits, the last is sampled in its middle, half a bit
/// from its edge. That is 5 % for both ends and the distortion of the line together.
const REFUSED: u32 = 25;

/// From here on a person should know, in thousandths.
const NOTED: u32 = 10;

/// The speed that the driver is at, if it can be told.
pub(super) fn made(port: &SerialPort) -> Option<u32> {
    port.get_configuration().ok()?.get_baud_rate().ok()
}

/// What to know about a speed that is not quite what was asked for.
pub(super) fn note(asked: u32, made: u32) -> Option<String> {
    let is_off = thousandths(asked, made) >= NOTED;
    is_off.then(|| format!("the driver makes {made} bit/s, {:.1} % off the {asked} asked for", percent(asked, made)))
}

/// Why a speed is refused, if that is for being too far off.
pub(super) fn refusal(asked: u32, made: u32) -> Option<String> {
    let is_off = thousandths(asked, made) > REFUSED;
    is_off.then(|| {
        format!(
            "the driver does not make {asked} bit/s; the nearest it would take is {made} ({:.1} % off, where units stand \
             2.5 %): set the units to a speed that it makes, or use another adapter",
            percent(asked, made)
        )
    })
}

fn thousandths(asked: u32, made: u32) -> u32 {
    let off = u64::from(asked.abs_diff(made)) * 1_000;
    u32::try_from(off / u64::from(asked.max(1))).unwrap_or(u32::MAX)
}

fn percent(asked: u32, made: u32) -> f64 {
    (f64::from(made) - f64::from(asked)) / f64::from(asked.max(1)) * 100.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_noted_from_one_percent_and_refused_above_two_and_a_half() {
        // 3 MHz over 26 is 115 384: the usual error of an FTDI chip at 115 200, and nobody's trouble.
        assert_eq!((note(115_200, 115_384), refusal(115_200, 115_384)), (None, None));
        let told = note(19_200, 19_500).unwrap();
        assert!(told.contains("19500") && told.contains("1.6 %"), "{told}");
        assert_eq!(refusal(19_200, 19_500), None);
        for made in [9_600, 18_600, 19_800, 38_400] {
            let told = refusal(19_200, made).unwrap();
            assert!(told.contains(&made.to_string()) && told.contains("19200"), "{told}");
        }
        assert!(refusal(250_000, 230_400).unwrap().contains("-7.8 %"));
    }
}
