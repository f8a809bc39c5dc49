//! What the system tells of a port without opening it: for people who look for what is wrong.

use std::fs;
use std::path::Path;

use crate::ports::adapters::holder::holders;
use crate::ports::adapters::identity::{Places, device_number};
use crate::ports::adapters::latency::{UDEV_RULE, timer_of};

/// What is known of a port that nobody here has opened. Linux; elsewhere nothing is.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct PortFacts {
    /// The kernel's driver, such as `ftdi_sio`.
    pub driver: Option<String>,
    /// What the adapter says of itself over USB, for people.
    pub adapter: Option<String>,
    /// How long the adapter keeps what it receives, in milliseconds, if that is known.
    pub latency_timer_ms: Option<u8>,
    /// The udev rule that sets that timer to its least, where it is not.
    pub latency_rule: Option<&'static str>,
    /// Programs that have the port, for people; this one is not among them unless it has locked it.
    pub holders: Vec<String>,
}

impl Places {
    /// What the system tells of the port at `path`.
    pub fn facts(&self, path: &Path) -> PortFacts {
        let mut facts =
            PortFacts { holders: holders(path).iter().map(ToString::to_string).collect(), ..PortFacts::default() };
        let Some(number) = device_number(path) else { return facts };
        facts.adapter = self.identify(number).map(|identity| identity.to_string());
        if let Some(entry) = self.entry_of(number) {
            // A port of usb-serial has its own driver, a port of a chip on the board that of the chip.
            facts.driver = fs::canonicalize(entry.join("device/driver"))
                .ok()
                .and_then(|driver| Some(driver.file_name()?.to_string_lossy().into_owned()));
            facts.latency_timer_ms = timer_of(&entry);
            facts.latency_rule = facts.latency_timer_ms.filter(|&millis| millis > 1).map(|_| UDEV_RULE);
        }
        facts
    }
}
