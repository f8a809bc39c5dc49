//! What goes out before a question whose unit may still answer another one, and what is said where nothing helps.

use drivebus_line::{CallError, CallOptions, Done};
use drivebus_rtu::Request;

use crate::scripted::{Rig, at_once, right, unit};

fn call(rig: &Rig, request: &Request<'_>, options: CallOptions) -> Result<Done, Box<CallError>> {
    rig.call(unit(1).into(), request, options, &mut || false, &mut |_| ())
}

/// What is verified is asked as it is, so that a read of another length comes before it. Nothing else is known of the unit.
#[test]
fn a_unit_that_never_answered_and_is_silent_on_08h_is_settled_by_a_read_of_another_length() {
    let script =
        |number, request: &[u8]| if number == 0 || request[1] == 8 { Vec::new() } else { at_once(&right(request)) };
    let rig = Rig::new(script);
    let (read, verify) = (Request::read(200, 1).unwrap(), CallOptions::new().verify(true));
    call(&rig, &read, verify).expect_err("it was not heard");
    call(&rig, &read, verify).expect_err("silence on an echo is all that is known");
    call(&rig, &read, verify).unwrap();
    assert_eq!(rig.sent(&Request::read(200, 2).unwrap()), 1);
}
