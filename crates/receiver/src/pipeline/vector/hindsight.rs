//! What the filter took in lately, so that it can be taken in again without a satellite that turned out to be faulty.
//!
//! An alarm comes after the fault: by then the filter holds what the satellite said in between, and channels steered by
//! it begin to look faulty themselves.

use std::collections::VecDeque;

use fault_ml::learned::ChannelStep;
use gnss_nav::filter::{Covariance, Disposition, Innovations};
use gnss_nav::{GpsTime, Measurement, NavState, SatelliteId};
use gnss_signal::tracking::DopplerReach;
use nalgebra::Vector3;

use super::acceleration::{Velocities, change_of_rate_mps};
use super::filter::filter;
use super::{VectorTracking, monitors, reach};
use crate::ReceiverError;

/// Oscillators are where the filter puts them, and what they measured elsewhere is past, so many updates or bits after it
/// was corrected: two, and nothing hangs on rounding.
const IN_PLACE: f64 = 2.5;
/// A bit, s.
const BIT_S: f64 = 0.02;

/// What was known before an epoch.
#[derive(Debug, Clone)]
struct Before {
    state: NavState,
    covariance: Covariance,
    velocities: Velocities,
}

/// An epoch as the filter took it in.
#[derive(Debug, Clone)]
pub(super) struct Taken {
    before: Before,
    /// Whether the epoch before was measured.
    measured: bool,
    /// Reading of the receiver's clock.
    pub(super) receive_time: GpsTime,
    /// What the drift became less certain by, m^2/s^2.
    pub(super) drift_variance_m2_s2: f64,
    /// Acceleration that range rates were carried to the epoch by, ECEF, m/s^2.
    acceleration_mps2: Vector3<f64>,
    /// As they were taken, whatever of them was not heard.
    pub(super) measurements: Vec<Measurement>,
    /// How old range rates were.
    pub(super) ages_s: Vec<(SatelliteId, f64)>,
    /// Where Dopplers had to lie to be told.
    pub(super) reaches: Vec<(SatelliteId, DopplerReach)>,
    /// What monitors were shown.
    pub(super) shown: Vec<(SatelliteId, ChannelStep)>,
    /// What the filter was told of the measurements.
    pub(super) told: Vec<(SatelliteId, Disposition)>,
}

impl Taken {
    /// What the monitors of `satellite` were shown.
    pub(super) fn step(&self, satellite: SatelliteId) -> Option<ChannelStep> {
        let mut shown = self.shown.iter();
        shown.find(|(s, _)| *s == satellite).map(|(_, step)| *step)
    }

    /// What the filter was told of `satellite`.
    fn disposition(&self, satellite: SatelliteId) -> Option<Disposition> {
        let mut told = self.told.iter();
        let told = told.find(|(s, _)| *s == satellite);
        told.map(|(_, disposition)| *disposition)
    }

    /// Carries range rates to the epoch by another acceleration, of a receiver at `receiver_m`, ECEF.
    fn accelerate(&mut self, acceleration_mps2: Vector3<f64>, receiver_m: &Vector3<f64>) {
        let more_mps2 = acceleration_mps2 - self.acceleration_mps2;
        for measurement in &mut self.measurements {
            let mut ages = self.ages_s.iter();
            let age = ages.find(|(s, _)| *s == measurement.satellite);
            let satellite_m = &measurement.state.position_ecef_m;
            measurement.range_rate_mps += age.map_or(0.0, |(_, age_s)| {
                change_of_rate_mps(&more_mps2, satellite_m, receiver_m, *age_s)
            });
        }
        self.acceleration_mps2 = acceleration_mps2;
    }

    fn tell(&mut self, faulty: &[(SatelliteId, Disposition)]) {
        self.told
            .retain(|(s, _)| faulty.iter().all(|(f, _)| f != s));
        self.told.extend_from_slice(faulty);
    }
}

/// The last epochs.
#[derive(Debug, Clone, Default)]
pub(super) struct Hindsight {
    /// The oldest first.
    epochs: VecDeque<Taken>,
    /// Whether the filter is no longer where measurements alone led it from the last of them.
    moved: bool,
    /// When last epochs were taken in again.
    corrected: Option<GpsTime>,
}

impl Hindsight {
    /// Keeps an epoch and forgets those more than `span_s` before it; not one in which the filter was moved.
    pub(super) fn keep(&mut self, taken: Taken, span_s: f64) {
        let now = taken.receive_time;
        if !std::mem::take(&mut self.moved) {
            self.epochs.push_back(taken);
        }
        self.epochs.retain(|t| now - t.receive_time <= span_s);
    }

