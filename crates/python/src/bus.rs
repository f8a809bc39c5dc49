//! `Bus` for Python: arguments in, one call of the core without the GIL, exceptions out.

use std::sync::Arc;
use std::time::Duration;

use drivebus_drive::protocol;
use drivebus_line::{
    Bus as CoreBus, CallOptions, Counters, Done, Failure, Hint, LastWill, PortError, PortErrorKind, UnitOptions,
};
use drivebus_rtu::{Adu, Answer, Destination, Frame, MAX_READ_BITS, Request, Table};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

use crate::arguments::{
    duration, open_failed, options_for, read_options, read_request, to_open, write_options, write_request,
};
use crate::clock::{UnixClock, calendar_ahead, to_seconds};
use crate::convert::{any_unit, bytes_of, one_word, words_of};
use crate::ending::detached;
use crate::errors::{call_error, port_error, refuse};
use crate::format::SerialFormat;
use crate::halter::{GivenName, as_named};
use crate::profile::Profile;
use crate::signals::with_signals;
use crate::{overhear, trace};

/// The table that is meant where nothing is said.
pub(crate) const HOLDING: &str = Table::Holding.name();

/// One line and its owner.
#[pyclass(frozen, weakref, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Bus {
    /// Shared with the threads that work for it.
    pub(crate) core: Arc<CoreBus>,
    /// Where the line's clock stands on the calendar, if it is a simulation's: it began when the bus was opened.
    pub(crate) virtual_ahead: Option<f64>,
}

