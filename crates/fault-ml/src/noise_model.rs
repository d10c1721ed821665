//! Noise of real pseudoranges: a bias, a slow Gauss-Markov part, and white noise with tails.

use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use crate::MonitorError;
use crate::error::within;

/// Width of the tail over the core of the white part; its share is fitted, its width is not: a
/// fourth moment fixes one of the two.
const TAIL_SCALE: f64 = 3.0;
/// Fewest epochs of a satellite that a fit takes.
const FEWEST_EPOCHS: usize = 100;
/// Largest share of the tail: beyond it the kurtosis of the mixture falls again.
const LARGEST_SHARE: f64 = 0.1;

/// Parts of the noise of a pseudorange, independent of one another and between satellites.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrelatedNoise {
    /// Standard deviation of what stays over the whole stretch, m.
    pub bias_sigma_m: f64,
    /// Standard deviation of the Gauss-Markov part, m.
    pub markov_sigma_m: f64,
    /// Its correlation time, s.
    pub markov_time_s: f64,
    /// Standard deviation of the white part, m.
    pub white_sigma_m: f64,
    /// Share of white values from the tail, 0 to 0.1, three times as wide as the others.
    pub tail_share: f64,
}

impl CorrelatedNoise {
    /// Standard deviation of all parts together, m: what a monitor has to assume of a pseudorange.
    #[must_use]
    pub fn sigma_m(&self) -> f64 {
        self.bias_sigma_m
            .hypot(self.markov_sigma_m)
            .hypot(self.white_sigma_m)
    }

    /// This noise, if possible.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where a part is not.
    pub fn check(self) -> Result<Self, MonitorError> {
        let deviations = [self.bias_sigma_m, self.markov_sigma_m, self.white_sigma_m];
        for deviation in deviations {
            within("standard deviation (m)", deviation, (0.0, 1e6), "0 to 1e6")?;
        }
        within(
            "correlation time (s)",
            self.markov_time_s,
            (1e-3, 1e7),
            "0.001 to 1e7",
        )?;
        within(
            "tail share",
            self.tail_share,
            (0.0, LARGEST_SHARE),
            "0 to 0.1",
        )?;
        Ok(self)
    }

    /// Fits the residuals (m) of fault-free satellites, one row each, taken every `interval_s`,
    /// with position and clock known and taken off.
    ///
    /// By moments: the decay of the autocovariance gives the Gauss-Markov part, what is missing at
    /// lag zero is white, the kurtosis of its differences is the tail's, and the scatter of the
    /// means beyond what a Gauss-Markov mean scatters is bias. A time constant longer than about a
    /// fifth of the stretch cannot be told from a bias.
    ///
    /// # Errors
    /// [`MonitorError::Value`] with fewer than two satellites, fewer than 100 epochs of one, or a
    /// number that is not finite.
    pub fn fit(residuals_m: &[&[f64]], interval_s: f64) -> Result<Self, MonitorError> {
        within("interval (s)", interval_s, (1e-3, 1e5), "0.001 to 1e5")?;
        let satellites = residuals_m.len() as f64;
        within("satellites", satellites, (2.0, 1e6), "2 or more")?;
        for row in residuals_m {
            within(
                "epochs",
                row.len() as f64,
                (FEWEST_EPOCHS as f64, 1e9),
                "100 or more",
            )?;
            for residual in *row {
                within(
                    "residual (m)",
                    *residual,
                    (-1e9, 1e9),
                    "at most 1e9 either way",
                )?;
            }
        }
        let shape = Autocovariance::of(residuals_m);
        let (markov_m2, lags) = shape.gauss_markov();
        let white_m2 = (shape.at(0) - markov_m2).max(0.0);
        let epochs = shape.shortest as f64;
        let means = residuals_m.iter().map(|row| mean(row));
        // The mean of a Gauss-Markov process over T has the variance 2 sigma^2 tau / T, if T is long.
        let explained = (2.0 * lags / epochs).min(1.0) * markov_m2 + white_m2 / epochs;
        let bias_m2 = (square_mean(means) - explained).max(0.0);
        let noise = Self {
            bias_sigma_m: bias_m2.sqrt(),
            markov_sigma_m: markov_m2.sqrt(),
            markov_time_s: lags * interval_s,
            white_sigma_m: white_m2.sqrt(),
            tail_share: tail_share(residuals_m, white_m2),
        };
        noise.check()
    }

