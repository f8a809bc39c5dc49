//! Whether each doubt ends within its stated time. Asked of every state that is reached, so that what has to happen some
//! time is a question about one state.

use drivebus_rtu::{Adu, Answer, Attribution, Event, Instant, OwnEcho, Request};

use crate::frames::Kind;
use crate::scenario::{LONGEST, PATIENCE, STRANGERS_COME_FOR};
use crate::world::{State, TICK, Unit, address};

/// A word that no echo of a search carries.
const FRESH: u16 = 0xFFFE;

/// What outlasts its time about a unit; `None` where all is well.
pub fn overdue(state: &State) -> Option<&'static str> {
    if state.program.in_flight().is_some() {
        return None;
    }
    let is_idle = !state.program.is_sending();
    (0..state.units.len()).find_map(|unit| {
        if outlasts_its_time(state, unit) {
            Some("the stated time is over, and the unit still is in doubt")
        } else if is_idle && outlasts_an_echo(state, unit) {
            Some("the unit has returned an echo, and still is in doubt")
        } else {
            None
        }
    })
}

/// Whether at `at` something still could pass for an answer to what may be asked.
fn is_uncertain(state: &State, unit: usize, at: Instant) -> bool {
    [Kind::Read(1), Kind::Read(2), Kind::Run]
        .iter()
        .any(|kind| state.master().attribution(at, address(unit), &kind.request()) != Attribution::Certain)
}

/// Whether the doubt about `unit`, if it never returned an echo, goes on when first contact is over and it has owed nothing
/// for as long as it may; or, whatever was answered meanwhile, for the longest time.
fn outlasts_its_time(state: &State, unit: usize) -> bool {
    let Unit { echoed, gave_up, touched, .. } = state.units[unit];
    let first_contact = state.opened.map(|opened| opened + STRANGERS_COME_FOR);
    let asked = touched.map(|at| at + PATIENCE).min(gave_up.map(|at| at + LONGEST));
    let over = [Some(state.now), first_contact, asked].into_iter().max().flatten().unwrap_or(state.now);
    (!echoed && state.is_doubted_at(over, unit)) || is_uncertain(state, unit, over)
}

/// Whether the echo of a fresh word does not end the doubt about `unit`.
fn outlasts_an_echo(state: &State, unit: usize) -> bool {
    if !state.is_doubted(unit) || state.known.echo() == OwnEcho::Unknown {
        return false;
    }
    let (mut master, unit, now) = (state.master().clone(), address(unit), state.now);
    let echo = Request::echo(FRESH);
    let went_out =
        master.begin(now, unit.into(), &echo, 2 * TICK).is_ok() && matches!(master.poll(now), Some(Event::Transmit(_)));
    master.sent(now);
    let request = Adu::request(unit.into(), &echo);
    if state.known.echo() == OwnEcho::Present {
        master.receive(now, request.as_bytes());
        if master.poll(now).is_some() {
            return true;
        }
    }
    let Some(answer) = Answer::confirming(&echo) else { return true };
    master.receive(now, Adu::answer(unit, &answer).as_bytes());
    let answered = matches!(master.poll(now), Some(Event::Answer(Answer::Echo { .. })));
    !went_out || !answered || master.in_quarantine(now, unit)
}
