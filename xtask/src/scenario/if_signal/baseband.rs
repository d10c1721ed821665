//! One satellite's code, bits and carrier, sample by sample at baseband.

use std::f64::consts::TAU;

use anyhow::{Result, ensure};
use gnss_nav::GpsTime;
use gnss_signal::ranging_code;

use crate::scenario::antenna::{Emitter, Ray};

/// Samples whose carrier is turned together.
pub(super) const LANES: usize = 16;
/// Chips that one block may span (a power of two, so that indexing needs no check).
const TABLE_CHIPS: usize = 4096;
/// Longest block, s: 2046 chips.
pub(super) const LONGEST_BLOCK_S: f64 = 2e-3;
/// Fraction bits of the code phase inside a block: rounding of the rate reaches 1e-9 chips.
const FRACTION_BITS: u32 = 48;

/// I and Q of consecutive samples, in separate arrays padded to whole [`LANES`].
#[derive(Debug, Clone, Default)]
pub(super) struct Planes {
    pub(super) i: Vec<f32>,
    pub(super) q: Vec<f32>,
}

impl Planes {
    pub(super) fn clear(&mut self, samples: usize) {
        for plane in [&mut self.i, &mut self.q] {
            plane.clear();
            plane.resize(samples.next_multiple_of(LANES), 0.0);
        }
    }
}

/// What a sample holds of the code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Sampling {
    /// Its value at the instant.
    Instant,
    /// Its mean over the sample's interval, so that edges keep their place between samples.
    Mean,
}

/// Adds one transmitter's rays to blocks of samples.
pub(super) struct Modulator {
    sampling: Sampling,
    code: &'static [i8; 1023],
    code_rate_hz: f64,
    periods_per_bit: u32,
    emitter: Box<dyn Emitter>,
    /// Amplitude of a component over the square root of C/N0 in Hz.
    scale: f64,
    begin: Vec<Ray>,
    end: Vec<Ray>,
    table: Box<[f32; TABLE_CHIPS]>,
}

impl Modulator {
    pub(super) fn new(emitter: Box<dyn Emitter>, scale: f64, sampling: Sampling) -> Self {
        let spec = emitter.signal().spec();
        Self {
            sampling,
            code: ranging_code(emitter.signal()),
            code_rate_hz: spec.code_rate_hz,
            periods_per_bit: spec.code_periods_per_bit,
            emitter,
            scale,
            begin: Vec::new(),
            end: Vec::new(),
            table: Box::new([0.0; TABLE_CHIPS]),
        }
    }

    /// Adds the signal to `planes`, whose first sample is `tick`.
    pub(super) fn add(
        &mut self,
        tick: i64,
        samples: usize,
        sample_rate_hz: f64,
        planes: &mut Planes,
    ) -> Result<()> {
        // The interval of a sample begins half a sample before it.
        let begins = match self.sampling {
            Sampling::Instant => 0.0,
            Sampling::Mean => 0.5,
        };
        let at_s = |tick: i64| (tick as f64 - begins) / sample_rate_hz;
        let (begin_s, end_s) = (at_s(tick), at_s(tick + samples as i64));
        let within_s = 0.5 * (begin_s + end_s);
        self.begin.clear();
        self.end.clear();
        self.emitter.rays(begin_s, within_s, &mut self.begin)?;
        self.emitter.rays(end_s, within_s, &mut self.end)?;
        for ray in 0..self.begin.len().min(self.end.len()) {
            let (start, end) = (self.begin[ray], self.end[ray]);
            let chips = (end.arrival.code_time - start.arrival.code_time) * self.code_rate_hz;
            ensure!(
                chips > 0.0 && chips < (TABLE_CHIPS / 2 + 32) as f64,
                "the code advances by {chips} chips over {samples} samples"
            );
            let amplitude = (self.scale * start.amplitude) as f32;
            let phase = self.fill_table(start.arrival.code_time, chips, amplitude)?;
            let code = CodePhase {
                phase: (phase * FRACTION).round() as u64,
                step: (chips / samples as f64 * FRACTION).round() as u64,
            };
            let first_cycles = start.arrival.carrier_cycles;
            let step_cycles = (end.arrival.carrier_cycles - first_cycles) / samples as f64;
            let carrier = Rotation {
                cycles: first_cycles + begins * step_cycles,
                step_cycles,
            };
            match self.sampling {
                Sampling::Instant => modulate(&self.table, code, carrier, planes, instant),
                Sampling::Mean => modulate(&self.table, code, carrier, planes, mean),
            }
        }
        Ok(())
    }

