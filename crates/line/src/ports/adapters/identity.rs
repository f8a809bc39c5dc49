//! Which physical adapter a serial port is, and where that adapter is now.
//!
//! A name such as `ttyUSB0` goes by the order of plugging in. What stays with an adapter is what it says of itself over
//! USB, which Linux shows in sysfs, and the link that udev makes of it in `/dev/serial/by-id`. Both are read here, as
//! they are; nothing is kept open and nothing is sent. Systems without these folders tell nothing: there a port is its
//! name.
//!
//! Own code, because nothing light was found: `serial2` leaves USB out on purpose (its issue 40), `serialport` is
//! MPL-2.0, `udev` needs the C library libudev, `nusb` knows devices but not their ports, and `serial_enumerator` brings
//! a parser and bindings to three systems for what are six small files here.

use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// Names the folder of links to use instead of `/dev/serial/by-id`.
const BY_ID_VARIABLE: &str = "DRIVEBUS_SERIAL_BY_ID";

/// Where a system tells which adapter is which.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Places {
    /// Links named after adapters, each to its port: `/dev/serial/by-id`.
    pub by_id: PathBuf,
    /// A folder for each port, with what the kernel knows of it: `/sys/class/tty`.
    pub tty_class: PathBuf,
}

impl Default for Places {
    /// Those of this machine. The environment variable `DRIVEBUS_SERIAL_BY_ID` names another folder of links.
    fn default() -> Self {
        let by_id = std::env::var_os(BY_ID_VARIABLE).filter(|given| !given.is_empty());
        Self {
            by_id: by_id.map_or_else(|| PathBuf::from("/dev/serial/by-id"), PathBuf::from),
            tty_class: PathBuf::from("/sys/class/tty"),
        }
    }
}

impl Places {
    /// Sets [`by_id`](Self#structfield.by_id).
    #[must_use]
    pub fn by_id(self, by_id: impl Into<PathBuf>) -> Self {
        Self { by_id: by_id.into(), ..self }
    }

    /// Sets [`tty_class`](Self#structfield.tty_class).
    #[must_use]
    pub fn tty_class(self, tty_class: impl Into<PathBuf>) -> Self {
        Self { tty_class: tty_class.into(), ..self }
    }
}

/// The device number of a port, as the system counts them. It is one port's for as long as that is open.
pub(crate) type DeviceNumber = (u32, u32);

/// What tells an adapter from every other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Identity {
    /// The name of its link.
    link: Option<OsString>,
    usb: Option<Usb>,
}

/// One port of a USB adapter.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Usb {
    /// Hexadecimal, as sysfs has it.
    vendor: String,
    product: String,
    /// What the maker gave this one only. Many cheap adapters have none, and some all have the same.
    serial: Option<String>,
    /// Which of the adapter's ports, where it has several: by interface, or by number within an interface.
    interface: Option<String>,
    port: Option<String>,
    /// Which USB socket it is in, through which hubs: `1-1.2`.
    socket: String,
    /// Whether nothing else plugged in says the same of itself.
    alone: bool,
}

impl Usb {
    /// Whether both say the same of themselves, wherever they are plugged in.
    fn is_alike(&self, other: &Self) -> bool {
        (&self.vendor, &self.product, &self.serial, &self.interface, &self.port)
            == (&other.vendor, &other.product, &other.serial, &other.interface, &other.port)
    }

    /// Whether its serial number is its own. Otherwise only the socket tells it from its likes.
    fn is_unique(&self) -> bool {
        self.serial.is_some() && self.alone
    }

    fn is(&self, found: &Self) -> bool {
        self.is_alike(found) && (self.is_unique() || self.socket == found.socket)
    }
}

impl fmt::Display for Usb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "USB {}:{}", self.vendor, self.product)?;
        match &self.serial {
            Some(serial) => write!(f, ", serial number {serial}")?,
            None => f.write_str(", no serial number")?,
        }
        if let Some(interface) = &self.interface {
            write!(f, ", interface {interface}")?;
        }
        write!(f, ", in USB socket {}", self.socket)
    }
}

impl fmt::Display for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.link, &self.usb) {
            (Some(link), Some(usb)) => write!(f, "{} ({usb})", link.display()),
            (Some(link), None) => write!(f, "{}", link.display()),
            (None, Some(usb)) => usb.fmt(f),
            (None, None) => f.write_str("an adapter of which nothing is known"),
        }
    }
}

impl Identity {
    /// Whether `found` is the same adapter.
    pub(crate) fn is(&self, found: &Self) -> bool {
        match (&self.usb, &found.usb) {
            (Some(known), Some(found)) => known.is(found),
            _ => self.link.is_some() && self.link == found.link,
        }
    }

    /// This, seen again as `found`: what was known before and is not seen now is kept.
    pub(crate) fn seen_again(self, found: Self) -> Self {
        let usb = match (self.usb, found.usb) {
            (Some(known), Some(found)) => Some(Usb { alone: known.alone && found.alone, ..found }),
            (known, found) => found.or(known),
        };
        Self { link: found.link.or(self.link), usb }
    }
}

/// Where the adapter that is looked for is now.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Found {
    /// There.
    At(PathBuf),
    /// Nowhere.
    Nowhere,
    /// It may be any of these: they say the same of themselves.
    OneOf(Vec<PathBuf>),
}

