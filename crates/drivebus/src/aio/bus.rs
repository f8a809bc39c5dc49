//! The bus whose calls are futures.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use drivebus_drive::task::{Outcome, Read, Step, Task, Wish};
use drivebus_drive::{Identification, Look, Looks};
use drivebus_drives::Place;
use drivebus_line::{CallOptions as LineOptions, DeviceIdentification, DeviceQuestion, Reply, Stats};
use drivebus_rtu::{Destination, Instant, Request, UnitAddress};

use super::asked::Asked;
use super::poll::Poll;
use crate::builder::Builder;
use crate::bus::once;
use crate::checks;
use crate::error::Error;
use crate::operations;
use crate::options::CallOptions;
use crate::payload::Payload;
use crate::poll::Target;
use crate::reading::{Reading, Values};
use crate::replies;

/// One line with drives on it, whose calls are futures. The calls are those of [`drivebus::Bus`](crate::Bus), and so is
/// what they say of errors.
#[derive(Debug, Clone)]
pub struct Bus(crate::Bus);

impl From<crate::Bus> for Bus {
    fn from(bus: crate::Bus) -> Self {
        Self(bus)
    }
}

impl Bus {
    /// Opens `port` with the usual settings; [`open_as`](Self::open_as) takes others.
    pub fn open(port: &str) -> Asked<Self> {
        Self::open_as(Builder::default(), port)
    }

    /// Opens `port` as `builder` says.
    pub fn open_as(builder: Builder, port: &str) -> Asked<Self> {
        let port = port.to_owned();
        Asked::apart(move |wanted| builder.open_while(&port, &mut || wanted.load(Ordering::Acquire)).map(Self))
    }

    /// The same bus for who waits in a thread: what it tells at once is asked there.
    pub fn blocking(&self) -> &crate::Bus {
        &self.0
    }

    /// Reads `count` words: as [`Bus::read`](crate::Bus::read).
    pub fn read(&self, unit: u8, address: impl Into<Place>, count: u16) -> Asked<Vec<u16>> {
        self.read_with(unit, address, count, CallOptions::new())
    }

    /// As [`Bus::read_with`](crate::Bus::read_with).
    pub fn read_with(&self, unit: u8, address: impl Into<Place>, count: u16, options: CallOptions) -> Asked<Vec<u16>> {
        let place = address.into();
        let checked = || {
            let (unit, request) = (checks::unit(unit)?, checks::read(place, count)?);
            Ok((unit.into(), request, options.of(&request)?))
        };
        self.ask(checked(), move |reply| replies::words_of(&reply, count))
    }

