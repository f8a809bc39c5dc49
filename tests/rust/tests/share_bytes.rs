//! The bytes of a shared port: what two programs say to each other through a relay that writes it down, the file of a last
//! will, and the types of `drivebus-line` that anybody can serialize. By `tests/vectors/share.toml`.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fmt::Debug;
use std::fs;
use std::io::{Read, Write};
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use drivebus_line::url::{Known, PortOptions, PortUrl};
use drivebus_line::{
    AdapterEcho, Bus, BusOptions, CallError, CallOptions, Counters, Done, LastWill, Latency, Named, Priority, Program,
    UnitOptions, run_time_folder,
};
use drivebus_rtu::{AnswerLength, ExceptionCode, Meaning, Meanings, Request, SerialFormat, UnitAddress};
use drivebus_sim::{Options, Simulator};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

#[derive(Deserialize)]
struct Document {
    version: u8,
    said: Vec<Message>,
    will: Will,
    latency: Form,
    program: Form,
    counters: Form,
}

#[derive(Deserialize)]
struct Message {
    what: String,
    by: String,
    bytes: String,
}

#[derive(Deserialize)]
struct Will {
    after: usize,
    bytes: String,
}

#[derive(Deserialize)]
struct Form {
    postcard: String,
    json: String,
    mean_ns: Option<u64>,
}

fn document() -> Document {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../vectors/share.toml");
    toml::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

fn hex(text: &str) -> Vec<u8> {
    let pairs = text.split_whitespace().filter(|pair| *pair != "|");
    pairs.map(|pair| u8::from_str_radix(pair, 16).unwrap()).collect()
}

/// A number at the beginning of `bytes`, seven bits a byte, and what follows it.
fn number(bytes: &[u8]) -> Option<(usize, &[u8])> {
    let end = bytes.iter().position(|byte| byte & 0x80 == 0)?;
    let value = bytes[..=end].iter().rev().fold(0, |value, byte| value << 7 | usize::from(byte & 0x7F));
    Some((value, &bytes[end + 1..]))
}

/// What is left of `bytes` behind one word of a vector; `None` where they are not alike.
fn behind<'a>(bytes: &'a [u8], word: &str) -> Option<&'a [u8]> {
    match word {
        "|" => Some(bytes),
        "*" => number(bytes).map(|(_, rest)| rest),
        "text" => number(bytes).and_then(|(length, rest)| rest.get(length..)),
        pair => bytes.strip_prefix(&[u8::from_str_radix(pair, 16).unwrap()]),
    }
}

#[track_caller]
fn assert_alike(came: &[u8], wanted: &str, what: &str) {
    let rest = wanted.split_whitespace().try_fold(came, behind);
    assert!(rest.is_some_and(<[u8]>::is_empty), "{what}: {wanted} is wanted, {came:02X?} came");
}

/// Who said what, whole messages without their lengths.
type Log = Arc<Mutex<Vec<(&'static str, Vec<u8>)>>>;

fn carry(mut from: UnixStream, mut to: UnixStream, by: &'static str, log: &Log) {
    let mut length = [0; 4];
    while from.read_exact(&mut length).is_ok() {
        let mut message = vec![0; u32::from_le_bytes(length) as usize];
        if from.read_exact(&mut message).is_err() {
            break;
        }
        log.lock().unwrap().push((by, message.clone()));
        if to.write_all(&[&length[..], &message].concat()).is_err() {
            break;
        }
    }
    let _ = to.shutdown(std::net::Shutdown::Both);
}

/// Stands in the place of a socket from now on, passes on what is said there, and writes down the first connection: the
/// guest keeps a second one, over which nothing is said.
fn relay(socket: &Path) -> Log {
    let behind = socket.with_extension("behind");
    fs::rename(socket, &behind).unwrap();
    let listener = UnixListener::bind(socket).unwrap();
    let log = Log::default();
    let shared = Arc::clone(&log);
    thread::spawn(move || {
        for (at, guest) in listener.incoming().enumerate() {
            let log = if at == 0 { Arc::clone(&shared) } else { Log::default() };
            let (guest, host) = (guest.unwrap(), UnixStream::connect(&behind).unwrap());
            for (from, to, by) in [(&guest, &host, "guest"), (&host, &guest, "host")] {
                let (from, to, log) = (from.try_clone().unwrap(), to.try_clone().unwrap(), Arc::clone(&log));
                thread::spawn(move || carry(from, to, by, &log));
            }
        }
    });
    log
}

fn open(path: &Path) -> Bus {
    let port = PortUrl::parse(path.to_str().unwrap(), &Known::default()).unwrap();
    let key = port.key();
    let options = BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent).timeout(Duration::from_secs(5));
    let opener = port.opener(&PortOptions::new(options.format)).unwrap();
    Bus::open_shared(opener, key, options, &mut || false).unwrap()
}

/// Where what belongs to the pseudo-terminal at `path` stands, without an ending.
fn place(path: &Path) -> PathBuf {
    let status = fs::metadata(path).unwrap();
    run_time_folder().unwrap().join(format!("port-{:x}-{:x}", status.dev(), status.rdev()))
}

fn unit(raw: u8) -> UnitAddress {
    UnitAddress::new(raw).unwrap()
}

fn ask(bus: &Bus, to: u8, request: &Request<'_>, options: CallOptions) -> Result<Done, Box<CallError>> {
    bus.call(unit(to).into(), request, options, &mut || false, &mut |_| ())
}

