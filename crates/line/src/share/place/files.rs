//! The files of a port in its folder: nobody else than who meets there reads or writes them. One of them is a lock, and some
//! are kept open by the program that made them, for as long as that lives.

use std::fs::{File, OpenOptions};
use std::io;

pub(super) use of_this_system::is_kept;

use super::Place;
use crate::system::inherited::Kept;

/// The lock of a port: a program at a time has it, until it is dropped, or the program is gone.
#[derive(Debug)]
pub(super) struct Lock {
    #[cfg(unix)]
    file: Kept<File>,
    #[cfg(not(unix))]
    path: std::path::PathBuf,
    /// Open, it lets nobody else open it.
    #[cfg(not(unix))]
    file: Option<File>,
}

#[cfg(unix)]
mod of_this_system {
    use std::fs::Permissions;
    use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
    use std::path::Path;

    use rustix::fs::{FlockOperation, OFlags, flock};

    use super::{File, Kept, Lock, OpenOptions, Place, io};
    use crate::system::process::user;

    impl Place {
        /// What a file here allows.
        pub(in crate::share::place) const fn mode(&self) -> u32 {
            if self.is_of_group() { 0o660 } else { 0o600 }
        }

        /// The file of this port with such an ending, made anew if `is_new`. What somebody else put in its place is not followed.
        pub(crate) fn file(&self, ending: &str, is_new: bool) -> io::Result<File> {
            let mut options = OpenOptions::new();
            options.read(true).write(true).mode(self.mode()).custom_flags(OFlags::NOFOLLOW.bits().cast_signed());
            let file = options.create(!is_new).create_new(is_new).open(self.path(ending))?;
            let status = file.metadata()?;
            if self.is_of_group() && status.uid() == user() && status.mode() & 0o777 != self.mode() {
                // What the user's mask took away.
                file.set_permissions(Permissions::from_mode(self.mode()))?;
            }
            Ok(file)
        }

        /// The file of this port with such an ending, made anew.
        pub(in crate::share::place) fn new_file(&self, ending: &str) -> io::Result<File> {
            self.file(ending, true)
        }

        /// The file of this port with such an ending, made anew, and [kept](is_kept) by this program.
        pub(in crate::share::place) fn kept_file(&self, ending: &str) -> io::Result<Kept<File>> {
            let file = Kept::opened(|| self.file(ending, true))?;
            flock(&*file, FlockOperation::NonBlockingLockExclusive)?;
            Ok(file)
        }

        /// The lock, not taken yet; `None` where this user may not have it.
        pub(in crate::share::place) fn lock(&self) -> io::Result<Option<Lock>> {
            match Kept::opened(|| self.file("lock", false)) {
                Ok(file) => Ok(Some(Lock { file })),
                // Who may not come in need not wait either.
                Err(_) if self.is_of_group() => Ok(None),
                Err(error) => Err(error),
            }
        }
    }

    /// Whether the program lives that keeps the file at `path`, and has it open.
    pub(in crate::share::place) fn is_kept(path: &Path) -> bool {
        // Those who look do not keep each other out.
        File::open(path).is_ok_and(|file| flock(file, FlockOperation::NonBlockingLockShared).is_err())
    }

    impl Lock {
        /// Takes it, unless another program has it.
        pub(in crate::share::place) fn is_taken(&mut self) -> bool {
            flock(&*self.file, FlockOperation::NonBlockingLockExclusive).is_ok()
        }
    }
}

#[cfg(windows)]
mod of_this_system {
    use std::os::windows::fs::OpenOptionsExt;
    use std::path::Path;

    use super::{File, Kept, Lock, OpenOptions, Place, io};

    /// What the system says of a file that another program keeps for itself. Source: *System Error Codes*,
    /// `ERROR_SHARING_VIOLATION`.
    const KEPT_BY_ANOTHER: i32 = 32;
    /// What may be done with a file that is open. Source: `CreateFileW`, `FILE_SHARE_DELETE`.
    const SHARE_DELETE: u32 = 4;

    impl Place {
        /// The file of this port with such an ending, made anew.
        pub(in crate::share::place) fn new_file(&self, ending: &str) -> io::Result<File> {
            OpenOptions::new().write(true).create_new(true).open(self.path(ending))
        }

        /// The file of this port with such an ending, made anew, and [kept](is_kept) by this program.
        pub(in crate::share::place) fn kept_file(&self, ending: &str) -> io::Result<Kept<File>> {
            let mut options = OpenOptions::new();
            options.write(true).create_new(true).share_mode(SHARE_DELETE);
            options.open(self.path(ending)).map(Kept::new)
        }

        /// The lock, not taken yet.
        pub(in crate::share::place) fn lock(&self) -> io::Result<Option<Lock>> {
            let path = self.path("lock");
            Ok(Some(Lock { file: alone(&path)?, path }))
        }
    }

    /// Whether the program lives that keeps the file at `path`, and has it open.
    pub(in crate::share::place) fn is_kept(path: &Path) -> bool {
        let opened = OpenOptions::new().write(true).open(path);
        opened.is_err_and(|error| error.raw_os_error() == Some(KEPT_BY_ANOTHER))
    }

    impl Lock {
        /// Takes it, unless another program has it.
        pub(in crate::share::place) fn is_taken(&mut self) -> bool {
            self.file = self.file.take().or_else(|| alone(&self.path).ok().flatten());
            self.file.is_some()
        }
    }

    /// The file at `path`, for this program alone; `None` where another has it.
    fn alone(path: &Path) -> io::Result<Option<File>> {
        let mut options = OpenOptions::new();
        match options.write(true).create(true).truncate(false).share_mode(0).open(path) {
            Ok(file) => Ok(Some(file)),
            Err(error) if error.raw_os_error() == Some(KEPT_BY_ANOTHER) => Ok(None),
            Err(error) => Err(error),
        }
    }
}
