//! A name that stays while what it leads to gets others.

use std::fs;
use std::io;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};

/// A symbolic link that leads to the pseudo-terminal, whatever its name is by now; removed when this is dropped.
#[derive(Debug)]
pub(crate) struct Link {
    path: PathBuf,
    /// The process that made it. It outlives a child that was forked meanwhile.
    made_by: u32,
}

impl Link {
    pub(crate) fn new(path: PathBuf, target: &Path) -> io::Result<Self> {
        match fs::symlink_metadata(&path) {
            Ok(there) if !there.is_symlink() => {
                let message = format!("{} is there and is not a link; give another name", path.display());
                return Err(io::Error::new(io::ErrorKind::AlreadyExists, message));
            }
            _ => {}
        }
        let link = Self { path, made_by: std::process::id() };
        link.lead_to(target)?;
        Ok(link)
    }

    /// In one step: there is no moment without the link.
    pub(crate) fn lead_to(&self, target: &Path) -> io::Result<()> {
        let mut name = self.path.file_name().unwrap_or_default().to_owned();
        name.push(format!(".{}", std::process::id()));
        let new = self.path.with_file_name(name);
        symlink(target, &new).and_then(|()| fs::rename(&new, &self.path)).map_err(|error| {
            let _ = fs::remove_file(&new); // where it was made, and leads nowhere that anybody asked for
            io::Error::new(error.kind(), format!("the link {} cannot be made: {error}", self.path.display()))
        })
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        if self.made_by == std::process::id() {
            // Somebody may have removed it already.
            let _ = fs::remove_file(&self.path);
        }
    }
}
