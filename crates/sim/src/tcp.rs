//! The simulated line behind a TCP port: RTU frames as they are, with their CRC, as serial servers pass them on.

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::os::fd::AsFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant as SystemInstant};

use crate::outlet::Outlet;
use crate::pacer::{Due, Next, Served, Serving};
use crate::port::Port;
use crate::shared::Shared;
use crate::watch::{Key, Watch};

/// How long to wait when a connection cannot be taken.
const RETRY: Duration = Duration::from_millis(100);

/// A TCP port on 127.0.0.1 that is served until this is dropped: one client at a time, the next when it is gone.
#[derive(Debug)]
pub struct TcpServer(Arc<Socket>);

impl TcpServer {
    pub(crate) fn start(shared: Arc<Shared>) -> io::Result<Self> {
        let (address, serving) = listen(&shared, (Ipv4Addr::LOCALHOST, 0).into())?;
        let socket = Arc::new(Socket { shared, address, serving: Mutex::new(Some(serving)) });
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
    serving: Mutex<Option<Serving>>,
}

impl Socket {
    fn lock(&self) -> MutexGuard<'_, Option<Serving>> {
        self.serving.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Outlet for Socket {
    /// The connection is closed, and new ones are refused.
    fn unplug(&self) {
        *self.lock() = None;
    }

    fn replug(&self) -> io::Result<()> {
        let mut serving = self.lock();
        if serving.is_none() {
            *serving = Some(listen(&self.shared, self.address)?.1);
        }
        Ok(())
    }
}

/// Takes connections at `address`.
fn listen(shared: &Arc<Shared>, address: SocketAddr) -> io::Result<(SocketAddr, Serving)> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let shared = Arc::clone(shared);
    let serving = Serving::start(move |watch, key| {
        watch.add(listener.as_fd(), key)?;
        Ok(Box::new(Door { shared, listener, state: State::Open }))
    })?;
    Ok((address, serving))
}

/// The port, and who has come in.
struct Door {
    shared: Arc<Shared>,
    listener: TcpListener,
    state: State,
}

enum State {
    /// Connections are waited for.
    Open,
    /// One could not be taken: they wait until it is worth trying again.
    Resting,
    /// One is served, the next wait.
    Taken(Port),
}

impl Door {
    /// Takes the next connection.
    fn accept(&mut self, watch: &Watch, key: Key) -> Next {
        watch.remove(self.listener.as_fd());
        let taken = self.listener.accept().and_then(|(client, _)| {
            client.set_nodelay(true)?;
            client.set_nonblocking(true)?;
            Port::new(Arc::clone(&self.shared), client.into(), None, watch, key)
        });
        match taken {
            Ok(port) => {
                self.state = State::Taken(port);
                Next::Readable
            }
            // The client may have given up; if the system is out of sockets, it may have some again later.
            Err(_) => self.rest(),
        }
    }

    fn rest(&mut self) -> Next {
        let until = SystemInstant::now() + RETRY;
        self.state = State::Resting;
        Next::At(Due { at: until, latest: until + RETRY })
    }

    /// Waits for connections again.
    fn open(&mut self, watch: &Watch, key: Key) -> Next {
        self.state = State::Open;
        match watch.add(self.listener.as_fd(), key) {
            Ok(()) => Next::Readable,
            Err(_) => self.rest(),
        }
    }
}

impl Served for Door {
    fn serve(&mut self, readable: bool, watch: &Watch, key: Key) -> Next {
        match &self.state {
            State::Open if readable => self.accept(watch, key),
            State::Open => Next::Readable,
            State::Resting => self.open(watch, key),
            State::Taken(port) => match port.serve(readable) {
                // A client that fails is gone like one that leaves.
                Next::Gone => {
                    port.leave(watch);
                    self.open(watch, key)
                }
                next => next,
            },
        }
    }

    fn leave(&mut self, watch: &Watch) {
        match &self.state {
            State::Open => watch.remove(self.listener.as_fd()),
            State::Resting => {}
            State::Taken(port) => port.leave(watch),
        }
    }
}
