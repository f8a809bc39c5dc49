//! How a program comes in to one that has a port: on the loopback each shows first who it is, then this one says hello.

use std::io;
use std::sync::Arc;
use std::time::Duration;

use super::{Host, MOST, readable};
use crate::share::channel::Channel;
use crate::share::message::{GREETING, Hello, LET_IN, SENT_AWAY, VERSION, Welcome};
use crate::share::place::Reached;
use crate::share::proof::{self, Unproven};
use crate::system::clock::monotonic;
use crate::system::process::{self, Life, Peer};

/// What is said of somebody on the loopback who has the address of a program that has the port.
const STRANGER: &str = "what listens on the loopback where this port was shared is no program of this user's: it does not know \
    their secret, and was told nothing; end it, or end the program that has the port";

/// Why nobody did.
pub(super) enum Greeting {
    Gone,
    SentAway(String),
    Silent(String),
}

/// A program that let this one in.
pub(super) struct Greeted {
    pub(super) channel: Channel,
    pub(super) welcome: Welcome,
    pub(super) life: Arc<Life>,
    pub(super) peer: Peer,
    pub(super) ahead: i64,
}

/// Says hello, and waits to be let in, by the program that lives as `known` if that is who is at the other end.
pub(super) fn greet(
    reached: Reached,
    hello: &Hello,
    known: Option<&Arc<Life>>,
    patience: Duration,
) -> Result<Greeted, Greeting> {
    let Reached { stream, secret } = reached;
    let mut peer = process::peer(&stream);
    let mut ahead = 0;
    let gone = |_: io::Error| Greeting::Gone;
    let life = known.map_or_else(|| Arc::new(peer.life()), Arc::clone);
    if life.is_gone() {
        return Err(Greeting::Gone); // somebody else has its socket, and nobody opens
    }
    let mut channel = Channel::new(stream, MOST, Arc::clone(&life)).map_err(gone)?;
    if let Some(secret) = secret {
        channel.lets_say(proof::MOST);
        let owner = proof::of_owner(&mut channel, &secret, monotonic() + patience);
        let owner = owner.map_err(|unproven| match unproven {
            Unproven::Gone => Greeting::Gone,
            Unproven::Silent => Greeting::Silent(crowded(patience)),
            Unproven::Stranger => Greeting::Silent(STRANGER.to_owned()),
        })?;
        channel.lets_say(MOST);
        (peer.process, ahead) = (owner.process, owner.ahead);
    }
    let greeting = postcard::to_extend(hello, [GREETING, &[VERSION]].concat()).map_err(|_| Greeting::Gone)?;
    channel.say_bytes(&greeting).map_err(gone)?;
    let Some(answer) = channel.hear_bytes(monotonic() + patience).map_err(gone)? else {
        let is_elsewhere = cfg!(target_os = "linux") && peer.process == 0;
        let host = Host { program: "a program".to_owned(), process: peer.process, is_elsewhere };
        return Err(Greeting::Silent(silence(&host, patience)));
    };
    match answer.split_first() {
        Some((&LET_IN, welcome)) => {
            let welcome = postcard::from_bytes(welcome).map_err(|_| Greeting::Gone)?;
            Ok(Greeted { channel, welcome, life, peer, ahead })
        }
        Some((&SENT_AWAY, why)) => Err(Greeting::SentAway(readable(&String::from_utf8_lossy(why)))),
        _ => Err(Greeting::Silent("what stands where this port is shared is no program of drivebus".to_owned())),
    }
}

/// What is said of `host`, which said nothing for so long.
pub(super) fn silence(host: &Host, silent: Duration) -> String {
    let Host { process, is_elsewhere, .. } = host;
    if !is_elsewhere && process::is_stopped(*process) {
        return format!(
            "{host} has the port and is stopped, perhaps by Ctrl-Z; let it go on (`fg`, or `kill -CONT {process}`), or end it"
        );
    }
    let end = match process {
        // Of 0, `kill` would take it for every program of the terminal.
        _ if *is_elsewhere || *process == 0 => "end it".to_owned(),
        process if cfg!(windows) => format!("end it (`taskkill /F /PID {process}`)"),
        process => format!("end it (`kill {process}`)"),
    };
    format!("{host} has the port and said nothing for {silent:?}: it hangs; {end}, or let it go on")
}

pub(super) fn crowded(silent: Duration) -> String {
    format!("a program has the port, and let nobody in for {silent:?}: it hangs; end it, or let it go on")
}
