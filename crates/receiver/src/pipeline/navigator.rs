//! From the channels' epochs to position, velocity and time.

use gnss_nav::atmosphere::Klobuchar;
use gnss_nav::coarse_time::{self, Prior, SnapshotMeasurement, SnapshotSolution};
use gnss_nav::constants::{L1_WAVELENGTH_M, SPEED_OF_LIGHT_MPS};
use gnss_nav::integrity::Assured;
use gnss_nav::least_squares::Solution;
use gnss_nav::measurement::{ErrorModel, Formed, MeasurementModel, RawMeasurement, form};
use gnss_nav::prediction::{Expected, ReceiverState, predict};
use gnss_nav::{Ephemeris, EphemerisStore, GpsTime, NavState, SatelliteId};
use gnss_signal::tracking::{ChannelEpoch, Lock};
use nalgebra::Vector3;

use super::clock::{ClockTrust, ReceiverClock};
use super::measured::{NEEDED, code_variance_m2, raw_measurement, shape_dispositions, weighted};
use super::navigated::Navigated;
use super::settings::Settings;
use super::slot::{Slot, transmit_fraction_s};
use crate::ReceiverError;
use crate::raim::RaimWatch;
use crate::record::Source;

/// Travel time assumed before the first fix, s: the middle between zenith and horizon.
const TYPICAL_TRAVEL_S: f64 = 0.075;
/// Chance of leaving out a good satellite at one epoch.
const EXCLUSION_FALSE_ALARM: f64 = 1e-5;
/// A coarse time this good, s, tells which bit boundary is which (10 ms is half a bit).
const BIT_SAFE_SIGMA_S: f64 = 2.5e-3;
/// Bit boundaries of all satellites agree to this with a position good to 100 km, s.
const BIT_AGREEMENT_S: f64 = 0.5e-3;

/// Klobuchar's delay at night, 5 ns at the zenith (IS-GPS-200, 20.3.3.5.2.5).
const NIGHT_IONOSPHERE: Klobuchar = Klobuchar {
    alpha: [0.0; 4],
    beta: [0.0; 4],
};
/// Deviation of the true delay from that, in its units: by day it is 2 to 10 times as much.
const UNKNOWN_IONOSPHERE_FRACTION: f64 = 4.0;

/// Satellites this far below the horizon are not looked for, rad (10 degrees).
const HORIZON_MARGIN_RAD: f64 = 0.175;

/// A channel with its epoch.
pub(super) struct Tracked<'a> {
    pub(super) slot: &'a mut Slot,
    pub(super) epoch: ChannelEpoch,
}

/// Knows ephemerides, time and place, and finds the next.
#[derive(Debug)]
pub(super) struct Navigator {
    pub(super) store: EphemerisStore,
    ionosphere: Option<Klobuchar>,
    use_ionosphere: bool,
    troposphere: bool,
    errors: ErrorModel,
    mask_rad: f64,
    sample_rate_hz: f64,
    /// Any recent GPS time, to tell weeks apart.
    near: Option<GpsTime>,
    clock: Option<ReceiverClock>,
    place: Option<Place>,
    pub(super) watch: RaimWatch,
}

/// Where the receiver was.
#[derive(Debug, Clone, Copy)]
struct Place {
    position_ecef_m: Vector3<f64>,
    velocity_ecef_mps: Vector3<f64>,
    /// What the receiver's clock was ahead by at `tick`, m.
    clock_bias_m: f64,
    clock_drift_mps: f64,
    tick: u64,
    solved: bool,
}

impl Navigator {
    /// # Errors
    /// [`ReceiverError::Monitor`] where a monitor cannot be set up.
    pub(super) fn new(settings: &Settings, sample_rate_hz: f64) -> Result<Self, ReceiverError> {
        let aiding = &settings.aiding;
        let clock = aiding
            .time
            .map(|t| ReceiverClock::new(0, t, ClockTrust::Coarse, sample_rate_hz));
        let place = aiding.position_ecef_m.map(|position_ecef_m| Place {
            position_ecef_m,
            velocity_ecef_mps: Vector3::zeros(),
            clock_bias_m: 0.0,
            clock_drift_mps: 0.0,
            tick: 0,
            solved: false,
        });
        Ok(Self {
            watch: RaimWatch::new(settings.raim, settings.seed)?,
            store: aiding.ephemerides.iter().copied().collect(),
            ionosphere: aiding.ionosphere,
            use_ionosphere: settings.ionosphere,
            troposphere: settings.troposphere,
            errors: settings.errors,
            mask_rad: settings.elevation_mask_rad,
            sample_rate_hz,
            near: aiding.time,
            clock,
            place,
        })
    }

