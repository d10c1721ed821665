//! Code tracking error against truth at sample rates with and without an integer number of samples
//! per chip.

use std::fmt;

use anyhow::{Context, Result, ensure};
use gnss_nav::GpsTime;
use gnss_nav::lnav::LnavEncoder;
use gnss_signal::sample::{SampleDescription, SampleFormat};
use gnss_signal::tracking::{Channel, NoiseFloor, TrackingSettings};
use gnss_signal::{AcquisitionHit, CorrelatorBank, IfCorrelatorBank, InstructionSet, SignalId};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scenario::antenna::{Gain, Reception, Scene};
use crate::scenario::constellation;
use crate::scenario::emitter::PlainEmitter;
use crate::scenario::if_signal::Synthesiser;
use crate::scenario::message::Message;
use crate::scenario::path::{SignalPath, UniformPath};

/// Rates compared, Hz: 4 and 16 samples a chip exactly, beside rates next to them.
pub const RATES_HZ: [f64; 4] = [4.0e6, 4.092e6, 16.368e6, 16.369e6];
/// Each rate with an integer number of samples per chip, with the rate it is held against.
const INTEGER_AND_BESIDE_HZ: [(f64, f64); 2] = [(4.092e6, 4.0e6), (16.368e6, 16.369e6)];
/// Dopplers, Hz: nearly no code Doppler, and the usual.
pub const DOPPLERS_HZ: [f64; 2] = [20.0, 1000.0];
/// Front ends: two-sided bandwidth over the sample rate.
pub const BANDWIDTHS: [Option<f64>; 2] = [Some(0.8), None];
/// Navigation epochs a second.
const EPOCH_RATE_HZ: f64 = 10.0;
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
    /// Signal before that, s.
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
    let mut sums = Sums::default();
    for seed in 0..experiment.seeds {
        follow(experiment, case, seed, &mut sums)?;
    }
    sums.code_error()
}

#[derive(Debug, Default)]
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

    fn code_error(&self) -> Result<CodeError> {
        ensure!(self.epochs > 0, "nothing was judged");
        let n = self.epochs as f64;
        Ok(CodeError {
            rms_chips: (self.square / n).sqrt(),
            mean_chips: self.error / n,
            stated_chips: (self.variance / n).sqrt(),
            epochs: self.epochs,
        })
    }
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
        duration_s: experiment.settle_s + experiment.judged_s,
        emitters: vec![Box::new(emitter)],
        interference: vec![],
        gaps: vec![],
        seed,
    })
}

