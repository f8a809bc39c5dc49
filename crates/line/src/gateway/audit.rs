//! What clients wrote, one line of JSON each: when, who, to what, what stood there and what was written, and what became of
//! it. Appended to a file that is put aside when it is large.
//!
//! A thread of its own writes, so that no disk holds the line up. Each line is with the system as soon as it is written: what
//! kills the program takes nothing of it away.

use std::fmt::Write as _;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crate::gateway::rights::Written;
use crate::system::inherited::Kept;

/// Bytes after which a file is put aside.
const LARGE: u64 = 10_000_000;
/// So many files are kept that were.
const KEPT: usize = 9;
/// Lines that wait for the disk; beyond them, lines are lost, which is told.
const WAITING: usize = 10_000;

/// The file, until this is dropped. Without one, nothing is written.
#[derive(Debug, Default)]
pub(super) struct Audit {
    lines: Mutex<Option<SyncSender<Item>>>,
    writer: Mutex<Option<JoinHandle<()>>>,
}

/// What the thread is given.
#[derive(Debug)]
enum Item {
    /// A line to write.
    Line(String),
    /// Whom to tell that all before this is written.
    Settled(SyncSender<()>),
}

/// What became of a write.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    /// The unit took it.
    Done,
    /// The unit refused it by this exception.
    Refused(u8),
    /// It never went out, or could not be heard.
    NotSent,
    /// It went out, and no answer says whether it was taken.
    Unknown,
    /// It went to all units, which do not answer.
    Sent,
}

/// A write, as it is told of.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub(super) at: SystemTime,
    pub(super) client: String,
    pub(super) unit: u8,
    pub(super) function: u8,
    pub(super) written: Written,
    pub(super) old: Option<Vec<u16>>,
}

impl Audit {
    /// Appends to the file at `path`; `fails` hears in words what cannot be written.
    ///
    /// # Errors
    ///
    /// The system's: it cannot be opened for that.
    pub(super) fn open(path: &Path, fails: impl Fn(String) + Send + 'static) -> io::Result<Self> {
        let mut file = Rotated::open(path)?;
        let (lines, waiting) = sync_channel(WAITING);
        let mut write = move |waiting: Receiver<Item>| {
            for item in waiting {
                match item {
                    Item::Line(line) => {
                        if let Err(error) = file.append(&line) {
                            fails(format!("the audit cannot be written: {error}; lost is {line}"));
                        }
                    }
                    // Who waited may have given up.
                    Item::Settled(told) => drop(told.try_send(())),
                }
            }
        };
        let writer = thread::Builder::new().name("drivebus-audit".to_owned()).spawn(move || write(waiting))?;
        Ok(Self { lines: Mutex::new(Some(lines)), writer: Mutex::new(Some(writer)) })
    }

    /// Writes what became of a write. False: it is lost, since the disk does not follow.
    pub(super) fn write(&self, entry: &Entry, outcome: Outcome) -> bool {
        self.append(|| line_of(entry, outcome))
    }

    /// Writes that the motor of `unit` is halted for `client`, which commanded it, and why.
    pub(super) fn halts(&self, client: &str, unit: u8, why: &str) -> bool {
        let moment = moment(SystemTime::now());
        self.append(|| {
            format!(
                "{{\"time\":\"{moment}\",\"client\":{},\"unit\":{unit},\"halted\":{}}}",
                quoted(client),
                quoted(why)
            )
        })
    }

    /// Waits until all that was told so far is written, for `time` at most.
    pub(super) fn settle(&self, time: Duration) {
        let (settled, told) = sync_channel(1);
        let is_asked = {
            let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
            lines.as_ref().is_some_and(|lines| lines.try_send(Item::Settled(settled)).is_ok())
        };
        if is_asked {
            let _ = told.recv_timeout(time);
        }
    }

    fn append(&self, line: impl FnOnce() -> String) -> bool {
        let lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        // Where the thread panicked, nothing is written any more.
        lines.as_ref().is_none_or(|lines| {
            !matches!(lines.try_send(Item::Line(line())), Err(TrySendError::Full(_) | TrySendError::Disconnected(_)))
        })
    }
}

impl Drop for Audit {
    /// What waits is written.
    fn drop(&mut self) {
        let lines = self.lines.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        drop(lines);
        if let Some(writer) = self.writer.get_mut().unwrap_or_else(PoisonError::into_inner).take() {
            let _ = writer.join();
        }
    }
}

/// A file, and those that were put aside: `NAME.1` is the latest of them.
#[derive(Debug)]
struct Rotated {
    path: PathBuf,
    file: Kept<File>,
    size: u64,
}

