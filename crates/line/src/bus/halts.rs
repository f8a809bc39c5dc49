//! How a bus carries out a last will, and tells the program that has the port of one.

use std::time::Duration;

use drivebus_rtu::{Answer, Destination, Instant, Request, UnitAddress};

use crate::bus::call::Call;
use crate::bus::errand::pdu_of;
use crate::bus::port::Port;
use crate::bus::shared::Shared;
use crate::bus::spoken;
use crate::bus::wills::CarriesOut;
use crate::error::{CallError, Failure};
use crate::options::CallOptions;
use crate::share::message::{Told, Wish};
use crate::share::place::Place;
use crate::share::will::Will;
use crate::turns::order::Priority;

/// How long the question takes at most, which makes sure that it still is the same unit.
const LOOK: Duration = Duration::from_millis(100);

impl CarriesOut for Shared {
    fn is_shut(&self) -> bool {
        self.port.is_shut()
    }

    fn is_guest(&self) -> bool {
        self.sharing.as_ref().is_some_and(|sharing| sharing.is_guest())
    }

    fn place(&self) -> Option<Place> {
        self.sharing.as_ref()?.guest().map(|guest| guest.place().clone())
    }

    fn tell_of_wills(&self) -> bool {
        self.told_at_once(&Wish::Wills, |_, told| matches!(told, Told::Wills).then_some(())).is_some()
    }

    fn is_another(&self, unit: UnitAddress, look: &(Vec<u8>, Vec<Vec<u8>>)) -> bool {
        is_another(&self.port, unit, look)
    }

    fn halt(&self, unit: UnitAddress, will: &Will, way: usize) -> Result<(), Failure> {
        halt(&self.port, unit, will, way)
    }

    fn ask(
        &self,
        unit: UnitAddress,
        request: &Request<'_>,
        options: CallOptions,
        take: &mut dyn FnMut(Answer<'_>),
    ) -> Result<(), Box<CallError>> {
        let said = self.port.said(unit.into(), request, &options)?;
        let options = spoken::options_for(&said, options);
        let ask = self.port.ask(unit.into(), &said, &options);
        let take = &mut |answer: Answer<'_>| spoken::tell(&said, request, answer, take);
        Call::new(&self.port, ask, options).run(&mut || self.port.is_shut(), take).map(drop)
    }

    fn now(&self) -> Instant {
        self.port.now()
    }

    fn sleep(&self, time: Duration) {
        self.port.sleep(time, &mut || self.port.is_shut());
    }

    fn reconnects(&self) -> u64 {
        self.reconnects()
    }
}

/// Whether the unit says that it is another one than the will means.
fn is_another(port: &Port, unit: UnitAddress, (question, others): &(Vec<u8>, Vec<Vec<u8>>)) -> bool {
    let Ok(request) = Request::parse(question) else { return false };
    if request.is_write() {
        return false;
    }
    let mut came = Vec::new();
    // At once: a halt waits for it, and it needs no echo before that makes sure of what is only a word against a halt.
    let options = CallOptions::new().urgent(&request).timeout(LOOK).retries(0).in_doubt(true);
    let ask = port.ask(unit.into(), &request, &options);
    let result = Call::new(port, ask, options)
        .run(&mut || port.is_shut(), &mut |answer| came = pdu_of(Destination::Unit(unit), &answer));
    result.is_ok() && others.contains(&came)
}

/// Halts the unit in one of the ways of `will`.
fn halt(port: &Port, unit: UnitAddress, will: &Will, way: usize) -> Result<(), Failure> {
    for pdu in will.ways.get(way).into_iter().flatten() {
        let Some(request) = Request::of_either(pdu) else { continue };
        let options = CallOptions::new().urgent(&request).timeout(Duration::from_nanos(will.timeout)).retries(0);
        let options = CallOptions { priority: Some(Priority::Stop), ..options };
        let ask = port.ask(unit.into(), &request, &options);
        let result = Call::new(port, ask, options).run(&mut || port.is_shut(), &mut |_| ());
        result.map_err(|error| error.failure)?;
    }
    Ok(())
}
