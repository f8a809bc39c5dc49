//! What clients may do: by network, then unit, then function, then register or command. Whatever is not let pass here never
//! reaches the line.
//!
//! Nothing here knows what a word means to a drive: whoever makes the rules says which words move a motor, and which halt it.

use std::collections::BTreeMap;
use std::net::IpAddr;

use drivebus_rtu::{AnswerLength, Destination, ExceptionCode, Request, Table, Touched, UnitAddress};

use crate::gateway::network::Network;
use crate::options::LastWill;

/// Reads of the specification V1.1b3, §6.1 to §6.4.
pub const READS: [u8; 4] = [0x01, 0x02, 0x03, 0x04];
/// Its writes that say what they write: §6.5, §6.6, §6.11 and §6.12. A mask and a write with a read are let pass by no rule.
pub const WRITES: [u8; 4] = [WRITE_COIL, WRITE_SINGLE, WRITE_COILS, WRITE_MULTIPLE];
const WRITE_COIL: u8 = 0x05;
const WRITE_SINGLE: u8 = 0x06;
const WRITE_COILS: u8 = 0x0F;
const WRITE_MULTIPLE: u8 = 0x10;

/// What clients may do, and what is known of the units for that.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Rights {
    /// What is allowed: what any of these allows.
    pub rules: Vec<Rule>,
    /// The units that can be halted.
    pub units: BTreeMap<u8, Halts>,
}

/// Reads of the units 1 to 247, to everybody.
impl Default for Rights {
    fn default() -> Self {
        Self::new(vec![Rule { functions: READS.to_vec(), ..Rule::default() }])
    }
}

impl Rights {
    /// What `rules` allow.
    pub const fn new(rules: Vec<Rule>) -> Self {
        Self { rules, units: BTreeMap::new() }
    }

    /// Whether a client may move a motor.
    pub(super) fn moves_any(&self) -> bool {
        self.rules.iter().flat_map(|rule| &rule.writes).any(|write| write.means == Means::Moves)
    }
}

/// What some clients may do to some units.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Rule {
    /// Whose clients; none: everybody's.
    pub networks: Vec<Network>,
    /// Which units; none: 1 to 247. 0, which is all of them, and 248 to 255 only where they are listed.
    pub units: Vec<u8>,
    /// By which function codes. A stop goes by any that writes.
    pub functions: Vec<u8>,
    /// What may be written.
    pub writes: Vec<Writable>,
}

impl Rule {
    /// What everybody may do to the units 1 to 247 by `functions`.
    pub fn new(functions: Vec<u8>) -> Self {
        Self { functions, ..Self::default() }
    }

    /// Sets [`networks`](Self#structfield.networks).
    #[must_use]
    pub fn networks(self, networks: Vec<Network>) -> Self {
        Self { networks, ..self }
    }

    /// Sets [`units`](Self#structfield.units).
    #[must_use]
    pub fn units(self, units: Vec<u8>) -> Self {
        Self { units, ..self }
    }

    /// Sets [`writes`](Self#structfield.writes).
    #[must_use]
    pub fn writes(self, writes: Vec<Writable>) -> Self {
        Self { writes, ..self }
    }
}

/// A place that may be written, and what that does.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Writable {
    /// Coils or holding registers.
    pub table: Table,
    /// Where.
    pub address: u16,
    /// Which words; `None`: any.
    pub words: Option<Vec<u16>>,
    /// What it does.
    pub means: Means,
    /// What people call it.
    pub name: String,
    /// Where the word that it replaces can be read.
    pub shown_at: Option<u16>,
}

impl Writable {
    /// Any word at `address`, which sets something.
    pub fn new(table: Table, address: u16, name: impl Into<String>) -> Self {
        Self { table, address, words: None, means: Means::Sets, name: name.into(), shown_at: None }
    }

    /// Sets [`words`](Self#structfield.words).
    #[must_use]
    pub fn words(self, words: impl Into<Option<Vec<u16>>>) -> Self {
        Self { words: words.into(), ..self }
    }

    /// Sets [`means`](Self#structfield.means).
    #[must_use]
    pub fn means(self, means: Means) -> Self {
        Self { means, ..self }
    }

    /// Sets [`shown_at`](Self#structfield.shown_at).
    #[must_use]
    pub fn shown_at(self, shown_at: impl Into<Option<u16>>) -> Self {
        Self { shown_at: shown_at.into(), ..self }
    }
}