#[pymethods]
impl Bus {
    #[new]
    #[pyo3(signature = (port, format, *, timeout = 0.5, retries = 2, read_only = false, rs485 = None, echo = "auto",
        turnaround = 0.1, learn_timeout = false, low_latency = true, queue = 65_536, share = "auto", group = None, realtime = false))]
    #[expect(
        clippy::too_many_arguments,
        clippy::fn_params_excessive_bools,
        reason = "the keywords of the Python class"
    )]
    fn new(
        py: Python<'_>,
        port: &Bound<'_, PyAny>,
        format: SerialFormat,
        timeout: f64,
        retries: u32,
        read_only: bool,
        rs485: Option<&Bound<'_, PyDict>>,
        echo: &str,
        turnaround: f64,
        learn_timeout: bool,
        low_latency: bool,
        queue: usize,
        share: &str,
        group: Option<u32>,
        realtime: bool,
    ) -> PyResult<Self> {
        let (opener, key, options) = to_open(
            port,
            format,
            timeout,
            retries,
            read_only,
            rs485,
            echo,
            turnaround,
            learn_timeout,
            low_latency,
            queue,
            share,
            group,
            realtime,
        )?;
        let core =
            with_signals(py, |give_up| CoreBus::open_shared(opener, key, options, give_up))?.map_err(open_failed)?;
        Ok(Self::around(core))
    }

    #[getter]
    fn port(&self) -> &str {
        self.core.name()
    }

    #[getter]
    fn closed(&self) -> bool {
        self.core.is_closed()
    }

    #[getter(r#virtual)]
    fn is_virtual(&self) -> bool {
        self.core.is_virtual()
    }

    #[getter]
    fn read_only(&self) -> bool {
        self.core.options().read_only
    }

    /// Calls `function` for each frame on the line, or nothing any more.
    #[pyo3(signature = (function, /))]
    fn watch(&self, py: Python<'_>, function: Option<Py<PyAny>>) {
        let watch = function.map(trace::watch);
        detached(py, || self.core.watch(watch));
    }

    fn close(&self, py: Python<'_>) {
        detached(py, || self.core.close());
    }

    #[pyo3(signature = (meanwhile, /))]
    fn step_aside(&self, py: Python<'_>, meanwhile: &Bound<'_, PyAny>) -> PyResult<()> {
        let meanwhile = meanwhile.clone().unbind();
        let mut result = Ok(());
        py.detach(|| {
            self.core.step_aside(|| result = Python::attach(|py| meanwhile.call0(py).map(drop)));
        });
        result
    }

    fn now(&self, py: Python<'_>) -> f64 {
        py.detach(|| to_seconds(self.core.now()))
    }

    #[pyo3(signature = (seconds, /))]
    fn sleep(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let time = duration("seconds", seconds)?;
        with_signals(py, |give_up| self.core.sleep(time, give_up))
    }

    #[pyo3(signature = (seconds, /))]
    fn listen<'py>(&self, py: Python<'py>, seconds: f64) -> PyResult<Vec<(f64, Bound<'py, PyBytes>)>> {
        let time = duration("seconds", seconds)?;
        with_signals(py, |give_up| Heard::on(&self.core, time, give_up))?.into_python(py, self.core.name())
    }

    #[pyo3(signature = (function, /))]
    fn overhear(&self, py: Python<'_>, function: &Bound<'_, PyAny>) -> PyResult<()> {
        overhear::overhear(py, &self.core, function.as_unbound())
    }

    #[pyo3(signature = (unit, address, count, /, *, timeout = None, retries = None, urgent = false, verify = false,
        table = "holding"))]
    #[expect(clippy::too_many_arguments, reason = "the keywords of the Python method")]
    fn read<'py>(
        &self,
        unit: &Bound<'py, PyAny>,
        address: &Bound<'_, PyAny>,
        count: &Bound<'_, PyAny>,
        timeout: Option<f64>,
        retries: Option<u32>,
        urgent: bool,
        verify: bool,
        table: &str,
    ) -> PyResult<Bound<'py, PyList>> {
        let options = read_options(timeout, retries, verify)?;
        Ok(self.read_words(unit, table, address, count, options, urgent)?.0)
    }

    #[pyo3(signature = (unit, address, count, /, *, urgent = false, verify = false, table = "holding"))]
    fn read_stamped<'py>(
        &self,
        unit: &Bound<'py, PyAny>,
        address: &Bound<'_, PyAny>,
        count: &Bound<'_, PyAny>,
        urgent: bool,
        verify: bool,
        table: &str,
    ) -> PyResult<(Bound<'py, PyList>, f64, f64)> {
        let options = read_options(None, None, verify)?;
        let (words, done) = self.read_words(unit, table, address, count, options, urgent)?;
        let clock = self.unix_clock(unit.py());
        Ok((words, clock.at(done.sent), clock.at(done.ended)))
    }

    #[pyo3(signature = (unit, address, value, /, *, timeout = None, urgent = false, read_back = None, connection = None,
        halts = None, table = "holding"))]
    #[expect(clippy::too_many_arguments, reason = "the keywords of the Python method")]
    fn write(
        &self,
        unit: &Bound<'_, PyAny>,
        address: &Bound<'_, PyAny>,
        value: &Bound<'_, PyAny>,
        timeout: Option<f64>,
        urgent: bool,
        read_back: Option<&Bound<'_, PyAny>>,
        connection: Option<u64>,
        halts: Option<u64>,
        table: &str,
    ) -> PyResult<()> {
        let options = write_options(timeout, read_back, connection, halts)?;
        self.write_to(any_unit(unit)?.into(), table, address, value, options, urgent)
    }

    #[pyo3(signature = (address, value, /))]
    fn broadcast(&self, address: &Bound<'_, PyAny>, value: &Bound<'_, PyAny>) -> PyResult<()> {
        self.write_to(Destination::Broadcast, HOLDING, address, value, CallOptions::default(), false)
    }

    #[pyo3(signature = (unit, word = None, /, *, timeout = None))]
    fn echo(
        &self,
        py: Python<'_>,
        unit: &Bound<'_, PyAny>,
        word: Option<&Bound<'_, PyAny>>,
        timeout: Option<f64>,
    ) -> PyResult<f64> {
        let timeout = timeout.map(|time| duration("timeout", time)).transpose()?;
        let word = match word {
            Some(word) => one_word("word", word)?,
            None => py.detach(|| self.core.fresh_word()),
        };
        let options = CallOptions::new().timeout(timeout);
        let done = self.call(py, any_unit(unit)?.into(), &Request::echo(word), options, &mut |_| ())?;
        Ok(done.ended.saturating_duration_since(done.sent).as_secs_f64())
    }

    #[pyo3(signature = (unit, pdu, reply_length = None, /, *, timeout = None, in_doubt = false, retries = Some(0)))]
    #[expect(clippy::too_many_arguments, reason = "they are Python's")]
    fn transact<'py>(
        &self,
        py: Python<'py>,
        unit: &Bound<'py, PyAny>,
        pdu: &Bound<'py, PyAny>,
        reply_length: Option<u8>,
        timeout: Option<f64>,
        in_doubt: bool,
        retries: Option<u32>,
    ) -> PyResult<Bound<'py, PyBytes>> {
        let (unit, pdu) = (any_unit(unit)?, bytes_of(pdu)?);
        let options = read_options(timeout, retries, false)?.in_doubt(in_doubt);
        let pdu = pdu.as_bytes();
        let request = Request::raw(pdu, reply_length).map_err(refuse)?;
        let mut reply = Vec::new();
        self.call(py, unit.into(), &request, options, &mut |answer| {
            let frame = Adu::answer(unit, &answer);
            if let Ok(frame) = Frame::parse(frame.as_bytes()) {
                reply = frame.pdu().to_vec();
            }
        })?;
        Ok(PyBytes::new(py, &reply))
    }

    #[pyo3(signature = (unit, /, *, timeout = None, gap = None))]
    fn configure(&self, unit: &Bound<'_, PyAny>, timeout: Option<f64>, gap: Option<f64>) -> PyResult<()> {
        let timeout = timeout.map(|time| duration("timeout", time)).transpose()?;
        let gap = gap.map(|time| duration("gap", time)).transpose()?;
        self.core.configure(any_unit(unit)?, UnitOptions::new().timeout(timeout).gap(gap));
        Ok(())
    }

    #[pyo3(signature = (unit, profile, /))]
    fn set_profile(&self, unit: &Bound<'_, PyAny>, profile: &Profile) -> PyResult<()> {
        let unit = any_unit(unit)?;
        self.core.set_meanings(unit, profile.meanings());
        self.core.set_protocol(unit, protocol(&profile.core()));
        Ok(())
    }

    #[pyo3(signature = (unit, /))]
    fn link(&self, py: Python<'_>, unit: &Bound<'_, PyAny>) -> PyResult<(u32, u32)> {
        let unit = any_unit(unit)?;
        let link = py.detach(|| self.core.link(unit));
        Ok((link.good, link.asked))
    }

    #[pyo3(signature = (unit, /))]
    fn halts(&self, py: Python<'_>, unit: &Bound<'_, PyAny>) -> PyResult<u64> {
        let unit = any_unit(unit)?;
        Ok(py.detach(|| self.core.halts(unit)))
    }

    /// Leaves what halts a unit when this program is gone without a word; `None` where nobody would find it.
    #[pyo3(signature = (unit, ways, /, *, look = None, silence = 0.0, named = None))]
    fn leave_will(
        &self,
        unit: &Bound<'_, PyAny>,
        ways: Vec<Vec<Vec<u8>>>,
        look: Option<(Vec<u8>, Vec<Vec<u8>>)>,
        silence: f64,
        named: Option<GivenName<'_>>,
    ) -> PyResult<Option<u64>> {
        let will = LastWill::new(any_unit(unit)?, ways).silence(duration("silence", silence)?).named(as_named(named));
        let will = match look {
            Some((question, others)) => will.look(question, others),
            None => will,
        };
        Ok(unit.py().detach(|| self.core.leave_will(will)))
    }

    #[pyo3(signature = (number, /))]
    fn withdraw_will(&self, py: Python<'_>, number: u64) {
        py.detach(|| self.core.withdraw_will(number));
    }

    #[getter]
    fn reconnects(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.core.reconnects())
    }

    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (stats, notes, wills) = py.detach(|| (self.core.stats(), self.core.notes(), self.core.wills()));
        let all = counters(py, &stats.total)?;
        all.set_item("reconnects", stats.reconnects)?;
        all.set_item("settings_changed", stats.settings_changed)?;
        all.set_item("notes", notes)?;
        all.set_item("wills", wills)?;
        all.set_item("hints", stats.hints().iter().map(ToString::to_string).collect::<Vec<_>>())?;
        all.set_item("hint_names", stats.hints().iter().map(Hint::name).collect::<Vec<_>>())?;
        let programs = stats.programs.iter().map(|program| {
            let one = PyDict::new(py);
            one.set_item("name", &program.name)?;
            one.set_item("process", program.process)?;
            one.set_item("here", program.here)?;
            one.set_item("calls", program.calls)?;
            one.set_item("answered", program.answered)?;
            Ok(one)
        });
        all.set_item("programs", programs.collect::<PyResult<Vec<_>>>()?)?;
        let units = PyDict::new(py);
        for (unit, figures) in &stats.units {
            units.set_item(unit.get(), counters(py, figures)?)?;
        }
        all.set_item("units", units)?;
        Ok(all)
    }

    fn __repr__(&self) -> String {
        format!("<_native.Bus {}>", self.core.name())
    }
}

