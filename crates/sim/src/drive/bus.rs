//! Requests from the bus: judged, carried out, answered.
//!
//! A request is judged as a whole before any of it is done.
//! Assumption: the manual does not say what a drive does with a 10H request of which one word is refused.

use drivebus_rtu::huanyang::{Huanyang, Protocol};
use drivebus_rtu::{Adu, Answer, ExceptionCode, Instant, MAX_PDU, Request, RequestError, Table, Words, function};

use super::family::{Memory, OtherWords, Range};
use super::machine::{Command, Direction, RunState};
use super::map::{Access, Word};
use super::places::{spot, table_of};
use super::refusal::Refusal;
use super::settings::other_words;
use super::{Drive, WRITES_KEPT, WriteRecord};

/// The most words that any family takes in one request.
const MOST_WORDS: usize = 125;

/// Where a word goes.
#[derive(Debug, Clone, Copy)]
enum Target {
    /// A register of the bus.
    Control,
    /// A parameter, in RAM and EEPROM.
    Eeprom,
    /// A parameter, in RAM only.
    Ram,
}

impl Drive {
    /// As [`handle`](Self::handle), for a request that is for this unit alone: its answer goes on the line.
    pub(crate) fn answer(&mut self, now: Instant, pdu: &[u8]) -> Option<Adu> {
        let told = self.refusing.as_mut().zip(pdu.first()).and_then(|(told, &function)| told.of(now, function));
        let answer = match told {
            None => self.handle(now, pdu)?,
            Some((code, taken)) => self.refuse_as_told(now, pdu, code, taken)?,
        };
        self.frames.sent = self.frames.sent.wrapping_add(1);
        Some(answer)
    }

    /// Carries out the request in `pdu` at `now`; returns the frame that answers it.
    ///
    /// `None`: the PDU is empty or an exception, so that it is somebody's answer and no request.
    pub(crate) fn handle(&mut self, now: Instant, pdu: &[u8]) -> Option<Adu> {
        if self.family().roles.protocol == Protocol::Huanyang {
            return self.handle_huanyangs(now, pdu);
        }
        let function = self.hear(now, pdu)?;
        let mut words = [0; MOST_WORDS];
        let answer = match Request::parse(pdu) {
            _ if !self.family().functions.contains(&function) => Err(Refusal::Function),
            Ok(request) => self.carry_out(now, &request, &mut words),
            // A range beyond FFFFH is a combination of address and quantity that leaves the valid area.
            Err(RequestError::Range { .. }) => Err(Refusal::Address),
            Err(RequestError::Function { .. }) => Err(Refusal::Function),
            Err(_) => Err(Refusal::Structure),
        };
        let answer = answer.unwrap_or_else(|refusal| Answer::exception(function, self.exception(refusal)));
        Some(Adu::answer(self.unit, &answer))
    }

    /// The same in Huanyang's protocol; on anything else the drive is silent.
    fn handle_huanyangs(&mut self, now: Instant, pdu: &[u8]) -> Option<Adu> {
        let asked = Huanyang::parse(pdu)?;
        self.hear(now, pdu)?;
        let (address, request) = match asked {
            Huanyang::ReadParameter { number } => (0x0100 | u16::from(number), None),
            Huanyang::ReadStatus { number } => (0x0400 | u16::from(number), None),
            Huanyang::WriteParameter { number, value } => (0x0100 | u16::from(number), Some(value)),
            Huanyang::Control { bits } => (0x0300, Some(bits.into())),
            Huanyang::SetFrequency { value } => (0x0500, Some(value)),
        };
        let request = request.map_or(Request::read(address, 1).ok()?, |value| Request::write(address, value));
        let (mut words, mut answer) = ([0; MOST_WORDS], [0; MAX_PDU]);
        let len = if self.carry_out(now, &request, &mut words).is_ok() {
            asked.answer(words[0], self.fits_a_byte(address), self.told_state(), &mut answer)
        } else {
            let refusal = asked.refusal();
            answer[..refusal.len()].copy_from_slice(&refusal);
            refusal.len()
        };
        Some(Adu::answer(self.unit, &Answer::custom(&answer[..len]).ok()?))
    }

    /// Whether no value of the parameter at `address` needs two bytes.
    fn fits_a_byte(&self, address: u16) -> bool {
        match self.map.word(address.into()) {
            Some(Word::Parameter(parameter)) => parameter.bounds.high.is_some_and(|high| high <= 0xFF),
            _ => false,
        }
    }