    /// Noise of `satellites` satellites, drawn from `random`, which also gives their biases.
    pub fn generator(&self, satellites: usize, random: &mut impl Rng) -> NoiseGenerator {
        let mut normal = || -> f64 { StandardNormal.sample(random) };
        let draw = |_| (self.bias_sigma_m * normal(), self.markov_sigma_m * normal());
        NoiseGenerator {
            noise: *self,
            parts_m: (0..satellites).map(draw).collect(),
        }
    }
}

/// Noise of some satellites, epoch after epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct NoiseGenerator {
    noise: CorrelatedNoise,
    /// Bias and Gauss-Markov value of every satellite, m.
    parts_m: Vec<(f64, f64)>,
}

impl NoiseGenerator {
    /// Moves on by `elapsed_s` and writes the noise (m) of every satellite into `values_m`.
    pub fn advance(&mut self, elapsed_s: f64, values_m: &mut [f64], random: &mut impl Rng) {
        let noise = self.noise;
        let decay = (-elapsed_s / noise.markov_time_s).exp();
        let drive_m = noise.markov_sigma_m * (1.0 - decay * decay).sqrt();
        let square = TAIL_SCALE * TAIL_SCALE;
        let core_m =
            noise.white_sigma_m / (1.0 - noise.tail_share + noise.tail_share * square).sqrt();
        for ((bias_m, markov_m), value_m) in self.parts_m.iter_mut().zip(values_m) {
            let [slow, white]: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(random));
            let wide = random.random::<f64>() < noise.tail_share;
            *markov_m = decay * *markov_m + drive_m * slow;
            let white_m = core_m * white * if wide { TAIL_SCALE } else { 1.0 };
            *value_m = *bias_m + *markov_m + white_m;
        }
    }
}

/// Autocovariance about each satellite's mean, averaged over satellites, by lag.
struct Autocovariance {
    by_lag: Vec<f64>,
    shortest: usize,
}

impl Autocovariance {
    fn of(rows: &[&[f64]]) -> Self {
        let shortest = rows.iter().map(|row| row.len()).min().unwrap_or(0);
        let lag = |lag: usize| {
            let products = rows.iter().map(|row| {
                let centre = mean(row);
                let pairs = row.iter().zip(row.iter().skip(lag));
                pairs.map(|(a, b)| (a - centre) * (b - centre)).sum::<f64>()
                    / (row.len() - lag) as f64
            });
            products.sum::<f64>() / rows.len() as f64
        };
        Self {
            by_lag: (0..shortest / 2).map(lag).collect(),
            shortest,
        }
    }

    fn at(&self, lag: usize) -> f64 {
        self.by_lag.get(lag).copied().unwrap_or(0.0)
    }

