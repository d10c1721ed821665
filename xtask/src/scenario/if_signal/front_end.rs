//! From rays to samples at the intermediate frequency: everything before the quantiser.

use std::sync::Arc;

use anyhow::Result;
use gnss_signal::sample::SampleDescription;

use super::filter::{HALF_BAND_REACH, HalfBand, LowPass, REACH};
use super::grid::{Grid, HALVES};
use super::interference::Interferer;
use super::modulate::{Modulator, Sampling};
use super::noise::{GROUP, Noise};
use super::planes::{Planes, Stagger};
use super::segment::Segment;
use super::shift::shift;
use super::synthesiser::ThermalNoise;
use crate::scenario::antenna::{Interference, Reception};

/// Ticks that a sample depends on before and after its own.
pub(super) const MARGIN_TICKS: i64 = (REACH + HALF_BAND_REACH + 2 * GROUP) as i64;

/// The front end, as long as a scene lasts.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FrontEnd {
    samples: SampleDescription,
    grid: Grid,
    scale: f64,
    filters: Option<(HalfBand, LowPass)>,
    noise: Option<Noise>,
    interferers: Vec<Interferer>,
}

/// What making samples needs and keeps for the next ones.
pub(super) struct Bench {
    modulator: Modulator,
    /// Signals twice a sample, and the two halves of them.
    halves: Planes,
    on_ticks: Planes,
    between: Planes,
    baseband: Planes,
    /// What leaves the front end, and its components as they are delivered.
    pub(super) received: Planes,
    pub(super) components: Vec<f32>,
}

impl FrontEnd {
    /// # Errors
    /// Where interference is impossible.
    pub(super) fn new(
        reception: &Reception,
        interference: Vec<Interference>,
        seed: u64,
        thermal: ThermalNoise,
    ) -> Result<Self> {
        let samples = reception.samples;
        let rate_hz = samples.sample_rate_hz;
        let grid = Grid {
            sample_rate_hz: rate_hz,
        };
        let bandwidth = reception.bandwidth_hz.map(|b| b / rate_hz);
        let filters = bandwidth.map(|b| (HalfBand::new(), LowPass::new(b)));
        let scale = amplitude_scale(&samples, filters.is_some());
        // Stream 0 is thermal noise.
        let interferers = interference.into_iter().zip(1..);
        let interferers = interferers
            .map(|(one, stream)| Interferer::new(one, grid, scale, Noise::new(seed, stream)));
        Ok(Self {
            samples,
            grid,
            scale,
            filters,
            noise: (thermal == ThermalNoise::White).then(|| Noise::new(seed, 0)),
            interferers: interferers.collect::<Result<_>>()?,
        })
    }

    /// Root mean square of a component of noise, and of signals with these C/N0 in sum (Hz).
    pub(super) fn rms(&self, cn0_sum_hz: f64) -> f64 {
        let noise_power = self.filters.as_ref().map_or(1.0, |f| f.1.noise_gain());
        (noise_power + 0.5 * self.scale.powi(2) * cn0_sum_hz).sqrt()
    }

    pub(super) fn bench(&self) -> Bench {
        let sampling = match self.filters {
            Some(_) => Sampling::Filtered,
            None => Sampling::Delivered,
        };
        Bench {
            modulator: Modulator::new(sampling, self.scale),
            halves: Planes::default(),
            on_ticks: Planes::default(),
            between: Planes::default(),
            baseband: Planes::default(),
            received: Planes::default(),
            components: Vec::new(),
        }
    }

    /// Makes `samples` from `tick` on; `segments` cover [`MARGIN_TICKS`] more on either side.
    pub(super) fn receive(
        &self,
        segments: &[Arc<Segment>],
        tick: i64,
        samples: usize,
        bench: &mut Bench,
        out: &mut Planes,
    ) {
        match &self.filters {
            Some(filters) => self.filtered(filters, segments, tick, samples, bench, out),
            None => self.unfiltered(segments, tick, samples, bench, out),
        }
        let frequency_hz = self.samples.intermediate_frequency_hz;
        if frequency_hz != 0.0 {
            let cycles = self.grid.cycles(frequency_hz, 2 * tick);
            shift(cycles, frequency_hz / self.samples.sample_rate_hz, out);
        }
    }

    fn unfiltered(
        &self,
        segments: &[Arc<Segment>],
        tick: i64,
        samples: usize,
        bench: &mut Bench,
        out: &mut Planes,
    ) {
        let first = floor_to_group(tick);
        let before = (tick - first) as usize;
        out.fit((before + samples).next_multiple_of(GROUP));
        bench.modulator.make(segments, HALVES * first, out);
        self.add_carriers(first, Stagger::Whole, out);
        self.add_noise(first, out);
        for plane in out.each() {
            plane.drain(..before);
        }
    }

    fn filtered(
        &self,
        (half_band, low_pass): &(HalfBand, LowPass),
        segments: &[Arc<Segment>],
        tick: i64,
        samples: usize,
        bench: &mut Bench,
        out: &mut Planes,
    ) {
        // Whole vectors of output read beyond the last sample.
        let first = floor_to_group(tick - REACH as i64);
        let before = (tick - first) as usize - REACH;
        let length = (before + samples.next_multiple_of(GROUP) + 2 * REACH).next_multiple_of(GROUP);
        let reach = HALF_BAND_REACH as i64;
        let Bench {
            modulator,
            halves,
            on_ticks,
            between,
            baseband,
            ..
        } = bench;
        let made = length + 2 * HALF_BAND_REACH;
        halves.fit(2 * made);
        modulator.make(segments, HALVES * (first - reach), halves);
        halves.deal(made, on_ticks, between);
        for (stagger, planes) in [
            (Stagger::Whole, &mut *on_ticks),
            (Stagger::Half, &mut *between),
        ] {
            self.add_carriers(first - reach, stagger, planes);
        }
        half_band.decimate(on_ticks, between, length, baseband);
        self.add_noise(first, baseband);
        low_pass.filter(baseband, before, samples, out);
    }

    fn add_carriers(&self, tick: i64, stagger: Stagger, planes: &mut Planes) {
        let widest_hz = match self.filters {
            Some(_) => self.samples.sample_rate_hz,
            None => f64::INFINITY,
        };
        for interferer in &self.interferers {
            interferer.add_carrier(tick, stagger, widest_hz, planes);
        }
    }

    fn add_noise(&self, tick: i64, planes: &mut Planes) {
        if let Some(noise) = &self.noise {
            noise.add(tick, 1.0, planes);
        }
        for interferer in &self.interferers {
            interferer.add_band(tick, planes);
        }
    }
}

fn floor_to_group(tick: i64) -> i64 {
    tick.div_euclid(GROUP as i64) * GROUP as i64
}

/// Amplitude of a signal over the square root of its C/N0 in Hz, where each component of the noise
/// at baseband has unit variance.
///
/// Complex samples: C = A^2, N0 = 2 / fs. Real ones are the real part of those: half the signal's
/// power, and half the noise's density where a filter keeps positive and negative frequencies
/// apart. Without a filter the two fold onto each other, so that the density stays and the signal
/// has to be twice as strong: N0 = 2 / fs, C = A^2 / 2.
fn amplitude_scale(samples: &SampleDescription, filtered: bool) -> f64 {
    let folds = !samples.format.is_complex() && !filtered;
    (if folds { 4.0 } else { 2.0 } / samples.sample_rate_hz).sqrt()
}
