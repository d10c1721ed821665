//! The extended Kalman filter of eight states around a way to take in measurements.

use std::marker::PhantomData;

use nalgebra::{Cholesky, Matrix4, Vector3, Vector4};

use super::NavFilter;
use super::batch::Batch;
use super::correction::{Correct, Corrected};
use super::covariance::{Blocks, Covariance};
use super::disposition::{self, Disposition, SkipReason, Skipped, Update};
use super::innovation::{Innovation, Innovations, SatelliteInnovation};
use super::row::Row;
use super::sequential::Sequential;
use super::settings::{FilterSettings, Gate};
use crate::{GpsTime, Measurement, NavError, NavState, SatelliteId, Solution};

/// Standard deviation per axis of a velocity nothing is known of, m/s: aircraft are within it.
const UNKNOWN_VELOCITY_MPS: f64 = 300.0;

/// Standard deviation of a clock drift nothing is known of, m/s: 10 ppm.
const UNKNOWN_DRIFT_MPS: f64 = 3_000.0;

/// A filter whose `Way` is [`Batch`] or [`Sequential`]; see [`BatchFilter`], [`SequentialFilter`].
#[derive(Debug, Clone)]
pub struct Ekf<Way> {
    state: NavState,
    covariance: Blocks,
    settings: FilterSettings,
    way: PhantomData<Way>,
}

/// All measurements of an epoch at once.
pub type BatchFilter = Ekf<Batch>;

/// Measurement by measurement, without an inverse or an allocation: the one to take.
pub type SequentialFilter = Ekf<Sequential>;

impl<Way> Ekf<Way> {
    /// A filter that knows `state` with `covariance`.
    ///
    /// # Errors
    /// [`NavError::Value`] for a state that is not finite or settings out of their range,
    /// [`NavError::Singular`] for a covariance that is not symmetric and positive definite.
    pub fn new(
        state: NavState,
        covariance: Covariance,
        settings: FilterSettings,
    ) -> Result<Self, NavError> {
        settings.check()?;
        if !state.is_finite() {
            return Err(NavError::Value {
                name: "state of a filter",
                value: format!("{state:?}"),
                expected: "finite values",
            });
        }
        if !is_positive_definite(&covariance) {
            return Err(NavError::Singular);
        }
        Ok(Self {
            state,
            covariance: Blocks::from_interleaved(&covariance),
            settings,
            way: PhantomData,
        })
    }

    /// A filter that starts where least squares ended, with its covariance. Without a velocity it
    /// starts at rest, not knowing it by 300 m/s per axis and its drift by 10 ppm.
    ///
    /// # Errors
    /// As [`Ekf::new`].
    pub fn from_solution(solution: &Solution, settings: FilterSettings) -> Result<Self, NavError> {
        Self::new(NavState::from(solution), covariance_of(solution), settings)
    }

    /// The settings.
    #[must_use]
    pub const fn settings(&self) -> &FilterSettings {
        &self.settings
    }

    fn decide(&self, satellite: &SatelliteInnovation, disposition: Disposition) -> Decision {
        if disposition == Disposition::Exclude {
            Decision::Skip(SkipReason::Excluded)
        } else if satellite.look.elevation_rad < self.settings.model.elevation_mask_rad {
            Decision::Skip(SkipReason::BelowMask)
        } else if let Disposition::Deweight { variance_factor } = disposition {
            Decision::Test(variance_factor)
        } else {
            Decision::Test(1.0)
        }
    }

    /// The row of `innovation`, or why it is skipped.
    fn judge(&self, innovation: &Innovation, decision: Decision) -> Result<Row, SkipReason> {
        let factor = match decision {
            Decision::Skip(reason) => return Err(reason),
            Decision::Test(factor) => factor,
        };
        let weighted = innovation.deweighted(factor);
        match self.settings.gate {
            Gate::Sigmas(sigmas) if weighted.normalised_squared() > sigmas * sigmas => {
                Err(SkipReason::Gate)
            }
            Gate::Off | Gate::Sigmas(_) => Ok(*weighted.row()),
        }
    }

    /// The rows to use, what is not used going to `skipped`. Every innovation is held against the
    /// prediction, none against a state that another has changed: the order cannot matter.
    fn select<'a>(
        &'a self,
        innovations: &'a Innovations,
        dispositions: &'a [(SatelliteId, Disposition)],
        skipped: &'a mut Vec<Skipped>,
    ) -> impl Iterator<Item = Row> + 'a {
        let both = innovations.satellites.iter().flat_map(move |s| {
            let decision = self.decide(s, disposition::of(s.satellite, dispositions));
            [Some(s.code), s.rate]
                .into_iter()
                .flatten()
                .map(move |innovation| (s.satellite, innovation, decision))
        });
        both.filter_map(move |(satellite, innovation, decision)| {
            self.judge(&innovation, decision)
                .map_err(|reason| {
                    skipped.push(Skipped {
                        satellite,
                        observable: innovation.row().observable,
                        reason,
                    });
                })
                .ok()
        })
    }

    fn apply(&mut self, corrected: &Corrected) {
        let (offset, rate) = (&corrected.error.offset, &corrected.error.rate);
        self.state.position_ecef_m += offset.xyz();
        self.state.velocity_ecef_mps += rate.xyz();
        self.state.clock_bias_m += offset.w;
        self.state.clock_drift_mps += rate.w;
        self.covariance = corrected.covariance;
    }
}

