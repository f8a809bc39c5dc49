//! The thread at the door: it lets in who knocks, and stands back while the system has nothing left to let anybody in with.

use std::io;
use std::time::Duration;

use crate::share::place::{Entrance, ReachedBy};
use crate::system::sockets::{Came, Stream, wait_for_a_knock};
use crate::system::sync::thread;

/// How long nobody is let in where the system has no more files or threads for that: the first time, and in the end.
const SHORTEST: Duration = Duration::from_millis(10);
const LONGEST: Duration = Duration::from_secs(1);

/// Lets in who knocks at `entrances`, by `let_in`, until the other end of `woken` is gone. `says` is told what the system
/// refused, and `None` when it gives again.
///
/// Whoever knocks goes on knocking until it is let in. So where that cannot be, nobody is listened to for a while.
pub(super) fn stand(
    entrances: &[Entrance],
    woken: &Stream,
    says: impl Fn(Option<&io::Error>),
    mut let_in: impl FnMut(Stream, ReachedBy) -> io::Result<()>,
) {
    let mut pause = Pause::default();
    loop {
        let listened = if pause.is_none() { entrances } else { &[] };
        let doors = listened.iter().map(|entrance| &*entrance.listener);
        let refused = match wait_for_a_knock(doors, woken, pause.timeout()) {
            Ok(Came::End) => return,
            Ok(Came::Knock) => accept(entrances, &mut let_in).err(),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => {
                thread::sleep(LONGEST);
                Some(error)
            }
        };
        says(refused.as_ref());
        pause.after(refused.is_some());
    }
}

/// Lets in one at each entrance; the error is the system's that has nothing left for it.
fn accept(entrances: &[Entrance], let_in: &mut impl FnMut(Stream, ReachedBy) -> io::Result<()>) -> io::Result<()> {
    for Entrance { listener, reached_by } in entrances {
        match listener.accept() {
            Ok(stream) => let_in(stream, reached_by.clone())?,
            Err(error) => match error.kind() {
                // Nobody knocks here, or who did has gone.
                io::ErrorKind::WouldBlock | io::ErrorKind::ConnectionAborted | io::ErrorKind::Interrupted => {}
                _ => return Err(error),
            },
        }
    }
    Ok(())
}

/// How long nobody is let in: longer each time in a row that it cannot be.
#[derive(Debug, Default)]
struct Pause(Duration);

impl Pause {
    fn is_none(&self) -> bool {
        self.0.is_zero()
    }

    /// For how long only the end is waited for; `None` while there is no pause.
    fn timeout(&self) -> Option<Duration> {
        (!self.is_none()).then_some(self.0)
    }

    fn after(&mut self, refused: bool) {
        self.0 = if refused { (2 * self.0).clamp(SHORTEST, LONGEST) } else { Duration::ZERO };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_hour_without_descriptors_is_an_hour_of_few_tries() {
        let (mut pause, mut waited, mut tries) = (Pause::default(), Duration::ZERO, 0);
        while waited < Duration::from_secs(3_600) {
            pause.after(true);
            waited += pause.0;
            tries += 1;
        }
        assert!(tries < 3_610, "{tries} tries");
        pause.after(false);
        assert!(pause.is_none() && pause.timeout().is_none(), "then somebody who knocks is heard at once");
        pause.after(true);
        assert_eq!(pause.0, SHORTEST, "and the next time begins anew");
    }
}
