//! Output files that appear under their name only when complete.

use std::fmt::Arguments;
use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::ReceiverError;

/// A file written under a temporary name beside its own and renamed by [`OutputFile::commit`].
///
/// Dropped without that, it leaves nothing behind: a reader never meets half a file.
#[derive(Debug)]
pub struct OutputFile {
    path: PathBuf,
    temporary: PathBuf,
    writer: Option<BufWriter<File>>,
}

impl OutputFile {
    /// Opens `name` in `directory`, which must exist. An older file of that name, which would
    /// speak of another run, is removed.
    ///
    /// # Errors
    /// [`ReceiverError::File`] where the directory cannot be written to.
    pub fn create(directory: &Path, name: &str) -> Result<Self, ReceiverError> {
        let path = directory.join(name);
        let temporary = directory.join(format!("{name}.part"));
        let file = remove_old(&path).and_then(|()| File::create(&temporary));
        match file {
            Ok(file) => Ok(Self {
                path,
                temporary,
                writer: Some(BufWriter::new(file)),
            }),
            Err(source) => Err(ReceiverError::File { path, source }),
        }
    }

    /// Where the file will stand.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes formatted text; `write!` and `writeln!` call it.
    ///
    /// # Errors
    /// [`ReceiverError::File`], also after the file was committed.
    pub fn write_fmt(&mut self, text: Arguments<'_>) -> Result<(), ReceiverError> {
        self.with_writer(|writer| writer.write_fmt(text))
    }

    /// Overwrites what stands at `offset` bytes from the start, for values known late.
    ///
    /// # Errors
    /// [`ReceiverError::File`].
    pub fn patch(&mut self, offset: u64, text: &str) -> Result<(), ReceiverError> {
        self.with_writer(|writer| {
            writer.seek(SeekFrom::Start(offset))?;
            writer.write_all(text.as_bytes())?;
            writer.seek(SeekFrom::End(0)).map(|_| ())
        })
    }

    /// Writes bytes.
    ///
    /// # Errors
    /// [`ReceiverError::File`], also after the file was committed.
    pub fn write_bytes(&mut self, bytes: &[u8]) -> Result<(), ReceiverError> {
        self.with_writer(|writer| writer.write_all(bytes))
    }

    /// Writes out what is buffered and gives the file its name.
    ///
    /// # Errors
    /// [`ReceiverError::File`]; nothing is left behind then.
    pub fn commit(&mut self) -> Result<(), ReceiverError> {
        self.with_writer(|writer| {
            writer.flush()?;
            // Some file systems find out only now that they are full.
            writer.get_ref().sync_data()
        })?;
        fs::rename(&self.temporary, &self.path).map_err(|source| self.error(source))?;
        self.writer = None;
        Ok(())
    }

    fn with_writer<T>(
        &mut self,
        write: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<T>,
    ) -> Result<T, ReceiverError> {
        let result = match self.writer.as_mut() {
            Some(writer) => write(writer),
            None => Err(std::io::Error::other("already complete")),
        };
        result.map_err(|source| self.error(source))
    }

    fn error(&self, source: std::io::Error) -> ReceiverError {
        ReceiverError::File {
            path: self.path.clone(),
            source,
        }
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        if let Some(writer) = self.writer.take() {
            // The buffered rest is not wanted, and a full disk must not be written to again.
            drop(writer.into_parts());
            // Nothing can be done about a failure here; the error that led here is reported.
            let _ = fs::remove_file(&self.temporary);
        }
    }
}

/// Creates `directory` with its parents.
///
/// # Errors
/// [`ReceiverError::File`] naming the directory.
pub fn create_directory(directory: &Path) -> Result<(), ReceiverError> {
    fs::create_dir_all(directory).map_err(|source| ReceiverError::File {
        path: directory.to_owned(),
        source,
    })
}

fn remove_old(path: &Path) -> std::io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_only_when_committed() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = OutputFile::create(folder.path(), "a.txt").unwrap();
        write!(file, "0123456789").unwrap();
        assert!(!folder.path().join("a.txt").exists());
        file.patch(3, "xyz").unwrap();
        write!(file, "!").unwrap();
        file.commit().unwrap();
        let text = fs::read_to_string(folder.path().join("a.txt")).unwrap();
        assert_eq!(text, "012xyz6789!");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn an_abandoned_file_leaves_nothing_not_even_an_older_one() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.txt"), "of another run").unwrap();
        let mut file = OutputFile::create(folder.path(), "a.txt").unwrap();
        write!(file, "half").unwrap();
        drop(file);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_missing_directory_is_named() {
        let error = OutputFile::create(Path::new("/nonexistent"), "a.txt").unwrap_err();
        assert!(error.to_string().starts_with("/nonexistent/a.txt: "));
    }

    #[test]
    fn a_full_disk_is_an_error_that_names_the_file() {
        let Ok(full) = File::options().write(true).open("/dev/full") else {
            return;
        };
        let folder = tempfile::tempdir().unwrap();
        let mut file = OutputFile::create(folder.path(), "a.txt").unwrap();
        file.writer = Some(BufWriter::new(full));
        write!(file, "text").unwrap();
        let error = file.commit().unwrap_err().to_string();
        assert!(error.contains("a.txt"), "{error}");
    }
}
