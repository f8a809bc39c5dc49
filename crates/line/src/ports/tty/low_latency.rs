//! The low-latency flag of a port's driver: two ioctls that no crate offers in safe Rust.
//!
//! One of the four files of this project with `unsafe`. `serial2`, `rustix` and `nix` leave `TIOCGSERIAL` and `TIOCSSERIAL` out;
//! `serialport_low_latency` has them for ports of `serialport` only, and brings bindgen. Without the flag only root, or a
//! udev rule, takes the 16 ms off every answer that an FTDI adapter adds from the factory.

use std::io;

use serial2::SerialPort;

use crate::ports::adapters::latency::LowLatencyFlag;

#[cfg(all(target_os = "linux", not(any(target_arch = "mips", target_arch = "mips64"))))]
#[expect(unsafe_code, reason = "no crate has these two ioctls in safe Rust")]
mod linux {
    use std::io;

    use rustix::ioctl::{Opcode, Setter, Updater, ioctl};
    use serial2::SerialPort;

    /// From `asm-generic/ioctls.h`; MIPS has numbers of its own.
    const TIOCGSERIAL: Opcode = 0x541E;
    const TIOCSSERIAL: Opcode = 0x541F;

    /// `ASYNC_LOW_LATENCY` of `linux/tty_flags.h`.
    const LOW_LATENCY: i32 = 1 << 13;

    /// `struct serial_struct` of `linux/serial.h`, of which only `flags` is looked at. It is 72 bytes long where pointers
    /// have 64 bits and 60 where they have 32; the rest is room.
    #[derive(Clone, Copy)]
    #[repr(C, align(8))]
    struct SerialStruct {
        kind_line_port_irq: [i32; 4],
        flags: i32,
        rest: [i32; 27],
    }

    pub(super) fn get(port: &SerialPort) -> io::Result<bool> {
        Ok(read(port)?.flags & LOW_LATENCY != 0)
    }

    pub(super) fn set(port: &SerialPort, on: bool) -> io::Result<()> {
        let mut settings = read(port)?;
        settings.flags = if on { settings.flags | LOW_LATENCY } else { settings.flags & !LOW_LATENCY };
        // SAFETY: the kernel reads one `serial_struct`, which is no longer than what it is given, and keeps no pointer.
        unsafe { ioctl(port, Setter::<TIOCSSERIAL, SerialStruct>::new(settings)) }?;
        Ok(())
    }

    fn read(port: &SerialPort) -> io::Result<SerialStruct> {
        let mut settings = SerialStruct { kind_line_port_irq: [0; 4], flags: 0, rest: [0; 27] };
        // SAFETY: the kernel writes one `serial_struct` there, which is no longer than the place it is given, and any
        // bytes are valid integers.
        unsafe { ioctl(port, Updater::<TIOCGSERIAL, SerialStruct>::new(&mut settings)) }?;
        Ok(settings)
    }
}

#[cfg(all(target_os = "linux", not(any(target_arch = "mips", target_arch = "mips64"))))]
impl LowLatencyFlag for SerialPort {
    fn low_latency(&self) -> io::Result<bool> {
        linux::get(self)
    }

    fn set_low_latency(&self, on: bool) -> io::Result<()> {
        linux::set(self, on)
    }
}

#[cfg(not(all(target_os = "linux", not(any(target_arch = "mips", target_arch = "mips64")))))]
impl LowLatencyFlag for SerialPort {
    fn low_latency(&self) -> io::Result<bool> {
        Err(io::ErrorKind::Unsupported.into())
    }

    fn set_low_latency(&self, _on: bool) -> io::Result<()> {
        Err(io::ErrorKind::Unsupported.into())
    }
}
