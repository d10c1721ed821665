//! A made-up signal, tracked and held against its truth.

use anyhow::{Context, Result, bail, ensure};
use gnss_nav::GpsTime;
use gnss_nav::lnav::LnavEncoder;
use gnss_signal::sample::{SampleDescription, SampleFormat};
use gnss_signal::tracking::{Channel, Lock, NoiseFloor, TrackingSettings};
use gnss_signal::{AcquisitionHit, CorrelatorBank, IfCorrelatorBank, InstructionSet, SignalId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scenario::antenna::{Gain, Reception, Scene};
use crate::scenario::constellation;
use crate::scenario::emitter::PlainEmitter;
use crate::scenario::if_signal::Synthesiser;
use crate::scenario::message::Message;
use crate::scenario::path::{SignalPath, UniformPath};

/// Looks at the noise floor, 1/s.
const LOOKS_HZ: f64 = 10.0;
/// A code nobody sends here.
const NOISE_PRN: u8 = 37;
const PRN: u8 = 5;

/// How one signal is sent and followed.
#[derive(Debug, Clone, Copy)]
pub struct Experiment {
    /// C/N0 before filter and quantiser, dB-Hz.
    pub cn0_dbhz: f64,
    /// Judged signal of one seed, s.
    pub judged_s: f64,
    /// Signal before that, s; or more, up to where steady tracking begins.
    pub settle_s: f64,
    /// Independent runs, each with its own noise and code phase.
    pub seeds: u64,
    /// Tracking.
    pub tracking: TrackingSettings,
}

impl Default for Experiment {
    /// 45 dB-Hz, 8 runs of 20 s after 10 s, tracking as the receiver does.
    fn default() -> Self {
        Self {
            cn0_dbhz: 45.0,
            judged_s: 20.0,
            settle_s: 10.0,
            seeds: 8,
            tracking: TrackingSettings::default(),
        }
    }
}

impl Experiment {
    /// Signal that may be needed, s: tracking begins after at most two stretches of a second.
    fn duration_s(&self) -> f64 {
        self.settle_s + self.judged_s + 2.0
    }

    /// The same with another code loop, in and out of carrier lock.
    #[must_use]
    pub fn with_code_bandwidth(mut self, bandwidth_hz: f64) -> Self {
        self.tracking.code_locked_hz = bandwidth_hz;
        self.tracking.code_unlocked_hz = bandwidth_hz;
        self
    }
}

/// One front end and Doppler.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Case {
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Two-sided bandwidth over the sample rate.
    pub bandwidth: Option<f64>,
    /// Doppler, Hz.
    pub doppler_hz: f64,
}

/// Code error over all epochs of all seeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CodeError {
    /// Root mean square about the truth, chips.
    pub rms_chips: f64,
    /// Standard error of that, chips, by the scatter of the runs; infinite for one run.
    pub rms_deviation_chips: f64,
    /// Mean, chips; above zero: the tracked phase is ahead of the truth.
    pub mean_chips: f64,
    /// Root mean square the channel itself states, chips.
    pub stated_chips: f64,
    /// Epochs.
    pub epochs: usize,
}

/// Code error of `case`.
///
/// # Errors
/// Where the signal cannot be made or is not tracked.
pub fn measure(experiment: &Experiment, case: Case) -> Result<CodeError> {
    code_error(&runs(experiment, case)?)
}

/// Code error of the runs' means alone: of what stays the same over the judged signal.
///
/// # Errors
/// As [`measure`].
pub(super) fn measure_means(experiment: &Experiment, case: Case) -> Result<CodeError> {
    let runs = runs(experiment, case)?;
    let means: Vec<_> = runs.iter().map(Sums::mean).collect();
    code_error(&means)
}

fn runs(experiment: &Experiment, case: Case) -> Result<Vec<Sums>> {
    let seeds = 0..experiment.seeds;
    seeds.map(|seed| follow(experiment, case, seed)).collect()
}

/// Sums over the epochs of a run.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    error: f64,
    square: f64,
    variance: f64,
    epochs: usize,
}

impl Sums {
    fn add(&mut self, error_chips: f64, variance_chips2: f64) {
        self.error += error_chips;
        self.square += error_chips * error_chips;
        self.variance += variance_chips2;
        self.epochs += 1;
    }

