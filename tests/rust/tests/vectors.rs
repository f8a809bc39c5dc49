//! The shared vectors of `tests/vectors`, through the protocol core: encode, decode, refuse, and from the stream.
//!
//! Python runs the same files in `tests/python/test_vectors.py`. The format is explained in `tests/vectors/README.md`.
#![expect(clippy::unwrap_used, clippy::panic, reason = "tests")]

use std::cell::RefCell;
use std::fs;
use std::path::PathBuf;

use drivebus_rtu::{
    Adu, Answer, AnswerError, Destination, ExceptionCode, Frame, FrameError, Framer, Instant, Request, SerialFormat,
    Slave, SlaveEvent, Table, UnitAddress, crc16,
};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    family: String,
    exchange: Vec<Exchange>,
    #[serde(default)]
    template: Vec<Template>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Exchange {
    what: String,
    #[serde(rename = "origin")]
    _origin: Origin,
    source: String,
    #[serde(default, rename = "note")]
    _note: String,
    request: Option<Vector>,
    /// What the answer answers, where no request is printed.
    asked: Option<Fields>,
    answer: Option<Vector>,
}

#[derive(Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum Origin {
    Printed,
    Computed,
    Constructed,
}

/// A frame as it should be, or as it was misprinted beside as it should be.
#[derive(Deserialize)]
#[serde(untagged)]
enum Vector {
    Good { wire: Hex, fields: Fields },
    Misprint { printed: Hex, computed_crc: u16, received_crc: u16, right: Hex, fields: Fields, foreign: Option<bool> },
}

impl Vector {
    fn wire(&self) -> &[u8] {
        match self {
            Self::Good { wire: Hex(bytes), .. } | Self::Misprint { right: Hex(bytes), .. } => bytes,
        }
    }

    fn fields(&self) -> &Fields {
        match self {
            Self::Good { fields, .. } | Self::Misprint { fields, .. } => fields,
        }
    }

    fn is_foreign(&self) -> bool {
        matches!(self, Self::Misprint { foreign: Some(true), .. })
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Template {
    what: String,
    #[serde(rename = "origin")]
    _origin: Origin,
    #[serde(rename = "source")]
    _source: String,
    layout: String,
    fill: Fill,
    filled: Hex,
    filled_origin: Origin,
    fields: Fields,
}

#[derive(Deserialize)]
struct Fill {
    #[serde(rename = "N")]
    n: u8,
    value: u16,
}

/// What a frame's bytes mean, as a person wrote it down.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum Fields {
    Read { unit: u8, address: u16, count: u16 },
    Write { unit: u8, address: u16, value: u16 },
    WriteMany { unit: u8, address: u16, words: Vec<u16> },
    Echo { unit: u8, data: u16 },
    ReadAnswer { unit: u8, words: Vec<u16> },
    WriteManyAnswer { unit: u8, address: u16, count: u16 },
    Exception { unit: u8, function: u8, code: u8 },
}

impl Fields {
    fn request(&self) -> (Destination, Request<'_>) {
        let (unit, request) = match self {
            Self::Read { unit, address, count } => (unit, Request::read(*address, *count).unwrap()),
            Self::Write { unit, address, value } => (unit, Request::write(*address, *value)),
            Self::WriteMany { unit, address, words } => (unit, Request::write_many(*address, words).unwrap()),
            Self::Echo { unit, data } => (unit, Request::echo(*data)),
            other => panic!("{other:?} is no request"),
        };
        (Destination::from_wire(*unit).unwrap(), request)
    }

    fn encode_request(&self) -> Adu {
        let (destination, request) = self.request();
        Adu::request(destination, &request)
    }

