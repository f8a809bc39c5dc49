//! What comes in before a call asks, while nothing of it is on the wire.

use drivebus_rtu::*;

use crate::among_others::rig;
use crate::rig::*;

#[test]
fn what_is_there_when_a_call_begins_is_taken_down_before_it_is_chosen_how_to_ask() {
    let mut rig = rig();
    assert_eq!(rig.run(ask(9, 1)).end, End::Words(vec![9]));
    rig.now = rig.now + ms(200);
    rig.comes(ms(0), words(&[0x77]));
    let told = rig.run(ask(9, 1));
    assert_eq!(told.end, End::Words(vec![9]));
    assert!(told.sent.iter().all(|frame| frame[5] != 1), "another master asks for one word: {:02X?}", told.sent);
}

#[test]
fn the_rest_of_a_frame_that_is_coming_in_is_waited_for() {
    let (mut rig, fresh, frame) = (rig(), FreshWords::beginning_at(1), words(&[0x77]));
    rig.known.stray(rig.now, &frame[..4]);
    let mut call = Conversation::new(ask(9, 1), &fresh);
    assert!(matches!(call.next(rig.now, &mut rig.known), Step::LetPass));
    // Whoever listens may be woken before.
    for _ in 0..3 {
        let Step::Listen(until) = call.next(rig.now, &mut rig.known) else { panic!("it does not listen") };
        assert!(until > rig.now);
        assert_eq!(call.heard(rig.now, &mut rig.known, &[]), Ok(0));
    }
    rig.comes(ms(1), frame[4..].to_vec());
    assert_eq!(rig.carry_out(&mut call).end, End::Words(vec![9]));
    let strays = rig.known.take_strays();
    assert_eq!((strays.late, strays.noise), (1, 0), "it was whole");
}

#[test]
fn a_frame_whose_rest_never_comes_is_waited_for_no_longer_than_the_silence_that_ends_it() {
    let mut rig = rig();
    let began = rig.now;
    rig.known.stray(rig.now, &words(&[0x77])[..4]);
    let told = rig.run(ask(9, 1));
    assert_eq!((told.end, told.sent[0].clone()), (End::Words(vec![9]), read(9, 1)));
    assert!(told.last_sent.is_some_and(|sent| sent < began + ms(20)), "{:?}", told.last_sent);
    assert_eq!(rig.known.take_strays().noise, 4);
}
