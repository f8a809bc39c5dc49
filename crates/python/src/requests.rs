//! The requests of an event loop: asked without waiting, and answered through the loop's mailbox.
//!
//! The same arguments as those of `Bus`, checked and converted by the same functions.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use drivebus_line::{Bus as CoreBus, CallError, CallOptions, Errand, Link, Reply, Running};
use drivebus_rtu::{Answer, Destination, Expected, Request};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arguments::{
    duration, open_failed, options_for, read_options, read_request, to_open, write_options, write_request,
};
use crate::bus::{Bus, HOLDING, Heard};
use crate::clock::UnixClock;
use crate::convert::{any_unit, one_word, words_of};
use crate::errors::{call_error, refuse};
use crate::format::SerialFormat;
use crate::mailbox::{Inbox, Mailbox};

/// A bus, as an event loop uses it.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Requests {
    core: Arc<CoreBus>,
    virtual_ahead: Option<f64>,
    inbox: Arc<Inbox>,
}

/// Who is told what came of an errand.
type Then = Box<dyn FnOnce(Result<Reply, Box<CallError>>) + Send>;

/// Something that was asked, and under which number its answer will come.
#[pyclass(frozen, module = "drivebus._native")]
#[derive(Debug)]
pub(crate) struct Asked {
    #[pyo3(get)]
    number: u64,
    how: How,
}

#[derive(Debug)]
enum How {
    Errand(Option<Running>),
    /// A thread of its own looks now and then whether it is still wanted.
    Apart(Arc<AtomicBool>),
}

#[pymethods]
impl Asked {
    fn abandon(&self, py: Python<'_>) {
        match &self.how {
            How::Errand(Some(running)) => py.detach(|| running.abandon()),
            How::Errand(None) => {}
            How::Apart(wanted) => wanted.store(false, Ordering::Release),
        }
    }
}

impl Asked {
    /// What comes under `number` unless `wanted` was taken back by then.
    pub(crate) fn apart(number: u64, wanted: Arc<AtomicBool>) -> Self {
        Self { number, how: How::Apart(wanted) }
    }
}

/// Opens a bus in a thread of its own; it comes as a letter.
#[pyfunction]
#[pyo3(signature = (mailbox, port, format, *, timeout = 0.5, retries = 2, read_only = false, rs485 = None, echo = "auto",
    turnaround = 0.1, learn_timeout = false, low_latency = true, queue = 65_536, share = "auto", group = None, realtime = false))]
#[expect(clippy::too_many_arguments, clippy::fn_params_excessive_bools, reason = "the keywords of the Python class")]
pub(crate) fn open_bus(
    mailbox: &Mailbox,
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
) -> PyResult<Asked> {
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
    apart(&mailbox.inbox, move |wanted| {
        let core = CoreBus::open_shared(opener, key, options, &mut || !wanted.load(Ordering::Acquire));
        move |py: Python<'_>| match core {
            Ok(core) => Ok(Bound::new(py, Bus::around(core))?.into_any()),
            Err(failure) => Err(open_failed(failure)),
        }
    })
}

#[pymethods]
impl Requests {
    #[new]
    fn new(bus: &Bus, mailbox: &Mailbox) -> Self {
        Self { core: Arc::clone(&bus.core), virtual_ahead: bus.virtual_ahead, inbox: Arc::clone(&mailbox.inbox) }
    }