    /// The filter is moved by other means than measurements: nothing before counts.
    pub(super) fn clear(&mut self) {
        self.epochs.clear();
        self.moved = true;
    }

    /// What the filter is `told` of at this epoch, of satellites that it used when it last was told of them.
    fn newly_faulty(&self, told: &[(SatelliteId, Disposition)]) -> Vec<(SatelliteId, Disposition)> {
        let last = |satellite| {
            let mut epochs = self.epochs.iter().rev();
            epochs.find_map(|epoch| epoch.disposition(satellite))
        };
        let is_new = |(satellite, disposition): &&(SatelliteId, Disposition)| {
            *disposition != Disposition::Use && last(*satellite) == Some(Disposition::Use)
        };
        told.iter().filter(is_new).copied().collect()
    }

    /// The signal of `satellite` is gone: what monitors were shown of it no longer counts.
    pub(super) fn forget(&mut self, satellite: SatelliteId) {
        for epoch in &mut self.epochs {
            epoch.shown.retain(|(s, _)| *s != satellite);
        }
    }
}

impl VectorTracking {
    /// Carries the filter to the epoch at `receive_time`, of which nothing is taken in yet.
    pub(super) fn predict(&mut self, receive_time: GpsTime) -> Result<Taken, ReceiverError> {
        let measured = self.fixed == self.state().time;
        let before = self.before();
        self.carry(receive_time, measured)?;
        Ok(Taken {
            before,
            measured,
            receive_time,
            drift_variance_m2_s2: 0.0,
            acceleration_mps2: self.acceleration_mps2,
            measurements: Vec::new(),
            ages_s: Vec::new(),
            reaches: Vec::new(),
            shown: Vec::new(),
            told: Vec::new(),
        })
    }

    /// Whether what is measured at `now` may be by oscillators that the filter put where it no longer is.
    pub(super) fn was_corrected(&self, now: GpsTime) -> bool {
        let in_place_s = IN_PLACE * self.settings.interval_s.max(BIT_S);
        let corrected = self.hindsight.corrected;
        corrected.is_some_and(|at| now - at <= in_place_s)
    }

    fn before(&self) -> Before {
        Before {
            state: *self.state(),
            covariance: self.filter.covariance(),
            velocities: self.velocities.clone(),
        }
    }

    fn carry(&mut self, receive_time: GpsTime, measured: bool) -> Result<(), ReceiverError> {
        self.acceleration_mps2 = self.velocities.mean_acceleration_mps2(measured);
        let to = self.state().gps_time(receive_time);
        let interval_s = to - self.state().time;
        self.filter.predict(to)?;
        Ok(self
            .filter
            .accelerate(&self.acceleration_mps2, interval_s)?)
    }

    /// Where the filter is told at the epoch `now` not to use a satellite that it used so far, takes the last epochs in
    /// again without it, lets the monitors of the others see them anew, and predicts `now` anew; returns its
    /// innovations if so.
    pub(super) fn take_back(
        &mut self,
        now: &mut Taken,
    ) -> Result<Option<Innovations>, ReceiverError> {
        let faulty = self.hindsight.newly_faulty(&now.told);
        let first = self.hindsight.epochs.front().map(|t| t.before.clone());
        let Some(first) = first.filter(|_| !faulty.is_empty()) else {
            return Ok(None);
        };
        let scatter = self.scatter;
        let mut epochs = std::mem::take(&mut self.hindsight.epochs);
        self.filter = filter(first.state, first.covariance, &self.model, &self.settings)?;
        self.velocities = first.velocities;
        for taken in &mut epochs {
            taken.tell(&faulty);
            let innovations = self.predict_again(taken)?;
            self.filter.update(&innovations, &taken.told)?;
            self.velocities
                .remember(self.filter.state(), &self.filter.covariance());
        }
        let innovations = self.predict_again(now)?;
        self.scatter = scatter;
        self.faults.clear();
        for (satellite, watch) in &mut self.watches {
            let seen = epochs.iter().chain([&*now]);
            let steps: Vec<ChannelStep> = seen.filter_map(|t| t.step(*satellite)).collect();
            watch.hear_again(&steps)?;
        }
        self.hindsight.epochs = epochs;
        self.hindsight.corrected = Some(now.receive_time);
        Ok(Some(innovations))
    }

