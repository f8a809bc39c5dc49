//! What a unit said of itself, which all handles of it share.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use drivebus_drives::Place;
use drivebus_rtu::Instant;

use super::Told;

/// For so long of the line's clock a halt trusts that nobody has put another drive at the address.
const HOLDS: Duration = Duration::from_secs(10);

/// What a unit said of itself, asked in the words of one family. A clone is the same one.
#[derive(Clone)]
pub struct Identity(Arc<Mutex<Known>>);

#[derive(Debug)]
pub(super) struct Known {
    /// How often the port had been opened again when that was heard.
    pub(super) connection: u64,
    /// Its answers; `None` while it has not told all of them.
    pub(super) told: Option<Told>,
    /// When it answered last; `None` if nobody noted that.
    pub(super) heard: Option<Instant>,
    /// Whether they tell anything: that it refuses whatever it is asked, any unit may say.
    pub(super) spoke: bool,
    /// Whether they speak against the family.
    pub(super) contradicts: bool,
    /// Whether they leave no other family that one of its halts could start.
    pub(super) is_sure: bool,
    /// The connection over which it said that it takes the words of its profile; `None`: it did not say so yet.
    pub(super) own_words: Option<u64>,
    /// The connection over which it took a word as one that is not locked; `None` where it did not yet.
    pub(super) unlocked: Option<u64>,
    /// The places that no family which it may be keeps words of, or starts by.
    pub(super) harmless: BTreeSet<Place>,
}

impl Identity {
    /// Nothing was said yet over `connection`: so often the port had been opened again.
    pub fn new(connection: u64) -> Self {
        let known = Known {
            connection,
            told: None,
            heard: None,
            spoke: false,
            contradicts: false,
            is_sure: false,
            own_words: None,
            unlocked: None,
            harmless: BTreeSet::new(),
        };
        Self(Arc::new(Mutex::new(known)))
    }

    /// How often the port had been opened again when it was heard.
    pub fn connection(&self) -> u64 {
        self.with(|known| known.connection)
    }

    /// Whether it said, over this connection, what no family says that its halts could start.
    pub fn is_sure(&self, connection: u64) -> bool {
        self.with(|known| known.is_sure && !known.contradicts && known.connection == connection)
    }

    /// Whether it said all that it is asked, over this connection, and nothing against its name.
    ///
    /// One that refused all that said nothing: any unit may.
    pub fn is_known(&self, connection: u64) -> bool {
        self.with(|known| {
            let is_told = known.is_sure || known.told.is_some() && known.spoke;
            is_told && !known.contradicts && known.connection == connection
        })
    }

    /// Whether what it said when it was asked last speaks against its name, over whatever connection.
    pub fn contradicts(&self) -> bool {
        self.with(|known| known.contradicts)
    }

    /// Whether a word at `place` was found to do no harm to it, over this connection.
    pub fn is_harmless(&self, place: Place, connection: u64) -> bool {
        self.with(|known| known.harmless.contains(&place) && known.connection == connection)
    }

    /// Whether it said, over this connection, that it is set to take the words of its profile.
    pub fn takes_own_words(&self, connection: u64) -> bool {
        self.with(|known| known.own_words == Some(connection))
    }

    /// It said so over this connection.
    pub(crate) fn found_own_words(&self, connection: u64) {
        self.with(|known| known.own_words = Some(connection));
    }

    /// It may have been set otherwise: that is asked again.
    pub(crate) fn forget_words(&self) {
        self.with(|known| known.own_words = None);
    }

    /// Whether it took a word over this connection. It may have been locked since.
    pub(crate) fn is_unlocked(&self, connection: u64) -> bool {
        self.with(|known| known.unlocked == Some(connection))
    }

    /// It took a word over this connection.
    pub(crate) fn found_unlocked(&self, connection: u64) {
        self.with(|known| known.unlocked = Some(connection));
    }

    /// Whether what it said was said so long ago that another drive may have taken its place unseen.
    pub fn is_old(&self, now: Instant) -> bool {
        self.with(|known| known.heard.is_none_or(|heard| now.saturating_duration_since(heard) > HOLDS))
    }

    /// A word at `place` does it no harm, for as long as the port stays open: by what it answered over this connection.
    pub fn found_harmless(&self, place: Place, connection: u64) {
        self.with(|known| {
            if known.connection == connection {
                known.harmless.insert(place);
            }
        });
    }

    /// Takes it for surely what it was named as, for as long as the port stays open: by what else it answered over this
    /// connection.
    pub fn settle(&self, connection: u64, now: Instant) {
        self.with(|known| {
            if known.connection == connection {
                (known.is_sure, known.heard) = (true, Some(now));
            }
        });
    }

    /// It showed that it is not what it was named as, over whatever connection: that is asked again.
    pub fn is_another(&self) {
        self.with(|known| {
            (known.contradicts, known.is_sure) = (true, false);
            known.harmless.clear();
        });
    }

    pub(super) fn with<T>(&self, f: impl FnOnce(&mut Known) -> T) -> T {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl fmt::Debug for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.with(|known| known.fmt(f))
    }
}