impl Rotated {
    fn open(path: &Path) -> io::Result<Self> {
        let file = opened(path)?;
        let size = file.metadata()?.len();
        let mut rotated = Self { path: path.to_owned(), file, size };
        if size > 0 && !ends_a_line(path)? {
            // What was killed in the middle of a line must not take the next one with it.
            rotated.append("")?;
        }
        Ok(rotated)
    }

    fn append(&mut self, line: &str) -> io::Result<()> {
        if self.is_put_aside() {
            self.file = opened(&self.path)?;
            self.size = self.file.metadata()?.len();
        }
        if self.size >= LARGE {
            self.put_aside()?;
        }
        let line = format!("{line}\n");
        (&*self.file).write_all(line.as_bytes())?;
        self.size += line.len() as u64;
        Ok(())
    }

    /// Whether another file has its name by now: that of another gateway with the same audit, which put it aside.
    #[cfg(unix)]
    fn is_put_aside(&self) -> bool {
        use std::os::unix::fs::MetadataExt as _;

        let file = |status: &fs::Metadata| (status.dev(), status.ino());
        let own = self.file.metadata();
        !own.is_ok_and(|own| fs::metadata(&self.path).is_ok_and(|there| file(&own) == file(&there)))
    }

    /// Nobody asks for the number of a file there.
    #[cfg(not(unix))]
    const fn is_put_aside(&self) -> bool {
        false
    }

    fn put_aside(&mut self) -> io::Result<()> {
        let aside = |number: usize| {
            let mut name = self.path.clone().into_os_string();
            name.push(format!(".{number}"));
            PathBuf::from(name)
        };
        for number in (1..KEPT).rev() {
            match fs::rename(aside(number), aside(number + 1)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        fs::rename(&self.path, aside(1))?;
        self.file = opened(&self.path)?;
        self.size = 0;
        Ok(())
    }
}

fn opened(path: &Path) -> io::Result<Kept<File>> {
    let mut options = OpenOptions::new();
    options.create(true).append(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o640);
    Kept::opened(|| options.open(path))
}

fn ends_a_line(path: &Path) -> io::Result<bool> {
    use std::io::{Read as _, Seek as _, SeekFrom};

    let mut file = File::open(path)?;
    file.seek(SeekFrom::End(-1))?;
    let mut last = [0];
    file.read_exact(&mut last)?;
    Ok(last == *b"\n")
}

fn line_of(entry: &Entry, outcome: Outcome) -> String {
    let Entry { at, client, unit, function, written, old } = entry;
    let names: Vec<String> = written.names.iter().map(|name| quoted(name)).collect();
    let old = old.as_ref().map_or_else(|| "null".to_owned(), |old| format!("{old:?}"));
    let (said, exception) = match outcome {
        Outcome::Done => ("done", None),
        Outcome::Refused(code) => ("refused", Some(code)),
        Outcome::NotSent => ("not sent", None),
        Outcome::Unknown => ("may have been done", None),
        Outcome::Sent => ("sent to all", None),
    };
    let exception = exception.map(|code| format!(",\"exception\":{code}")).unwrap_or_default();
    format!(
        "{{\"time\":\"{}\",\"client\":{},\"unit\":{unit},\"function\":{function},\"table\":\"{}\",\"address\":{},\
         \"registers\":[{}],\"old\":{old},\"new\":{:?},\"outcome\":\"{said}\"{exception}}}",
        moment(*at),
        quoted(client),
        if written.table == drivebus_rtu::Table::Coil { "coil" } else { "holding" },
        written.address,
        names.join(","),
        written.words,
    )
}

/// `text` as a string of JSON, in ASCII: nothing in it ends a line or moves a cursor.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for unit in text.encode_utf16() {
        match u8::try_from(unit) {
            Ok(byte @ (b'"' | b'\\')) => quoted.extend(['\\', char::from(byte)]),
            Ok(byte @ b' '..=b'~') => quoted.push(char::from(byte)),
            _ => {
                let _ = write!(quoted, "\\u{unit:04x}");
            }
        }
    }
    quoted.push('"');
    quoted
}

/// `at` by RFC 3339, in UTC, to the millisecond.
fn moment(at: SystemTime) -> String {
    let since = at.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO);
    let (days, seconds) = (since.as_secs() / 86_400, since.as_secs() % 86_400);
    // Days are counted from the first of March of the year 0: a leap day is the last of its year, and 400 years are 146 097.
    let day = days + 719_468;
    let (era, day_of_era) = (day / 146_097, day % 146_097);
    let year_of_era = (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march_is_0 = (5 * day_of_year + 2) / 153;
    let day_of_month = day_of_year - (153 * march_is_0 + 2) / 5 + 1;
    let month = if march_is_0 < 10 { march_is_0 + 3 } else { march_is_0 - 9 };
    let year = 400 * era + year_of_era + u64::from(month < 3);
    let (hour, minute, second) = (seconds / 3_600, seconds / 60 % 60, seconds % 60);
    format!("{year:04}-{month:02}-{day_of_month:02}T{hour:02}:{minute:02}:{second:02}.{:03}Z", since.subsec_millis())
}