    /// Variance (m^2) and correlation time (lags) of the Gauss-Markov part.
    ///
    /// A line through the logarithm of the covariance at lags from one to where it has fallen to
    /// half; the line's value at lag zero is free of white noise. Taking off each mean has lowered
    /// all lags by the variance of that mean, which is put back.
    fn gauss_markov(&self) -> (f64, f64) {
        let first = self.at(1);
        // Less than a hundredth of the variance is not there.
        if first <= 0.01 * self.at(0) {
            return (0.0, 1.0);
        }
        let half = (2..self.by_lag.len()).find(|lag| self.at(*lag) < 0.5 * first);
        let last = half.unwrap_or(self.by_lag.len()).max(3);
        let points = (1..last).filter(|lag| self.at(*lag) > 0.0);
        let (mut n, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for lag in points {
            let (x, y) = (lag as f64, self.at(lag).ln());
            n += 1.0;
            sx += x;
            sy += y;
            sxx += x * x;
            sxy += x * y;
        }
        let spread = n * sxx - sx * sx;
        let slope = if spread > 0.0 {
            (n * sxy - sx * sy) / spread
        } else {
            -1.0
        };
        let lags = (-1.0 / slope.min(-1e-6)).min(self.shortest as f64);
        let intercept = ((sy - slope * sx) / n).exp();
        let lost = (2.0 * lags / self.shortest as f64).min(0.5);
        (
            (intercept / (1.0 - lost)).min(self.at(0) / (1.0 - lost)),
            lags,
        )
    }
}

/// Share of the tail that gives the differences of successive residuals their kurtosis.
fn tail_share(rows: &[&[f64]], white_m2: f64) -> f64 {
    let differences = || {
        rows.iter()
            .flat_map(|row| row.windows(2).map(|w| w[1] - w[0]))
    };
    let square = square_mean(differences());
    if white_m2 <= 0.0 || square <= 0.0 {
        return 0.0;
    }
    let fourth = differences().map(|d| d.powi(4)).sum::<f64>() / differences().count() as f64;
    // Fourth cumulants add: two of the white part make that of a difference, the slow part none.
    let excess = (fourth - 3.0 * square * square) / (2.0 * white_m2 * white_m2);
    let (mut low, mut high) = (0.0, LARGEST_SHARE);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if mixture_excess(middle) < excess {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Excess kurtosis of the mixture: 3 (1 - p + p s^4) / (1 - p + p s^2)^2 - 3.
fn mixture_excess(share: f64) -> f64 {
    let square = TAIL_SCALE * TAIL_SCALE;
    let fourth = 1.0 - share + share * square * square;
    3.0 * fourth / (1.0 - share + share * square).powi(2) - 3.0
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn square_mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, n), x| (sum + x * x, n + 1.0));
    sum / count
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const NOISE: CorrelatedNoise = CorrelatedNoise {
        bias_sigma_m: 2.0,
        markov_sigma_m: 0.5,
        markov_time_s: 20.0,
        white_sigma_m: 0.3,
        tail_share: 0.03,
    };

    fn rows(noise: &CorrelatedNoise, satellites: usize, epochs: usize) -> Vec<Vec<f64>> {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut generator = noise.generator(satellites, &mut random);
        let mut rows = vec![Vec::new(); satellites];
        let mut values = vec![0.0; satellites];
        for _ in 0..epochs {
            generator.advance(1.0, &mut values, &mut random);
            for (row, value) in rows.iter_mut().zip(&values) {
                row.push(*value);
            }
        }
        rows
    }

    #[test]
    fn a_fit_finds_what_was_put_in() {
        let rows = rows(&NOISE, 60, 900);
        let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        let found = CorrelatedNoise::fit(&rows, 1.0).unwrap();
        // 60 biases: 1/sqrt(120) = 9 % of their deviation. 60 x 900 / 40 = 1350 independent slow
        // values: 2 % of their deviation, about 5 % of the time constant. White: 54 000 values but
        // after a difference of covariances. Three standard deviations of each, and as much again
        // for the fourth moment.
        let near = |a: f64, b: f64, share: f64| assert!((a / b - 1.0).abs() < share, "{found:?}");
        near(found.bias_sigma_m, NOISE.bias_sigma_m, 0.3);
        near(found.markov_sigma_m, NOISE.markov_sigma_m, 0.08);
        near(found.markov_time_s, NOISE.markov_time_s, 0.2);
        near(found.white_sigma_m, NOISE.white_sigma_m, 0.08);
        near(found.tail_share, NOISE.tail_share, 0.5);
    }

    #[test]
    fn white_noise_has_no_slow_part_and_no_bias() {
        let white = CorrelatedNoise {
            bias_sigma_m: 0.0,
            markov_sigma_m: 0.0,
            tail_share: 0.0,
            ..NOISE
        };
        let rows = rows(&white, 10, 2000);
        let rows: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
        let found = CorrelatedNoise::fit(&rows, 1.0).unwrap();
        assert!(
            found.bias_sigma_m < 0.02 && found.markov_sigma_m < 0.06,
            "{found:?}"
        );
        // 20 000 values: 0.5 % of the deviation; the excess kurtosis scatters by 0.05, a share of
        // 0.0003.
        assert!(
            (found.white_sigma_m - 0.3).abs() < 0.01 && found.tail_share < 0.002,
            "{found:?}"
        );
    }

    #[test]
    fn the_parts_add_up() {
        assert!((NOISE.sigma_m() - (4.0f64 + 0.25 + 0.09).sqrt()).abs() < 1e-12);
        assert!(CorrelatedNoise::fit(&[&[0.0; 200]], 1.0).is_err());
        assert!(CorrelatedNoise::fit(&[&[0.0; 20], &[0.0; 200]], 1.0).is_err());
    }
}
