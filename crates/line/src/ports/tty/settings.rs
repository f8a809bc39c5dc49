//! The settings of an open port, which any program that may open it can change: root can, and so can a container that has
//! the device.
//!
//! They are held to what the driver showed when the port was opened, not to what it was asked for then: what it never took,
//! such as the parity of a pseudo-terminal, nobody changed.

use rustix::termios::{
    ControlModes, InputModes, LocalModes, OptionalActions, OutputModes, SpecialCodeIndex, Termios, tcgetattr, tcsetattr,
};
use serial2::SerialPort;

use crate::ports::set_again::SetAgain;

/// What makes a difference to the bytes that come and go, and what people call it.
const INPUT: [(InputModes, &str); 11] = [
    (InputModes::IGNBRK, "IGNBRK"),
    (InputModes::BRKINT, "BRKINT"),
    (InputModes::IGNPAR, "IGNPAR"),
    (InputModes::PARMRK, "PARMRK"),
    (InputModes::INPCK, "INPCK"),
    (InputModes::ISTRIP, "ISTRIP"),
    (InputModes::INLCR, "INLCR"),
    (InputModes::IGNCR, "IGNCR"),
    (InputModes::ICRNL, "ICRNL"),
    (InputModes::IXON, "IXON"),
    (InputModes::IXOFF, "IXOFF"),
];
/// Without it none of the others has an effect.
const OUTPUT: [(OutputModes, &str); 1] = [(OutputModes::OPOST, "OPOST")];
const LOCAL: [(LocalModes, &str); 5] = [
    (LocalModes::ISIG, "ISIG"),
    (LocalModes::ICANON, "ICANON"),
    (LocalModes::ECHO, "ECHO"),
    (LocalModes::ECHONL, "ECHONL"),
    (LocalModes::IEXTEN, "IEXTEN"),
];
const CONTROL: [(ControlModes, &str); 3] =
    [(ControlModes::CREAD, "CREAD"), (ControlModes::CLOCAL, "CLOCAL"), (ControlModes::CRTSCTS, "CRTSCTS")];
const CODES: [(SpecialCodeIndex, &str); 2] = [(SpecialCodeIndex::VMIN, "VMIN"), (SpecialCodeIndex::VTIME, "VTIME")];

/// The settings as they were when the port was opened.
#[derive(Debug)]
pub(super) struct Settings {
    opened: Termios,
    again: SetAgain,
}

impl Settings {
    /// Those that `port` has now; `None` where the system does not tell.
    pub(super) fn of(port: &SerialPort) -> Option<Self> {
        Some(Self { opened: tcgetattr(port).ok()?, again: SetAgain::default() })
    }

    /// Sets again on `port` what is not as it was when it was opened. In words what that was, where it is news.
    pub(super) fn set_again(&mut self, port: &SerialPort) -> Option<String> {
        let changed = differences(&self.opened, &tcgetattr(port).ok()?);
        if changed.is_empty() {
            self.again.all_is_well();
            return None;
        }
        // What it has taken of it, the driver shows, not what it says.
        let _ = tcsetattr(port, OptionalActions::Now, &self.opened);
        let left = tcgetattr(port).map_or_else(|_| changed.clone(), |found| differences(&self.opened, &found));
        self.again.tried(&changed, &left)
    }

    /// How often that was, for people.
    pub(super) fn note(&self) -> Option<String> {
        self.again.note()
    }
}

