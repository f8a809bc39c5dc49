//! One connection between two programs: whole messages in and out, none longer than it may be.

use std::io::{self, Read};
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::time::Duration;

use drivebus_rtu::Instant;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use rustix::net::SendFlags;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::system::clock::wait_for;

/// How long a program may leave unread what it is told, before it is cut off.
const UNREAD: Duration = Duration::from_secs(1);
/// Bytes before a message: its length.
const HEAD: usize = 4;

/// A connection.
#[derive(Debug)]
pub(crate) struct Channel {
    stream: UnixStream,
    came: Vec<u8>,
    /// How long a message of the other side may be.
    most: usize,
}

impl Channel {
    /// `most` is how long a message of the other side may be.
    pub(crate) fn new(stream: UnixStream, most: usize) -> io::Result<Self> {
        stream.set_nonblocking(false)?;
        stream.set_write_timeout(Some(UNREAD))?;
        Ok(Self { stream, came: Vec::new(), most })
    }

    pub(crate) fn say(&mut self, message: &impl Serialize) -> io::Result<()> {
        let body = postcard::to_extend(message, vec![0; HEAD]).map_err(io::Error::other)?;
        self.send(body)
    }

    /// Sends `bytes` as they are.
    pub(crate) fn say_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.send([&[0; HEAD], bytes].concat())
    }

    fn send(&mut self, mut message: Vec<u8>) -> io::Result<()> {
        let length = u32::try_from(message.len() - HEAD).map_err(io::Error::other)?;
        message[..HEAD].copy_from_slice(&length.to_le_bytes());
        let mut rest = &message[..];
        while !rest.is_empty() {
            // Where the other side is gone that is an error, and no signal that ends the program.
            match rustix::net::send(&self.stream, rest, SendFlags::NOSIGNAL) {
                Ok(count) => rest = &rest[count..],
                Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// The next message, `None` if none was whole by `until`.
    ///
    /// # Errors
    ///
    /// The other side is gone, or says what cannot be a message.
    pub(crate) fn hear<T: DeserializeOwned>(&mut self, until: Instant) -> io::Result<Option<T>> {
        let Some(bytes) = self.hear_bytes(until)? else { return Ok(None) };
        postcard::from_bytes(&bytes).map(Some).map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error))
    }

    /// As [`hear`](Self::hear), the bytes as they are.
    pub(crate) fn hear_bytes(&mut self, until: Instant) -> io::Result<Option<Vec<u8>>> {
        loop {
            if let Some(message) = self.whole()? {
                return Ok(Some(message));
            }
            if wait_for(self.stream.as_fd(), PollFlags::IN, until)?.is_none() {
                return Ok(None);
            }
            let mut piece = [0; 4_096];
            match self.stream.read(&mut piece) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(count) => self.came.extend_from_slice(&piece[..count]),
                Err(error) if matches!(error.kind(), io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock) => {}
                Err(error) => return Err(error),
            }
        }
    }

    /// Whether a message has begun to come.
    pub(crate) fn has_begun(&self) -> bool {
        !self.came.is_empty()
    }

    /// Whether the other side is still there.
    pub(crate) fn is_there(&self) -> bool {
        let mut descriptors = [PollFd::new(&self.stream, PollFlags::RDHUP)];
        let now = Timespec { tv_sec: 0, tv_nsec: 0 };
        !matches!(poll(&mut descriptors, Some(&now)), Ok(1..))
    }

    /// The same connection, to end it from elsewhere.
    pub(crate) fn end(&self) -> io::Result<UnixStream> {
        self.stream.try_clone()
    }

    fn whole(&mut self) -> io::Result<Option<Vec<u8>>> {
        let Some(&length) = self.came.first_chunk::<HEAD>() else { return Ok(None) };
        let length = usize::try_from(u32::from_le_bytes(length)).unwrap_or(usize::MAX);
        if length > self.most {
            let why = format!("a message of {length} bytes is announced; {} may be sent", self.most);
            return Err(io::Error::new(io::ErrorKind::InvalidData, why));
        }
        if self.came.len() < HEAD + length {
            return Ok(None);
        }
        let rest = self.came.split_off(HEAD + length);
        let mut message = std::mem::replace(&mut self.came, rest);
        message.drain(..HEAD);
        Ok(Some(message))
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    use crate::system::clock::monotonic;

    fn pair() -> (Channel, UnixStream) {
        let (one, other) = UnixStream::pair().unwrap();
        (Channel::new(one, 100).unwrap(), other)
    }

    #[test]
    fn messages_come_whole_however_they_are_cut() {
        let (mut channel, mut far) = pair();
        let words: Vec<u16> = vec![1, 2, 300];
        let mut bytes = postcard::to_extend(&words, vec![0; HEAD]).unwrap();
        let length = u8::try_from(bytes.len() - HEAD).unwrap();
        bytes[0] = length;
        let twice = [bytes.clone(), bytes].concat();
        let (last, most) = twice.split_last().unwrap();
        far.write_all(most).unwrap();
        let now = monotonic();
        assert_eq!(channel.hear::<Vec<u16>>(now).unwrap(), Some(words.clone()));
        assert_eq!(channel.hear::<Vec<u16>>(now).unwrap(), None);
        assert!(channel.has_begun());
        far.write_all(&[*last]).unwrap();
        assert_eq!(channel.hear::<Vec<u16>>(now).unwrap(), Some(words));
        assert!(!channel.has_begun() && channel.is_there());
        drop(far);
        assert!(!channel.is_there());
        assert_eq!(channel.hear::<u8>(now).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn what_is_too_long_is_refused_before_it_comes() {
        let (mut channel, mut far) = pair();
        far.write_all(&101_u32.to_le_bytes()).unwrap();
        let error = channel.hear::<u8>(monotonic()).unwrap_err().to_string();
        assert_eq!(error, "a message of 101 bytes is announced; 100 may be sent");
    }

    #[test]
    fn what_is_no_message_is_refused() {
        let (mut channel, mut far) = pair();
        far.write_all(&[2, 0, 0, 0, 0xFF, 0xFF]).unwrap();
        assert_eq!(channel.hear::<u32>(monotonic()).unwrap_err().kind(), io::ErrorKind::InvalidData);
    }

    #[test]
    fn who_reads_nothing_is_cut_off() {
        let (mut channel, _far) = pair();
        channel.stream.set_write_timeout(Some(Duration::from_millis(1))).unwrap();
        let said = (0..10_000).map(|_| channel.say_bytes(&[0; 100])).find(Result::is_err);
        assert!(said.is_some());
    }
}
