//! Test support: correlator sums of one ideal signal in white noise.

use std::f64::consts::{PI, TAU};

use num_complex::Complex64;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::cn0;
use crate::{
    AcquisitionHit, CorrelatorBank, FrontEnd, Replica, SearchReport, SearchRequest, SignalError,
    SignalId, Taps,
};

/// A signal with constant acceleration, ideal triangle, bits of 20 periods.
#[derive(Debug, Clone)]
pub(super) struct IdealSignal {
    pub(super) signal: SignalId,
    pub(super) front_end: FrontEnd,
    pub(super) cn0_dbhz: f64,
    /// Code phase at tick 0, chips, counted from the start of a bit.
    pub(super) code_chips: f64,
    pub(super) doppler_hz: f64,
    pub(super) doppler_rate_hz_s: f64,
    /// The signal is absent from here on.
    pub(super) ends_s: f64,
    /// The carrier appears upside down.
    pub(super) mirrored: bool,
    pub(super) rng: ChaCha8Rng,
}

impl IdealSignal {
    pub(super) fn new(cn0_dbhz: f64, seed: u64) -> Self {
        Self {
            signal: SignalId::gps_l1_ca(5).unwrap(),
            front_end: FrontEnd {
                sample_rate_hz: 2.6e6,
                intermediate_frequency_hz: 0.0,
                complex: true,
            },
            cn0_dbhz,
            code_chips: 5_000.3,
            doppler_hz: 1_234.5,
            doppler_rate_hz_s: 0.5,
            ends_s: f64::INFINITY,
            mirrored: false,
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// Integral of the Doppler, cycles.
    pub(super) fn cycles_at(&self, t: f64) -> f64 {
        self.doppler_hz * t + 0.5 * self.doppler_rate_hz_s * t * t
    }

    /// Code phase, chips, unbounded.
    pub(super) fn chips_at(&self, t: f64) -> f64 {
        self.code_chips + 1.023e6 * t + self.cycles_at(t) / 1540.0
    }

    /// The bit on the air: a fixed pattern.
    pub(super) fn bit_at(&self, t: f64) -> f64 {
        let k = (self.chips_at(t) / 20_460.0).floor() as u64;
        if (k * 2_654_435_761) >> 13 & 1 == 1 {
            1.0
        } else {
            -1.0
        }
    }

    /// What acquisition would say, `code_error` chips and `doppler_error` off.
    pub(super) fn hit(&self, code_error: f64, doppler_error: f64) -> AcquisitionHit {
        AcquisitionHit {
            signal: self.signal,
            tick: 0,
            code_phase_chips: (self.code_chips + code_error).rem_euclid(1023.0),
            doppler_hz: self.doppler_hz + doppler_error,
            statistic: 10.0,
            threshold: 5.0,
            cn0_dbhz: self.cn0_dbhz,
        }
    }

    fn taps(&mut self, replica: &Replica) -> Taps {
        let fs = self.front_end.sample_rate_hz;
        let samples = (replica.end_tick - replica.start_tick) as f64;
        let (start, length) = (replica.start_tick as f64 / fs, samples / fs);
        let middle = start + length / 2.0;
        let code = replica.code_phase_chips + replica.code_rate_hz * length / 2.0;
        let error = (self.chips_at(middle) - code + 511.5).rem_euclid(1023.0) - 511.5;
        let replica_phase =
            replica.carrier_phase_cycles + replica.carrier_frequency_hz * length / 2.0;
        let sign = if self.mirrored { -1.0 } else { 1.0 };
        let phase = TAU * (sign * self.cycles_at(middle) - replica_phase);
        let doppler_hz = sign * (self.doppler_hz + self.doppler_rate_hz_s * middle);
        let x = PI * length * (doppler_hz - replica.carrier_frequency_hz);
        let sinc = if x == 0.0 { 1.0 } else { x.sin() / x };
        let present = replica.signal == self.signal && middle < self.ends_s;
        let snr = if present {
            cn0::ratio_hz(self.cn0_dbhz) * length
        } else {
            0.0
        };
        let peak = snr.sqrt() * sinc * self.bit_at(middle);
        let offsets = replica.tap_offsets.as_slice();
        let noise = self.noise(offsets);
        let sums: Vec<Complex64> = offsets
            .iter()
            .zip(noise)
            .map(|(offset, noise)| {
                let r = (1.0 - (error + offset).abs()).max(0.0);
                (Complex64::from_polar(peak * r, phase) + noise) * samples.sqrt()
            })
            .collect();
        Taps::new(&sums, samples as u32, 1.0)
    }

    /// Noise of unit variance whose taps correlate as the triangle does: the increments of a
    /// random walk over one chip.
    fn noise(&mut self, offsets: &[f64]) -> Vec<Complex64> {
        let mut points: Vec<f64> = offsets.iter().flat_map(|o| [*o, o + 1.0]).collect();
        points.sort_by(f64::total_cmp);
        let (mut at, mut walk) = (points[0], Complex64::default());
        let walks: Vec<Complex64> = points
            .iter()
            .map(|point| {
                let step = Complex64::new(self.gauss(), self.gauss());
                walk += step * ((point - at) / 2.0).sqrt();
                at = *point;
                walk
            })
            .collect();
        let walk_at = |point: f64| walks[points.partition_point(|p| *p < point)];
        offsets
            .iter()
            .map(|o| walk_at(o + 1.0) - walk_at(*o))
            .collect()
    }

    fn gauss(&mut self) -> f64 {
        StandardNormal.sample(&mut self.rng)
    }
}

impl CorrelatorBank for IdealSignal {
    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn advance_to(&mut self, tick: u64) -> Result<u64, SignalError> {
        Ok(tick)
    }

    fn oldest_tick(&self) -> u64 {
        0
    }

    fn correlate(&mut self, replicas: &[Replica], taps: &mut Vec<Taps>) -> Result<(), SignalError> {
        taps.clear();
        taps.extend(replicas.iter().map(|r| self.taps(r)));
        Ok(())
    }

    fn search(&mut self, _: &SearchRequest) -> Result<SearchReport, SignalError> {
        Ok(SearchReport {
            hits: vec![self.hit(0.0, 0.0)],
            best_missed: None,
            threshold: 5.0,
        })
    }
}
