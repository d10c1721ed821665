//! The filter taken up anew: after a step of the clock, with another model of the delays, or from least
//! squares.

use gnss_nav::integrity::{self, IntegritySettings};
use gnss_nav::least_squares::Consistency;
use gnss_nav::{Measurement, MeasurementModel, Solution};

use super::clock_step::ClockStep;
use super::filter::{filter, from_solution};
use super::{Epoch, Outlook, VectorTracking, report};
use crate::ReceiverError;
use crate::pipeline::belief::Change;
use crate::record::EventKind;

/// Satellites a fix to start anew from may leave out: most channels may contradict the filter.
const MOST_FAULTS: usize = 4;

impl VectorTracking {
    /// Follows a step of the receiver's clock.
    pub(super) fn step_clock(
        &mut self,
        step: &ClockStep,
        epoch: &mut Epoch,
    ) -> Result<(), ReceiverError> {
        self.hindsight.clear();
        let mut state = *self.state();
        let mut covariance = self.filter.covariance();
        state.clock_bias_m += step.size_m;
        covariance[(6, 6)] += step.variance_m2;
        self.filter = filter(state, covariance, &self.model, &self.settings)?;
        let kind = EventKind::ClockStep {
            size_m: step.size_m,
        };
        epoch.events.push((None, kind));
        Ok(())
    }

    /// Takes another model of the delays, and moves to where it puts the same pseudoranges.
    pub(super) fn remodel(
        &mut self,
        model: MeasurementModel,
        measurements: &[Measurement],
    ) -> Result<(), ReceiverError> {
        let covariance = self.filter.covariance();
        let before = self.filter.innovations(measurements)?;
        self.hindsight.clear();
        self.model = model;
        self.filter = filter(*self.state(), covariance, &model, &self.settings)?;
        if let Ok(shift) = self.filter.innovations(measurements)?.shift_from(&before) {
            let mut state = *self.state();
            state.position_ecef_m += shift.xyz();
            state.clock_bias_m += shift.w;
            self.filter = filter(state, covariance, &model, &self.settings)?;
        }
        Ok(())
    }

    /// Starts anew from least squares where that is consistent.
    pub(super) fn reset(
        &mut self,
        measurements: &[Measurement],
        channels: usize,
        epoch: &mut Epoch,
    ) -> Result<(), ReceiverError> {
        let settings = IntegritySettings {
            most_faults: MOST_FAULTS,
            ..IntegritySettings::default()
        };
        let start = &self.state().position_ecef_m;
        let solved = integrity::solve(measurements, &self.model, start, &settings);
        self.faults.clear();
        let solved = solved.ok().map(|assured| assured.solution);
        let consistent = |s: &Solution| s.consistency == Consistency::Passed;
        let Some(solution) = solved.filter(consistent) else {
            self.outlook = Outlook::Contradicted;
            return Ok(());
        };
        let kind = EventKind::FilterReset { channels };
        epoch.events.push((None, kind));
        self.filter = from_solution(&solution, measurements, &self.model, &self.settings)?;
        for (satellite, watch) in std::mem::take(&mut self.watches) {
            if watch.is_suspended() {
                let kind = report::change(&Change::Cleared, self.settings.policy);
                epoch.events.push((Some(satellite), kind));
            }
        }
        self.velocities.clear();
        self.hindsight.clear();
        Ok(())
    }
}
