//! A test bench: one master, some drives, and the few things a test does with them.

use std::time::Duration;

use drivebus_line::Line;
use drivebus_rtu::{Frame, Instant, SerialFormat, crc16};
use drivebus_sim::{Options, SimLine, SimulatedDrive, Simulator};

/// Longer than any answer takes to come.
const PATIENCE: Duration = Duration::from_secs(1);

pub(crate) struct Bench {
    pub(crate) simulator: Simulator,
    pub(crate) line: SimLine,
}

impl Bench {
    /// Drives 1 and 3 on a line at 19 200 bit/s 8E1.
    pub(crate) fn new() -> Self {
        Self::with(Options::default())
    }

    pub(crate) fn with(options: Options) -> Self {
        Self::line_of(&[(1, "gd350"), (3, "gd350")], options)
    }

    /// One drive, with the address 1.
    pub(crate) fn of(family: &str) -> Self {
        Self::line_of(&[(1, family)], Options::default())
    }

    /// Any drives.
    pub(crate) fn line_of(units: &[(u8, &str)], options: Options) -> Self {
        let simulator = Simulator::new(units.iter().copied(), options).unwrap();
        let line = simulator.line();
        Self { simulator, line }
    }

    /// Drive 1 set to obey the bus.
    pub(crate) fn obedient() -> Self {
        let mut bench = Self::new();
        for (address, value) in [(0x0001, 2), (0x0002, 0), (0x0006, 8)] {
            bench.write(address, value);
        }
        bench
    }

    pub(crate) fn drive(&self) -> SimulatedDrive {
        self.simulator.drive(1).unwrap()
    }

    /// Keeps the silence, sends `frame` as it is, and returns all that comes back.
    pub(crate) fn exchange(&mut self, frame: &[u8]) -> Vec<u8> {
        let silence = self.line.now() + SerialFormat::DEFAULT.t35();
        self.line.sleep(silence);
        let sent = self.line.send(frame).unwrap();
        self.listen(sent + PATIENCE).into_iter().map(|(_, byte)| byte).collect()
    }

    /// What arrives until `until` or, once something came, until 50 ms of silence.
    pub(crate) fn listen(&mut self, until: Instant) -> Vec<(Instant, u8)> {
        let mut heard = Vec::new();
        let mut until = until;
        let mut buffer = [0; 1];
        while self.line.receive(&mut buffer, until).unwrap() == 1 {
            heard.push((self.line.now(), buffer[0]));
            until = self.line.now() + Duration::from_millis(50);
        }
        heard
    }

    /// Sends `pdu` to `unit`; returns the PDU that answers it.
    pub(crate) fn ask(&mut self, unit: u8, pdu: &[u8]) -> Option<Vec<u8>> {
        let answer = self.exchange(&framed(unit, pdu));
        if answer.is_empty() {
            return None;
        }
        let frame = Frame::parse(&answer).unwrap();
        assert_eq!(frame.address(), unit);
        Some(frame.pdu().to_vec())
    }

    /// The PDU `request` to drive 1, which must answer `answer`; both in hex.
    #[track_caller]
    pub(crate) fn answers(&mut self, request: &str, answer: &str) {
        assert_eq!(self.ask(1, &hex(request)), Some(hex(answer)), "{request}");
    }

    /// The same for one that writes and is echoed; then a minute passes.
    #[track_caller]
    pub(crate) fn obeys(&mut self, request: &str) {
        self.answers(request, request);
        self.go_to(self.taken(), 60.0);
    }

    /// 06H to drive 1, which must take it.
    pub(crate) fn write(&mut self, address: u16, value: u16) {
        self.write_to(1, address, value);
    }

    /// 06H to a drive, which must take it.
    pub(crate) fn write_to(&mut self, unit: u8, address: u16, value: u16) {
        let pdu = pdu(0x06, &[address, value]);
        assert_eq!(self.ask(unit, &pdu), Some(pdu));
    }

    /// 06H to drive 1, which must refuse it with this code.
    #[track_caller]
    pub(crate) fn refuses_write(&mut self, address: u16, value: u16, code: u8) {
        let answer = self.ask(1, &pdu(0x06, &[address, value]));
        assert_eq!(answer, Some(vec![0x86, code]), "{address:04X} = {value:04X}");
    }

    /// 03H to drive 1, which must refuse it with this code.
    #[track_caller]
    pub(crate) fn refuses_read(&mut self, address: u16, count: u16, code: u8) {
        let answer = self.ask(1, &pdu(0x03, &[address, count]));
        assert_eq!(answer, Some(vec![0x83, code]), "{count} from {address:04X}");
    }

    /// 10H to drive 1, which must take it.
    pub(crate) fn write_many(&mut self, address: u16, values: &[u16]) {
        let count = u16::try_from(values.len()).unwrap();
        let request = write_many_pdu(address, values);
        assert_eq!(self.ask(1, &request), Some(pdu(0x10, &[address, count])));
    }

    /// 03H to drive 1, which must answer.
    pub(crate) fn read<const N: usize>(&mut self, address: u16) -> [u16; N] {
        let answer = self.ask(1, &pdu(0x03, &[address, u16::try_from(N).unwrap()])).unwrap();
        assert_eq!(answer[..2], [0x03, u8::try_from(2 * N).unwrap()]);
        let words: Vec<u16> = answer[2..].chunks(2).map(|word| u16::from_be_bytes([word[0], word[1]])).collect();
        words.try_into().unwrap()
    }

    /// Forward at `hundredths` of a hertz in one frame; returns the moment the drive took it.
    pub(crate) fn run(&mut self, hundredths: u16) -> Instant {
        self.write_many(0x2000, &[1, hundredths]);
        self.taken()
    }

    /// The moment drive 1 took the last word.
    pub(crate) fn taken(&self) -> Instant {
        self.drive().writes().last().unwrap().at
    }

    /// Lets time pass until `seconds` after `from`.
    pub(crate) fn go_to(&mut self, from: Instant, seconds: f64) {
        let until = from + Duration::from_secs_f64(seconds);
        assert!(self.line.now() <= until, "the bus took longer than the test allows for");
        self.line.sleep(until);
    }
}

/// A PDU of a function code and words.
pub(crate) fn pdu(function: u8, words: &[u16]) -> Vec<u8> {
    [function].into_iter().chain(words.iter().flat_map(|word| word.to_be_bytes())).collect()
}

pub(crate) fn write_many_pdu(address: u16, values: &[u16]) -> Vec<u8> {
    let count = u16::try_from(values.len()).unwrap();
    let mut request = pdu(0x10, &[address, count]);
    request.push(u8::try_from(2 * values.len()).unwrap());
    request.extend(values.iter().flat_map(|value| value.to_be_bytes()));
    request
}

/// `pdu` with the address before it and the CRC after it.
pub(crate) fn framed(unit: u8, pdu: &[u8]) -> Vec<u8> {
    let mut frame = vec![unit];
    frame.extend_from_slice(pdu);
    frame.extend(crc16(&frame).to_le_bytes());
    frame
}

/// Bytes as the manuals print them.
pub(crate) fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}