/// What `found` has otherwise than `opened`, in words.
fn differences(opened: &Termios, found: &Termios) -> Vec<String> {
    let mut told = Vec::new();
    let instead = |what: &str, of: String, is: String| (of != is).then(|| format!("{what}{is} instead of {of}"));
    // A driver that is told one speed keeps the other as it was; few have two.
    let speed = |of: fn(&Termios) -> u32, what| instead(what, of(opened).to_string(), format!("{} bit/s", of(found)));
    if opened.output_speed() != found.output_speed() {
        told.extend(speed(Termios::output_speed, ""));
    } else if opened.input_speed() != found.input_speed() {
        told.extend(speed(Termios::input_speed, "receives at "));
    }
    let modes = (opened.control_modes, found.control_modes);
    told.extend(instead("parity ", parity(modes.0).to_owned(), parity(modes.1).to_owned()));
    told.extend(instead("", data_bits(modes.0).to_owned(), data_bits(modes.1).to_owned()));
    told.extend(instead("", stop_bits(modes.0).to_owned(), stop_bits(modes.1).to_owned()));
    told.extend(switched(&INPUT, |flag| opened.input_modes.contains(flag), |flag| found.input_modes.contains(flag)));
    told.extend(switched(&OUTPUT, |flag| opened.output_modes.contains(flag), |flag| found.output_modes.contains(flag)));
    told.extend(switched(&CONTROL, |flag| modes.0.contains(flag), |flag| modes.1.contains(flag)));
    told.extend(switched(&LOCAL, |flag| opened.local_modes.contains(flag), |flag| found.local_modes.contains(flag)));
    for (index, name) in CODES {
        let code = |settings: &Termios| settings.special_codes[index].to_string();
        told.extend(instead(&format!("{name} "), code(opened), code(found)));
    }
    told
}

/// Those of `flags` that are not `now` as they were `then`.
fn switched<F: Copy>(flags: &[(F, &str)], then: impl Fn(F) -> bool, now: impl Fn(F) -> bool) -> Vec<String> {
    let changed = flags.iter().filter(|(flag, _)| then(*flag) != now(*flag));
    changed.map(|(flag, name)| format!("{name} {}", if now(*flag) { "on" } else { "off" })).collect()
}

fn parity(modes: ControlModes) -> &'static str {
    #[cfg(target_os = "linux")]
    if modes.contains(ControlModes::PARENB | ControlModes::CMSPAR) {
        return "that never changes";
    }
    match (modes.contains(ControlModes::PARENB), modes.contains(ControlModes::PARODD)) {
        (false, _) => "none",
        (true, false) => "even",
        (true, true) => "odd",
    }
}

fn data_bits(modes: ControlModes) -> &'static str {
    match modes & ControlModes::CSIZE {
        ControlModes::CS5 => "5 data bits",
        ControlModes::CS6 => "6 data bits",
        ControlModes::CS7 => "7 data bits",
        _ => "8 data bits",
    }
}

fn stop_bits(modes: ControlModes) -> &'static str {
    if modes.contains(ControlModes::CSTOPB) { "2 stop bits" } else { "1 stop bit" }
}

#[cfg(test)]
mod tests {
    use rustix::pty::{OpenptFlags, openpt};

    use super::*;

    #[test]
    fn what_a_pseudo_terminal_does_not_take_has_words_too() {
        let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        let with = |modes: ControlModes| {
            let mut settings = tcgetattr(&terminal).unwrap();
            settings.control_modes = modes | ControlModes::CREAD;
            settings
        };
        let (none, even) = (ControlModes::CS8, ControlModes::CS8 | ControlModes::PARENB);
        let told = |opened, found| differences(&with(opened), &with(found)).join(", ");
        assert_eq!(told(even, even), "");
        assert_eq!(told(even, none), "parity none instead of even");
        assert_eq!(told(none, even | ControlModes::PARODD), "parity odd instead of none");
        assert_eq!(told(none, none | ControlModes::PARODD), "", "without parity there is none to be odd");
        let seven = ControlModes::CS7 | ControlModes::PARENB | ControlModes::CSTOPB;
        assert_eq!(told(even, seven), "7 data bits instead of 8 data bits, 2 stop bits instead of 1 stop bit");
        assert_eq!(told(none, none | ControlModes::CRTSCTS), "CRTSCTS on");
    }
}
