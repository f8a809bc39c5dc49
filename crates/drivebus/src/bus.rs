//! The bus as a program uses it: plain numbers in, words out, one thread that waits.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use drivebus_drive::Record;
use drivebus_drives::Place;
use drivebus_line::{
    Bus as Core, CallOptions as LineOptions, DeviceIdentification, DeviceQuestion, Done, Link, Stats, UnitOptions,
    Watch,
};
use drivebus_rtu::{Answer, Destination, Instant, Request, UnitAddress};

use crate::checks;
use crate::error::Error;
use crate::options::CallOptions;
use crate::payload::Payload;
use crate::poll::{Poll, Target};
use crate::reading::{Reading, Values};
use crate::replies;

/// One line with drives on it. Clones are handles to the same line, and it is safe from any thread.
///
/// Each call waits for its turn, a stop before all others, and returns when it is answered. Units are plain numbers,
/// 1..=247. What cannot be sent is refused before anything is.
#[derive(Debug, Clone)]
pub struct Bus {
    pub(crate) core: Arc<Core>,
    /// What was sent to each unit that was named here, and what it said of itself.
    records: Arc<Mutex<BTreeMap<UnitAddress, Record>>>,
    #[cfg(feature = "sim")]
    simulator: Option<drivebus_sim::Simulator>,
}

impl Bus {
    pub(crate) fn around(core: Core) -> Self {
        Self {
            core: Arc::new(core),
            records: Arc::default(),
            #[cfg(feature = "sim")]
            simulator: None,
        }
    }

    #[cfg(feature = "sim")]
    pub(crate) fn simulated(core: Core, simulator: drivebus_sim::Simulator) -> Self {
        Self { simulator: Some(simulator), ..Self::around(core) }
    }

    /// The simulator behind a `sim://` port: its wire and its drives, seen from the shaft.
    #[cfg(feature = "sim")]
    pub fn simulator(&self) -> Option<&drivebus_sim::Simulator> {
        self.simulator.as_ref()
    }

    /// The name of the port, for messages.
    pub fn port(&self) -> &str {
        self.core.name()
    }

    /// Whether it was closed, or belongs to the parent of this process.
    pub fn is_closed(&self) -> bool {
        self.core.is_closed()
    }

    /// Closes the line for all handles. What waits ends with an error. Closing again does nothing.
    ///
    /// It is closed by itself when the last handle is gone.
    pub fn close(&self) {
        self.core.close();
    }

    /// Reads `count` words (1..=125) of `unit` from `address`: function 03H.
    ///
    /// Drives allow fewer words than the protocol (INVT: 16) and refuse more themselves. A read that brings nothing is
    /// asked again, as often as the bus is set to.
    ///
    /// # Errors
    ///
    /// [`Error`]: a read changes nothing in a drive, whatever became of it.
    pub fn read(&self, unit: u8, address: impl Into<Place>, count: u16) -> Result<Vec<u16>, Error> {
        self.read_with(unit, address, count, CallOptions::new())
    }

    /// As [`read`](Self::read), with what this call wants otherwise.
    ///
    /// # Errors
    ///
    /// Those of [`read`](Self::read).
    pub fn read_with(
        &self,
        unit: u8,
        address: impl Into<Place>,
        count: u16,
        options: CallOptions,
    ) -> Result<Vec<u16>, Error> {
        let (unit, request) = (checks::unit(unit)?, checks::read(address.into(), count)?);
        let mut words = Vec::new();
        self.call(unit.into(), &request, options.of(&request)?, &mut |answer| words = replies::words(&answer))?;
        Ok(words)
    }