/// One run: tracks from an acquisition and adds the judged epochs.
fn follow(experiment: &Experiment, case: Case, seed: u64, sums: &mut Sums) -> Result<()> {
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
    let epochs = (experiment.settle_s + experiment.judged_s) * EPOCH_RATE_HZ;
    for k in 1..epochs as u64 {
        let tick = (k as f64 / EPOCH_RATE_HZ * rate_hz) as u64;
        bank.advance_to(tick)?;
        listen(&mut bank, &mut noise, tick)?;
        track(&mut bank, &mut channel, &noise, tick)?;
        let epoch = channel.epoch(tick);
        if k as f64 >= experiment.settle_s * EPOCH_RATE_HZ {
            let epoch = epoch.with_context(|| format!("{case:?}, seed {seed}: signal lost"))?;
            let sent = path.arrival(tick as f64 / rate_hz)?.code_time;
            let error = wrapped(epoch.code_phase_chips - chips(sent));
            sums.add(error, epoch.code_variance_chips2);
        }
    }
    Ok(())
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

/// Every case with its result.
#[derive(Debug, Clone)]
pub struct Table(pub Vec<(Case, CodeError)>);

/// Measures all rates, Dopplers and front ends, two at a time.
///
/// # Errors
/// As [`measure`].
pub fn table(experiment: &Experiment) -> Result<Table> {
    let mut cases = Vec::new();
    for bandwidth in BANDWIDTHS {
        for doppler_hz in DOPPLERS_HZ {
            cases.extend(RATES_HZ.map(|sample_rate_hz| Case {
                sample_rate_hz,
                bandwidth,
                doppler_hz,
            }));
        }
    }
    let half = cases.len() / 2;
    let rows = |cases: &[Case]| -> Result<Vec<_>> {
        cases
            .iter()
            .map(|c| Ok((*c, measure(experiment, *c)?)))
            .collect()
    };
    let (first, second) = std::thread::scope(|scope| {
        let other = scope.spawn(|| rows(&cases[half..]));
        (rows(&cases[..half]), other.join())
    });
    let second = second.map_err(|_| anyhow::anyhow!("a measurement panicked"))?;
    let mut all = first?;
    all.extend(second?);
    Ok(Table(all))
}

impl Table {
    /// The largest ratio, behind `bandwidth`, of the rms error at a rate with an integer number of
    /// samples per chip to that at the rate next to it, at the same Doppler.
    #[must_use]
    pub fn worst_ratio(&self, bandwidth: Option<f64>) -> Option<f64> {
        let rms = |sample_rate_hz, doppler_hz| {
            let case = Case {
                sample_rate_hz,
                bandwidth,
                doppler_hz,
            };
            let row = self.0.iter().find(|(c, _)| *c == case);
            row.map(|(_, error)| error.rms_chips)
        };
        let ratio = |integer_hz, beside_hz, doppler_hz| {
            Some(rms(integer_hz, doppler_hz)? / rms(beside_hz, doppler_hz)?)
        };
        let ratios = DOPPLERS_HZ.iter().flat_map(|&doppler_hz| {
            INTEGER_AND_BESIDE_HZ.map(|(integer, beside)| ratio(integer, beside, doppler_hz))
        });
        ratios.flatten().max_by(f64::total_cmp)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const CHIP_M: f64 = 299_792_458.0 / 1.023e6;
        writeln!(
            f,
            "| fs (MHz) | filter | Doppler (Hz) | rms (m) | mean (m) | stated (m) | epochs |"
        )?;
        write!(f, "|---|---|---|---|---|---|---|")?;
        for (case, error) in &self.0 {
            let filter = case
                .bandwidth
                .map_or("none".to_owned(), |b| format!("{b} fs"));
            write!(
                f,
                "\n| {} | {filter} | {} | {:.3} | {:+.3} | {:.3} | {} |",
                case.sample_rate_hz / 1e6,
                case.doppler_hz,
                error.rms_chips * CHIP_M,
                error.mean_chips * CHIP_M,
                error.stated_chips * CHIP_M,
                error.epochs
            )?;
        }
        for bandwidth in BANDWIDTHS {
            if let Some(ratio) = self.worst_ratio(bandwidth) {
                let filter = bandwidth.map_or("no filter".to_owned(), |b| format!("{b} fs"));
                write!(
                    f,
                    "\n{filter}: integer samples per chip over the rate beside: at most {ratio:.2}"
                )?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_code_error_is_what_the_channel_states() {
        // A wide loop, so that a short run holds many independent errors: 2 runs of 5 s at 5 Hz,
        // one in 0.1 s.
        let mut experiment = Experiment {
            settle_s: 2.0,
            judged_s: 5.0,
            seeds: 2,
            ..Experiment::default()
        };
        experiment.tracking.code_locked_hz = 5.0;
        experiment.tracking.code_unlocked_hz = 5.0;
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

    #[test]
    fn ratios_pair_each_integer_rate_with_its_neighbour() {
        let row = |sample_rate_hz, rms_chips| {
            let case = Case {
                sample_rate_hz,
                bandwidth: None,
                doppler_hz: 20.0,
            };
            let error = CodeError {
                rms_chips,
                mean_chips: 0.0,
                stated_chips: 0.0,
                epochs: 1,
            };
            (case, error)
        };
        let rows = vec![
            row(4.0e6, 1.0),
            row(4.092e6, 3.0),
            row(16.368e6, 1.0),
            row(16.369e6, 2.0),
        ];
        let table = Table(rows);
        assert_eq!(table.worst_ratio(None), Some(3.0));
        assert_eq!(table.worst_ratio(Some(0.8)), None);
    }
}
