//! The simulator as its user holds it: handles to the shared world, checked at the door.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use drivebus_drives::ProfileError;
use drivebus_rtu::{AddressError, ExceptionCode, Instant, SerialFormat, UnitAddress};

use crate::clock::Clock;
use crate::drive::{Drive, Map, WriteRecord};
use crate::line::SimLine;
use crate::trace::Transmission;
use crate::world::World;

/// The family whose behaviour is simulated.
const SIMULATED: &str = "gd350";
/// The heaviest load, as a share of rated torque.
const MAX_LOAD: f64 = 4.0;
/// The highest word of the digital inputs: S1 to S4, HDIA, HDIB.
const MAX_INPUTS: u16 = 0x3F;

/// Why a simulation cannot be as asked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// No unit can have this address.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// There is no such profile, or it is broken.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// There is a profile, but no behaviour for it.
    #[error("no simulated drive behaves like \"{profile}\"; \"{SIMULATED}\" is simulated")]
    NotSimulated {
        /// The profile asked for.
        profile: String,
    },
    /// Two units were given one address.
    #[error("unit {unit} is there twice; give each unit an address of its own")]
    Twice {
        /// The address.
        unit: u8,
    },
    /// No unit has this address here.
    #[error("no unit {unit} is simulated; there are {present:?}")]
    NoUnit {
        /// The address asked for.
        unit: u8,
        /// The addresses there are.
        present: Vec<u8>,
    },
    /// Real time cannot be moved.
    #[error("this simulation runs in real time; only virtual time can be advanced")]
    RealTime,
    /// Other programs live in real time.
    #[error("this simulation runs in virtual time; a port that other programs open needs real time")]
    VirtualTime,
    /// The load is not a share of 0.0..=4.0.
    #[error("load {load} is not in 0.0..=4.0 of the motor's rated torque")]
    Load {
        /// What was given.
        load: f64,
    },
    /// The digital inputs are six bits.
    #[error("inputs {inputs:#x} are not in 0x00..=0x3f; bit 0 is S1, bit 5 HDIB")]
    Inputs {
        /// What was given.
        inputs: u16,
    },
    /// There are four analog inputs.
    #[error("analog input {input} is not in 1..=4")]
    Analog {
        /// What was given.
        input: u8,
    },
    /// 0 is no fault.
    #[error("0 is no fault; fault numbers are 1..=65535")]
    NoFault,
    /// The system has no port to give.
    #[error("cannot serve the simulated line: {0}")]
    Io(#[from] std::io::Error),
}

/// How a simulation runs.
#[derive(Debug, Clone, Copy)]
#[non_exhaustive]
pub struct Options {
    /// Speed and shape of the characters.
    pub format: SerialFormat,
    /// Where chance comes from; the same seed gives the same simulation.
    pub seed: u64,
    /// Whether time is real. Otherwise it stands still until somebody waits.
    pub realtime: bool,
    /// Whether units ignore a request that comes less than 3.5 characters after the last bit on the wire, as real
    /// ones do. Otherwise it is counted and answered.
    pub strict_silence: bool,
}

impl Default for Options {
    /// 19 200 bit/s 8E1, virtual time, seed 0, lenient.
    fn default() -> Self {
        Self { format: SerialFormat::DEFAULT, seed: 0, realtime: false, strict_silence: false }
    }
}

impl Options {
    /// The same with this format.
    #[must_use]
    pub fn format(mut self, format: SerialFormat) -> Self {
        self.format = format;
        self
    }

    /// The same with this seed.
    #[must_use]
    pub fn seed(mut self, seed: u64) -> Self {
        self.seed = seed;
        self
    }

    /// The same in real or virtual time.
    #[must_use]
    pub fn realtime(mut self, realtime: bool) -> Self {
        self.realtime = realtime;
        self
    }

    /// The same with units that insist on silence, or not.
    #[must_use]
    pub fn strict_silence(mut self, strict: bool) -> Self {
        self.strict_silence = strict;
        self
    }
}

/// What every handle shares.
#[derive(Debug)]
pub(crate) struct Shared {
    pub(crate) clock: Clock,
    /// `sim:1=gd350,2=gd350`.
    pub(crate) name: String,
    units: Vec<u8>,
    world: Mutex<World>,
}

impl Shared {
    /// The world as some thread left it; no thread leaves it half done.
    pub(crate) fn lock(&self) -> MutexGuard<'_, World> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The world, come to the present.
    pub(crate) fn present(&self) -> MutexGuard<'_, World> {
        let mut world = self.lock();
        let now = self.clock.now(world.now());
        world.advance(now);
        world
    }
}

/// A simulated line with simulated drives. Clones are handles to the same simulation.
#[derive(Debug, Clone)]
pub struct Simulator {
    shared: Arc<Shared>,
}