    /// The answer's frame. Writes of one word and echoes look alike in both directions.
    fn encode_answer(&self) -> Adu {
        let (unit, answer) = match self {
            Self::ReadAnswer { unit, words } => (unit, Answer::read(words).unwrap()),
            Self::Exception { unit, function, code } => (unit, Answer::exception(*function, ExceptionCode(*code))),
            Self::WriteManyAnswer { unit, address, count } => {
                let words = vec![0; usize::from(*count)];
                let request = Request::write_many(*address, &words).unwrap();
                return Adu::answer(UnitAddress::new(*unit).unwrap(), &Answer::confirming(&request).unwrap());
            }
            Self::Write { unit, .. } | Self::Echo { unit, .. } => {
                (unit, Answer::confirming(&self.request().1).unwrap())
            }
            other => panic!("{other:?} is no answer"),
        };
        Adu::answer(UnitAddress::new(*unit).unwrap(), &answer)
    }

    fn of_request(frame: &Frame<'_>) -> Self {
        let unit = frame.address();
        match Request::parse(frame.pdu()).unwrap() {
            Request::Read { table: Table::Holding, address, count, .. } => Self::Read { unit, address, count },
            Request::WriteSingle { address, value, .. } => Self::Write { unit, address, value },
            Request::WriteMultiple { address, words, .. } => {
                Self::WriteMany { unit, address, words: words.iter().collect() }
            }
            Request::Echo { data, .. } => Self::Echo { unit, data },
            other => panic!("no vector is like {other:?}"),
        }
    }

    fn of_answer(frame: &Frame<'_>) -> Self {
        let unit = frame.address();
        match Answer::parse(frame.pdu()).unwrap() {
            Answer::Read { table: Table::Holding, words, .. } => {
                Self::ReadAnswer { unit, words: words.iter().collect() }
            }
            Answer::WriteSingle { address, value, .. } => Self::Write { unit, address, value },
            Answer::WriteMultiple { address, count, .. } => Self::WriteManyAnswer { unit, address, count },
            Answer::Echo { data, .. } => Self::Echo { unit, data },
            Answer::Exception { function, code, .. } => Self::Exception { unit, function, code: code.0 },
            other => panic!("no vector is like {other:?}"),
        }
    }
}

/// Bytes as they travel, written as pairs of hexadecimal digits.
#[derive(Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
struct Hex(Vec<u8>);

impl TryFrom<String> for Hex {
    type Error = std::num::ParseIntError;

