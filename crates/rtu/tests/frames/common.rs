//! Arbitrary requests and answers, owned so that proptest can keep them.

use drivebus_rtu::*;
use proptest::prelude::*;

#[derive(Debug, Clone)]
pub(crate) enum Owned {
    Read(u16, u16),
    Write(u16, u16),
    Echo(u16),
    Many(u16, Vec<u16>),
    Words(Vec<u16>),
    ReadOf(Table, u16, u16),
    WordsOf(Table, Vec<u16>),
    Coil(u16, bool),
    Confirm(u16, u16),
    Exception(u8, u8),
    Custom(Vec<u8>),
}

pub(crate) struct OwnedRequest(pub(crate) Owned);
pub(crate) struct OwnedAnswer(pub(crate) Owned);

impl std::fmt::Debug for OwnedRequest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl std::fmt::Debug for OwnedAnswer {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl OwnedRequest {
    pub(crate) fn borrow(&self) -> Request<'_> {
        match &self.0 {
            Owned::Read(address, count) => Request::read(*address, *count).unwrap(),
            Owned::Write(address, value) => Request::write(*address, *value),
            Owned::ReadOf(table, address, count) => Request::read_of(*table, *address, *count).unwrap(),
            Owned::Coil(address, on) => Request::write_coil(*address, *on),
            Owned::Echo(data) => Request::echo(*data),
            Owned::Many(address, words) => Request::write_many(*address, words).unwrap(),
            Owned::Custom(pdu) => Request::custom(pdu, AnswerLength::BySilence).unwrap(),
            other => unreachable!("{other:?}"),
        }
    }
}

impl OwnedAnswer {
    pub(crate) fn borrow(&self) -> Answer<'_> {
        match &self.0 {
            Owned::Words(words) => Answer::read(words).unwrap(),
            Owned::WordsOf(table, words) => Answer::read_of(*table, words).unwrap(),
            Owned::Coil(address, on) => Answer::confirming(&Request::write_coil(*address, *on)).unwrap(),
            Owned::Write(address, value) => Answer::confirming(&Request::write(*address, *value)).unwrap(),
            Owned::Echo(data) => Answer::confirming(&Request::echo(*data)).unwrap(),
            Owned::Confirm(address, count) => {
                Answer::confirming(&Request::write_many(*address, &vec![0; usize::from(*count)]).unwrap()).unwrap()
            }
            Owned::Exception(function, code) => Answer::exception(*function, ExceptionCode(*code)),
            Owned::Custom(pdu) => Answer::custom(pdu).unwrap(),
            other => unreachable!("{other:?}"),
        }
    }
}

fn words(max: usize) -> impl Strategy<Value = Vec<u16>> {
    prop::collection::vec(any::<u16>(), 1..=max)
}

fn tables() -> impl Strategy<Value = Table> {
    prop::sample::select(&Table::ALL[..])
}

/// Whole bytes of bits: how many of the last byte were asked for, an answer does not tell.
fn words_of(table: Table) -> impl Strategy<Value = Owned> {
    let words = if table.is_bits() {
        prop::collection::vec(prop::collection::vec(0..=1_u16, 8), 1..=250).prop_map(|bytes| bytes.concat()).boxed()
    } else {
        words(125).boxed()
    };
    words.prop_map(move |words| Owned::WordsOf(table, words))
}

fn custom() -> impl Strategy<Value = Owned> {
    (0x41..=0x48_u8, prop::collection::vec(any::<u8>(), 1..=252))
        .prop_map(|(function, data)| Owned::Custom([vec![function], data].concat()))
}

pub(crate) fn requests() -> impl Strategy<Value = OwnedRequest> {
    prop_oneof![
        (0..=0xFF00_u16, 1..=125_u16).prop_map(|(address, count)| Owned::Read(address, count)),
        (tables(), 0..=0xF000_u16, 1..=2000_u16).prop_map(|(table, address, count)| Owned::ReadOf(
            table,
            address,
            count.min(table.max_read())
        )),
        any::<(u16, bool)>().prop_map(|(address, on)| Owned::Coil(address, on)),
        any::<(u16, u16)>().prop_map(|(address, value)| Owned::Write(address, value)),
        any::<u16>().prop_map(Owned::Echo),
        (0..=0xFF00_u16, words(123)).prop_map(|(address, words)| Owned::Many(address, words)),
        custom(),
    ]
    .prop_map(OwnedRequest)
}

pub(crate) fn answers() -> impl Strategy<Value = OwnedAnswer> {
    prop_oneof![
        words(125).prop_map(Owned::Words),
        tables().prop_flat_map(words_of),
        any::<(u16, bool)>().prop_map(|(address, on)| Owned::Coil(address, on)),
        any::<(u16, u16)>().prop_map(|(address, value)| Owned::Write(address, value)),
        any::<u16>().prop_map(Owned::Echo),
        (0..=0xFF00_u16, 1..=123_u16).prop_map(|(address, count)| Owned::Confirm(address, count)),
        (0..0x80_u8, any::<u8>()).prop_map(|(function, code)| Owned::Exception(function, code)),
        custom(),
    ]
    .prop_map(OwnedAnswer)
}

/// A request with an answer that a unit could give to it. Few addresses and values, so that strangers often fit.
pub(crate) fn exchanges() -> impl Strategy<Value = Exchange> {
    let small = || 0..3_u16;
    prop_oneof![
        (small(), prop::collection::vec(small(), 1..=3)).prop_map(|(address, words)| (
            Owned::Read(address, u16::try_from(words.len()).unwrap()),
            Owned::Words(words)
        )),
        (tables(), small(), prop::collection::vec(0..=1_u16, 1..=17)).prop_map(|(table, address, words)| (
            Owned::ReadOf(table, address, u16::try_from(words.len()).unwrap()),
            Owned::WordsOf(table, words)
        )),
        (small(), any::<bool>()).prop_map(|(address, on)| (Owned::Coil(address, on), Owned::Coil(address, on))),
        (small(), small()).prop_map(|(address, value)| (Owned::Write(address, value), Owned::Write(address, value))),
        small().prop_map(|data| (Owned::Echo(data), Owned::Echo(data))),
        (small(), prop::collection::vec(small(), 1..=3)).prop_map(|(address, words)| {
            let count = u16::try_from(words.len()).unwrap();
            (Owned::Many(address, words), Owned::Confirm(address, count))
        }),
    ]
    .prop_map(|(request, answer)| Exchange(OwnedRequest(request), OwnedAnswer(answer)))
}

#[derive(Debug)]
pub(crate) struct Exchange(OwnedRequest, OwnedAnswer);

impl Exchange {
    pub(crate) fn borrow(&self) -> (Request<'_>, Answer<'_>) {
        (self.0.borrow(), self.1.borrow())
    }
}
