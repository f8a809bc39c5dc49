//! The simulator and its drives for Python.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use drivebus_drives::{Place, Table};
use drivebus_line::{Line, PortError, PortErrorKind};
use drivebus_sim::{self as sim, Asked, Model, Options, Refusals, WriteRecord};
use pyo3::prelude::*;

use crate::clock::seconds;
use crate::convert::{duration, one_word, shown, unit_address};
use crate::errors::{bad_argument, refuse, sim_error};
use crate::format::SerialFormat;
use crate::profile::Profile;
use crate::sim_line::SimulatedLine;

/// What other programs reach the simulated line by. It is served until this is dropped.
enum Server {
    InProcess,
    #[cfg(target_os = "linux")]
    Pty(sim::PtyServer),
    #[cfg(unix)]
    Tcp(sim::TcpServer),
}

impl Server {
    #[cfg_attr(not(unix), expect(unused_variables, reason = "only Unix has ports to serve"))]
    fn start(simulator: &sim::Simulator, transport: &str, link: Option<PathBuf>) -> PyResult<Self> {
        let failed = |error| sim_error(&format!("simulator ({transport})"), error);
        if link.is_some() && transport != "pty" {
            return Err(bad_argument(format!(
                "a link leads to a pseudo-terminal, and there is none with {transport:?}"
            )));
        }
        match transport {
            "process" => Ok(Self::InProcess),
            #[cfg(target_os = "linux")]
            "pty" => match link {
                None => simulator.serve_pty().map(Self::Pty).map_err(failed),
                Some(link) => simulator.serve_pty_linked(&link).map(Self::Pty).map_err(failed),
            },
            #[cfg(unix)]
            "tcp" => simulator.serve_tcp().map(Self::Tcp).map_err(failed),
            #[cfg(not(target_os = "linux"))]
            "pty" => Err(bad_argument(String::from("transport \"pty\" needs Linux; use \"tcp\" or \"process\""))),
            #[cfg(not(unix))]
            "tcp" => Err(bad_argument(String::from("transport \"tcp\" needs a Unix system; use \"process\""))),
            other => Err(bad_argument(format!("transport {other:?} is not \"pty\", \"tcp\" or \"process\""))),
        }
    }

    fn port(&self, simulator: &sim::Simulator) -> String {
        match self {
            Self::InProcess => simulator.name().to_owned(),
            #[cfg(target_os = "linux")]
            Self::Pty(server) => server.path().display().to_string(),
            #[cfg(unix)]
            Self::Tcp(server) => format!("socket://{}", server.address()),
        }
    }
}

/// What another program overhears the line by. It is there until this is dropped.
struct Ear {
    path: String,
    #[cfg(target_os = "linux")]
    _server: sim::EarServer,
}

impl Ear {
    #[cfg(target_os = "linux")]
    fn start(simulator: &sim::Simulator, link: Option<PathBuf>) -> PyResult<Self> {
        let server = match link {
            None => simulator.serve_ear(),
            Some(link) => simulator.serve_ear_linked(&link),
        };
        let server = server.map_err(|error| sim_error("simulator (ear)", error))?;
        Ok(Self { path: server.path().display().to_string(), _server: server })
    }

    #[cfg(not(target_os = "linux"))]
    fn start(_: &sim::Simulator, _: Option<PathBuf>) -> PyResult<Self> {
        Err(bad_argument(String::from("an ear needs Linux; here, drivebus.sniff hears a bus of the same program")))
    }
}

/// A simulated line with simulated drives.
#[pyclass(frozen, module = "drivebus._native")]
pub(crate) struct Simulator {
    core: sim::Simulator,
    /// Where it was to be reached when that was last asked.
    port: Mutex<String>,
    /// `None` once it is closed.
    server: Mutex<Option<Server>>,
    /// What its ear is called, if it has one.
    heard_at: Option<String>,
    /// `None` where it has none, and once it is closed.
    ear: Mutex<Option<Ear>>,
}

impl Simulator {
    /// A bus's connection to the line, in this process.
    pub(crate) fn sim_line(&self) -> Result<Box<dyn Line>, PortError> {
        if self.server().is_none() {
            let message = "the simulation is closed; make a new Simulator";
            return Err(PortError::new(PortErrorKind::Closed, self.current_port(), message));
        }
        Ok(Box::new(self.core.open_line()?))
    }

