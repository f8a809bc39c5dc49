//! The simulated line behind a pseudo-terminal and TCP, in real time.
//!
//! Nothing here judges how long something took, except that no character may be early.

#[cfg(target_os = "linux")]
use std::fs::{File, OpenOptions};
#[cfg(unix)]
use std::io::{ErrorKind, Read, Write};
#[cfg(unix)]
use std::net::TcpStream;
use std::time::Duration;

use drivebus_line::Line;
#[cfg(target_os = "linux")]
use drivebus_line::tty::{Tty, TtyOptions};
use drivebus_rtu::Instant;
#[cfg(unix)]
use drivebus_rtu::{DataBits, Parity, SerialFormat, Silence, StopBits};
#[cfg(target_os = "linux")]
use drivebus_sim::FaultKind;
use drivebus_sim::{Options, SimError, Simulator};

use crate::bench::{framed, hex, pdu};

/// 8 characters, the silence and 7 characters of 11 bits at 19 200 bit/s.
const SHORTEST: Duration = Duration::from_nanos(4_583_334 + 2_005_209 + 4_010_417);

fn simulator() -> Simulator {
    Simulator::new([(1, "gd350")], Options::default().realtime(true)).unwrap()
}

/// Asks who is there, three times, and reads each answer byte by byte, blocking.
#[cfg(unix)]
fn ask_thrice(simulator: &Simulator, port: &mut (impl Read + Write)) {
    for _ in 0..3 {
        let sent = simulator.now();
        port.write_all(&framed(1, &pdu(0x03, &[0x2103, 1]))).unwrap();
        let mut answer = [0; 7];
        port.read_exact(&mut answer).unwrap();
        assert!(simulator.now() >= sent + SHORTEST, "faster than the wire");
        assert_eq!(answer[..], hex("01 03 02 01 A0 B9 AC"));
    }
}

