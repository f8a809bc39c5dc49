//! A master on a line where nothing takes time: what it asks goes out at once, and what comes is there as a whole.

use drivebus_rtu::*;

/// How long each answer is waited for.
pub(crate) const TIMEOUT: Duration = Duration::from_millis(50);

pub(crate) fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

pub(crate) fn ms(millis: u64) -> Instant {
    Instant::from_nanos(millis * 1_000_000)
}

/// The last moment before `moment`.
pub(crate) fn before(moment: Instant) -> Instant {
    Instant::from_nanos(moment.as_nanos() - 1)
}

pub(crate) fn read(count: u16) -> Request<'static> {
    Request::read(0x2100, count).unwrap()
}

/// The answer of `unit` to a read, each word `value`.
pub(crate) fn words(unit: UnitAddress, count: u16, value: u16) -> Adu {
    Adu::answer(unit, &Answer::read(&vec![value; count.into()]).unwrap())
}

pub(crate) fn confirms(unit: UnitAddress, request: &Request<'_>) -> Adu {
    Adu::answer(unit, &Answer::confirming(request).unwrap())
}

pub(crate) fn refuses(unit: UnitAddress, request: &Request<'_>) -> Adu {
    Adu::answer(unit, &Answer::exception(request.function(), ExceptionCode::ILLEGAL_ADDRESS))
}

/// What becomes of a request.
#[derive(Debug, PartialEq)]
pub(crate) enum Came {
    Answer,
    Refusal,
    Wrong(AnswerError),
    /// Still waited for.
    Nothing,
}

#[derive(Debug, Clone)]
pub(crate) struct Asker {
    pub(crate) master: Master,
    echoed: u16,
}

impl Asker {
    /// Of a line that nobody else asked anything on, and whose format nobody knows.
    pub(crate) fn new() -> Self {
        Self { master: Master::with_silence(Duration::ZERO), echoed: 0 }
    }

    /// The same, and unit 1 has returned an echo at 0.
    pub(crate) fn of_a_unit_that_echoes() -> Self {
        let mut asker = Self::new();
        asker.echoes(0, unit(1));
        asker
    }

    /// `request` goes out, in doubt or not.
    pub(crate) fn sends(&mut self, now: u64, unit: UnitAddress, request: &Request<'_>, timeout: Duration) {
        self.master.begin_in_doubt(ms(now), unit.into(), request, timeout).unwrap();
        assert!(matches!(self.master.poll(ms(now)), Some(Event::Transmit(_))));
        self.master.sent(ms(now));
    }

    /// `request` goes out in vain, and is given up at once.
    pub(crate) fn leaves_open(&mut self, now: u64, unit: UnitAddress, request: &Request<'_>) {
        self.leaves_open_for(now, unit, request, TIMEOUT);
    }

    /// The same, with another time-out.
    pub(crate) fn leaves_open_for(&mut self, now: u64, unit: UnitAddress, request: &Request<'_>, timeout: Duration) {
        self.sends(now, unit, request, timeout);
        assert!(self.master.abort(ms(now)));
    }

    /// What the master makes of `frame`, which comes at `now`.
    pub(crate) fn hears(&mut self, now: u64, frame: &Adu) -> Came {
        assert_eq!(self.master.receive(ms(now), frame.as_bytes()), frame.as_bytes().len());
        match self.master.poll(ms(now)) {
            Some(Event::Answer(Answer::Exception { .. })) => Came::Refusal,
            Some(Event::Answer(_)) => Came::Answer,
            Some(Event::Wrong { error, .. }) => Came::Wrong(error),
            None => Came::Nothing,
            other => panic!("{other:?}"),
        }
    }

    /// `request` goes out, and `frame` comes at once.
    pub(crate) fn asks(&mut self, now: u64, unit: UnitAddress, request: &Request<'_>, frame: &Adu) -> Came {
        self.sends(now, unit, request, TIMEOUT);
        self.hears(now, frame)
    }

    /// `count` words are read, and come.
    pub(crate) fn reads(&mut self, now: u64, unit: UnitAddress, count: u16) {
        assert_eq!(self.asks(now, unit, &read(count), &words(unit, count, 7)), Came::Answer);
    }

    /// The unit returns a fresh word.
    pub(crate) fn echoes(&mut self, now: u64, unit: UnitAddress) {
        self.echoed += 1;
        let echo = Request::echo(self.echoed);
        assert_eq!(self.asks(now, unit, &echo, &confirms(unit, &echo)), Came::Answer);
    }

    /// A fresh word is asked back in vain.
    pub(crate) fn leaves_echo_open(&mut self, now: u64, unit: UnitAddress) {
        self.echoed += 1;
        self.leaves_open(now, unit, &Request::echo(self.echoed));
    }

    pub(crate) fn attribution(&self, now: Instant, request: &Request<'_>) -> Attribution {
        self.master.attribution(now, unit(1), request)
    }

    pub(crate) fn tells_apart(&self, now: Instant, request: &Request<'_>) -> bool {
        self.master.tells_apart(now, unit(1), request)
    }

    pub(crate) fn in_quarantine(&self, now: Instant) -> bool {
        self.master.in_quarantine(now, unit(1))
    }
}
