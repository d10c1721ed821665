//! The kinematic filter: position, velocity and clock carried from epoch to epoch.
//!
//! The models of motion and clock are those of vector tracking (`gnss_nav::filter`). What differs is what is
//! known of the measurements: another receiver's errors are correlated over seconds, and among
//! buildings a reflection may be off by a hundred metres for as long as it lasts. Each
//! satellite's variance therefore follows what its innovations say of it.

use std::collections::{BTreeMap, BTreeSet};

use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_nav::dynamics::{AccelerationNoise, ClockNoise, ProcessNoise};
use gnss_nav::filter::{
    Covariance, EpochGeometry, FilterSettings, Gate, Innovation, Innovations, NavFilter,
    SequentialFilter,
};
use gnss_nav::integrity::{self, IntegritySettings, ProtectionLevels, Ranged};
use gnss_nav::{Geodetic, GpsTime, Measurement, MeasurementModel, NavError, NavState, SatelliteId};
use nalgebra::Matrix3;

use super::single_point::Fix;

/// Settings of the kinematic filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KinematicSettings {
    /// Motion and clock between epochs. Default: a car (1 m^2/s^3 along the ground, 0.1 upwards) with
    /// a TCXO.
    pub process_noise: ProcessNoise,
    /// Time over which the error of a pseudorange lasts, s. Default 15: real receivers at 1 Hz have
    /// an autocorrelation of 0.8 to 0.97 at one second, which is 5 to 33 s.
    pub code_correlation_s: f64,
    /// The same of a range rate, s. Default 1.
    pub rate_correlation_s: f64,
    /// The filter gives up after this long without a measurement, s. Default 60.
    pub longest_gap_s: f64,
}

impl Default for KinematicSettings {
    fn default() -> Self {
        Self {
            process_noise: ProcessNoise {
                acceleration: AccelerationNoise {
                    horizontal_m2_per_s3: 1.0,
                    vertical_m2_per_s3: 0.1,
                },
                clock: ClockNoise::tcxo(),
            },
            code_correlation_s: 15.0,
            rate_correlation_s: 1.0,
            longest_gap_s: 60.0,
        }
    }
}

/// What the filter says of one epoch.
#[derive(Debug, Clone)]
pub(super) struct Estimate {
    pub(super) state: NavState,
    /// Errors that last included.
    pub(super) covariance: Covariance,
    pub(super) pdop: f64,
    pub(super) innovations: Innovations,
    /// Satellites it took.
    pub(super) satellites: usize,
    /// Whether enough satellites determine it.
    pub(super) is_determined: bool,
    /// How far off it may be, where enough satellites check one another.
    pub(super) protection: Option<ProtectionLevels>,
}

/// Satellites that determine a position.
const NEEDED: usize = 4;

/// Beyond this dilution an epoch says little of its own errors.
const POOR_PDOP: f64 = 15.0;

/// A clock that jumps does so by whole milliseconds, m.
const CLOCK_STEP_M: f64 = SPEED_OF_LIGHT_MPS * 1e-3;

/// How much larger than stated the variances of one satellite are.
#[derive(Debug, Clone, Copy)]
struct Excess {
    code: f64,
    rate: f64,
    /// Deviation of a single pseudorange that it comes to, m.
    sigma_m: f64,
    seen: GpsTime,
}

/// The filter and what it has learnt of the satellites.
#[derive(Debug)]
pub(super) struct Kinematic {
    settings: KinematicSettings,
    model: MeasurementModel,
    filter: Option<SequentialFilter>,
    measured: Option<GpsTime>,
    excess: BTreeMap<SatelliteId, Excess>,
    /// Of the last epoch with a good one.
    geometry: Option<EpochGeometry>,
}

impl Kinematic {
    pub(super) fn new(settings: KinematicSettings, model: MeasurementModel) -> Self {
        Self {
            settings,
            model,
            filter: None,
            measured: None,
            excess: BTreeMap::new(),
            geometry: None,
        }
    }

