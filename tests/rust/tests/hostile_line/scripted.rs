//! A line in virtual time whose unit and adapter do what a script says, on time or not.
//!
//! Register *a* of every unit holds the value *a*, so that a wrong answer shows at once.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus_line::{Bus, BusOptions, CallError, CallOptions, Done, Line, LineClock, PortError, PortErrorKind};
use drivebus_rtu::{
    Adu, Answer, Destination, FIRST_CONTACT, Frame, IdentificationPage, Instant, MAX_PDU, Request, SerialFormat,
    UnitAddress,
};

pub(crate) const FORMAT: SerialFormat = SerialFormat::DEFAULT;

/// Bytes that arrive so long after the last bit of the request.
pub(crate) type Pieces = Vec<(Duration, Vec<u8>)>;
/// What comes back for the request with this number, counted from 0.
pub(crate) type Script = Box<dyn FnMut(usize, &[u8]) -> Pieces + Send>;

pub(crate) const fn millis(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

pub(crate) fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

/// Who made every unit.
pub(crate) const OBJECTS: &[(u8, &[u8])] = &[(0, b"Example"), (1, b"EX-1"), (2, b"V2.11"), (0x80, &[b'x'; 240])];

/// The right answer to `request`.
pub(crate) fn right(request: &[u8]) -> Vec<u8> {
    let frame = Frame::parse(request).unwrap();
    let request = Request::parse(frame.pdu()).unwrap();
    let words: Vec<u16>;
    let mut buffer = [0; MAX_PDU];
    let answer = match request {
        Request::Read { address, count, .. } => {
            words = (address..address + count).collect();
            Answer::read(&words).unwrap()
        }
        Request::Custom { pdu, .. } => Answer::custom(pdu).unwrap(),
        Request::ReadWrite { address, count, .. } => {
            words = (address..address + count).collect();
            Answer::read_write(&words).unwrap()
        }
        Request::ReportServerId => Answer::server_id(b"unit\xFF").unwrap(),
        Request::ReadIdentification { level, object, .. } => {
            IdentificationPage::answer(OBJECTS, (level, object), &mut buffer)
        }
        _ => Answer::confirming(&request).unwrap(),
    };
    Adu::answer(unit(frame.address()), &answer).as_bytes().to_vec()
}

/// An answer whose last byte is there as soon as a unit can have sent it.
pub(crate) fn at_once(bytes: &[u8]) -> Pieces {
    after(Duration::ZERO, bytes)
}

/// As [`at_once`], so much later.
pub(crate) fn after(delay: Duration, bytes: &[u8]) -> Pieces {
    vec![(FORMAT.t35() + FORMAT.chars(u32::try_from(bytes.len()).unwrap()) + delay, bytes.to_vec())]
}

/// Four bytes every 16 ms, as some USB adapters deliver.
pub(crate) fn lumps(start: Duration, bytes: &[u8]) -> Pieces {
    (0..).map(|index| start + index * millis(16)).zip(bytes.chunks(4).map(<[u8]>::to_vec)).collect()
}

/// What is on the wire, and when.
pub(crate) struct Wire {
    pub(crate) now: Instant,
    coming: Vec<(Instant, Vec<u8>)>,
    /// The requests, in the order they were sent.
    pub(crate) sent: Vec<Vec<u8>>,
    /// When each of them was.
    pub(crate) times: Vec<Instant>,
    /// When the latest byte of either side was on the wire.
    busy: Instant,
    script: Script,
    echo: Script,
    /// Fails once after the next request, as an adapter does that is pulled out and put in again.
    pub(crate) vanish_after_sending: bool,
    /// The same, before the next request is out.
    pub(crate) vanish_before_sending: bool,
    pub(crate) opened: u32,
    /// What the script has arrive may be on the wire together with a request.
    pub(crate) collides: bool,
}

impl std::fmt::Debug for Wire {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Wire").field("now", &self.now).finish_non_exhaustive()
    }
}

impl Wire {
    fn put(&mut self, end: Instant, pieces: Pieces) {
        for (delay, bytes) in pieces {
            let at = end + delay;
            let place = self.coming.partition_point(|(other, _)| *other <= at);
            self.coming.insert(place, (at, bytes));
        }
    }
}

/// A line on a wire that the test holds too.
#[derive(Debug, Clone)]
pub(crate) struct Scripted(Arc<Mutex<Wire>>);

impl Line for Scripted {
    fn now(&self) -> Instant {
        self.0.lock().unwrap().now
    }

    fn send(&mut self, bytes: &[u8]) -> Result<Instant, PortError> {
        let mut wire = self.0.lock().unwrap();
        let arrived = wire.coming.iter().map(|(at, _)| *at).take_while(|at| *at <= wire.now).last();
        let busy = arrived.map_or(wire.busy, |arrived| arrived.max(wire.busy));
        assert!(wire.collides || wire.now >= busy + FORMAT.t35(), "silence was broken at {:?}", wire.now);
        let end = wire.now + FORMAT.chars(u32::try_from(bytes.len()).unwrap());
        wire.busy = end;
        let number = wire.sent.len();
        wire.sent.push(bytes.to_vec());
        let now = wire.now;
        wire.times.push(now);
        let pieces = (wire.echo)(number, bytes);
        wire.put(end, pieces);
        let pieces = (wire.script)(number, bytes);
        wire.put(end, pieces);
        Ok(end)
    }