impl Bus {
    fn read_words<'py>(
        &self,
        unit: &Bound<'py, PyAny>,
        table: &str,
        address: &Bound<'_, PyAny>,
        count: &Bound<'_, PyAny>,
        options: CallOptions,
        urgent: bool,
    ) -> PyResult<(Bound<'py, PyList>, Done)> {
        let py = unit.py();
        let request = read_request(table, address, count)?;
        let options = options_for(&request, options, urgent);
        // Kept here while the interpreter is let go of, so that only the list is made.
        let (mut read, mut count) = ([0; MAX_READ_BITS as usize], 0);
        let done = self.call(py, any_unit(unit)?.into(), &request, options, &mut |answer| {
            if let Answer::Read { words, .. } = answer {
                count = words.len();
                read.iter_mut().zip(words.iter()).for_each(|(slot, word)| *slot = word);
            }
        })?;
        Ok((PyList::new(py, &read[..count])?, done))
    }

    fn write_to(
        &self,
        to: Destination,
        table: &str,
        address: &Bound<'_, PyAny>,
        value: &Bound<'_, PyAny>,
        options: CallOptions,
        urgent: bool,
    ) -> PyResult<()> {
        let py = address.py();
        let address = one_word("address", address)?;
        let words = words_of(value)?;
        let request = write_request(table, address, &words)?;
        self.call(py, to, &request, options_for(&request, options, urgent), &mut |_| ())?;
        Ok(())
    }

    fn call(
        &self,
        py: Python<'_>,
        to: Destination,
        request: &Request<'_>,
        options: CallOptions,
        take: &mut (dyn FnMut(Answer<'_>) + Send),
    ) -> PyResult<Done> {
        let result = with_signals(py, |give_up| self.core.call(to, request, options, give_up, take))?;
        result.map_err(|error| call_error(&error, self.unix_clock(py)))
    }

    pub(crate) fn around(core: CoreBus) -> Self {
        let virtual_ahead = core.is_virtual().then(|| calendar_ahead(&core));
        Self { core: Arc::new(core), virtual_ahead }
    }

    pub(crate) fn unix_clock(&self, py: Python<'_>) -> UnixClock {
        py.detach(|| UnixClock::of(&self.core, self.virtual_ahead))
    }
}

/// What came on a line while nothing was asked, and how that ended.
pub(crate) struct Heard {
    frames: Vec<(f64, Vec<u8>)>,
    end: Result<(), Failure>,
}

impl Heard {
    pub(crate) fn on(core: &CoreBus, time: Duration, give_up: &mut dyn FnMut() -> bool) -> Self {
        let mut frames = Vec::new();
        let end = core.listen(time, give_up, &mut |moment, bytes| frames.push((to_seconds(moment), bytes.to_vec())));
        Self { frames, end }
    }

    pub(crate) fn into_python<'py>(self, py: Python<'py>, port: &str) -> PyResult<Vec<(f64, Bound<'py, PyBytes>)>> {
        self.end.map_err(|failure| match failure {
            Failure::Port(error) => port_error(&error),
            full @ Failure::QueueFull { .. } => refuse(full),
            other => port_error(&PortError::new(PortErrorKind::Closed, port, other.to_string())),
        })?;
        Ok(self.frames.into_iter().map(|(moment, bytes)| (moment, PyBytes::new(py, &bytes))).collect())
    }
}