    /// Carries the filter to an epoch that it was once carried to; returns what its measurements are now.
    fn predict_again(&mut self, taken: &mut Taken) -> Result<Innovations, ReceiverError> {
        taken.before = self.before();
        self.carry(taken.receive_time, taken.measured)?;
        self.filter.loosen_drift(taken.drift_variance_m2_s2)?;
        taken.accelerate(self.acceleration_mps2, &self.state().position_ecef_m);
        let mut innovations = self.filter.innovations(&taken.measurements)?;
        // A copy: it may be taken in yet again, without another satellite.
        let mut heard = taken.measurements.clone();
        if reach::leave_out(&mut heard, &innovations, &taken.reaches) {
            innovations = self.filter.innovations(&heard)?;
        }
        let given = self.deviations(&innovations)?;
        for (innovation, given) in innovations.satellites().iter().zip(&given) {
            let mut shown = taken.shown.iter_mut();
            if let Some((_, step)) = shown.find(|(s, _)| *s == innovation.satellite) {
                *step = monitors::step_again(step, innovation, given);
            }
        }
        if self.closes_rates(&mut heard, &given) {
            innovations = self.filter.innovations(&heard)?;
        }
        Ok(innovations)
    }
}

#[cfg(test)]
mod tests {
    use gnss_nav::filter::Disposition::{Exclude, Use};

    use super::*;

    const DEWEIGHT: Disposition = Disposition::Deweight {
        variance_factor: 100.0,
    };

    fn told(dispositions: &[(u8, Disposition)]) -> Vec<(SatelliteId, Disposition)> {
        let told = dispositions.iter();
        told.map(|(prn, d)| (SatelliteId::gps(*prn), *d)).collect()
    }

    /// An epoch `tow_s` into the week of which nothing matters but when it was and what was told.
    fn taken(tow_s: f64, dispositions: &[(u8, Disposition)]) -> Taken {
        let receive_time = GpsTime::new(2600, tow_s);
        Taken {
            before: Before {
                state: NavState {
                    time: receive_time,
                    position_ecef_m: Vector3::zeros(),
                    velocity_ecef_mps: Vector3::zeros(),
                    clock_bias_m: 0.0,
                    clock_drift_mps: 0.0,
                },
                covariance: Covariance::zeros(),
                velocities: Velocities::default(),
            },
            measured: true,
            receive_time,
            drift_variance_m2_s2: 0.0,
            acceleration_mps2: Vector3::zeros(),
            measurements: Vec::new(),
            ages_s: Vec::new(),
            reaches: Vec::new(),
            shown: Vec::new(),
            told: told(dispositions),
        }
    }

    fn hindsight(epochs: &[&[(u8, Disposition)]]) -> Hindsight {
        let mut hindsight = Hindsight::default();
        for (tow_s, dispositions) in (0..).map(f64::from).zip(epochs) {
            hindsight.keep(taken(tow_s, dispositions), 10.0);
        }
        hindsight
    }

    #[test]
    fn faulty_anew_is_what_was_used_when_last_told_of() {
        let used = hindsight(&[&[(1, Use), (2, Use)], &[(2, Use)]]);
        // Satellite 1 was silent at the last epoch; nothing was ever told of 3.
        assert_eq!(
            used.newly_faulty(&told(&[(1, Exclude), (2, DEWEIGHT), (3, Exclude)])),
            told(&[(1, Exclude), (2, DEWEIGHT)])
        );
        assert_eq!(used.newly_faulty(&told(&[(1, Use), (2, Use)])), []);
        let left_out = hindsight(&[&[(1, Use), (2, Use)], &[(1, Exclude), (2, DEWEIGHT)]]);
        let faulty = told(&[(1, Exclude), (2, Exclude)]);
        assert_eq!(left_out.newly_faulty(&faulty), []);
    }

    #[test]
    fn an_epoch_in_which_the_filter_was_moved_is_not_kept() {
        let mut hindsight = hindsight(&[&[(1, Use)], &[(1, Use)]]);
        hindsight.clear();
        hindsight.keep(taken(2.0, &[(1, Use)]), 10.0);
        assert_eq!(hindsight.epochs.len(), 0);
        for tow_s in [3.0, 4.0, 13.5] {
            hindsight.keep(taken(tow_s, &[(1, Use)]), 10.0);
        }
        // The first is more than ten seconds before the last.
        assert_eq!(hindsight.epochs.len(), 2);
    }
}