    #[pyo3(signature = (unit, address, count, /, *, timeout = None, retries = None, urgent = false, verify = false,
        table = "holding"))]
    #[expect(clippy::too_many_arguments, reason = "the keywords of the Python method")]
    fn read(
        &self,
        unit: &Bound<'_, PyAny>,
        address: &Bound<'_, PyAny>,
        count: &Bound<'_, PyAny>,
        timeout: Option<f64>,
        retries: Option<u32>,
        urgent: bool,
        verify: bool,
        table: &str,
    ) -> PyResult<Asked> {
        let request = read_request(table, address, count)?;
        let options = options_for(&request, read_options(timeout, retries, verify)?, urgent);
        let expected = request.expected();
        Ok(self.ask(any_unit(unit)?.into(), &request, options, move |py, reply, _| {
            words(expected, &reply).into_pyobject(py)
        }))
    }

    #[pyo3(signature = (unit, address, count, /, *, urgent = false, verify = false, table = "holding"))]
    fn read_stamped(
        &self,
        unit: &Bound<'_, PyAny>,
        address: &Bound<'_, PyAny>,
        count: &Bound<'_, PyAny>,
        urgent: bool,
        verify: bool,
        table: &str,
    ) -> PyResult<Asked> {
        let request = read_request(table, address, count)?;
        let expected = request.expected();
        let options = options_for(&request, read_options(None, None, verify)?, urgent);
        Ok(self.ask(any_unit(unit)?.into(), &request, options, move |py, reply, clock| {
            let stamped = (words(expected, &reply), clock.at(reply.done.sent), clock.at(reply.done.ended));
            Ok(stamped.into_pyobject(py)?.into_any())
        }))
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
    ) -> PyResult<Asked> {
        let options = write_options(timeout, read_back, connection, halts)?;
        self.write_to(any_unit(unit)?.into(), table, address, value, options, urgent)
    }

    #[pyo3(signature = (address, value, /))]
    fn broadcast(&self, address: &Bound<'_, PyAny>, value: &Bound<'_, PyAny>) -> PyResult<Asked> {
        self.write_to(Destination::Broadcast, HOLDING, address, value, CallOptions::default(), false)
    }

    #[pyo3(signature = (unit, word = None, /))]
    fn echo(&self, unit: &Bound<'_, PyAny>, word: Option<&Bound<'_, PyAny>>) -> PyResult<Asked> {
        let word = word.map(|word| one_word("word", word)).transpose()?;
        let to = any_unit(unit)?.into();
        let options = CallOptions::default();
        Ok(match word {
            Some(word) => self.ask(to, &Request::echo(word), options, round_trip()),
            None => self.send(round_trip(), |then| Errand::echo(to, options, then)),
        })
    }

    #[pyo3(signature = (unit, pdu, reply_length = None, /, *, timeout = None, in_doubt = false, retries = Some(0)))]
    fn transact(
        &self,
        unit: &Bound<'_, PyAny>,
        pdu: &Bound<'_, PyBytes>,
        reply_length: Option<u8>,
        timeout: Option<f64>,
        in_doubt: bool,
        retries: Option<u32>,
    ) -> PyResult<Asked> {
        let request = Request::raw(pdu.as_bytes(), reply_length).map_err(refuse)?;
        let options = read_options(timeout, retries, false)?.in_doubt(in_doubt);
        Ok(self
            .ask(any_unit(unit)?.into(), &request, options, |py, reply, _| Ok(PyBytes::new(py, &reply.pdu).into_any())))
    }

    #[pyo3(signature = (unit, /))]
    fn link(&self, unit: &Bound<'_, PyAny>) -> PyResult<Asked> {
        let unit = any_unit(unit)?;
        self.here_or_asked(self.core.link_if_here(unit).map(shown), move |core| shown(core.link(unit)))
    }

    #[pyo3(signature = (unit, /))]
    fn halts(&self, unit: &Bound<'_, PyAny>) -> PyResult<Asked> {
        let unit = any_unit(unit)?;
        self.here_or_asked(self.core.halts_if_here(unit).map(counted), move |core| counted(core.halts(unit)))
    }

    #[pyo3(signature = (seconds, /))]
    fn sleep(&self, seconds: f64) -> PyResult<Asked> {
        let (core, time) = (Arc::clone(&self.core), duration("seconds", seconds)?);
        apart(&self.inbox, move |wanted| {
            core.sleep(time, &mut || !wanted.load(Ordering::Acquire));
            nothing
        })
    }

    #[pyo3(signature = (seconds, /))]
    fn listen(&self, seconds: f64) -> PyResult<Asked> {
        let (core, time) = (Arc::clone(&self.core), duration("seconds", seconds)?);
        apart(&self.inbox, move |wanted| {
            let heard = Heard::on(&core, time, &mut || !wanted.load(Ordering::Acquire));
            move |py: Python<'_>| Ok(heard.into_python(py, core.name())?.into_pyobject(py)?.into_any())
        })
    }

    fn close(&self) -> PyResult<Asked> {
        let core = Arc::clone(&self.core);
        apart(&self.inbox, move |_| {
            core.close();
            nothing
        })
    }
}

