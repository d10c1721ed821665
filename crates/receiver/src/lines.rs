//! Numbered lines of a file that may be compressed.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;

/// Longest line taken, bytes: all systems and signals of one satellite take less than 2000.
const LONGEST: u64 = 1 << 16;

/// Bytes read at a time.
const BUFFER: usize = 1 << 16;

/// Lines of a text without their ends, numbered from 1.
pub(crate) struct Lines {
    reader: Box<dyn BufRead>,
    text: Vec<u8>,
    number: u64,
    is_held: bool,
}

impl Lines {
    /// Opens a file, compressed by gzip or not.
    pub(crate) fn open(path: &Path) -> io::Result<Self> {
        let mut reader = BufReader::with_capacity(BUFFER, File::open(path)?);
        let is_gzip = reader.fill_buf()?.starts_with(&[0x1f, 0x8b]);
        Ok(if is_gzip {
            let plain = MultiGzDecoder::new(reader);
            Self::new(Box::new(BufReader::with_capacity(BUFFER, plain)))
        } else {
            Self::new(Box::new(reader))
        })
    }

    pub(crate) fn new(reader: Box<dyn BufRead>) -> Self {
        Self {
            reader,
            text: Vec::new(),
            number: 0,
            is_held: false,
        }
    }

    /// Number of the line read last.
    pub(crate) const fn number(&self) -> u64 {
        self.number
    }

    /// The line read last.
    pub(crate) fn current(&self) -> &[u8] {
        &self.text
    }

    /// Lets the next [`Self::advance`] stay at the current line.
    pub(crate) fn hold(&mut self) {
        self.is_held = true;
    }

    /// Reads the next line into [`Self::current`]; false at the end.
    pub(crate) fn advance(&mut self) -> io::Result<bool> {
        if std::mem::take(&mut self.is_held) {
            return Ok(true);
        }
        self.text.clear();
        let read = (&mut self.reader)
            .take(LONGEST)
            .read_until(b'\n', &mut self.text)?;
        if read == 0 {
            return Ok(false);
        }
        self.number += 1;
        if read as u64 == LONGEST {
            return Err(io::Error::other(format!(
                "line {} is longer than {LONGEST} bytes: expected text",
                self.number
            )));
        }
        while matches!(self.text.last(), Some(b'\n' | b'\r')) {
            self.text.pop();
        }
        Ok(true)
    }
}
