//! The last will of a program: what halts a unit that it runs, kept in a small file beside the socket of the port.
//!
//! Whoever leaves one holds a lock on its file for as long as it lives. It is a record lock of POSIX: the system takes it
//! back when the program is gone, a forked child does not inherit it, and no number of a process has to be believed, which
//! another name space counts otherwise. Whoever has the port by then finds a file that nobody holds.
//!
//! The first eight bytes of the file say when its program was alive last. So a will that nobody found for a long time is not
//! taken for one of a program that ended a moment ago.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use drivebus_rtu::Instant;
use rustix::fs::{FlockOperation, OFlags, fcntl_lock};
use serde::{Deserialize, Serialize};

use crate::options::Named;
use crate::share::message::Characters;
use crate::share::place::Place;
use crate::system::process::Process;

/// How a file says what is written in it.
const VERSION: u8 = 2;
/// Bytes before what is written: when the program was alive last, and the version.
const HEAD: usize = 9;
/// No will is longer.
const MOST: u64 = 4_096;
const ENDING: &str = "will";

/// What is to be done for a program that is gone.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Will {
    pub(crate) unit: u8,
    /// Each halts the unit: PDUs that follow each other.
    pub(crate) ways: Vec<Vec<Vec<u8>>>,
    /// As what it is halted where families are known.
    pub(crate) named: Option<NamedAs>,
    /// What the unit is asked first, and what it answers if it is another one than is meant.
    pub(crate) look: Option<(Vec<u8>, Vec<Vec<u8>>)>,
    /// How long an answer is waited for, in nanoseconds.
    pub(crate) timeout: u64,
    /// After how long a silence the unit acts by itself, in nanoseconds; 0: it does not, as far as is known.
    pub(crate) silence: u64,
    /// Which of the ports it was that had this name ([`PortKey::made`](crate::ports::key::PortKey::made)).
    pub(crate) port: u64,
    /// When it was left.
    pub(crate) left: u64,
    pub(crate) program: String,
    pub(crate) process: u32,
    pub(crate) characters: Characters,
}

/// As what a unit was named: [`Named`](crate::options::Named), as it is written.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct NamedAs {
    pub(crate) family: String,
    pub(crate) commands: Vec<String>,
    pub(crate) is_trusted: bool,
    pub(crate) is_unverified: bool,
}

impl From<Named> for NamedAs {
    fn from(named: Named) -> Self {
        let Named { family, commands, is_trusted, is_unverified } = named;
        Self { family, commands, is_trusted, is_unverified }
    }
}

impl From<NamedAs> for Named {
    fn from(named: NamedAs) -> Self {
        let NamedAs { family, commands, is_trusted, is_unverified } = named;
        Self { family, commands, is_trusted, is_unverified }
    }
}

/// The file of a will, held.
#[derive(Debug)]
pub(crate) struct Paper {
    file: File,
    path: PathBuf,
    held_by: Process,
}

/// A will whose program is gone.
#[derive(Debug)]
pub(crate) struct Orphan {
    pub(crate) paper: Paper,
    /// `None` where another version of drivebus wrote it.
    pub(crate) will: Option<Will>,
    /// When its program was alive last.
    pub(crate) alive: Instant,
}

/// What is found at a place.
#[derive(Debug, Default)]
pub(crate) struct Found {
    pub(crate) orphans: Vec<Orphan>,
    /// How many are of other programs that live.
    pub(crate) living: usize,
}

/// The files that this process holds. It must not open them again: with the first descriptor that it closes, it would lose
/// its lock.
static HELD: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn held() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Paper {
    /// Leaves `will` at `place`.
    pub(crate) fn leave(place: &Place, will: &Will, now: Instant) -> io::Result<Self> {
        let mut bytes = now.as_nanos().to_le_bytes().to_vec();
        bytes.push(VERSION);
        let bytes = postcard::to_extend(will, bytes).map_err(io::Error::other)?;
        let mut held = held();
        for number in 0.. {
            let name = format!("{}-{}-{number}", std::process::id(), now.as_nanos());
            // Nobody looks for it under this name: found without a lock it would be taken for an orphan.
            let draft = format!("{name}.draft");
            let file = match place.file(&draft, true) {
                Ok(file) => file,
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => continue,
                Err(error) => return Err(error),
            };
            fcntl_lock(&file, FlockOperation::NonBlockingLockExclusive)?;
            file.write_all_at(&bytes, 0)?;
            let path = place.path(&format!("{name}.{ENDING}"));
            fs::rename(place.path(&draft), &path)?;
            held.insert(path.clone());
            return Ok(Self { file, path, held_by: Process::current() });
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }

    /// Its program lives.
    pub(crate) fn is_alive(&self, now: Instant) {
        // Where that cannot be written, the will is taken for older than it is.
        let _ = self.file.write_all_at(&now.as_nanos().to_le_bytes(), 0);
    }

    /// Takes it back, or away: it is done. In a forked child it stays the parent's.
    pub(crate) fn remove(self) {
        if self.held_by.is_current() {
            // Where it cannot be removed, it is carried out once more: a stop.
            let _ = fs::remove_file(&self.path);
        }
    }
}

impl Drop for Paper {
    /// Lets go of it: unless it was removed, whoever has the port carries it out.
    fn drop(&mut self) {
        if self.held_by.is_current() {
            held().remove(&self.path);
        }
    }
}

/// The wills at `place` that nobody holds; they are held by this process from here on.
pub(crate) fn find(place: &Place) -> io::Result<Found> {
    let mut held = held();
    let mut found = Found::default();
    for path in all(place)? {
        if held.contains(&path) {
            continue;
        }
        match take(&path) {
            Ok(Some(orphan)) => {
                held.insert(path);
                found.orphans.push(orphan);
            }
            Ok(None) => found.living += 1,
            Err(_) => {} // it was taken back, or carried out, meanwhile
        }
    }
    found.orphans.sort_by_key(|orphan| orphan.will.as_ref().map(|will| will.left));
    Ok(found)
}

/// Whether there is a will at `place`, whoever holds it.
pub(crate) fn is_any(place: &Place) -> bool {
    all(place).is_ok_and(|paths| !paths.is_empty())
}

/// The wills at `place`.
fn all(place: &Place) -> io::Result<Vec<PathBuf>> {
    let prefix = place.path("");
    let (Some(folder), Some(name)) = (prefix.parent(), prefix.file_name().and_then(|name| name.to_str())) else {
        return Ok(Vec::new());
    };
    let ending = format!(".{ENDING}");
    let is_one =
        |file: &str| file.strip_prefix(name).is_some_and(|rest| rest.ends_with(&ending) && rest.len() >= ending.len());
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder)? {
        let file_name = entry?.file_name();
        if file_name.to_str().is_some_and(is_one) {
            paths.push(folder.join(&file_name));
        }
    }
    Ok(paths)
}

