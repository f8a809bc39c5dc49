//! A family, as a unit is told to be of it or not: its profile, and what is worked out of that once.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use drivebus_drives::{Access, Command, Entry, Identification, Place, Profile, Signature, State, Table};
use drivebus_rtu::huanyang::Protocol;
use drivebus_rtu::{ExceptionCode, Meaning, Meanings};

use crate::answer::{Answer, is_no_such_address, meanings, protocol};
use crate::codes::{self, Codes};

/// The commands that end a motion, in the order of who else may stand in for one that a family lacks.
pub const HALTS: [Command; 3] = [Command::Stop, Command::Coast, Command::JogStop];

/// One family of drives, by what its units answer and refuse.
///
/// Get one of [`Families`](crate::Families). It never changes, and is shared freely.
#[derive(Debug)]
pub struct Family {
    profile: Arc<Profile>,
    codes: Arc<Codes>,
    /// Whether one of the families that its units report as is shipped.
    is_shipped: bool,
    meanings: Meanings,
    protocol: Protocol,
    /// The exceptions that its documents list; empty where they list none.
    exceptions: BTreeSet<u8>,
    signature: Option<Signature>,
    code_place: Option<Place>,
    is_listed: bool,
    state_place: Option<Place>,
    answered: BTreeSet<Place>,
    refused: BTreeSet<Place>,
    telling: Vec<Place>,
    /// Where its units take commands, and what each word means there.
    command_registers: BTreeMap<Place, BTreeMap<u16, String>>,
    halts: BTreeSet<(Place, u16)>,
    groups: BTreeSet<u8>,
}

impl Family {
    /// What is worked out of `profile`, with the `codes` that all shipped profiles list.
    ///
    /// `signature` is that of its family, which an overlay without its own one has, too.
    pub(crate) fn new(
        profile: Arc<Profile>,
        codes: Arc<Codes>,
        signature: Option<&Signature>,
        is_shipped: bool,
    ) -> Self {
        let signature = profile.signature().or(signature).cloned();
        let code_place = codes::place_of(&profile);
        let own = |row: &Identification| row.family == profile.family();
        let is_listed = profile.identifications().iter().any(own) || codes.has_family(profile.family());
        let state_place = profile.role("state").and_then(Entry::place);
        let asked_code = code_place.filter(|_| is_listed);
        let (answers, refuses) =
            signature.as_ref().map_or((&[][..], &[][..]), |known| (known.answers.as_slice(), known.refuses.as_slice()));

        let printed = profile.entries().filter(|entry| entry.verified() && entry.access() != Access::Wo);
        let mut answered: BTreeSet<_> = printed.filter_map(Entry::place).collect();
        answered.extend(answers.iter().copied().chain(asked_code));

        let mut telling = Vec::new();
        for place in asked_code.into_iter().chain([answers, refuses].concat()).chain(state_place) {
            if !telling.contains(&place) {
                telling.push(place);
            }
        }
        Self {
            is_shipped,
            meanings: meanings(&profile),
            protocol: protocol(&profile),
            exceptions: profile.exceptions().map(|row| row.code).collect(),
            code_place,
            is_listed,
            state_place,
            answered,
            refused: refuses.iter().copied().collect(),
            telling,
            command_registers: command_registers(&profile),
            halts: HALTS.into_iter().filter_map(|command| profile.command(command)).collect(),
            groups: profile.unlisted_groups().collect(),
            signature,
            profile,
            codes,
        }
    }

    /// Its profile.
    pub fn profile(&self) -> &Arc<Profile> {
        &self.profile
    }

    /// The name of its profile: `gd350`.
    pub fn name(&self) -> &str {
        self.profile.name()
    }

    /// Which protocol its units speak.
    pub fn protocol(&self) -> Protocol {
        self.protocol
    }

    /// Where its units keep their identification code; `None` if they have none, or nobody knows where.
    pub fn code_place(&self) -> Option<Place> {
        self.code_place
    }

    /// Whether its profile or a shipped one lists a code of the family.
    pub fn is_listed(&self) -> bool {
        self.is_listed
    }

    /// How its units are told by what they answer and refuse; that of the family below where an overlay has none.
    pub fn signature(&self) -> Option<&Signature> {
        self.signature.as_ref()
    }

    /// What is listed of the code `word` at `place`: the rows of its own profile, then those of the shipped ones.
    pub fn rows(&self, place: Place, word: u16) -> impl Iterator<Item = &Identification> {
        let own = self.profile.identifications().iter();
        own.filter(move |row| row.code == word && self.code_place == Some(place)).chain(self.codes.rows(place, word))
    }

    /// Whether `word` at `place` is a code of a family that its units report as.
    pub fn is_own(&self, place: Place, word: u16) -> bool {
        self.rows(place, word).any(|row| codes::is_own(&self.profile, row))
    }

