//! Monitors of all satellites of an epoch.

use crate::{Health, Judgement, MonitorError};

/// What one satellite contributes to an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SatelliteMeasurement {
    /// Whose, by any number the caller likes.
    pub id: u32,
    /// Satellite position at transmission in the ECEF frame of reception, m.
    pub position_ecef_m: [f64; 3],
    /// Pseudorange with satellite clock and modelled delays taken off, m.
    pub pseudorange_m: f64,
    /// Its variance, m^2.
    pub variance_m2: f64,
}

/// What a monitor says of one epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IntegrityReport {
    /// Judged.
    Judged {
        /// Score of the whole epoch against its threshold.
        judgement: Judgement,
        /// The satellite that fits worst, where it can be told.
        worst: Option<u32>,
    },
    /// Too few epochs seen yet.
    WarmingUp,
    /// Too few satellites, or in too poor a geometry, to tell.
    Unavailable,
}

impl IntegrityReport {
    /// Health of the epoch.
    #[must_use]
    pub fn health(&self) -> Health {
        match self {
            Self::Judged { judgement, .. } => judgement.health(),
            Self::WarmingUp => Health::WarmingUp,
            Self::Unavailable => Health::Unavailable,
        }
    }

    /// The satellite held to be faulty: the one that fits worst, in a faulty epoch alone.
    #[must_use]
    pub fn faulty_satellite(&self) -> Option<u32> {
        match self {
            Self::Judged { judgement, worst } if judgement.health() == Health::Faulty => *worst,
            _ => None,
        }
    }
}

/// Judges the satellites of one epoch together, epoch by epoch.
///
/// Causal, and deterministic given its seed.
pub trait IntegrityMonitor {
    /// Name in results and options.
    fn name(&self) -> &str;

    /// Takes the measurements of the epoch `time_s` (s on any clock that only grows).
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a number is not finite or a variance not above zero; the epoch
    /// then leaves no trace.
    fn epoch(
        &mut self,
        time_s: f64,
        measurements: &[SatelliteMeasurement],
    ) -> Result<IntegrityReport, MonitorError>;

    /// Satellites alarmed on in earlier epochs or this one that the monitor does not yet believe
    /// again. A later epoch without them may well be healthy: they are faulty all the same. None
    /// for a monitor that looks at every epoch anew.
    fn set_aside(&self) -> &[u32] {
        &[]
    }

    /// Forgets all epochs.
    fn reset(&mut self);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_satellite_is_named_only_where_the_epoch_is_faulty() {
        let judged = |score| IntegrityReport::Judged {
            judgement: Judgement::new(score, 4.0).unwrap(),
            worst: Some(7),
        };
        assert_eq!(judged(4.0).health(), Health::Healthy);
        assert_eq!(judged(4.0).faulty_satellite(), None);
        assert_eq!(judged(4.1).health(), Health::Faulty);
        assert_eq!(judged(4.1).faulty_satellite(), Some(7));
        assert_eq!(IntegrityReport::WarmingUp.health(), Health::WarmingUp);
        assert_eq!(IntegrityReport::Unavailable.health(), Health::Unavailable);
    }
}
