//! A correlator bank over a scene.

use std::io;

use anyhow::Result;
use gnss_signal::{
    CorrelatorBank, FrontEnd, MAX_TAPS, Replica, SearchReport, SearchRequest, SignalError,
    SignalId, Taps,
};
use num_complex::Complex64;
use rand_chacha::ChaCha8Rng;

use super::code_correlation::CodeCorrelation;
use super::front_end::FrontEndModel;
use super::interference::{Heard, Interferer};
use super::level::Level;
use super::noise::{TapFactor, TapFactors, generator, normal, seeded};
use super::ray_track::{RayTracks, STRETCH_S};
use super::sample_grid::SampleGrid;
use super::signal_sum::SignalSum;
use super::timeline::Timeline;
use crate::scenario::antenna::Scene;

/// Samples that can still be correlated, s.
const HISTORY_S: f64 = 2.0;
/// Stretches whose signal power is remembered.
const POWERS: usize = 128;

/// Draws the correlator sums and acquisitions of a [`Scene`].
///
/// The same scene gives the same sums for the same replicas, in whatever order they are asked for.
pub struct CorrelatorLevelBank {
    pub(super) front_end: FrontEnd,
    pub(super) timeline: Timeline,
    pub(super) model: FrontEndModel,
    pub(super) tracks: Vec<RayTracks>,
    pub(super) seed: ChaCha8Rng,
    /// What the acquisition engine's own filter leaves of a signal; none: nobody searched yet.
    pub(super) band_gain: Option<f64>,
    interferers: Vec<Interferer>,
    level: Level,
    codes: Vec<Option<Box<Code>>>,
    /// Power of all signals by stretch, C/N0 in Hz.
    powers: Vec<(i64, f64)>,
    newest_tick: u64,
}

/// What is known of one code.
struct Code {
    signal: CodeCorrelation,
    noise: CodeCorrelation,
    factors: TapFactors,
}

/// Gain and noise over an interval, for one code.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reception {
    /// Sum of a sample over the square root of C/N0 in Hz.
    pub(super) scale: f64,
    /// Variance of a sum under noise, per sample.
    pub(super) density: f64,
    /// Mean square of the samples.
    pub(super) sample_power: f64,
}

impl CorrelatorLevelBank {
    /// A bank at the first sample of `scene`.
    ///
    /// # Errors
    /// Where a value of the scene is impossible, or a signal has none at its beginning.
    pub fn new(scene: Scene) -> Result<Self> {
        scene.check()?;
        let timeline = Timeline::new(&scene);
        let mut tracks: Vec<_> = scene.emitters.into_iter().map(RayTracks::new).collect();
        let mut power_hz = 0.0;
        for track in &mut tracks {
            power_hz += track.segment(0.0)?.0.nominal_power_hz();
        }
        let model = FrontEndModel::new(&scene.reception, power_hz)?;
        let variance = model.noise_power + model.power_scale * power_hz;
        let sources = scene.interference.into_iter();
        Ok(Self {
            front_end: scene.reception.samples.front_end(),
            timeline,
            interferers: sources.map(|s| Interferer::new(s, &model)).collect(),
            level: Level::new(scene.reception.gain, variance),
            model,
            tracks,
            seed: seeded(scene.seed),
            band_gain: None,
            codes: Vec::new(),
            powers: vec![(i64::MIN, 0.0); POWERS],
            newest_tick: 0,
        })
    }

    /// Power of all signals around `elapsed_s`, C/N0 in Hz.
    fn power_hz(&mut self, elapsed_s: f64) -> Result<f64> {
        let index = (elapsed_s / STRETCH_S).floor() as i64;
        let slot = index.rem_euclid(POWERS as i64) as usize;
        if self.powers[slot].0 != index {
            let middle_s = (index as f64 + 0.5) * STRETCH_S;
            self.powers[slot] = (index, total_power_hz(&mut self.tracks, middle_s)?);
        }
        Ok(self.powers[slot].1)
    }

