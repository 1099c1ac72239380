//! The directory of a run.

use std::io::Read;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use super::error::{RunError, io};
use crate::exchange;

/// The directories of all current runs.
static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Removes the temporary files of all runs: for a program that is interrupted, and exits before its runs end.
/// A running QEMU removes them when its host is gone, but QEMU may not have started yet.
///
/// No run begins or ends after this: a thread that tries blocks until the program exits.
pub fn remove_temporary_files() {
    let folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
    // The mutex stays locked.
    for folder in ManuallyDrop::new(folders).drain(..) {
        exchange::remove(&folder);
    }
}

/// Reason why QEMU would misread a directory's name, if so.
fn misread(folder: &Path) -> Option<&'static str> {
    match folder.to_str() {
        None => Some("has a name that is not UTF-8"),
        Some(name) if name.contains(',') => Some("has a comma in its name, which QEMU takes for a separator"),
        Some(_) => None,
    }
}

/// A temporary directory. It is removed when this is dropped.
pub(super) struct RunFolder(tempfile::TempDir);

impl Drop for RunFolder {
    fn drop(&mut self) {
        let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
        folders.retain(|folder| folder != self.0.path());
        // The mutex is still locked: a program that is interrupted here leaves no files either.
        exchange::remove(self.0.path());
    }
}

impl RunFolder {
    /// # Errors
    /// [`RunError::Io`], and [`RunError::Input`] where QEMU could not read the directory's name.
    pub(super) fn new() -> Result<Self, RunError> {
        // Locked first, so that `remove_temporary_files` misses no directory.
        let mut folders = FOLDERS.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::Builder::new()
            .prefix("stm32f405-qemu-")
            .tempdir()
            .map_err(io("cannot make a temporary directory"))?;
        if let Some(why) = misread(folder.path()) {
            let shown = folder.path().display();
            let what = format!("the temporary directory {shown} {why}; set TMPDIR to another");
            return Err(RunError::Input(what));
        }
        folders.push(folder.path().to_owned());
        drop(folders);
        Ok(Self(folder))
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(super) fn write(&self, name: &str, bytes: &[u8]) -> Result<PathBuf, RunError> {
        let path = self.path(name);
        std::fs::write(&path, bytes).map_err(io("cannot write the run's temporary files"))?;
        Ok(path)
    }

    pub(super) fn text(&self, name: &str) -> String {
        let bytes = std::fs::read(self.path(name)).unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// Takes the text in a file, and empties the file. The other side appends to it.
    pub(super) fn take_text(&self, name: &str) -> String {
        let file = std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .open(self.path(name));
        let Ok(mut file) = file else { return String::new() };
        let mut bytes = Vec::new();
        let taken = file.read_to_end(&mut bytes).and_then(|_| file.set_len(0));
        if taken.is_err() {
            return String::new();
        }
        String::from_utf8_lossy(&bytes).into_owned()
    }

    pub(super) fn read(&self, name: &str) -> Result<Vec<u8>, RunError> {
        std::fs::read(self.path(name)).map_err(io("cannot read back what the run wrote"))
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::OsStr;
    use std::fs::File;
    use std::os::unix::ffi::OsStrExt;
    use std::time::Duration;

    use super::*;

    #[test]
    fn directories_whose_names_qemu_would_misread_are_refused() {
        let refused = |name: &[u8]| misread(Path::new(OsStr::from_bytes(name))).is_some();
        let names = [&b"/tmp/a=b c"[..], b"/tmp/a,b", b"/tmp/\xff"];
        assert_eq!(names.map(refused), [false, true, true]);
    }

    #[test]
    fn a_directory_is_removed_although_files_still_come() {
        for _ in 0..100 {
            let folder = tempfile::tempdir().unwrap().keep();
            let writer = std::thread::spawn({
                let folder = folder.clone();
                let write = move |name: u32| {
                    std::thread::sleep(Duration::from_micros(50));
                    File::create(folder.join((name % 4).to_string()))
                };
                // Until the directory is gone.
                move || (0..).all(|name| write(name).is_ok())
            });
            std::thread::sleep(Duration::from_millis(1));
            exchange::remove(&folder);
            assert!(!folder.exists());
            assert!(!writer.join().unwrap());
        }
    }
}
