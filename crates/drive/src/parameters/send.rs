//! Writes that are allowed, on their way: alone or by one request, and what is remembered of where they are kept.

use drivebus_drives::Store;

use super::not_kept::{InForce, WhyNotKept};
use super::plan::Planned;
use crate::families::Families;
use crate::record::Record;
use crate::task::{LineError, Mailbox, Notice, Payload, Read};
use crate::unit::Unit;
use crate::writing::{NotWritten, Words};

type Why<E> = WhyNotKept<E>;

impl Unit {
    /// Sends the writes of `run`, whose addresses follow each other, by one request; to EEPROM only what that has not, by as few
    /// requests as it takes. `done` gets the names of what the drive then has.
    pub(crate) async fn keep<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        run: &[Planned<'_>],
        store: Store,
        done: &mut Vec<String>,
    ) -> Result<(), Why<E>> {
        if store == Store::Ram || !run.iter().all(Planned::is_parameter) {
            for item in run.iter().filter(|item| item.is_parameter()) {
                self.record().put_in_ram(item.key());
            }
            return self.send_run(line, families, run, true, done).await;
        }
        // What stays in RAM until all is stored needs no more than to be there.
        let stays = self.profile().store_word().is_some();
        // What is read is what is in force. It tells about EEPROM only if RAM was not written since.
        let held = self.words_of(line, run).await.map_err(Why::Failed)?;
        let (mut from, mut is_told) = (0, true);
        for (at, (item, words)) in run.iter().zip(held).enumerate() {
            if words == item.words && (stays || !self.record().is_in_ram(item.key())) {
                self.store(line, families, &run[from..at], is_told, done).await?;
                done.push(item.name.to_owned());
                (from, is_told) = (at + 1, true);
            } else {
                is_told &= words != item.words;
            }
        }
        self.store(line, families, &run[from..], is_told, done).await
    }

    /// Writes `run` to EEPROM; whether reading would tell that EEPROM took it, `is_told` says: what is in force already, from
    /// RAM, reads the same in any case.
    async fn store<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        run: &[Planned<'_>],
        is_told: bool,
        done: &mut Vec<String>,
    ) -> Result<(), Why<E>> {
        if run.is_empty() {
            return Ok(());
        }
        if self.profile().store_word().is_some() {
            for item in run {
                self.record().put_in_ram(item.key());
            }
            return self.send_run(line, families, run, is_told, done).await;
        }
        self.send_run(line, families, run, is_told, done).await?;
        for item in run {
            self.note_stored(line, item.key()).await;
        }
        Ok(())
    }

    pub(super) async fn note_stored<E: LineError>(&self, line: &Mailbox<E>, key: &str) {
        let times = self.record().stored(key);
        if times >= Record::STORES_BEFORE_NOTICE {
            let name = key.to_owned();
            line.taken_for(self.address(), self.family()).tell(Notice::Stored { name, times }).await;
        }
    }

    /// Sends `run` by one request, whose confirmation is looked for by reading where that `is_told` by it.
    async fn send_run<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        run: &[Planned<'_>],
        is_told: bool,
        done: &mut Vec<String>,
    ) -> Result<(), Why<E>> {
        let Some(first) = run.first() else { return Ok(()) };
        let read_back = self.profile().read_back(&first.entry).filter(|_| is_told).map(|place| place.address);
        let all: Vec<u16> = run.iter().flat_map(|item| &item.words).copied().collect();
        let payload = if let [one] = all[..] { Payload::Word(one) } else { Payload::Words(all) };
        // A drive that says that it is busy may have begun to do what it was told.
        let acts = self.profile().acting().any(|entry| entry.name() == first.key());
        let words = Words { is_absolute: !acts, ..Words::value(first.place, payload, read_back) };
        let names = run.iter().map(|item| item.name.to_owned());
        let Err(why) = self.write(line, families, &words).await else {
            done.extend(names);
            return Ok(());
        };
        // Whether a drive takes none of the words then, or those before the wrong one, is not printed.
        let is_open = run.len() > 1 && matches!(&why, NotWritten::Failed(error) if error.cause().is_refusal());
        let in_force = if is_open { Some(self.in_force(line, run).await) } else { None };
        Err(Why::NotWritten { names: names.collect(), why, in_force })
    }

    async fn in_force<E: LineError>(&self, line: &Mailbox<E>, run: &[Planned<'_>]) -> InForce<E> {
        match self.words_of(line, run).await {
            Ok(words) => InForce::Shown(run.iter().zip(words).map(|(item, words)| item.held(&words)).collect()),
            Err(error) => InForce::Unread(error),
        }
    }

    /// What the drive has of each of `run`, by one read.
    async fn words_of<E>(&self, line: &Mailbox<E>, run: &[Planned<'_>]) -> Result<Vec<Vec<u16>>, E> {
        // What may be written has an address, and what shares a request fits into one.
        let first = run.first().and_then(|item| item.entry.place());
        let count: u16 = run.iter().map(|item| item.entry.words()).sum();
        let Some(first) = first else { return Ok(Vec::new()) };
        let read = Read::words(self.address(), first, count);
        let mut words = line.taken_for(self.address(), self.family()).read(read).await?.into_iter();
        Ok(run.iter().map(|item| words.by_ref().take(item.words.len()).collect()).collect())
    }
}
