//! The main job on an embedded default: make a signal, receive it, judge the position.

use std::fmt;
use std::time::Instant;

use anyhow::{Context, Result};
use gnss_nav::atmosphere::Klobuchar;
use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_nav::lnav::LnavEncoder;
use gnss_nav::prediction::{ReceiverState, predict};
use gnss_nav::{Ephemeris, Geodetic, GpsTime, SatelliteId};
use gnss_signal::sample::{SampleDescription, SampleFormat};
use gnss_signal::{IfCorrelatorBank, InstructionSet, SignalId};
use nalgebra::Vector3;
use receiver::pipeline::{Aiding, Settings, run};
use receiver::record::{Acquired, EventKind, PvtRecord, Record};

use crate::constellation;
use crate::scenario::antenna::{Emitter, Gain, Reception, Scene};
use crate::scenario::emitter::PlainEmitter;
use crate::scenario::if_signal::Synthesiser;
use crate::scenario::message::Message;
use crate::scenario::path::{Atmosphere, OrbitPath, ReceiverMotion};

/// Signal made, s.
const DURATION_S: f64 = 0.5;
/// Complex 8-bit samples at this rate, Hz.
const SAMPLE_RATE_HZ: f64 = 4e6;
/// Two-sided front-end bandwidth over the sample rate.
const BANDWIDTH: f64 = 0.8;
/// Satellites above this elevation send.
const MASK_DEG: f64 = 5.0;
/// What the receiver is told is wrong by this much: m in each of two directions, s.
const PRIOR_ERROR_M: f64 = 14e3;
const PRIOR_TIME_ERROR_S: f64 = 5.0;
/// Position error that fails the demo, m. Half a second at 38 to 50 dB-Hz leaves a few metres.
const LARGEST_ERROR_M: f64 = 20.0;

const IONOSPHERE: Klobuchar = Klobuchar {
    alpha: [1.2e-8, 7.5e-9, -6.0e-8, -6.0e-8],
    beta: [98_304.0, 32_768.0, -196_608.0, -65_536.0],
};

/// What was sent and what the receiver made of it.
#[derive(Debug, Clone)]
pub struct Demo {
    /// The receiver's true way.
    pub truth: ReceiverMotion,
    /// Satellites sent, with elevation (rad) and C/N0 (dB-Hz).
    pub sent: Vec<(SatelliteId, f64, f64)>,
    /// Satellites found.
    pub acquired: Vec<Acquired>,
    /// Every solution.
    pub solutions: Vec<PvtRecord>,
    /// Why there is none, where there is none.
    pub no_fix_reason: Option<String>,
    /// Signal made and received, s.
    pub signal_s: f64,
    /// Time it took, s.
    pub wall_s: f64,
}

/// Makes half a second of signal and receives it with rough aiding, all in memory.
///
/// # Errors
/// Where the signal cannot be made or the receiver fails.
pub fn demo(seed: u64) -> Result<Demo> {
    let begun = Instant::now();
    let truth = ReceiverMotion {
        start: GpsTime::new(2350, 392_400.25),
        position_ecef_m: Geodetic::from_degrees(52.3, 10.5, 120.0).to_ecef(),
        velocity_ecef_mps: Vector3::new(-6.0, 18.0, 4.0),
        clock_drift: 6e-7,
    };
    let ephemerides = constellation::nominal(truth.start)?;
    let sent = in_view(&ephemerides, &truth)?;
    let scene = scene(&ephemerides, &sent, &truth, seed)?;
    let bank = IfCorrelatorBank::new(Synthesiser::new(scene)?, 2.0, InstructionSet::detect())?;
    let settings = Settings {
        aiding: Aiding {
            ephemerides,
            ionosphere: Some(IONOSPHERE),
            position_ecef_m: Some(
                truth.position_ecef_m + Vector3::new(PRIOR_ERROR_M, -PRIOR_ERROR_M, 0.0),
            ),
            time: Some(truth.start + PRIOR_TIME_ERROR_S),
        },
        ..Settings::default()
    };
    let (mut acquired, mut solutions) = (Vec::new(), Vec::new());
    let outcome = run(bank, &settings, &mut |record| {
        match record {
            Record::Event(event) => {
                if let EventKind::Acquired(found) = event.kind {
                    acquired.push(found);
                }
            }
            Record::Pvt(pvt) => solutions.push(pvt),
            _ => {}
        }
        Ok(())
    })?;
    Ok(Demo {
        truth,
        sent,
        acquired,
        solutions,
        no_fix_reason: outcome.no_fix_reason,
        signal_s: outcome.signal_s,
        wall_s: begun.elapsed().as_secs_f64(),
    })
}

/// Satellites above the mask with elevation and a C/N0 that grows with it.
fn in_view(
    ephemerides: &[Ephemeris],
    truth: &ReceiverMotion,
) -> Result<Vec<(SatelliteId, f64, f64)>> {
    let state = ReceiverState {
        time: truth.start,
        position_ecef_m: truth.position_ecef_m,
        velocity_ecef_mps: truth.velocity_ecef_mps,
        clock_drift_mps: truth.clock_drift * SPEED_OF_LIGHT_MPS,
    };
    let mut sent = Vec::new();
    for ephemeris in ephemerides {
        let elevation_rad = predict(ephemeris, &state)?.look.elevation_rad;
        if elevation_rad > MASK_DEG.to_radians() {
            let cn0_dbhz = 38.0 + 10.0 * elevation_rad.sin();
            sent.push((ephemeris.satellite, elevation_rad, cn0_dbhz));
        }
    }
    Ok(sent)
}

