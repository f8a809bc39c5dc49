//! A program that has a port and no descriptor left: whoever knocks meanwhile costs it next to nothing, and is served when
//! there are descriptors again. The program is this test's own, started again with few descriptors.
#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, reason = "a test may panic")]

use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read, Seek, Write};
use std::path::PathBuf;
use std::process::{ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use drivebus_line::url::{Known, PortOptions, PortUrl};
use drivebus_line::{AdapterEcho, Bus, BusOptions, CallOptions, Failure};
use drivebus_rtu::{Request, SerialFormat, UnitAddress};
use drivebus_sim::{Options, Simulator};

/// Where the program that is started finds the port.
const PORT: &str = "DRIVEBUS_TEST_PORT_OF_A_FULL_PROGRAM";
const FULL: &str = "other programs cannot come in to use this port now: ";

fn open(port: &str) -> Result<Arc<Bus>, Failure> {
    let options = BusOptions::new(SerialFormat::DEFAULT).echo(AdapterEcho::Absent).timeout(Duration::from_secs(5));
    let url = PortUrl::parse(port, &Known::default()).unwrap();
    let key = url.key();
    let opener = url.opener(&PortOptions::new(options.format)).unwrap();
    Bus::open_shared(opener, key, options, &mut || false).map(Arc::new)
}

/// The thread at the door, in `/proc`.
fn door() -> Option<PathBuf> {
    let threads = fs::read_dir("/proc/self/task").unwrap().map(|task| task.unwrap().path());
    let is_door =
        |path: &PathBuf| fs::read_to_string(path.join("comm")).is_ok_and(|name| name.trim() == "drivebus-door");
    threads.filter(is_door).last()
}

/// How often a thread has waited since it began; `status` is its file of that name.
fn waits(status: &mut File) -> u64 {
    let mut text = String::new();
    status.rewind().unwrap();
    status.read_to_string(&mut text).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"));
    line.unwrap().trim().parse().unwrap()
}

fn says(what: &str) {
    let mut out = std::io::stdout();
    writeln!(out, "\nchild: {what}").unwrap();
    out.flush().unwrap();
}

/// What the program does that is started; nothing in the test itself.
#[test]
fn the_full_program() {
    let Ok(port) = std::env::var(PORT) else { return };
    let bus = open(&port).unwrap();
    // A thread names itself when it begins.
    let door = std::iter::repeat_with(door).inspect(|_| thread::yield_now()).find_map(|found| found);
    let mut status = File::open(door.unwrap().join("status")).unwrap();
    let all: Vec<File> = std::iter::from_fn(|| File::open("/dev/null").ok()).collect();
    let (began, before) = (Instant::now(), waits(&mut status));
    says("full");
    let mut lines = std::io::stdin().lines();
    lines.next().unwrap().unwrap();
    let (waited, seconds) = (waits(&mut status) - before, began.elapsed().as_secs());
    // Ten in the first second, and one in each that follows. Each look at the clock is later than what it counts.
    assert!(waited <= 12 + 2 * seconds, "{waited} waits in {seconds} s");
    assert!(bus.notes().iter().any(|note| note.starts_with(FULL)), "{:?}", bus.notes());
    drop(all);
    says("free");
    lines.next().unwrap().unwrap();
    // Who is let in may be served before the door says so.
    while bus.notes().iter().any(|note| note.starts_with(FULL)) {
        thread::yield_now();
    }
    says("well");
}

fn hears(from: &mut BufReader<ChildStdout>, what: &str) {
    let mut all = String::new();
    while !all.ends_with(&format!("child: {what}\n")) {
        assert_ne!(from.read_line(&mut all).unwrap(), 0, "no {what:?} in {all}");
    }
}

#[test]
fn who_knocks_at_a_full_program_is_served_later() {
    let simulator = Simulator::new([(1, "gd350")], Options::default().realtime(true)).unwrap();
    let served = simulator.serve_pty().unwrap();
    let port = served.path().to_str().unwrap().to_owned();
    let own = std::env::current_exe().unwrap();
    let mut child = Command::new("sh")
        .args(["-c", "ulimit -n 64 && exec \"$0\" --exact the_full_program --nocapture", own.to_str().unwrap()])
        .env(PORT, &port)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut to, mut from) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
    hears(&mut from, "full");
    let refused = open(&port).map(|bus| bus.notes());
    assert!(matches!(&refused, Err(Failure::Port(_))), "nobody can let it in: {refused:?}");
    writeln!(to).unwrap();
    hears(&mut from, "free");
    let guest = open(&port).unwrap();
    let unit = UnitAddress::new(1).unwrap();
    let request = Request::read(0x2103, 1).unwrap();
    guest.call(unit.into(), &request, CallOptions::new(), &mut || false, &mut |_| ()).unwrap();
    writeln!(to).unwrap();
    hears(&mut from, "well");
    assert!(child.wait().unwrap().success());
}
