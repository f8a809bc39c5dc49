//! Drives the protocol core by hand, as a microcontroller would: a UART that takes and gives bytes, a timer, no thread.
//!
//! Only `drivebus-rtu` is used, which needs no allocator and no clock; the simulated line stands for the hardware.
//!
//! ```text
//! cargo run --example by_hand
//! ```
#![allow(clippy::print_stdout, reason = "an example shows what it does")]

use std::error::Error;
use std::time::Duration;

use drivebus::line::Line;
use drivebus::rtu::{Answer, Event, Instant, Master, Request, SerialFormat, UnitAddress};
use drivebus::sim::{Options, SimLine, Simulator};

/// What the hardware offers: a timer, a transmitter, and a receiver that hands over one byte at a time.
struct Uart(SimLine);

impl Uart {
    fn now(&self) -> Instant {
        self.0.now()
    }

    /// Sends in one piece, and tells when the last bit will have left.
    fn send(&mut self, bytes: &[u8]) -> Result<Instant, Box<dyn Error>> {
        Ok(self.0.send(bytes)?)
    }

    /// Sleeps until a byte is there or the timer has come to `until`.
    fn wait_for_byte(&mut self, until: Instant) -> Result<Option<u8>, Box<dyn Error>> {
        let mut byte = [0];
        Ok(if self.0.receive(&mut byte, until)? == 0 { None } else { Some(byte[0]) })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let format = SerialFormat::DEFAULT; // 19 200 bit/s, 8E1
    let mut uart = Uart(Simulator::new([(1, "gd350")], Options::default().format(format))?.line());
    let mut master = Master::new(&format);

    let frequency = ask(&mut uart, &mut master, &format, &Request::read(0x3000, 1)?)?;
    println!("running frequency: {}.{:02} Hz", frequency / 100, frequency % 100);
    let current = ask(&mut uart, &mut master, &format, &Request::read(0x3004, 1)?)?;
    println!("output current: {}.{} A", current / 10, current % 10);
    Ok(())
}

/// Asks unit 1, and returns the first word of its answer.
fn ask(
    uart: &mut Uart,
    master: &mut Master,
    format: &SerialFormat,
    request: &Request<'_>,
) -> Result<u16, Box<dyn Error>> {
    let unit = UnitAddress::new(1)?;
    master.begin(uart.now(), unit.into(), request, Duration::from_millis(500))?;
    loop {
        match master.poll(uart.now()) {
            None => {
                let until = master.deadline().unwrap_or(uart.now());
                if let Some(byte) = uart.wait_for_byte(until)? {
                    master.receive(uart.now(), &[byte]);
                }
            }
            Some(Event::Transmit(frame)) => {
                let end = uart.send(frame)?;
                debug_assert_eq!(end, uart.now() + format.chars(u32::try_from(frame.len())?));
                master.sent(end);
            }
            Some(Event::Answer(Answer::Read { words, .. })) => return Ok(words.get(0).unwrap_or_default()),
            Some(outcome) => return Err(format!("{outcome:?}").into()),
        }
    }
}
