//! Loading: from four files to a checked [`Profile`].
//!
//! Everything a file can have wrong is found here, with file, line and reason; a `Profile` that exists is consistent.
//! `manifest` knows the shape of `profile.toml`, `table` that of CSV files, `rows` what their cells mean, `assemble`
//! what must agree between them.

mod assemble;
mod manifest;
mod rows;
mod table;

use std::path::Path;
use std::sync::{Arc, OnceLock};

use crate::lookup::closest;
use crate::profile::Profile;

/// Why there is no profile.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// No shipped profile has this name.
    #[error("no profile \"{name}\" is shipped; the closest is \"{closest}\"")]
    Unknown {
        /// The name as given.
        name: String,
        /// The name closest to it.
        closest: String,
    },
    /// A file of the profile cannot be read.
    #[error("{file}: {reason}")]
    Unreadable {
        /// The file.
        file: String,
        /// What the system says.
        reason: String,
    },
    /// A file of the profile says something that cannot be.
    #[error("{file}, line {line}: {reason}")]
    Broken {
        /// The file.
        file: String,
        /// The line, from 1.
        line: u64,
        /// What is wrong with it, and what would be right.
        reason: String,
    },
}

/// One file of a profile, in memory.
struct File {
    /// Its path, for messages.
    name: String,
    text: String,
}

impl File {
    /// The text without the mark that some editors put before it.
    fn text(&self) -> &str {
        self.text.strip_prefix('\u{feff}').unwrap_or(&self.text)
    }

    fn broken(&self, line: u64, reason: impl Into<String>) -> ProfileError {
        ProfileError::Broken { file: self.name.clone(), line, reason: reason.into() }
    }
}

/// The files of a profile.
struct Files {
    manifest: File,
    registers: File,
    parameters: File,
    faults: File,
}

/// A profile that is part of the program.
struct Builtin {
    name: &'static str,
    manifest: &'static str,
    registers: &'static str,
    parameters: &'static str,
    faults: &'static str,
    loaded: OnceLock<Result<Arc<Profile>, ProfileError>>,
}

static BUILTINS: [Builtin; 1] = [Builtin {
    name: "gd350",
    manifest: include_str!("../profiles/gd350/profile.toml"),
    registers: include_str!("../profiles/gd350/registers.csv"),
    parameters: include_str!("../profiles/gd350/parameters.csv"),
    faults: include_str!("../profiles/gd350/faults.csv"),
    loaded: OnceLock::new(),
}];

impl Builtin {
    fn files(&self) -> Files {
        let file = |name: &str, text: &str| File { name: format!("{}/{name}", self.name), text: text.to_owned() };
        Files {
            manifest: file("profile.toml", self.manifest),
            registers: file("registers.csv", self.registers),
            parameters: file("parameters.csv", self.parameters),
            faults: file("faults.csv", self.faults),
        }
    }
}

impl Profile {
    /// A shipped profile, by its name in upper or lower case. It is loaded once and shared.
    ///
    /// # Errors
    ///
    /// [`ProfileError::Unknown`]: none has this name; the closest is named.
    pub fn builtin(name: &str) -> Result<Arc<Self>, ProfileError> {
        match BUILTINS.iter().find(|builtin| builtin.name.eq_ignore_ascii_case(name.trim())) {
            Some(builtin) => builtin.loaded.get_or_init(|| assemble::profile(&builtin.files()).map(Arc::new)).clone(),
            None => Err(ProfileError::Unknown {
                name: name.to_owned(),
                closest: closest(name.trim(), Self::builtin_names()).unwrap_or_default().to_owned(),
            }),
        }
    }

    /// The names of the shipped profiles.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        BUILTINS.iter().map(|builtin| builtin.name)
    }

    /// Loads the profile in `folder`: `profile.toml`, `registers.csv`, `parameters.csv` and `faults.csv`, all UTF-8.
    ///
    /// # Errors
    ///
    /// [`ProfileError`]: a file is missing or cannot be read, or a line of it says something that cannot be.
    pub fn load(folder: &Path) -> Result<Self, ProfileError> {
        assemble::profile(&Files {
            manifest: read(folder, "profile.toml")?,
            registers: read(folder, "registers.csv")?,
            parameters: read(folder, "parameters.csv")?,
            faults: read(folder, "faults.csv")?,
        })
    }
}

/// Reads one file of a profile.
fn read(folder: &Path, name: &str) -> Result<File, ProfileError> {
    let path = folder.join(name);
    let file = path.display().to_string();
    let bytes = std::fs::read(&path)
        .map_err(|error| ProfileError::Unreadable { file: file.clone(), reason: error.to_string() })?;
    match String::from_utf8(bytes) {
        Ok(text) => Ok(File { name: file, text }),
        Err(error) => {
            let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = line_of(valid);
            Err(ProfileError::Broken { file, line, reason: "not UTF-8; save the file in this encoding".to_owned() })
        }
    }
}

/// The line, from 1, in which the text after `before` begins.
fn line_of(before: &[u8]) -> u64 {
    before.iter().filter(|&&byte| byte == b'\n').fold(1, |line, _| line + 1)
}
