//! Loading: from the files of a folder to a checked [`Profile`].
//!
//! Everything a file can have wrong is found here, with file, line and reason; a `Profile` that exists is consistent.
//! `manifest` knows the shape of `profile.toml`, `placed` where its values stand, `shape` all that is wrong with it, `table` the shape of CSV files, `rows`
//! what their cells mean, `entries` how rows lie over those of a profile below, `succeed` what they take over from them,
//! `inherit` what may be trusted of that, `facts`, `motion` and
//! `sequence` the tables of `profile.toml`, `words` the words that bit fields make, `assemble` what must agree
//! between them, `sense` what cannot be meant, `fit` whether what came from below still fits.

mod assemble;
mod called;
mod entries;
mod facts;
mod fit;
mod inherit;
mod manifest;
mod motion;
mod placed;
mod problems;
mod rows;
mod sense;
mod sequence;
mod shape;
mod succeed;
mod table;
mod table_cell;
mod words;

use std::io::Read;
use std::path::{Component, Path, PathBuf};
use std::sync::{Arc, OnceLock};

use manifest::Manifest;
use problems::Problems;

use crate::profile::Profile;
use crate::sheet::decode;
use crate::text::closest;

/// The files of a profile.
const FILES: [&str; 4] = ["profile.toml", "registers.csv", "parameters.csv", "faults.csv"];
/// Most bytes of one file.
const MOST_BYTES: u64 = 1 << 20;
/// Most profiles one below the other.
const MOST_LEVELS: usize = 3;