    /// Takes the epoch at `receive_time` by the receiver's clock, and what it gives by itself.
    pub(super) fn epoch(
        &mut self,
        receive_time: GpsTime,
        measurements: &[Measurement],
        fix: Option<&Fix>,
    ) -> Option<Estimate> {
        let estimate = match self.filter.take() {
            Some(filter) => self.step(filter, receive_time, measurements, fix),
            // The measurements of this epoch have made the fix it starts from.
            None => self
                .start(fix?)
                .and_then(|filter| self.estimate(filter, measurements)),
        };
        if estimate.is_none() {
            self.filter = None;
            self.excess.clear();
            self.geometry = None;
        }
        estimate
    }

    /// Starts where a fix says that is vouched for, or has two satellites to spare.
    fn start(&mut self, fix: &Fix) -> Option<SequentialFilter> {
        let is_checked = fix.protection.is_some() || fix.solution.degrees_of_freedom() >= 2;
        if !(fix.is_trusted && is_checked) {
            return None;
        }
        let settings = FilterSettings {
            process_noise: self.settings.process_noise,
            model: self.model,
            gate: Gate::Off,
        };
        let filter = SequentialFilter::from_solution(&fix.solution, settings).ok()?;
        self.measured = Some(filter.state().time);
        Some(filter)
    }

    fn step(
        &mut self,
        mut filter: SequentialFilter,
        receive_time: GpsTime,
        measurements: &[Measurement],
        fix: Option<&Fix>,
    ) -> Option<Estimate> {
        let before = filter.state().time;
        filter.predict(filter.state().gps_time(receive_time)).ok()?;
        let interval_s = filter.state().time - before;
        let used: Vec<Measurement> = measurements
            .iter()
            .filter(|m| fix.is_none_or(|fix| fix.excludes(m.satellite).is_none()))
            .copied()
            .collect();
        let mut filter = follow_clock(filter, &used).ok()?;
        let stated = filter.innovations(&used).ok()?;
        let scaled = self.scaled(&used, &stated, filter.state().time, interval_s);
        let innovations = filter.innovations(&scaled).ok()?;
        filter.update(&innovations, &[]).ok()?;
        self.report(filter, innovations)
    }

    /// The estimate of a filter as it is, beside measurements.
    fn estimate(
        &mut self,
        filter: SequentialFilter,
        measurements: &[Measurement],
    ) -> Option<Estimate> {
        let innovations = filter.innovations(measurements).ok()?;
        self.report(filter, innovations)
    }

    /// Keeps the filter and says what it knows; none after too long a gap.
    fn report(&mut self, filter: SequentialFilter, innovations: Innovations) -> Option<Estimate> {
        let state = *filter.state();
        let mask = self.model.elevation_mask_rad;
        let above: BTreeSet<SatelliteId> = innovations
            .satellites()
            .iter()
            .filter(|s| s.look.elevation_rad >= mask)
            .map(|s| s.satellite)
            .collect();
        if !above.is_empty() {
            self.measured = Some(state.time);
        }
        let gap_s = self
            .measured
            .map_or(f64::INFINITY, |last| state.time - last);
        if gap_s > self.settings.longest_gap_s {
            return None;
        }
        let geometry = innovations
            .geometry(|satellite| above.contains(&satellite))
            .ok()
            .filter(|g| above.len() >= NEEDED && g.pdop <= POOR_PDOP);
        // Through a few epochs of poor geometry lasts what lasted before.
        self.geometry = geometry.or(self.geometry);
        let own = filter.covariance();
        self.filter = Some(filter);
        let covariance = self.geometry.map_or(own, |g| g.with_lasting(&own));
        Some(Estimate {
            state,
            covariance,
            protection: geometry
                .and_then(|_| self.protection(&state, &innovations, &above, &covariance)),
            pdop: geometry.map_or(f64::INFINITY, |g| g.pdop),
            satellites: above.len(),
            is_determined: geometry.is_some(),
            innovations,
        })
    }

