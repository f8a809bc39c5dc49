//! How long an adapter keeps what it has received, and making that as short as it gets.
//!
//! FTDI's chips hand over what came when 62 bytes are there, or when a timer runs out: 16 ms from the factory. Linux shows
//! the timer in sysfs as `latency_timer`, in milliseconds; that file is root's, unless a udev rule says otherwise. The
//! flag `ASYNC_LOW_LATENCY` makes the driver use 1 ms and may be set by whoever may open the port (Linux 4.12 and later).
//! So the flag is tried first. Ports without such a file keep nothing that can be set, and are left alone.
//!
//! What was changed is put back when the port is closed: the adapter is the user's, and the next program may count on it.
//! Sources: `drivers/usb/serial/ftdi_sio.c` of Linux; FTDI's application note AN232B-04.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::Path;

use drivebus_rtu::Duration;

/// What the timer can be set to at least, in milliseconds.
const LEAST_MS: u8 = 1;

/// A timer, in the folder of its port in sysfs.
const TIMER: &str = "device/latency_timer";

/// How to let an ordinary user set the timer, for good. Source: udev(7).
pub(crate) const UDEV_RULE: &str =
    "ACTION==\"add\", SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", ATTR{latency_timer}=\"1\"";

/// The low-latency flag of a port; a test has one of its own.
pub(crate) trait LowLatencyFlag {
    fn low_latency(&self) -> io::Result<bool>;
    fn set_low_latency(&self, on: bool) -> io::Result<()>;
}

/// The timer of an open port.
#[derive(Debug, Default)]
pub(crate) struct LatencyTimer {
    /// In force; `None` where the port has no timer that is known of.
    in_force: Option<u8>,
    note: Option<String>,
    changed: Option<Changed>,
}

/// What to put back.
#[derive(Debug)]
enum Changed {
    Flag,
    /// Open since: a file of an adapter that was unplugged takes nothing, whoever has its name now.
    Timer(File, u8),
}

/// The timer of the port whose folder in sysfs is `entry`, in milliseconds.
pub(crate) fn timer_of(entry: &Path) -> Option<u8> {
    std::fs::read_to_string(entry.join(TIMER)).ok()?.trim().parse().ok()
}

impl LatencyTimer {
    /// Sets the timer of the port whose folder in sysfs is `entry` to the least, if that may be done.
    pub(crate) fn lower(entry: &Path, port: &dyn LowLatencyFlag) -> Self {
        let Some(before) = timer_of(entry) else { return Self::default() };
        if before <= LEAST_MS {
            return Self { in_force: Some(before), ..Self::default() };
        }
        let changed = match port.low_latency() {
            Ok(false) if port.set_low_latency(true).is_ok() => Some(Changed::Flag),
            _ => None,
        };
        // The driver shows what is in force, the flag included.
        if changed.is_some() && timer_of(entry) == Some(LEAST_MS) {
            return Self::lowered(before, changed);
        }
        if changed.is_some() {
            let _ = port.set_low_latency(false);
        }
        match set(entry) {
            Ok(file) if timer_of(entry) == Some(LEAST_MS) => Self::lowered(before, Some(Changed::Timer(file, before))),
            outcome => {
                let why = outcome.err().map(|error| format!(" ({error})")).unwrap_or_default();
                let note = format!(
                    "the adapter keeps what it receives for up to {before} ms, which every request pays, and this user \
                     may not change it{why}; allow it with a file /etc/udev/rules.d/99-low-latency.rules that holds \
                     {UDEV_RULE} and plug the adapter in again"
                );
                Self { in_force: Some(before), note: Some(note), changed: None }
            }
        }
    }

    fn lowered(before: u8, changed: Option<Changed>) -> Self {
        let note = format!(
            "the adapter's latency timer is {LEAST_MS} ms while this port is open; it was {before} ms, and will be again"
        );
        Self { in_force: Some(LEAST_MS), note: Some(note), changed }
    }

    /// How late a byte may be handed over.
    pub(crate) fn latency(&self) -> Duration {
        Duration::from_millis(self.in_force.unwrap_or_default().into())
    }

    pub(crate) fn note(&self) -> Option<&str> {
        self.note.as_deref()
    }

    /// Puts back what was changed. An adapter that is unplugged has forgotten it.
    pub(crate) fn put_back(&mut self, port: &dyn LowLatencyFlag) {
        match self.changed.take() {
            Some(Changed::Flag) => drop(port.set_low_latency(false)),
            Some(Changed::Timer(mut file, before)) => drop(write(&mut file, before)),
            None => {}
        }
    }
}