/// What to do with the measurements of a satellite.
#[derive(Debug, Clone, Copy)]
enum Decision {
    Skip(SkipReason),
    /// Hold against the gate with the variance times this factor.
    Test(f64),
}

impl<Way: Correct> NavFilter for Ekf<Way> {
    fn state(&self) -> &NavState {
        &self.state
    }

    fn covariance(&self) -> Covariance {
        self.covariance.interleaved()
    }

    fn covariance_after(&self, interval_s: f64) -> Covariance {
        let noise = &self.settings.process_noise;
        self.covariance
            .propagated(interval_s, noise, &self.state.position_ecef_m)
            .interleaved()
    }

    fn predict(&mut self, to: GpsTime) -> Result<(), NavError> {
        let interval_s = to - self.state.time;
        if !(interval_s.is_finite() && interval_s >= 0.0) {
            return Err(NavError::Value {
                name: "interval to predict over, s",
                value: interval_s.to_string(),
                expected: "0 or more, and finite",
            });
        }
        let state = self.state.at(to);
        let covariance = self.covariance.propagated(
            interval_s,
            &self.settings.process_noise,
            &state.position_ecef_m,
        );
        if !(state.is_finite() && covariance.has_variances()) {
            return Err(NavError::Singular);
        }
        self.state = state;
        self.covariance = covariance;
        Ok(())
    }

    fn accelerate(
        &mut self,
        acceleration_ecef_mps2: &Vector3<f64>,
        interval_s: f64,
    ) -> Result<(), NavError> {
        let change_mps = acceleration_ecef_mps2 * interval_s;
        if !change_mps.iter().all(|x| x.is_finite()) {
            return Err(NavError::Value {
                name: "acceleration over an interval",
                value: format!("{acceleration_ecef_mps2:?} over {interval_s} s"),
                expected: "finite values",
            });
        }
        self.state.velocity_ecef_mps += change_mps;
        self.state.position_ecef_m += change_mps * (interval_s / 2.0);
        Ok(())
    }

    fn loosen_drift(&mut self, variance_m2_s2: f64) -> Result<(), NavError> {
        if !(variance_m2_s2 >= 0.0 && variance_m2_s2.is_finite()) {
            return Err(NavError::Value {
                name: "variance of the clock's drift",
                value: variance_m2_s2.to_string(),
                expected: "0 or more, and finite",
            });
        }
        self.covariance.rate[(3, 3)] += variance_m2_s2;
        Ok(())
    }

    fn innovations(&self, measurements: &[Measurement]) -> Result<Innovations, NavError> {
        Innovations::new(
            measurements,
            &self.state,
            &self.covariance,
            &self.settings.model,
        )
    }

    fn update(
        &mut self,
        innovations: &Innovations,
        dispositions: &[(SatelliteId, Disposition)],
    ) -> Result<Update, NavError> {
        if innovations.predicted != self.state {
            return Err(NavError::StaleInnovations);
        }
        for (_, disposition) in dispositions {
            disposition.check()?;
        }
        let mut skipped = Vec::new();
        let rows = self.select(innovations, dispositions, &mut skipped);
        let corrected = Way::correct(&self.covariance, rows)?;
        if !corrected.is_finite() {
            return Err(NavError::Singular);
        }
        self.apply(&corrected);
        Ok(Update {
            used: corrected.count,
            normalised_innovation_squared: corrected.normalised_squared,
            skipped,
        })
    }
}

fn is_positive_definite(covariance: &Covariance) -> bool {
    // Rounding of whoever computed it may differ by a few last places across the diagonal.
    let asymmetry = (covariance - covariance.transpose()).amax();
    covariance.iter().all(|x| x.is_finite())
        && asymmetry <= 1e-12 * covariance.amax()
        && Cholesky::new(*covariance).is_some()
}

fn covariance_of(solution: &Solution) -> Covariance {
    let unknown = Vector4::new(
        UNKNOWN_VELOCITY_MPS,
        UNKNOWN_VELOCITY_MPS,
        UNKNOWN_VELOCITY_MPS,
        UNKNOWN_DRIFT_MPS,
    );
    let rate = solution.velocity.map_or_else(
        || Matrix4::from_diagonal(&unknown.map(|sigma| sigma * sigma)),
        |velocity| velocity.covariance_m2_s2,
    );
    Blocks {
        offset: solution.covariance_m2,
        cross: Matrix4::zeros(),
        rate,
    }
    .interleaved()
}
