//! What closes the loops: a Kalman filter a channel, or the product's filter of all.

use anyhow::Result;
use gnss_nav::dynamics::ProcessNoise;
use gnss_nav::filter::{Covariance, FilterSettings, Gate, NavFilter, SequentialFilter};
use gnss_nav::{GpsTime, Measurement, NavState, SatelliteId, SatelliteState};
use nalgebra::SVector;

use super::sums::{INTERVAL_S, Measured, Replica};
use super::truth::{expected, model};

/// Variances at the start: of ranges, m^2, and of rates, (m/s)^2.
const START_M2: f64 = 1.0;
const START_M2_S2: f64 = 0.01;
/// Measurements further off than so many deviations are skipped: the product's gate.
const GATE_SIGMAS: f64 = 4.0;

/// Where replicas go for the next interval.
pub trait Loops {
    /// Replicas from now on.
    fn replicas(&self) -> Vec<Replica>;

    /// Takes what an interval that ends at `receive_time` measured.
    ///
    /// # Errors
    /// Where numbers fail.
    fn update(&mut self, receive_time: GpsTime, measured: &[Measured]) -> Result<()>;
}

/// A Kalman filter of range and rate a channel, sharing nothing.
#[derive(Debug, Clone)]
pub struct Scalar {
    channels: Vec<Channel>,
    process: ProcessNoise,
}

#[derive(Debug, Clone, Copy)]
struct Channel {
    replica: Replica,
    /// Variances of range and rate, and their covariance.
    range: f64,
    rate: f64,
    both: f64,
}

impl Scalar {
    /// Loops that start on their signals.
    #[must_use]
    pub fn new(
        state: &NavState,
        sky: &[(SatelliteId, SatelliteState)],
        receive_time: GpsTime,
        process: ProcessNoise,
    ) -> Self {
        let channels = sky.iter().map(|(_, satellite)| Channel {
            replica: replica(state, satellite, receive_time),
            range: 2.0 * START_M2,
            rate: 2.0 * START_M2_S2,
            both: 0.0,
        });
        Self {
            channels: channels.collect(),
            process,
        }
    }
}

impl Loops for Scalar {
    fn replicas(&self) -> Vec<Replica> {
        self.channels.iter().map(|c| c.replica).collect()
    }

    fn update(&mut self, _: GpsTime, measured: &[Measured]) -> Result<()> {
        for (channel, measured) in self.channels.iter_mut().zip(measured) {
            channel.predict(&self.process);
            channel.correct(measured);
        }
        Ok(())
    }
}

impl Channel {
    /// The receiver's acceleration along the line of sight and its clock, as the filter of all has them.
    fn predict(&mut self, process: &ProcessNoise) {
        let t = INTERVAL_S;
        let (clock, acceleration) = (&process.clock, &process.acceleration);
        let density = acceleration.horizontal_m2_per_s3 + clock.random_walk_m2_per_s3;
        self.replica.range_m += t * self.replica.rate_mps;
        self.range += t * (2.0 * self.both + t * self.rate)
            + density * t.powi(3) / 3.0
            + clock.white_m2_per_s * t;
        self.both += t * self.rate + density * t * t / 2.0;
        // A measured rate is the mean of an interval: white noise of frequency lies between.
        self.rate += density * t + clock.white_m2_per_s / t;
    }

    fn correct(&mut self, measured: &Measured) {
        let innovations = [
            measured.range_m - self.replica.range_m,
            measured.rate_mps - self.replica.rate_mps,
        ];
        let variances = [
            self.range + measured.range_m2,
            self.rate + measured.rate_m2_s2,
        ];
        let within =
            |k: usize| innovations[k] * innovations[k] <= GATE_SIGMAS.powi(2) * variances[k];
        let (range, rate) = (within(0), within(1));
        let before = self.replica;
        if range {
            self.take([self.range, self.both], variances[0], innovations[0]);
        }
        if rate {
            let gains = [self.both, self.rate];
            let moved = self.replica.rate_mps - before.rate_mps;
            let variance = self.rate + measured.rate_m2_s2;
            self.take(gains, variance, innovations[1] - moved);
        }
    }

    /// Takes a measurement of that innovation and variance, whose covariance with range and rate is
    /// `covariance`.
    fn take(&mut self, covariance: [f64; 2], variance: f64, innovation: f64) {
        let [range, rate] = covariance;
        self.replica.range_m += range / variance * innovation;
        self.replica.rate_mps += rate / variance * innovation;
        self.range -= range * range / variance;
        self.both -= range * rate / variance;
        self.rate -= rate * rate / variance;
    }
}

/// The product's filter, which steers all channels.
#[derive(Debug)]
pub struct Vector {
    filter: SequentialFilter,
    sky: Vec<(SatelliteId, SatelliteState)>,
    receive_time: GpsTime,
    white_m2_per_s: f64,
}

impl Vector {
    /// A filter that starts on the truth.
    ///
    /// # Errors
    /// Where the settings make no filter.
    pub fn new(
        state: &NavState,
        sky: &[(SatelliteId, SatelliteState)],
        receive_time: GpsTime,
        process_noise: ProcessNoise,
    ) -> Result<Self> {
        let variances = SVector::from_fn(|k, _| if k % 2 == 0 { START_M2 } else { START_M2_S2 });
        let settings = FilterSettings {
            process_noise,
            model: model(),
            gate: Gate::Sigmas(GATE_SIGMAS),
        };
        Ok(Self {
            filter: SequentialFilter::new(*state, Covariance::from_diagonal(&variances), settings)?,
            sky: sky.to_vec(),
            receive_time,
            white_m2_per_s: process_noise.clock.white_m2_per_s,
        })
    }
}

impl Loops for Vector {
    fn replicas(&self) -> Vec<Replica> {
        let state = self.filter.state();
        let all = self.sky.iter();
        all.map(|(_, satellite)| replica(state, satellite, self.receive_time))
            .collect()
    }

    fn update(&mut self, receive_time: GpsTime, measured: &[Measured]) -> Result<()> {
        self.receive_time = receive_time;
        let to = self.filter.state().gps_time(receive_time);
        self.filter.predict(to)?;
        self.filter.loosen_drift(self.white_m2_per_s / INTERVAL_S)?;
        let measurements: Vec<Measurement> = self
            .sky
            .iter()
            .zip(measured)
            .map(|((satellite, state), measured)| Measurement {
                satellite: *satellite,
                receive_time,
                pseudorange_m: measured.range_m,
                range_rate_mps: measured.rate_mps,
                pseudorange_variance_m2: measured.range_m2,
                range_rate_variance_m2_s2: measured.rate_m2_s2,
                cn0_dbhz: 0.0,
                state: *state,
                user_range_accuracy_m: 0.0,
            })
            .collect();
        let innovations = self.filter.innovations(&measurements)?;
        self.filter.update(&innovations, &[])?;
        Ok(())
    }
}

fn replica(state: &NavState, satellite: &SatelliteState, receive_time: GpsTime) -> Replica {
    let (range_m, rate_mps) = expected(state, satellite, receive_time);
    Replica { range_m, rate_mps }
}