impl Requests {
    /// What is known in this program is told at once; a thread of its own asks another, by `ask`.
    fn here_or_asked<L>(&self, here: Option<L>, ask: impl FnOnce(&CoreBus) -> L + Send + 'static) -> PyResult<Asked>
    where
        L: for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send + 'static,
    {
        let Some(known) = here else {
            let core = Arc::clone(&self.core);
            return apart(&self.inbox, move |_| ask(&core));
        };
        let number = self.inbox.number();
        self.inbox.post(number, known);
        Ok(Asked { number, how: How::Errand(None) })
    }

    fn write_to(
        &self,
        to: Destination,
        table: &str,
        address: &Bound<'_, PyAny>,
        value: &Bound<'_, PyAny>,
        options: CallOptions,
        urgent: bool,
    ) -> PyResult<Asked> {
        let address = one_word("address", address)?;
        let words = words_of(value)?;
        let request = write_request(table, address, &words)?;
        Ok(self.ask(to, &request, options_for(&request, options, urgent), confirmed))
    }

    /// Leaves the request with the bus. `make` makes of the reply what the program gets.
    fn ask(
        &self,
        to: Destination,
        request: &Request<'_>,
        options: CallOptions,
        make: impl for<'py> FnOnce(Python<'py>, Reply, UnixClock) -> PyResult<Bound<'py, PyAny>> + Send + 'static,
    ) -> Asked {
        self.send(make, |then| Errand::new(to, request, options, then))
    }

    /// Leaves what `errand` makes with the bus: it is handed who is told what came of it.
    fn send(
        &self,
        make: impl for<'py> FnOnce(Python<'py>, Reply, UnixClock) -> PyResult<Bound<'py, PyAny>> + Send + 'static,
        errand: impl FnOnce(Then) -> Errand,
    ) -> Asked {
        let (number, inbox) = (self.inbox.number(), Arc::clone(&self.inbox));
        let clock = UnixClock::of(&self.core, self.virtual_ahead);
        let errand = errand(Box::new(move |result| {
            inbox.post(number, move |py| match result {
                Ok(reply) => make(py, reply, clock),
                Err(error) => Err(call_error(&error, clock)),
            });
        }));
        Asked { number, how: How::Errand(self.core.send(errand)) }
    }
}

/// Does `work` in a thread of its own, and posts the letter that it makes.
pub(crate) fn apart<L>(inbox: &Arc<Inbox>, work: impl FnOnce(&AtomicBool) -> L + Send + 'static) -> PyResult<Asked>
where
    L: for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send + 'static,
{
    let (number, wanted) = (inbox.number(), Arc::new(AtomicBool::new(true)));
    let (inbox, asked) = (Arc::clone(inbox), Arc::clone(&wanted));
    thread::Builder::new().name(String::from("drivebus-apart")).spawn(move || inbox.post(number, work(&asked)))?;
    Ok(Asked::apart(number, wanted))
}

/// How long the answer took, in seconds.
fn round_trip() -> impl for<'py> FnOnce(Python<'py>, Reply, UnixClock) -> PyResult<Bound<'py, PyAny>> + Send {
    |py, reply, _| {
        let time = reply.done.ended.saturating_duration_since(reply.done.sent).as_secs_f64();
        Ok(time.into_pyobject(py)?.into_any())
    }
}

/// A link, as the program gets it.
fn shown(link: Link) -> impl for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send {
    move |py| Ok((link.good, link.asked).into_pyobject(py)?.into_any())
}

fn counted(count: u64) -> impl for<'py> FnOnce(Python<'py>) -> PyResult<Bound<'py, PyAny>> + Send {
    move |py| Ok(count.into_pyobject(py)?.into_any())
}

/// The words of the reply to a read, as many as were asked for.
fn words(asked: Expected, reply: &Reply) -> Vec<u16> {
    match asked.judge(&reply.pdu) {
        Ok(Answer::Read { words, .. }) => words.iter().collect(),
        _ => Vec::new(),
    }
}

/// `None`, for what has nothing to tell.
#[expect(clippy::unnecessary_wraps, reason = "a letter, as the others are")]
pub(crate) fn nothing(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    Ok(py.None().into_bound(py))
}

fn confirmed(py: Python<'_>, _: Reply, _: UnixClock) -> PyResult<Bound<'_, PyAny>> {
    nothing(py)
}