/// The will at `path`, if nobody holds it.
fn take(path: &Path) -> io::Result<Option<Orphan>> {
    // Whatever else somebody put there under such a name is neither followed nor waited for.
    let as_it_is = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits().cast_signed();
    let file = OpenOptions::new().read(true).write(true).custom_flags(as_it_is).open(path)?;
    let status = file.metadata()?;
    if !status.is_file() || status.nlink() != 1 {
        return Err(io::ErrorKind::InvalidData.into());
    }
    if fcntl_lock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
        return Ok(None);
    }
    let (here, there) = (file.metadata()?, fs::symlink_metadata(path)?);
    if (here.dev(), here.ino()) != (there.dev(), there.ino()) {
        return Err(io::ErrorKind::NotFound.into());
    }
    let mut bytes = Vec::new();
    (&file).take(MOST).read_to_end(&mut bytes)?;
    let alive = bytes.first_chunk().map_or(0, |head| u64::from_le_bytes(*head));
    let will = bytes.split_at_checked(HEAD).filter(|(head, _)| head.last() == Some(&VERSION));
    let will = will.and_then(|(_, will)| postcard::from_bytes(will).ok());
    let paper = Paper { file, path: path.to_owned(), held_by: Process::current() };
    Ok(Some(Orphan { paper, will, alive: Instant::from_nanos(alive) }))
}

#[cfg(test)]
mod tests {
    use std::env::temp_dir;

    use drivebus_rtu::SerialFormat;

    use super::*;
    use crate::system::clock::monotonic;

    /// A place of its own; its folder goes with it.
    struct Room(PathBuf, Place);

    impl Room {
        fn new(name: &str) -> Self {
            let folder = temp_dir().join(format!("drivebus-wills-{name}-{}", std::process::id()));
            fs::create_dir_all(&folder).unwrap();
            let place = Place::in_folder(folder.clone(), "port-1");
            Self(folder, place)
        }
    }

    impl Drop for Room {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn will(left: u64) -> Will {
        Will {
            unit: 3,
            ways: vec![vec![vec![6, 0x20, 0, 0, 5]], vec![vec![6, 0x20, 0, 0, 6]]],
            named: Some(Named::new("gd350", vec!["stop".to_owned(), "coast".to_owned()]).unverified(true).into()),
            look: Some((vec![3, 0x21, 3, 0, 1], vec![vec![3, 2, 1, 0xA0]])),
            timeout: 300_000_000,
            silence: 2_000_000_000,
            port: 8_812,
            left,
            program: "python".to_owned(),
            process: 4711,
            characters: Characters::of(&SerialFormat::DEFAULT),
        }
    }

    #[test]
    fn what_is_let_go_of_is_found_as_it_was_left_and_once() {
        let room = Room::new("found");
        let (late, early) =
            (Paper::leave(&room.1, &will(2), monotonic()), Paper::leave(&room.1, &will(1), monotonic()));
        let early = early.unwrap();
        early.is_alive(Instant::from_nanos(77));
        assert!(find(&room.1).unwrap().orphans.is_empty() && is_any(&room.1), "both are held");
        drop((late.unwrap(), early));
        assert!(is_any(&room.1) && is_any(&room.1), "who looks takes none up");
        let found = find(&room.1).unwrap().orphans;
        let wills: Vec<_> = found.iter().map(|orphan| orphan.will.clone().unwrap()).collect();
        assert_eq!(wills, [will(1), will(2)], "in the order in which they were left");
        assert_eq!(found[0].alive, Instant::from_nanos(77));
        assert!(find(&room.1).unwrap().orphans.is_empty() && is_any(&room.1), "who found them holds them");
        for orphan in found {
            orphan.paper.remove();
        }
        assert!(find(&room.1).unwrap().orphans.is_empty() && !is_any(&room.1));
        assert_eq!(fs::read_dir(&room.0).unwrap().count(), 0);
    }

    #[test]
    fn what_is_no_will_is_told_from_one() {
        let room = Room::new("strange");
        let paper = Paper::leave(&room.1, &will(1), monotonic()).unwrap();
        paper.file.write_all_at(&[VERSION + 1], 8).unwrap();
        drop(paper);
        fs::write(room.0.join("port-1.lock"), "").unwrap();
        fs::write(room.0.join("port-11.1-1-0.will"), "of another port").unwrap();
        let found = find(&room.1).unwrap().orphans;
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].will, None);
    }
}