    fn try_from(text: String) -> Result<Self, Self::Error> {
        text.split_whitespace().map(|pair| u8::from_str_radix(pair, 16)).collect::<Result<_, _>>().map(Self)
    }
}

fn read<T: serde::de::DeserializeOwned>(name: &str) -> T {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../vectors").join(name);
    toml::from_str(&fs::read_to_string(&path).unwrap()).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn families() -> Vec<Document> {
    ["gd350.toml", "gd20.toml", "gd600.toml", "gd3000.toml", "vfd500.toml", "starvert.toml"].map(read).into()
}

/// Calls `check` with every exchange, and with words to begin a failure's message.
fn each(mut check: impl FnMut(&Exchange, &str)) {
    for family in families() {
        for exchange in &family.exchange {
            check(exchange, &format!("{}: {} ({})", family.family, exchange.what, exchange.source));
        }
    }
}

#[test]
fn every_worked_example_is_here() {
    let counts: Vec<_> = families().iter().map(|family| family.exchange.len() + family.template.len()).collect();
    // Of the frames known for each family, in the order of `families`.
    assert_eq!(counts, [15, 2, 8, 7, 13, 2]);
    each(|exchange, what| assert!(exchange.request.is_some() || exchange.answer.is_some(), "{what}: no frame"));
}

#[test]
fn crcs() {
    #[derive(Deserialize)]
    struct File {
        crc: Vec<Entry>,
    }
    #[derive(Deserialize)]
    struct Entry {
        what: String,
        data: Hex,
        crc: u16,
        wire: Hex,
    }
    for entry in read::<File>("crc.toml").crc {
        assert_eq!(crc16(&entry.data.0), entry.crc, "{}", entry.what);
        assert_eq!(Hex(entry.crc.to_le_bytes().to_vec()), entry.wire, "{}", entry.what);
    }
}

#[test]
fn requests_encode_and_decode() {
    each(|exchange, what| {
        let Some(request) = &exchange.request else { return };
        assert_eq!(request.fields().encode_request().as_bytes(), request.wire(), "{what}");
        let frame = Frame::parse(request.wire()).unwrap();
        assert_eq!(&Fields::of_request(&frame), request.fields(), "{what}");
    });
}

#[test]
fn answers_encode_and_decode() {
    each(|exchange, what| {
        let Some(answer) = &exchange.answer else { return };
        assert_eq!(answer.fields().encode_answer().as_bytes(), answer.wire(), "{what}");
        let frame = Frame::parse(answer.wire()).unwrap();
        assert_eq!(&Fields::of_answer(&frame), answer.fields(), "{what}");
    });
}

#[test]
fn answers_are_judged_by_what_was_asked() {
    each(|exchange, what| {
        let Some(answer) = &exchange.answer else { return };
        let asked = exchange.request.as_ref().map(Vector::fields).or(exchange.asked.as_ref()).unwrap();
        let (_, request) = asked.request();
        let frame = Frame::parse(answer.wire()).unwrap();
        assert!(request.judge(frame.pdu()).is_ok(), "{what}");

        // The same bytes answer no read of another count, and no other function.
        let other = Request::read(0x0000, 125).unwrap();
        match other.judge(frame.pdu()) {
            Err(AnswerError::Count { .. } | AnswerError::Function { .. }) => {}
            Ok(Answer::Exception { .. }) if frame.pdu()[0] == 0x83 => {}
            verdict => panic!("{what}: taken as the answer to a read of 125 words: {verdict:?}"),
        }
    });
}

#[test]
fn misprints_are_refused_and_both_values_named() {
    let mut misprints = 0;
    each(|exchange, what| {
        for vector in [&exchange.request, &exchange.answer].into_iter().flatten() {
            let Vector::Misprint { printed, computed_crc, received_crc, right, .. } = vector else { continue };
            misprints += 1;
            let error = Frame::parse(&printed.0).unwrap_err();
            assert_eq!(error, FrameError::Crc { computed: *computed_crc, received: *received_crc }, "{what}");
            let message = error.to_string();
            for [low, high] in [computed_crc, received_crc].map(|crc| crc.to_le_bytes()) {
                assert!(message.contains(&format!("{low:02X} {high:02X}")), "{what}: {message}");
            }
            assert_eq!(printed.0.split_last_chunk::<2>().unwrap().0, right.0.split_last_chunk::<2>().unwrap().0);
        }
    });
    // GD350: request and answer of 10H, and the answer with the wrong unit. GD20: the request of 10H. GD600: its answer.
    assert_eq!(misprints, 5);
}

#[test]
fn a_foreign_answer_comes_from_another_unit() {
    let mut foreign = 0;
    each(|exchange, what| {
        let (Some(request), Some(answer)) = (&exchange.request, &exchange.answer) else { return };
        let same_unit =
            Frame::parse(request.wire()).unwrap().address() == Frame::parse(answer.wire()).unwrap().address();
        assert_eq!(same_unit, !answer.is_foreign(), "{what}");
        foreign += usize::from(answer.is_foreign());
    });
    assert_eq!(foreign, 1);
}

/// How a wire image may arrive: noise before it that silence has ended, bytes a chunk, noise after it.
const WAYS: [(&[u8], usize, &[u8]); 5] =
    [(&[], 256, &[]), (&[], 1, &[]), (&[], 256, &[0x00]), (&[], 1, &[0xFF, 0x00]), (&[0xAA, 0x01, 0x03], 256, &[])];

/// Hands `receive` the image in one of the `WAYS`, with moments that keep the rules of the line: no gap inside of it,
/// silence around it. Calls `poll` after each piece until there is nothing more.
fn arrive(
    (before, chunk, after): (&[u8], usize, &[u8]),
    wire: &[u8],
    mut receive: impl FnMut(Instant, &[u8]),
    mut poll: impl FnMut(Instant) -> bool,
) {
    let mut now = Instant::ZERO;
    if !before.is_empty() {
        receive(now, before);
        now = now + SerialFormat::DEFAULT.t35();
        while poll(now) {}
    }
    let image = [wire, after].concat();
    for piece in image.chunks(chunk) {
        receive(now, piece);
        while poll(now) {}
        now = now + SerialFormat::DEFAULT.char_time();
    }
    now = now + SerialFormat::DEFAULT.t35();
    while poll(now) {}
}

#[test]
fn a_unit_hears_every_request_however_it_arrives() {
    each(|exchange, what| {
        let Some(vector) = &exchange.request else { return };
        let (destination, request) = vector.fields().request();
        let unit = match destination {
            Destination::Unit(unit) => unit,
            Destination::Broadcast => UnitAddress::new(1).unwrap(),
        };
        for way in WAYS {
            let slave = RefCell::new(Slave::new(unit, &SerialFormat::DEFAULT));
            let mut heard = 0;
            let poll = |now| match slave.borrow_mut().poll(now) {
                Some(SlaveEvent::Request { request: came, broadcast }) => {
                    assert_eq!(came, request, "{what}, {way:?}");
                    assert_eq!(broadcast, destination == Destination::Broadcast, "{what}, {way:?}");
                    heard += 1;
                    true
                }
                event => event.is_some(),
            };
            arrive(way, vector.wire(), |now, bytes| _ = slave.borrow_mut().receive(now, bytes), poll);
            assert_eq!(heard, 1, "{what}, {way:?}");
        }
    });
}

#[test]
fn a_master_finds_every_answer_however_it_arrives() {
    each(|exchange, what| {
        let Some(vector) = exchange.answer.as_ref().filter(|answer| !answer.is_foreign()) else { return };
        let asked = exchange.request.as_ref().map(Vector::fields).or(exchange.asked.as_ref()).unwrap();
        let (Destination::Unit(unit), request) = asked.request() else { panic!("{what}: a broadcast has no answer") };
        for way in WAYS {
            let framer = RefCell::new(Framer::new(SerialFormat::DEFAULT.t35()));
            framer.borrow_mut().expect(unit, request.expected());
            let mut found = 0;
            let poll = |now| match framer.borrow_mut().poll(now) {
                Some(Ok(frame)) => {
                    assert_eq!(frame.as_bytes(), vector.wire(), "{what}, {way:?}");
                    found += 1;
                    true
                }
                event => event.is_some(),
            };
            arrive(way, vector.wire(), |now, bytes| _ = framer.borrow_mut().receive(now, bytes), poll);
            assert_eq!(found, 1, "{what}, {way:?}");
        }
    });
}

#[test]
fn one_flipped_bit_is_never_a_frame() {
    each(|exchange, what| {
        for vector in [&exchange.request, &exchange.answer].into_iter().flatten() {
            for bit in 0..vector.wire().len() * 8 {
                let mut bytes = vector.wire().to_vec();
                bytes[bit / 8] ^= 1 << (bit % 8);
                assert!(Frame::parse(&bytes).is_err(), "{what}: bit {bit}");
            }
        }
    });
}

#[test]
fn templates_hold_what_they_are_filled_with() {
    for template in families().iter().flat_map(|family| &family.template) {
        let text = template
            .layout
            .replace("{N}", &format!("{:02X}", template.fill.n))
            .replace("{ValH}", &format!("{:02X}", template.fill.value >> 8))
            .replace("{ValL}", &format!("{:02X}", template.fill.value & 0xFF));
        let body = Hex::try_from(text.replace("{CRCL} {CRCH}", "")).unwrap().0;
        let filled = &template.filled.0;
        assert_eq!(filled.split_last_chunk::<2>().unwrap().0, body, "{}", template.what);
        assert!(template.filled_origin == Origin::Constructed, "{}", template.what);
        assert_eq!(template.fields.encode_request().as_bytes(), filled, "{}", template.what);
        assert_eq!(Fields::of_request(&Frame::parse(filled).unwrap()), template.fields, "{}", template.what);
        assert!(matches!(template.fields.request().0, Destination::Broadcast), "{}", template.what);
    }
}