    /// What the drive does, as it answers a control. D5M manual, p. 72: 0 operation, 1 jogging, 2 reverse, as told; 3 to 5 the same,
    /// as it is.
    fn told_state(&self) -> u8 {
        let is_running = self.machine.is_running();
        let (runs, jogs) = (is_running && !self.machine.is_jogging(), is_running && self.machine.is_jogging());
        let reverse = self.machine.state() == RunState::Reverse;
        let bits = [runs, jogs, reverse].map(u8::from);
        (bits[0] | bits[1] << 1 | bits[2] << 2) * 0b1001
    }

    /// A request has come: its function. `None`: it is none.
    fn hear(&mut self, now: Instant, pdu: &[u8]) -> Option<u8> {
        self.advance(now);
        let function = *pdu.first().filter(|&&code| code & function::EXCEPTION_BIT == 0)?;
        self.last_heard = Some(now);
        self.frames.received = self.frames.received.wrapping_add(1);
        Some(function)
    }

    /// Refuses by `code` what it was told to refuse; if it is `taken`, only behind having done it.
    fn refuse_as_told(&mut self, now: Instant, pdu: &[u8], code: ExceptionCode, taken: bool) -> Option<Adu> {
        let function = if taken {
            let answer = self.handle(now, pdu)?;
            match answer.as_bytes().get(1) {
                Some(&function) if function & function::EXCEPTION_BIT == 0 => function,
                _ => return Some(answer),
            }
        } else {
            self.hear(now, pdu)?
        };
        Some(Adu::answer(self.unit, &Answer::exception(function, code)))
    }

    /// The word at `address` as the bus would read it at this moment, or the exception code.
    pub(crate) fn read(&self, address: u16) -> Result<u16, ExceptionCode> {
        self.check_unlocked().and_then(|()| self.word(address.into())).map_err(|refusal| self.exception(refusal))
    }

    /// Sets a parameter at the keypad, for good: checked as on the bus, but no password is asked, and neither the
    /// record of writes nor the EEPROM counter moves.
    pub(crate) fn set_parameter(&mut self, address: u16, word: u16) -> Result<(), ExceptionCode> {
        let refused = |refusal| self.exception(refusal);
        if !self.map.word(address.into()).is_some_and(Word::is_parameter) {
            return Err(refused(Refusal::Address));
        }
        self.check_word(address.into(), word).map_err(refused)?;
        self.store.keep(address, word);
        self.settings_may_have_changed();
        Ok(())
    }

