//! What parameters and setpoints ask of the machine.

use super::addresses as at;
use super::machine::Settings;
use super::store::Store;
use crate::ramp::Slopes;

/// P00.06 = 8: the frequency comes from 2001H.
const FROM_BUS: u16 = 8;
/// P01.08 = 1. Assumption: 0 ramps down, 1 coasts; the digits are not printed.
const COAST_TO_STOP: u16 = 1;

/// Reads the settings from the parameters in force and the words of the 2000H block.
///
/// Assumption: any source but 8 in P00.06 means the frequency set at the keypad (P00.10). Ramps are straight lines; their
/// times are those from 0 Hz to P00.03. The setpoint is cut to P00.04 and P00.03.
pub(crate) fn settings(store: &Store, control: &[u16]) -> Settings {
    let parameter = |address| f64::from(store.get(address).unwrap_or(0));
    let full_scale = parameter(at::MAX_FREQUENCY) / 100.0;
    let asked = if store.get(at::FREQUENCY_SOURCE) == Some(FROM_BUS) {
        let index = usize::from(at::SET_FREQUENCY - at::CONTROL_COMMAND);
        f64::from(control.get(index).copied().unwrap_or(0))
    } else {
        parameter(at::KEYPAD_FREQUENCY)
    };
    let slopes = |rise, fall| Slopes::from_times(full_scale, parameter(rise) / 10.0, parameter(fall) / 10.0);
    Settings {
        setpoint: (asked / 100.0).min(parameter(at::UPPER_FREQUENCY) / 100.0).min(full_scale),
        run_slopes: slopes(at::ACCELERATION_TIME, at::DECELERATION_TIME),
        jog: (parameter(at::JOG_FREQUENCY) / 100.0).min(full_scale),
        jog_slopes: slopes(at::JOG_ACCELERATION, at::JOG_DECELERATION),
        stop_by_coasting: store.get(at::STOP_MODE) == Some(COAST_TO_STOP),
    }
}