    /// A run of the mean alone.
    fn mean(&self) -> Self {
        let n = self.epochs as f64;
        let mut mean = Self::default();
        mean.add(self.error / n, self.variance / n);
        mean
    }
}

/// Code error over runs of the same length.
fn code_error(runs: &[Sums]) -> Result<CodeError> {
    let total = |value: fn(&Sums) -> f64| runs.iter().map(value).sum::<f64>();
    let epochs = runs.iter().map(|run| run.epochs).sum::<usize>();
    ensure!(epochs > 0, "nothing was judged");
    let n = epochs as f64;
    let square = total(|run| run.square) / n;
    let scatter: f64 = runs
        .iter()
        .map(|run| (run.square / run.epochs as f64 - square).powi(2))
        .sum();
    let count = runs.len() as f64;
    let square_deviation = if runs.len() > 1 {
        (scatter / (count - 1.0) / count).sqrt()
    } else {
        f64::INFINITY
    };
    let rms = square.sqrt();
    Ok(CodeError {
        rms_chips: rms,
        rms_deviation_chips: 0.5 * square_deviation / rms,
        mean_chips: total(|run| run.error) / n,
        stated_chips: (total(|run| run.variance) / n).sqrt(),
        epochs,
    })
}

fn scene(experiment: &Experiment, case: Case, path: UniformPath, seed: u64) -> Result<Scene> {
    let ephemerides = constellation::nominal(path.code_time)?;
    let own = ephemerides.iter().find(|e| e.satellite.prn == PRN);
    let encoder = LnavEncoder::new(own.context("no such satellite")?)?;
    let message = Message::Lnav(Box::new(encoder));
    let signal = SignalId::gps_l1_ca(PRN)?;
    let emitter = PlainEmitter::new(signal, experiment.cn0_dbhz, Box::new(path), message);
    Ok(Scene {
        reception: Reception {
            samples: SampleDescription {
                format: SampleFormat::Ci8,
                sample_rate_hz: case.sample_rate_hz,
                intermediate_frequency_hz: 0.0,
                swap_iq: false,
            },
            bits: None,
            bandwidth_hz: case.bandwidth.map(|b| b * case.sample_rate_hz),
            gain: Gain::Fixed,
        },
        duration_s: experiment.duration_s(),
        emitters: vec![Box::new(emitter)],
        interference: vec![],
        gaps: vec![],
        seed,
    })
}

/// One run: tracks from an acquisition and sums the judged epochs.
fn follow(experiment: &Experiment, case: Case, seed: u64) -> Result<Sums> {
    let mut sums = Sums::default();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let path = UniformPath {
        code_time: GpsTime::new(2350, 100_000.0) + random.random_range(0.0..1.0),
        doppler_hz: case.doppler_hz,
    };
    let source = Synthesiser::new(scene(experiment, case, path, seed)?)?;
    let mut bank = IfCorrelatorBank::new(source, 1.5, InstructionSet::detect())?;
    let mut noise = NoiseFloor::new(SignalId::gps_l1_ca(NOISE_PRN)?, bank.front_end())?;
    let hit = acquisition(experiment, &path, &mut random)?;
    let mut channel = Channel::new(&hit, bank.front_end(), experiment.tracking.check()?);
    let rate_hz = case.sample_rate_hz;
    // One an integration, so that wide loops hide no error.
    let epoch_rate_hz = 1e3 / f64::from(experiment.tracking.integration_periods);
    let epochs = |duration_s: f64| (duration_s * epoch_rate_hz).round() as usize;
    let epochs_per_look = epochs(1.0 / LOOKS_HZ);
    let last = epochs(experiment.duration_s());
    for k in 1..last {
        let tick = (k as f64 / epoch_rate_hz * rate_hz) as u64;
        bank.advance_to(tick)?;
        if k % epochs_per_look == 1 {
            listen(&mut bank, &mut noise, tick)?;
        }
        track(&mut bank, &mut channel, &noise, tick)?;
        let steady = channel.epoch(tick).filter(|e| e.lock != Lock::PullIn);
        if let Some(epoch) = steady.filter(|_| k >= epochs(experiment.settle_s)) {
            let sent = path.arrival(tick as f64 / rate_hz)?.code_time;
            let error = wrapped(epoch.code_phase_chips - chips(sent));
            sums.add(error, epoch.code_variance_chips2);
        }
        if sums.epochs == epochs(experiment.judged_s) {
            return Ok(sums);
        }
    }
    bail!("{case:?}, seed {seed}: not tracked")
}

