//! A machine on paper: the folders in which Linux tells of serial adapters, filled by hand, with pseudo-terminals as ports.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use drivebus_line::Places;
use drivebus_line::tty::{Adapter, TtyOptions};
use drivebus_rtu::Parity;
use rustix::fs::{major, minor, stat};

use super::format;

/// What a USB adapter says of itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Usb {
    pub(crate) serial: Option<&'static str>,
    pub(crate) socket: &'static str,
    pub(crate) interface: &'static str,
    pub(crate) port: &'static str,
}

/// With a serial number, as good ones have.
pub(crate) const FTDI: Usb = Usb { serial: Some("A50285BI"), socket: "1-1.2", interface: "00", port: "0" };

/// The folders, which go when this does.
pub(crate) struct Machine {
    root: PathBuf,
}

impl Machine {
    pub(crate) fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let name = format!("machine-{}-{}", std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
        let root = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        for folder in ["by-id", "class", "devices"] {
            fs::create_dir_all(root.join(folder)).unwrap();
        }
        Self { root }
    }

    /// A path in this machine that is neither a link of an adapter nor anything else yet.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    pub(crate) fn adapter(&self, name: impl AsRef<Path>) -> Adapter {
        let name = name.as_ref().to_str().unwrap();
        Adapter::new(name, format(Parity::None), TtyOptions::default()).within(self.places())
    }

    pub(crate) fn places(&self) -> Places {
        Places::default().by_id(self.root.join("by-id")).tty_class(self.root.join("class"))
    }

    /// The link of an adapter, made or led elsewhere.
    pub(crate) fn link(&self, name: &str, port: &str) {
        point(&self.root.join("by-id").join(name), port);
    }

    pub(crate) fn unlink(&self, name: &str) {
        fs::remove_file(self.root.join("by-id").join(name)).unwrap();
    }

    /// A USB adapter whose port is `port`, in the folders as the driver of FTDI's chips makes them.
    pub(crate) fn plug(&self, tty: &str, port: &str, usb: Usb) {
        let hub = self.root.join("devices/usb1/1-1");
        write(&hub, &[("idVendor", "05e3"), ("idProduct", "0608"), ("serial", "that of the hub")]);
        let device = hub.join(usb.socket);
        write(&device, &[("idVendor", "0403"), ("idProduct", "6001")]);
        if let Some(serial) = usb.serial {
            write(&device, &[("serial", serial)]);
        }
        let interface = device.join(format!("{}:1.{}", usb.socket, usb.interface));
        write(&interface, &[("bInterfaceNumber", usb.interface)]);
        let behind = interface.join(tty);
        write(&behind, &[("port_number", usb.port)]);
        let entry = behind.join("tty").join(tty);
        let number = stat(port).unwrap().st_rdev;
        let number = format!("{}:{}", major(number), minor(number));
        let name = port.strip_prefix("/dev/").unwrap();
        write(&entry, &[("dev", &number), ("uevent", &format!("MAJOR=136\nDEVNAME={name}\n"))]);
        point(&entry.join("device"), "../../../".to_owned() + tty);
        point(&self.root.join("class").join(tty), entry);
    }

    /// The latency timer of a port that is plugged in, as the driver of FTDI's chips shows it.
    pub(crate) fn latency_timer(&self, tty: &str) -> PathBuf {
        self.root.join("class").join(tty).join("device/latency_timer")
    }

    pub(crate) fn unplug(&self, tty: &str) {
        let entry = fs::canonicalize(self.root.join("class").join(tty)).unwrap();
        fs::remove_file(self.root.join("class").join(tty)).unwrap();
        fs::remove_dir_all(entry.parent().unwrap().parent().unwrap()).unwrap();
    }
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.root);
    }
}

/// A link at `path` to `target`, whatever was there.
pub(crate) fn point(path: &Path, target: impl AsRef<Path>) {
    let _ = fs::remove_file(path);
    symlink(target, path).unwrap();
}

fn write(folder: &Path, files: &[(&str, &str)]) {
    fs::create_dir_all(folder).unwrap();
    for (name, content) in files {
        fs::write(folder.join(name), format!("{content}\n")).unwrap();
    }
}