    /// Puts the chips from `time` on, with their bits and amplitude, into the table; returns the
    /// phase inside the first of them.
    fn fill_table(&mut self, time: GpsTime, chips: f64, amplitude: f32) -> Result<f64> {
        let since_second = time.fraction_s() * self.code_rate_hz;
        let first = since_second.floor();
        let mut second = GpsTime::from_parts(time.week(), time.second().into(), 0.0);
        let length = self.code.len();
        let per_second = (self.code_rate_hz) as usize;
        let mut at = (first as usize).min(per_second - 1);
        // Padding to whole lanes runs up to 16 samples on, less than a chip each.
        let wanted = (chips as usize + LANES + 2).min(TABLE_CHIPS);
        let mut filled = 0;
        while filled < wanted {
            let (period, chip) = (at / length, at % length);
            let sign = self
                .emitter
                .bit_sign(second, period / self.periods_per_bit as usize)?;
            let run = (length - chip).min(wanted - filled);
            let level = sign * amplitude;
            let to = &mut self.table[filled..filled + run];
            for (out, code) in to.iter_mut().zip(&self.code[chip..chip + run]) {
                *out = level * f32::from(*code);
            }
            filled += run;
            at += run;
            if at == per_second {
                at = 0;
                second = second + 1.0;
            }
        }
        Ok(since_second - first)
    }
}

const FRACTION: f64 = (1_u64 << FRACTION_BITS) as f64;

/// Code phase and rate, chips in fixed point.
#[derive(Debug, Clone, Copy)]
struct CodePhase {
    phase: u64,
    step: u64,
}

/// Carrier phase and rate, cycles.
#[derive(Debug, Clone, Copy)]
struct Rotation {
    cycles: f64,
    step_cycles: f64,
}

/// The chip at a phase.
fn instant(table: &[f32; TABLE_CHIPS], code: CodePhase) -> f32 {
    table[(code.phase >> FRACTION_BITS) as usize % TABLE_CHIPS]
}

/// The mean of the chips from a phase to the next (less than a chip on).
fn mean(table: &[f32; TABLE_CHIPS], code: CodePhase) -> f32 {
    let end = CodePhase {
        phase: code.phase.wrapping_add(code.step),
        ..code
    };
    let (first, last) = (instant(table, code), instant(table, end));
    let into = end.phase & ((1 << FRACTION_BITS) - 1);
    let share = (into as f32 / code.step as f32).min(1.0);
    first + (last - first) * share
}

/// Adds table chips times carrier to every sample.
fn modulate(
    table: &[f32; TABLE_CHIPS],
    mut code: CodePhase,
    carrier: Rotation,
    planes: &mut Planes,
    chip_at: impl Fn(&[f32; TABLE_CHIPS], CodePhase) -> f32,
) {
    let lane = |k: usize| (TAU * carrier.step_cycles * k as f64).sin_cos();
    let lane_cos: [f32; LANES] = std::array::from_fn(|k| lane(k).1 as f32);
    let lane_sin: [f32; LANES] = std::array::from_fn(|k| lane(k).0 as f32);
    let (step_sin, step_cos) = lane(LANES);
    let (mut sin, mut cos) = (TAU * carrier.cycles.rem_euclid(1.0)).sin_cos();
    let (i, q) = (
        planes.i.as_chunks_mut::<LANES>().0,
        planes.q.as_chunks_mut::<LANES>().0,
    );
    for (i, q) in i.iter_mut().zip(q) {
        let mut chips = [0.0; LANES];
        for chip in &mut chips {
            *chip = chip_at(table, code);
            code.phase = code.phase.wrapping_add(code.step);
        }
        let (c, s) = (cos as f32, sin as f32);
        for k in 0..LANES {
            i[k] += chips[k] * (c * lane_cos[k] - s * lane_sin[k]);
            q[k] += chips[k] * (s * lane_cos[k] + c * lane_sin[k]);
        }
        (sin, cos) = (
            sin * step_cos + cos * step_sin,
            cos * step_cos - sin * step_sin,
        );
    }
}

