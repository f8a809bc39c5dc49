//! The simulated line behind a TCP port: RTU frames as they are, with their CRC, as serial servers pass them on.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::time::Duration;

use crate::server::{Ended, Worker, serve, wait_for};
use crate::simulator::Shared;

/// How long to wait when a connection cannot be taken.
const RETRY: Duration = Duration::from_millis(100);

/// A TCP port on 127.0.0.1 that is served until this is dropped: one client at a time, the next when it is gone.
#[derive(Debug)]
pub struct TcpServer {
    address: SocketAddr,
    _worker: Worker,
}

impl TcpServer {
    pub(crate) fn start(shared: Arc<Shared>) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let worker = Worker::start("drivebus-sim-tcp", move |stop| {
            loop {
                match wait_for(stop.as_fd(), listener.as_fd(), None) {
                    Ok((false, true)) => {}
                    Ok((false, false)) => continue,
                    Ok((true, _)) | Err(_) => return,
                }
                let Ok((client, _)) = listener.accept() else {
                    // The client may have given up; if the system is out of sockets, it may have some again later.
                    match wait_for(stop.as_fd(), stop.as_fd(), Some(RETRY)) {
                        Ok((false, _)) => continue,
                        _ => return,
                    }
                };
                if client.set_nodelay(true).is_err() || client.set_nonblocking(true).is_err() {
                    continue;
                }
                // A client that fails is gone like one that leaves.
                if serve(&shared, client.as_fd(), stop.as_fd()).is_ok_and(|ended| ended == Ended::Stopped) {
                    return;
                }
            }
        })?;
        Ok(Self { address, _worker: worker })
    }

    /// Where to connect.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}
