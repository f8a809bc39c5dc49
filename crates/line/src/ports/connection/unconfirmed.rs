//! The end of what the system could not hand over: how long what was sent may stay unconfirmed before the connection counts as
//! lost.
//!
//! Without it the system keeps on trying for a quarter of an hour, and a server that is reached again then gets every request of
//! that time at once, commands that nobody wants any more among them.
//!
//! One of the four files of this project with `unsafe`: no crate has the options of Apple and Windows in safe Rust.
#![cfg_attr(
    any(target_vendor = "apple", windows),
    expect(unsafe_code, reason = "no crate has these two options in safe Rust")
)]

use std::io;
use std::net::TcpStream;

/// The time, in seconds: Apple and Windows count no others.
#[cfg(any(target_os = "linux", target_vendor = "apple", windows))]
const SECONDS: u16 = 3;

/// Has the system give up what stays unconfirmed; `false` where it cannot be told.
///
/// # Errors
///
/// Linux can be told, and did not take it.
#[cfg(target_os = "linux")]
pub(super) fn give_up(stream: &TcpStream) -> io::Result<bool> {
    rustix::net::sockopt::set_tcp_user_timeout(stream, u32::from(SECONDS) * 1_000)?;
    Ok(true)
}

/// Has the system give up what stays unconfirmed; `false` where it cannot be told.
#[cfg(target_vendor = "apple")]
#[expect(clippy::unnecessary_wraps, reason = "it may fail on Linux")]
pub(super) fn give_up(stream: &TcpStream) -> io::Result<bool> {
    use std::os::fd::AsRawFd;

    /// From its netinet/tcp.h; libc does not name it.
    const TCP_RXT_CONNDROPTIME: libc::c_int = 0x80;
    let seconds = libc::c_int::from(SECONDS);
    // SAFETY: the descriptor is open, and the option is an int that is only read, of the length that is said.
    let result = unsafe {
        let value = (&raw const seconds).cast();
        libc::setsockopt(stream.as_raw_fd(), libc::IPPROTO_TCP, TCP_RXT_CONNDROPTIME, value, size_of_val(&seconds) as _)
    };
    Ok(result == 0)
}

/// Has the system give up what stays unconfirmed; `false` where it cannot be told.
#[cfg(windows)]
#[expect(clippy::unnecessary_wraps, reason = "it may fail on Linux")]
pub(super) fn give_up(stream: &TcpStream) -> io::Result<bool> {
    use std::os::windows::io::AsRawSocket;

    /// From its ws2def.h and ws2ipdef.h; libc does not name them.
    const IPPROTO_TCP: libc::c_int = 6;
    const TCP_MAXRT: libc::c_int = 5;
    let seconds = u32::from(SECONDS);
    let Ok(socket) = libc::SOCKET::try_from(stream.as_raw_socket()) else { return Ok(false) };
    // SAFETY: the socket is open, and the option is a DWORD that is only read, of the length that is said.
    let result = unsafe {
        let value = (&raw const seconds).cast();
        libc::setsockopt(socket, IPPROTO_TCP, TCP_MAXRT, value, size_of_val(&seconds) as _)
    };
    Ok(result == 0)
}

/// Has the system give up what stays unconfirmed; `false` where it cannot be told.
#[cfg(not(any(target_os = "linux", target_vendor = "apple", windows)))]
#[expect(clippy::unnecessary_wraps, reason = "it may fail on Linux")]
pub(super) fn give_up(_stream: &TcpStream) -> io::Result<bool> {
    Ok(false)
}
