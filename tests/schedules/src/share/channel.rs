// One connection between two programs: what is said comes whole.

use std::io;
use std::sync::Arc;

use drivebus_rtu::Instant;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::system::clock::monotonic;
use crate::system::inherited::Kept;
use crate::system::process::Life;
use crate::system::sockets::Stream;
use crate::system::sync::thread;

#[derive(Debug)]
pub(crate) struct Channel(Arc<Kept<Stream>>);

impl Channel {
    pub(crate) fn new(stream: Stream, _most: usize, _other: Arc<Life>) -> io::Result<Self> {
        Ok(Self(Arc::new(Kept::new(stream))))
    }

    pub(crate) fn depends_on(&mut self, _other: Arc<Life>) {}

    pub(crate) fn lets_say(&mut self, _most: usize) {}

    pub(crate) fn say(&mut self, message: &impl Serialize) -> io::Result<()> {
        self.say_bytes(&postcard::to_stdvec(message).map_err(io::Error::other)?)
    }

    pub(crate) fn say_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.0.send(bytes.to_vec())
    }

    pub(crate) fn say_in_passing(&mut self, message: &impl Serialize) -> io::Result<bool> {
        self.say(message).map(|()| true)
    }

    pub(crate) fn hear<T: DeserializeOwned>(&mut self, until: Instant) -> io::Result<Option<T>> {
        let Some(bytes) = self.hear_bytes(until)? else { return Ok(None) };
        postcard::from_bytes(&bytes).map(Some).map_err(io::Error::other)
    }

    /// As long as it takes, unless the time is over by now.
    pub(crate) fn hear_bytes(&mut self, until: Instant) -> io::Result<Option<Vec<u8>>> {
        while until > monotonic() && !self.0.is_ready_or_calls() {
            thread::park();
        }
        self.0.receive()
    }

    /// What comes here comes whole.
    pub(crate) fn has_begun(&self) -> bool {
        false
    }

    pub(crate) fn is_there(&self) -> bool {
        self.0.is_open()
    }

    pub(crate) fn voice(&self) -> Self {
        Self(Arc::clone(&self.0))
    }

    pub(crate) fn end(&self) -> Arc<Kept<Stream>> {
        Arc::clone(&self.0)
    }
}