impl Places {
    /// What is known of the port with this number.
    pub(crate) fn identify(&self, number: DeviceNumber) -> Option<Identity> {
        let link = self.link_to(number);
        let usb = self.entry_of(number).and_then(|entry| {
            let mut usb = usb_of(&entry)?;
            usb.alone = !self.plugged_in().iter().any(|(_, other)| usb.is_alike(other) && usb.socket != other.socket);
            Some(usb)
        });
        (link.is_some() || usb.is_some()).then_some(Identity { link, usb })
    }

    /// Looks for the adapter `known`: by what USB devices say of themselves, else by its link.
    pub(crate) fn find(&self, known: &Identity) -> Found {
        if let Some(usb) = &known.usb {
            let mut alike = self.plugged_in();
            alike.retain(|(_, other)| usb.is(other));
            if let Some(here) = alike.iter().position(|(_, other)| other.socket == usb.socket) {
                alike.swap(0, here);
                alike.truncate(1);
            }
            match alike.len() {
                0 => {}
                1 => return Found::At(alike.swap_remove(0).0),
                _ => return Found::OneOf(alike.into_iter().map(|(path, _)| path).collect()),
            }
        }
        let Some(link) = known.link.as_ref().map(|name| self.by_id.join(name)) else { return Found::Nowhere };
        // The link of adapters without a serial number goes to any of them.
        let leads_to_it = device_number(&link).and_then(|number| self.identify(number)).is_some_and(|it| known.is(&it));
        match fs::canonicalize(&link) {
            Ok(path) if leads_to_it => Found::At(path),
            _ => Found::Nowhere,
        }
    }

    /// The folder of the port with this number.
    pub(crate) fn entry_of(&self, number: DeviceNumber) -> Option<PathBuf> {
        self.entries().into_iter().find(|entry| number_of_entry(entry) == Some(number))
    }

    /// The name of the link to the port with this number.
    fn link_to(&self, number: DeviceNumber) -> Option<OsString> {
        let mut names: Vec<OsString> = fs::read_dir(&self.by_id)
            .ok()?
            .filter_map(|entry| Some(entry.ok()?.file_name()))
            .filter(|name| device_number(&self.by_id.join(name)) == Some(number))
            .collect();
        names.sort();
        names.into_iter().next()
    }

    /// The ports of USB adapters that are plugged in.
    fn plugged_in(&self) -> Vec<(PathBuf, Usb)> {
        self.entries().iter().filter_map(|entry| Some((path_of(entry)?, usb_of(entry)?))).collect()
    }

    /// The folders of ports that have a device behind them: not the many consoles.
    fn entries(&self) -> Vec<PathBuf> {
        let Ok(entries) = fs::read_dir(&self.tty_class) else { return Vec::new() };
        let mut entries: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|entry| entry.join("device").exists())
            .collect();
        entries.sort();
        entries
    }
}

/// The number of the port at `path`, if it is one; links are followed.
#[cfg(target_os = "linux")]
pub(crate) fn device_number(path: &Path) -> Option<DeviceNumber> {
    use std::os::unix::fs::{FileTypeExt, MetadataExt};

    let status = fs::metadata(path).ok().filter(|status| status.file_type().is_char_device())?;
    Some((rustix::fs::major(status.rdev()), rustix::fs::minor(status.rdev())))
}

/// Nothing: there is nowhere to look it up.
#[cfg(not(target_os = "linux"))]
pub(crate) fn device_number(_path: &Path) -> Option<DeviceNumber> {
    None
}

/// The number of the port whose folder `entry` is: the file `dev` holds `major:minor`.
fn number_of_entry(entry: &Path) -> Option<DeviceNumber> {
    let text = attribute(entry, "dev")?;
    let (major, minor) = text.split_once(':')?;
    Some((major.parse().ok()?, minor.parse().ok()?))
}

/// The port whose folder `entry` is: the file `uevent` holds its path below `/dev`.
fn path_of(entry: &Path) -> Option<PathBuf> {
    let uevent = attribute(entry, "uevent")?;
    let name = uevent.lines().find_map(|line| line.strip_prefix("DEVNAME="))?;
    Some(Path::new("/dev").join(name))
}

/// What the USB device behind `entry` says of itself. Its folder lies above the port's: the nearest with `idVendor`.
fn usb_of(entry: &Path) -> Option<Usb> {
    let behind = fs::canonicalize(entry.join("device")).ok()?;
    let device = behind.ancestors().find(|folder| folder.join("idVendor").exists())?;
    let within = || behind.ancestors().take_while(|folder| *folder != device);
    Some(Usb {
        vendor: attribute(device, "idVendor")?,
        product: attribute(device, "idProduct")?,
        serial: attribute(device, "serial").filter(|serial| !serial.is_empty()),
        interface: within().find_map(|folder| attribute(folder, "bInterfaceNumber")),
        port: within().find_map(|folder| attribute(folder, "port_number")),
        socket: device.file_name()?.to_string_lossy().into_owned(),
        alone: true,
    })
}

fn attribute(folder: &Path, name: &str) -> Option<String> {
    Some(fs::read_to_string(folder.join(name)).ok()?.trim().to_owned())
}
