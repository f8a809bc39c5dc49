//! Rarer troubles: babble, slow units that do not echo, ports that vanish.

use std::sync::Arc;

use drivebus_line::{CallOptions, Failure, PortErrorKind};
use drivebus_rtu::{BeginError, Request};

use crate::scripted::{Rig, after, at_once, millis, right, unit};

#[test]
fn an_answer_after_much_babble_loses_no_byte() {
    for (babble, piece) in [(300, 600), (505, 600), (600, 600), (400, 100), (500, 150), (1_000, 90)] {
        let rig = Rig::new(move |_, request| {
            let bytes = [vec![0xFF; babble], right(request)].concat();
            bytes.chunks(piece).map(|piece| (millis(5), piece.to_vec())).collect()
        });
        assert_eq!(rig.read(100, 100).unwrap(), (100..200).collect::<Vec<u16>>(), "{babble} bytes by {piece}");
        assert_eq!(rig.bus.stats().total.noise_bytes, u64::try_from(babble).unwrap());
    }
}

/// A unit that answers everything, in order, a second too late: also the echo, which then looks unknown to it.
#[test]
fn a_unit_that_never_echoed_in_time_gives_no_answer_to_another_question() {
    let rig = Rig::new(|_, request| after(millis(1_250), &right(request)));
    for address in (100..2_000).step_by(100) {
        if let Ok(words) = rig.read(address, 1) {
            assert_eq!(words, [address]);
        }
    }
}

#[test]
fn a_unit_that_ignores_08h_is_found_again() {
    let rig =
        Rig::new(|number, request| if number == 0 || request[1] == 8 { Vec::new() } else { at_once(&right(request)) });
    rig.read(100, 1).unwrap_err();
    let tries = (0..10).position(|_| rig.read(200, 1).is_ok_and(|words| words == [200]));
    assert!(tries.is_some(), "{:?}", rig.read(200, 1));
}

/// A serial server that is connected to again hands over what its line brings, whoever asked.
#[test]
fn what_was_asked_before_a_port_was_lost_is_remembered() {
    let rig = Rig::new(|number, request| after(millis(if number == 0 { 200 } else { 0 }), &right(request)));
    rig.wire.lock().unwrap().vanish_after_sending = true;
    let error = rig.read(100, 1).unwrap_err();
    assert!(matches!(&error.failure, Failure::Port(port) if port.kind == PortErrorKind::Lost), "{error}");
    rig.pass(millis(190));
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    let stats = rig.bus.stats();
    assert_eq!((stats.reconnects, stats.total.late, stats.total.resyncs), (1, 1, 1), "{stats:?}");
}

#[test]
fn a_read_goes_on_over_a_port_that_comes_back() {
    let rig = Rig::new(|_, request| at_once(&right(request)));
    rig.wire.lock().unwrap().vanish_after_sending = true;
    let again = CallOptions::new().retries(1);
    let request = Request::read(100, 1).unwrap();
    rig.call(unit(1).into(), &request, again, &mut || false, &mut |_| ()).unwrap();
    assert_eq!(rig.wire.lock().unwrap().opened, 2);
}

/// A server that is switched off lets the system try for seconds.
#[test]
fn who_gives_up_does_not_wait_for_a_port_to_open() {
    let rig = Rig::new(|_, request| at_once(&right(request)));
    rig.wire.lock().unwrap().vanish_after_sending = true;
    rig.read(100, 1).unwrap_err();
    let opening = Arc::clone(&rig.opening);
    let held = opening.lock().unwrap();
    let request = Request::read(100, 1).unwrap();
    let error = rig.call(unit(1).into(), &request, CallOptions::default(), &mut || true, &mut |_| ()).unwrap_err();
    assert_eq!((error.failure, error.sent), (Failure::Interrupted, None));
    drop(held);
    assert_eq!(rig.read(200, 1).unwrap(), [200]);
    assert_eq!(rig.wire.lock().unwrap().opened, 2, "the opening under way was waited for");
}

#[test]
fn a_write_that_was_not_sent_is_not_said_to_be() {
    let rig = Rig::new(|_, _| Vec::new());
    let write = Request::write(0x2001, 7);
    let error = rig.call(unit(1).into(), &write, CallOptions::default(), &mut || true, &mut |_| ()).unwrap_err();
    assert_eq!(error.failure, Failure::Interrupted);
    assert_eq!(rig.sent(&write), 0);
    assert_eq!(error.sent, None, "{error}");
}

/// A signal handler runs inside the question whether to give up; it must not wait for the call that asks.
#[test]
fn a_handler_may_use_the_bus_it_interrupts() {
    let rig = Rig::new(|_, _| Vec::new());
    let bus = &rig.bus;
    let request = Request::read(100, 1).unwrap();
    let mut inside = None;
    let mut handler = || {
        assert_eq!((bus.stats().reconnects, bus.notes().len()), (0, 0));
        assert_ne!(bus.fresh_word(), bus.fresh_word());
        assert_eq!(bus.link(unit(1)).asked, 0);
        let now = bus.now();
        bus.sleep(millis(5), &mut || false); // not here, where it would wait for itself
        assert_eq!(bus.now(), now);
        inside = Some(rig.ask(&Request::write(0x2000, 5)));
        bus.close();
        false
    };
    let error = rig.call(unit(1).into(), &request, CallOptions::default(), &mut handler, &mut |_| ()).unwrap_err();
    assert_eq!(error.failure, Failure::Closed);
    let inside = inside.unwrap().unwrap_err();
    assert_eq!((inside.failure, inside.sent), (Failure::NotBegun(BeginError::OutOfTurn), None));
    assert!(matches!(rig.read(100, 1).unwrap_err().failure, Failure::Closed));
}

#[test]
fn who_closes_the_bus_from_inside_listening_lets_go_of_the_port() {
    let rig = Rig::new(|_, _| Vec::new());
    let held = Arc::strong_count(&rig.wire);
    let ended = rig.bus.listen(
        millis(500),
        &mut || {
            rig.bus.close();
            false
        },
        &mut |_, _| (),
    );
    assert_eq!(ended, Err(Failure::Closed));
    assert_eq!(Arc::strong_count(&rig.wire), held - 1, "the line is gone");
}
