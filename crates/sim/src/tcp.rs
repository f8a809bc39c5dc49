//! The simulated line behind a TCP port: RTU frames as they are, with their CRC, as serial servers pass them on.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::fd::AsFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::outlet::Outlet;
use crate::server::{Ended, Worker, serve, wait_for};
use crate::simulator::Shared;

/// How long to wait when a connection cannot be taken.
const RETRY: Duration = Duration::from_millis(100);

/// A TCP port on 127.0.0.1 that is served until this is dropped: one client at a time, the next when it is gone.
#[derive(Debug)]
pub struct TcpServer(Arc<Socket>);

impl TcpServer {
    pub(crate) fn start(shared: Arc<Shared>) -> io::Result<Self> {
        let (address, worker) = listen(&shared, (Ipv4Addr::LOCALHOST, 0).into())?;
        let socket = Arc::new(Socket { shared, address, worker: Mutex::new(Some(worker)) });
        socket.shared.outlets.add(&socket);
        Ok(Self(socket))
    }

    /// Where to connect.
    pub fn address(&self) -> SocketAddr {
        self.0.address
    }
}

#[derive(Debug)]
struct Socket {
    shared: Arc<Shared>,
    address: SocketAddr,
    /// `None` while it is unplugged.
    worker: Mutex<Option<Worker>>,
}

impl Socket {
    fn lock(&self) -> MutexGuard<'_, Option<Worker>> {
        self.worker.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Outlet for Socket {
    /// The connection is closed, and new ones are refused.
    fn unplug(&self) {
        *self.lock() = None;
    }

    fn replug(&self) -> io::Result<()> {
        let mut worker = self.lock();
        if worker.is_none() {
            *worker = Some(listen(&self.shared, self.address)?.1);
        }
        Ok(())
    }
}

/// Takes connections at `address` in a thread of its own.
fn listen(shared: &Arc<Shared>, address: SocketAddr) -> io::Result<(SocketAddr, Worker)> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let shared = Arc::clone(shared);
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
    Ok((address, worker))
}
