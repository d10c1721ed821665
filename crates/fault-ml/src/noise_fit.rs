//! Fitting [`CorrelatedNoise`] to residuals, by moments.

use crate::error::within;
use crate::noise_model::{LARGEST_SHARE, TAIL_SCALE};
use crate::{CorrelatedNoise, MonitorError};

/// Fewest epochs of a satellite that a fit takes.
const FEWEST_EPOCHS: f64 = 100.0;

impl CorrelatedNoise {
    /// Fits the residuals (m) of fault-free satellites, one row each, taken every `interval_s`,
    /// with position and clock known and taken off.
    ///
    /// By moments: the decay of the autocovariance gives the Gauss-Markov part, what is missing at
    /// lag zero is white, the kurtosis of its differences is the tail's, and the scatter of the
    /// means beyond what a Gauss-Markov mean scatters is bias, whose tail is that of the kurtosis of the
    /// means. A time constant longer than about a fifth of the stretch cannot be told from a bias, and
    /// the few satellites of one stretch say little of the law of a bias: take many stretches.
    ///
    /// # Errors
    /// [`MonitorError::Value`] with fewer than two satellites, fewer than 100 epochs of one, or a
    /// number that is not finite.
    pub fn fit(residuals_m: &[&[f64]], interval_s: f64) -> Result<Self, MonitorError> {
        within("interval (s)", interval_s, (1e-3, 1e5), "0.001 to 1e5")?;
        check_rows(residuals_m)?;
        let shape = Autocovariance::of(residuals_m);
        let (markov_m2, lags) = shape.gauss_markov();
        let white_m2 = (shape.at(0) - markov_m2).max(0.0);
        let epochs = shape.shortest as f64;
        let means = || residuals_m.iter().map(|row| mean(row));
        // The mean of a Gauss-Markov process over T has the variance 2 sigma^2 tau / T, if T is long.
        let explained = (2.0 * lags / epochs).min(1.0) * markov_m2 + white_m2 / epochs;
        let square = square_mean(means());
        let bias_m2 = (square - explained).max(0.0);
        let noise = Self {
            bias_sigma_m: bias_m2.sqrt(),
            bias_tail_share: share_of_excess(fourth_cumulant(means(), square), 1.0, bias_m2),
            markov_sigma_m: markov_m2.sqrt(),
            markov_time_s: lags * interval_s,
            white_sigma_m: white_m2.sqrt(),
            tail_share: tail_share(residuals_m, white_m2),
        };
        noise.check()
    }
}

fn check_rows(residuals_m: &[&[f64]]) -> Result<(), MonitorError> {
    within(
        "satellites",
        residuals_m.len() as f64,
        (2.0, 1e6),
        "2 or more",
    )?;
    for row in residuals_m {
        within(
            "epochs",
            row.len() as f64,
            (FEWEST_EPOCHS, 1e9),
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
    Ok(())
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
    // Fourth cumulants add: two of the white part make that of a difference, the slow part none.
    share_of_excess(fourth_cumulant(differences(), square), 2.0, white_m2)
}

/// Fourth cumulant of values whose mean is zero and whose mean square is `square`.
fn fourth_cumulant(values: impl Iterator<Item = f64>, square: f64) -> f64 {
    square_mean(values.map(|v| v * v)) - 3.0 * square * square
}

/// Share of tail of which `parts` mixtures of the variance `variance_m2` have this fourth cumulant.
fn share_of_excess(cumulant: f64, parts: f64, variance_m2: f64) -> f64 {
    if variance_m2 <= 0.0 {
        return 0.0;
    }
    let excess = cumulant / (parts * variance_m2 * variance_m2);
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
        bias_tail_share: 0.03,
        markov_sigma_m: 0.5,
        markov_time_s: 20.0,
        white_sigma_m: 0.3,
        tail_share: 0.03,
    };

    fn rows_of(noise: &CorrelatedNoise, satellites: usize, epochs: usize) -> Vec<Vec<f64>> {
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
        let rows = rows_of(&NOISE, 60, 900);
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
        // The kurtosis of 2000 means of excess 3.2 scatters by about 0.8.
        let many = rows_of(&NOISE, 2000, 300);
        let many: Vec<&[f64]> = many.iter().map(Vec::as_slice).collect();
        let found = CorrelatedNoise::fit(&many, 1.0).unwrap();
        assert!((0.005..0.1).contains(&found.bias_tail_share), "{found:?}");
    }

    #[test]
    fn white_noise_has_no_slow_part_and_no_bias() {
        let white = CorrelatedNoise {
            bias_sigma_m: 0.0,
            markov_sigma_m: 0.0,
            tail_share: 0.0,
            ..NOISE
        };
        let rows = rows_of(&white, 10, 2000);
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
    fn too_little_is_refused() {
        assert!(CorrelatedNoise::fit(&[&[0.0; 200]], 1.0).is_err());
        assert!(CorrelatedNoise::fit(&[&[0.0; 20], &[0.0; 200]], 1.0).is_err());
    }
}
