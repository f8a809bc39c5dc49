//! Requests from the bus: judged, carried out, answered.
//!
//! A request is judged as a whole before any of it is done.
//! Assumption: the manual does not say what a drive does with a 10H request of which one word is refused.

use drivebus_rtu::{Adu, Answer, ExceptionCode, Instant, Request, RequestError, Words, function};

use super::addresses as at;
use super::machine::Command;
use super::map::Access;
use super::refusal::Refusal;
use super::{Drive, WRITES_KEPT, WriteRecord};

/// Most words of one read or write (operation manual, sections 9.4.1 and 9.4.4).
const MAX_WORDS: u16 = 16;

/// Where a word goes.
#[derive(Debug, Clone, Copy)]
enum Target {
    /// The 2000H block.
    Control,
    /// A parameter, in RAM and EEPROM.
    Parameter,
    /// A parameter, in RAM only.
    Ram,
}

impl Drive {
    /// Carries out the request in `pdu` at `now`; returns the frame that answers it.
    ///
    /// `None`: the PDU is empty or an exception, so that it is somebody's answer and no request.
    pub(crate) fn handle(&mut self, now: Instant, pdu: &[u8]) -> Option<Adu> {
        self.advance(now);
        let function = *pdu.first().filter(|&&code| code & function::EXCEPTION_BIT == 0)?;
        self.last_heard = Some(now);
        let mut words = [0; MAX_WORDS as usize];
        let answer = match Request::parse(pdu) {
            Ok(request) => self.carry_out(now, &request, &mut words),
            // A range beyond FFFFH is a combination of address and quantity that leaves the valid area.
            Err(RequestError::Range { .. }) => Err(Refusal::Address),
            Err(RequestError::Function { .. }) => Err(Refusal::Function),
            Err(_) => Err(Refusal::Structure),
        };
        let answer = answer.unwrap_or_else(|refusal| Answer::exception(function, refusal.code()));
        Some(Adu::answer(self.unit, &answer))
    }

    /// The word at `address` as the bus would read it at this moment, or the exception code.
    pub(crate) fn read(&self, address: u16) -> Result<u16, ExceptionCode> {
        self.check_unlocked().and_then(|()| self.word(address).ok_or(Refusal::Address)).map_err(Refusal::code)
    }

    /// Sets a parameter at the keypad, for good: checked as on the bus, but no password is asked, and neither the
    /// record of writes nor the EEPROM counter moves.
    pub(crate) fn set_parameter(&mut self, address: u16, word: u16) -> Result<(), ExceptionCode> {
        if !self.map.is_parameter(address) {
            return Err(Refusal::Address.code());
        }
        self.check_write(address, word).map_err(Refusal::code)?;
        self.store.keep(address, word);
        self.settings_may_have_changed();
        Ok(())
    }

    fn carry_out<'a>(
        &mut self,
        now: Instant,
        request: &Request<'_>,
        words: &'a mut [u16; MAX_WORDS as usize],
    ) -> Result<Answer<'a>, Refusal> {
        match *request {
            Request::ReadHolding { address, count, .. } => {
                check_count(count)?;
                self.check_unlocked()?;
                let words = &mut words[..usize::from(count)];
                for (word, offset) in words.iter_mut().zip(0..) {
                    *word = self.word(address.wrapping_add(offset)).ok_or(Refusal::Address)?;
                }
                return Answer::read(words).map_err(|_| Refusal::Structure);
            }
            Request::WriteSingle { address, value, .. } => self.write(now, address, Words::new(&[value]))?,
            Request::WriteMultiple { address, words, .. } => {
                check_count(u16::try_from(words.len()).unwrap_or(u16::MAX))?;
                self.write(now, address, words)?;
            }
            // Assumption: the echo works on a locked drive; it reads and writes nothing.
            Request::Echo { .. } => {}
            Request::Custom { .. } => return Err(Refusal::Function),
        }
        Answer::confirming(request).ok_or(Refusal::Function)
    }

    fn write(&mut self, now: Instant, address: u16, words: Words<'_>) -> Result<(), Refusal> {
        if let (Some(password), at::PASSWORD, 1) = (words.get(0), address & !at::RAM_BIT, words.len()) {
            self.check_password(password)?;
        } else {
            self.check_unlocked()?;
        }
        for (address, word) in (address..).zip(words.iter()) {
            self.check_write(address, word)?;
        }
        for (address, word) in (address..).zip(words.iter()) {
            self.take(now, address, word);
        }
        Ok(())
    }

    /// Assumption: a drive with a password is locked from the moment it is set, and unlocked by writing the right one
    /// to P07.00 (which address takes it is not printed). A write of P07.00 to an unlocked drive sets a new one; 0
    /// removes it.
    fn check_password(&self, password: u16) -> Result<(), Refusal> {
        if self.is_locked() && password != self.parameter(at::PASSWORD) { Err(Refusal::Password) } else { Ok(()) }
    }

    fn is_locked(&self) -> bool {
        self.parameter(at::PASSWORD) != 0 && !self.unlocked
    }

    fn check_unlocked(&self) -> Result<(), Refusal> {
        if self.is_locked() { Err(Refusal::Locked) } else { Ok(()) }
    }

    fn target(&self, address: u16) -> Option<Target> {
        let parameter = address & !at::RAM_BIT;
        match (self.map.has(parameter), address) {
            (false, _) => None,
            (true, at::CONTROL_COMMAND..=at::CONTROL_BLOCK_END) => Some(Target::Control),
            (true, _) if address == parameter => Some(Target::Parameter),
            (true, _) => self.map.is_parameter(parameter).then_some(Target::Ram),
        }
    }

    fn check_write(&self, address: u16, word: u16) -> Result<(), Refusal> {
        self.target(address).ok_or(Refusal::Address)?;
        let plain = address & !at::RAM_BIT;
        match self.map.access(plain) {
            Access::ReadOnly => return Err(Refusal::ReadOnly),
            Access::Stopped if self.machine.is_running() => return Err(Refusal::Running),
            Access::Stopped | Access::Always => {}
        }
        if self.map.allows(plain, word, |bound| self.parameter(bound)) { Ok(()) } else { Err(Refusal::Value) }
    }

    /// Does what `check_write` found right.
    fn take(&mut self, now: Instant, address: u16, word: u16) {
        if self.writes.len() == WRITES_KEPT {
            self.writes.pop_front();
        }
        self.words_written += 1;
        self.writes.push_back(WriteRecord { at: now, address, value: word });

        if address & !at::RAM_BIT == at::PASSWORD && self.is_locked() {
            self.unlocked = true;
            return;
        }
        match self.target(address) {
            Some(Target::Control) => {
                if let Some(control) = self.control.get_mut(usize::from(address - at::CONTROL_COMMAND)) {
                    *control = word;
                }
            }
            Some(Target::Parameter) => self.store.write_eeprom(address, word),
            Some(Target::Ram) => self.store.write_ram(address & !at::RAM_BIT, word),
            None => {}
        }
        if address & !at::RAM_BIT == at::PASSWORD {
            self.unlocked = false;
        }
        self.settings_may_have_changed();
        // Assumption: a command that the drive is not set to obey is taken as a word and changes nothing.
        if address == at::CONTROL_COMMAND
            && self.obeys_bus()
            && let Some(command) = Command::from_code(word)
        {
            self.machine.command(command, &self.settings);
        }
    }
}

fn check_count(count: u16) -> Result<(), Refusal> {
    if (1..=MAX_WORDS).contains(&count) { Ok(()) } else { Err(Refusal::Structure) }
}
