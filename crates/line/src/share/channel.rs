//! One connection between two programs: whole messages in and out, none longer than it may be.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use drivebus_rtu::Instant;
use rustix::event::{PollFd, PollFlags};
use rustix::fd::AsFd;
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::system::clock::{monotonic, wait_for, wait_for_any};
use crate::system::inherited::Kept;
use crate::system::process::Life;
use crate::system::sockets::{Stream, Waits};

/// How long a program may leave unread what it is told, before it is cut off.
const UNREAD: Duration = Duration::from_secs(1);
/// Bytes before a message: its length.
const HEAD: usize = 4;

/// A connection.
#[derive(Debug)]
pub(crate) struct Channel {
    stream: Arc<Kept<Stream>>,
    /// The program at the other end: gone, it says nothing more, whoever has its descriptors.
    other: Arc<Life>,
    came: Vec<u8>,
    /// What is left of a message that was said in passing.
    unsent: Vec<u8>,
    /// How long a message of the other side may be.
    most: usize,
}

impl Channel {
    /// `most` is how long a message of the other side may be, whose program is `other`.
    pub(crate) fn new(stream: Stream, most: usize, other: Arc<Life>) -> io::Result<Self> {
        Self::with_patience(stream, most, other, UNREAD)
    }

    fn with_patience(mut stream: Stream, most: usize, other: Arc<Life>, patience: Duration) -> io::Result<Self> {
        stream.leaves_unread(patience)?;
        Ok(Self { stream: Arc::new(Kept::new(stream)), other, came: Vec::new(), unsent: Vec::new(), most })
    }

    /// Whose program is at the other end is known now.
    pub(crate) fn depends_on(&mut self, other: Arc<Life>) {
        self.other = other;
    }

    /// A message of the other side may be as long as that from now on.
    pub(crate) fn lets_say(&mut self, most: usize) {
        self.most = most;
    }

    pub(crate) fn say(&mut self, message: &impl Serialize) -> io::Result<()> {
        let body = postcard::to_extend(message, vec![0; HEAD]).map_err(io::Error::other)?;
        self.send(body)
    }