    /// Takes the week from a message.
    pub(super) fn learn_time(&mut self, time: GpsTime) {
        self.near = Some(time);
    }

    /// Takes an ephemeris; tells whether it is new.
    pub(super) fn learn_ephemeris(&mut self, ephemeris: Ephemeris) -> bool {
        self.store.insert(ephemeris)
    }

    /// Takes the ionosphere model from a message.
    pub(super) fn learn_ionosphere(&mut self, model: Klobuchar) {
        self.ionosphere = Some(model);
    }

    /// A recent GPS time, if any is known.
    pub(super) const fn near(&self) -> Option<GpsTime> {
        self.near
    }

    /// The oscillator's part of every Doppler, Hz, once there was a fix at moderate speed.
    pub(super) fn oscillator_doppler_hz(&self) -> Option<f64> {
        let place = self
            .place
            .filter(|p| p.solved && p.velocity_ecef_mps.norm() < 200.0)?;
        Some(-place.clock_drift_mps / L1_WAVELENGTH_M)
    }

    /// Reading of the receiver's clock at `tick`, where it is good enough for pseudoranges.
    pub(super) fn receive_time(&self, tick: u64) -> Option<GpsTime> {
        let clock = self.clock.filter(|c| c.trust == ClockTrust::Fix)?;
        Some(clock.at(tick))
    }

    /// Reading of the receiver's clock at `tick`, where that is known only roughly.
    pub(super) fn coarse_time(&self, tick: u64) -> Option<GpsTime> {
        let clock = self.clock.filter(|c| c.trust == ClockTrust::Coarse)?;
        Some(clock.at(tick))
    }

    /// Whether there is an ephemeris of `satellite` for now.
    pub(super) fn knows(&self, satellite: SatelliteId) -> bool {
        let near = self.near;
        near.is_some_and(|time| self.store.select(satellite, time).is_some())
    }

    /// Takes over where vector tracking has got to at `tick`.
    pub(super) fn follow(&mut self, tick: u64, state: &NavState) {
        self.place = Some(Place {
            position_ecef_m: state.position_ecef_m,
            velocity_ecef_mps: state.velocity_ecef_mps,
            clock_bias_m: state.clock_bias_m,
            clock_drift_mps: state.clock_drift_mps,
            tick,
            solved: true,
        });
        self.near = Some(state.time);
    }

    /// Samples were lost or repeated: time is only roughly known from here on.
    pub(super) fn time_jumped(&mut self) {
        if let Some(clock) = &mut self.clock {
            clock.trust = ClockTrust::Coarse;
        }
    }

    /// Whether `satellite` is known, from a fix and not from aiding alone, to be below the horizon.
    pub(super) fn is_below_horizon(&self, satellite: SatelliteId, tick: u64) -> bool {
        let solved = self.place.is_some_and(|p| p.solved);
        let expected = self.expected(satellite, tick).filter(|_| solved);
        expected.is_some_and(|e| e.look.elevation_rad < -HORIZON_MARGIN_RAD)
    }

    /// What is expected of a satellite, where time, place and ephemeris are known.
    fn expected(&self, satellite: SatelliteId, tick: u64) -> Option<Expected> {
        let place = self.place?;
        let since_s = (tick as f64 - place.tick as f64) / self.sample_rate_hz;
        let ahead_m = place.clock_bias_m + place.clock_drift_mps * since_s;
        let time = self.clock?.at(tick) - ahead_m / SPEED_OF_LIGHT_MPS;
        let ephemeris = self.store.select(satellite, time)?;
        let receiver = ReceiverState {
            time,
            position_ecef_m: place.position_ecef_m,
            velocity_ecef_mps: place.velocity_ecef_mps,
            clock_drift_mps: place.clock_drift_mps,
        };
        predict(ephemeris, &receiver).ok()
    }

    /// Errors beyond tracking noise are those of real signals.
    ///
    /// Until the ionosphere's parameters are known its night-time delay stands in for it, with
    /// room for the day's.
    pub(super) fn model(&self) -> MeasurementModel {
        let errors = self.errors;
        let ionosphere_fraction = if self.ionosphere.is_some() {
            errors.ionosphere_fraction
        } else {
            UNKNOWN_IONOSPHERE_FRACTION
        };
        MeasurementModel {
            ionosphere: self
                .use_ionosphere
                .then(|| self.ionosphere.unwrap_or(NIGHT_IONOSPHERE)),
            troposphere: self.troposphere,
            elevation_mask_rad: self.mask_rad,
            errors: ErrorModel {
                ionosphere_fraction,
                ..errors
            },
        }
    }

