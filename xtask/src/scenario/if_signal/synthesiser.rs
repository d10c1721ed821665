//! A stream of samples made from a scene.

use std::io;

use anyhow::Result;
use gnss_signal::sample::{SampleDescription, SampleSource};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::baseband::{LONGEST_BLOCK_S, Modulator, Planes, Sampling};
use super::filter::{HALF_LENGTH, LowPass, OVERSAMPLING, shift};
use super::quantise::Quantiser;
use crate::scenario::antenna::{Ray, Scene};

/// Makes the samples of a [`Scene`], a block of at most 2 ms at a time.
///
/// The same scene gives the same bytes, however they are read.
pub struct Synthesiser {
    description: SampleDescription,
    length_ticks: i64,
    block_ticks: i64,
    modulators: Vec<Modulator>,
    noise: ChaCha8Rng,
    filter: Option<LowPass>,
    quantiser: Quantiser,
    /// Next tick to make, and next to hand out (they differ by the filter's length).
    made: i64,
    out: i64,
    planes: Planes,
    bytes: Vec<u8>,
    taken: usize,
}

impl Synthesiser {
    /// A synthesiser at the first sample of `scene`.
    ///
    /// # Errors
    /// Where a value of the scene is impossible.
    pub fn new(scene: Scene) -> Result<Self> {
        scene.check()?;
        let samples = scene.reception.samples;
        let length_ticks = scene.length_ticks() as i64;
        let bandwidth = scene.reception.bandwidth_hz;
        let filter = bandwidth.map(|b| LowPass::new(b / samples.sample_rate_hz));
        let scale = amplitude_scale(&samples);
        let sampling = match filter {
            Some(_) => Sampling::Mean,
            None => Sampling::Instant,
        };
        let noise_power = filter.as_ref().map_or(1.0, LowPass::noise_gain);
        let mut emitters = scene.emitters;
        let mut signal_power = 0.0;
        for emitter in &mut emitters {
            let mut rays = Vec::new();
            emitter.rays(0.0, 0.0, &mut rays)?;
            let square = |ray: &Ray| (ray.amplitude * scale).powi(2) / 2.0;
            signal_power += rays.iter().map(square).sum::<f64>();
        }
        let rms = (noise_power + signal_power).sqrt();
        // The filter looks half its length ahead and back.
        let reach = if filter.is_some() {
            HALF_LENGTH as i64
        } else {
            0
        };
        Ok(Self {
            description: samples,
            length_ticks,
            block_ticks: (LONGEST_BLOCK_S * samples.sample_rate_hz) as i64,
            noise: ChaCha8Rng::seed_from_u64(scene.seed),
            filter,
            quantiser: Quantiser::new(samples.format, rms)?,
            made: -reach,
            out: -2 * reach,
            planes: Planes::default(),
            bytes: Vec::new(),
            taken: 0,
            modulators: emitters
                .into_iter()
                .map(|emitter| Modulator::new(emitter, scale, sampling))
                .collect(),
        })
    }

    /// Makes the bytes of the next block; none at the end.
    fn next_block(&mut self) -> Result<()> {
        self.bytes.clear();
        self.taken = 0;
        while self.bytes.is_empty() && self.out < self.length_ticks {
            let samples = self.block_ticks as usize;
            self.make(samples)?;
            self.emit(samples);
        }
        Ok(())
    }

    /// Signals, noise and filter over the next `samples` ticks.
    fn make(&mut self, samples: usize) -> Result<()> {
        let over = match self.filter {
            Some(_) => OVERSAMPLING,
            None => 1,
        };
        let rate_hz = self.description.sample_rate_hz * over as f64;
        let (tick, made) = (self.made * over as i64, samples * over);
        self.planes.clear(made);
        for modulator in &mut self.modulators {
            modulator.add(tick, made, rate_hz, &mut self.planes)?;
        }
        // The density of the noise is that of a deviation of 1 at the sample rate.
        let deviation = (over as f32).sqrt();
        let (i, q) = (&mut self.planes.i[..made], &mut self.planes.q[..made]);
        for (i, q) in i.iter_mut().zip(q) {
            let (a, b): (f32, f32) = (
                StandardNormal.sample(&mut self.noise),
                StandardNormal.sample(&mut self.noise),
            );
            *i += deviation * a;
            *q += deviation * b;
        }
        if let Some(filter) = &mut self.filter {
            filter.filter(samples, &mut self.planes);
        }
        self.made += samples as i64;
        Ok(())
    }

    /// Shifts and quantises what was made, from tick 0 to the end of the scene.
    fn emit(&mut self, samples: usize) {
        let description = self.description;
        let frequency = description.intermediate_frequency_hz / description.sample_rate_hz;
        if frequency != 0.0 {
            shift(frequency, self.out, samples, &mut self.planes);
        }
        let first = (-self.out).clamp(0, samples as i64) as usize;
        let end = (self.length_ticks - self.out).clamp(0, samples as i64) as usize;
        let complex = description.format.is_complex();
        for n in first..end {
            let (mut i, mut q) = (self.planes.i[n], self.planes.q[n]);
            if description.swap_iq {
                (i, q) = (q, i);
            }
            self.quantiser.push(i, &mut self.bytes);
            if complex {
                self.quantiser.push(q, &mut self.bytes);
            }
        }
        self.out += samples as i64;
        if self.out >= self.length_ticks {
            self.quantiser.finish(&mut self.bytes);
        }
    }
}

/// Amplitude of a signal over the square root of its C/N0 in Hz, where each component of the noise
/// has unit variance.
///
/// Complex samples: C = A^2, N0 = 2 / fs. Real ones: C = A^2 / 2, N0 = 2 / fs.
fn amplitude_scale(samples: &SampleDescription) -> f64 {
    let complex = samples.format.is_complex();
    (if complex { 2.0 } else { 4.0 } / samples.sample_rate_hz).sqrt()
}

impl SampleSource for Synthesiser {
    fn description(&self) -> SampleDescription {
        self.description
    }

    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.bytes.len() {
            self.next_block().map_err(io::Error::other)?;
        }
        let ready = &self.bytes[self.taken..];
        let len = ready.len().min(bytes.len());
        bytes[..len].copy_from_slice(&ready[..len]);
        self.taken += len;
        Ok(len)
    }
}
