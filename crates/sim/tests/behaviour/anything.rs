//! Whatever a master does, a drive answers with a right frame of its own or stays silent.

use drivebus_line::Line;
use drivebus_rtu::Frame;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use crate::bench::{Bench, framed, pdu};

/// PDUs of the four functions with words near the edges of the map, and any other bytes.
fn any_pdu() -> impl Strategy<Value = Vec<u8>> {
    let address = prop_oneof![
        0x0000..0x0010_u16,
        0x06FE..0x0722_u16,
        0x0E00..0x0E06_u16,
        0x1FFE..0x2012_u16,
        0x2FFE..0x3019_u16,
        0x0AFE..0x0B07_u16,
        0x18FE..0x1902_u16,
        0x1AFE..0x1B15_u16,
        0x1DFE..0x1E10_u16,
        0x6FFE..0x700D_u16,
        0x0BD4..0x0BD8_u16,
        0xC34E..0xC35B_u16,
        0xC416..0xC423_u16,
        any::<u16>()
    ];
    let words = (prop_oneof![Just(0x03), Just(0x06), Just(0x08), Just(0x10)], address, vec(0..20_u16, 0..4));
    prop_oneof![
        words.prop_map(|(function, address, rest)| {
            let all: Vec<u16> = [address].into_iter().chain(rest).collect();
            pdu(function, &all)
        }),
        vec(any::<u8>(), 1..60)
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn every_request_gets_a_right_frame_or_silence(
        family in select(vec!["gd350", "gd10", "gd600", "gd3000", "gd3000-rectifier", "vfd500", "chf100a", "ms300", "vfd-e", "yl620", "md500", "fr-d700", "a1000", "j1000", "vf-s15", "cfw500", "nowforever", "frenic", "saj8000m", "eds300", "sunfar-e300", "fc51", "fc202", "atv312", "atv12", "atv600", "atv71", "atv320", "v20", "acs355", "acs580", "optidrive-e3", "optidrive-p2", "e510", "f510", "gs2", "gs4", "vfd-b", "vacon10", "dc1", "smd", "starvert", "x200"]),
        pdus in vec(any_pdu(), 1..30)
    ) {
        let mut bench = Bench::of(family);
        for (address, value) in [(0x0001, 2), (0x0002, 2 * u16::from(family == "vfd500")), (0x0006, 8)] {
            bench.ask(1, &pdu(0x06, &[address, value]));
        }
        for pdu in pdus {
            let answer = bench.exchange(&framed(1, &pdu));
            if pdu[0] & 0x80 != 0 {
                prop_assert!(answer.is_empty(), "{pdu:02X?} is an exception, no request");
                continue;
            }
            let frame = Frame::parse(&answer).map_err(|error| TestCaseError::fail(format!("{pdu:02X?}: {error}")))?;
            prop_assert_eq!(frame.address(), 1);
            prop_assert_eq!(frame.pdu()[0] & 0x7F, pdu[0]);
        }
    }

    #[test]
    fn noise_gets_silence_and_a_right_frame_after_it_an_answer(
        noise in vec((vec(any::<u8>(), 0..40), 0..5_000_000_u64), 0..20)
    ) {
        let mut bench = Bench::new();
        for (bytes, gap) in noise {
            bench.line.send(&bytes).unwrap();
            let until = bench.line.now() + std::time::Duration::from_nanos(gap);
            bench.line.sleep(until);
        }
        // All of it is over by then; a frame in it that was right by chance has been answered.
        let quiet = bench.line.now() + std::time::Duration::from_secs(10);
        bench.line.sleep(quiet);
        let _ = bench.line.receive(&mut [0; 4_096], quiet);
        prop_assert_eq!(bench.exchange(&framed(1, &[0x08, 0, 0, 0x12, 0xAB])), framed(1, &[0x08, 0, 0, 0x12, 0xAB]));
    }
}