    /// Sends `bytes` as they are.
    pub(crate) fn say_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.send([&[0; HEAD], bytes].concat())
    }

    /// As [`say`](Self::say), and waits for nobody: where the other side does not read, the message is left out, and this
    /// is `false`.
    pub(crate) fn say_in_passing(&mut self, message: &impl Serialize) -> io::Result<bool> {
        if !self.finish(Waits::No)? {
            return Ok(false);
        }
        let body = postcard::to_extend(message, vec![0; HEAD]).map_err(io::Error::other)?;
        self.unsent = with_length(body)?;
        let whole = self.unsent.len();
        self.finish(Waits::No)?;
        // What has begun to go out follows with the next one.
        if self.unsent.len() == whole {
            self.unsent.clear();
            return Ok(false);
        }
        Ok(true)
    }

    fn send(&mut self, message: Vec<u8>) -> io::Result<()> {
        let message = with_length(message)?;
        self.unsent.extend_from_slice(&message);
        match self.finish(Waits::AWhile) {
            Ok(true) => Ok(()),
            Ok(false) => Err(io::ErrorKind::TimedOut.into()),
            Err(error) => Err(error),
        }
    }

    /// Sends what is left; `false` where the other side has no room for it.
    fn finish(&mut self, waits: Waits) -> io::Result<bool> {
        while !self.unsent.is_empty() {
            match self.stream.send(&self.unsent, waits) {
                Ok(count) => drop(self.unsent.drain(..count)),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(false),
                Err(error) => return Err(error),
            }
        }
        Ok(true)
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
            if !self.something_comes(until)? {
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

    /// Whether there is something to read before `until`. What a program said before it ended is still heard.
    fn something_comes(&self, until: Instant) -> io::Result<bool> {
        if let Some(turn) = self.stream.looks_up() {
            return self.something_comes_in_turns(until, turn);
        }
        let Some(end) = self.other.end() else {
            return Ok(wait_for(self.stream.as_fd(), PollFlags::IN, until)?.is_some());
        };
        let mut both = [PollFd::new(&**self.stream, PollFlags::IN), PollFd::from_borrowed_fd(end, PollFlags::IN)];
        match wait_for_any(&mut both, until)? {
            None => Ok(false),
            Some([said, _]) if !said.is_empty() => Ok(true),
            Some(_) => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }

    /// As [`something_comes`](Self::something_comes), on a connection of which the system may not tell that it was ended here.
    fn something_comes_in_turns(&self, until: Instant, turn: Duration) -> io::Result<bool> {
        loop {
            let now = monotonic();
            if wait_for(self.stream.as_fd(), PollFlags::IN, until.min(now + turn))?.is_some() {
                return Ok(true);
            }
            if self.stream.is_ended() {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            if now >= until {
                return Ok(false);
            }
        }
    }

    /// Whether a message has begun to come.
    pub(crate) fn has_begun(&self) -> bool {
        !self.came.is_empty()
    }

    /// Whether the other side is still there.
    pub(crate) fn is_there(&self) -> bool {
        self.stream.is_there() && !self.other.is_gone()
    }

    /// The same connection, for who only says something there; who has this one says nothing any more.
    pub(crate) fn voice(&self) -> Self {
        let (stream, other) = (Arc::clone(&self.stream), Arc::clone(&self.other));
        Self { stream, other, came: Vec::new(), unsent: Vec::new(), most: self.most }
    }

    /// The same connection, to end it from elsewhere.
    pub(crate) fn end(&self) -> Arc<Kept<Stream>> {
        Arc::clone(&self.stream)
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

/// `message`, which has room for it, with its length before it.
fn with_length(mut message: Vec<u8>) -> io::Result<Vec<u8>> {
    let length = u32::try_from(message.len() - HEAD).map_err(io::Error::other)?;
    message[..HEAD].copy_from_slice(&length.to_le_bytes());
    Ok(message)
}
#[cfg(test)]
mod tests {
    use super::*;

    use crate::system::sockets::{Loopback, Shutdown};

    /// The two ends of a connection, of each kind that there is.
    fn pairs() -> impl Iterator<Item = (Stream, Stream)> {
        let over_loopback = Loopback::pair().unwrap();
        [Stream::pair().unwrap(), (Stream::Tcp(over_loopback.0), Stream::Tcp(over_loopback.1))].into_iter()
    }

    fn channel(stream: Stream, most: usize) -> Channel {
        Channel::new(stream, most, Arc::new(Life::Unknown)).unwrap()
    }

    fn write(far: &Stream, bytes: &[u8]) {
        assert_eq!(far.send(bytes, Waits::AWhile).unwrap(), bytes.len());
    }

    /// What has been written is on its way, and comes.
    fn soon() -> Instant {
        monotonic() + Duration::from_secs(60)
    }

    #[test]
    fn messages_come_whole_however_they_are_cut() {
        for (one, far) in pairs() {
            let mut channel = channel(one, 100);
            let words: Vec<u16> = vec![1, 2, 300];
            let mut bytes = postcard::to_extend(&words, vec![0; HEAD]).unwrap();
            let length = u8::try_from(bytes.len() - HEAD).unwrap();
            bytes[0] = length;
            let twice = [bytes.clone(), bytes].concat();
            let (last, most) = twice.split_last().unwrap();
            write(&far, most);
            assert_eq!(channel.hear::<Vec<u16>>(soon()).unwrap(), Some(words.clone()));
            assert_eq!(channel.hear::<Vec<u16>>(monotonic()).unwrap(), None);
            assert!(channel.has_begun());
            write(&far, &[*last]);
            assert_eq!(channel.hear::<Vec<u16>>(soon()).unwrap(), Some(words));
            assert!(!channel.has_begun() && channel.is_there());
            drop(far);
            assert_eq!(channel.hear::<u8>(soon()).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
            assert!(!channel.is_there());
        }
    }

    #[test]
    fn what_is_too_long_is_refused_before_it_comes() {
        for (one, far) in pairs() {
            let mut channel = channel(one, 1_000);
            channel.lets_say(100);
            write(&far, &101_u32.to_le_bytes());
            let error = channel.hear::<u8>(soon()).unwrap_err().to_string();
            assert_eq!(error, "a message of 101 bytes is announced; 100 may be sent");
        }
    }

    #[test]
    fn what_is_no_message_is_refused() {
        for (one, far) in pairs() {
            let mut channel = channel(one, 100);
            write(&far, &[2, 0, 0, 0, 0xFF, 0xFF]);
            assert_eq!(channel.hear::<u32>(soon()).unwrap_err().kind(), io::ErrorKind::InvalidData);
        }
    }

    #[test]
    fn who_reads_nothing_is_cut_off() {
        for (one, _far) in pairs() {
            let quick = Duration::from_millis(1);
            let mut channel = Channel::with_patience(one, 100, Arc::new(Life::Unknown), quick).unwrap();
            let said = (0..1_000_000).map(|_| channel.say_bytes(&[0; 100])).find(Result::is_err);
            assert!(said.is_some());
        }
    }

    #[test]
    fn what_is_said_in_passing_waits_for_nobody_and_is_whole_or_left_out() {
        for (one, far) in pairs() {
            let mut channel = channel(one, 100);
            let mut said = Vec::new();
            // Longer and longer, so that some end where there is no room any more.
            let left_out = (1..u16::MAX).find(|&count| {
                let is_said = channel.say_in_passing(&vec![count; usize::from(count)]).unwrap();
                said.extend(is_said.then_some(count));
                !is_said
            });
            assert!(left_out.is_some());
            let mut far = self::channel(far, 1 << 20);
            let heard = said.iter().map(|_| {
                loop {
                    // What had begun to go out goes on as soon as there is room.
                    channel.finish(Waits::No).unwrap();
                    if let Some(message) = far.hear::<Vec<u16>>(monotonic()).unwrap() {
                        break message;
                    }
                }
            });
            assert!(heard.zip(&said).all(|(message, &count)| message == vec![count; usize::from(count)]));
        }
    }

    #[test]
    fn what_is_ended_here_is_not_waited_for() {
        for how in [Shutdown::Read, Shutdown::Both] {
            for (one, _far) in pairs() {
                let mut channel = channel(one, 100);
                let end = channel.end();
                let ends = std::thread::spawn(move || end.shutdown(how).unwrap());
                assert_eq!(channel.hear::<u8>(soon()).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
                ends.join().unwrap();
            }
        }
    }

    #[cfg(unix)]
    #[test]
    fn who_has_ended_is_gone_whoever_has_its_descriptors() {
        let mut child = std::process::Command::new("cat").stdin(std::process::Stdio::piped()).spawn().unwrap();
        let (one, held) = Stream::pair().unwrap();
        let mut channel = Channel::new(one, 100, Arc::new(Life::of(child.id()))).unwrap();
        write(&held, &[1, 0, 0, 0, 7]);
        drop(child.stdin.take());
        child.wait().unwrap();
        assert_eq!(channel.hear::<u8>(soon()).unwrap(), Some(7), "what it said before");
        if cfg!(target_os = "linux") {
            assert_eq!(channel.hear::<u8>(soon()).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
            assert!(!channel.is_there());
        }
    }
}
