//! Who knocks on the loopback and is no program of this user's, and who stands there in the place of one.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, LazyLock, Mutex};
use std::thread;

use drivebus_line::Share;

use crate::port::{open, open_as, options, read, sent};
use crate::{files, on_loopback};

/// How a guest begins.
const OPENING: &[u8] = b"drivebus proof 1";

/// Where the one that has the port listens, and the rest of its file.
fn address(folder: &Path) -> (u16, String) {
    let file = fs::read_to_string(&files(folder, "tcp")[0]).unwrap();
    let (port, secret) = file.strip_prefix("drivebus loopback 1 ").unwrap().split_once(' ').unwrap();
    (port.parse().unwrap(), secret.to_owned())
}

fn knock(folder: &Path) -> TcpStream {
    TcpStream::connect((Ipv4Addr::LOCALHOST, address(folder).0)).unwrap()
}

/// As it is sent: its length before it.
fn message(body: &[u8]) -> Vec<u8> {
    [&u32::try_from(body.len()).unwrap().to_le_bytes()[..], body].concat()
}

fn heard(stream: &mut TcpStream) -> Vec<u8> {
    let mut length = [0; 4];
    stream.read_exact(&mut length).unwrap();
    let mut body = vec![0; u32::from_le_bytes(length) as usize];
    stream.read_exact(&mut body).unwrap();
    body
}

/// Nothing more comes, and the connection ends.
#[track_caller]
fn assert_cut_off(mut stream: TcpStream) {
    let mut rest = Vec::new();
    // Where the system ends it before what was sent is read, that is an error.
    let _ = stream.read_to_end(&mut rest);
    assert_eq!(rest, []);
}

#[test]
fn who_says_what_is_no_proof_is_cut_off_and_the_line_goes_on() {
    on_loopback("outsiders::who_says_what_is_no_proof_is_cut_off_and_the_line_goes_on", |folder| {
        let (owner, guest) = (open(), open());
        let opening = [OPENING, &[7; 32]].concat();
        let hello = [b"drivebus share ", &[9, 4, b't', b'e', b's', b't'][..]].concat();
        let words: [&[u8]; 7] = [
            b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
            &[0; 64],
            &[0xFF; 4_096],
            &message(&hello),
            &message(&opening[1..]),
            &message(&[&opening[..], &[0]].concat()),
            &message(b""),
        ];
        for said in words {
            let mut stream = knock(folder);
            // It may be cut off before all of it is said.
            let _ = stream.write_all(said);
            assert_cut_off(stream);
        }
        // One that says nothing, and one that says half of it.
        let silent = knock(folder);
        let mut half = knock(folder);
        half.write_all(&message(&opening)[..20]).unwrap();
        assert_eq!((read(&guest, 1).unwrap(), read(&owner, 2).unwrap()), (1, 2));
        assert_cut_off(silent);
        assert_cut_off(half);
        assert_eq!((sent(), owner.stats().programs.len()), (2, 1));
    });
}

#[test]
fn who_does_not_know_the_secret_is_cut_off_however_its_bytes_are_cut() {
    on_loopback("outsiders::who_does_not_know_the_secret_is_cut_off_however_its_bytes_are_cut", |folder| {
        let owner = open();
        for piece in [1, 3, 1_000] {
            let mut stream = knock(folder);
            let say = |stream: &mut TcpStream, bytes: &[u8]| {
                bytes.chunks(piece).for_each(|piece| stream.write_all(piece).unwrap());
            };
            say(&mut stream, &message(&[OPENING, &[7; 32]].concat()));
            // It shows that it knows the secret, and waits for the same.
            assert_eq!(heard(&mut stream).len(), 32 + 4 + 8 + 32);
            say(&mut stream, &message(&[&4_711_u32.to_le_bytes()[..], &[7; 32]].concat()));
            assert_cut_off(stream);
        }
        assert_eq!((sent(), owner.stats().programs.len()), (0, 0));
    });
}