#[cfg(test)]
mod tests {
    use gnss_nav::constants::L1_HZ;
    use gnss_nav::lnav::LnavEncoder;

    use gnss_signal::SignalId;

    use super::*;
    use crate::scenario::constellation::nominal;
    use crate::scenario::emitter::PlainEmitter;
    use crate::scenario::message::Message;
    use crate::scenario::path::{SignalPath, UniformPath};

    /// Code, bit and carrier in `f64` at one sample, straight from the definition.
    fn ideal(path: &UniformPath, encoder: &LnavEncoder, elapsed_s: f64) -> (f64, f64, f64) {
        let arrival = path.arrival(elapsed_s).unwrap();
        let chips = arrival.code_time.fraction_s() * 1.023e6;
        let code = ranging_code(SignalId::gps_l1_ca(3).unwrap());
        let chip = f64::from(code[chips as usize % 1023]);
        let bit = if encoder.bit_at(arrival.code_time).unwrap() {
            -1.0
        } else {
            1.0
        };
        let (sin, cos) = (TAU * arrival.carrier_cycles).sin_cos();
        (chips.fract(), bit * chip * cos, bit * chip * sin)
    }

    #[test]
    fn every_sample_is_what_the_definition_says() {
        let code_time = GpsTime::new(2350, 17.998_765);
        let encoder = LnavEncoder::new(&nominal(code_time).unwrap()[2]).unwrap();
        for (rate_hz, doppler_hz) in [(4e6, 3210.0), (2.6e6, -4999.0), (16.368e6, 20.0)] {
            let path = UniformPath {
                code_time,
                doppler_hz,
            };
            let message = Message::Lnav(Box::new(encoder.clone()));
            let signal = SignalId::gps_l1_ca(3).unwrap();
            // 0 dB-Hz: an amplitude of 1.
            let source = Box::new(PlainEmitter::new(signal, 0.0, Box::new(path), message));
            let mut modulator = Modulator::new(source, 1.0, Sampling::Instant);
            let mut planes = Planes::default();
            let mut near_edges = 0;
            for block in 0..20_i64 {
                let samples = (rate_hz * 1.9e-3) as usize;
                let tick = block * samples as i64;
                planes.clear(samples);
                modulator.add(tick, samples, rate_hz, &mut planes).unwrap();
                for k in (0..samples).step_by(7) {
                    let elapsed_s = (tick + k as i64) as f64 / rate_hz;
                    let (into_chip, i, q) = ideal(&path, &encoder, elapsed_s);
                    // Nearer to an edge than 1e-6 chips (0.3 mm) either side may be right.
                    if (1e-6..1.0 - 1e-6).contains(&into_chip) {
                        // Single precision of the rotation.
                        assert!((f64::from(planes.i[k]) - i).abs() < 2e-6);
                        assert!((f64::from(planes.q[k]) - q).abs() < 2e-6);
                    } else {
                        near_edges += 1;
                    }
                }
            }
            assert!(near_edges < 50, "{near_edges} at {rate_hz}");
        }
    }

    #[test]
    fn blocks_of_any_length_give_the_same_samples() {
        let path = UniformPath {
            code_time: GpsTime::new(2350, 5.000_000_1),
            doppler_hz: L1_HZ * 1e-6,
        };
        let samples_in = |lengths: &[usize]| {
            let signal = SignalId::gps_l1_ca(8).unwrap();
            let message = Message::Unmodulated;
            let source = Box::new(PlainEmitter::new(signal, 0.0, Box::new(path), message));
            let (mut modulator, mut planes) = (
                Modulator::new(source, 1.0, Sampling::Instant),
                Planes::default(),
            );
            let (mut tick, mut all) = (-100, Vec::new());
            for &len in lengths {
                planes.clear(len);
                modulator.add(tick, len, 5e6, &mut planes).unwrap();
                all.extend_from_slice(&planes.i[..len]);
                tick += len as i64;
            }
            all
        };
        let (one, many) = (samples_in(&[9000]), samples_in(&[1, 4000, 999, 4000]));
        let different = one
            .iter()
            .zip(&many)
            .filter(|(a, b)| (**a - **b).abs() > 1e-5);
        assert_eq!(different.count(), 0);
    }
}
