//! What a signal adds to the sums of a replica.
//!
//! The interval is cut at lost samples, at edges of the rays and at data bits. Over what is left a
//! ray has constant bit, amplitude and code lag (those of the middle; a lag that drifts by more
//! than 0.01 chip is averaged by Simpson's rule), and a phase that runs as a parabola:
//!
//! sum = g a d N R(lag + offset) exp(i phase at the middle) (s0 + i pi c s2),
//!
//! with s0 = sin(u) / u, u = pi f T, c the rate of the frequency, and s2 the second moment of time
//! under the same rotation. The last is exact to first order in pi c T^2 / 4 (0.04 at 20 ms and
//! 4 g). A negligible (pi f / fs)^2 / 6 parts the integral from the sum over samples.

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use gnss_signal::{MAX_TAPS, Replica};
use num_complex::Complex64;

use super::code_correlation::CodeCorrelation;
use super::ray_track::{RayTrack, RayTracks, STRETCH_S};
use super::sample_grid::SampleGrid;
use super::timeline::{Timeline, sample_at};
use crate::scenario::antenna::Emitter;

/// Chips in a bit of navigation data, and bits in a second.
const BIT_CHIPS: f64 = 20_460.0;
const BITS_PER_SECOND: i64 = 50;
const CODE_CHIPS: f64 = 1023.0;
/// Drift of the lag over a piece from which it is averaged, chips.
const DRIFT_CHIPS: f64 = 0.01;

/// One replica, ready to be summed with signals.
pub(super) struct SignalSum<'a> {
    pub(super) timeline: &'a Timeline,
    pub(super) replica: &'a Replica,
    pub(super) correlation: &'a CodeCorrelation,
    /// Where the taps act, chips; those of the replica unless chips stand still on the samples.
    pub(super) taps_chips: &'a [f64; MAX_TAPS],
    /// The grid on which the signal's own chips stand still, where they do.
    pub(super) signal_grid: Option<SampleGrid>,
    /// Intermediate frequency, Hz.
    pub(super) intermediate_frequency_hz: f64,
    /// Sum of one sample over the square root of C/N0 in Hz.
    pub(super) scale: f64,
}

/// A run of delivered ticks, and how many samples were lost before it.
#[derive(Debug, Clone, Copy)]
struct Piece {
    begin: u64,
    end: u64,
    lost: u64,
}

impl Piece {
    /// Samples at the antenna up to the middle of the piece.
    fn middle(&self) -> f64 {
        self.lost as f64 + 0.5 * (self.begin + self.end - 1) as f64
    }
}

