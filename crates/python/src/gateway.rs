//! `Gateway` for Python: a server for Modbus TCP, or RTU, before a bus.

use std::path::PathBuf;
use std::sync::Arc;

use drivebus_line::gateway::{
    DeadMan, Framing, Gateway as CoreGateway, GatewayOptions, Halts, Means, Network, Rights, Rule, Writable,
};
use drivebus_line::{LastWill, PortError, PortErrorKind};
use drivebus_rtu::UnitAddress;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arguments::duration;
use crate::bus::Bus;
use crate::convert::table_of;
use crate::errors::{bad_argument, port_error, refuse};
use crate::halter::{GivenName, as_named};

/// Table and address, words, what it does, where the same is in RAM, name, and where it is shown.
type GivenWrite = (String, u16, Option<Vec<u16>>, String, Option<u16>, String, Option<u16>);
/// Networks, units, functions, and what may be written.
type GivenRule = (Vec<String>, Vec<u8>, Vec<u8>, Vec<GivenWrite>);
/// A unit, its stops, and its will: ways, look, and as what it is named.
type GivenHalts<'py> =
    (u8, Vec<GivenWrite>, Vec<Vec<Vec<u8>>>, Option<(Vec<u8>, Vec<Vec<u8>>)>, Option<GivenName<'py>>);

fn rights(rules: Vec<GivenRule>, units: Vec<GivenHalts<'_>>) -> PyResult<Rights> {
    let rules = rules.into_iter().map(|(networks, units, functions, writes)| {
        let networks = networks.iter().map(|text| text.parse::<Network>().map_err(refuse));
        let networks = networks.collect::<PyResult<_>>()?;
        Ok(Rule::new(functions).networks(networks).units(units).writes(writables(writes)?))
    });
    let mut rights = Rights::new(rules.collect::<PyResult<_>>()?);
    for (unit, stops, ways, look, named) in units {
        let will = LastWill::new(UnitAddress::by_name(unit), ways).named(as_named(named));
        let will = match look {
            Some((question, others)) => will.look(question, others),
            None => will,
        };
        rights.units.insert(unit, Halts::new(writables(stops)?, will));
    }
    Ok(rights)
}

fn writables(given: Vec<GivenWrite>) -> PyResult<Vec<Writable>> {
    given.into_iter().map(writable).collect()
}

fn writable((table, address, words, means, instead, name, shown_at): GivenWrite) -> PyResult<Writable> {
    let table = table_of(&table)?;
    let means = match means.as_str() {
        "sets" => Means::Sets,
        "wears" => Means::Wears { instead },
        "stops" => Means::Stops,
        "moves" => Means::Moves,
        _ => return Err(bad_argument(format!("{means} is nothing that a write does"))),
    };
    Ok(Writable::new(table, address, name).words(words).means(means).shown_at(shown_at))
}

/// Opens it at `host:port`, or at a pseudo-terminal where `address` is a path.
fn open(bus: &Arc<drivebus_line::Bus>, address: &str, options: GatewayOptions) -> std::io::Result<CoreGateway> {
    if !address.starts_with('/') {
        return CoreGateway::open(bus, address, options);
    }
    #[cfg(target_os = "linux")]
    return CoreGateway::open_terminal(bus, std::path::Path::new(address), options);
    #[cfg(not(target_os = "linux"))]
    Err(std::io::Error::new(std::io::ErrorKind::Unsupported, "pseudo-terminals are served on Linux alone"))
}

/// A server for Modbus TCP, until it is closed.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Gateway {
    core: CoreGateway,
}

#[pymethods]
impl Gateway {
    #[new]
    #[expect(clippy::too_many_arguments, reason = "the keywords of the Python class")]
    #[pyo3(signature = (bus, address, within, /, *, rtu, rules, units, dead_man, audit))]
    fn new(
        bus: &Bound<'_, Bus>,
        address: &str,
        within: f64,
        rtu: bool,
        rules: Vec<GivenRule>,
        units: Vec<GivenHalts<'_>>,
        dead_man: Option<f64>,
        audit: Option<PathBuf>,
    ) -> PyResult<Self> {
        let dead_man = match dead_man {
            Some(silence) => DeadMan::After(duration("dead_man", silence)?),
            None => DeadMan::Off,
        };
        let options = GatewayOptions::default()
            .answer_within(duration("answer_within", within)?)
            .framing(if rtu { Framing::Rtu } else { Framing::Tcp })
            .dead_man(dead_man)
            .audit(audit);
        let options = if rules.is_empty() { options } else { options.rights(rights(rules, units)?) };
        let core = &bus.get().core;
        let opened = bus.py().detach(|| open(core, address, options));
        opened.map(|core| Self { core }).map_err(|error| {
            let kind = match error.kind() {
                std::io::ErrorKind::AddrInUse | std::io::ErrorKind::AlreadyExists => PortErrorKind::Busy,
                std::io::ErrorKind::PermissionDenied => PortErrorKind::Denied,
                std::io::ErrorKind::AddrNotAvailable | std::io::ErrorKind::NotFound => PortErrorKind::NotFound,
                _ => PortErrorKind::Other,
            };
            port_error(&PortError::new(kind, address, format!("nothing can listen there: {error}")))
        })
    }

    #[getter]
    fn address(&self) -> String {
        self.core.address().to_string()
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let stats = self.core.stats();
        let all = PyDict::new(py);
        all.set_item("clients", stats.clients)?;
        for (name, count) in [
            ("let_in", stats.let_in),
            ("cut_off", stats.cut_off),
            ("gave_way", stats.gave_way),
            ("requests", stats.requests),
            ("answered", stats.answered),
            ("refused", stats.refused),
            ("failed", stats.failed),
            ("late", stats.late),
            ("given_up", stats.given_up),
            ("busy", stats.busy),
            ("together", stats.together),
            ("written", stats.written),
            ("halted", stats.halted),
            ("unaudited", stats.unaudited),
        ] {
            all.set_item(name, count)?;
        }
        Ok(all)
    }

    fn take_told(&self) -> Vec<String> {
        self.core.take_told()
    }

    fn close(&self, py: Python<'_>) {
        py.detach(|| self.core.close());
    }
}
