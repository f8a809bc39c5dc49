//! Real ports behind the trait [`Line`]: pseudo-terminals and TCP connections of this machine.
//!
//! Nothing here judges by how long something took: a deadline is only held not to end early, on the line's own clock.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use drivebus_line::{Line, PortErrorKind};
use drivebus_rtu::{DataBits, Duration, Instant, Parity, SerialFormat, Silence, StopBits};

/// Longer than anything here takes; a test that hits it fails by its assertion, not by the clock.
const LONG: Duration = Duration::from_secs(20);

/// 03H to unit 1, two words from 2100H, CRC by the bitwise rule of the specification.
const REQUEST: [u8; 8] = [0x01, 0x03, 0x21, 0x00, 0x00, 0x02, 0xCE, 0x37];

fn format(parity: Parity) -> SerialFormat {
    SerialFormat::new(19_200, DataBits::Eight, parity, StopBits::One, Silence::Spec).unwrap()
}

/// Receives until `count` bytes are there, however they are cut.
fn receive_exactly(line: &mut impl Line, count: usize) -> Vec<u8> {
    let until = line.now() + LONG;
    let mut bytes = Vec::new();
    while bytes.len() < count {
        let mut buffer = [0x80; 256];
        let got = line.receive(&mut buffer, until).unwrap();
        assert_ne!(got, 0, "only {bytes:02X?} of {count} bytes came");
        bytes.extend_from_slice(&buffer[..got]);
    }
    bytes
}

/// The deadline of an empty line is kept, to the nanosecond on the early side.
fn check_deadlines(line: &mut impl Line) {
    let mut buffer = [0; 8];
    for micros in [0, 40, 110, 2_005, 20_000] {
        let until = line.now() + Duration::from_micros(micros);
        assert_eq!(line.receive(&mut buffer, until).unwrap(), 0);
        assert!(line.now() >= until, "receive of {micros} µs came back early");
        let until = line.now() + Duration::from_micros(micros);
        line.sleep(until);
        assert!(line.now() >= until, "sleep of {micros} µs came back early");
    }
    let past = Instant::from_nanos(line.now().as_nanos().saturating_sub(1_000_000));
    assert_eq!(line.receive(&mut buffer, past).unwrap(), 0);
    line.sleep(past);
}

/// The end of what was sent lies behind now by its characters, and behind what was sent before.
fn check_wire_time(line: &mut impl Line, format: &SerialFormat) {
    let before = line.now();
    let first = line.send(&REQUEST).unwrap();
    assert!(first >= before + format.chars(8));
    let second = line.send(&REQUEST).unwrap();
    assert!(second >= first + format.chars(8));
}

#[cfg(unix)]
mod pty {
    use std::fs::File;
    use std::io::{Read, Write};
    use std::os::fd::OwnedFd;

    use drivebus_line::rs485::Rs485;
    use drivebus_line::tty::{Tty, TtyOptions};
    use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
    use rustix::termios::{ControlModes, tcgetattr};

    use super::*;