#[cfg(test)]
mod tests {
    use drivebus_rtu::Table;

    use super::*;
    use crate::gateway::rights::Means;

    fn entry(name: &str) -> Entry {
        let written = Written {
            table: Table::Holding,
            address: 0x2000,
            words: vec![1],
            names: vec![name.to_owned()],
            means: Means::Moves,
            wears: vec![],
            shown_at: None,
        };
        Entry { at: UNIX_EPOCH, client: "10.0.0.5:4711".to_owned(), unit: 7, function: 6, written, old: Some(vec![5]) }
    }

    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let folder = std::env::temp_dir().join(format!("drivebus-audit-{name}-{}", std::process::id()));
            let _ = fs::remove_dir_all(&folder);
            fs::create_dir(&folder).unwrap();
            Self(folder)
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn what_was_told_is_in_the_file_once_it_is_settled() {
        let folder = Folder::new("settled");
        let path = folder.0.join("audit.jsonl");
        let audit = Audit::open(&path, |why| panic!("{why}")).unwrap();
        for count in 1..=200 {
            assert!(audit.write(&entry("P00.11"), Outcome::Done));
            audit.settle(Duration::from_secs(60));
            assert_eq!(fs::read_to_string(&path).unwrap().lines().count(), count);
        }
    }

    #[test]
    fn moments_of_the_calendar() {
        // By `date -u -d @SECONDS` of GNU coreutils.
        for (seconds, shown) in [
            (0, "1970-01-01T00:00:00.007Z"),
            (951_782_399, "2000-02-28T23:59:59.007Z"),
            (951_868_800, "2000-03-01T00:00:00.007Z"),
            (951_782_400, "2000-02-29T00:00:00.007Z"),
            (1_764_313_200, "2025-11-28T07:00:00.007Z"),
            (4_107_542_399, "2100-02-28T23:59:59.007Z"),
            (4_107_542_400, "2100-03-01T00:00:00.007Z"),
        ] {
            assert_eq!(moment(UNIX_EPOCH + Duration::from_millis(1_000 * seconds + 7)), shown);
        }
    }

    #[test]
    fn a_line_is_one_object_whatever_the_names_are() {
        let line = line_of(&entry("a\"b\\c\n\u{1b}[2J<é😀"), Outcome::Refused(2));
        assert!(line.bytes().all(|byte| (b' '..=b'~').contains(&byte)), "{line}");
        let told: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert_eq!(told["registers"][0], "a\"b\\c\n\u{1b}[2J<é😀");
        assert_eq!((&told["old"], &told["new"], &told["exception"]), (&[5].into(), &[1].into(), &2.into()));
        assert_eq!((&told["outcome"], &told["time"]), (&"refused".into(), &"1970-01-01T00:00:00.000Z".into()));
    }

    #[test]
    fn a_large_file_is_put_aside_and_no_line_is_lost_or_torn() {
        let folder = Folder::new("large");
        let path = folder.0.join("audit.jsonl");
        fs::write(&path, format!("{{}}\n{}", "x".repeat(usize::try_from(LARGE).unwrap() - 30))).unwrap();
        let audit = Audit::open(&path, |why| panic!("{why}")).unwrap();
        for _ in 0..3 {
            assert!(audit.write(&entry("run_forward"), Outcome::Done));
        }
        drop(audit);
        let aside = fs::read_to_string(folder.0.join("audit.jsonl.1")).unwrap();
        let now = fs::read_to_string(&path).unwrap();
        let whole = [aside.lines().skip(2).collect::<Vec<_>>(), now.lines().collect()].concat();
        assert_eq!(whole.len(), 3);
        assert!(whole.iter().all(|line| serde_json::from_str::<serde_json::Value>(line).is_ok()));
        assert_eq!(now.lines().count(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn two_with_one_file_put_it_aside_once() {
        let folder = Folder::new("two");
        let path = folder.0.join("audit.jsonl");
        fs::write(&path, format!("{}\n", "x".repeat(usize::try_from(LARGE).unwrap()))).unwrap();
        let [mut one, mut other] = [(); 2].map(|()| Rotated::open(&path).unwrap());
        one.append("one").unwrap();
        other.append("other").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "one\nother\n");
        assert!(!folder.0.join("audit.jsonl.2").exists());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_disk_is_told() {
        let (tell, told) = std::sync::mpsc::channel();
        let audit = Audit::open(Path::new("/dev/full"), move |why| tell.send(why).unwrap()).unwrap();
        audit.halts("10.0.0.5:1", 3, "silent");
        assert!(told.recv().unwrap().contains("cannot be written"));
    }
}
