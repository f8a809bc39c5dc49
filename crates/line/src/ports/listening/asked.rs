//! The sockets that listen at a port, as Linux tells who asks for them.
//!
//! A question is a `nlmsghdr` and an `inet_diag_req_v2` for all sockets of a family that listen; the answer is messages, of
//! a `nlmsghdr` and an `inet_diag_msg` each, up to one that says "done". Numbers are of the processor's own byte order, but
//! for the port. Source: `netlink(7)`, `sock_diag(7)`.

use std::io::{Error, ErrorKind, Result};
use std::net::IpAddr;

use rustix::net::sockopt::{Timeout, set_socket_timeout};
use rustix::net::{AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, netlink, recv, send, socket_with};

use super::Listener;

/// `SOCK_DIAG_BY_FAMILY`: the kind of the question and of its answers.
const BY_FAMILY: u16 = 20;
/// `NLM_F_REQUEST` and `NLM_F_DUMP`.
const REQUEST: u16 = 0x0301;
/// `NLMSG_ERROR` and `NLMSG_DONE`.
const ERROR: u16 = 2;
const DONE: u16 = 3;
/// `IPPROTO_TCP`, and the bit of the state "listens".
const TCP: u8 = 6;
const LISTENS: u32 = 1 << 10;
/// The lengths of `nlmsghdr`, `inet_diag_req_v2` and `inet_diag_msg`.
const HEADER: usize = 16;
const QUESTION: usize = 56;
const MESSAGE: usize = 72;
/// Nobody is waited for who does not answer: the system does within microseconds.
const PATIENCE: std::time::Duration = std::time::Duration::from_millis(100);

/// All that listen at `port`.
///
/// # Errors
///
/// The system does not let one ask, or its answer is none.
pub(super) fn listeners(port: u16) -> Result<Vec<Listener>> {
    let mut found = Vec::new();
    let socket = socket_with(AddressFamily::NETLINK, SocketType::RAW, SocketFlags::CLOEXEC, Some(netlink::SOCK_DIAG))?;
    set_socket_timeout(&socket, Timeout::Recv, Some(PATIENCE))?;
    // What one answer of the system holds at most.
    let mut answer = vec![0; 32_768];
    for family in [AddressFamily::INET, AddressFamily::INET6] {
        send(&socket, &question(family, port), SendFlags::empty())?;
        loop {
            let (length, whole) = recv(&socket, answer.as_mut_slice(), RecvFlags::TRUNC)?;
            if length < whole {
                return Err(ErrorKind::InvalidData.into());
            }
            if read_off(&answer[..length], &mut found)? {
                break;
            }
        }
    }
    Ok(found)
}

fn question(family: AddressFamily, port: u16) -> [u8; HEADER + QUESTION] {
    let mut bytes = [0; HEADER + QUESTION];
    let mut put = |at: usize, some: &[u8]| bytes[at..at + some.len()].copy_from_slice(some);
    put(0, &72_u32.to_ne_bytes());
    put(4, &BY_FAMILY.to_ne_bytes());
    put(6, &REQUEST.to_ne_bytes());
    put(HEADER, &[family.as_raw().to_ne_bytes()[0], TCP]);
    put(HEADER + 4, &LISTENS.to_ne_bytes());
    put(HEADER + 8, &port.to_be_bytes());
    bytes
}

/// Adds what the messages of an answer tell; returns whether it was the last answer.
fn read_off(answer: &[u8], found: &mut Vec<Listener>) -> Result<bool> {
    let no_answer = || Error::from(ErrorKind::InvalidData);
    let mut rest = answer;
    while !rest.is_empty() {
        let &length = rest.first_chunk().ok_or_else(no_answer)?;
        let &[_, _, _, _, kind @ .., _, _] = rest.first_chunk::<8>().ok_or_else(no_answer)?;
        let length = usize::try_from(u32::from_ne_bytes(length)).map_err(|_| no_answer())?;
        let told = rest.get(HEADER..length).ok_or_else(no_answer)?;
        match u16::from_ne_bytes(kind) {
            DONE => return Ok(true),
            // The number of an error, and it is negative.
            ERROR => {
                let number = told.first_chunk().map(|&number| i32::from_ne_bytes(number)).ok_or_else(no_answer)?;
                return Err(Error::from_raw_os_error(number.saturating_neg()));
            }
            BY_FAMILY => found.push(listener(told).ok_or_else(no_answer)?),
            _ => {}
        }
        // Each begins at a multiple of four.
        rest = rest.get(length.next_multiple_of(4)..).unwrap_or_default();
    }
    Ok(false)
}

/// The socket of an `inet_diag_msg`: its family first, its port at 4, its address at 8 and its number at 68.
fn listener(told: &[u8]) -> Option<Listener> {
    let told = told.first_chunk::<MESSAGE>()?;
    let port = u16::from_be_bytes([told[4], told[5]]);
    let ip = match u16::from(told[0]) {
        family if family == AddressFamily::INET.as_raw() => IpAddr::from(*told[8..].first_chunk::<4>()?),
        family if family == AddressFamily::INET6.as_raw() => IpAddr::from(*told[8..].first_chunk::<16>()?),
        _ => return None,
    };
    Some(Listener { ip, port, socket: u32::from_ne_bytes(*told.last_chunk()?).into() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_cut_anywhere_is_no_answer_or_none_of_its_messages_is_made_up() {
        let mut message = vec![0; HEADER + MESSAGE];
        message[..6].copy_from_slice(&[88, 0, 0, 0, 20, 0]);
        message[HEADER] = 2;
        message[HEADER + 4..HEADER + 12].copy_from_slice(&[0x0F, 0xA1, 0, 0, 127, 0, 0, 1]);
        message[HEADER + 68] = 11;
        if cfg!(target_endian = "big") {
            return; // the bytes are of a machine of the other order
        }
        let here = Listener { ip: IpAddr::from([127, 0, 0, 1]), port: 0x0FA1, socket: 11 };
        let done = [20, 0, 0, 0, 3, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        let whole = [message.as_slice(), message.as_slice(), &done].concat();
        for cut in 0..=whole.len() {
            let mut found = Vec::new();
            let told = read_off(&whole[..cut], &mut found);
            assert!(found.iter().all(|each| *each == here), "{cut}");
            assert_eq!(told.is_ok(), [0, 88, 176, 196].contains(&cut), "{cut}");
            assert_eq!(told.is_ok_and(|is_last| is_last), cut == 196, "{cut}");
        }
        let refused = [20, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xF3, 0xFF, 0xFF, 0xFF];
        let error = read_off(&refused, &mut Vec::new()).unwrap_err();
        assert_eq!(error.raw_os_error(), Some(13));
        // Lengths that are none do not go on for ever.
        for length in [0_u8, 15, 255] {
            assert!(read_off(&[length, 0, 0, 0, 20, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], &mut Vec::new()).is_err());
        }
    }
}
