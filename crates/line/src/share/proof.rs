//! How a program that knocks on the loopback and one that listens there show each other that they know one secret.
//!
//! | who | what it says |
//! | --- | --- |
//! | guest | [`OPENING`], its nonce |
//! | owner | its nonce, its process (4 bytes), its clock (8 bytes), the code of [`OWNER`], both nonces and these |
//! | guest | its process, the code of [`GUEST`], both nonces and that |
//!
//! A nonce is 32 random bytes, made for this one connection, so that no code that was heard once is good for another. The owner
//! shows it first: whoever took its address when it was gone hears a nonce, and nothing by which a guest is known. The two
//! labels differ, so that neither side can be told what it said itself. Numbers have their lowest byte first.

use std::io;

use drivebus_rtu::Instant;

use crate::share::channel::Channel;
use crate::share::secret::{LENGTH, Secret, random};
use crate::system::clock::monotonic;

/// What a guest says first, before its nonce.
const OPENING: &[u8] = b"drivebus proof 1";
/// Whose code it is.
const OWNER: &[u8] = b"drivebus owner 1";
const GUEST: &[u8] = b"drivebus guest 1";
/// Bytes of a process, and of what an owner says of itself.
const PROCESS: usize = 4;
const OF_OWNER: usize = PROCESS + 8;
/// No message of a proof is longer.
pub(crate) const MOST: usize = LENGTH + OF_OWNER + LENGTH;

/// An owner that knows the secret.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Owner {
    pub(crate) process: u32,
    /// By how many nanoseconds this program's clock is ahead of the owner's.
    pub(crate) ahead: i64,
}

/// Why somebody is not known to be an owner.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Unproven {
    /// The connection has ended.
    Gone,
    /// It said nothing in time.
    Silent,
    /// It does not know the secret.
    Stranger,
}

/// Has who listens show by `until` that it knows `secret`, and then shows the same.
pub(crate) fn of_owner(channel: &mut Channel, secret: &Secret, until: Instant) -> Result<Owner, Unproven> {
    let gone = |_: io::Error| Unproven::Gone;
    let own = random().map_err(gone)?;
    let asked = monotonic();
    channel.say_bytes(&[OPENING, &own].concat()).map_err(gone)?;
    let said = channel.hear_bytes(until).map_err(|error| match error.kind() {
        io::ErrorKind::InvalidData => Unproven::Stranger,
        _ => Unproven::Gone,
    })?;
    let said = said.ok_or(Unproven::Silent)?;
    let heard = monotonic();
    let (theirs, rest) = said.split_first_chunk::<LENGTH>().ok_or(Unproven::Stranger)?;
    let (about, code) = rest.split_first_chunk::<OF_OWNER>().ok_or(Unproven::Stranger)?;
    if !secret.is_code(code, &[OWNER, &own, theirs, about]) {
        return Err(Unproven::Stranger);
    }
    let process = std::process::id().to_le_bytes();
    let code = secret.code(&[GUEST, &own, theirs, &process]);
    channel.say_bytes(&[&process[..], &code].concat()).map_err(gone)?;
    let ([process @ .., _, _, _, _, _, _, _, _], [_, _, _, _, clock @ ..]) = (about, about);
    let there = Instant::from_nanos(u64::from_le_bytes(*clock));
    Ok(Owner { process: u32::from_le_bytes(*process), ahead: ahead(asked, there, heard) })
}

/// Shows who knocks that this program knows `secret`, and has it show the same by `until`. The number of its process; `None`
/// where it does not.
pub(crate) fn of_guest(channel: &mut Channel, secret: &Secret, until: Instant) -> Option<u32> {
    let said = channel.hear_bytes(until).ok()??;
    let theirs: &[u8; LENGTH] = said.strip_prefix(OPENING)?.try_into().ok()?;
    let own = random().ok()?;
    let about = [&std::process::id().to_le_bytes()[..], &monotonic().as_nanos().to_le_bytes()].concat();
    let code = secret.code(&[OWNER, theirs, &own, &about]);
    channel.say_bytes(&[&own[..], &about, &code].concat()).ok()?;
    let said = channel.hear_bytes(until).ok()??;
    let (process, code) = said.split_first_chunk::<PROCESS>()?;
    secret.is_code(code, &[GUEST, theirs, &own, process]).then(|| u32::from_le_bytes(*process))
}