impl Simulator {
    /// A line with these units: address (1..=247) and the name of a profile.
    ///
    /// # Errors
    ///
    /// [`SimError`]: an address is impossible or there twice, a profile is unknown or not simulated.
    pub fn new<'a>(units: impl IntoIterator<Item = (u8, &'a str)>, options: Options) -> Result<Self, SimError> {
        let mut maps: BTreeMap<&str, Arc<Map>> = BTreeMap::new();
        let mut drives = BTreeMap::new();
        for (unit, profile) in units {
            let address = UnitAddress::new(unit)?;
            let map = match maps.get(profile) {
                Some(map) => Arc::clone(map),
                None => Arc::clone(maps.entry(profile).or_insert(Arc::new(load(profile)?))),
            };
            if drives.insert(unit, Drive::new(address, map, Instant::ZERO)).is_some() {
                return Err(SimError::Twice { unit });
            }
        }
        let named: Vec<String> = drives.iter().map(|(unit, drive)| format!("{unit}={}", drive.profile())).collect();
        let shared = Shared {
            clock: if options.realtime { Clock::real() } else { Clock::Virtual },
            name: format!("sim:{}", named.join(",")),
            units: drives.keys().copied().collect(),
            world: Mutex::new(World::new(options.format, options.strict_silence, options.seed, drives)),
        };
        Ok(Self { shared: Arc::new(shared) })
    }

    /// A master's connection to the line, in this process.
    pub fn line(&self) -> SimLine {
        SimLine::new(Arc::clone(&self.shared))
    }

    /// A pseudo-terminal that other programs open as a serial port. Served by a thread until it is dropped.
    ///
    /// # Errors
    ///
    /// [`SimError::VirtualTime`], or [`SimError::Io`] if the system has no pseudo-terminal to give.
    #[cfg(target_os = "linux")]
    pub fn serve_pty(&self) -> Result<crate::PtyServer, SimError> {
        self.require_real_time()?;
        Ok(crate::PtyServer::start(Arc::clone(&self.shared))?)
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
                Ok(SimulatedDrive { shared: Arc::clone(&self.shared), unit: address })
            }
            _ => Err(SimError::NoUnit { unit, present: self.shared.units.clone() }),
        }
    }

    /// The wire.
    pub fn wire(&self) -> SimulatedLine {
        SimulatedLine { shared: Arc::clone(&self.shared) }
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

fn load(profile: &str) -> Result<Map, SimError> {
    let map = Map::builtin(profile)?;
    if map.profile() == SIMULATED { Ok(map) } else { Err(SimError::NotSimulated { profile: profile.to_owned() }) }
}

/// One drive, seen from its shaft, its terminals and its keypad, not from the bus.
#[derive(Debug, Clone)]
pub struct SimulatedDrive {
    shared: Arc<Shared>,
    unit: UnitAddress,
}

impl SimulatedDrive {
    /// Its address on the line.
    pub fn unit(&self) -> u8 {
        self.unit.get()
    }

    /// The name of its profile.
    pub fn profile(&self) -> String {
        self.with(|drive| drive.profile().to_owned()).unwrap_or_default()
    }

    /// What the motor does: `forward`, `reverse`, `stopped` or `fault`.
    pub fn state(&self) -> &'static str {
        self.with(|drive| drive.state()).unwrap_or("unknown")
    }

    /// Output frequency in Hz, negative in reverse; 0 while the output is off.
    pub fn frequency(&self) -> f64 {
        self.with(|drive| drive.frequency()).unwrap_or(0.0)
    }

    /// Shaft speed in rpm, negative in reverse.
    pub fn speed(&self) -> f64 {
        self.with(|drive| drive.speed()).unwrap_or(0.0)
    }

    /// Present fault number, 0 for none.
    pub fn fault(&self) -> u16 {
        self.with(|drive| drive.fault()).unwrap_or(0)
    }

    /// Load torque as a share of the motor's rated torque.
    pub fn load(&self) -> f64 {
        self.with(|drive| drive.load()).unwrap_or(0.0)
    }

    /// Sets the load torque: 0.0..=4.0 of the motor's rated torque.
    ///
    /// # Errors
    ///
    /// [`SimError::Load`]: out of range.
    pub fn set_load(&self, load: f64) -> Result<(), SimError> {
        if !(0.0..=MAX_LOAD).contains(&load) {
            return Err(SimError::Load { load });
        }
        self.with(|drive| drive.set_load(load));
        Ok(())
    }

    /// Digital inputs, bit 0 = S1.
    pub fn inputs(&self) -> u16 {
        self.with(|drive| drive.inputs()).unwrap_or(0)
    }

    /// Sets the digital inputs: bits 0 to 5 are S1 to S4, HDIA, HDIB.
    ///
    /// # Errors
    ///
    /// [`SimError::Inputs`]: other bits are set.
    pub fn set_inputs(&self, inputs: u16) -> Result<(), SimError> {
        if inputs > MAX_INPUTS {
            return Err(SimError::Inputs { inputs });
        }
        self.with(|drive| drive.set_inputs(inputs));
        Ok(())
    }

    /// Sets the word that analog input `input` (1..=4) shows; hundredths of a volt, two's complement.
    ///
    /// # Errors
    ///
    /// [`SimError::Analog`]: there is no such input.
    pub fn set_analog(&self, input: u8, word: u16) -> Result<(), SimError> {
        match input {
            1..=4 => {
                self.with(|drive| drive.set_analog(usize::from(input) - 1, word));
                Ok(())
            }
            _ => Err(SimError::Analog { input }),
        }
    }

    /// Trips the drive with fault `code` (1..=65535), whose cause is gone at once.
    ///
    /// # Errors
    ///
    /// [`SimError::NoFault`]: `code` is 0.
    pub fn trip(&self, code: u16) -> Result<(), SimError> {
        if code == 0 {
            return Err(SimError::NoFault);
        }
        self.with(|drive| drive.trip(code));
        Ok(())
    }

    /// Trips the drive with fault `code` (1..=65535), which cannot be reset before
    /// [`release_fault`](Self::release_fault).
    ///
    /// # Errors
    ///
    /// [`SimError::NoFault`]: `code` is 0.
    pub fn hold_fault(&self, code: u16) -> Result<(), SimError> {
        if code == 0 {
            return Err(SimError::NoFault);
        }
        self.with(|drive| drive.hold_fault(code));
        Ok(())
    }

    /// Takes the cause of a held fault away. The fault stays until it is reset.
    pub fn release_fault(&self) {
        self.with(Drive::release_fault);
    }

    /// Switches the drive off and on: RAM is lost, EEPROM stays, the motor coasts to a stop.
    pub fn power_cycle(&self) {
        let mut world = self.shared.present();
        let now = world.now();
        if let Some(drive) = world.drive(self.unit) {
            drive.power_cycle(now);
        }
    }

    /// The word at `address` as the drive would answer it now.
    ///
    /// # Errors
    ///
    /// The exception code with which it would refuse.
    pub fn register(&self, address: u16) -> Result<u16, ExceptionCode> {
        self.with(|drive| drive.read(address)).unwrap_or(Err(ExceptionCode::ILLEGAL_ADDRESS))
    }

    /// Words written to EEPROM from the bus.
    pub fn eeprom_writes(&self) -> u64 {
        self.with(|drive| drive.eeprom_writes()).unwrap_or(0)
    }

    /// Words written to one EEPROM address from the bus.
    pub fn eeprom_writes_of(&self, address: u16) -> u64 {
        self.with(|drive| drive.eeprom_writes_of(address)).unwrap_or(0)
    }

    /// The words that the drive took from the bus, oldest first; the last 100 000.
    pub fn writes(&self) -> Vec<WriteRecord> {
        self.with(|drive| drive.writes()).unwrap_or_default()
    }

    /// A handle is given out only for a unit that exists, and units never go, so `None` does not happen.
    fn with<T>(&self, ask: impl FnOnce(&mut Drive) -> T) -> Option<T> {
        self.shared.present().drive(self.unit).map(ask)
    }
}