    fn heard(&self, begin_s: f64, end_s: f64, doppler_hz: f64) -> Heard {
        let mut sum = Heard::default();
        for interferer in &self.interferers {
            let one = interferer.over(begin_s, end_s, doppler_hz);
            sum.power_hz += one.power_hz;
            sum.density += one.density;
        }
        sum
    }

    /// Variance of the components over an interval.
    fn variance(&self, power_hz: f64, heard: Heard) -> f64 {
        self.model.noise_power
            + self.model.power_scale * (power_hz * self.model.signal_part + heard.power_hz)
    }

    /// Gain and noise for `signal` at a Doppler over an interval.
    pub(super) fn reception(
        &mut self,
        signal: SignalId,
        begin_tick: u64,
        end_tick: u64,
        doppler_hz: f64,
    ) -> Result<Reception> {
        let begin_s = self.timeline.elapsed_s(begin_tick);
        let end_s = self.timeline.elapsed_s(end_tick);
        let middle_s = 0.5 * (begin_s + end_s);
        let heard = self.heard(begin_s, end_s, doppler_hz);
        let power_hz = self.power_hz(middle_s)?;
        let mut others_hz = power_hz;
        for track in self.tracks.iter_mut().filter(|t| t.signal == signal) {
            others_hz -= track.segment(middle_s)?.0.power_hz;
        }
        let variance = self.variance(power_hz, heard);
        let level = self.level.at(middle_s);
        let model = &self.model;
        let response = model.response(variance.sqrt(), level.sqrt());
        let gain = response.gain / variance.sqrt();
        let input =
            model.thermal_density + others_hz.max(0.0) * model.code_overlap_s + heard.density;
        Ok(Reception {
            scale: gain * model.amplitude_scale,
            density: model.components
                * (gain * gain * input + response.distortion * model.distortion_density),
            sample_power: model.components * response.power(),
        })
    }

    fn code(&mut self, signal: SignalId) -> &mut Code {
        let index = usize::from(signal.prn());
        if self.codes.len() <= index {
            self.codes.resize_with(index + 1, || None);
        }
        let model = &self.model;
        self.codes[index].get_or_insert_with(|| {
            Box::new(Code {
                signal: CodeCorrelation::new(signal, model.signal_lobe.as_ref()),
                noise: CodeCorrelation::new(signal, model.noise_lobe.as_ref()),
                factors: TapFactors::default(),
            })
        })
    }

    fn check_held(&self, start: u64, end: u64) -> Result<(), SignalError> {
        let (oldest, newest) = (self.oldest_tick(), self.newest_tick);
        if start >= oldest && start <= end && end <= newest {
            return Ok(());
        }
        Err(SignalError::NotHeld {
            start,
            end,
            oldest,
            newest,
        })
    }

    fn correlate_one(&mut self, replica: &Replica) -> Result<Taps> {
        let (start, end) = (replica.start_tick, replica.end_tick);
        let offsets = replica.tap_offsets.as_slice();
        let mut storage = [Complex64::default(); MAX_TAPS];
        let sums = &mut storage[..offsets.len()];
        let samples = end - start;
        if samples == 0 {
            return Ok(Taps::new(sums, 0, 0.0));
        }
        let doppler_hz = replica.carrier_frequency_hz - self.front_end.intermediate_frequency_hz;
        let reception = self.reception(replica.signal, start, end, doppler_hz)?;
        let samples_per_chip = self.front_end.sample_rate_hz / replica.code_rate_hz;
        let grid = SampleGrid::new(samples_per_chip, samples as f64);
        let mut taps_chips = [0.0; MAX_TAPS];
        for (tap, offset) in taps_chips.iter_mut().zip(offsets) {
            let lag = grid.map_or(0.0, |g| g.lag_chips(replica.code_phase_chips - offset));
            *tap = offset + lag;
        }
        self.add_signals(replica, &taps_chips, grid, reception.scale, sums)?;
        let mut generator = generator(&self.seed, replica.signal, start, samples);
        let deviation = self.model.power_deviation / (samples as f64).sqrt();
        let turn = -std::f64::consts::TAU * replica.carrier_phase_cycles;
        let scale = (reception.density * samples as f64).sqrt() * Complex64::cis(turn);
        let code = self.code(replica.signal);
        match grid {
            None => {
                code.factors
                    .get(&replica.tap_offsets, &code.noise)
                    .add(scale, &mut generator, sums)
            }
            Some(_) => TapFactor::new(&taps_chips[..offsets.len()], &code.noise).add(
                scale,
                &mut generator,
                sums,
            ),
        }
        let power = reception.sample_power * (1.0 + deviation * normal(&mut generator));
        Ok(Taps::new(sums, samples as u32, power))
    }