/// By how much the clock here is ahead of one that showed `there` at a moment between `asked` and `heard`. Where it is one
/// clock, as on systems that have one for all processes, by nothing.
fn ahead(asked: Instant, there: Instant, heard: Instant) -> i64 {
    if (asked..=heard).contains(&there) {
        return 0;
    }
    let middle = asked.as_nanos().midpoint(heard.as_nanos());
    middle.wrapping_sub(there.as_nanos()).cast_signed()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::thread;
    use std::time::Duration;

    use super::*;
    use crate::system::process::Life;
    use crate::system::sockets::{Loopback, Stream};

    fn pair() -> (Channel, Channel) {
        let (one, other) = Loopback::pair().unwrap();
        let channel = |end| Channel::new(Stream::Tcp(end), MOST, Arc::new(Life::Unknown)).unwrap();
        (channel(one), channel(other))
    }

    /// Longer than anything here takes.
    fn in_time() -> Instant {
        monotonic() + Duration::from_secs(60)
    }

    fn secret(byte: u8) -> Secret {
        Secret::of([byte; LENGTH])
    }

    /// What an owner and a guest think of each other that know these secrets, and what went between them.
    fn meet(owner: &Secret, guest: &Secret) -> (Option<u32>, Result<Owner, Unproven>, Vec<Vec<u8>>) {
        let ((mut at_owner, mut owner_end), (mut at_guest, mut guest_end)) = (pair(), pair());
        thread::scope(|scope| {
            // Each drops its end of the connection when it has made up its mind.
            let owner = scope.spawn(move || of_guest(&mut owner_end, owner, in_time()));
            let guest = scope.spawn(move || of_owner(&mut guest_end, guest, in_time()));
            let mut said = Vec::new();
            let mut carry = |from: &mut Channel, to: &mut Channel| {
                let message = from.hear_bytes(in_time()).ok().flatten()?;
                said.push(message.clone());
                to.say_bytes(&message).ok()
            };
            let carried = carry(&mut at_guest, &mut at_owner)
                .and_then(|()| carry(&mut at_owner, &mut at_guest))
                .and_then(|()| carry(&mut at_guest, &mut at_owner));
            if carried.is_none() {
                drop((at_owner, at_guest));
            }
            (owner.join().unwrap(), guest.join().unwrap(), said)
        })
    }

    #[test]
    fn who_knows_the_secret_is_known_and_says_which_process_it_is() {
        let own = std::process::id();
        let (guest, owner, said) = meet(&secret(7), &secret(7));
        assert_eq!(guest, Some(own));
        assert_eq!(owner, Ok(Owner { process: own, ahead: 0 }), "one process has one clock");
        let [opening, of_owner, of_guest] = &said[..] else { panic!("{said:?}") };
        let nonce = opening.strip_prefix(b"drivebus proof 1").unwrap();
        assert_eq!((nonce.len(), of_owner.len(), of_guest.len()), (32, 76, 36));
        let (theirs, about) = (&of_owner[..32], &of_owner[32..44]);
        assert_eq!(about[..4], own.to_le_bytes());
        assert_eq!(of_owner[44..], secret(7).code(&[b"drivebus owner 1", nonce, theirs, about])[..]);
        assert_eq!(of_guest[..4], own.to_le_bytes());
        assert_eq!(of_guest[4..], secret(7).code(&[b"drivebus guest 1", nonce, theirs, &of_guest[..4]])[..]);
    }

    #[test]
    fn a_guest_shows_nothing_to_who_does_not_know_the_secret() {
        let (guest, owner, said) = meet(&secret(8), &secret(7));
        assert_eq!((guest, owner), (None, Err(Unproven::Stranger)));
        assert_eq!(said.len(), 2, "a nonce, and what the stranger says");
    }

    #[test]
    fn what_was_said_before_shows_nothing_again() {
        let (_, _, said) = meet(&secret(7), &secret(7));
        let (mut stranger, mut owner) = pair();
        stranger.say_bytes(&said[0]).unwrap();
        stranger.say_bytes(&said[2]).unwrap();
        assert_eq!(of_guest(&mut owner, &secret(7), in_time()), None);
        let (mut stranger, mut guest) = pair();
        stranger.say_bytes(&said[1]).unwrap();
        assert_eq!(of_owner(&mut guest, &secret(7), in_time()), Err(Unproven::Stranger));
    }

    #[test]
    fn what_one_side_says_is_no_proof_of_the_other() {
        let (mut stranger, mut owner) = pair();
        thread::scope(|scope| {
            let proof = scope.spawn(move || of_guest(&mut owner, &secret(7), in_time()));
            stranger.say_bytes(&[OPENING, &[1; LENGTH]].concat()).unwrap();
            let said = stranger.hear_bytes(in_time()).unwrap().unwrap();
            let code = &said[LENGTH + OF_OWNER..];
            stranger.say_bytes(&[&said[LENGTH..LENGTH + PROCESS], code].concat()).unwrap();
            assert_eq!(proof.join().unwrap(), None);
        });
        let (mut stranger, mut guest) = pair();
        thread::scope(|scope| {
            let proof = scope.spawn(move || of_owner(&mut guest, &secret(7), in_time()));
            let said = stranger.hear_bytes(in_time()).unwrap().unwrap();
            stranger.say_bytes(&said).unwrap();
            assert_eq!(proof.join().unwrap(), Err(Unproven::Stranger));
        });
    }

    #[test]
    fn what_is_no_proof_is_none_and_who_is_silent_is_not_waited_for() {
        let long = [OPENING, &[1; LENGTH + 1]].concat();
        let openings = [&[][..], OPENING, &OPENING[1..], b"GET / HTTP/1.1\r\n\r\n", &[0xFF; MOST], &long];
        for said in openings {
            let (mut stranger, mut owner) = pair();
            stranger.say_bytes(said).unwrap();
            assert_eq!(of_guest(&mut owner, &secret(7), in_time()), None);
            let (mut stranger, mut guest) = pair();
            stranger.say_bytes(said).unwrap();
            assert_eq!(of_owner(&mut guest, &secret(7), in_time()), Err(Unproven::Stranger));
        }
        let too_long = [0xFF; MOST + 1];
        let (mut stranger, mut guest) = pair();
        stranger.say_bytes(&too_long).unwrap();
        assert_eq!(of_owner(&mut guest, &secret(7), in_time()), Err(Unproven::Stranger));
        let (_stranger, mut owner) = pair();
        assert_eq!(of_guest(&mut owner, &secret(7), monotonic()), None);
        let (stranger, mut guest) = pair();
        assert_eq!(of_owner(&mut guest, &secret(7), monotonic()), Err(Unproven::Silent));
        drop(stranger);
        assert_eq!(of_owner(&mut guest, &secret(7), in_time()), Err(Unproven::Gone));
    }

    #[test]
    fn another_clock_is_seen_to_be_one() {
        let at = Instant::from_nanos;
        assert_eq!(ahead(at(100), at(100), at(200)), 0);
        assert_eq!(ahead(at(100), at(200), at(200)), 0);
        assert_eq!(ahead(at(100), at(7), at(200)), 143);
        assert_eq!(ahead(at(100), at(1_150), at(200)), -1_000);
    }
}