    /// Protection levels where the filter settles, with the variances of single pseudoranges that their
    /// innovations speak for.
    fn protection(
        &self,
        state: &NavState,
        innovations: &Innovations,
        above: &BTreeSet<SatelliteId>,
        covariance: &Covariance,
    ) -> Option<ProtectionLevels> {
        let used = innovations.satellites().iter();
        let ranged: Vec<Ranged> = used
            .filter(|s| above.contains(&s.satellite))
            .map(|s| Ranged {
                look: s.look,
                sigma_m: match self.excess.get(&s.satellite) {
                    Some(excess) => excess.sigma_m,
                    None => s.code.noise_variance().sqrt(),
                },
            })
            .collect();
        let position = Matrix3::from_fn(|row, column| covariance[(2 * row, 2 * column)]);
        let to_enu = Geodetic::from_ecef(&state.position_ecef_m).enu_from_ecef();
        let enu = to_enu * position * to_enu.transpose();
        integrity::levels_of(&ranged, Some(&enu), &IntegritySettings::default()).ok()?
    }

    /// The measurements with the variances that their innovations speak for.
    fn scaled(
        &mut self,
        measurements: &[Measurement],
        innovations: &Innovations,
        now: GpsTime,
        interval_s: f64,
    ) -> Vec<Measurement> {
        let settings = self.settings;
        let code_share = lasting_share(settings.code_correlation_s, interval_s);
        let rate_share = lasting_share(settings.rate_correlation_s, interval_s);
        let memory = (-interval_s / settings.code_correlation_s).exp();
        let pairs = measurements.iter().zip(innovations.satellites());
        pairs
            .map(|(m, i)| {
                let code_now = excess(&i.code);
                let rate_now = i.rate.as_ref().map_or(1.0, excess);
                let known = self
                    .excess
                    .get(&m.satellite)
                    .filter(|e| now - e.seen <= settings.code_correlation_s);
                let mean = |old: Option<f64>, new: f64| {
                    old.map_or(new, |old| memory * old + (1.0 - memory) * new)
                };
                let mut learnt = Excess {
                    code: mean(known.map(|e| e.code), code_now),
                    rate: mean(known.map(|e| e.rate), rate_now),
                    sigma_m: 0.0,
                    seen: now,
                };
                let code = learnt.code.max(code_now);
                learnt.sigma_m = (code * i.code.noise_variance()).sqrt();
                self.excess.insert(m.satellite, learnt);
                let beyond_m2 = (code - 1.0) * i.code.noise_variance();
                Measurement {
                    pseudorange_variance_m2: code_share * (m.pseudorange_variance_m2 + beyond_m2),
                    range_rate_variance_m2_s2: rate_share
                        * m.range_rate_variance_m2_s2
                        * learnt.rate.max(rate_now),
                    ..*m
                }
            })
            .collect()
    }
}

/// By how much the variance of an error that lasts `correlation_s` has to be raised for a filter
/// that takes it for new every `interval_s`: the mean of n such values has the variance of the mean of
/// n / (1 + 2 tau / T) independent ones.
fn lasting_share(correlation_s: f64, interval_s: f64) -> f64 {
    if interval_s > 0.0 {
        1.0 + 2.0 * correlation_s / interval_s
    } else {
        1.0
    }
}

/// By how much the noise of a measurement has to be larger than stated for its innovation to be one
/// standard deviation; 1 where it is within.
fn excess(innovation: &Innovation) -> f64 {
    let noise = innovation.noise_variance();
    let state = innovation.variance() - noise;
    ((innovation.value() * innovation.value() - state) / noise).max(1.0)
}

/// Follows a jump of the receiver's clock by whole milliseconds, which all pseudoranges show.
fn follow_clock(
    filter: SequentialFilter,
    measurements: &[Measurement],
) -> Result<SequentialFilter, NavError> {
    let innovations = filter.innovations(measurements)?;
    let mut values: Vec<f64> = innovations
        .satellites()
        .iter()
        .map(|s| s.code.value())
        .collect();
    values.sort_by(f64::total_cmp);
    let Some(median_m) = values.get(values.len() / 2) else {
        return Ok(filter);
    };
    let step_m = (median_m / CLOCK_STEP_M).round() * CLOCK_STEP_M;
    if step_m == 0.0 {
        return Ok(filter);
    }
    let state = filter.state();
    let mut moved = state.at(state.time - step_m / SPEED_OF_LIGHT_MPS);
    moved.clock_bias_m = state.clock_bias_m + step_m;
    SequentialFilter::new(moved, filter.covariance(), *filter.settings())
}