    /// Whether `answers` have all of its signature: each word that its units answer, and a refusal of each other. Not so
    /// where it has none.
    pub fn is_signed_by(&self, answers: &[Answer]) -> bool {
        let Some(Signature { answers: answered, refuses, .. }) = &self.signature else {
            return false;
        };
        // Of two answers to one question the later one counts.
        let said = |place: &Place| answers.iter().rfind(|each| each.place == *place).map(|each| each.word().is_some());
        answered.iter().all(|place| said(place) == Some(true)) && refuses.iter().all(|place| said(place) == Some(false))
    }

    /// Whether its units say by the exception `code` that they have no such address.
    pub fn lacks_address(&self, code: ExceptionCode) -> bool {
        is_no_such_address(&self.profile, code)
    }

    /// Whether its units say by the exception `code` that there is nothing at `place`: no such address, or no function that
    /// reads its table.
    pub(crate) fn lacks_place(&self, place: Place, code: ExceptionCode) -> bool {
        let has_no_table = place.table != Table::Holding && code == ExceptionCode::ILLEGAL_FUNCTION;
        has_no_table || self.lacks_address(code)
    }

    /// Whether `answer` is a refusal that passes, and so tells nothing of one of its units.
    pub fn is_put_off_by(&self, answer: Answer) -> bool {
        let means_later = |code| self.meanings.of(code) == Meaning::AskAgain;
        answer.passes() || answer.exception().is_some_and(means_later)
    }

    /// What its units say by the exception `code`.
    pub fn meaning_of(&self, code: ExceptionCode) -> Meaning {
        self.meanings.of(code)
    }

    /// Whether one of the families that its units report as is among the shipped ones.
    pub(crate) fn is_shipped(&self) -> bool {
        self.is_shipped
    }

    /// Whether its documents list exceptions, and not this one.
    pub(crate) fn never_says(&self, code: ExceptionCode) -> bool {
        !self.exceptions.is_empty() && !self.exceptions.contains(&code.0)
    }

    /// The codes that are listed anywhere.
    pub(crate) fn codes(&self) -> &Codes {
        &self.codes
    }

    /// The place of the word that says what its motor does.
    pub(crate) fn state_place(&self) -> Option<Place> {
        self.state_place
    }

    /// Whether `word` at its state's place is one that its profile knows.
    pub(crate) fn knows_state(&self, word: u16) -> bool {
        self.profile.state(word) != State::Unknown
    }

    /// Whether each of its units answers at `place`, as its own documents print.
    pub(crate) fn answers(&self, place: Place) -> bool {
        self.answered.contains(&place)
    }

    /// Whether none of its units answers at `place`.
    pub(crate) fn refuses(&self, place: Place) -> bool {
        self.refused.contains(&place)
    }

    /// Whether its profile has anything at `place`.
    pub(crate) fn has(&self, place: Place) -> bool {
        self.profile.entry_at(place).is_some()
    }

    /// The places that show one of its units, in the order in which they are asked for.
    pub(crate) fn telling(&self) -> &[Place] {
        &self.telling
    }

    /// The places and words that end a motion.
    pub(crate) fn halts(&self) -> &BTreeSet<(Place, u16)> {
        &self.halts
    }

    /// Whether its units take commands at `place`.
    pub(crate) fn commands_at(&self, place: Place) -> bool {
        self.command_registers.contains_key(&place) || self.profile.is_command(place)
    }

    /// The registers that take commands, with the words that the family defines there and what they mean.
    pub(crate) fn command_registers(&self) -> &BTreeMap<Place, BTreeMap<u16, String>> {
        &self.command_registers
    }

    /// Whether `place` is where its units may have a parameter, by the rule of their addresses.
    pub(crate) fn may_have_parameter(&self, place: Place) -> bool {
        let [group, _] = place.address.to_be_bytes();
        place.table == Table::Holding && self.groups.contains(&group)
    }

    /// Whether its units have something at `place`, or answer 0 there where they have nothing.
    pub(crate) fn would_answer(&self, place: Place) -> bool {
        let [group, _] = place.address.to_be_bytes();
        self.has(place) || place.table == Table::Holding && self.profile.requests().zeros.contains(&group)
    }

    /// The place and the word of `command`; `None` where it has no such command.
    pub(crate) fn command(&self, command: Command) -> Option<(Place, u16)> {
        self.profile.command(command)
    }
}

fn command_registers(profile: &Profile) -> BTreeMap<Place, BTreeMap<u16, String>> {
    let owned = |codes: BTreeMap<u16, &str>| codes.into_iter().map(|(code, name)| (code, name.to_owned())).collect();
    profile.command_registers().into_iter().map(|(place, codes)| (place, owned(codes))).collect()
}
