//! What the navigation filter makes of range rates once its gains have settled: how much noise it keeps,
//! and what of that the model of the dynamics and the common geometry do.
//!
//! Velocity and drift alone: pseudoranges, errors of metres every 20 ms, add nothing to rates known to
//! centimetres a second.

use gnss_nav::dynamics::ClockNoise;
use nalgebra::{DMatrix, DVector, Matrix4, Vector3, Vector4};

/// Updates after which gains no longer change: seconds, at 20 ms.
const SETTLED: usize = 2000;

/// One range rate: direction to the satellite, ECEF, and variance of an interval's measurement, (m/s)^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// Unit vector from the receiver to the satellite, ECEF.
    pub toward: Vector3<f64>,
    /// Variance, (m/s)^2.
    pub variance_m2_s2: f64,
}

impl Rate {
    /// d range rate / d (velocity, drift).
    fn gradient(&self) -> Vector4<f64> {
        Vector4::new(-self.toward.x, -self.toward.y, -self.toward.z, 1.0)
    }
}

/// How velocity and drift are taken to change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Model {
    /// Time between updates, s.
    pub interval_s: f64,
    /// Density of white acceleration, m^2/s^3, per axis.
    pub q_a_m2_per_s3: f64,
    /// The oscillator.
    pub clock: ClockNoise,
}

impl Model {
    /// Covariance by which velocity and drift change over an interval, m^2/s^2.
    fn change(&self) -> Matrix4<f64> {
        let (q, g) = (self.q_a_m2_per_s3, self.clock.random_walk_m2_per_s3);
        Matrix4::from_diagonal(&Vector4::new(q, q, q, g)) * self.interval_s
    }

    /// Variance of the mean drift over an interval about the drift, m^2/s^2: common to all rates.
    fn common_m2_s2(&self) -> f64 {
        self.clock.white_m2_per_s / self.interval_s
    }
}

/// Standard deviations of velocity along x, y and z (ECEF), m/s, or bandwidths, Hz.
pub type Axes = [f64; 3];

fn deviations(covariance: &Matrix4<f64>) -> Axes {
    [0, 1, 2].map(|axis| covariance[(axis, axis)].max(0.0).sqrt())
}

/// Information of one interval's rates.
fn information(rates: &[Rate]) -> Matrix4<f64> {
    let outer = |rate: &Rate| rate.gradient() * rate.gradient().transpose() / rate.variance_m2_s2;
    rates.iter().map(outer).sum()
}

/// Deviation of least squares of a single interval; `None` where the rates do not determine it.
#[must_use]
pub fn single_interval_sigma_mps(rates: &[Rate]) -> Option<Axes> {
    information(rates).try_inverse().map(|c| deviations(&c))
}

/// The filter of all rates with settled gains.
#[derive(Debug, Clone)]
pub struct SteadyFilter {
    /// Part of an error of the state that an update leaves.
    left: Matrix4<f64>,
    /// What an update makes of noise.
    noise: Matrix4<f64>,
    covariance: Matrix4<f64>,
}

impl SteadyFilter {
    /// Of `rates` every interval of `model`; `None` where they do not determine velocity and drift.
    #[must_use]
    pub fn new(rates: &[Rate], model: &Model) -> Option<Self> {
        let information = information(rates);
        let mut covariance = information.try_inverse()?;
        for _ in 0..SETTLED {
            let mut predicted = covariance + model.change();
            predicted[(3, 3)] += model.common_m2_s2();
            covariance = (predicted.try_inverse()? + information).try_inverse()?;
        }
        // K H, and K R K', by the settled covariance: K = P H' / R.
        Some(Self {
            left: Matrix4::identity() - covariance * information,
            noise: covariance * information * covariance,
            covariance,
        })
    }

    /// Deviation of velocity, m/s, if receiver and clock move as the model says.
    #[must_use]
    pub fn modelled_sigma_mps(&self) -> Axes {
        deviations(&self.covariance)
    }

    /// Deviation by noise of the measurements alone, m/s: of a receiver that hardly accelerates.
    #[must_use]
    pub fn noise_sigma_mps(&self) -> Axes {
        let settled = (0..SETTLED).fold(Matrix4::zeros(), |n, _| {
            self.left * n * self.left.transpose() + self.noise
        });
        deviations(&settled)
    }

    /// Response of each axis' velocity, update by update, to an impulse of that velocity.
    #[must_use]
    pub fn responses(&self) -> [Vec<f64>; 3] {
        [0, 1, 2].map(|axis| {
            let mut state = (Matrix4::identity() - self.left).column(axis).into_owned();
            let mut response = Vec::with_capacity(SETTLED);
            for _ in 0..SETTLED {
                response.push(state[axis]);
                state = self.left * state;
            }
            response
        })
    }
}

