//! What words do to inverters of routers' spindles that only programs tell of. Words are typed by hand.

use crate::bench::{Bench, hex};

fn asks(bench: &mut Bench, pdu: &str, answer: &str) {
    assert_eq!(bench.ask(1, &hex(pdu)), Some(hex(answer)), "{pdu}");
}

/// As bdring/FluidNC sends it (NowForeverProtocol.cpp): all is written by 10H. 1388H are 50.00 Hz.
#[test]
fn a_nowforever_is_run_by_10h_alone() {
    let mut bench = Bench::of("nowforever");
    asks(&mut bench, "06 09 00 00 01", "86 01");
    asks(&mut bench, "03 09 00 00 01", "83 02");
    asks(&mut bench, "10 00 00 00 01 02 00 02", "10 00 00 00 01");
    asks(&mut bench, "10 00 02 00 01 02 00 06", "10 00 02 00 01");
    asks(&mut bench, "10 09 01 00 01 02 13 88", "10 09 01 00 01");
    for (word, state) in [("01", "01"), ("03", "03"), ("00", "00")] {
        asks(&mut bench, &format!("10 09 00 00 01 02 00 {word}"), "10 09 00 00 01");
        let begin = bench.taken();
        bench.go_to(begin, 60.0);
        asks(&mut bench, "03 05 00 00 01", &format!("03 02 00 {state}"));
        let hertz = if word == "00" { "00 00" } else { "13 88" };
        asks(&mut bench, "03 05 02 00 01", &format!("03 02 {hertz}"));
    }
}