    /// Writes a word or a sequence of words: as [`Bus::write`](crate::Bus::write).
    pub fn write<'a>(&self, unit: u8, address: impl Into<Place>, value: impl Into<Payload<'a>>) -> Asked<()> {
        self.write_with(unit, address, value, CallOptions::new())
    }

    /// As [`Bus::write_with`](crate::Bus::write_with).
    pub fn write_with<'a>(
        &self,
        unit: u8,
        address: impl Into<Place>,
        value: impl Into<Payload<'a>>,
        options: CallOptions,
    ) -> Asked<()> {
        let (place, payload) = (address.into(), value.into());
        let checked = || {
            let (unit, request) = (checks::unit(unit)?, checks::write(place, &payload)?);
            Ok((unit.into(), request, options.of(&request)?))
        };
        self.ask(checked(), drop)
    }

    /// Writes to every unit at once: as [`Bus::broadcast`](crate::Bus::broadcast).
    pub fn broadcast<'a>(&self, address: u16, value: impl Into<Payload<'a>>) -> Asked<()> {
        let payload = value.into();
        let checked = || Ok((Destination::Broadcast, checks::write(address.into(), &payload)?, LineOptions::default()));
        self.ask(checked(), drop)
    }

    /// How long `unit` takes to send a word back: as [`Bus::echo`](crate::Bus::echo).
    pub fn echo(&self, unit: u8) -> Asked<Duration> {
        let time = |reply: Reply| reply.done.ended.saturating_duration_since(reply.done.sent);
        match checks::unit(unit) {
            Ok(unit) => Asked::echo(&self.0.core, unit.into(), LineOptions::default(), time),
            Err(error) => Asked::refused(error),
        }
    }

    /// Who made `unit` and what it is: as [`Bus::device_identification`](crate::Bus::device_identification).
    ///
    /// # Errors
    ///
    /// Those of [`Bus::device_identification`](crate::Bus::device_identification).
    pub async fn device_identification(&self, unit: u8) -> Result<DeviceIdentification, Error> {
        let mut question = DeviceQuestion::new();
        while let Some(request) = question.request() {
            let checked = || Ok((checks::unit(unit)?.into(), request, LineOptions::default()));
            match self.ask(checked(), |reply| reply.pdu).await {
                Ok(pdu) => question.heard(&pdu),
                Err(error) => replies::asks_less(&mut question, error)?,
            }
        }
        Ok(question.told())
    }

    /// Sends any PDU: as [`Bus::transact`](crate::Bus::transact).
    pub fn transact(&self, unit: u8, pdu: &[u8], reply_length: Option<u8>) -> Asked<Vec<u8>> {
        let checked = || Ok((checks::unit(unit)?.into(), Request::raw(pdu, reply_length)?, once()));
        self.ask(checked(), |reply| reply.pdu)
    }

    /// The values of `reading`: as [`Bus::values`](crate::Bus::values).
    ///
    /// # Errors
    ///
    /// Those of [`Bus::values`](crate::Bus::values).
    pub async fn values(&self, unit: u8, reading: &Reading) -> Result<Values, Error> {
        let mut words = Vec::with_capacity(reading.words());
        for (place, count) in reading.spans() {
            let checked = || Ok((checks::unit(unit)?.into(), checks::read(place, count)?, LineOptions::default()));
            let came = self.ask(checked(), move |reply| replies::words_of(&reply, count)).await?;
            words.extend(came);
        }
        Ok(reading.values(&words))
    }

    /// Finds out what `unit` is: as [`Bus::identify`](crate::Bus::identify).
    ///
    /// # Errors
    ///
    /// Those of [`Bus::identify`](crate::Bus::identify).
    pub async fn identify(&self, unit: u8) -> Result<Identification, Error> {
        self.carry_out(operations::identify(checks::unit(unit)?)).await
    }

    /// Looks at `unit`: as [`Bus::look`](crate::Bus::look).
    ///
    /// # Errors
    ///
    /// Those of [`Bus::look`](crate::Bus::look).
    pub async fn look(&self, unit: u8, looks: &Arc<Looks>) -> Result<Look, Error> {
        self.carry_out(operations::look(unit, looks)?).await
    }

    /// Carries an operation out: as [`Bus::carry_out`](crate::Bus::carry_out). Where this future is dropped, it ends where it
    /// stands.
    ///
    /// # Errors
    ///
    /// Those of [`Bus::carry_out`](crate::Bus::carry_out).
    pub async fn carry_out<T>(&self, mut task: Task<Result<T, Error>, Error>) -> Result<T, Error> {
        let (mut latest, mut outcome) = (Instant::ZERO, None);
        loop {
            let seen = self.0.seen(&mut latest);
            outcome = Some(match task.step(seen, outcome)? {
                Step::Done(done) => return done,
                Step::Wish(Wish::Sleep(time)) => {
                    self.sleep(time).await.map_or_else(Outcome::Failed, |()| Outcome::Slept)
                }
                Step::Wish(Wish::Read(read)) => self.came_of(read).await.unwrap_or_else(Outcome::Failed),
                Step::Wish(Wish::Write(write)) => {
                    let options = operations::options_of_write(&write);
                    let written =
                        self.write_with(write.unit.get(), write.place, operations::payload_of(&write), options);
                    written.await.map_or_else(Outcome::Failed, |()| Outcome::Written)
                }
                Step::Wish(Wish::Link(unit)) => Outcome::Link(self.0.link_of(unit)),
                Step::Wish(Wish::Halts(unit)) => Outcome::Halts(Some(self.halts_of(unit).await?)),
                // Nobody keeps or shows here what comes about.
                Step::Wish(Wish::Tell(_)) => Outcome::Heard,
                Step::Wish(wish) => return Err(operations::unknown(&wish)),
            });
        }
    }

    /// Where another program has the port, it is asked.
    fn halts_of(&self, unit: UnitAddress) -> Asked<u64> {
        let bus = self.0.clone();
        Asked::apart(move |_| Ok(bus.core.halts(unit)))
    }

    fn came_of(&self, read: Read) -> Asked<Outcome<Error>> {
        let checked = || {
            let request = checks::read(read.place, read.count)?;
            Ok((read.unit.into(), request, operations::options_of(&read).of(&request)?))
        };
        let bus = self.0.clone();
        self.ask(checked(), move |reply| bus.outcome_of(&read, replies::words_of(&reply, read.count), &reply.done))
    }

    /// Asks `targets` again and again: as [`Bus::poll`](crate::Bus::poll).
    ///
    /// # Errors
    ///
    /// Those of [`Bus::poll`](crate::Bus::poll).
    pub fn poll(
        &self,
        targets: impl IntoIterator<Item = Target>,
        interval: impl Into<Option<Duration>>,
    ) -> Result<Poll, Error> {
        self.0.poll(targets, interval).map(Poll::new)
    }

    /// Waits on the line's clock, which in virtual time moves only so.
    pub fn sleep(&self, time: Duration) -> Asked<()> {
        let bus = self.0.clone();
        Asked::apart(move |wanted| {
            bus.core.sleep(time, &mut || !wanted.load(Ordering::Acquire));
            Ok(())
        })
    }

    /// Closes the line for all handles. What waits ends with an error.
    pub fn close(&self) -> Asked<()> {
        let bus = self.0.clone();
        Asked::apart(move |_| {
            bus.close();
            Ok(())
        })
    }

    /// Counters and latencies since the bus was opened.
    pub fn stats(&self) -> Stats {
        self.0.stats()
    }

    fn ask<T: Send + 'static>(
        &self,
        checked: Result<(Destination, Request<'_>, LineOptions), Error>,
        make: impl FnOnce(Reply) -> T + Send + 'static,
    ) -> Asked<T> {
        match checked {
            Ok((to, request, options)) => Asked::errand(&self.0.core, to, &request, options, make),
            Err(error) => Asked::refused(error),
        }
    }
}
