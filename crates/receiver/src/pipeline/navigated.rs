//! What navigation by the channels' own loops makes of an epoch.

use gnss_nav::GpsTime;
use gnss_nav::filter::Disposition;
use gnss_nav::integrity::{Misfit, ProtectionLevels};
use gnss_nav::least_squares::{Consistency, Solution};
use gnss_nav::measurement::RawMeasurement;

use crate::record::Source;

/// What an epoch brought.
#[derive(Debug, Clone)]
pub(super) struct Navigated {
    /// The solution, where there is one.
    pub(super) fix: Option<(Solution, Source)>,
    /// Satellites that do not fit it.
    pub(super) misfits: Vec<Misfit>,
    /// How far off it may be, where that can be said.
    pub(super) protection: Option<ProtectionLevels>,
    /// Receiver clock at the epoch, where it is good enough for pseudoranges.
    pub(super) receive_time: Option<GpsTime>,
    /// The measurements, where the clock is good enough.
    pub(super) raw: Vec<RawMeasurement>,
    /// What the solution did with each by the shape of its correlation.
    pub(super) dispositions: Vec<Disposition>,
}

impl Navigated {
    /// Neither a solution nor measurements.
    pub(super) const fn nothing() -> Self {
        Self {
            fix: None,
            misfits: Vec::new(),
            protection: None,
            receive_time: None,
            raw: Vec::new(),
            dispositions: Vec::new(),
        }
    }

    /// The solution, where it is one of least squares whose measurements agree.
    pub(super) fn consistent(&self) -> Option<&Solution> {
        let (solution, source) = self.fix.as_ref()?;
        let consistent = *source == Source::LeastSquares
            && solution.consistency == Consistency::Passed
            && solution.velocity.is_some();
        consistent.then_some(solution)
    }
}

/// Whether the measurements of a solution contradict each other.
pub(super) fn is_contradictory(solution: &Solution) -> bool {
    matches!(solution.consistency, Consistency::Failed)
}