/// What a write does, as far as that decides whether and how it goes out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Means {
    /// It sets something.
    Sets,
    /// It wears the memory of the unit, and may be done seldom. `instead`: where it would not.
    Wears {
        /// The address of the same in RAM.
        instead: Option<u16>,
    },
    /// It halts the motor.
    Stops,
    /// It may move a motor.
    Moves,
}

/// How a unit is halted.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Halts {
    /// The writes by which clients do it: allowed to each who may write anything to the unit.
    pub stops: Vec<Writable>,
    /// How it is done for a client that is gone.
    pub will: LastWill,
}

impl Halts {
    /// By `stops`, and for a client that is gone by `will`.
    pub const fn new(stops: Vec<Writable>, will: LastWill) -> Self {
        Self { stops, will }
    }
}

/// What becomes of one request.
#[derive(Debug, PartialEq)]
pub(super) enum Judged<'a> {
    /// It may be asked.
    Read(Destination, Request<'a>),
    /// It may be written.
    Write(Destination, Written),
    /// It is not allowed, for people: what is not.
    Refused(String),
    /// It cannot be one of the protocol.
    Wrong(ExceptionCode),
}

/// What a write that may go out writes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Written {
    pub(super) table: Table,
    pub(super) address: u16,
    pub(super) words: Vec<u16>,
    pub(super) names: Vec<String>,
    /// What the strongest of its words does.
    pub(super) means: Means,
    /// The places that wear, and where they would not.
    pub(super) wears: Vec<(u16, Option<u16>)>,
    /// From where on what it replaces can be read.
    pub(super) shown_at: Option<u16>,
}

impl Rights {
    /// Judges what a client at `host` asks of `unit`.
    ///
    /// A read has the form that the specification gives it: what has another may be a write, as 02H and 03H are in Huanyang's
    /// own protocol.
    pub(super) fn judge<'a>(&self, host: IpAddr, unit: u8, pdu: &'a [u8]) -> Judged<'a> {
        let applies = |rule: &&Rule| {
            let is_unit = if rule.units.is_empty() { (1..=247).contains(&unit) } else { rule.units.contains(&unit) };
            is_unit && (rule.networks.is_empty() || rule.networks.iter().any(|network| network.has(host)))
        };
        let rules: Vec<&Rule> = self.rules.iter().filter(applies).collect();
        let destination = match unit {
            0 => Destination::Broadcast,
            _ => UnitAddress::by_name(unit).into(),
        };
        match (pdu, request_of(pdu)) {
            _ if rules.is_empty() => Judged::Refused(format!("may not ask unit {unit}")),
            ([function, ..], Some(request @ Request::Read { .. })) if unit != 0 => {
                if rules.iter().any(|rule| rule.functions.contains(function)) {
                    Judged::Read(destination, request)
                } else {
                    Judged::Refused(format!("may not read unit {unit} by function {function:02X}H"))
                }
            }
            // A count or a range that no unit has, in the right form.
            ([0x01..=0x04, _, _, _, _], None) if unit != 0 => Judged::Wrong(ExceptionCode::ILLEGAL_VALUE),
            ([function, ..], request) if WRITES.contains(function) => {
                match (self.written(&rules, unit, pdu), request) {
                    (Ok(written), Some(_)) => Judged::Write(destination, written),
                    (Err(why), _) => Judged::Refused(why),
                    // Whoever may write nothing hears that, and not what is wrong with it.
                    (_, None) => Judged::Wrong(ExceptionCode::ILLEGAL_VALUE),
                }
            }
            ([function, ..], _) => {
                Judged::Refused(format!("may not ask unit {unit} function {function:02X}H in this form"))
            }
            ([], _) => Judged::Refused(format!("asked unit {unit} nothing")),
        }
    }

    /// What `pdu` writes to `unit`, if `rules` allow all of it; `Err`: what they do not.
    fn written(&self, rules: &[&Rule], unit: u8, pdu: &[u8]) -> Result<Written, String> {
        let stops: &[Writable] = match self.units.get(&unit) {
            Some(halts) if rules.iter().any(|rule| !rule.writes.is_empty()) => &halts.stops,
            _ => &[],
        };
        let by_function = || rules.iter().filter(|rule| rule.functions.contains(&pdu[0])).flat_map(|rule| &rule.writes);
        let (table, first, words) = Touched::by(pdu)
            .and_then(|touched| Some((touched.table, touched.address, touched.written()?.collect::<Vec<_>>())))
            .filter(|(_, _, words)| !words.is_empty())
            .ok_or_else(|| format!("may not write to unit {unit} in this form"))?;
        let mut of_each = Vec::with_capacity(words.len());
        for (offset, &word) in (0_u16..).zip(&words) {
            let address = first.wrapping_add(offset);
            let here = |write: &&Writable| {
                (write.table, write.address) == (table, address)
                    && write.words.as_ref().is_none_or(|words| words.contains(&word))
            };
            // What is a command is one, whatever else a rule has there.
            let found = stops.iter().chain(by_function()).filter(here).max_by_key(|write| write.means);
            of_each.push(found.ok_or_else(|| {
                let coil = if table == Table::Coil { "coil " } else { "" };
                format!("may not write {word} to {coil}{address:04X}H of unit {unit} by function {:02X}H", pdu[0])
            })?);
        }
        let wears = of_each.iter().filter_map(|write| match write.means {
            Means::Wears { instead } => Some((write.address, instead)),
            _ => None,
        });
        let shown_at = of_each[0].shown_at.filter(|&start| {
            (0_u16..).zip(&of_each).all(|(offset, write)| write.shown_at == start.checked_add(offset))
        });
        Ok(Written {
            table,
            address: first,
            names: of_each.iter().map(|write| write.name.clone()).collect(),
            means: of_each.iter().map(|write| write.means).max().unwrap_or(Means::Sets),
            wears: wears.collect(),
            shown_at,
            words,
        })
    }
}

