//! The simulator as its user holds it: made from units and options, shared by its handles.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use drivebus_line::{PortError, PortErrorKind};
use drivebus_rtu::{Instant, SerialFormat, UnitAddress};

use crate::clock::Clock;
use crate::drive::{Drive, Drives, Map};
#[cfg(target_os = "linux")]
use crate::ears::Ears;
use crate::error::SimError;
use crate::handles::SimulatedDrive;
use crate::line::SimLine;
use crate::model::Model;
use crate::outlet::Outlets;
use crate::shared::Shared;
use crate::wire_handle::SimulatedLine;
use crate::world::World;

/// How long a vain attempt to open the line takes in virtual time, so that whoever tries again comes to its end.
const OPENING: Duration = Duration::from_millis(10);

/// How a simulation runs: by default at 19 200 bit/s 8E1, in virtual time, with seed 0, and lenient.
#[derive(Debug, Clone, Copy, Default)]
pub struct Options {
    format: SerialFormat,
    seed: u64,
    realtime: bool,
    strict_silence: bool,
    fifo: Fifo,
}

/// After how many characters a served port hands them over.
#[derive(Debug, Clone, Copy)]
struct Fifo(usize);

impl Default for Fifo {
    /// As Linux sets up a 16550A: an interrupt when 8 of its 16 places are filled.
    fn default() -> Self {
        Self(8)
    }
}

impl Options {
    /// Speed and shape of the characters.
    #[must_use]
    pub fn format(self, format: SerialFormat) -> Self {
        Self { format, ..self }
    }

    /// Where chance comes from; the same seed gives the same simulation.
    #[must_use]
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Whether time is real. Otherwise it stands still until somebody waits, and then jumps.
    #[must_use]
    pub fn realtime(self, realtime: bool) -> Self {
        Self { realtime, ..self }
    }

    /// Whether units ignore a request that comes less than 3.5 characters after the last bit on the wire, as real
    /// ones do. Otherwise it is counted and answered.
    #[must_use]
    pub fn strict_silence(self, strict_silence: bool) -> Self {
        Self { strict_silence, ..self }
    }

    /// After how many characters (at least 1) a pseudo-terminal or TCP port hands over what has come, as the FIFO of a
    /// UART does: 8 if it is not said. Where a run of characters ends, what is left comes at once. With 1 each character
    /// comes at its moment, which costs a wake-up and a system call for each.
    #[must_use]
    pub fn fifo(self, characters: usize) -> Self {
        Self { fifo: Fifo(characters.max(1)), ..self }
    }
}

/// A simulated line with simulated drives. Clones are handles to the same simulation.
#[derive(Debug, Clone)]
pub struct Simulator {
    shared: Arc<Shared>,
}

