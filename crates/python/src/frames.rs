//! Frames without a line: encode, judge, take apart, and the CRC.

use drivebus_drive::huanyang;
use drivebus_rtu::huanyang::{has_form, is_sure};
use drivebus_rtu::{
    Adu, Answer, AnswerLength, Destination, Frame, Request, Table, Touched, UnitAddress, crc16 as crc,
    frame_len as len_of, function,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

use crate::convert::{any_unit, bytes_of, destination, one_word, unit_address, words_of};
use crate::errors::{answer_error, frame_error, refuse, refused};

/// CRC-16/MODBUS of any bytes-like object. By position only, as `zlib.crc32`: a name costs a fifth of the call.
#[pyfunction]
#[pyo3(signature = (data, /))]
pub(crate) fn crc16(data: &Bound<'_, PyAny>) -> PyResult<u16> {
    // The usual case, without so much as a reference count.
    if let Ok(bytes) = data.cast::<PyBytes>() {
        return Ok(crc(bytes.as_bytes()));
    }
    Ok(crc(bytes_of(data)?.as_bytes()))
}

/// How many bytes at the front of any bytes-like object are a whole frame.
#[pyfunction]
#[pyo3(signature = (data, /))]
pub(crate) fn frame_len(data: &Bound<'_, PyAny>) -> PyResult<Option<usize>> {
    Ok(len_of(bytes_of(data)?.as_bytes()))
}

/// Whether the PDU of a request may change something in the unit; of what is no request nobody knows.
#[pyfunction]
#[pyo3(signature = (pdu, /))]
pub(crate) fn is_write(pdu: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(custom(bytes_of(pdu)?.as_bytes()).is_none_or(|request| request.is_write()))
}

/// Whether the PDU of a request has the form of a read.
#[pyfunction]
#[pyo3(signature = (pdu, /))]
pub(crate) fn only_reads(pdu: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(custom(bytes_of(pdu)?.as_bytes()).is_some_and(|request| request.only_reads()))
}

fn custom(pdu: &[u8]) -> Option<Request<'_>> {
    Request::custom(pdu, AnswerLength::BySilence).ok()
}

/// First place, how many, and the words that are written.
type Places = (u32, u16, Option<Vec<u16>>);

/// What the PDU of a request reads or writes.
#[pyfunction]
#[pyo3(signature = (pdu, /))]
pub(crate) fn touched(pdu: &Bound<'_, PyAny>) -> PyResult<Option<Places>> {
    let bytes = bytes_of(pdu)?;
    Ok(Touched::by(bytes.as_bytes()).map(|touched| {
        let table = if touched.table == Table::Holding { 0 } else { u32::from(touched.table.function()) };
        (table << 16 | u32::from(touched.address), touched.count, touched.written().map(Iterator::collect))
    }))
}

/// A whole 03H request frame.
#[pyfunction]
pub(crate) fn encode_read<'py>(
    py: Python<'py>,
    unit: &Bound<'py, PyAny>,
    address: &Bound<'py, PyAny>,
    count: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyBytes>> {
    let request = Request::read(one_word("address", address)?, one_word("count", count)?).map_err(refuse)?;
    Ok(frame(py, unit_address(unit)?.into(), &request))
}

/// A whole 06H or 10H request frame.
#[pyfunction]
pub(crate) fn encode_write<'py>(
    py: Python<'py>,
    unit: &Bound<'py, PyAny>,
    address: &Bound<'py, PyAny>,
    value: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyBytes>> {
    let (to, address) = (destination(unit)?, one_word("address", address)?);
    match words_of(value)? {
        Err(value) => Ok(frame(py, to, &Request::write(address, value))),
        Ok(words) => Ok(frame(py, to, &Request::write_many(address, &words).map_err(refuse)?)),
    }
}

/// A whole 08H/0000 request frame.
#[pyfunction]
pub(crate) fn encode_echo<'py>(
    py: Python<'py>,
    unit: &Bound<'py, PyAny>,
    word: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyBytes>> {
    Ok(frame(py, unit_address(unit)?.into(), &Request::echo(one_word("word", word)?)))
}

fn frame<'py>(py: Python<'py>, to: Destination, request: &Request<'_>) -> Bound<'py, PyBytes> {
    PyBytes::new(py, Adu::request(to, request).as_bytes())
}

/// The words that a frame answers to a request, or None for a confirmation.
#[pyfunction]
pub(crate) fn decode_answer<'py>(
    request: &Bound<'py, PyAny>,
    frame: &Bound<'py, PyAny>,
) -> PyResult<Option<Bound<'py, PyList>>> {
    let py = frame.py();
    let (asked, came) = (bytes_of(request)?, bytes_of(frame)?);
    let (asked, came) = (asked.as_bytes(), came.as_bytes());
    let request = Frame::parse(asked).map_err(refuse)?;
    let unit = UnitAddress::new(request.address()).map_err(refuse)?;
    let request = Request::parse(request.pdu()).map_err(refuse)?;
    let answer = Frame::parse(came).map_err(|error| frame_error(error, came))?;
    let judged = request.expected().judge_frame(unit, &answer);
    match judged.and_then(|by_itself| match by_itself {
        Answer::Custom { .. } => request.judge(answer.pdu()),
        named => Ok(named),
    }) {
        Ok(Answer::Read { words, .. }) => PyList::new(py, words.iter()).map(Some),
        Ok(Answer::Exception { function, code, .. }) => {
            let message = format!("unit {unit} refused function {function:02X}H with exception {:02X}H", code.0);
            Err(refused(&message, code, |keywords| {
                keywords.set_item("unit", unit.get())?;
                keywords.set_item("request", PyBytes::new(keywords.py(), asked))?;
                keywords.set_item("raw", PyBytes::new(keywords.py(), came))
            }))
        }
        Ok(_) => Ok(None),
        Err(error) => Err(answer_error(error, asked, came)),
    }
}

