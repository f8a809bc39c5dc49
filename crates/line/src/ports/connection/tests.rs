//! Connections to this machine, and servers that close them.
#![cfg(target_os = "linux")]

use std::net::TcpListener;

use super::*;

const LONG: Duration = Duration::from_secs(20);

/// A connection, and the other side of it and of those that follow.
fn pair() -> (Connection, TcpStream, TcpListener) {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let connection = Connection::open("socket", "127.0.0.1", port, LONG, &Closing::default()).unwrap();
    let (server, _) = listener.accept().unwrap();
    (connection, server, listener)
}

/// A request that is answered by `answer`, which is taken.
fn exchange(connection: &mut Connection, server: &mut TcpStream, answer: &[u8]) {
    connection.send(b"?").unwrap();
    server.read_exact(&mut [0]).unwrap();
    server.write_all(answer).unwrap();
    let mut came = 0;
    while came < answer.len() {
        came += connection.receive(&mut [0; 8], monotonic() + LONG).unwrap();
    }
}

#[test]
fn a_server_that_hangs_up_inside_an_answer_is_told_from_one_that_says_nothing() {
    for (answer, said) in [(&b"\x01"[..], "behind 1 bytes"), (b"", "the other side closed it;")] {
        let (mut connection, mut server, _listener) = pair();
        exchange(&mut connection, &mut server, answer);
        drop(server);
        let error = connection.receive(&mut [0; 8], monotonic() + LONG).unwrap_err();
        assert!(error.message.contains(said), "{error}");
        assert!(!connection.closing.is_behind_answers());
    }
}

#[test]
fn a_server_that_closes_behind_its_answer_gets_a_connection_for_each() {
    let (mut connection, mut server, listener) = pair();
    for count in 0..4 {
        assert_eq!((connection.make_ready().unwrap(), connection.renewed), (count > 0, count));
        if count > 0 {
            server = listener.accept().unwrap().0;
        }
        exchange(&mut connection, &mut server, b"answer");
        server.shutdown(Shutdown::Both).unwrap();
        // Who looks what came behind it hears nothing of that.
        assert!(wait(&connection.stream, monotonic() + LONG).unwrap());
        assert_eq!(connection.receive(&mut [0; 8], Instant::ZERO).unwrap(), 0);
    }
    assert!(connection.notes()[0].contains("closes the connection behind each answer"));
}

#[test]
fn one_that_leaves_it_open_keeps_it() {
    let (mut connection, mut server, _listener) = pair();
    for _ in 0..3 {
        assert!(!connection.make_ready().unwrap());
        exchange(&mut connection, &mut server, b"answer");
    }
    assert!(connection.notes().is_empty());
    // Before anything was asked behind the answer, it says something.
    server.write_all(b"more").unwrap();
    assert!(wait(&connection.stream, monotonic() + LONG).unwrap());
    assert!(!connection.make_ready().unwrap());
    assert_eq!(connection.receive(&mut [0; 8], Instant::ZERO).unwrap(), 4);
}

#[test]
fn one_that_ended_while_nothing_was_asked_is_lost_before_anything_is_sent() {
    let (mut connection, mut server, listener) = pair();
    exchange(&mut connection, &mut server, b"answer");
    // A minute later.
    connection.answered = Some(Instant::ZERO);
    drop(server);
    assert!(wait(&connection.stream, monotonic() + LONG).unwrap());
    let error = connection.make_ready().unwrap_err();
    assert!(error.kind == PortErrorKind::Lost && error.message.contains("while nothing was asked"), "{error}");
    listener.set_nonblocking(true).unwrap();
    assert!(listener.accept().is_err(), "nobody connects behind the back of who counts that");
    let (mut fresh, server, _listener) = pair();
    drop(server);
    assert!(wait(&fresh.stream, monotonic() + LONG).unwrap());
    assert_eq!(fresh.make_ready().unwrap_err().kind, PortErrorKind::Lost);
}

#[test]
fn an_end_that_meets_the_next_request_teaches_the_habit() {
    let (mut connection, mut server, _listener) = pair();
    exchange(&mut connection, &mut server, b"answer");
    connection.send(b"?").unwrap();
    server.read_exact(&mut [0]).unwrap();
    drop(server);
    let error = connection.receive(&mut [0; 8], monotonic() + LONG).unwrap_err();
    assert!(error.message.contains("behind the answer before, and may not have heard"), "{error}");
    assert!(connection.closing.is_behind_answers());
}

#[test]
fn one_that_closes_and_is_gone_is_lost() {
    let (mut connection, mut server, listener) = pair();
    exchange(&mut connection, &mut server, b"answer");
    drop((server, listener));
    let error = connection.make_ready().unwrap_err();
    assert!(error.message.contains("behind its answer, and takes no other one"), "{error}");
}

#[test]
fn what_nobody_confirms_is_not_kept_for_long() {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let connection =
        Connection::open("socket", "127.0.0.1", port, Duration::from_secs(20), &Closing::default()).unwrap();
    assert_eq!(rustix::net::sockopt::tcp_user_timeout(&*connection.stream).unwrap(), 3_000); // milliseconds
}

#[test]
fn behind_a_whole_answer_the_end_is_a_silence() {
    const ANSWER: [u8; 7] = [0x01, 0x03, 0x02, 0x00, 0x03, 0xF8, 0x45];
    for len in 1..=ANSWER.len() {
        let (mut connection, mut server, _listener) = pair();
        exchange(&mut connection, &mut server, &[&[0xFF][..], &ANSWER[..len]].concat());
        drop(server);
        let until = monotonic() + Duration::from_millis(5);
        match connection.receive(&mut [0; 8], until) {
            Ok(count) => assert!(count == 0 && len == ANSWER.len() && monotonic() >= until, "{len}"),
            Err(error) => assert!(len < ANSWER.len() && error.message.contains("not all of the answer"), "{error}"),
        }
    }
}