/// The wire: what it saw, and what it is told to spoil.
#[derive(Debug, Clone)]
pub struct SimulatedLine {
    shared: Arc<Shared>,
}

impl SimulatedLine {
    /// Transmissions of masters, right or wrong, that silence or the next one has told apart.
    pub fn requests(&self) -> u64 {
        self.shared.present().wire.requests
    }

    /// Requests whose first bit came less than 3.5 characters after the last bit on the wire.
    pub fn silence_violations(&self) -> u64 {
        self.shared.present().wire.silence_violations
    }

    /// Characters that were spoilt because both sides spoke at once.
    pub fn collisions(&self) -> u64 {
        self.shared.present().wire.collisions
    }

    /// The next answer on the line is `bytes` instead, as they are. Several wait in order.
    pub fn answer_with(&self, bytes: &[u8]) {
        self.shared.present().wire.spoil.answer_with(bytes);
    }

    /// The next `count` answers are lost.
    pub fn drop_answers(&self, count: u32) {
        self.shared.present().wire.spoil.drop_answers(count);
    }

    /// The next `count` answers come this much later.
    pub fn delay_answers(&self, delay: Duration, count: u32) {
        self.shared.present().wire.spoil.delay_answers(delay, count);
    }

    /// `bytes` come right before the next `count` answers.
    pub fn noise_before(&self, bytes: &[u8], count: u32) {
        self.shared.present().wire.spoil.noise_before(bytes, count);
    }

    /// `bytes` come right after the next `count` answers.
    pub fn noise_after(&self, bytes: &[u8], count: u32) {
        self.shared.present().wire.spoil.noise_after(bytes, count);
    }

    /// Forgets every fault that waits.
    pub fn clear(&self) {
        self.shared.present().wire.spoil.clear();
    }

    /// The last 1000 transmissions, oldest first.
    pub fn trace(&self) -> Vec<Transmission> {
        self.shared.present().wire.trace.to_vec()
    }
}