/// Why there is no profile.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// No shipped profile has this name.
    #[error("no profile \"{name}\" is shipped{}", nearest(closest))]
    Unknown {
        /// The name as given.
        name: String,
        /// The name closest to it; empty where none is shipped with this build.
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

impl ProfileError {
    /// Where it stands among others, for people who mend file after file from the top.
    fn place(&self) -> (usize, u64) {
        let (file, line) = match self {
            Self::Unknown { .. } => return (0, 0),
            Self::Unreadable { file, .. } => (file, 0),
            Self::Broken { file, line, .. } => (file, *line),
        };
        (FILES.iter().position(|name| file.ends_with(name)).unwrap_or_default(), line)
    }
}

fn nearest(closest: &str) -> String {
    if closest.is_empty() {
        return String::from(" with this build, which is without the feature \"builtin-profiles\"");
    }
    format!("; the closest is \"{closest}\"")
}

/// One file of a profile, in memory.
struct File {
    /// Its path, for messages.
    name: String,
    text: String,
}

impl File {
    fn text(&self) -> &str {
        &self.text
    }

    fn broken(&self, line: u64, reason: impl Into<String>) -> ProfileError {
        ProfileError::Broken { file: self.name.clone(), line, reason: reason.into() }
    }
}

/// The files of a profile; a table may be missing where another profile lies below.
struct Files {
    manifest: File,
    registers: Option<File>,
    parameters: Option<File>,
    faults: Option<File>,
}

/// A profile that is part of the program.
struct Builtin {
    name: &'static str,
    manifest: &'static str,
    /// Those of its tables that it has: file and text.
    tables: &'static [(&'static str, &'static str)],
    loaded: OnceLock<Result<Arc<Profile>, ProfileError>>,
}

/// A shipped profile by its folder, with those of its tables that it has.
#[cfg(feature = "builtin-profiles")]
macro_rules! builtin {
    ($name:literal: $($table:literal)*) => {
        Builtin {
            name: $name,
            manifest: include_str!(concat!("../profiles/", $name, "/profile.toml")),
            tables: &[$(($table, include_str!(concat!("../profiles/", $name, "/", $table)))),*],
            loaded: OnceLock::new(),
        }
    };
}

#[cfg(feature = "builtin-profiles")]
static BUILTINS: [Builtin; 55] = [
    builtin!("gd350": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("gd35": "registers.csv"),
    builtin!("gd35-h1": "registers.csv"),
    builtin!("gd300": "registers.csv" "parameters.csv"),
    builtin!("gd10": "registers.csv" "faults.csv"),
    builtin!("gd20": "registers.csv" "parameters.csv"),
    builtin!("gd100": "registers.csv" "parameters.csv"),
    builtin!("gd200a": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("gd600": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("gd600-rectifier": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("gd3000": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("gd3000-rectifier": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("vfd500": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("chf100a": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("chv100": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("ms300": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("vfd-e": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("vfd-b": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("yl620": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("md500": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("a1000": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("j1000": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("nowforever": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("cfw500": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("saj8000m": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("eds300": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("sunfar-e300": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("fr-d700": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("atv12": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("atv312": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("atv600": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("atv71": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("atv320": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("v20": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("acs355": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("acs580": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("fc51": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("fc202": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("frenic": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("vf-s15": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("e510": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("f510": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("gs2": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("gs4": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("vacon10": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("wj200": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("sj200": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("x200": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("h100": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("optidrive-e3": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("optidrive-p2": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("dc1": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("smd": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("starvert": "registers.csv" "parameters.csv" "faults.csv"),
    builtin!("huanyang-hy": "registers.csv" "parameters.csv" "faults.csv"),
];

#[cfg(not(feature = "builtin-profiles"))]
static BUILTINS: [Builtin; 0] = [];

impl Builtin {
    fn files(&self) -> Files {
        let file = |name: &str, text: &str| File { name: format!("{}/{name}", self.name), text: text.to_owned() };
        let table =
            |name: &str| self.tables.iter().find(|(table, _)| *table == name).map(|(name, text)| file(name, text));
        Files {
            manifest: file("profile.toml", self.manifest),
            registers: table("registers.csv"),
            parameters: table("parameters.csv"),
            faults: table("faults.csv"),
        }
    }
}

impl Profile {
    /// A shipped profile, by its name, or by what its drives are called ([`Called`](crate::Called)): `atv312`, `ATV312`,
    /// `Altivar 312`. Case, blanks and signs are not looked at. It is loaded once and shared.
    ///
    /// # Errors
    ///
    /// [`ProfileError::Unknown`]: none has this name; the closest is named.
    pub fn builtin(name: &str) -> Result<Arc<Self>, ProfileError> {
        let by_name = || BUILTINS.iter().find(|builtin| builtin.name.eq_ignore_ascii_case(name.trim()));
        match by_name().or_else(|| called::shipped(name)) {
            Some(builtin) => {
                let load = || first(check_files(&builtin.files(), None, &[])).map(Arc::new);
                builtin.loaded.get_or_init(load).clone()
            }
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

    /// The JSON schema (draft 7) of `profile.toml`, for editors. It knows the keys and their types; what their values must
    /// be, [`check`](Self::check) says.
    pub fn schema() -> &'static str {
        include_str!("../profiles/profile.schema.json")
    }

    /// Loads the profile in `folder`: `profile.toml`, `registers.csv`, `parameters.csv` and `faults.csv`, UTF-8
    /// or UTF-16 with its mark.
    ///
    /// # Errors
    ///
    /// [`ProfileError`]: a file is missing or cannot be read, or a line of it says something that cannot be.
    pub fn load(folder: &Path) -> Result<Self, ProfileError> {
        first(load(folder, &[]))
    }

    /// All that is wrong with the profile in `folder`, each with file, line and reason; nothing if it is sound. Where
    /// hundreds of lines are wrong, those that were found first.
    pub fn check(folder: &Path) -> Vec<ProfileError> {
        load(folder, &[]).err().unwrap_or_default()
    }
}

fn first(loaded: Result<Profile, Vec<ProfileError>>) -> Result<Profile, ProfileError> {
    loaded.map_err(|problems| {
        let unknown = || ProfileError::Unreadable { file: "the profile".to_owned(), reason: "not loaded".to_owned() };
        problems.into_iter().next().unwrap_or_else(unknown)
    })
}

/// Loads the profile in `folder`, below those in the folders `above`.
fn load(folder: &Path, above: &[PathBuf]) -> Result<Profile, Vec<ProfileError>> {
    let manifest = read(folder, "profile.toml").map_err(|error| vec![error])?;
    // A link that leads nowhere is there, and is named.
    let is_there = |name: &str| folder.join(name).symlink_metadata().is_ok();
    let table = |name: &str| is_there(name).then(|| read(folder, name)).transpose();
    let mut problems = Problems::default();
    let files = Files {
        manifest,
        registers: problems.keep(table("registers.csv")).flatten(),
        parameters: problems.keep(table("parameters.csv")).flatten(),
        faults: problems.keep(table("faults.csv")).flatten(),
    };
    if !problems.is_empty() {
        return Err(problems.into_all());
    }
    check_files(&files, Some(folder), above)
}

/// Puts a profile together from `files`, and from the one below them.
fn check_files(files: &Files, folder: Option<&Path>, above: &[PathBuf]) -> Result<Profile, Vec<ProfileError>> {
    let file = &files.manifest;
    let manifest = manifest::read(file).map_err(|mut wrong| {
        // What does not depend on it is checked all the same.
        let mut problems = Problems::default();
        rows::check(files, &mut problems);
        wrong.append(&mut problems.into_all());
        wrong
    })?;
    let base = below(file, &manifest, folder, above)?;
    let mut problems = Problems::default();
    if base.is_none() {
        let tables =
            [("registers.csv", &files.registers), ("parameters.csv", &files.parameters), ("faults.csv", &files.faults)];
        for (name, _) in tables.iter().filter(|(_, table)| table.is_none()) {
            problems.keep::<()>(Err(ProfileError::Unreadable {
                file: folder.map_or_else(|| name.into(), |folder| folder.join(name)).display().to_string(),
                reason: "there is no such file; a table without rows has its first line only".to_owned(),
            }));
        }
    }
    let profile = assemble::profile(files, &manifest, base, &mut problems);
    match profile {
        Some(profile) if problems.is_empty() => Ok(profile),
        _ => Err(problems.into_all()),
    }
}

/// The profile that `manifest` extends or lies over.
fn below(
    file: &File,
    manifest: &Manifest,
    folder: Option<&Path>,
    above: &[PathBuf],
) -> Result<Option<Profile>, Vec<ProfileError>> {
    let name = match (&manifest.extends, &manifest.overlay) {
        (Some(extends), None) => &extends.get_ref().profile,
        (None, Some(overlay)) => &overlay.get_ref().profile,
        (None, None) => return Ok(None),
        (Some(_), Some(overlay)) => {
            let reason = "a profile either extends another one or is an overlay, not both";
            return Err(vec![file.broken(manifest::line(file, overlay), reason)]);
        }
    };
    let line = manifest::line(file, name);
    let wanted = name.get_ref();
    if let Some(folder) = folder.filter(|_| wanted.contains(['/', '\\'])) {
        let path = PathBuf::from(wanted);
        let plain =
            |part: Component<'_>| matches!(part, Component::Normal(_) | Component::ParentDir | Component::CurDir);
        if !path.components().all(plain) {
            let reason = format!("\"{wanted}\" must be a shipped name, or a folder relative to this one");
            return Err(vec![file.broken(line, reason)]);
        }
        let wrong = |reason: String| Err(vec![file.broken(line, reason)]);
        let real = |folder: &Path| folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        let below = folder.join(path);
        let mut above = above.to_vec();
        above.push(real(folder));
        if above.contains(&real(&below)) {
            return wrong(format!("\"{wanted}\" leads back to this profile: none can lie below itself"));
        }
        if above.len() >= MOST_LEVELS {
            return wrong(format!(
                "\"{wanted}\" lies below {} others; {MOST_LEVELS} one over the other are the most",
                above.len()
            ));
        }
        return load(&below, &above).map(Some);
    }
    match Profile::builtin(wanted) {
        Ok(base) => Ok(Some(Profile::clone(&base))),
        Err(ProfileError::Unknown { closest, .. }) => {
            let reason =
                format!("no profile \"{wanted}\" is shipped; the closest is \"{closest}\", and a folder has a / in it");
            Err(vec![file.broken(line, reason)])
        }
        Err(other) => Err(vec![other]),
    }
}

/// Reads one file of a profile.
fn read(folder: &Path, name: &str) -> Result<File, ProfileError> {
    let path = folder.join(name);
    let file = path.display().to_string();
    let unreadable = |reason: String| ProfileError::Unreadable { file: file.clone(), reason };
    // A pipe or a device would be read for ever, or not at all.
    let is_file = std::fs::metadata(&path).map_err(|error| unreadable(error.to_string()))?.is_file();
    if !is_file {
        return Err(unreadable("this is not a file".to_owned()));
    }
    let mut bytes = Vec::new();
    let opened = std::fs::File::open(&path).map_err(|error| unreadable(error.to_string()))?;
    opened.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(|error| unreadable(error.to_string()))?;
    if bytes.len() as u64 > MOST_BYTES {
        return Err(unreadable(format!("the file has more than {} MiB", MOST_BYTES >> 20)));
    }
    match decode(&bytes) {
        Ok(text) => Ok(File { name: file, text: text.into_owned() }),
        Err(error) => Err(ProfileError::Broken { file, line: error.line, reason: error.reason }),
    }
}

/// The line, from 1, in which the text after `before` begins.
fn line_of(before: &[u8]) -> u64 {
    before.iter().filter(|&&byte| byte == b'\n').fold(1, |line, _| line + 1)
}