    /// Writes a word (06H) or a sequence of words (10H) to `unit`, or 0 or 1 to a coil (05H). Sent once, never repeated.
    ///
    /// A word in a command register moves the motor. A unit that may still owe another answer is first asked for an echo,
    /// or for a read that cannot be mistaken; if it answers neither, the write is not sent.
    ///
    /// # Errors
    ///
    /// [`Error`]: unless [`may_have_acted`](Error::may_have_acted) says so, the unit has not taken it.
    pub fn write<'a>(&self, unit: u8, address: impl Into<Place>, value: impl Into<Payload<'a>>) -> Result<(), Error> {
        self.write_with(unit, address, value, CallOptions::new())
    }

    /// As [`write`](Self::write), with what this call wants otherwise.
    ///
    /// # Errors
    ///
    /// Those of [`write`](Self::write).
    pub fn write_with<'a>(
        &self,
        unit: u8,
        address: impl Into<Place>,
        value: impl Into<Payload<'a>>,
        options: CallOptions,
    ) -> Result<(), Error> {
        let (unit, payload) = (checks::unit(unit)?, value.into());
        let request = checks::write(address.into(), &payload)?;
        self.call(unit.into(), &request, options.of(&request)?, &mut |_| ())?;
        Ok(())
    }

    /// Writes to every unit at once; none answers. Returns after the turnaround delay. Sent once.
    ///
    /// # Errors
    ///
    /// [`Error`]: the units may have taken it where [`may_have_acted`](Error::may_have_acted) says so.
    pub fn broadcast<'a>(&self, address: u16, value: impl Into<Payload<'a>>) -> Result<(), Error> {
        let payload = value.into();
        let request = checks::write(address.into(), &payload)?;
        self.call(Destination::Broadcast, &request, LineOptions::default(), &mut |_| ())?;
        Ok(())
    }

    /// Asks `unit` to send a fresh word back (08H/0000), and tells how long that took.
    ///
    /// # Errors
    ///
    /// [`Error`]: an echo changes nothing in a drive.
    pub fn echo(&self, unit: u8) -> Result<Duration, Error> {
        let (unit, request) = (checks::unit(unit)?, Request::echo(self.core.fresh_word()));
        let done = self.call(unit.into(), &request, LineOptions::default(), &mut |_| ())?;
        Ok(done.ended.saturating_duration_since(done.sent))
    }

    /// Who made `unit` and what it is, as it says itself (2BH/0EH). What does not fit into one answer is asked for by
    /// more requests, 32 at most.
    ///
    /// # Errors
    ///
    /// [`Error`]: most units do not know the function, and refuse it with 01H. Nothing of the unit changed.
    pub fn device_identification(&self, unit: u8) -> Result<DeviceIdentification, Error> {
        let unit = checks::unit(unit)?;
        let mut question = DeviceQuestion::new();
        while let Some(request) = question.request() {
            let answer = &mut |answer: Answer<'_>| question.answered(&answer);
            let done = self.call(unit.into(), &request, LineOptions::default(), answer);
            if let Err(error) = done {
                replies::asks_less(&mut question, error)?;
            }
        }
        Ok(question.told())
    }

    /// Sends any PDU (1..=253 bytes, the function code first) and returns the answer's PDU. Sent once.
    ///
    /// Unit and CRC are added and checked. `reply_length` is the length of the answer's PDU; without it the end is found by
    /// the function or by silence.
    ///
    /// # Errors
    ///
    /// [`Error`]: the unit may have acted where [`may_have_acted`](Error::may_have_acted) says so.
    pub fn transact(&self, unit: u8, pdu: &[u8], reply_length: Option<u8>) -> Result<Vec<u8>, Error> {
        let (unit, request) = (checks::unit(unit)?, Request::raw(pdu, reply_length)?);
        let mut reply = Vec::new();
        self.call(unit.into(), &request, once(), &mut |answer| reply = replies::pdu(unit, &answer))?;
        Ok(reply)
    }

    /// The values of `reading` from `unit`, in the fewest reads.
    ///
    /// # Errors
    ///
    /// Those of [`read`](Self::read).
    pub fn values(&self, unit: u8, reading: &Reading) -> Result<Values, Error> {
        let unit = checks::unit(unit)?;
        let mut words = Vec::with_capacity(reading.words());
        for (place, count) in reading.spans() {
            let request = checks::read(place, count)?;
            let mut take = |answer: Answer<'_>| words.extend(replies::words(&answer));
            self.call(unit.into(), &request, LineOptions::default(), &mut take)?;
        }
        Ok(reading.values(&words))
    }

    /// Asks `targets` again and again, and keeps the last 10 000 samples until they are taken.
    ///
    /// In each cycle every target is asked once; a cycle begins at every beat of `interval`, or right after the one
    /// before. Whatever else wants the line goes before the next request. What is not answered is not repeated: the
    /// sample says so, and the next cycle asks again. On a real line a thread of the poll's own does the asking; in virtual
    /// time it is done by who waits for samples.
    ///
    /// # Errors
    ///
    /// [`Error`]: there is nobody to ask, or the wire cannot carry so much so often; the message has the shortest interval.
    pub fn poll(
        &self,
        targets: impl IntoIterator<Item = Target>,
        interval: impl Into<Option<Duration>>,
    ) -> Result<Poll, Error> {
        Poll::start(&self.core, targets.into_iter().collect(), interval.into())
    }

    /// What comes within `time` while nothing is asked: pieces, each with its moment on the line's clock.
    ///
    /// # Errors
    ///
    /// [`Port`](crate::ErrorKind::Port): the line was lost or closed.
    pub fn listen(&self, time: Duration) -> Result<Vec<(Instant, Vec<u8>)>, Error> {
        let mut heard = Vec::new();
        self.core.listen(time, &mut || false, &mut |moment, bytes| heard.push((moment, bytes.to_vec())))?;
        Ok(heard)
    }

    /// Waits on the line's clock, which in virtual time moves only so.
    pub fn sleep(&self, time: Duration) {
        self.core.sleep(time, &mut || false);
    }

    /// Now, on the line's clock.
    pub fn now(&self) -> Instant {
        self.core.now()
    }

    /// Sets what `unit` needs otherwise than the bus, for every call from now on.
    ///
    /// # Errors
    ///
    /// [`NotAllowed`](crate::ErrorKind::NotAllowed): no such unit, or a time that cannot be.
    pub fn configure(&self, unit: u8, options: UnitOptions) -> Result<(), Error> {
        options.timeout.map_or(Ok(()), checks::timeout)?;
        options.gap.map_or(Ok(()), |gap| checks::time("gap", gap))?;
        self.core.configure(checks::unit(unit)?, options);
        Ok(())
    }

    /// Of the last ten exchanges with `unit`, how many brought an answer.
    ///
    /// # Errors
    ///
    /// [`NotAllowed`](crate::ErrorKind::NotAllowed): no such unit.
    pub fn link(&self, unit: u8) -> Result<Link, Error> {
        Ok(self.core.link(checks::unit(unit)?))
    }

    /// A number that is another one each time `unit` is told to halt over this line, by whichever program: by an
    /// [urgent](CallOptions::urgent) write. For [`CallOptions::halts`]. Where another program has the port, it is asked, a
    /// second at most.
    ///
    /// # Errors
    ///
    /// [`NotAllowed`](crate::ErrorKind::NotAllowed): no such unit.
    pub fn halts(&self, unit: u8) -> Result<u64, Error> {
        Ok(self.core.halts(checks::unit(unit)?))
    }

    /// Counters and latencies since the bus was opened, for the line and for each unit.
    pub fn stats(&self) -> Stats {
        self.core.stats()
    }

    /// Shows each frame that goes over the line to `watch` from now on, or to nobody any more.
    ///
    /// It is called in the thread that uses the line, while it does: what it takes, the next request waits. See
    /// [`Traced`](crate::line::Traced) for what it is shown.
    ///
    /// ```
    /// use std::sync::{Arc, Mutex};
    ///
    /// # #[cfg(feature = "sim")] {
    /// let bus = drivebus::Bus::open("sim://gd350?clock=virtual")?;
    /// let shown = Arc::new(Mutex::new(Vec::new()));
    /// let show = Arc::clone(&shown);
    /// bus.watch(Some(Arc::new(move |frame| show.lock().unwrap().push(frame.to_string()))));
    /// bus.read(1, 0x2103, 1)?;
    /// assert!(shown.lock().unwrap().last().unwrap().ends_with("<- 01 03 02 01 A0 B9 AC"));
    /// # }
    /// # Ok::<(), drivebus::Error>(())
    /// ```
    pub fn watch(&self, watch: Option<Watch>) {
        self.core.watch(watch);
    }

    /// What the user should know about the line, such as a setting that did not reach the wire.
    pub fn notes(&self) -> Vec<String> {
        self.core.notes()
    }

    /// The same bus, with futures for calls.
    pub fn aio(&self) -> crate::aio::Bus {
        crate::aio::Bus::from(self.clone())
    }

    /// What was sent to `unit`, and what it said of itself.
    pub(crate) fn record(&self, unit: UnitAddress) -> Record {
        self.records.lock().unwrap_or_else(PoisonError::into_inner).entry(unit).or_default().clone()
    }

    pub(crate) fn call(
        &self,
        to: Destination,
        request: &Request<'_>,
        options: LineOptions,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Error> {
        Ok(self.core.call(to, request, options, &mut || false, take)?)
    }
}

/// What is carried as it is may do anything, so it is never repeated.
pub(crate) fn once() -> LineOptions {
    LineOptions::default().retries(0)
}
