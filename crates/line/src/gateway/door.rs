//! Where clients come in over the network, and how each is let in.

use std::io;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::gateway::clients::Clients;
use crate::gateway::common::Common;
use crate::gateway::connection::Connection;
use crate::gateway::reader;
use crate::gateway::stream::{Stream, over_tcp};
use crate::system::clock::{LOOK_UP, monotonic};
use crate::system::inherited::Kept;

/// Who is behind the doors of one gateway.
#[derive(Debug, Clone)]
pub(super) struct Hall {
    pub(super) common: Arc<Common>,
    pub(super) clients: Arc<Clients>,
}

impl Hall {
    /// Serves the client at the other end of `stream`, who is at `host` and is called `name`.
    pub(super) fn let_in(&self, stream: Arc<dyn Stream>, host: IpAddr, name: String) -> io::Result<()> {
        let Some(bus) = self.common.bus.upgrade() else {
            stream.end();
            return Ok(());
        };
        let seat = bus.seat_of(format!("client {name}"));
        drop(bus);
        let Some((place, gave_way)) = self.clients.enter(Arc::clone(&stream), host, monotonic()) else {
            stream.end();
            return Ok(());
        };
        if gave_way {
            self.common.counts.gave_way(&name);
        }
        self.common.counts.let_in();
        reader::serve(Connection { common: Arc::clone(&self.common), seat, host, name, place, stream })
    }

    /// A client cannot be let in now: that is told.
    pub(super) fn tell(&self, error: &io::Error) {
        self.common.counts.tell(format!("a client cannot be let in now: {error}"));
    }
}

/// A door to the network.
pub(super) struct TcpDoor {
    pub(super) hall: Hall,
    pub(super) listener: Kept<TcpListener>,
    pub(super) is_closed: Arc<AtomicBool>,
}

impl TcpDoor {
    /// Lets clients in until it is closed and somebody knocks; nobody is let in then, though a child that is being forked has
    /// the door still open.
    pub(super) fn stand(&self) {
        self.let_in_while_open();
        // Linux refuses clients from here on, whoever has a copy; other systems do when the last copy is closed.
        #[cfg(unix)]
        let _ = rustix::net::shutdown(&*self.listener, rustix::net::Shutdown::Both);
    }

    fn let_in_while_open(&self) {
        while !self.is_closed.load(Ordering::Acquire) {
            let served = match self.listener.accept() {
                Ok(_) if self.is_closed.load(Ordering::Acquire) => return,
                Ok((stream, peer)) => over_tcp(stream).and_then(|stream| {
                    let host = peer.ip().to_canonical();
                    self.hall.let_in(stream, host, SocketAddr::new(host, peer.port()).to_string())
                }),
                Err(error) => Err(error),
            };
            if let Err(error) = served {
                self.hall.tell(&error);
                // No file is left to open, most likely: that does not end by being tried at once.
                thread::sleep(LOOK_UP);
            }
        }
    }
}
