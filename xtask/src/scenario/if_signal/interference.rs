//! Interference as plain numbers: tones, sweeps and noise, on and off on the sample.

use std::f64::consts::TAU;
use std::ops::Range;

use anyhow::{Result, ensure};

use super::filter::{LowPass, REACH};
use super::grid::Grid;
use super::noise::{GROUP, Noise};
use super::planes::Planes;
use super::planes::Stagger;
use crate::scenario::antenna::{Interference, Waveform};

/// Ticks after which level and sweep are taken up anew.
const RUN_TICKS: i64 = 256;

/// An interfering signal on the grid of samples.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Interferer {
    interference: Interference,
    grid: Grid,
    /// Amplitude of a component over the square root of power over noise density.
    scale: f64,
    /// Noise in a band, where it is that.
    band: Option<Band>,
}

#[derive(Debug, Clone, PartialEq)]
struct Band {
    noise: Noise,
    /// None where it is wider than what is sampled.
    filter: Option<LowPass>,
    width_hz: f64,
}

impl Interferer {
    /// # Errors
    /// Where a width, a period or a duty is impossible.
    pub(super) fn new(
        interference: Interference,
        grid: Grid,
        scale: f64,
        noise: Noise,
    ) -> Result<Self> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if let Some(pulses) = interference.pulses {
            ensure!(
                positive(pulses.period_s) && positive(pulses.duty) && pulses.duty <= 1.0,
                "pulses are {pulses:?}: expected a period above 0 s and a duty above 0 and at most 1"
            );
        }
        let band = match interference.waveform {
            Waveform::Broadband { width_hz } => {
                let fraction = width_hz / grid.sample_rate_hz;
                ensure!(
                    fraction >= 0.02 && fraction.is_finite(),
                    "width of interference is {width_hz} Hz: expected at least 0.02 of the sample rate"
                );
                Some(Band {
                    noise,
                    filter: (fraction < 1.0).then(|| LowPass::new(fraction)),
                    width_hz,
                })
            }
            Waveform::Chirp { period_s, .. } => {
                ensure!(
                    positive(period_s),
                    "a sweep takes {period_s} s: expected above 0"
                );
                None
            }
            Waveform::Tone { .. } => None,
        };
        Ok(Self {
            interference,
            grid,
            scale,
            band,
        })
    }

    /// Adds a tone or sweep to samples whose first one is `tick`. Where a filter follows, what is
    /// beyond the rate of half samples is left out: nothing of it would pass.
    pub(super) fn add_carrier(
        &self,
        tick: i64,
        stagger: Stagger,
        widest_hz: f64,
        planes: &mut Planes,
    ) {
        if self.band.is_some() {
            return;
        }
        let halves = |n: i64| 2 * n + stagger as i64;
        self.each_run(tick, stagger, planes.i.len(), |range, gain| {
            let begin = halves(tick + range.start as i64);
            let (cycles, step, bend) = self.carrier_at(begin);
            let middle_hz = (step + bend * range.len() as f64 / 2.0) * self.grid.sample_rate_hz;
            if middle_hz.abs() <= widest_hz {
                let (i, q) = (&mut planes.i[range.clone()], &mut planes.q[range]);
                let scale = self.scale * gain;
                oscillate([cycles, step, bend], scale, i, q);
            }
        });
    }

    /// Adds noise in a band to samples whose first one is `tick`, a multiple of [`GROUP`].
    pub(super) fn add_band(&self, tick: i64, planes: &mut Planes) {
        let Some(band) = &self.band else { return };
        // Samples that the filter needs on either side, in whole groups.
        let margin = REACH.next_multiple_of(GROUP);
        let length = planes.i.len();
        let mut white = Planes::default();
        white.clear(length + 2 * margin);
        band.noise.add(tick - margin as i64, 1.0, &mut white);
        let mut made = Planes::default();
        if let Some(filter) = &band.filter {
            filter.filter(&white, margin - REACH, length, &mut made);
        } else {
            made.i.extend_from_slice(&white.i[margin..margin + length]);
            made.q.extend_from_slice(&white.q[margin..margin + length]);
        }
        // Thermal noise has a deviation of 1; this one a density of its power over its width.
        let per_root = 1.0 / band.width_hz.sqrt();
        self.each_run(tick, Stagger::Whole, length, |range, gain| {
            let level = (gain * per_root) as f32;
            for n in range {
                planes.i[n] += level * made.i[n];
                planes.q[n] += level * made.q[n];
            }
        });
    }

    /// Calls `add` with every run of samples that are on, and the square root of its power over
    /// noise density, Hz^(1/2).
    fn each_run(
        &self,
        tick: i64,
        stagger: Stagger,
        samples: usize,
        mut add: impl FnMut(Range<usize>, f64),
    ) {
        // Sample n stands at half tick 2 (tick + n) + stagger.
        let index_of = |t_s: f64| {
            let half = self.grid.first_half(t_s);
            (half - stagger as i64 + 1).div_euclid(2) - tick
        };
        let (begin_s, end_s) = self.interference.level_dbhz.span_s();
        let last = index_of(end_s).min(samples as i64);
        let mut at = index_of(begin_s).max(0);
        while at < last {
            let half = 2 * (tick + at) + stagger as i64;
            let here_s = self.grid.elapsed_s(half).0;
            let mut stretch_begin = (tick + at).div_euclid(RUN_TICKS) * RUN_TICKS - tick;
            let mut stretch_end = stretch_begin + RUN_TICKS;
            for instant_s in self.interference.level_dbhz.instants_s() {
                let index = index_of(instant_s);
                if index > at {
                    stretch_end = stretch_end.min(index);
                } else {
                    stretch_begin = stretch_begin.max(index);
                }
            }
            let mut end = stretch_end.min(last);
            let on = self.pulse(here_s, begin_s, at, &index_of, &mut end);
            if let Waveform::Chirp { period_s, .. } = self.interference.waveform {
                let sweep = (here_s / period_s + 1e-9).floor();
                let next = index_of((sweep + 1.0) * period_s);
                end = end.min(next.max(at + 1));
            }
            if on {
                // In the middle of the stretch, whatever part of it is asked for.
                let middle_half = 2 * tick + stretch_begin + stretch_end + stagger as i64;
                let middle_s = self.grid.elapsed_s(middle_half).0;
                let level_dbhz = self.interference.level_dbhz.at(middle_s);
                add(at as usize..end as usize, 10f64.powf(level_dbhz / 20.0));
            }
            at = end;
        }
    }

    /// Whether a pulse is on at an instant; brings `end` to where that changes.
    fn pulse(
        &self,
        here_s: f64,
        begin_s: f64,
        at: i64,
        index_of: &impl Fn(f64) -> i64,
        end: &mut i64,
    ) -> bool {
        let Some(pulses) = self.interference.pulses else {
            return true;
        };
        let number = ((here_s - begin_s) / pulses.period_s).floor();
        // Rounding may leave the number of the pulse one too low.
        let mut on = false;
        for number in [number - 1.0, number, number + 1.0] {
            let rise_s = begin_s + number * pulses.period_s;
            let (rise, fall) = (
                index_of(rise_s),
                index_of(rise_s + pulses.duty * pulses.period_s),
            );
            on |= (rise..fall).contains(&at);
            for edge in [rise, fall] {
                if edge > at {
                    *end = edge.min(*end);
                }
            }
        }
        on
    }

    /// Phase (cycles), frequency (cycles per tick) and its growth per tick at a half tick.
    fn carrier_at(&self, half: i64) -> (f64, f64, f64) {
        let rate_hz = self.grid.sample_rate_hz;
        match self.interference.waveform {
            Waveform::Tone { offset_hz } => {
                (self.grid.cycles(offset_hz, half), offset_hz / rate_hz, 0.0)
            }
            Waveform::Chirp {
                from_hz,
                to_hz,
                period_s,
            } => {
                let elapsed_s = self.grid.elapsed_s(half).0;
                // A sample on the seam belongs to the sweep that begins.
                let sweeps = (elapsed_s / period_s + 1e-9).floor();
                let into_s = elapsed_s - sweeps * period_s;
                let slope = (to_hz - from_hz) / period_s;
                let whole = sweeps * (0.5 * (from_hz + to_hz) * period_s).rem_euclid(1.0);
                let cycles = whole + (from_hz + 0.5 * slope * into_s) * into_s;
                (
                    cycles,
                    (from_hz + slope * into_s) / rate_hz,
                    slope / (rate_hz * rate_hz),
                )
            }
            Waveform::Broadband { .. } => (0.0, 0.0, 0.0),
        }
    }
}

/// Adds an oscillation of `[phase, frequency, growth of it]`, in cycles and samples.
fn oscillate([cycles, step, bend]: [f64; 3], amplitude: f64, i: &mut [f32], q: &mut [f32]) {
    let phasor = |cycles: f64| {
        let (sine, cosine) = (TAU * (cycles - cycles.round())).sin_cos();
        (cosine, sine)
    };
    let turn = |a: (f64, f64), b: (f64, f64)| (a.0 * b.0 - a.1 * b.1, a.1 * b.0 + a.0 * b.1);
    let (mut now, mut next, more) = (phasor(cycles), phasor(step + 0.5 * bend), phasor(bend));
    for (i, q) in i.iter_mut().zip(q) {
        *i += (amplitude * now.0) as f32;
        *q += (amplitude * now.1) as f32;
        now = turn(now, next);
        next = turn(next, more);
    }
}