/// What is wished, in the order of the vectors.
fn converse(guest: &Bus) {
    let usual = CallOptions::new();
    let read = Request::read(0x2103, 1).unwrap();
    ask(guest, 1, &read, usual).unwrap();

    guest.configure(unit(2), UnitOptions::new().gap(Duration::from_millis(10)));
    guest.set_meanings(unit(2), Meanings::STANDARD.with(ExceptionCode(4), Meaning::AskAgain));
    let second = Duration::from_secs(1);
    let halts = guest.halts(unit(2));
    let all = usual
        .timeout(second)
        .retries(1)
        .priority(Priority::Poll)
        .verify(true)
        .read_back(0x800B)
        .connection(0)
        .halts(halts);
    ask(guest, 2, &Request::write(0x800B, 11), all).unwrap();

    for length in [AnswerLength::Bytes(4), AnswerLength::BySilence] {
        ask(guest, 1, &Request::custom(&[3, 0x21, 3, 0, 1], length).unwrap(), usual).unwrap();
    }
    ask(guest, 1, &Request::read(0x6300, 1).unwrap(), usual).unwrap_err();
    assert_eq!(guest.link(unit(9)).asked, 0);
    guest.fresh_word();
    assert_eq!(guest.reconnects(), 0);
    let time = Duration::from_millis(20);
    guest.listen(time, &mut || false, &mut |_, _| ()).unwrap();
    guest.overhear(time, &mut || false, &mut |_| ()).unwrap();
}

#[test]
fn two_programs_say_what_is_written_down() {
    let simulator = Simulator::new([(1, "gd350"), (2, "gd350")], Options::default().realtime(true)).unwrap();
    let served = simulator.serve_pty().unwrap();
    let _host = open(&served.path());
    let socket = place(&served.path()).with_extension("sock");
    let log = relay(&socket);
    let guest = open(&served.path());
    converse(&guest);
    let said = log.lock().unwrap().clone();
    fs::remove_file(&socket).unwrap();
    fs::remove_file(socket.with_extension("behind")).unwrap();

    let document = document();
    assert_eq!(document.version, said[0].1["drivebus share ".len()], "the version has vectors of its own");
    // That it is still to come, and that time passes while nothing is overheard, is said as often as it takes.
    let is_told =
        |(by, message): &&(&str, Vec<u8>)| *by == "guest" || !matches!(message[..], [0x0A] | [0x03, .., 0x00]);
    let said: Vec<_> = said.iter().filter(is_told).collect();
    for ((by, came), wanted) in said.iter().zip(&document.said) {
        assert_eq!(*by, wanted.by, "{}: {came:02X?} came", wanted.what);
        assert_alike(came, &wanted.bytes, &wanted.what);
    }
    assert_eq!(said.len(), document.said.len());
}

#[test]
fn a_last_will_is_written_as_is_written_down() {
    let simulator = Simulator::new([(1, "gd350")], Options::default().realtime(true)).unwrap();
    let served = simulator.serve_pty().unwrap();
    let bus = open(&served.path());
    let will = LastWill::new(unit(1), vec![vec![vec![0x06, 0x20, 0x00, 0x00, 0x05]]])
        .look(vec![3, 0x21, 3, 0, 1], vec![vec![3, 2, 0x00, 0x12]])
        .named(Named::new("abc", vec!["stop".to_owned()]).trusted(true))
        .silence(Duration::from_secs(1));
    let number = bus.leave_will(will).unwrap();
    let place = place(&served.path());
    let prefix = format!("{}.", place.file_name().unwrap().to_str().unwrap());
    let files = fs::read_dir(place.parent().unwrap()).unwrap().map(|entry| entry.unwrap().path());
    let wills: Vec<_> = files
        .filter(|path| path.extension().is_some_and(|ending| ending == "will"))
        .filter(|path| path.file_name().unwrap().to_str().unwrap().starts_with(&prefix))
        .collect();
    // Another process reads it: who closes a file gives up the locks that its process has on it.
    let came = Command::new("cat").args(&wills).output().unwrap().stdout;
    bus.withdraw_will(number);
    let wanted = document().will;
    assert_eq!(wills.len(), 1, "{wills:?}");
    assert_alike(&came[wanted.after..], &wanted.bytes, "a will");
}

/// Both forms of one value are each other's, and are what is written down.
fn both<T: Serialize + DeserializeOwned + PartialEq + Debug>(form: &Form) -> T {
    let bytes = hex(&form.postcard);
    let value: T = postcard::from_bytes(&bytes).unwrap();
    assert_eq!(value, serde_json::from_str(&form.json).unwrap());
    assert_eq!(postcard::to_stdvec(&value).unwrap(), bytes);
    assert_eq!(serde_json::to_string(&value).unwrap(), form.json);
    value
}

#[test]
fn what_anybody_can_serialize_has_the_form_that_is_written_down() {
    let document = document();
    let latency: Latency = both(&document.latency);
    assert_eq!((latency.min, latency.max), (Duration::from_millis(1), Duration::new(3, 2)));
    assert_eq!(Some(latency.mean()), document.latency.mean_ns.map(Duration::from_nanos));

    let program: Program = both(&document.program);
    let counts = (program.process, program.here, program.calls, program.answered);
    assert_eq!((program.name.as_str(), counts), ("abc", (4711, true, 300, 7)));

    let counters: Counters = both(&document.counters);
    assert_eq!((counters.requests, counters.answers, counters.own_echoes), (1, 2, 300));
    assert_eq!((counters.round_trip, counters.delay), (latency, Latency::default()));
}