    fn receive(&mut self, buffer: &mut [u8], until: Instant) -> Result<usize, PortError> {
        let mut wire = self.0.lock().unwrap();
        let is_sent = wire.busy > wire.now;
        if std::mem::take(&mut wire.vanish_before_sending)
            || (is_sent && std::mem::take(&mut wire.vanish_after_sending))
        {
            return Err(PortError::new(PortErrorKind::Lost, "script", "pulled out"));
        }
        let Some((at, _)) = wire.coming.first().filter(|(at, _)| *at <= until.max(wire.now)) else {
            wire.now = wire.now.max(until);
            return Ok(0);
        };
        wire.now = wire.now.max(*at);
        wire.busy = wire.busy.max(wire.now);
        let (at, mut bytes) = wire.coming.remove(0);
        let rest = bytes.split_off(bytes.len().min(buffer.len()));
        buffer[..bytes.len()].copy_from_slice(&bytes);
        if !rest.is_empty() {
            wire.coming.insert(0, (at, rest));
        }
        Ok(bytes.len())
    }

    fn sleep(&mut self, until: Instant) {
        let mut wire = self.0.lock().unwrap();
        wire.now = wire.now.max(until);
    }

    fn name(&self) -> String {
        "script".to_owned()
    }

    fn is_virtual(&self) -> bool {
        true
    }

    fn clock(&self) -> Option<LineClock> {
        let wire = Arc::clone(&self.0);
        Some(Arc::new(move || wire.lock().unwrap().now))
    }

    fn may_echo(&self) -> bool {
        true
    }
}

/// A bus on a scripted line.
#[derive(Debug)]
pub(crate) struct Rig {
    pub(crate) bus: Arc<Bus>,
    pub(crate) wire: Arc<Mutex<Wire>>,
    /// Who holds it keeps the port from opening.
    pub(crate) opening: Arc<Mutex<()>>,
}

impl Rig {
    /// Reads are asked once; the time-out is half a second.
    pub(crate) fn new(script: impl FnMut(usize, &[u8]) -> Pieces + Send + 'static) -> Self {
        Self::echoing(|_, _| Vec::new(), script)
    }

    /// As [`new`](Self::new), with an adapter that sends back what `echo` says.
    pub(crate) fn echoing(
        echo: impl FnMut(usize, &[u8]) -> Pieces + Send + 'static,
        script: impl FnMut(usize, &[u8]) -> Pieces + Send + 'static,
    ) -> Self {
        let rig = Self::fresh(echo, script);
        rig.pass(FIRST_CONTACT);
        rig
    }

    /// On a line that was just opened, so that nobody knows what another program has asked.
    pub(crate) fn fresh(
        echo: impl FnMut(usize, &[u8]) -> Pieces + Send + 'static,
        script: impl FnMut(usize, &[u8]) -> Pieces + Send + 'static,
    ) -> Self {
        let wire = Arc::new(Mutex::new(Wire {
            now: Instant::ZERO,
            coming: Vec::new(),
            sent: Vec::new(),
            times: Vec::new(),
            busy: Instant::ZERO,
            script: Box::new(script),
            echo: Box::new(echo),
            vanish_after_sending: false,
            vanish_before_sending: false,
            opened: 0,
            collides: false,
        }));
        let line = Scripted(Arc::clone(&wire));
        let opening = Arc::default();
        let door: Arc<Mutex<()>> = Arc::clone(&opening);
        let opener = move || {
            let _open = door.lock().unwrap();
            line.0.lock().unwrap().opened += 1;
            Ok(Box::new(line.clone()) as Box<dyn Line>)
        };
        let options = BusOptions::new(FORMAT).retries(0);
        let bus = Bus::open(Box::new(opener), options, &mut || false).unwrap();
        Self { bus: Arc::new(bus), wire, opening }
    }

    /// Asks unit 1; the words read, or none.
    pub(crate) fn ask(&self, request: &Request<'_>) -> Result<Vec<u16>, Box<CallError>> {
        let mut words_read = Vec::new();
        self.call(unit(1).into(), request, CallOptions::default(), &mut || false, &mut |answer| {
            if let Answer::Read { words, .. } = answer {
                words_read = words.iter().collect();
            }
        })?;
        Ok(words_read)
    }

    pub(crate) fn read(&self, address: u16, count: u16) -> Result<Vec<u16>, Box<CallError>> {
        self.ask(&Request::read(address, count).unwrap())
    }

    pub(crate) fn call(
        &self,
        destination: Destination,
        request: &Request<'_>,
        options: CallOptions,
        give_up: &mut dyn FnMut() -> bool,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<Done, Box<CallError>> {
        self.bus.call(destination, request, options, give_up, take)
    }

    pub(crate) fn now(&self) -> Instant {
        self.wire.lock().unwrap().now
    }

    /// How long ago `then` is.
    pub(crate) fn since(&self, then: Instant) -> Duration {
        self.now().saturating_duration_since(then)
    }

    /// The program does something else for `time`; what arrives meanwhile waits in the driver.
    pub(crate) fn pass(&self, time: Duration) {
        let mut wire = self.wire.lock().unwrap();
        wire.now = wire.now + time;
    }

    /// What was sent until now counts no more.
    pub(crate) fn forget_sent(&self) {
        self.wire.lock().unwrap().sent.clear();
    }

    /// How often exactly these bytes were sent.
    pub(crate) fn sent(&self, request: &Request<'_>) -> usize {
        let adu = Adu::request(unit(1).into(), request);
        self.wire.lock().unwrap().sent.iter().filter(|sent| *sent == adu.as_bytes()).count()
    }
}
