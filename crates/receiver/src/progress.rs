//! Progress on standard error, where that is a terminal.

use std::io::{self, Read};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Seconds of signal that pass per second, and how long the rest will take.
#[derive(Debug, Clone)]
pub struct Progress {
    bar: ProgressBar,
}

const KNOWN_LENGTH: &str = "{bar:32} {percent:>3}%  {msg}  {eta} left";
const UNKNOWN_LENGTH: &str = "{spinner}  {msg}";

impl Progress {
    /// A bar over `total_bytes`, or without an end where that is not known. Hidden where `quiet`
    /// or where standard error is no terminal.
    #[must_use]
    pub fn new(total_bytes: Option<u64>, quiet: bool) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(5)
        };
        let bar = ProgressBar::with_draw_target(total_bytes, target);
        let template = if total_bytes.is_some() {
            KNOWN_LENGTH
        } else {
            UNKNOWN_LENGTH
        };
        // Both templates are constants that parse; the default style would do otherwise.
        bar.set_style(
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        Self { bar }
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Counts what is read through it.
#[derive(Debug)]
pub struct Counted<R> {
    reader: R,
    progress: Progress,
    bytes_per_s: f64,
    bytes: u64,
}

impl<R> Counted<R> {
    /// Reports what is read from `reader` to `progress`.
    #[must_use]
    pub const fn new(reader: R, progress: Progress, bytes_per_s: f64) -> Self {
        Self {
            reader,
            progress,
            bytes_per_s,
            bytes: 0,
        }
    }
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.reader.read(buffer)?;
        self.bytes += count as u64;
        let bar = &self.progress.bar;
        if !bar.is_hidden() {
            let signal_s = self.bytes as f64 / self.bytes_per_s;
            let elapsed_s = bar.elapsed().max(Duration::from_millis(1)).as_secs_f64();
            bar.set_position(self.bytes);
            bar.set_message(format!(
                "{signal_s:.1} s of signal, {:.1} times real time",
                signal_s / elapsed_s
            ));
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reading_through_changes_nothing() {
        let progress = Progress::new(Some(5), true);
        let mut text = String::new();
        Counted::new(&b"bytes"[..], progress.clone(), 1.0)
            .read_to_string(&mut text)
            .unwrap();
        progress.finish();
        assert_eq!(text, "bytes");
    }
}