/// Listens on the loopback, says so in the file of the port with this secret, and lives as a program that has the port does.
fn stand_there(folder: &Path, secret: &str) -> (TcpListener, File) {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let there = listener.local_addr().unwrap().port();
    let lock = files(folder, "lock").remove(0);
    fs::write(lock.with_extension("tcp"), format!("drivebus loopback 1 {there} {secret}")).unwrap();
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(windows)]
    std::os::windows::fs::OpenOptionsExt::share_mode(&mut options, 4);
    let kept = options.open(lock.with_extension(format!("{there}.kept"))).unwrap();
    #[cfg(unix)]
    rustix::fs::flock(&kept, rustix::fs::FlockOperation::LockExclusive).unwrap();
    (listener, kept)
}

/// Carries what comes on, and keeps each message.
fn carry(mut from: TcpStream, mut to: TcpStream, kept: &Mutex<Vec<Vec<u8>>>) {
    let mut length = [0; 4];
    while from.read_exact(&mut length).is_ok() {
        let mut body = vec![0; u32::from_le_bytes(length) as usize];
        if from.read_exact(&mut body).is_err() || to.write_all(&message(&body)).is_err() {
            break;
        }
        kept.lock().unwrap().push(body);
    }
    // The other end may be gone already.
    let _ = to.shutdown(Shutdown::Both);
}

/// Stands between the program that has the port and those who knock there from now on; what the first of them says is kept.
fn stand_between(folder: &Path) -> Arc<Mutex<Vec<Vec<u8>>>> {
    let (port, secret) = address(folder);
    let (between, file) = stand_there(folder, &secret);
    let said = Arc::new(Mutex::new(Vec::new()));
    let kept = Arc::clone(&said);
    thread::spawn(move || {
        let _file = file;
        for (at, near) in between.incoming().enumerate() {
            let (near, far) = (near.unwrap(), TcpStream::connect((Ipv4Addr::LOCALHOST, port)).unwrap());
            let kept = if at == 0 { Arc::clone(&kept) } else { Arc::default() };
            let (back, back_to) = (far.try_clone().unwrap(), near.try_clone().unwrap());
            thread::spawn(move || carry(near, far, &kept));
            thread::spawn(move || carry(back, back_to, &Mutex::default()));
        }
    });
    said
}

#[test]
fn a_proof_that_was_heard_is_good_for_no_other_connection() {
    on_loopback("outsiders::a_proof_that_was_heard_is_good_for_no_other_connection", |folder| {
        let owner = open();
        let (port, _) = address(folder);
        let said = stand_between(folder);
        let guest = open();
        assert_eq!(read(&guest, 1).unwrap(), 1);
        let said = said.lock().unwrap().clone();
        assert!(said[0].starts_with(OPENING) && said[1].len() == 36 && said[2].starts_with(b"drivebus share "));
        assert!(said.len() > 3, "and what it wished");
        let mut again = TcpStream::connect((Ipv4Addr::LOCALHOST, port)).unwrap();
        again.write_all(&message(&said[0])).unwrap();
        heard(&mut again);
        let rest: Vec<u8> = said[1..].iter().flat_map(|body| message(body)).collect();
        // It may be cut off before all of it is said.
        let _ = again.write_all(&rest);
        assert_cut_off(again);
        assert_eq!((sent(), owner.stats().programs[0].calls), (1, 1));
    });
}

#[test]
fn a_thousand_who_knock_hold_up_nobody() {
    on_loopback("outsiders::a_thousand_who_knock_hold_up_nobody", |folder| {
        let (owner, guest) = (open(), open());
        let mut knocking = Vec::new();
        for number in 0..1_000_u16 {
            knocking.push(knock(folder));
            if number % 100 == 0 {
                assert_eq!((read(&guest, number).unwrap(), read(&owner, number).unwrap()), (number, number));
                knocking.drain(..knocking.len() / 2).for_each(drop);
            }
        }
        // Another program of this user comes in all the same.
        assert_eq!(read(&open(), 1).unwrap(), 1);
        knocking.into_iter().for_each(assert_cut_off);
        assert_eq!((sent(), owner.stats().programs.len()), (21, 1));
    });
}

/// Somebody who listens in the place of a program that has the port.
struct Impostor {
    told: Receiver<Vec<u8>>,
    _kept: File,
}