/// What acquisition leaves: up to a sixth of a chip and 10 Hz off.
fn acquisition(
    experiment: &Experiment,
    path: &UniformPath,
    random: &mut ChaCha8Rng,
) -> Result<AcquisitionHit> {
    let phase = chips(path.code_time) + random.random_range(-0.15..0.15);
    Ok(AcquisitionHit {
        signal: SignalId::gps_l1_ca(PRN)?,
        tick: 0,
        code_phase_chips: phase.rem_euclid(1023.0),
        doppler_hz: path.doppler_hz + random.random_range(-10.0..10.0),
        statistic: 0.0,
        threshold: 0.0,
        cn0_dbhz: experiment.cn0_dbhz,
    })
}

fn listen<B: CorrelatorBank>(bank: &mut B, noise: &mut NoiseFloor, tick: u64) -> Result<()> {
    let period = (bank.front_end().sample_rate_hz * 1e-3) as u64;
    for back in 1..=5 {
        if let Some(start) = tick.checked_sub(back * (period + 1)) {
            noise.measure(bank, start)?;
        }
    }
    Ok(())
}

fn track<B: CorrelatorBank>(
    bank: &mut B,
    channel: &mut Channel,
    noise: &NoiseFloor,
    tick: u64,
) -> Result<()> {
    let mut taps = Vec::new();
    while let Some(replica) = channel.replica().filter(|r| r.end_tick <= tick) {
        bank.correlate(&[replica], &mut taps)?;
        channel.update(&replica, taps.first().context("no sums")?, noise);
    }
    Ok(())
}

/// Code phase sent at a reading of the satellite's clock, chips in [0, 1023).
fn chips(time: GpsTime) -> f64 {
    (time.fraction_s() * 1.023e6).rem_euclid(1023.0)
}

/// A difference of code phases in the middle of its range, chips.
fn wrapped(chips: f64) -> f64 {
    (chips + 511.5).rem_euclid(1023.0) - 511.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_standard_error_is_by_the_scatter_of_the_runs() {
        let run = |error: f64| {
            let mut sums = Sums::default();
            sums.add(error, 4.0);
            sums.add(error, 4.0);
            sums
        };
        // Mean squares of 1, 4 and 4: mean 3, deviation sqrt(3), of the mean 1; half of that over
        // the rms of sqrt(3).
        let error = code_error(&[run(1.0), run(-2.0), run(2.0)]).unwrap();
        assert!((error.rms_chips - 3f64.sqrt()).abs() < 1e-12);
        assert!((error.rms_deviation_chips - 0.5 / 3f64.sqrt()).abs() < 1e-12);
        assert!((error.mean_chips - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!((error.stated_chips, error.epochs), (2.0, 6));
        // Without what differs within a run nothing is left of one that is to both sides.
        let mut sums = run(3.0);
        sums.add(-6.0, 4.0);
        assert_eq!(code_error(&[sums.mean()]).unwrap().rms_chips, 0.0);
        let alone = code_error(&[run(1.0)]).unwrap();
        assert_eq!(alone.rms_deviation_chips, f64::INFINITY);
    }

    #[test]
    fn the_code_error_is_what_the_channel_states() {
        // A wide loop, so that a short run holds many independent errors: 2 runs of 5 s at 5 Hz,
        // one in 0.1 s.
        let experiment = Experiment {
            settle_s: 2.0,
            judged_s: 5.0,
            seeds: 2,
            ..Experiment::default()
        }
        .with_code_bandwidth(5.0);
        let case = Case {
            sample_rate_hz: 4.0e6,
            bandwidth: Some(0.8),
            doppler_hz: 1000.0,
        };
        let error = measure(&experiment, case).unwrap();
        // 100 errors tell the rms to 7 %, the mean to a tenth of it.
        let ratio = error.rms_chips / error.stated_chips;
        assert!((0.7..1.4).contains(&ratio), "{error:?}");
        assert!(error.mean_chips.abs() < 0.5 * error.rms_chips, "{error:?}");
    }
}
