//! Scenes and replicas for tests.

use anyhow::Result;
use gnss_nav::GpsTime;
use gnss_nav::lnav::LnavEncoder;
use gnss_signal::sample::{SampleDescription, SampleFormat};
use gnss_signal::{Replica, SignalId, TapOffsets};

use crate::scenario::antenna::{Arrival, Emitter, Gain, Ray, Reception, Scene};
use crate::scenario::constellation::nominal;
use crate::scenario::message::{BitStream, Message};
use crate::scenario::path::{SignalPath, UniformPath};

pub(super) const PRN: u8 = 5;

/// A reflection of the straight ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reflection {
    pub(super) amplitude: f64,
    pub(super) delay_chips: f64,
    pub(super) phase_cycles: f64,
}

/// A signal of constant Doppler, with reflections, between two instants.
pub(super) struct TestEmitter {
    pub(super) signal: SignalId,
    pub(super) cn0_dbhz: f64,
    pub(super) path: UniformPath,
    pub(super) bits: BitStream,
    pub(super) reflections: Vec<Reflection>,
    /// Instants at which it is switched on, off, on, ..
    pub(super) edges_s: Vec<f64>,
}

impl TestEmitter {
    pub(super) fn new(cn0_dbhz: f64, path: UniformPath, message: Message) -> Self {
        Self {
            signal: SignalId::gps_l1_ca(PRN).unwrap(),
            cn0_dbhz,
            path,
            bits: BitStream::new(message),
            reflections: Vec::new(),
            edges_s: Vec::new(),
        }
    }
}

impl Emitter for TestEmitter {
    fn signal(&self) -> SignalId {
        self.signal
    }

    fn edges_s(&self) -> &[f64] {
        &self.edges_s
    }

    fn rays(&mut self, elapsed_s: f64, within_s: f64, rays: &mut Vec<Ray>) -> Result<()> {
        let passed = self.edges_s.partition_point(|e| *e <= within_s);
        if passed % 2 == 1 {
            return Ok(());
        }
        let amplitude = 10f64.powf(self.cn0_dbhz / 20.0);
        let arrival = self.path.arrival(elapsed_s)?;
        rays.push(Ray { amplitude, arrival });
        rays.extend(self.reflections.iter().map(|r| Ray {
            amplitude: amplitude * r.amplitude,
            arrival: Arrival {
                code_time: arrival.code_time - r.delay_chips / 1.023e6,
                carrier_cycles: arrival.carrier_cycles + r.phase_cycles,
            },
        }));
        Ok(())
    }

    fn bit_sign(&mut self, second: GpsTime, index: usize) -> Result<f32> {
        self.bits.sign(second, index)
    }
}

/// Real navigation data of the satellite.
pub(super) fn lnav(time: GpsTime) -> Message {
    let ephemerides = nominal(time).unwrap();
    let own = ephemerides.iter().find(|e| e.satellite.prn == PRN).unwrap();
    Message::Lnav(Box::new(LnavEncoder::new(own).unwrap()))
}

pub(super) fn path(doppler_hz: f64) -> UniformPath {
    UniformPath {
        code_time: GpsTime::new(2350, 17.004_321_7),
        doppler_hz,
    }
}

/// A front end of a rate and kind; the intermediate frequency is zero where complex, a quarter of
/// the rate where real.
pub(super) fn reception(format: SampleFormat, rate_hz: f64, bandwidth: Option<f64>) -> Reception {
    Reception {
        samples: SampleDescription {
            format,
            sample_rate_hz: rate_hz,
            intermediate_frequency_hz: if format.is_complex() {
                0.0
            } else {
                rate_hz / 4.0
            },
            swap_iq: false,
        },
        bandwidth_hz: bandwidth.map(|b| b * rate_hz),
        bits: None,
        gain: Gain::Fixed,
    }
}

pub(super) fn scene(reception: Reception, duration_s: f64, emitters: Vec<TestEmitter>) -> Scene {
    let boxed = |e: TestEmitter| Box::new(e) as Box<dyn Emitter>;
    Scene {
        reception,
        duration_s,
        emitters: emitters.into_iter().map(boxed).collect(),
        interference: vec![],
        gaps: vec![],
        seed: 1,
    }
}

/// How a replica differs from the signal.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mismatch {
    /// Code phase of the signal over that of the replica, chips.
    pub(super) code_chips: f64,
    /// Frequency of the signal over that of the replica, Hz.
    pub(super) frequency_hz: f64,
    /// Phase of the signal over that of the replica in the first sample, cycles.
    pub(super) phase_cycles: f64,
}

/// A replica of `path` from sample `at` of the antenna, which is `tick` of those delivered.
pub(super) fn replica(
    reception: &Reception,
    path: &UniformPath,
    (tick, at): (u64, u64),
    ticks: u64,
    taps: TapOffsets,
    mismatch: Mismatch,
) -> Replica {
    let samples = &reception.samples;
    let elapsed_s = at as f64 / samples.sample_rate_hz;
    let arrival = path.arrival(elapsed_s).unwrap();
    let chips = arrival.code_time.fraction_s() * 1.023e6 - mismatch.code_chips;
    let if_hz = samples.intermediate_frequency_hz;
    let cycles = arrival.carrier_cycles + if_hz * elapsed_s - mismatch.phase_cycles;
    Replica {
        signal: SignalId::gps_l1_ca(PRN).unwrap(),
        start_tick: tick,
        end_tick: tick + ticks,
        code_phase_chips: chips.rem_euclid(1023.0),
        code_rate_hz: 1.023e6 * (1.0 + path.doppler_hz / 1_575.42e6),
        carrier_phase_cycles: cycles.rem_euclid(1.0),
        carrier_frequency_hz: if_hz + path.doppler_hz - mismatch.frequency_hz,
        tap_offsets: taps,
    }
}