fn counters<'py>(py: Python<'py>, figures: &Counters) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    all.set_item("requests", figures.requests)?;
    all.set_item("answers", figures.answers)?;
    all.set_item("refusals", figures.refusals)?;
    all.set_item("timeouts", figures.timeouts)?;
    all.set_item("crc_errors", figures.crc_errors)?;
    all.set_item("bad_answers", figures.bad_answers)?;
    all.set_item("retries", figures.retries)?;
    all.set_item("verified", figures.verified)?;
    all.set_item("not_asked", figures.not_asked)?;
    all.set_item("resyncs", figures.resyncs)?;
    all.set_item("late_replies", figures.late)?;
    all.set_item("foreign_frames", figures.foreign)?;
    all.set_item("noise_bytes", figures.noise_bytes)?;
    all.set_item("noise_idle", figures.noise_idle)?;
    all.set_item("own_echoes", figures.own_echoes)?;
    all.set_item("other_answers", figures.other_answers)?;
    all.set_item("other_functions", figures.other_functions)?;
    all.set_item("other_transactions", figures.other_transactions)?;
    all.set_item("noise_events", figures.noise_events)?;
    all.set_item("occupied", figures.occupied.as_secs_f64())?;
    for (name, latency) in [("round_trip", &figures.round_trip), ("delay", &figures.delay)] {
        let times = PyDict::new(py);
        times.set_item("min", latency.min.as_secs_f64())?;
        times.set_item("mean", latency.mean().as_secs_f64())?;
        times.set_item("max", latency.max.as_secs_f64())?;
        all.set_item(name, times)?;
    }
    Ok(all)
}
