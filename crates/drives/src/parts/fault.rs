//! Faults and exceptions: why a drive tripped, and why it refuses a request.

use crate::evidence::Evidence;

/// A reason for which a drive trips.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Fault {
    /// Its number in the fault register.
    pub code: u16,
    /// What the keypad shows: `OL1`. Case matters: on the GD350 `STo` is not `STO`. May be empty.
    pub mnemonic: String,
    /// What happened.
    pub label: String,
    /// What it comes from; may be empty.
    pub cause: String,
    /// What to do; may be empty.
    pub remedy: String,
    /// How well documents of this family prove number, mnemonic and label.
    pub evidence: Evidence,
    /// What to know about this row; may be empty.
    pub note: String,
    /// Where it is printed; may be empty.
    pub source: String,
}

impl Fault {
    /// Whether number, mnemonic and label rest on documents of this family.
    pub fn verified(&self) -> bool {
        self.evidence == Evidence::Verified
    }

    /// The fault that stands for a number which the profile does not know.
    pub(crate) fn unknown(code: u16) -> Self {
        Self {
            code,
            mnemonic: String::new(),
            label: format!("Unknown fault {code}"),
            cause: String::new(),
            remedy: "Look the number up in the manual of the drive".to_owned(),
            evidence: Evidence::Assumed,
            note: "This number is not in the profile.".to_owned(),
            source: String::new(),
        }
    }
}

/// What a drive says by an exception: whether it is a decision, and whether the request was carried out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Means {
    /// There is no such function, address, count or value: a decision, and the next answer will be the same.
    NoSuch,
    /// It is not allowed or not possible now: a decision that another state of the drive may change.
    NotNow,
    /// The drive is busy, or the request reached it damaged: it was not carried out, and may be the next time.
    AskAgain,
    /// The drive took the request and is still at it.
    Taken,
}

/// A reason for which a drive refuses a request: the code of a Modbus exception, in this family's meaning.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Exception {
    /// The exception code.
    pub code: u8,
    /// Its name: `operation_failed`.
    pub name: String,
    /// What it means, as a clause.
    pub meaning: String,
    /// Whether it is a decision; `None`: as the specification has the code.
    pub means: Option<Means>,
    /// Where it is printed; may be empty.
    pub source: String,
}

impl Exception {
    /// The exception that stands for a code which the profile does not know.
    pub(crate) fn unknown(code: u8) -> Self {
        Self {
            code,
            name: "unknown".to_owned(),
            meaning: format!("exception code {code:02X}H is not documented for this drive"),
            means: None,
            source: String::new(),
        }
    }
}
