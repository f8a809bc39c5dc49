//! What people in the field type, and what the rows of profiles are called.
//!
//! The left column comes from the usage of the field: what other makers' keypads, manuals and bus masters call a thing, and
//! what is said beside a machine. It is no fact about any drive, and decides nothing: it only helps to find a row.

/// What may be typed (lower case, one or more words; a plural finds it too), and words that then are looked for, the
/// likeliest first. A longer phrase goes before its words.
pub(crate) const SYNONYMS: &[(&str, &[&str])] = &[
    // Ramps, starts and stops.
    ("ramp", &["acceleration time", "deceleration time"]),
    ("ramp up", &["acceleration time"]),
    ("ramp down", &["deceleration time"]),
    ("run up", &["acceleration time"]),
    ("start", &["run command", "run forward"]),
    ("halt", &["stop"]),
    ("brake", &["braking", "stop mode", "deceleration time"]),
    ("freewheel", &["stop mode", "coast"]),
    ("free run", &["stop mode", "coast"]),
    ("inch", &["jog"]),
    ("inching", &["jog"]),
    ("direction", &["reverse"]),
    ("preset", &["multi step"]),
    // Speeds and setpoints.
    ("speed", &["output frequency", "frequency setpoint", "frequency"]),
    ("velocity", &["speed", "output frequency", "frequency setpoint", "frequency"]),
    ("hertz", &["frequency"]),
    ("hz", &["frequency"]),
    ("rpm", &["rotation speed"]),
    ("frequency", &["speed"]),
    ("setpoint", &["reference", "setting"]),
    ("set point", &["setpoint", "reference", "setting"]),
    ("reference", &["setpoint"]),
    ("target", &["setpoint", "reference"]),
    ("max", &["upper", "ceiling"]),
    ("maximum", &["max", "upper", "ceiling"]),
    ("min", &["lower"]),
    ("minimum", &["lower"]),
    ("limit", &["ceiling"]),
    // What is measured.
    ("motor current", &["output current"]),
    ("motor speed", &["rotation speed", "output frequency"]),
    ("motor voltage", &["output voltage"]),
    ("amp", &["current"]),
    ("ampere", &["current"]),
    ("current limit", &["torque limit", "torque ceiling"]),
    ("dc link", &["bus voltage"]),
    ("dc voltage", &["bus voltage"]),
    ("intermediate circuit", &["bus voltage"]),
    ("overload", &["output current", "output torque"]),
    ("load", &["output torque", "output current", "output power"]),
    ("kwh", &["energy meter", "output power"]),
    ("energy", &["output power"]),
    // Faults.
    ("trip", &["fault"]),
    ("error", &["fault"]),
    ("alarm", &["fault"]),
    ("acknowledge", &["reset"]),
    ("clear", &["reset"]),
    ("power loss", &["power cut"]),
    ("power failure", &["power cut"]),
    // The line.
    ("bit rate", &["baud rate"]),
    ("bitrate", &["baud rate"]),
    ("bps", &["baud rate"]),
    ("parity", &["character format"]),
    ("stop bit", &["character format"]),
    ("data bit", &["character format"]),
    ("8n1", &["character format"]),
    ("8e1", &["character format"]),
    ("slave", &["unit address"]),
    ("slave id", &["unit address"]),
    ("station", &["unit address"]),
    ("node", &["unit address"]),
    ("node id", &["unit address"]),
    ("watchdog", &["communication timeout", "communication fault"]),
    ("rs485", &["unit address", "baud rate", "character format"]),
    ("rs 485", &["unit address", "baud rate", "character format"]),
    ("serial", &["unit address", "baud rate", "character format"]),
    ("turnaround", &["response delay"]),
    // Inputs, outputs, the motor, the drive.
    ("analogue", &["analog"]),
    ("potentiometer", &["analog input"]),
    ("4 20ma", &["analog input", "analog output"]),
    ("0 10v", &["analog input", "analog output"]),
    ("relay", &["output state", "digital output"]),
    ("local", &["run command source"]),
    ("remote", &["run command source"]),
    ("tune", &["autotuning"]),
    ("autotune", &["autotuning"]),
    ("auto tune", &["autotuning"]),
    ("nameplate", &["rated"]),
    ("switching frequency", &["carrier frequency"]),
    ("pwm", &["carrier frequency"]),
    ("avr", &["voltage regulation"]),
    ("lock", &["password"]),
    ("model", &["identification code"]),
    ("series", &["identification code"]),
];

#[cfg(test)]
mod tests {
    use super::SYNONYMS;

    #[test]
    fn each_is_typed_once_and_in_lower_case() {
        let mut typed: Vec<_> = SYNONYMS.iter().map(|&(typed, _)| typed).collect();
        assert!(typed.iter().all(|&text| text == text.to_lowercase()));
        typed.sort_unstable();
        assert!(typed.windows(2).all(|pair| pair[0] != pair[1]), "{typed:?}");
    }
}