    /// The other side of a pseudo-terminal, and the path to open.
    fn pair() -> (File, String) {
        let far: OwnedFd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&far).unwrap();
        unlockpt(&far).unwrap();
        let path = ptsname(&far, Vec::new()).unwrap().into_string().unwrap();
        (far.into(), path)
    }

    fn open(path: &str, parity: Parity) -> Tty {
        Tty::open(path, &format(parity), &TtyOptions::default()).unwrap()
    }

    fn kind_of(path: &str) -> PortErrorKind {
        Tty::open(path, &format(Parity::Even), &TtyOptions::default()).unwrap_err().kind
    }

    #[test]
    fn every_byte_goes_both_ways_unchanged() {
        let (mut far, path) = pair();
        let mut line = open(&path, Parity::Even);
        assert_eq!(line.name(), path);
        assert!(!line.gapless());
        let all: Vec<u8> = (0..=255).collect();

        line.send(&all).unwrap();
        let mut there = vec![0x80; 256];
        far.read_exact(&mut there).unwrap();
        assert_eq!(there, all);

        far.write_all(&all).unwrap();
        assert_eq!(receive_exactly(&mut line, 256), all);
    }

    #[test]
    fn a_frame_in_lumps_and_a_small_buffer_lose_nothing() {
        let (mut far, path) = pair();
        let mut line = open(&path, Parity::None);
        let mut bytes = Vec::new();
        for lump in REQUEST.chunks(3) {
            far.write_all(lump).unwrap();
            bytes.extend(receive_exactly(&mut line, lump.len()));
        }
        assert_eq!(bytes, REQUEST);

        far.write_all(&REQUEST).unwrap();
        let until = line.now() + LONG;
        let mut bytes = Vec::new();
        while bytes.len() < REQUEST.len() {
            let mut one = [0x80];
            assert_eq!(line.receive(&mut one, until).unwrap(), 1);
            bytes.push(one[0]);
        }
        assert_eq!(bytes, REQUEST);
    }

    #[test]
    fn bytes_that_come_during_the_wait_end_it() {
        let (mut far, path) = pair();
        let mut line = open(&path, Parity::Even);
        let answering = std::thread::spawn(move || {
            let mut request = [0; 8];
            far.read_exact(&mut request).unwrap();
            far.write_all(&request).unwrap();
            far // kept open until the answer was taken
        });
        line.send(&REQUEST).unwrap();
        assert_eq!(receive_exactly(&mut line, 8), REQUEST);
        answering.join().unwrap();
    }

    #[test]
    fn parity_is_left_away_kept_in_the_timing_and_noted() {
        let (far, path) = pair();
        let even = open(&path, Parity::Even);
        assert_eq!(even.notes().len(), 1);
        assert!(even.notes()[0].starts_with("parity is not on the wire"), "{:?}", even.notes());
        assert!(even.notes()[0].contains("19200 8E1"), "{:?}", even.notes());
        drop(even);

        let none = open(&path, Parity::None);
        assert!(none.notes().is_empty(), "{:?}", none.notes());
        drop(none);

        let seven = SerialFormat::new(9_600, DataBits::Seven, Parity::Odd, StopBits::Two, Silence::Characters).unwrap();
        let seven = Tty::open(&path, &seven, &TtyOptions::default()).unwrap();
        assert_eq!(seven.notes().len(), 2);
        let settings = tcgetattr(&far).unwrap();
        assert!(settings.control_modes.contains(ControlModes::CSTOPB));
        assert_eq!(settings.control_modes & ControlModes::CSIZE, ControlModes::CS8);
    }

    #[test]
    fn any_speed_is_set() {
        let (far, path) = pair();
        for baud_rate in [1_200, 9_600, 115_200, 187_500, 250_000] {
            let format =
                SerialFormat::new(baud_rate, DataBits::Eight, Parity::Even, StopBits::One, Silence::Spec).unwrap();
            let mut line = Tty::open(&path, &format, &TtyOptions::default()).unwrap();
            assert_eq!(tcgetattr(&far).unwrap().output_speed(), baud_rate);
            check_wire_time(&mut line, &format);
        }
    }

    #[test]
    fn what_was_queued_before_the_opening_is_discarded() {
        let (mut far, path) = pair();
        let first = open(&path, Parity::Even);
        far.write_all(b"stale\n").unwrap();
        drop(first);
        let mut line = open(&path, Parity::Even);
        far.write_all(&REQUEST).unwrap();
        assert_eq!(receive_exactly(&mut line, 8), REQUEST);
    }

    #[test]
    fn deadlines_are_kept() {
        let (_far, path) = pair();
        check_deadlines(&mut open(&path, Parity::Even));
    }

    #[test]
    fn a_receive_into_nothing_is_a_wait_and_no_loss() {
        let (mut far, path) = pair();
        let mut line = open(&path, Parity::Even);
        far.write_all(&REQUEST).unwrap();
        let until = line.now() + Duration::from_millis(1);
        assert_eq!(line.receive(&mut [], until).unwrap(), 0);
        assert!(line.now() >= until);
        assert_eq!(receive_exactly(&mut line, 8), REQUEST);
    }

    #[test]
    fn a_second_opening_is_refused_until_the_first_is_closed() {
        let (_far, path) = pair();
        let first = open(&path, Parity::Even);
        let error = Tty::open(&path, &format(Parity::Even), &TtyOptions::default()).unwrap_err();
        assert_eq!(error.kind, PortErrorKind::Busy);
        assert!(error.to_string().starts_with(&format!("{path}: another program has it")), "{error}");
        let shared = TtyOptions { exclusive: false, ..TtyOptions::default() };
        assert!(Tty::open(&path, &format(Parity::Even), &shared).is_ok());
        drop(first);
        open(&path, Parity::Even);
    }

    #[test]
    fn a_lock_of_another_program_is_respected() {
        let (_far, path) = pair();
        let other = File::open(&path).unwrap();
        rustix::fs::flock(&other, rustix::fs::FlockOperation::NonBlockingLockExclusive).unwrap();
        assert_eq!(kind_of(&path), PortErrorKind::Busy);
    }

    #[test]
    fn what_is_no_serial_port_is_refused() {
        assert_eq!(kind_of("/dev/ttyNoSuchPort"), PortErrorKind::NotFound);
        assert_eq!(kind_of(""), PortErrorKind::NotFound);
        assert_eq!(kind_of("/dev/null"), PortErrorKind::Unsupported);
        assert_eq!(kind_of(env!("CARGO_MANIFEST_DIR")), PortErrorKind::Unsupported);
        let with_zero = Tty::open("/dev/tty\0", &format(Parity::Even), &TtyOptions::default()).unwrap_err();
        assert_eq!(with_zero.kind, PortErrorKind::NotFound);
    }

    #[test]
    fn a_closed_far_side_is_a_lost_port_every_time() {
        let (mut far, path) = pair();
        let mut line = open(&path, Parity::Even);
        far.write_all(&REQUEST).unwrap();
        assert_eq!(receive_exactly(&mut line, 8), REQUEST);
        drop(far);
        let until = line.now() + LONG;
        for _ in 0..3 {
            let error = line.receive(&mut [0; 8], until).unwrap_err();
            assert_eq!(error.kind, PortErrorKind::Lost);
            assert!(error.to_string().starts_with(&format!("{path}: the port is gone")), "{error}");
            assert_eq!(line.send(&REQUEST).unwrap_err().kind, PortErrorKind::Lost);
        }
        assert!(line.now() < until, "the loss ended the wait");
    }

    #[test]
    fn a_far_side_that_takes_nothing_is_a_lost_port_in_the_end() {
        let (_far, path) = pair();
        let mut line = open(&path, Parity::None);
        // A pseudo-terminal holds some kilobytes; a megabyte that nobody reads cannot fit.
        let error = (0..4_096).find_map(|_| line.send(&[0x55; 256]).err()).unwrap();
        assert_eq!(error.kind, PortErrorKind::Lost);
        assert!(error.to_string().contains("takes no more bytes"), "{error}");
    }

    #[test]
    fn rs485_mode_is_refused_where_there_is_none() {
        let (_far, path) = pair();
        let refused = |rs485| {
            let options = TtyOptions { rs485: Some(rs485), ..TtyOptions::default() };
            Tty::open(&path, &format(Parity::Even), &options).unwrap_err()
        };
        let error = refused(Rs485::default());
        assert_eq!(error.kind, PortErrorKind::Unsupported);
        assert!(error.to_string().contains("RS-485"), "{error}");
        let error = refused(Rs485 { delay_after_ms: 101, ..Rs485::default() });
        assert!(error.to_string().contains("101 ms") && error.to_string().contains("0..=100 ms"), "{error}");
        open(&path, Parity::Even); // the refusals left nothing locked
    }
}