    fn carry_out<'a>(
        &mut self,
        now: Instant,
        request: &Request<'_>,
        words: &'a mut [u16; MOST_WORDS],
    ) -> Result<Answer<'a>, Refusal> {
        match *request {
            Request::Read { table, address, count, .. } => {
                check_count(count, self.family().max_words)?;
                self.check_unlocked()?;
                self.check_groups(address, count)?;
                self.check_single(address, count)?;
                let words = words.get_mut(..usize::from(count)).ok_or(Refusal::Structure)?;
                let absent = self.family().roles.absent;
                let mut has_any = absent.is_none_or(|absent| absent.alone);
                for (word, offset) in words.iter_mut().zip(0..) {
                    *word = match (self.word(spot(table, address.wrapping_add(offset))), absent) {
                        (Err(Refusal::Address | Refusal::Unreadable), Some(absent)) => absent.word,
                        (read, _) => {
                            has_any = true;
                            read?
                        }
                    };
                }
                if !has_any {
                    return Err(Refusal::Address);
                }
                return Answer::read_of(table, words).map_err(|_| Refusal::Structure);
            }
            Request::WriteSingle { address, value, .. } => {
                let taken = self.limits.get(&address).map_or(value, |&highest| highest.min(value));
                self.write(now, address.into(), Words::new(&[taken]))?;
                return Answer::confirming(&Request::write(address, taken)).ok_or(Refusal::Function);
            }
            Request::WriteCoil { address, on, .. } => {
                self.write(now, spot(Table::Coil, address), Words::new(&[on.into()]))?;
            }
            Request::WriteMultiple { address, words, .. } => {
                let most = self.family().roles.max_written.unwrap_or(self.family().max_words);
                check_count(u16::try_from(words.len()).unwrap_or(u16::MAX), most)?;
                self.write(now, address.into(), words)?;
            }
            // Assumption: the echo works on a locked drive; it reads and writes nothing.
            Request::Echo { .. } => {}
            _ => return Err(Refusal::Function),
        }
        Answer::confirming(request).ok_or(Refusal::Function)
    }

    /// Whether the read of `count` words from `address` on stays where the family lets one stay.
    fn check_groups(&self, address: u16, count: u16) -> Result<(), Refusal> {
        let group = |address: u16| address >> 8;
        let last = address.wrapping_add(count - 1);
        if self.family().across_groups || group(address) == group(last) { Ok(()) } else { Err(Refusal::Address) }
    }

    /// Whether a read of several words has no parameter where one may stand alone only.
    fn check_single(&self, address: u16, count: u16) -> Result<(), Refusal> {
        let is_parameter = |offset| {
            let word = self.map.word(spot(Table::Holding, address.wrapping_add(offset)));
            word.is_some_and(Word::is_parameter)
        };
        let is_free = count == 1 || !self.family().roles.reads_single_parameters;
        if is_free || !(0..count).any(is_parameter) { Ok(()) } else { Err(Refusal::Structure) }
    }

    fn write(&mut self, now: Instant, address: u32, words: Words<'_>) -> Result<(), Refusal> {
        match words.get(0) {
            Some(password) if words.len() == 1 && self.is_password(address) => self.check_password(password)?,
            _ => self.check_unlocked()?,
        }
        let lock = self.family().roles.lock;
        if !self.unlocked && lock.is_some_and(|lock| lock.at != address) {
            return Err(Refusal::Locked);
        }
        for (address, word) in (address..).zip(words.iter()) {
            self.target(address).ok_or(Refusal::Address)?;
            self.check_word(self.plain(address), word)?;
        }
        for (address, word) in (address..).zip(words.iter()) {
            self.take(now, address, word);
        }
        Ok(())
    }

    /// Assumption: a drive with a password is locked from the moment it is set, and unlocked by writing the right one
    /// to the parameter that holds it (which address takes it is not printed). A write to an unlocked drive sets a new
    /// one; 0 removes it.
    fn check_password(&self, password: u16) -> Result<(), Refusal> {
        if self.is_locked() && password != self.password() { Err(Refusal::Password) } else { Ok(()) }
    }

    pub(super) fn is_password(&self, address: u32) -> bool {
        self.family().roles.password.map(u32::from) == Some(self.plain(address))
    }

    fn password(&self) -> u16 {
        self.role(self.family().roles.password)
    }

    fn is_locked(&self) -> bool {
        !self.unlocked && self.password() != 0
    }

    fn check_unlocked(&self) -> Result<(), Refusal> {
        if self.is_locked() { Err(Refusal::Locked) } else { Ok(()) }
    }

    /// The address at which is read what is written at `address`.
    pub(super) fn plain(&self, address: u32) -> u32 {
        match table_of(address) {
            (Table::Holding, _) => self.family().memory.plain(address),
            _ => address,
        }
    }

    fn target(&self, address: u32) -> Option<Target> {
        let plain = self.plain(address);
        match (self.map.word(plain)?, self.family().memory, address == plain) {
            (Word::Register(_), _, true) => Some(Target::Control),
            (Word::Register(_), _, false) | (Word::Parameter(_), Memory::EepromOnly, false) => None,
            (Word::Parameter(_), Memory::BitMeansRam(_) | Memory::BitsMeanEeprom(_), false)
            | (Word::Parameter(_), Memory::BitMeansEeprom(_), true)
            | (Word::Parameter(_), Memory::RamUntil(..), _) => Some(Target::Ram),
            (Word::Parameter(_), _, _) => Some(Target::Eeprom),
        }
    }

    /// Whether `word` may be written to what stands at `address`, which is a plain one.
    fn check_word(&self, address: u32, word: u16) -> Result<(), Refusal> {
        let target = self.map.word(address).ok_or(Refusal::Address)?;
        match target.access() {
            Access::ReadOnly => return Err(Refusal::ReadOnly),
            Access::Stopped if self.machine.is_running() => return Err(Refusal::Running),
            Access::Stopped | Access::Always | Access::WriteOnly => {}
        }
        let family = self.family();
        let fits = match target {
            Word::Parameter(parameter) => parameter.bounds.allows(word, |bound| self.parameter(bound)),
            Word::Register(_) if family.takes_commands(address) => {
                self.meant(address, self.control_word(address), word).is_some()
            }
            Word::Register(register) => match register.range {
                Range::Words(low, high) => (low..=high).contains(&word),
                Range::UpTo(high, bound) => word <= high.min(self.parameter(bound)),
                Range::Signed(low, high) => (low..=high).contains(&word.cast_signed()),
                Range::Speed => family.roles.speed.as_ref().is_some_and(|speed| {
                    let scale = speed.scale(|parameter| self.store.get(parameter));
                    scale.bounds.allows(word, |bound| self.parameter(bound))
                }),
                Range::Within(bounds) => bounds.allows(word, |bound| self.parameter(bound)),
            },
        };
        if fits { Ok(()) } else { Err(Refusal::Value) }
    }

    /// What `word` at `address` commands, in the words that the drive is set to take.
    fn meant(&self, address: u32, before: u16, word: u16) -> Option<Command> {
        let family = self.family();
        match self.other_words().filter(|_| family.takes_commands(address)) {
            Some(other) => Some((other.decode)(before, word)),
            None => family.command_at(address, before, word),
        }
    }

    /// The other meaning of its commands, where the drive is set to that.
    fn other_words(&self) -> Option<OtherWords> {
        other_words(self.family(), &self.store)
    }

    /// What `word` at `address` tells the machine. A run turns the way that another word says, where a family has one, and
    /// so does a motor that runs when that word changes.
    fn command_at(&self, address: u32, before: u16, word: u16) -> Option<Command> {
        let direction = self.family().roles.direction;
        let turns =
            direction.map(
                |(place, reverse)| {
                    if self.control_word(place) == reverse { Direction::Reverse } else { Direction::Forward }
                },
            );
        let runs = || matches!(self.machine.state(), RunState::Forward | RunState::Reverse);
        match (self.meant(address, before, word), turns) {
            (Some(Command::Run(_)), Some(turns)) => Some(Command::Run(turns)),
            (None, Some(turns)) if direction.is_some_and(|(place, _)| place == address) && runs() => {
                Some(Command::Run(turns))
            }
            (command, _) => command,
        }
    }

    /// Does what was found right.
    fn take(&mut self, now: Instant, address: u32, word: u16) {
        if self.writes.len() == WRITES_KEPT {
            self.writes.pop_front();
        }
        self.words_written += 1;
        let (table, plain) = (table_of(address).0, table_of(self.plain(address)).1);
        self.writes.push_back(WriteRecord { at: now, table, address: table_of(address).1, value: word });

        if self.is_password(address) && self.is_locked() {
            self.unlocked = true;
            return;
        }
        let family = self.map.family();
        if let Some(lock) = family.roles.lock {
            let locks = family.command == Some(address) && word & lock.again != 0;
            self.unlocked = !locks && (self.unlocked || address == lock.at);
        }
        let address = match (family.roles.direction, family.roles.direction_words) {
            (Some((place, _)), Some(words)) if family.command == Some(address) && words.contains(&word) => place,
            _ => address,
        };
        let before = self.control_word(address);
        let (stores, word) = match self.family().memory {
            Memory::RamUntil(at, bits) if at == address => (bits == 0 || word & bits != 0, word & !bits),
            _ => (false, word),
        };
        match self.target(address) {
            Some(Target::Control) => {
                if let Some(control) = self.map.control(address).and_then(|place| self.control.get_mut(place)) {
                    *control = word;
                }
            }
            Some(Target::Eeprom) => self.store.write_eeprom(plain, word),
            Some(Target::Ram) => self.store.write_ram(plain, word),
            None => {}
        }
        if stores {
            self.store.keep_all();
        }
        if self.is_password(address) {
            self.unlocked = false;
        }
        self.settings_may_have_changed();
        if self.family().roles.runs_after.contains(&address) {
            self.may_run = true;
            if let Some(run) = self.waiting.take() {
                self.machine.command(run, &self.settings);
            }
        }
        // Assumption: a command that the drive is not set to obey is taken as a word and changes nothing.
        if self.obeys_bus()
            && let Some(command) = self.command_at(address, before, word)
        {
            self.obey(address, word, command);
        }
    }

    /// Does a command, where a run needs words before it only if these came in their order.
    ///
    /// Assumption: while it runs, a word of those that means nothing else changes nothing, and a run that follows another is obeyed
    /// at once.
    fn obey(&mut self, address: u32, word: u16, command: Command) {
        let family = self.map.family();
        let handshake =
            family.roles.handshake.as_ref().filter(|_| family.command == Some(address) && self.other_words().is_none());
        if let Some(handshake) = handshake {
            let is_running = self.machine.is_running();
            match command {
                Command::Run(_) | Command::Jog(_) if !is_running && !handshake.is_through(self.led_up) => return,
                Command::Run(_) | Command::Jog(_) => {}
                _ if self.machine.fault().is_some() && command != Command::ResetFault => return,
                Command::Nothing if is_running => return,
                _ => match handshake.after(self.led_up, word) {
                    Some(led_up) => self.led_up = led_up,
                    None => return,
                },
            }
        }
        let is_start = matches!(command, Command::Run(_) | Command::Jog(_)) && !self.machine.is_running();
        let must_wait = is_start && !self.may_run && !self.family().roles.runs_after.is_empty();
        self.waiting = must_wait.then_some(command);
        if !must_wait {
            self.machine.command(command, &self.settings);
        }
    }
}

fn check_count(count: u16, most: u16) -> Result<(), Refusal> {
    if (1..=most).contains(&count) { Ok(()) } else { Err(Refusal::Structure) }
}