/// Any frame of either direction as fields.
#[pyfunction]
pub(crate) fn decode<'py>(py: Python<'py>, frame: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
    let bytes = bytes_of(frame)?;
    let bytes = bytes.as_bytes();
    let frame = Frame::parse(bytes).map_err(|error| frame_error(error, bytes))?;
    let fields = PyDict::new(py);
    fields.set_item("unit", frame.address())?;
    fields.set_item("crc", crc(&bytes[..bytes.len() - 2]))?;
    let kind = match (Request::parse(frame.pdu()), Answer::parse(frame.pdu())) {
        (Ok(Request::Read { table, address, count, .. }), _) => {
            set_table(&fields, table)?;
            fields.set_item("address", address)?;
            fields.set_item("count", count)?;
            "read"
        }
        (Ok(Request::WriteCoil { address, on, .. }), _) => {
            set_table(&fields, Table::Coil)?;
            fields.set_item("address", address)?;
            fields.set_item("value", u16::from(on))?;
            "write"
        }
        (Ok(Request::WriteSingle { address, value, .. }), _) => {
            fields.set_item("address", address)?;
            fields.set_item("value", value)?;
            "write"
        }
        (Ok(Request::Echo { data, .. }), _) => {
            fields.set_item("data", data)?;
            "echo"
        }
        (Ok(Request::WriteMultiple { address, words, .. }), _) => {
            fields.set_item("address", address)?;
            fields.set_item("count", words.len())?;
            fields.set_item("words", PyList::new(py, words.iter())?)?;
            "write_many"
        }
        (_, Ok(Answer::Read { table, words, .. })) => {
            set_table(&fields, table)?;
            fields.set_item("count", words.len())?;
            fields.set_item("words", PyList::new(py, words.iter())?)?;
            "read_answer"
        }
        (_, Ok(Answer::WriteMultiple { address, count, .. })) => {
            fields.set_item("address", address)?;
            fields.set_item("count", count)?;
            "write_many_answer"
        }
        (_, Ok(Answer::Exception { code, .. })) => {
            fields.set_item("code", code.0)?;
            "exception"
        }
        _ => {
            fields.set_item("pdu", PyBytes::new(py, frame.pdu()))?;
            "other"
        }
    };
    fields.set_item("kind", kind)?;
    fields.set_item("function", frame.pdu().first().map(|code| code & !function::EXCEPTION_BIT))?;
    Ok(fields)
}

/// Names the table, where it is not that of the holding registers.
fn set_table(fields: &Bound<'_, PyDict>, table: Table) -> PyResult<()> {
    if table == Table::Holding { Ok(()) } else { fields.set_item("table", table.name()) }
}

/// Whether a master and whether a unit may have sent a frame, and what is wrong inside.
#[pyfunction]
pub(crate) fn judge(frame: &Bound<'_, PyAny>) -> PyResult<(bool, bool, Option<String>)> {
    let bytes = bytes_of(frame)?;
    let bytes = bytes.as_bytes();
    let frame = Frame::parse(bytes).map_err(|error| frame_error(error, bytes))?;
    let Some(wrong) = frame.wrong_inside() else { return Ok((frame.may_ask(), frame.may_answer(), None)) };
    let is_request = wrong.is_request();
    Ok((is_request == Some(true), is_request == Some(false), Some(wrong.to_string())))
}

/// Why a frame does not answer a request of the same unit and function, in words.
#[pyfunction]
pub(crate) fn misses(request: &Bound<'_, PyAny>, frame: &Bound<'_, PyAny>) -> PyResult<Option<String>> {
    let (asked, came) = (bytes_of(request)?, bytes_of(frame)?);
    let (asked, came) = (asked.as_bytes(), came.as_bytes());
    let asked = Frame::parse(asked).map_err(|error| frame_error(error, asked))?;
    let came = Frame::parse(came).map_err(|error| frame_error(error, came))?;
    Ok(came.misses(&asked).map(|why| why.to_string()))
}

/// Where the whole frames in a row of bytes stand.
#[pyfunction]
#[pyo3(signature = (data, /))]
pub(crate) fn frames_in(data: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, usize)>> {
    let bytes = bytes_of(data)?;
    Ok(drivebus_rtu::frames_in(bytes.as_bytes()).map(|range| (range.start, range.end)).collect())
}

/// The same, and those that are surely of Huanyang's own protocol.
#[pyfunction]
#[pyo3(signature = (data, /))]
pub(crate) fn all_frames_in(data: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, usize)>> {
    let bytes = bytes_of(data)?;
    Ok(huanyang::frames_in(bytes.as_bytes()).into_iter().map(|range| (range.start, range.end)).collect())
}

/// Whether `data` is a whole frame of Huanyang's own protocol, and whether it is surely none of Modbus.
#[pyfunction]
#[pyo3(signature = (data, /))]
pub(crate) fn huanyang_form(data: &Bound<'_, PyAny>) -> PyResult<(bool, bool)> {
    let bytes = bytes_of(data)?;
    Ok((has_form(bytes.as_bytes()), is_sure(bytes.as_bytes())))
}

/// Whether `data`, which came where `unit` was asked, may hold an answer of it.
#[pyfunction]
#[pyo3(signature = (unit, data, /))]
pub(crate) fn may_be_of(unit: &Bound<'_, PyAny>, data: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(huanyang::may_be_of(any_unit(unit)?, bytes_of(data)?.as_bytes()))
}
