//! A folder of a test's own with a profile in it, removed when it is dropped.

use std::fs;
use std::path::PathBuf;

use drivebus_drives::{Profile, ProfileError};

/// The line with the names of the columns of `registers.csv`.
pub(crate) const REGISTERS: &str =
    "address,name,label,unit,scale,signed,low,high,high_from,access,verified,note,source\n";
/// That of `faults.csv`.
pub(crate) const FAULTS: &str = "code,mnemonic,label,cause,remedy,verified,note,source\n";

pub(crate) struct Folder(pub(crate) PathBuf);

impl Folder {
    /// A folder with `files`; `name` is that of the test, since many run at once.
    pub(crate) fn new(name: &str, files: &[(&str, &str)]) -> Self {
        let folder = Self(PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id())));
        for (file, text) in files {
            folder.write(file, text);
        }
        folder
    }

    /// Writes `text` into `file`, which may stand in a folder inside.
    pub(crate) fn write(&self, file: &str, text: impl AsRef<[u8]>) {
        let path = self.0.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    pub(crate) fn load(&self) -> Result<Profile, ProfileError> {
        Profile::load(&self.0)
    }

    /// The reasons of all that is wrong with it.
    pub(crate) fn reasons(&self) -> Vec<String> {
        Profile::check(&self.0).iter().map(ToString::to_string).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder left behind in the build directory harms nobody.
        drop(fs::remove_dir_all(&self.0));
    }
}
