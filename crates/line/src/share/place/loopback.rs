//! The file of a port that is served on the loopback: at which TCP port its program listens, and the secret by which it and
//! its guests know each other.
//!
//! It is one line of text, made anew by each program that has the port: [`FORM`], the TCP port, and the secret as two digits a
//! byte. It is removed when that program gives the port up. If it was killed, the file is left, and with it an address at which
//! nobody listens, or somebody else. So the program keeps a second file open, which is named after the TCP port: where nobody
//! has that open, nobody is asked.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::thread;
use std::time::Duration;

use drivebus_rtu::Instant;

use super::files::is_kept;
use super::{Door, Entrance, Nobody, Place, Reached, ReachedBy, STEP, Sign};
use crate::share::secret::Secret;
use crate::system::clock::monotonic;
use crate::system::inherited::Kept;
use crate::system::sockets::{Listener, Loopback, Stream};

/// How the file begins, of this form.
const FORM: &str = "drivebus loopback 1";
/// No file is longer.
const MOST: u64 = 128;
/// What its name ends in while it is written.
const DRAFT: &str = "tcp-draft";
/// What the name of the file ends in that is kept open.
const KEPT: &str = "kept";
/// How long a connection within this machine may take. Where nobody listens, Windows goes on trying for longer.
const CONNECTS: Duration = Duration::from_secs(1);

impl Place {
    /// Puts the file there. Whatever stands there is of a program that has the port no more.
    pub(super) fn put_secret(&self) -> io::Result<Door> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        listener.set_nonblocking(true)?;
        let port = listener.local_addr()?.port();
        let secret = Secret::random()?;
        self.tidy_up()?;
        let ending = format!("{port}.{KEPT}");
        let (beside, kept) = (self.path(&ending), self.kept_file(&ending)?);
        let (path, draft) = (self.path(self.ending()), self.path(DRAFT));
        let mut file = self.new_file(DRAFT)?;
        file.write_all(format!("{FORM} {port} {}\n", secret.written()).as_bytes())?;
        drop(file);
        fs::rename(&draft, &path)?;
        let listener = Kept::new(Listener::Tcp(listener));
        let entrance = Entrance { listener, reached_by: ReachedBy::Strangers(secret.clone()) };
        Ok(Door::new(std::iter::once(entrance), Sign::Secret { path, secret, beside, _kept: kept }))
    }

    /// Removes what programs have left that are gone.
    fn tidy_up(&self) -> io::Result<()> {
        let mut left = vec![self.path(DRAFT)];
        for entry in fs::read_dir(&self.folder)? {
            let path = entry?.path();
            let name = path.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_prefix(&self.name));
            let is_one =
                name.is_some_and(|rest| rest.starts_with('.')) && path.extension().is_some_and(|end| end == KEPT);
            left.extend((is_one && !is_kept(&path)).then_some(path));
        }
        for path in left {
            match fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(error),
                _ => {}
            }
        }
        Ok(())
    }

    /// Connects to the program that serves the port; by `until` where many knock.
    pub(super) fn knock_on_loopback(&self, until: Instant) -> Result<Reached, Nobody> {
        let path = self.path(self.ending());
        loop {
            let Some((port, secret)) = read(&path) else {
                return Err(if path.exists() { Nobody::Gone } else { Nobody::Absent });
            };
            // Whoever listens there now, is not the program that wrote it.
            if !is_kept(&self.path(&format!("{port}.{KEPT}"))) {
                return Err(Nobody::Gone);
            }
            match connect(port) {
                Err(Nobody::Crowded) if monotonic() < until => thread::sleep(STEP),
                found => return found.map(|stream| Reached { stream, secret: Some(secret) }),
            }
        }
    }
}

fn connect(port: u16) -> Result<Stream, Nobody> {
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
    let stream = TcpStream::connect_timeout(&address, CONNECTS).map_err(|error| match error.kind() {
        ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset | ErrorKind::ConnectionAborted => Nobody::Gone,
        ErrorKind::TimedOut if cfg!(windows) => Nobody::Gone,
        // So many knock that the system keeps no more of them, or this program has too many files open.
        _ => Nobody::Crowded,
    })?;
    // Where nobody listens, a system may give it the address to which it goes: then it leads back to this program.
    if stream.local_addr().is_ok_and(|own| own == address) {
        return Err(Nobody::Gone);
    }
    Loopback::new(stream).map(Stream::Tcp).map_err(|_| Nobody::Gone)
}