mod tcp {
    use std::io::{Read, Write};
    use std::net::{TcpListener, TcpStream};

    use drivebus_line::mbap::ModbusTcp;
    use drivebus_line::tcp::RtuOverTcp;

    use super::*;

    fn listen() -> (TcpListener, u16) {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        (listener, port)
    }

    fn rtu() -> (RtuOverTcp, TcpStream) {
        let (listener, port) = listen();
        let line = RtuOverTcp::connect("127.0.0.1", port, &format(Parity::Even), LONG).unwrap();
        (line, listener.accept().unwrap().0)
    }

    fn mbap() -> (ModbusTcp, TcpStream) {
        let (listener, port) = listen();
        let line = ModbusTcp::connect("127.0.0.1", port, LONG).unwrap();
        (line, listener.accept().unwrap().0)
    }

    /// A port on which nobody listens: our own end of a connection, nobody else's for as long as that is held.
    fn deserted() -> (TcpStream, u16) {
        let (_listener, port) = listen();
        let held = TcpStream::connect(("127.0.0.1", port)).unwrap();
        let port = held.local_addr().unwrap().port();
        (held, port)
    }

    #[test]
    fn bytes_go_both_ways_and_are_cut_anyhow() {
        let (mut line, mut far) = rtu();
        assert!(!line.gapless());
        assert_eq!(line.name(), format!("socket://{}", far.local_addr().unwrap()));
        check_wire_time(&mut line, &format(Parity::Even));
        let mut there = [0; 16];
        far.read_exact(&mut there).unwrap();
        assert_eq!(there[..8], REQUEST);
        assert_eq!(there[8..], REQUEST);
        for lump in REQUEST.chunks(3) {
            far.write_all(lump).unwrap();
            assert_eq!(receive_exactly(&mut line, lump.len()), lump);
        }
    }