fn scene(
    ephemerides: &[Ephemeris],
    sent: &[(SatelliteId, f64, f64)],
    truth: &ReceiverMotion,
    seed: u64,
) -> Result<Scene> {
    let emitters = sent.iter().map(|&(satellite, _, cn0_dbhz)| {
        let own = ephemerides.iter().find(|e| e.satellite == satellite);
        let ephemeris = *own.context("a satellite without an orbit")?;
        let path = OrbitPath {
            ephemeris,
            receiver: *truth,
            atmosphere: Atmosphere {
                ionosphere: Some(IONOSPHERE),
                troposphere: true,
            },
        };
        let signal = SignalId::gps_l1_ca(satellite.prn)?;
        let message = Message::Lnav(Box::new(LnavEncoder::new(&ephemeris)?));
        let emitter = PlainEmitter::new(signal, cn0_dbhz, Box::new(path), message);
        Ok(Box::new(emitter) as Box<dyn Emitter>)
    });
    Ok(Scene {
        reception: Reception {
            samples: SampleDescription {
                format: SampleFormat::Ci8,
                sample_rate_hz: SAMPLE_RATE_HZ,
                intermediate_frequency_hz: 0.0,
                swap_iq: false,
            },
            bits: None,
            bandwidth_hz: Some(BANDWIDTH * SAMPLE_RATE_HZ),
            gain: Gain::Fixed,
        },
        duration_s: DURATION_S,
        emitters: emitters.collect::<Result<_>>()?,
        interference: vec![],
        gaps: vec![],
        seed,
    })
}

impl Demo {
    /// East, north, up error (m) of `solution`.
    #[must_use]
    pub fn error_enu_m(&self, solution: &PvtRecord) -> Vector3<f64> {
        let true_m = self.truth.position_at(solution.time_s);
        let place = Geodetic::from_ecef(&true_m);
        place.enu_from_ecef() * (solution.position_ecef_m - true_m)
    }

    /// Whether there is a position and the last one is right.
    #[must_use]
    pub fn holds(&self) -> bool {
        let last = self.solutions.last();
        last.is_some_and(|s| self.error_enu_m(s).norm() <= LARGEST_ERROR_M)
    }

    fn write_satellites(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "sat  elevation  C/N0 sent  found   Doppler")?;
        for (satellite, elevation_rad, cn0_dbhz) in &self.sent {
            let elevation_deg = elevation_rad.to_degrees();
            write!(
                f,
                "{satellite}  {elevation_deg:7.1} deg {cn0_dbhz:6.1} dB-Hz  "
            )?;
            match self.acquired.iter().find(|a| a.satellite == *satellite) {
                Some(a) => writeln!(f, "{:5.1}  {:8.1} Hz", a.cn0_dbhz, a.doppler_hz)?,
                None => writeln!(f, "    -")?,
            }
        }
        Ok(())
    }

    fn write_solution(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(last) = self.solutions.last() else {
            let reason = self.no_fix_reason.as_deref().unwrap_or("no reason given");
            return writeln!(f, "no position: {reason}");
        };
        let place = Geodetic::from_ecef(&last.position_ecef_m);
        let error = self.error_enu_m(last);
        let velocity = last.velocity_ecef_mps - self.truth.velocity_ecef_mps;
        let true_time = self.truth.start + self.truth.true_elapsed_s(last.time_s);
        writeln!(
            f,
            "position  {:.6} N {:.6} E {:.1} m, {} from {} satellites after {:.1} s of signal",
            place.lat_rad.to_degrees(),
            place.lon_rad.to_degrees(),
            place.height_m,
            last.source.name(),
            last.satellites_used,
            last.time_s
        )?;
        writeln!(
            f,
            "error     {:+.2} m east {:+.2} m north {:+.2} m up (sigma {:.1} {:.1} {:.1}), \
             {:.2} m/s, time {:+.4} s",
            error.x,
            error.y,
            error.z,
            last.sigma_enu_m[0],
            last.sigma_enu_m[1],
            last.sigma_enu_m[2],
            velocity.norm(),
            last.time - true_time
        )
    }
}

impl fmt::Display for Demo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:.1} s of {} MHz complex 8-bit samples made and received in {:.2} s; told a position \
             {:.0} km and a time {:.0} s off",
            self.signal_s,
            SAMPLE_RATE_HZ / 1e6,
            self.wall_s,
            PRIOR_ERROR_M * 2f64.sqrt() / 1e3,
            PRIOR_TIME_ERROR_S
        )?;
        self.write_satellites(f)?;
        self.write_solution(f)?;
        let verdict = if self.holds() {
            "holds"
        } else {
            "does not hold"
        };
        write!(f, "bound     {LARGEST_ERROR_M} m: {verdict}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_receiver_finds_the_place_and_time() {
        let demo = demo(1).unwrap();
        assert!(demo.sent.len() >= 6, "{demo}");
        assert!(demo.holds(), "{demo}");
        let found = demo
            .sent
            .iter()
            .filter(|(s, ..)| demo.acquired.iter().any(|a| a.satellite == *s));
        assert_eq!(found.count(), demo.sent.len(), "{demo}");
        assert_eq!(demo.acquired.len(), demo.sent.len(), "{demo}");
    }
}