    fn add_signals(
        &mut self,
        replica: &Replica,
        taps_chips: &[f64; MAX_TAPS],
        grid: Option<SampleGrid>,
        scale: f64,
        sums: &mut [Complex64],
    ) -> Result<()> {
        if self.tracks.iter().all(|t| t.signal != replica.signal) {
            return Ok(());
        }
        self.code(replica.signal);
        let Some(Some(code)) = self.codes.get(usize::from(replica.signal.prn())) else {
            return Ok(());
        };
        let sum = SignalSum {
            timeline: &self.timeline,
            replica,
            correlation: &code.signal,
            taps_chips,
            // Behind a filter the signal has no edges.
            signal_grid: grid.filter(|_| self.model.signal_lobe.is_none()),
            intermediate_frequency_hz: self.front_end.intermediate_frequency_hz,
            scale,
        };
        for track in self
            .tracks
            .iter_mut()
            .filter(|t| t.signal == replica.signal)
        {
            sum.add(track, sums)?;
        }
        Ok(())
    }

    /// Sets the level for what comes up to the newest tick.
    fn control_level(&mut self) -> Result<()> {
        let newest_s = self.timeline.elapsed_s(self.newest_tick);
        while let Some((begin_s, end_s)) = self.level.due(newest_s) {
            let power_hz = self.power_hz(0.5 * (begin_s + end_s))?;
            let heard = self.heard(begin_s, end_s, 0.0);
            let variance = self.variance(power_hz, heard);
            self.level.follow(variance);
        }
        Ok(())
    }
}

fn total_power_hz(tracks: &mut [RayTracks], elapsed_s: f64) -> Result<f64> {
    let mut total = 0.0;
    for track in tracks {
        total += track.segment(elapsed_s)?.0.power_hz;
    }
    Ok(total)
}

/// What a scene cannot give, as an error of reading.
pub(super) fn unreadable(error: anyhow::Error) -> SignalError {
    SignalError::Read(io::Error::other(error))
}

impl CorrelatorBank for CorrelatorLevelBank {
    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn advance_to(&mut self, tick: u64) -> Result<u64, SignalError> {
        let end = tick.min(self.timeline.length_ticks);
        self.newest_tick = self.newest_tick.max(end);
        self.control_level().map_err(unreadable)?;
        Ok(self.newest_tick)
    }

    fn oldest_tick(&self) -> u64 {
        let history = (HISTORY_S * self.front_end.sample_rate_hz) as u64;
        self.newest_tick.saturating_sub(history)
    }

    fn correlate(&mut self, replicas: &[Replica], taps: &mut Vec<Taps>) -> Result<(), SignalError> {
        taps.clear();
        for replica in replicas {
            self.check_held(replica.start_tick, replica.end_tick)?;
            taps.push(self.correlate_one(replica).map_err(unreadable)?);
        }
        Ok(())
    }

    fn search(&mut self, request: &SearchRequest) -> Result<SearchReport, SignalError> {
        self.check_held(request.start_tick, request.start_tick)?;
        let held = self.newest_tick - request.start_tick;
        self.draw_search(request, held)
    }
}