#[cfg(target_os = "linux")]
fn open(server: &drivebus_sim::PtyServer) -> File {
    OpenOptions::new().read(true).write(true).open(server.path()).unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn a_pseudo_terminal_serves_one_program_after_the_other() {
    let simulator = simulator();
    let server = simulator.serve_pty().unwrap();
    ask_thrice(&simulator, &mut open(&server));
    ask_thrice(&simulator, &mut open(&server));
    assert_eq!(simulator.wire().requests(), 6);
}

/// Whether unit 1 answers a bus that opens `path` as `format` says.
#[cfg(target_os = "linux")]
fn answers(path: &std::path::Path, format: &SerialFormat) -> bool {
    let mut port = Tty::open(path.to_str().unwrap(), format, &TtyOptions::default()).unwrap();
    let sent = port.send(&framed(1, &pdu(0x03, &[0x2103, 1]))).unwrap();
    port.receive(&mut [0; 64], sent + Duration::from_millis(300)).unwrap() > 0
}

#[cfg(target_os = "linux")]
#[test]
fn the_speed_that_a_program_sets_on_a_pseudo_terminal_counts_and_parity_does_not() {
    let simulator = simulator();
    let server = simulator.serve_pty().unwrap();
    let format =
        |speed, parity| SerialFormat::new(speed, DataBits::Eight, parity, StopBits::One, Silence::Spec).unwrap();
    let path = server.path();
    assert!(!answers(&path, &format(9_600, Parity::Even)));
    assert!(answers(&path, &format(19_200, Parity::Even)));
    assert!(answers(&path, &format(19_200, Parity::None)), "no pseudo-terminal carries it");
    simulator.wire().set_format(format(9_600, Parity::None));
    assert!(!answers(&path, &format(19_200, Parity::Even)));
    assert!(answers(&path, &format(9_600, Parity::Even)));
    // One that only opens and writes has the speed that was set last.
    simulator.wire().set_format(format(9_600, Parity::Even));
    let mut port = open(&server);
    port.write_all(&framed(1, &pdu(0x03, &[0x2103, 1]))).unwrap();
    port.read_exact(&mut [0; 7]).unwrap();
}

#[cfg(unix)]
#[test]
fn a_tcp_port_keeps_the_settings_that_the_simulation_began_with() {
    let simulator = simulator();
    let server = simulator.serve_tcp().unwrap();
    let other = SerialFormat::new(19_200, DataBits::Eight, Parity::None, StopBits::One, Silence::Spec).unwrap();
    let mut port = TcpStream::connect(server.address()).unwrap();
    ask_thrice(&simulator, &mut port);
    simulator.wire().set_format(other);
    port.write_all(&framed(1, &pdu(0x03, &[0x2103, 1]))).unwrap();
    port.set_read_timeout(Some(Duration::from_millis(200))).unwrap();
    assert!(port.read(&mut [0; 8]).is_err(), "nobody understands 8E1 any more");
    simulator.wire().set_format(SerialFormat::DEFAULT);
    port.set_read_timeout(None).unwrap();
    ask_thrice(&simulator, &mut port);
}

#[cfg(target_os = "linux")]
#[test]
fn a_pseudo_terminal_is_gone_when_its_server_is_dropped() {
    let simulator = simulator();
    let server = simulator.serve_pty().unwrap();
    let mut port = open(&server);
    drop(server);
    // The read end of a terminal whose other side is closed: end of file, or EIO.
    assert!(matches!(port.read(&mut [0; 1]), Ok(0) | Err(_)));
}

#[cfg(target_os = "linux")]
#[test]
fn a_pseudo_terminal_that_is_plugged_in_again_has_another_name_and_its_link_leads_there() {
    let simulator = simulator();
    let folder = std::env::temp_dir().join(format!("drivebus-link-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let link = folder.join("drive");
    std::fs::write(&link, "precious").unwrap();
    assert!(simulator.serve_pty_linked(&link).unwrap_err().to_string().contains("is not a link"));
    std::fs::remove_file(&link).unwrap();

    let server = simulator.serve_pty_linked(&link).unwrap();
    let mut names = vec![server.path()];
    for _ in 0..20 {
        let open_link = || OpenOptions::new().read(true).write(true).open(&link);
        let mut port = open_link().unwrap();
        ask_thrice(&simulator, &mut port);
        simulator.wire().unplug();
        assert!(matches!(port.read(&mut [0; 1]), Ok(0) | Err(_)), "a hang-up");
        assert!(open_link().is_err(), "there is nothing to open");
        simulator.wire().unplug();
        simulator.wire().replug().unwrap();
        simulator.wire().replug().unwrap();
        assert_ne!(Some(&server.path()), names.last());
        names.push(server.path());
        assert_eq!(std::fs::read_link(&link).unwrap(), server.path());
    }
    drop(server);
    assert!(std::fs::symlink_metadata(&link).is_err());
    std::fs::remove_dir(&folder).unwrap();
}

#[cfg(target_os = "linux")]
#[test]
fn all_ports_of_a_process_are_served_by_one_thread() {
    let simulators: Vec<Simulator> = (0..6).map(|_| simulator()).collect();
    let ptys: Vec<_> = simulators[..3].iter().map(|simulator| simulator.serve_pty().unwrap()).collect();
    let tcps: Vec<_> = simulators[3..].iter().map(|simulator| simulator.serve_tcp().unwrap()).collect();
    std::thread::scope(|scope| {
        for (simulator, server) in simulators.iter().zip(&ptys) {
            scope.spawn(|| ask_thrice(simulator, &mut open(server)));
        }
        for (simulator, server) in simulators[3..].iter().zip(&tcps) {
            scope.spawn(|| ask_thrice(simulator, &mut TcpStream::connect(server.address()).unwrap()));
        }
    });
    let threads = std::fs::read_dir("/proc/self/task").unwrap();
    let names = threads.filter_map(|thread| std::fs::read_to_string(thread.unwrap().path().join("comm")).ok());
    assert_eq!(names.filter(|name| name.trim_end() == "drivebus-sim").count(), 1);
    assert!(simulators.iter().all(|simulator| simulator.wire().requests() == 3));
}

#[cfg(unix)]
#[test]
fn tcp_is_refused_while_it_is_unplugged() {
    let simulator = simulator();
    let server = simulator.serve_tcp().unwrap();
    let mut port = TcpStream::connect(server.address()).unwrap();
    ask_thrice(&simulator, &mut port);
    simulator.wire().unplug();
    assert!(matches!(port.read(&mut [0; 1]), Ok(0) | Err(_)));
    assert_eq!(TcpStream::connect(server.address()).unwrap_err().kind(), ErrorKind::ConnectionRefused);
    simulator.wire().replug().unwrap();
    ask_thrice(&simulator, &mut TcpStream::connect(server.address()).unwrap());
}

#[cfg(target_os = "linux")]
#[test]
fn faults_and_echo_are_on_the_wire_behind_a_pseudo_terminal_too() {
    let simulator = simulator();
    let server = simulator.serve_pty().unwrap();
    let mut port = open(&server);
    let request = framed(1, &pdu(0x03, &[0x2103, 1]));
    simulator.wire().set_echo(true);
    simulator.wire().script(&[(1, FaultKind::Split)]);
    port.write_all(&request).unwrap();
    let mut came = [0; 15];
    port.read_exact(&mut came).unwrap();
    assert_eq!(came[..], [request, hex("01 03 02 01 A0 B9 AC")].concat());
    assert_eq!(simulator.wire().counts(FaultKind::Split), 1);
}

#[cfg(unix)]
#[test]
fn tcp_serves_one_client_after_the_other() {
    let simulator = simulator();
    let server = simulator.serve_tcp().unwrap();
    ask_thrice(&simulator, &mut TcpStream::connect(server.address()).unwrap());
    ask_thrice(&simulator, &mut TcpStream::connect(server.address()).unwrap());
    let mut port = TcpStream::connect(server.address()).unwrap();
    ask_thrice(&simulator, &mut port);
    drop(server);
    assert!(matches!(port.read(&mut [0; 1]), Ok(0) | Err(_)));
}

#[test]
fn the_line_in_process_runs_in_real_time_too() {
    let simulator = simulator();
    let mut line = simulator.line();
    let sent = line.now();
    line.send(&framed(1, &pdu(0x03, &[0x2103, 1]))).unwrap();
    let mut answer = Vec::new();
    let mut buffer = [0; 16];
    while answer.len() < 7 {
        let until = line.now() + Duration::from_secs(60);
        let count = line.receive(&mut buffer, until).unwrap();
        answer.extend_from_slice(&buffer[..count]);
    }
    assert!(line.now() >= sent + SHORTEST, "faster than the wire");
    assert_eq!(answer, hex("01 03 02 01 A0 B9 AC"));
}

#[test]
fn each_clock_allows_what_it_can() {
    let virtual_time = Simulator::new([(1, "gd350")], Options::default()).unwrap();
    #[cfg(target_os = "linux")]
    assert!(matches!(virtual_time.serve_pty(), Err(SimError::VirtualTime)));
    #[cfg(unix)]
    assert!(matches!(virtual_time.serve_tcp(), Err(SimError::VirtualTime)));
    assert!(matches!(simulator().advance(Duration::from_secs(1)), Err(SimError::RealTime)));
    assert_eq!(virtual_time.now(), Instant::ZERO);
}