    #[test]
    fn deadlines_are_kept() {
        let (mut line, _far) = rtu();
        check_deadlines(&mut line);
        let (mut line, _far) = mbap();
        check_deadlines(&mut line);
    }

    #[test]
    fn a_closed_connection_is_a_lost_port_every_time() {
        let (mut line, mut far) = rtu();
        far.write_all(&REQUEST).unwrap();
        drop(far);
        assert_eq!(receive_exactly(&mut line, 8), REQUEST);
        for _ in 0..3 {
            let error = line.receive(&mut [0; 8], line.now() + LONG).unwrap_err();
            assert_eq!(error.kind, PortErrorKind::Lost);
            assert!(error.to_string().contains("the connection is gone"), "{error}");
        }
    }

    #[test]
    fn nobody_there_is_said() {
        let (_held, port) = deserted();
        let error = RtuOverTcp::connect("127.0.0.1", port, &format(Parity::Even), LONG).unwrap_err();
        assert_eq!(error.kind, PortErrorKind::NotFound);
        assert!(error.to_string().starts_with(&format!("socket://127.0.0.1:{port}: ")), "{error}");
        assert!(error.to_string().contains("nobody listens"), "{error}");
        assert_eq!(ModbusTcp::connect("127.0.0.1", port, LONG).unwrap_err().port, format!("tcp://127.0.0.1:{port}"));
        let error = ModbusTcp::connect("no host", 502, LONG).unwrap_err();
        assert_eq!(error.kind, PortErrorKind::NotFound);
        assert!(error.to_string().contains("there is no host \"no host\""), "{error}");
    }

    /// The header of what the line sends next, and what follows it.
    fn next_request(far: &mut TcpStream) -> ([u8; 2], Vec<u8>) {
        let mut prefix = [0; 6];
        far.read_exact(&mut prefix).unwrap();
        assert_eq!(prefix[2..4], [0, 0]);
        let mut body = vec![0; usize::from(u16::from_be_bytes([prefix[4], prefix[5]]))];
        far.read_exact(&mut body).unwrap();
        ([prefix[0], prefix[1]], body)
    }

    /// Unit 1 answers 03H with the words 1 and 2; the frame as on an RS-485 line.
    const BODY: [u8; 7] = [0x01, 0x03, 0x04, 0x00, 0x01, 0x00, 0x02];
    const FRAME: [u8; 9] = [0x01, 0x03, 0x04, 0x00, 0x01, 0x00, 0x02, 0x2A, 0x32];

    fn answer(transaction: [u8; 2], body: &[u8]) -> Vec<u8> {
        let length = u16::try_from(body.len()).unwrap().to_be_bytes();
        [&transaction, &[0, 0], &length, body].concat()
    }

