//! The two threads of a connection: one that reads what the client asks, and the clerk's.

use std::io::ErrorKind;
use std::sync::Arc;
use std::time::Duration;

use crate::gateway::clerk::Clerk;
use crate::gateway::connection::Connection;
use crate::gateway::desk::Desk;
use crate::gateway::mailbox::Mailbox;
use crate::gateway::requests::Requests;
use crate::gateway::stream::{HURRY, Stream, is_late};
use crate::system::clock::monotonic;

/// Requests of one connection on their way to the line.
pub(super) const IN_FLIGHT: usize = 16;
/// What is read at a time.
const CHUNK: usize = 4_096;

/// Serves the other end of the connection to its end.
///
/// # Errors
///
/// The system's: it gives no thread.
pub(super) fn serve(connection: Connection) -> std::io::Result<()> {
    let mailbox = Arc::new(Mailbox::default());
    let (reader, end) = (Arc::clone(&connection.stream), Arc::clone(&connection.stream));
    let letters = Arc::clone(&mailbox);
    let common = Arc::clone(&connection.common);
    std::thread::Builder::new().name("drivebus-tcp-in".to_owned()).spawn(move || {
        common.enter_thread();
        let why = read(&*reader, &letters, Requests::new(common.framing));
        letters.end(why);
    })?;
    let letters = Arc::clone(&mailbox);
    let desk = std::thread::Builder::new().name("drivebus-tcp".to_owned());
    let spawned = desk.spawn(move || {
        connection.common.enter_thread();
        let stream = Arc::clone(&connection.stream);
        let desk = Desk::new(connection.common.within, IN_FLIGHT, connection.common.framing);
        let why = Clerk::new(connection, desk).work(&letters);
        letters.end(why);
        // The reader waits there.
        stream.end();
    });
    if spawned.is_err() {
        mailbox.end(String::new());
        end.end();
    }
    spawned.map(drop)
}

/// Reads requests until the connection ends; why it does, for people, empty where the client ended it.
fn read(stream: &dyn Stream, mailbox: &Mailbox, mut requests: Requests) -> String {
    let mut bytes = [0; CHUNK];
    // When what is there began: the request that is not whole, or the time without one.
    let mut since = monotonic();
    loop {
        let limit = if requests.has_begun() { HURRY } else { stream.idle().unwrap_or(Duration::MAX) };
        let left = (since + limit).saturating_duration_since(monotonic());
        let came = if left.is_zero() { Err(ErrorKind::TimedOut.into()) } else { stream.read(&mut bytes, left) };
        match came {
            Ok(0) => return String::new(),
            Ok(count) => {
                let now = monotonic();
                let had_begun = requests.has_begun();
                let mut asked_any = false;
                let mut is_heard = true;
                let taken = requests.take(&bytes[..count], |asked| {
                    asked_any = true;
                    is_heard = is_heard && mailbox.ask(asked, now);
                });
                if let Err(wrong) = taken {
                    return wrong.to_string();
                }
                if !is_heard {
                    return String::new();
                }
                if asked_any || !had_begun {
                    // From when this is read on: what the client had to wait for room is not its delay.
                    since = monotonic();
                }
            }
            Err(error) if is_late(&error) => {
                if monotonic() < since + limit {
                    continue;
                }
                return if requests.has_begun() {
                    format!("a request that was not whole within {} s", HURRY.as_secs())
                } else {
                    format!("no request for {} s", limit.as_secs())
                };
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return String::new(),
        }
    }
}