    /// Where it is reached now: a pseudo-terminal gets another name by unplugging. What it was, once it is closed.
    fn current_port(&self) -> String {
        let mut port = self.port.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(server) = &*self.server() {
            *port = server.port(&self.core);
        }
        port.clone()
    }

    fn server(&self) -> MutexGuard<'_, Option<Server>> {
        self.server.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Simulator {
    #[new]
    #[pyo3(
        signature = (units, format, *, seed = 0, transport = "pty", realtime = true, strict_silence = false, link = None, fifo = None, ear = false, ear_link = None),
        text_signature = "(units, format, *, seed=0, transport='pty', realtime=True, strict_silence=False, link=None, fifo=None, ear=False, ear_link=None)"
    )]
    #[expect(clippy::too_many_arguments, reason = "the keywords of the Python class")]
    fn new(
        units: &Bound<'_, PyAny>,
        format: SerialFormat,
        seed: u64,
        transport: &str,
        realtime: bool,
        strict_silence: bool,
        link: Option<PathBuf>,
        fifo: Option<usize>,
        ear: bool,
        ear_link: Option<PathBuf>,
    ) -> PyResult<Self> {
        let units = units_of(units)?;
        let mut options =
            Options::default().format(format.0).seed(seed).realtime(realtime).strict_silence(strict_silence);
        if let Some(characters) = fifo {
            options = options.fifo(characters);
        }
        let models = units.iter().map(|(unit, behaves_like)| (*unit, behaves_like.model()));
        let core = sim::Simulator::new(models, options).map_err(refuse)?;
        let server = Server::start(&core, transport, link)?;
        let port = Mutex::new(server.port(&core));
        let ear = if ear || ear_link.is_some() { Some(Ear::start(&core, ear_link)?) } else { None };
        let heard_at = ear.as_ref().map(|ear| ear.path.clone());
        Ok(Self { core, port, server: Mutex::new(Some(server)), heard_at, ear: Mutex::new(ear) })
    }

    #[getter]
    fn port(&self) -> String {
        self.current_port()
    }

    #[getter]
    fn ear(&self) -> Option<&str> {
        self.heard_at.as_deref()
    }

    fn close(&self, py: Python<'_>) {
        self.current_port();
        let server = self.server().take();
        let ear = self.ear.lock().unwrap_or_else(PoisonError::into_inner).take();
        // Ending a server waits for its thread.
        py.detach(|| drop((server, ear)));
    }

    fn now(&self) -> f64 {
        seconds(self.core.now())
    }

    #[pyo3(signature = (seconds, /))]
    fn advance(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let time = duration(seconds)?;
        py.detach(|| self.core.advance(time)).map_err(refuse)
    }

    #[pyo3(signature = (unit, /))]
    fn drive(&self, unit: &Bound<'_, PyAny>) -> PyResult<SimulatedDrive> {
        self.core.drive(unit_address(unit)?.get()).map(SimulatedDrive).map_err(refuse)
    }

    #[getter]
    fn line(&self) -> SimulatedLine {
        SimulatedLine::new(self.core.wire())
    }

    fn __repr__(&self) -> String {
        format!("<Simulator {} at {}>", self.core.name(), self.current_port())
    }
}

/// One simulated drive, seen from its shaft and its keypad, not from the bus.
#[pyclass(frozen, module = "drivebus._native")]
pub(crate) struct SimulatedDrive(sim::SimulatedDrive);

#[pymethods]
impl SimulatedDrive {
    #[getter]
    fn unit(&self) -> u8 {
        self.0.unit()
    }

    #[getter]
    fn profile(&self) -> String {
        self.0.profile()
    }

