//! One port, several programs, on every system and over each way by which they meet: Unix sockets, and the loopback.
//!
//! Each test runs once more in a process of its own for each way: how programs meet is said by their environment, and a folder
//! of their own keeps them from others.

#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod outsiders;
mod port;
mod sharing;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{env, fs};

/// Where the programs of a test meet. It says that this is a process of a test's own.
const FOLDER: &str = "DRIVEBUS_TESTS_FOLDER";
/// Makes programs meet on the loopback where they have Unix sockets.
const OVER_LOOPBACK: &str = "DRIVEBUS_TESTS_OVER_LOOPBACK";
/// What says in which folder the programs of a user meet.
const USERS_FOLDER: &str = if cfg!(windows) { "LOCALAPPDATA" } else { "DRIVEBUS_RUNTIME_DIR" };

/// How many folders this process made: several tests run at once in it, and their names would make the path of a socket too long.
static FOLDERS: AtomicUsize = AtomicUsize::new(0);

/// Runs `body` in each way: the body of the test that is called `name`.
fn in_each_way(name: &str, body: impl FnOnce(&Path)) {
    let ways: &[bool] = if cfg!(unix) { &[false, true] } else { &[true] };
    in_ways(ways, name, body);
}

/// As [`in_each_way`], on the loopback alone.
fn on_loopback(name: &str, body: impl FnOnce(&Path)) {
    in_ways(&[true], name, body);
}

fn in_ways(ways: &[bool], name: &str, body: impl FnOnce(&Path)) {
    if let Some(folder) = env::var_os(FOLDER) {
        return body(Path::new(&folder));
    }
    for &is_over_loopback in ways {
        let number = FOLDERS.fetch_add(1, Ordering::Relaxed);
        let folder = env::temp_dir().join(format!("drivebus-share-{}-{number}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let mut again = this_program(name);
        again.env(FOLDER, &folder).env(USERS_FOLDER, &folder).env(port::PORT, port::unused().to_string());
        again.env_remove(OVER_LOOPBACK);
        if is_over_loopback {
            again.env(OVER_LOOPBACK, "1");
        }
        let done = again.output().unwrap();
        fs::remove_dir_all(&folder).unwrap();
        let said = [done.stdout, done.stderr].map(|said| String::from_utf8_lossy(&said).into_owned());
        assert!(done.status.success(), "over the loopback: {is_over_loopback}\n{}", said.concat());
        assert!(said[0].contains("1 passed"), "no test is called {name}");
    }
}

/// This program, running the test that is called `name`.
fn this_program(name: &str) -> Command {
    let mut program = Command::new(env::current_exe().unwrap());
    program.args(["--exact", name, "--nocapture"]);
    program
}

/// Another program that runs the test which is called `name`, and what it says to it and hears of it.
fn another_program(name: &str) -> Child {
    this_program(name).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap()
}

/// The files in `folder` whose names end so.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let files = fs::read_dir(folder.join("drivebus")).into_iter().flatten().map(|entry| entry.unwrap().path());
    files.filter(|path| path.extension().is_some_and(|found| found == ending)).collect()
}
