//! The simulated line behind a `sim://` port.

use drivebus_line::Opener;
use drivebus_line::url::SimulatorUrl;
use drivebus_rtu::SerialFormat;
use drivebus_sim::{FaultKind, Options, SimError, Simulator};

/// The simulator that `url` asks for.
pub(crate) fn simulator(url: &SimulatorUrl, format: SerialFormat) -> Result<Simulator, SimError> {
    let options =
        Options::default().format(format).seed(url.seed).realtime(!url.is_virtual).strict_silence(url.strict_silence);
    let units = url.units.iter().map(|(unit, family)| (unit.get(), family.as_str()));
    let simulator = Simulator::new(units, options)?;
    let wire = simulator.wire();
    wire.set_echo(url.echo);
    let rate_of = |name: &str| url.faults.iter().find(|(kind, _)| kind == name).map(|&(_, rate)| rate);
    for kind in FaultKind::ALL {
        // What is said of all is not said of the adapter: it would be pulled out again and again.
        let general = rate_of("all").filter(|_| kind != FaultKind::Unplug);
        wire.set_rate(kind, rate_of(kind.name()).or(general).unwrap_or(0.0))?;
    }
    Ok(simulator)
}

/// What opens its line, as often as it was lost.
pub(crate) fn opener(simulator: &Simulator) -> Opener {
    let simulator = simulator.clone();
    Box::new(move || Ok(Box::new(simulator.open_line()?)))
}