    #[getter]
    fn state(&self) -> &'static str {
        self.0.state()
    }

    #[getter]
    fn frequency(&self) -> f64 {
        self.0.frequency()
    }

    #[getter]
    fn speed(&self) -> f64 {
        self.0.speed()
    }

    #[getter]
    fn fault(&self) -> u16 {
        self.0.fault()
    }

    #[getter]
    fn load(&self) -> f64 {
        self.0.load()
    }

    #[setter]
    fn set_load(&self, load: f64) -> PyResult<()> {
        self.0.set_load(load).map_err(refuse)
    }

    #[getter]
    fn inputs(&self) -> u16 {
        self.0.inputs()
    }

    #[setter]
    fn set_inputs(&self, inputs: &Bound<'_, PyAny>) -> PyResult<()> {
        self.0.set_inputs(one_word("inputs", inputs)?).map_err(refuse)
    }

    #[pyo3(signature = (code, /))]
    fn trip(&self, code: &Bound<'_, PyAny>) -> PyResult<()> {
        self.0.trip(one_word("fault", code)?).map_err(refuse)
    }

    #[pyo3(signature = (code, /, *, asked = "anything", share = 1.0, seconds = None, count = None, taken = false))]
    fn refuse(
        &self,
        code: u8,
        asked: &str,
        share: f64,
        seconds: Option<f64>,
        count: Option<u64>,
        taken: bool,
    ) -> PyResult<()> {
        let asked = match asked {
            "anything" => Asked::Anything,
            "reads" => Asked::Reads,
            "writes" => Asked::Writes,
            other => return Err(bad_argument(format!("asked {other:?} is not \"anything\", \"reads\" or \"writes\""))),
        };
        let mut refusals = Refusals::new(code).of(asked).share(share);
        if let Some(seconds) = seconds {
            refusals = refusals.time(duration(seconds)?);
        }
        if let Some(count) = count {
            refusals = refusals.count(count);
        }
        self.0.refuse(if taken { refusals.taken() } else { refusals }).map_err(refuse)
    }

    fn refuse_no_more(&self) {
        self.0.refuse_no_more();
    }

    #[pyo3(signature = (address, highest, /))]
    fn limit(&self, address: &Bound<'_, PyAny>, highest: &Bound<'_, PyAny>) -> PyResult<()> {
        self.0.limit(one_word("address", address)?, one_word("highest", highest)?);
        Ok(())
    }

    fn power_cycle(&self) {
        self.0.power_cycle();
    }

    fn factory_reset(&self) -> PyResult<()> {
        self.0.factory_reset().map_err(refuse)
    }

    #[pyo3(signature = (address, /))]
    fn register(&self, address: &Bound<'_, PyAny>) -> PyResult<u16> {
        let address = one_word("address", address)?;
        self.0.register(address).map_err(|code| {
            let unit = self.0.unit();
            bad_argument(format!("unit {unit} would refuse to read {address:04X}H with exception {:02X}H", code.0))
        })
    }

    #[getter]
    fn eeprom_writes(&self) -> u64 {
        self.0.eeprom_writes()
    }

    #[pyo3(signature = (address, /))]
    fn eeprom_writes_of(&self, address: &Bound<'_, PyAny>) -> PyResult<u64> {
        Ok(self.0.eeprom_writes_of(one_word("address", address)?))
    }

    fn writes(&self) -> Vec<(f64, u32, u16)> {
        self.0.writes().iter().map(|write| (seconds(write.at), number(write), write.value)).collect()
    }

    fn take_writes(&self) -> Vec<(f64, u32, u16)> {
        self.0.take_writes().iter().map(|write| (seconds(write.at), number(write), write.value)).collect()
    }

    #[getter]
    fn words_written(&self) -> u64 {
        self.0.words_written()
    }

    fn __repr__(&self) -> String {
        format!("<SimulatedDrive {}: {}, {}>", self.0.unit(), self.0.profile(), self.0.state())
    }
}

/// What a unit was said to behave like.
enum BehavesLike {
    Name(String),
    Profile(Arc<drivebus_drives::Profile>),
}

impl BehavesLike {
    fn model(&self) -> Model<'_> {
        match self {
            Self::Name(name) => name.as_str().into(),
            Self::Profile(profile) => (&**profile).into(),
        }
    }
}

/// A mapping's items as unit address and what is there.
fn units_of(units: &Bound<'_, PyAny>) -> PyResult<Vec<(u8, BehavesLike)>> {
    let mistake =
        || bad_argument(format!("units {} do not map unit addresses to names of profiles or profiles", shown(units)));
    let items = units.call_method0("items").map_err(|_| mistake())?;
    items
        .try_iter()?
        .map(|item| {
            let (unit, profile): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item?.extract().map_err(|_| mistake())?;
            let behaves_like = match profile.cast::<Profile>() {
                Ok(profile) => BehavesLike::Profile(profile.get().core()),
                Err(_) => BehavesLike::Name(profile.extract().map_err(|_| mistake())?),
            };
            Ok((unit_address(&unit)?.get(), behaves_like))
        })
        .collect()
}

/// The place of a write, as profiles number it.
fn number(write: &WriteRecord) -> u32 {
    let table = Table::ALL.into_iter().find(|table| table.function() == write.table.function());
    Place::new(table.unwrap_or_default(), write.address).number()
}