    #[test]
    fn a_frame_is_wrapped_and_its_answer_unwrapped_however_it_is_cut() {
        let (mut line, mut far) = mbap();
        assert!(line.gapless());
        let mut transactions = Vec::new();
        for cut in [1, 2, 5, 6, 7, 8, 13] {
            line.send(&REQUEST).unwrap();
            let (transaction, body) = next_request(&mut far);
            assert_eq!(body, REQUEST[..6]);
            assert!(!transactions.contains(&transaction), "{transaction:?} again");
            transactions.push(transaction);

            let bytes = answer(transaction, &BODY);
            far.write_all(&bytes[..cut]).unwrap();
            if cut < bytes.len() {
                assert_eq!(line.receive(&mut [0; 8], line.now() + Duration::from_millis(2)).unwrap(), 0);
                far.write_all(&bytes[cut..]).unwrap();
            }
            assert_eq!(receive_exactly(&mut line, FRAME.len()), FRAME);
        }
        assert!(line.notes().is_empty(), "{:?}", line.notes());
    }

    #[test]
    fn answers_of_other_transactions_are_dropped_and_counted() {
        let (mut line, mut far) = mbap();
        line.send(&REQUEST).unwrap();
        let (old, _) = next_request(&mut far);
        line.send(&REQUEST).unwrap();
        let (new, _) = next_request(&mut far);
        // The late answer to the first, then the right one twice, all in one segment.
        let late = answer(old, &[0x01, 0x03, 0x04, 0xDE, 0xAD, 0xBE, 0xEF]);
        far.write_all(&[late, answer(new, &BODY), answer(new, &BODY)].concat()).unwrap();
        assert_eq!(receive_exactly(&mut line, FRAME.len()), FRAME);
        assert_eq!(line.receive(&mut [0; 8], line.now() + Duration::from_millis(2)).unwrap(), 0);
        assert_eq!(line.notes(), ["answers with another transaction than asked, dropped: 2"]);
    }

    #[test]
    fn an_answer_left_over_is_gone_with_the_next_request() {
        let (mut line, mut far) = mbap();
        line.send(&REQUEST).unwrap();
        let (transaction, _) = next_request(&mut far);
        far.write_all(&answer(transaction, &BODY)).unwrap();
        assert_eq!(line.receive(&mut [0; 4], line.now() + LONG).unwrap(), 4);
        line.send(&REQUEST).unwrap();
        let (transaction, _) = next_request(&mut far);
        far.write_all(&answer(transaction, &BODY)).unwrap();
        assert_eq!(receive_exactly(&mut line, FRAME.len()), FRAME);
    }

    #[test]
    fn a_server_that_speaks_something_else_is_lost_with_a_hint() {
        for bytes in [&FRAME[..], &[0, 1, 0, 0, 0, 1, 1], &[0, 1, 0, 0, 0, 255, 1], b"HTTP/1.1 400 Bad Request"] {
            let (mut line, mut far) = mbap();
            line.send(&REQUEST).unwrap();
            far.write_all(bytes).unwrap();
            let error = line.receive(&mut [0; 256], line.now() + LONG).unwrap_err();
            assert_eq!(error.kind, PortErrorKind::Lost);
            assert!(error.to_string().contains("socket://"), "{error}");
        }
    }

    #[test]
    fn a_closed_modbus_connection_is_lost() {
        let (mut line, far) = mbap();
        drop(far);
        assert_eq!(line.receive(&mut [0; 8], line.now() + LONG).unwrap_err().kind, PortErrorKind::Lost);
    }

    #[test]
    fn only_whole_frames_are_sent() {
        let (mut line, mut far) = mbap();
        for length in [0, 1, 3, 257] {
            let error = line.send(&vec![0; length]).unwrap_err();
            assert_eq!(error.kind, PortErrorKind::Unsupported);
            assert!(error.to_string().contains("4..=256"), "{error}");
        }
        line.send(&[0; 256]).unwrap();
        assert_eq!(next_request(&mut far).1, [0; 254]);
    }
}