/// The TCP port and the secret in the file at `path`; `None` where there is no such file, or none of this form.
pub(super) fn read(path: &Path) -> Option<(u16, Secret)> {
    let mut text = String::new();
    File::open(path).ok()?.take(MOST).read_to_string(&mut text).ok()?;
    let mut words = text.strip_prefix(FORM)?.split_ascii_whitespace();
    let (port, secret) = (words.next()?.parse().ok()?, Secret::read(words.next()?)?);
    words.next().is_none().then_some((port, secret))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder that goes with it.
    struct Room(std::path::PathBuf);

    impl Room {
        fn new(name: &str) -> Self {
            let folder = std::env::temp_dir().join(format!("drivebus-loopback-{name}-{}", std::process::id()));
            fs::create_dir_all(&folder).unwrap();
            Self(folder)
        }

        fn place(&self) -> Place {
            Place::on_loopback(self.0.clone(), "port-1")
        }

        fn files(&self) -> Vec<String> {
            let files = fs::read_dir(&self.0).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
            let mut files: Vec<_> = files.collect();
            files.sort();
            files
        }
    }

    impl Drop for Room {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn soon() -> Instant {
        monotonic() + Duration::from_secs(60)
    }

    #[test]
    fn the_file_is_this_users_alone_and_goes_with_the_door() {
        let room = Room::new("file");
        let place = room.place();
        fs::write(place.path(DRAFT), "of a program that was killed meanwhile").unwrap();
        let door = place.open_door().unwrap();
        assert!(place.has(&door));
        let (port, secret) = read(&place.path("tcp")).unwrap();
        assert_eq!(room.files(), [format!("port-1.{port}.kept"), "port-1.tcp".to_owned()]);
        #[cfg(unix)]
        for file in room.files() {
            use std::os::unix::fs::PermissionsExt;
            assert_eq!(fs::metadata(room.0.join(file)).unwrap().permissions().mode() & 0o777, 0o600);
        }
        let reached = place.knock(soon()).unwrap();
        assert_eq!(reached.secret.as_ref(), Some(&secret));
        assert_eq!(door.entrances[0].reached_by, ReachedBy::Strangers(secret));
        drop(door);
        assert!(room.files().is_empty());
    }

    #[test]
    fn each_door_has_a_secret_of_its_own_and_takes_away_its_own_file() {
        let room = Room::new("anew");
        let place = room.place();
        let first = place.open_door().unwrap();
        let (_, of_first) = read(&place.path("tcp")).unwrap();
        let second = place.open_door().unwrap();
        let (_, of_second) = read(&place.path("tcp")).unwrap();
        assert_ne!(of_first, of_second);
        assert!(!place.has(&first) && place.has(&second));
        drop(first);
        assert!(place.has(&second));
    }

    #[test]
    fn a_file_that_was_left_behind_leads_to_nobody() {
        let room = Room::new("left");
        let place = room.place();
        assert!(matches!(place.knock(soon()), Err(Nobody::Absent)));
        let door = place.open_door().unwrap();
        let left = fs::read(place.path("tcp")).unwrap();
        drop(door);
        // Somebody listens there all the same, and there is a file that nobody has open.
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let there = listener.local_addr().unwrap().port();
        fs::write(place.path(&format!("{there}.{KEPT}")), "").unwrap();
        let there = format!("{FORM} {there} {}", "00".repeat(32));
        let shorter = &left[..left.len() - 2];
        for file in [there.as_bytes(), &left, shorter, b"", b"drivebus loopback 2 1 00", b"\xFF\xFE", &left.repeat(2)] {
            fs::write(place.path("tcp"), file).unwrap();
            assert!(matches!(place.knock(soon()), Err(Nobody::Gone)));
        }
        let door = place.open_door().unwrap();
        assert!(place.has(&door) && place.knock(soon()).is_ok());
        assert_eq!(room.files().len(), 2, "what was left is gone");
    }

    #[test]
    fn one_program_at_a_time_has_the_turn() {
        let room = Room::new("turn");
        let place = room.place();
        let turn = place.turn().unwrap();
        assert!(turn.is_some() && !place.lock().unwrap().unwrap().is_taken());
        drop(turn);
        assert!(place.lock().unwrap().unwrap().is_taken());
    }
}