/// Listens where the file says, and keeps what is said there; answers each with `answer`.
fn impostor(folder: &Path, answer: &'static [u8]) -> Impostor {
    let (listener, kept) = stand_there(folder, &"5a".repeat(32));
    let (tell, told) = channel();
    thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut said = vec![0; 4 + OPENING.len() + 32];
            // On a busy machine a guest may have gone before it was heard; it comes again.
            let Ok(()) = stream.read_exact(&mut said).and_then(|()| stream.write_all(answer)) else { continue };
            // Until the guest ends it; that may be an error, where it has not read all.
            let _ = stream.read_to_end(&mut said);
            tell.send(said).unwrap();
        }
    });
    Impostor { told, _kept: kept }
}

#[test]
fn who_stands_in_the_place_of_a_program_learns_nothing() {
    on_loopback("outsiders::who_stands_in_the_place_of_a_program_learns_nothing", |folder| {
        open().close();
        for answer in [wrong_code(), &[0xFF; 80], b"HTTP/1.1 400 Bad Request\r\n\r\n", &[0; 4]] {
            let impostor = impostor(folder, answer);
            // Nobody has the port: it is opened, and the impostor's file is replaced.
            let bus = open();
            assert_eq!(read(&bus, 1).unwrap(), 1);
            let said = impostor.told.recv().unwrap();
            assert_eq!(said.len(), 4 + OPENING.len() + 32, "how it begins, and a nonce");
            assert_eq!(said[4..4 + OPENING.len()], *OPENING);
            assert_eq!(read(&open(), 2).unwrap(), 2, "others find the one that has it");
            bus.close();
        }
    });
}

#[test]
fn a_file_that_was_left_behind_is_followed_by_nobody() {
    on_loopback("outsiders::a_file_that_was_left_behind_is_followed_by_nobody", |folder| {
        open().close();
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let there = listener.local_addr().unwrap().port();
        let file = files(folder, "lock")[0].with_extension("tcp");
        fs::write(&file, format!("drivebus loopback 1 {there} {}", "5a".repeat(32))).unwrap();
        let (owner, guest) = (open(), open());
        assert_eq!((read(&owner, 1).unwrap(), read(&guest, 2).unwrap()), (1, 2));
        listener.set_nonblocking(true).unwrap();
        assert_eq!(listener.accept().unwrap_err().kind(), ErrorKind::WouldBlock, "nobody knocked there");
    });
}

/// A message that is as long as an owner's.
fn wrong_code() -> &'static [u8] {
    static MESSAGE: LazyLock<Vec<u8>> = LazyLock::new(|| message(&[7; 76]));
    &MESSAGE
}

#[test]
fn who_stands_in_the_place_of_a_program_that_has_the_port_is_told_of() {
    on_loopback("outsiders::who_stands_in_the_place_of_a_program_that_has_the_port_is_told_of", |folder| {
        let owner = open_as(options().share(Share::Own)).unwrap();
        let impostor = impostor(folder, wrong_code());
        let error = open_as(options()).unwrap_err().to_string();
        assert!(error.contains("is no program of this user's: it does not know their secret"), "{error}");
        assert_eq!(impostor.told.recv().unwrap().len(), 4 + OPENING.len() + 32);
        assert_eq!(read(&owner, 1).unwrap(), 1);
    });
}

/// The greeting comes behind the proof, and says the version as it always did.
#[test]
fn a_program_of_another_version_is_told_so() {
    on_loopback("outsiders::a_program_of_another_version_is_told_so", |folder| {
        let _owner = open();
        // Between them stands somebody who changes the version in what the guest says third.
        let (port, secret) = address(folder);
        let (between, _kept) = stand_there(folder, &secret);
        let guest = thread::spawn(|| open_as(options()).unwrap_err().to_string());
        let (mut near, _) = between.accept().unwrap();
        let mut far = TcpStream::connect((Ipv4Addr::LOCALHOST, port)).unwrap();
        far.write_all(&message(&heard(&mut near))).unwrap();
        near.write_all(&message(&heard(&mut far))).unwrap();
        far.write_all(&message(&heard(&mut near))).unwrap();
        let mut greeting = heard(&mut near);
        greeting["drivebus share ".len()] += 1;
        far.write_all(&message(&greeting)).unwrap();
        near.write_all(&message(&heard(&mut far))).unwrap();
        let error = guest.join().unwrap();
        assert!(error.contains("is of another version of drivebus"), "{error}");
    });
}
