//! Values of registers and parameters, written by name: what is allowed, and where it is kept.
//!
//! All checks come before the first write: names, ranges, also those that other parameters narrow, the state that the drive
//! must be in, and what documents prove. What makes a motor turn is not written here: that is a
//! [command](crate::Unit::start), or [bits](crate::Unit::set_bits).
//!
//! A drive tells the value in force, and not where it is kept. What was written to RAM over this [`Record`](crate::Record)
//! is taken for not stored, whatever else for stored.
//!
//! A family may keep all in RAM until a word stores it: that follows the last value, once, and stores also what somebody else
//! has set in RAM.

mod bounds;
mod not_kept;
mod plan;
mod runs;
mod send;
mod stored;

use drivebus_drives::{Input, Profile, Store};

pub use not_kept::{Beyond, Held, InForce, NotKept, NotPlanned, WhyNotKept, WhyNotPlanned, WhyNotStored};

use crate::families::Families;
use crate::task::{LineError, Mailbox};
use crate::unit::Unit;

type Why<E> = WhyNotKept<E>;

impl Unit {
    /// Writes each value of `wanted` to the register or parameter of that name, in their order, and parameters to where `store`
    /// says. What EEPROM has already is not written again.
    ///
    /// Each goes out by a request of its own. Parameters with successive codes, in that order, share one where the documents of
    /// the family print that they may. A confirmation that was lost is cleared up by reading. What acts when it is written is
    /// sent once.
    ///
    /// # Errors
    ///
    /// [`NotKept`]: its `done` has those that were written before.
    pub async fn write_values<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        wanted: &[(&str, Input<'_>)],
        store: Store,
    ) -> Result<(), NotKept<E>> {
        let mut done = Vec::new();
        let written = self.write_all(line, families, wanted, store, &mut done).await;
        written.map_err(|why| NotKept { unit: self.address(), done, parts: self.parts(), why: Box::new(why) })
    }

    async fn write_all<E: LineError>(
        &self,
        line: &Mailbox<E>,
        families: &Families,
        wanted: &[(&str, Input<'_>)],
        store: Store,
        done: &mut Vec<String>,
    ) -> Result<(), Why<E>> {
        check_deciding(self.profile(), wanted)?;
        let names: Vec<_> = wanted.iter().map(|(name, _)| *name).collect();
        let unit = self.settled(line, &names).await.map_err(Why::NotSettled)?;
        let planned = wanted.iter().map(|&(name, value)| unit.plan(name, value, store));
        let planned = planned.collect::<Result<Vec<_>, _>>().map_err(Why::NotPlanned)?;
        unit.check_now(line, &planned).await?;
        for run in runs::runs(unit.profile(), &planned) {
            unit.keep(line, families, run, store, done).await?;
        }
        if store == Store::Eeprom { unit.store_written(line, families, &planned).await } else { Ok(()) }
    }
}

/// That each name of `wanted` is one, and none of them changes what another one means, or what the drive was said to be.
fn check_deciding<E>(profile: &Profile, wanted: &[(&str, Input<'_>)]) -> Result<(), Why<E>> {
    let known = wanted.iter().map(|&(name, value)| Ok((name, value, plan::resolve(profile, name)?)));
    let known = known.collect::<Result<Vec<_>, _>>().map_err(Why::NotPlanned)?;
    for (variant, rule) in profile.variants() {
        let Ok(parameter) = profile.find(&rule.parameter) else { continue };
        let Some((name, value, entry)) = known.iter().find(|(_, _, entry)| entry.name() == parameter.name()) else {
            continue;
        };
        let depends = known.iter().find(|(_, _, entry)| entry.quantity().variant() == Some(variant));
        if let Some((other, ..)) = depends {
            return Err(Why::Decides { name: (*name).to_owned(), other: (*other).to_owned() });
        }
        let Some(choice) = profile.chosen().get(variant) else { continue };
        let words = entry.encode_words(*value);
        let words = words.map_err(|why| Why::NotPlanned(NotPlanned::of(name, WhyNotPlanned::Unfit(why))))?;
        if profile.choice_of(variant, entry.quantity().raw(&words)).as_ref() != Some(choice) {
            let (name, variant, choice) = ((*name).to_owned(), variant.clone(), choice.clone());
            return Err(Why::Unsays { name, variant, choice });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
