//! TCP connections to this machine.

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

/// So that it is known to be owed no more: once, whatever comes again.
#[test]
fn what_answers_an_earlier_transaction_is_handed_over_as_late_once() {
    let (mut line, mut far) = mbap();
    let transactions = [(); 3].map(|()| {
        line.send(&REQUEST).unwrap();
        next_request(&mut far).0
    });
    let late = answer(transactions[1], &[0x01, 0x83, 0x02]);
    let unknown = answer([0x7F, 0xFF], &BODY);
    let latest = answer(transactions[2], &BODY);
    far.write_all(&[&late[..], &late, &unknown, &latest, &latest].concat()).unwrap();
    assert_eq!(receive_exactly(&mut line, FRAME.len()), FRAME);
    assert_eq!(line.receive(&mut [0; 8], line.now() + Duration::from_millis(2)).unwrap(), 0);
    assert_eq!(line.take_late().unwrap(), [0x01, 0x83, 0x02, 0xC0, 0xF1]);
    assert_eq!(line.take_late(), None);

    // The answer to the latest came: a second one answers nothing that is open.
    line.send(&REQUEST).unwrap();
    far.write_all(&[latest, answer(transactions[0], &BODY)].concat()).unwrap();
    assert_eq!(line.receive(&mut [0; 8], line.now() + Duration::from_millis(2)).unwrap(), 0);
    assert_eq!(line.take_late().unwrap(), FRAME);
    assert_eq!(line.take_late(), None);
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
        assert!(error.to_string().contains("4 to 256"), "{error}");
    }
    line.send(&[0; 256]).unwrap();
    assert_eq!(next_request(&mut far).1, [0; 254]);
}