/// The request that `pdu` is, in the form of the specification; one that switches several coils (§6.11) is answered by five
/// bytes.
pub(super) fn request_of(pdu: &[u8]) -> Option<Request<'_>> {
    let &[WRITE_COILS, ref rest @ ..] = pdu else { return Request::parse(pdu).ok() };
    let &[a1, a0, c1, c0, bytes, ref data @ ..] = rest else { return None };
    let (address, count) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([c1, c0]));
    let is_whole = (1..=1968).contains(&count)
        && u32::from(address) + u32::from(count) <= 0x1_0000
        && data.len() == usize::from(bytes)
        && data.len() == usize::from(count).div_ceil(8);
    is_whole.then(|| Request::custom(pdu, AnswerLength::Bytes(5)).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;
    use proptest::sample::{Index, subsequence};

    use super::*;

    const HERE: IpAddr = IpAddr::V4(std::net::Ipv4Addr::LOCALHOST);

    fn reads_only(unit: u8, pdu: &[u8]) -> Judged<'_> {
        Rights::default().judge(HERE, unit, pdu)
    }

    #[test]
    fn reserved_units_are_not_asked_unless_they_are_listed() {
        let asked = |rights: &Rights| -> Vec<u8> {
            let read = |&unit: &u8| matches!(rights.judge(HERE, unit, &[3, 0, 0, 0, 1]), Judged::Read(..));
            (0..=255).filter(read).collect()
        };
        assert_eq!(asked(&Rights::default()), (1..=247).collect::<Vec<u8>>());
        let listed = Rule { units: vec![0, 7, 250], functions: READS.to_vec(), ..Rule::default() };
        assert_eq!(asked(&Rights::new(vec![listed])), [7, 250], "nobody answers for all of them");
    }

    #[test]
    fn a_request_that_cannot_be_is_told_from_what_is_not_allowed() {
        let wrong = Judged::Wrong(ExceptionCode::ILLEGAL_VALUE);
        assert_eq!(reads_only(1, &[3, 0, 0, 0, 126]), wrong);
        assert_eq!(reads_only(1, &[4, 0xFF, 0xFF, 0, 2]), wrong);
        assert!(matches!(reads_only(1, &[3, 1, 8]), Judged::Refused(_)));
        let writes = vec![anything(Table::Holding, 0, Means::Sets), anything(Table::Coil, 0, Means::Sets)];
        let rights = Rights::new(vec![Rule { functions: WRITES.to_vec(), writes, ..Rule::default() }]);
        for pdu in [
            &[0x10, 0, 0, 0, 2, 2, 0, 1][..],
            &[0x10, 0, 0, 0, 1, 4, 0, 1],
            &[5, 0, 0, 0, 1],
            &[15, 0, 0, 0, 1, 2, 1, 0],
        ] {
            assert_eq!(rights.judge(HERE, 1, pdu), wrong, "{pdu:02X?}");
        }
        for pdu in [&[0x10, 0, 0, 0, 1, 2, 0, 1][..], &[15, 0, 0, 0, 1, 1, 1]] {
            assert!(matches!(rights.judge(HERE, 1, pdu), Judged::Write(..)), "{pdu:02X?}");
        }
        for pdu in [&[0x16, 0, 0, 0, 1, 0, 1][..], &[0x17, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0, 1], &[0x10, 0, 0], &[6]] {
            assert!(matches!(rights.judge(HERE, 1, pdu), Judged::Refused(_)), "{pdu:02X?}");
        }
    }

    fn anything(table: Table, address: u16, means: Means) -> Writable {
        Writable { table, address, words: None, means, name: String::new(), shown_at: None }
    }

    #[test]
    fn a_stop_is_for_everybody_who_may_write_anything_there() {
        let stop = Writable { words: Some(vec![5]), ..anything(Table::Holding, 0x2000, Means::Stops) };
        let run = Writable { words: Some(vec![1]), ..anything(Table::Holding, 0x2000, Means::Moves) };
        let will = LastWill::new(UnitAddress::by_name(1), vec![]);
        let judge = |rule: Rule, words: &[u16]| {
            let mut rights = Rights::new(vec![Rule { functions: READS.to_vec(), ..Rule::default() }, rule]);
            rights.units.insert(1, Halts { stops: vec![stop.clone()], will: will.clone() });
            let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
            let count = u8::try_from(words.len()).unwrap();
            match rights.judge(HERE, 1, &[&[0x10, 0x20, 0, 0, count, 2 * count][..], &bytes].concat()) {
                Judged::Write(_, written) => Some(written.means),
                _ => None,
            }
        };
        let setpoint = || Rule { writes: vec![anything(Table::Holding, 0x2001, Means::Sets)], ..Rule::default() };
        assert_eq!(judge(Rule::default(), &[5]), None, "who may only read may not stop");
        assert_eq!(judge(setpoint(), &[5]), Some(Means::Stops), "whatever the function");
        assert_eq!(judge(setpoint(), &[5, 100]), None, "the setpoint is not allowed by 10H");
        assert_eq!(judge(Rule { functions: vec![0x10], ..setpoint() }, &[5, 100]), Some(Means::Stops));
        assert_eq!(judge(Rule { functions: vec![0x10], ..setpoint() }, &[1, 100]), None);
        let runs = Rule {
            functions: vec![0x10],
            writes: vec![run, anything(Table::Holding, 0x2001, Means::Sets)],
            ..Rule::default()
        };
        assert_eq!(judge(runs.clone(), &[1, 100]), Some(Means::Moves));
        assert_eq!(judge(runs, &[6]), None);
    }

    /// What some networks may: few enough of everything that rules meet.
    fn rules() -> impl Strategy<Value = Vec<Rule>> {
        let network = prop::sample::select(vec!["10.0.0.0/8", "10.0.0.1", "192.168.0.0/16", "0.0.0.0/0"]);
        let write = (any::<bool>(), 0_u16..4, prop::option::of(vec(0_u16..3, 1..3)), any::<bool>()).prop_map(
            |(is_coil, address, words, moves)| Writable {
                words,
                ..anything(
                    if is_coil { Table::Coil } else { Table::Holding },
                    address,
                    if moves { Means::Moves } else { Means::Sets },
                )
            },
        );
        let functions = subsequence(vec![1, 2, 3, 4, 5, 6, 15, 16, 22, 23], 0..=10);
        let rule = (vec(network, 0..2), subsequence(vec![0_u8, 1, 2, 248], 0..=4), functions, vec(write, 0..4))
            .prop_map(|(networks, units, functions, writes)| {
                let networks = networks.into_iter().map(|text| text.parse().unwrap()).collect();
                Rule { networks, units, functions, writes }
            });
        vec(rule, 0..4)
    }

    fn requests() -> impl Strategy<Value = Vec<u8>> {
        let plain = (0_u8..26, 0_u16..4, 0_u16..4).prop_map(|(function, address, second)| {
            [&[function][..], &address.to_be_bytes(), &second.to_be_bytes()].concat()
        });
        let words = (0_u16..4, vec(0_u16..3, 1..4)).prop_map(|(address, words)| {
            let count = u8::try_from(words.len()).unwrap();
            let data: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
            [&[16][..], &address.to_be_bytes(), &[0, count, 2 * count], &data].concat()
        });
        let coils = (0_u16..4, 1_u8..4, any::<u8>())
            .prop_map(|(address, count, bits)| [&[15][..], &address.to_be_bytes(), &[0, count, 1, bits]].concat());
        prop_oneof![plain, words, coils, vec(any::<u8>(), 1..8)]
    }

    /// What the rules say, worked out the long way round: each place and word by itself, from the bytes.
    fn may(rules: &[Rule], host: [u8; 4], unit: u8, pdu: &[u8]) -> bool {
        let inside = |network: &Network| match network.to_string().as_str() {
            "10.0.0.0/8" => host[0] == 10,
            "10.0.0.1/32" => host == [10, 0, 0, 1],
            "192.168.0.0/16" => host[..2] == [192, 168],
            other => other == "0.0.0.0/0",
        };
        let word = |at: usize| u16::from(pdu[at]) * 256 + u16::from(pdu[at + 1]);
        let places: Vec<(Table, u16, u16)> = match (pdu[0], pdu.len()) {
            (1..=4, 5) => vec![],
            (5, 5) if [0, 0xFF00].contains(&word(3)) => vec![(Table::Coil, word(1), u16::from(word(3) > 0))],
            (6, 5) => vec![(Table::Holding, word(1), word(3))],
            (15, 7) if (1..=8).contains(&word(3)) && pdu[5] == 1 => {
                (0..word(3)).map(|bit| (Table::Coil, word(1).wrapping_add(bit), u16::from(pdu[6]) >> bit & 1)).collect()
            }
            (16, length) if length > 6 && length == 6 + usize::from(pdu[5]) && pdu[5] == pdu[4] * 2 && pdu[3] == 0 => {
                (0..word(3))
                    .map(|at| (Table::Holding, word(1).wrapping_add(at), word(6 + 2 * usize::from(at))))
                    .collect()
            }
            _ => return false,
        };
        let mine = |rule: &&Rule| {
            (rule.networks.is_empty() || rule.networks.iter().any(inside))
                && (rule.units.contains(&unit) || rule.units.is_empty() && unit != 0 && unit != 248)
                && rule.functions.contains(&pdu[0])
        };
        let rules: Vec<&Rule> = rules.iter().filter(mine).collect();
        if places.is_empty() {
            return unit != 0 && !rules.is_empty() && (1..=100).contains(&word(3)) && word(1) < 100;
        }
        places.iter().all(|&(table, address, value)| {
            rules.iter().flat_map(|rule| &rule.writes).any(|write| {
                write.table == table
                    && write.address == address
                    && write.words.iter().all(|words| words.contains(&value))
            })
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4_000))]

        #[test]
        fn what_the_rules_say(rules in rules(), hosts in any::<Index>(), units in any::<Index>(), pdu in requests()) {
            let host = *hosts.get(&[[10, 0, 0, 1], [10, 9, 0, 1], [192, 168, 3, 4], [203, 0, 113, 7]]);
            let unit = *units.get(&[0, 1, 2, 3, 248]);
            let passes = matches!(Rights::new(rules.clone()).judge(host.into(), unit, &pdu), Judged::Read(..) | Judged::Write(..));
            prop_assume!(!(1..=4).contains(&pdu[0]) || pdu.len() != 5 || (pdu[1] == 0 && pdu[2] < 100 && pdu[3] == 0 && pdu[4] <= 100));
            prop_assert_eq!(passes, may(&rules, host, unit, &pdu));
        }

        /// Where nothing else is said, against the specification V1.1b3, §6.1 to §6.4, in other words.
        #[test]
        fn only_reads_pass(unit: u8, pdu in prop_oneof![
            vec(any::<u8>(), 1..8),
            (1_u8..=6, 0_u16.., 0_u16..2100).prop_map(|(function, address, count)| {
                [&[function][..], &address.to_be_bytes(), &count.to_be_bytes()].concat()
            }),
        ]) {
            let most = |function| if function < 3 { 2000 } else { 125 };
            let is_read = match *pdu {
                [function @ 1..=4, a1, a0, c1, c0] => {
                    let (address, count) = (u16::from_be_bytes([a1, a0]), u16::from_be_bytes([c1, c0]));
                    (1..=most(function)).contains(&count) && u32::from(address) + u32::from(count) <= 0x1_0000
                }
                _ => false,
            };
            let passes = !matches!(reads_only(unit, &pdu), Judged::Refused(_) | Judged::Wrong(_));
            prop_assert_eq!(passes, is_read && (1..=247).contains(&unit));
        }
    }
}