impl Simulator {
    /// A line with these units: address (1..=247), and the name of a shipped profile or a profile of one's own.
    ///
    /// # Errors
    ///
    /// [`SimError`]: an address is impossible or there twice, a profile is unknown or lacks what a simulation needs.
    pub fn new<'a, M: Into<Model<'a>>>(
        units: impl IntoIterator<Item = (u8, M)>,
        options: Options,
    ) -> Result<Self, SimError> {
        let mut maps: Vec<(Model<'a>, Arc<Map>)> = Vec::new();
        let mut drives = BTreeMap::new();
        for (unit, model) in units {
            let (address, model) = (UnitAddress::new(unit)?, model.into());
            let map = if let Some((_, map)) = maps.iter().find(|(known, _)| *known == model) {
                Arc::clone(map)
            } else {
                let map = Arc::new(model.map()?);
                maps.push((model, Arc::clone(&map)));
                map
            };
            if drives.insert(unit, Drive::new(address, map, Instant::ZERO)).is_some() {
                return Err(SimError::Twice { unit });
            }
        }
        let named: Vec<String> = drives.iter().map(|(unit, drive)| format!("{unit}={}", drive.family().name)).collect();
        let units = drives.keys().copied().collect();
        let world = World::new(options.format, options.strict_silence, options.seed, Drives::new(drives));
        let shared = Shared {
            clock: if options.realtime { Clock::real() } else { Clock::Virtual },
            name: format!("sim:{}", named.join(",")),
            units,
            shown: world.shown(),
            world: Mutex::new(world),
            fifo: options.fifo.0,
            began_as: options.format,
            outlets: Outlets::default(),
            #[cfg(target_os = "linux")]
            ears: Ears::default(),
        };
        Ok(Self { shared: Arc::new(shared) })
    }

    /// A master's connection to the line, in this process. While the adapter is unplugged it is lost at its first use.
    pub fn line(&self) -> SimLine {
        SimLine::new(Arc::clone(&self.shared))
    }

    /// As [`line`](Self::line), for an opener that is asked again and again.
    ///
    /// In virtual time an attempt in vain takes 10 ms, so that an adapter that comes back by itself does.
    ///
    /// # Errors
    ///
    /// [`PortErrorKind::NotFound`]: the adapter is unplugged.
    pub fn open_line(&self) -> Result<SimLine, PortError> {
        let mut world = self.shared.present();
        if world.is_plugged() {
            drop(world);
            return Ok(self.line());
        }
        if !self.is_realtime() {
            let later = world.now() + OPENING;
            world.advance(later);
        }
        let message = "the simulated adapter is unplugged; replug() puts it back";
        Err(PortError::new(PortErrorKind::NotFound, &self.shared.name, message))
    }

    /// A pseudo-terminal that other programs open as a serial port. Served by a thread until it is dropped.
    ///
    /// # Errors
    ///
    /// [`SimError::VirtualTime`], or [`SimError::Io`] if the system has no pseudo-terminal to give.
    #[cfg(target_os = "linux")]
    pub fn serve_pty(&self) -> Result<crate::PtyServer, SimError> {
        self.require_real_time()?;
        Ok(crate::PtyServer::start(Arc::clone(&self.shared), None)?)
    }

    /// As [`serve_pty`](Self::serve_pty), with a symbolic link that always leads to it, also where unplugging has given
    /// it another name. A link that is there is replaced; it is removed at the end.
    ///
    /// # Errors
    ///
    /// As above, and [`SimError::Io`] where `link` is something else than a link, or cannot be made.
    #[cfg(target_os = "linux")]
    pub fn serve_pty_linked(&self, link: &std::path::Path) -> Result<crate::PtyServer, SimError> {
        self.require_real_time()?;
        Ok(crate::PtyServer::start(Arc::clone(&self.shared), Some(link.to_owned()))?)
    }

    /// A pseudo-terminal that hands out all that goes over the wire, of masters and of units, and takes nothing: for a
    /// program that listens to what another one says at a served port. It is there until it is dropped.
    ///
    /// Its speed counts as on [`serve_pty`](Self::serve_pty). While nobody has it open, and where a program does not read
    /// what it has, what comes is lost to it, and the line goes on. Pulling the adapter out leaves it where it is. It
    /// moves with the line: who overhears a line of this process hears it while somebody waits on that line.
    ///
    /// # Errors
    ///
    /// [`SimError::VirtualTime`], or [`SimError::Io`] if the system has no pseudo-terminal to give.
    #[cfg(target_os = "linux")]
    pub fn serve_ear(&self) -> Result<crate::EarServer, SimError> {
        self.require_real_time()?;
        Ok(crate::EarServer::start(Arc::clone(&self.shared), None)?)
    }

    /// As [`serve_ear`](Self::serve_ear), with a symbolic link that leads to it. A link that is there is replaced; it is
    /// removed at the end.
    ///
    /// # Errors
    ///
    /// As above, and [`SimError::Io`] where `link` is something else than a link, or cannot be made.
    #[cfg(target_os = "linux")]
    pub fn serve_ear_linked(&self, link: &std::path::Path) -> Result<crate::EarServer, SimError> {
        self.require_real_time()?;
        Ok(crate::EarServer::start(Arc::clone(&self.shared), Some(link.to_owned()))?)
    }

    /// RTU over TCP on 127.0.0.1, at a port of the system's choosing. Served by a thread until it is dropped.
    ///
    /// # Errors
    ///
    /// [`SimError::VirtualTime`], or [`SimError::Io`] if the system has no port to give.
    #[cfg(unix)]
    pub fn serve_tcp(&self) -> Result<crate::TcpServer, SimError> {
        self.require_real_time()?;
        Ok(crate::TcpServer::start(Arc::clone(&self.shared))?)
    }

    /// The drive with the address `unit`.
    ///
    /// # Errors
    ///
    /// [`SimError::NoUnit`]: there is none.
    pub fn drive(&self, unit: u8) -> Result<SimulatedDrive, SimError> {
        match UnitAddress::new(unit) {
            Ok(address) if self.shared.units.contains(&unit) => {
                Ok(SimulatedDrive::new(Arc::clone(&self.shared), address))
            }
            _ => Err(SimError::NoUnit { unit, present: self.shared.units.clone() }),
        }
    }

    /// The wire.
    pub fn wire(&self) -> SimulatedLine {
        SimulatedLine::new(Arc::clone(&self.shared))
    }

    /// `sim:` and the units: `sim:1=gd350,2=gd350`.
    pub fn name(&self) -> &str {
        &self.shared.name
    }

    /// Whether time is real.
    pub fn is_realtime(&self) -> bool {
        self.shared.clock.is_real()
    }

    /// Time since the simulation began.
    pub fn now(&self) -> Instant {
        self.shared.present().now()
    }

    /// Lets virtual time pass.
    ///
    /// # Errors
    ///
    /// [`SimError::RealTime`]: it passes by itself.
    pub fn advance(&self, time: Duration) -> Result<(), SimError> {
        if self.is_realtime() {
            return Err(SimError::RealTime);
        }
        let mut world = self.shared.lock();
        let to = world.now() + time;
        world.advance(to);
        Ok(())
    }

    #[cfg(unix)]
    fn require_real_time(&self) -> Result<(), SimError> {
        if self.is_realtime() { Ok(()) } else { Err(SimError::VirtualTime) }
    }
}
