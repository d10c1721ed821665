//! The filter of vector tracking, and where it starts.

use gnss_nav::filter::{BatchFilter, Covariance, FilterSettings, NavFilter, SequentialFilter};
use gnss_nav::{Measurement, MeasurementModel, NavState, Solution};

use super::settings::{FilterKind, VectorSettings};
use crate::ReceiverError;

/// Deviation of each coordinate at the start beyond the noise of the code loops, m: an unsteady
/// oscillator or acceleration drags them along.
const START_SIGMA_M: f64 = 1.5;

/// A filter that knows `state` with `covariance`.
pub(super) fn filter(
    state: NavState,
    covariance: Covariance,
    model: &MeasurementModel,
    settings: &VectorSettings,
) -> Result<Box<dyn NavFilter>, ReceiverError> {
    let filter_settings = FilterSettings {
        process_noise: settings.process_noise,
        model: *model,
        gate: settings.gate,
    };
    Ok(match settings.filter {
        FilterKind::Batch => Box::new(BatchFilter::new(state, covariance, filter_settings)?),
        FilterKind::Sequential => {
            Box::new(SequentialFilter::new(state, covariance, filter_settings)?)
        }
    })
}

/// A filter that starts where least squares of `measurements` ended.
///
/// What lasts of their errors is not for the filter to average away: it starts with what tracking noise
/// made of the solution, and room for what the loops erred beyond their noise.
pub(super) fn from_solution(
    solution: &Solution,
    measurements: &[Measurement],
    model: &MeasurementModel,
    settings: &VectorSettings,
) -> Result<Box<dyn NavFilter>, ReceiverError> {
    let filter_settings = FilterSettings {
        model: *model,
        ..FilterSettings::default()
    };
    let start = SequentialFilter::from_solution(solution, filter_settings)?;
    let used = |satellite| solution.satellites.iter().any(|s| s.satellite == satellite);
    let geometry = start.innovations(measurements)?.geometry(used)?;
    let mut own = geometry.with_noise_alone(&start.covariance());
    for offset in [0, 2, 4, 6] {
        own[(offset, offset)] += START_SIGMA_M * START_SIGMA_M;
    }
    filter(*start.state(), own, model, settings)
}