impl SignalSum<'_> {
    /// Adds what all rays of `tracks` leave to `sums`.
    pub(super) fn add(&self, tracks: &mut RayTracks, sums: &mut [Complex64]) -> Result<()> {
        let rate_hz = self.timeline.rate_hz;
        let longest = (STRETCH_S * rate_hz) as u64;
        let mut begin = self.replica.start_tick;
        while begin < self.replica.end_tick {
            let (lost, run_end) = self.timeline.run(begin);
            let first = begin + lost;
            // A sample meant to be that of an edge is off by rounding.
            let edge_s = tracks.next_edge_s((first as f64 + 1e-6) / rate_hz);
            let edge = sample_at(edge_s, rate_hz).max(first + 1) - lost;
            let end = self.replica.end_tick.min(run_end).min(edge);
            let end = end.min(begin + longest);
            let piece = Piece { begin, end, lost };
            let (segment, emitter) = tracks.segment(piece.middle() / rate_hz)?;
            for ray in &segment.rays {
                let origin = Origin {
                    middle_s: segment.middle_s,
                    second: segment.second,
                };
                self.add_ray(piece, ray, origin, emitter, sums)?;
            }
            begin = end;
        }
        Ok(())
    }

    /// Adds one ray, bit by bit.
    fn add_ray(
        &self,
        mut piece: Piece,
        ray: &RayTrack,
        origin: Origin,
        emitter: &mut dyn Emitter,
        sums: &mut [Complex64],
    ) -> Result<()> {
        let rate_hz = self.timeline.rate_hz;
        let chips_at = |tick: u64| {
            let elapsed_s = (tick + piece.lost) as f64 / rate_hz;
            ray.chips.at(elapsed_s - origin.middle_s)
        };
        let bit_of = |chips: f64| (chips / BIT_CHIPS).floor() as i64;
        let mut chips = chips_at(piece.begin);
        let (mut bit, last) = (bit_of(chips), bit_of(chips_at(piece.end - 1)));
        let end = piece.end;
        while bit < last {
            let left = ((bit + 1) as f64 * BIT_CHIPS - chips) / ray.chips.0[1] * rate_hz;
            let edge = (piece.begin + left.ceil().max(1.0) as u64).min(end - 1);
            piece.end = edge;
            self.add_piece(piece, ray, origin.middle_s, origin.bit(bit, emitter)?, sums);
            piece.begin = edge;
            chips = chips_at(edge);
            bit += 1;
        }
        piece.end = end;
        self.add_piece(piece, ray, origin.middle_s, origin.bit(bit, emitter)?, sums);
        Ok(())
    }

    /// Adds a ray over a piece of one bit.
    fn add_piece(
        &self,
        piece: Piece,
        ray: &RayTrack,
        origin_s: f64,
        bit: f64,
        sums: &mut [Complex64],
    ) {
        let (replica, rate_hz) = (self.replica, self.timeline.rate_hz);
        let samples = (piece.end - piece.begin) as f64;
        let duration_s = samples / rate_hz;
        let x_s = piece.middle() / rate_hz - origin_s;
        let into_s =
            (0.5 * (piece.begin + piece.end - 1) as f64 - replica.start_tick as f64) / rate_hz;

        let cycles = ray.cycles.at(x_s) - replica.carrier_phase_cycles
            + self.intermediate_frequency_hz / rate_hz * piece.middle()
            - replica.carrier_frequency_hz * into_s;
        let frequency_hz =
            ray.cycles.slope(x_s) + self.intermediate_frequency_hz - replica.carrier_frequency_hz;
        let turned = mean_rotation(frequency_hz, 2.0 * ray.cycles.0[2], duration_s);
        let (sin, cos) = (TAU * (cycles - cycles.floor())).sin_cos();
        let peak = turned
            * Complex64::new(cos, sin)
            * (self.scale * samples * bit * ray.amplitude.at(x_s));

        let chips = ray.chips.at(x_s);
        let mut lag = chips - replica.code_phase_chips - replica.code_rate_hz * into_s;
        lag -= CODE_CHIPS * (lag / CODE_CHIPS).round();
        if let Some(grid) = self.signal_grid {
            let begins = chips - ray.chips.slope(x_s) * 0.5 * (samples - 1.0) / rate_hz;
            lag -= grid.lag_chips(begins);
        }
        let drift = (ray.chips.slope(x_s) - replica.code_rate_hz) * duration_s;
        for (sum, offset) in sums.iter_mut().zip(self.taps_chips) {
            *sum += peak * self.correlation_over(lag + offset, drift);
        }
    }

    fn correlation_over(&self, lag: f64, drift: f64) -> f64 {
        let at = |lag| self.correlation.at(lag);
        if drift.abs() < DRIFT_CHIPS {
            return at(lag);
        }
        (at(lag - 0.5 * drift) + 4.0 * at(lag) + at(lag + 0.5 * drift)) / 6.0
    }
}

/// What the polynomials of a segment count from.
#[derive(Debug, Clone, Copy)]
struct Origin {
    middle_s: f64,
    second: gnss_nav::GpsTime,
}

impl Origin {
    /// Sign of a bit counted from the segment's second.
    fn bit(&self, bit: i64, emitter: &mut dyn Emitter) -> Result<f64> {
        let seconds = bit.div_euclid(BITS_PER_SECOND);
        let second = if seconds == 0 {
            self.second
        } else {
            self.second + seconds as f64
        };
        let index = bit.rem_euclid(BITS_PER_SECOND) as usize;
        Ok(f64::from(emitter.bit_sign(second, index)?))
    }
}

/// Mean of exp(2 pi i (f t + c t^2 / 2)) over `duration_s` around zero, to first order in c.
fn mean_rotation(frequency_hz: f64, rate_hz_s: f64, duration_s: f64) -> Complex64 {
    let u = PI * frequency_hz * duration_s;
    let (sinc, moment) = if u.abs() < 0.05 {
        let square = u * u;
        (
            1.0 - square / 6.0 * (1.0 - square / 20.0),
            1.0 / 3.0 - square / 10.0 * (1.0 - square / 16.8),
        )
    } else {
        let (sin, cos) = u.sin_cos();
        let sinc = sin / u;
        (sinc, sinc + 2.0 * (cos - sinc) / (u * u))
    };
    Complex64::new(
        sinc,
        PI * rate_hz_s * 0.25 * duration_s * duration_s * moment,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_is_the_mean_of_its_samples() {
        let duration = 0.02;
        for frequency in [0.0, 0.3, 0.79, 0.8, 20.0, -55.0, 333.0] {
            for rate in [0.0, 5.0, -200.0] {
                let steps = 20_000;
                let mean: Complex64 = (0..steps)
                    .map(|k| ((f64::from(k) + 0.5) / f64::from(steps) - 0.5) * duration)
                    .map(|t| Complex64::cis(TAU * (frequency * t + 0.5 * rate * t * t)))
                    .sum::<Complex64>()
                    / f64::from(steps);
                let found = mean_rotation(frequency, rate, duration);
                // Second order in the largest phase of the bend, 0.063 rad at 200 Hz/s.
                assert!((found - mean).norm() < 1e-3, "{frequency} {rate}");
                if rate == 0.0 {
                    // Rounding of the numeric mean.
                    assert!((found - mean).norm() < 1e-6, "{frequency}");
                }
            }
        }
    }
}