    /// Finds position, velocity and time at `tick`.
    pub(super) fn navigate(&mut self, tick: u64, tracked: &mut [Tracked]) -> Navigated {
        self.set_clock_by_message(tick, tracked);
        let trust = self.clock.map(|c| c.trust);
        if trust == Some(ClockTrust::Coarse) {
            if let Some(found) = self.snapshot(tick, tracked) {
                if found.time_sigma_s < BIT_SAFE_SIGMA_S {
                    self.set_clock_by_bits(tick, tracked);
                }
                return self.result(tick, tracked, Some((found.solution, Source::Snapshot)));
            }
            return self.result(tick, tracked, None);
        }
        let mut navigated = self.least_squares(tick, tracked);
        if trust == Some(ClockTrust::Message)
            && let Some((solution, _)) = &navigated.fix
        {
            // The first fix sets the clock, and is made anew with it.
            let bias_m = solution.clock_bias_m;
            if let Some(clock) = &mut self.clock {
                clock.correct(bias_m);
            }
            navigated = self.least_squares(tick, tracked);
        }
        match &navigated.fix {
            Some((solution, _)) => self.settle(tick, solution),
            // Before the first fix the clock is not good enough to report pseudoranges.
            None if trust != Some(ClockTrust::Fix) => return self.result(tick, tracked, None),
            None => {}
        }
        navigated
    }

    /// Solution of this epoch's pseudoranges and range rates, without what does not fit.
    fn least_squares(&mut self, tick: u64, tracked: &[Tracked]) -> Navigated {
        let (raw, formed) = self.measurements(tick, tracked);
        let start = self
            .place
            .map_or_else(Vector3::zeros, |p| p.position_ecef_m);
        let time_s = tick as f64 / self.sample_rate_hz;
        let model = self.model();
        let solved = self
            .watch
            .epoch(time_s, &formed.measurements, &model, &start);
        let unsolved = Navigated {
            receive_time: self.clock.map(|c| c.at(tick)),
            dispositions: shape_dispositions(&raw, tracked),
            raw,
            ..Navigated::nothing()
        };
        match solved {
            Ok(Assured {
                solution,
                misfits,
                protection,
            }) => Navigated {
                fix: Some((solution, Source::LeastSquares)),
                misfits,
                protection,
                ..unsolved
            },
            Err(_) => unsolved,
        }
    }

    fn result(&self, tick: u64, tracked: &[Tracked], fix: Option<(Solution, Source)>) -> Navigated {
        let exact = self.clock.is_some_and(|c| c.trust == ClockTrust::Fix);
        let raw = if exact {
            self.measurements(tick, tracked).0
        } else {
            Vec::new()
        };
        Navigated {
            fix,
            receive_time: self.clock.filter(|_| exact).map(|c| c.at(tick)),
            dispositions: Vec::new(),
            raw,
            ..Navigated::nothing()
        }
    }

    /// The first transmit time decoded sets the clock to within the spread of travel times.
    fn set_clock_by_message(&mut self, tick: u64, tracked: &[Tracked]) {
        if self.clock.is_some_and(|c| c.trust != ClockTrust::Coarse) {
            return;
        }
        let Some(near) = self.near else { return };
        let latest = tracked
            .iter()
            .filter_map(|t| t.slot.transmit_time(&t.epoch, near))
            .max_by(|a, b| (*a - *b).total_cmp(&0.0));
        if let Some(latest) = latest {
            let time = latest + TYPICAL_TRAVEL_S;
            let clock = ReceiverClock::new(tick, time, ClockTrust::Message, self.sample_rate_hz);
            self.clock = Some(clock);
        }
    }

    fn settle(&mut self, tick: u64, solution: &Solution) {
        let velocity = solution.velocity.as_ref();
        let coarse = self.clock.is_some_and(|c| c.trust == ClockTrust::Coarse);
        self.place = Some(Place {
            position_ecef_m: solution.position_ecef_m,
            velocity_ecef_mps: velocity.map_or_else(Vector3::zeros, |v| v.velocity_ecef_mps),
            // A coarse clock is set anew below.
            clock_bias_m: if coarse { 0.0 } else { solution.clock_bias_m },
            tick,
            clock_drift_mps: velocity.map_or(0.0, |v| v.clock_drift_mps),
            solved: true,
        });
        self.near = Some(solution.gps_time());
        if let Some(clock) = &mut self.clock
            && clock.trust == ClockTrust::Coarse
        {
            *clock = ReceiverClock::new(
                tick,
                solution.gps_time(),
                ClockTrust::Coarse,
                self.sample_rate_hz,
            );
        }
    }

