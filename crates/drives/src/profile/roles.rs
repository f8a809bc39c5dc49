//! Roles: what every drive has under some name, by the name it has in this family.

use crate::entry::Entry;
use crate::parts::setpoint::Setpoint;
use crate::profile::Profile;

/// The registers that have a role beyond being read and written.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Roles {
    pub(crate) identification: Option<String>,
    pub(crate) fault: Option<String>,
    /// Whether its register keeps the number after a reset.
    pub(crate) fault_holds: bool,
    pub(crate) frequency: Option<String>,
    pub(crate) setpoint: Option<String>,
    /// The time that the ramp of a stop takes to 0 Hz, and the frequency that it is counted from.
    pub(crate) deceleration: Option<String>,
    pub(crate) ramp_start: Option<String>,
    /// The words whose bit fields tell more of the state.
    pub(crate) status_words: Vec<String>,
}

impl Roles {
    /// The roles that one register each has.
    pub(crate) fn single_mut(&mut self) -> [&mut Option<String>; 6] {
        [
            &mut self.identification,
            &mut self.fault,
            &mut self.frequency,
            &mut self.setpoint,
            &mut self.deceleration,
            &mut self.ramp_start,
        ]
    }
}

impl Profile {
    /// The lists that name entries.
    pub(crate) fn lists_mut(&mut self) -> [&mut Vec<String>; 8] {
        let (groups, roles) = (&mut self.groups, &mut self.roles);
        [
            &mut self.monitor,
            &mut self.fault_history,
            &mut self.fault_values,
            &mut roles.status_words,
            &mut groups.acts,
            &mut groups.serial,
            &mut groups.motor,
            &mut groups.last,
        ]
    }

    /// The entry that has a role: `"state"`, `"fault"` (the present one), `"frequency"` (at the output), `"setpoint"`
    /// (the frequency in force), `"deceleration"` (the time that the ramp of a stop takes to 0 Hz) and `"ramp_start"` (the
    /// frequency that it is counted from), `"identification"`, or a [setpoint](Setpoint), `"setpoints.torque"`. `None`
    /// where the family has none, or none is known, or nothing has such a role.
    pub fn role(&self, role: &str) -> Option<&Entry> {
        let name = match role {
            "state" => self.state.as_ref().map(|state| &state.register),
            "fault" => self.roles.fault.as_ref(),
            "frequency" => self.roles.frequency.as_ref(),
            "setpoint" => self.roles.setpoint.as_ref(),
            "deceleration" => self.roles.deceleration.as_ref(),
            "ramp_start" => self.roles.ramp_start.as_ref(),
            "identification" => self.roles.identification.as_ref(),
            _ => {
                let wanted = role.strip_prefix("setpoints.")?;
                let setpoint = Setpoint::ALL.into_iter().find(|setpoint| setpoint.name() == wanted)?;
                self.setpoints.get(&setpoint).map(|role| &role.register)
            }
        };
        self.entry(name?)
    }

    /// The number in the word `raw` of the present fault: its bit field `fault`, where it shares its word with something
    /// else, such as a warning.
    pub fn fault_number(&self, raw: u16) -> u16 {
        let shared = self.role("fault").and_then(|entry| entry.bits().iter().find(|field| field.name() == "fault"));
        shared.map_or(raw, |field| field.extract(raw))
    }

    /// Whether the register of the present fault keeps its number after a reset: it is the last fault then, and the present one
    /// while the state word says that the drive is in fault.
    pub fn fault_holds(&self) -> bool {
        self.roles.fault_holds
    }

    /// The words whose bit fields tell more of the state than the state itself.
    pub fn status_words(&self) -> impl Iterator<Item = &Entry> {
        self.roles.status_words.iter().filter_map(|name| self.entry(name))
    }
}