fn set(entry: &Path) -> io::Result<File> {
    let mut file = OpenOptions::new().write(true).open(entry.join(TIMER))?;
    write(&mut file, LEAST_MS)?;
    Ok(file)
}

/// Each write to a file of sysfs is one setting, whatever its offset; a plain file shows the last one all the same.
fn write(file: &mut File, millis: u8) -> io::Result<()> {
    use std::io::Seek;

    file.rewind()?;
    file.write_all(format!("{millis}\n").as_bytes())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #![expect(clippy::unwrap_used, reason = "a test may panic")]

    use std::cell::Cell;
    use std::fs;
    use std::path::PathBuf;

    use super::*;

    /// A port in sysfs, on disk, and its driver, which has the flag or not.
    struct Driver {
        entry: PathBuf,
        own: u8,
        has_flag: bool,
        flag: Cell<bool>,
    }

    impl Driver {
        fn new(name: &str, own: u8, has_flag: bool) -> Self {
            let entry = std::env::temp_dir().join(format!("drivebus-latency-{name}-{}", std::process::id()));
            fs::create_dir_all(entry.join("device")).unwrap();
            fs::write(entry.join(TIMER), format!("{own}\n")).unwrap();
            Self { entry, own, has_flag, flag: Cell::new(false) }
        }

        fn shows(&self) -> u8 {
            timer_of(&self.entry).unwrap()
        }
    }

    impl Drop for Driver {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.entry);
        }
    }

    impl LowLatencyFlag for Driver {
        fn low_latency(&self) -> io::Result<bool> {
            if self.has_flag { Ok(self.flag.get()) } else { Err(io::ErrorKind::Unsupported.into()) }
        }

        fn set_low_latency(&self, on: bool) -> io::Result<()> {
            assert!(self.has_flag);
            self.flag.set(on);
            fs::write(self.entry.join(TIMER), if on { "1\n".to_owned() } else { format!("{}\n", self.own) })
        }
    }

    #[test]
    fn the_flag_is_set_while_the_port_is_open() {
        let driver = Driver::new("flag", 16, true);
        let mut timer = LatencyTimer::lower(&driver.entry, &driver);
        assert_eq!((timer.latency(), driver.flag.get()), (Duration::from_millis(1), true));
        assert!(timer.note().unwrap().contains("it was 16 ms"));
        timer.put_back(&driver);
        assert_eq!((driver.shows(), driver.flag.get()), (16, false));
    }

    #[test]
    fn without_the_flag_the_file_is_written() {
        let driver = Driver::new("file", 16, false);
        let mut timer = LatencyTimer::lower(&driver.entry, &driver);
        assert_eq!((timer.latency(), driver.shows()), (Duration::from_millis(1), 1));
        timer.put_back(&driver);
        assert_eq!(driver.shows(), 16);
        timer.put_back(&driver); // once
    }

    #[test]
    fn what_is_short_already_is_left_alone() {
        let driver = Driver::new("short", 1, true);
        let mut timer = LatencyTimer::lower(&driver.entry, &driver);
        assert_eq!((timer.latency(), timer.note(), driver.flag.get()), (Duration::from_millis(1), None, false));
        driver.flag.set(true); // somebody else's by now
        timer.put_back(&driver);
        assert!(driver.flag.get());
    }

    #[test]
    fn a_timer_that_may_not_be_written_is_told_of_with_the_rule_that_allows_it() {
        let driver = Driver::new("refused", 16, false);
        let file = driver.entry.join(TIMER);
        fs::remove_file(&file).unwrap();
        // Forty, in a file that not even root may write.
        std::os::unix::fs::symlink("/proc/sys/kernel/cap_last_cap", &file).unwrap();
        let timer = LatencyTimer::lower(&driver.entry, &driver);
        let kept = driver.shows();
        assert_eq!(timer.latency(), Duration::from_millis(kept.into()));
        let note = timer.note().unwrap();
        assert!(note.contains(&format!("up to {kept} ms")) && note.contains(UDEV_RULE), "{note}");
    }

    #[test]
    fn a_port_without_a_timer_has_none() {
        let driver = Driver::new("none", 16, true);
        let timer = LatencyTimer::lower(Path::new("/nowhere"), &driver);
        assert_eq!((timer.latency(), timer.note(), driver.flag.get()), (Duration::ZERO, None, false));
    }
}
