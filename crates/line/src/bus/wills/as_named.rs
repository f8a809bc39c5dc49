//! A unit whose program is gone is halted by who knows families: which line that one has, and what is told of it.

use std::sync::{Arc, Weak};
use std::time::Duration;

use drivebus_rtu::huanyang::Protocol;
use drivebus_rtu::{Adu, Answer, Instant, Request, UnitAddress};

use crate::bus::wills::{CarriesOut, Told, Wills};
use crate::error::{CallError, Failure};
use crate::options::{CallOptions, HaltLine, Halted};
use crate::share::will::Will;
use crate::system::clock::monotonic;

impl Wills {
    /// Has `unit` halted within this time by who knows families. Whether nothing is left to be done.
    pub(super) fn halt_as_named(
        &self,
        bus: &Weak<dyn CarriesOut>,
        unit: UnitAddress,
        will: &Will,
        within: Duration,
    ) -> bool {
        let mut line = KeptLine { wills: self, bus, unit, will, told: None };
        let came = match (self.halter, will.named.clone()) {
            (Some(halter), Some(named)) => halter.halt(unit, &named.into(), within, &mut line),
            _ => Halted::Unknown,
        };
        let told = line.told.take();
        match came {
            Halted::Took(shown) => {
                let told = told.unwrap_or_else(|| self.is_done(unit, will, true));
                self.shows(told, &shown);
                return true;
            }
            _ if told.is_some() => return true,
            Halted::Another => {
                self.is_done(unit, will, false);
                return true;
            }
            Halted::NotTaken => self.of(unit, |halted| halted.course.was_not_halted(monotonic(), true)),
            Halted::GivenUp => self.of(unit, |halted| halted.course.was_not_halted(monotonic(), false)),
            Halted::Unknown => self.of(unit, |halted| halted.course.is_of_no_family()),
        }
        false
    }
}

/// The line of a unit that is being halted. It does not keep the bus from ending.
struct KeptLine<'a> {
    wills: &'a Wills,
    bus: &'a Weak<dyn CarriesOut>,
    unit: UnitAddress,
    will: &'a Will,
    /// Once it took a halt.
    told: Option<Told>,
}

impl KeptLine<'_> {
    /// The bus, while it is this one that halts the unit.
    fn open(&self) -> Option<Arc<dyn CarriesOut>> {
        let bus = self.bus.upgrade().filter(|bus| !bus.is_shut() && !bus.is_guest())?;
        (self.told.is_some() || self.wills.halts(self.unit)).then_some(bus)
    }
}

impl HaltLine for KeptLine<'_> {
    fn now(&self) -> Instant {
        self.bus.upgrade().map_or(Instant::ZERO, |bus| bus.now())
    }

    fn reconnects(&self) -> u64 {
        self.bus.upgrade().map_or(0, |bus| bus.reconnects())
    }

    fn is_closed(&self) -> bool {
        self.open().is_none()
    }

    fn sleep(&mut self, time: Duration) {
        if let Some(bus) = self.open() {
            bus.sleep(time);
        }
    }

    fn ask(
        &mut self,
        request: &Request<'_>,
        options: CallOptions,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<(), Box<CallError>> {
        let Some(bus) = self.open() else {
            return Err(Box::new(CallError {
                failure: Failure::Closed,
                destination: self.unit.into(),
                request: Adu::request(self.unit.into(), request).as_bytes().to_vec(),
                protocol: Protocol::Modbus,
                raw: Vec::new(),
                sent: None,
                ended: None,
                set_again: None,
            }));
        };
        bus.ask(self.unit, request, options.urgent(request), take)
    }

    fn took(&mut self) {
        if self.told.is_none() {
            self.told = Some(self.wills.is_done(self.unit, self.will, true));
        }
    }
}