    /// Position and time from code phases and Dopplers alone, where time is known only roughly; the next
    /// one begins from there.
    pub(super) fn snapshot(&mut self, tick: u64, tracked: &[Tracked]) -> Option<SnapshotSolution> {
        let clock = self.clock.filter(|c| c.trust == ClockTrust::Coarse)?;
        let measurements: Vec<_> = tracked
            .iter()
            .map(|t| SnapshotMeasurement {
                satellite: t.slot.satellite,
                transmit_fraction_s: transmit_fraction_s(&t.epoch),
                doppler_hz: t.epoch.doppler_hz,
                code_variance_m2: code_variance_m2(&t.epoch),
                doppler_variance_hz2: t.epoch.doppler_variance_hz2,
            })
            .collect();
        let prior = Prior::new(clock.at(tick), self.place.map(|p| p.position_ecef_m));
        let solved = coarse_time::solve(
            &measurements,
            &self.store,
            &prior,
            &self.model(),
            EXCLUSION_FALSE_ALARM,
        );
        let found = solved.ok()?;
        self.settle(tick, &found.solution);
        Some(found)
    }

    /// Once a coarse-time solution is good to a few milliseconds, the bit boundaries, which leave
    /// every satellite at multiples of 20 ms, make the clock exact.
    fn set_clock_by_bits(&mut self, tick: u64, tracked: &[Tracked]) {
        let Some(mut clock) = self.clock else { return };
        let bit_s = 0.02;
        let offsets: Vec<f64> = tracked
            .iter()
            .filter_map(|t| {
                let periods = f64::from(t.epoch.periods_into_bit?);
                let expected = self.expected(t.slot.satellite, tick)?.transmit_time;
                let into_bit = periods * 1e-3 + transmit_fraction_s(&t.epoch);
                // A second holds a whole number of bits.
                let difference = into_bit - expected.fraction_s();
                Some((difference / bit_s - (difference / bit_s).round()) * bit_s)
            })
            .collect();
        // A channel may have its bits wrong: three quarters have to agree.
        let agreed = largest_agreement(&offsets);
        let enough = agreed.len() >= NEEDED && 4 * agreed.len() >= 3 * offsets.len();
        let mean = agreed.iter().sum::<f64>() / agreed.len() as f64;
        if enough && mean.abs() < 4.0 * BIT_SAFE_SIGMA_S {
            clock.time = clock.time + mean;
            clock.trust = ClockTrust::Fix;
            self.clock = Some(clock);
        }
    }

    /// Pseudoranges and range rates of all channels whose transmit time is known.
    fn measurements(&self, tick: u64, tracked: &[Tracked]) -> (Vec<RawMeasurement>, Formed) {
        let Some(clock) = self.clock else {
            return Default::default();
        };
        let receive_time = clock.at(tick);
        let raw: Vec<_> = tracked
            .iter()
            .filter(|t| matches!(t.epoch.lock, Lock::Code | Lock::Carrier))
            .filter(|t| !t.slot.channel.is_silent())
            .filter_map(|t| {
                let transmit_time = self.transmit_time(&clock, tick, t)?;
                Some(raw_measurement(
                    &t.epoch,
                    t.slot.satellite,
                    receive_time,
                    transmit_time,
                ))
            })
            .collect();
        let told = shape_dispositions(&raw, tracked);
        let both = raw.iter().zip(told);
        let believed: Vec<_> = both.filter_map(|(r, told)| weighted(r, told)).collect();
        let formed = form(receive_time, &believed, &self.store);
        (raw, formed)
    }

    /// Transmit time of a channel, by its message or, once there was a fix, by prediction.
    fn transmit_time(&self, clock: &ReceiverClock, tick: u64, t: &Tracked) -> Option<GpsTime> {
        let decoded = t.slot.transmit_time(&t.epoch, clock.at(tick));
        decoded.or_else(|| {
            let known = clock.trust == ClockTrust::Fix && self.place.is_some_and(|p| p.solved);
            let expected = self.expected(t.slot.satellite, tick).filter(|_| known)?;
            let fraction = transmit_fraction_s(&t.epoch);
            let milliseconds = (expected.transmit_time.fraction_s() - fraction) * 1e3;
            let whole = GpsTime::from_parts(
                expected.transmit_time.week(),
                i64::from(expected.transmit_time.second()),
                0.0,
            );
            Some(whole + (milliseconds.round() * 1e-3 + fraction))
        })
    }
}

/// Most of `offsets_s` that agree with one of them to [`BIT_AGREEMENT_S`].
fn largest_agreement(offsets_s: &[f64]) -> Vec<f64> {
    let agreeing = |with: &f64| -> Vec<f64> {
        let near = |o: &&f64| (*o - with).abs() < BIT_AGREEMENT_S;
        offsets_s.iter().filter(near).copied().collect()
    };
    let all = offsets_s.iter().map(agreeing);
    all.max_by_key(Vec::len).unwrap_or_default()
}
