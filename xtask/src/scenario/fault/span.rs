//! When a fault is there, and how much of it.

use anyhow::{Result, ensure};

/// Onset, end and ramp of a fault, elapsed s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Onset.
    pub begin_s: f64,
    /// End; none: it stays.
    pub end_s: Option<f64>,
    /// Time in which it grows after the onset and shrinks before the end.
    pub ramp_s: f64,
}

impl Span {
    /// Checks that it is a span.
    ///
    /// # Errors
    /// Names what is impossible.
    pub fn check(&self) -> Result<()> {
        ensure!(
            (0.0..=1e6).contains(&self.begin_s),
            "begin_s is {}: expected 0 to 1e6",
            self.begin_s
        );
        if let Some(end_s) = self.end_s {
            ensure!(
                end_s > self.begin_s,
                "end_s is {end_s}: expected more than begin_s, {}",
                self.begin_s
            );
        }
        ensure!(
            (0.0..=1e6).contains(&self.ramp_s),
            "ramp_s is {}: expected 0 to 1e6",
            self.ramp_s
        );
        Ok(())
    }

    /// Whether the fault is there at `elapsed_s`.
    #[must_use]
    pub fn contains(&self, elapsed_s: f64) -> bool {
        elapsed_s >= self.begin_s && self.end_s.is_none_or(|end_s| elapsed_s < end_s)
    }

    /// How much of it is there, 0 to 1.
    #[must_use]
    pub fn share(&self, elapsed_s: f64) -> f64 {
        if self.ramp_s <= 0.0 {
            return 1.0;
        }
        let grown = (elapsed_s - self.begin_s) / self.ramp_s;
        let left = self
            .end_s
            .map_or(1.0, |end_s| (end_s - elapsed_s) / self.ramp_s);
        grown.min(left).clamp(0.0, 1.0)
    }

    /// Instants at which something begins or ends.
    pub fn edges_s(&self) -> impl Iterator<Item = f64> {
        [Some(self.begin_s), self.end_s].into_iter().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_grows_stays_and_vanishes() {
        let span = Span {
            begin_s: 2.0,
            end_s: Some(10.0),
            ramp_s: 2.0,
        };
        let shares = [(2.0, 0.0), (3.0, 0.5), (5.0, 1.0), (9.5, 0.25), (10.0, 0.0)];
        for (time_s, share) in shares {
            assert_eq!(span.share(time_s), share, "at {time_s}");
        }
        assert!(span.contains(2.0) && !span.contains(10.0) && !span.contains(1.999));
        assert!(span.edges_s().eq([2.0, 10.0]));
    }
}