/// Deviation of velocity, m/s, if receiver and clock move as the model says, by least squares of the rates
/// of loops that share nothing: a Kalman filter a channel, told how the motion and the clock project onto it.
#[must_use]
pub fn separate_loops_sigma_mps(rates: &[Rate], model: &Model) -> Option<Axes> {
    let change = (model.q_a_m2_per_s3 + model.clock.random_walk_m2_per_s3) * model.interval_s;
    let loops = rates.iter().map(|rate| {
        let noise = rate.variance_m2_s2 + model.common_m2_s2();
        // The positive root of p = (p + change) noise / (p + change + noise).
        let variance = (change * change / 4.0 + change * noise).sqrt() - change / 2.0;
        (variance, variance / noise)
    });
    let (variances, gains): (Vec<f64>, Vec<f64>) = loops.unzip();
    let errors = errors_of_loops(rates, model, &DVector::from_vec(gains));
    let weigh = |(rate, variance): (&Rate, &f64)| Rate {
        variance_m2_s2: *variance,
        ..*rate
    };
    let weighed: Vec<Rate> = rates.iter().zip(&variances).map(weigh).collect();
    let solve = information(&weighed).try_inverse()?;
    let design = DMatrix::from_fn(4, rates.len(), |row, column| {
        let rate = &weighed[column];
        (solve * rate.gradient())[row] / rate.variance_m2_s2
    });
    let covariance = &design * errors * design.transpose();
    Some([0, 1, 2].map(|axis| covariance[(axis, axis)].sqrt()))
}

/// Covariance of the errors of loops of fixed gains: what the motion adds is common to them.
fn errors_of_loops(rates: &[Rate], model: &Model, gains: &DVector<f64>) -> DMatrix<f64> {
    let count = rates.len();
    let change = model.change();
    let moved = DMatrix::from_fn(count, count, |i, j| {
        rates[i].gradient().dot(&(change * rates[j].gradient()))
    });
    let noise = DMatrix::from_fn(count, count, |i, j| {
        let own = if i == j { rates[i].variance_m2_s2 } else { 0.0 };
        gains[i] * gains[j] * (own + model.common_m2_s2())
    });
    (0..SETTLED).fold(DMatrix::zeros(count, count), |errors, _| {
        let moved = &errors + &moved;
        let kept = |i: usize, j: usize| (1.0 - gains[i]) * (1.0 - gains[j]) * moved[(i, j)];
        DMatrix::from_fn(count, count, kept) + &noise
    })
}

#[cfg(test)]
mod tests {
    use super::super::noise_bandwidth::noise_bandwidth_hz;
    use super::*;

    /// Six satellites along the axes, alike: every axis is by itself, and the clock apart from them.
    fn axes(variance_m2_s2: f64) -> Vec<Rate> {
        let units = [Vector3::x(), Vector3::y(), Vector3::z()];
        let both = units.iter().flat_map(|u| [*u, -*u]);
        both.map(|toward| Rate {
            toward,
            variance_m2_s2,
        })
        .collect()
    }

    fn model(white_m2_per_s: f64) -> Model {
        Model {
            interval_s: 0.02,
            q_a_m2_per_s3: 1.0,
            clock: ClockNoise {
                white_m2_per_s,
                random_walk_m2_per_s3: 0.04,
            },
        }
    }

    #[test]
    fn gains_settle_to_those_of_a_random_walk() {
        let (change, noise): (f64, f64) = (0.02, 0.03 / 2.0);
        let variance = (change * change / 4.0 + change * noise).sqrt() - change / 2.0;
        let gain = variance / noise;
        let filter = SteadyFilter::new(&axes(0.03), &model(0.01)).unwrap();
        let single = single_interval_sigma_mps(&axes(0.03)).unwrap();
        let (left, kept) = (filter.modelled_sigma_mps(), filter.noise_sigma_mps());
        for (axis, response) in filter.responses().iter().enumerate() {
            // Two satellites an axis: closed forms, up to rounding.
            assert!((single[axis] - noise.sqrt()).abs() < 1e-12);
            assert!((left[axis] - variance.sqrt()).abs() < 1e-12);
            assert!((kept[axis] - (gain / (2.0 - gain) * noise).sqrt()).abs() < 1e-12);
            let hz = noise_bandwidth_hz(response, 0.02);
            assert!((hz - gain / (2.0 - gain) / 0.04).abs() < 1e-9);
            // Of white noise 2 B T is kept.
            assert!((kept[axis] / single[axis] - (2.0 * hz * 0.02).sqrt()).abs() < 1e-9);
        }
    }

    #[test]
    fn loops_that_share_nothing_take_the_clock_s_noise_for_their_own() {
        let shared = |white| {
            let filter = SteadyFilter::new(&axes(0.03), &model(white));
            filter.unwrap().modelled_sigma_mps()[0]
        };
        let separate = |white| separate_loops_sigma_mps(&axes(0.03), &model(white)).unwrap()[0];
        assert!(separate(0.0) > shared(0.0));
        // A loop told of the clock's noise follows the motion less; the filter of all sets it apart.
        assert!(separate(0.01) > 1.2 * separate(0.0));
        assert!((shared(0.01) / shared(0.0) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn too_few_rates_determine_nothing() {
        assert!(SteadyFilter::new(&axes(0.03)[..3], &model(0.0)).is_none());
        assert!(single_interval_sigma_mps(&axes(0.03)[..3]).is_none());
        assert!(separate_loops_sigma_mps(&axes(0.03)[..3], &model(0.0)).is_none());
    }
}
