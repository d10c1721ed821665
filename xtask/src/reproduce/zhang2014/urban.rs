//! Twelve satellites, some with a reflection: what becomes of the position.

use std::f64::consts::{PI, TAU};

use anyhow::{Context, Result};
use fault_ml::shape::closed_loop_chart;
use gnss_nav::constants::{CA_CODE_RATE_HZ, SPEED_OF_LIGHT_MPS};
use gnss_nav::integrity::{self, IntegritySettings};
use gnss_nav::least_squares::{Consistency, solve};
use gnss_nav::measurement::ErrorModel;
use gnss_nav::{Geodetic, GpsTime, Measurement, MeasurementModel, SatelliteId, SatelliteState};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::channel::{Channel, Seen};
use super::closed_loop::{Reflection, Setting};
use crate::judged::{in_parallel, rms};
use crate::order::quantile;
use crate::scenario::constellation::nominal;

/// Satellites of a scenario.
const SATELLITES: usize = 12;
/// They stand above this elevation, rad (15 degrees).
const MASK_RAD: f64 = 15.0 * PI / 180.0;
/// Most of them that have a reflection.
pub const MOST: usize = 4;
/// Scenarios of each number.
pub const SCENARIOS: usize = 100;
/// Epochs of a scenario, a second apart, after a second in which the loops settle.
const EPOCHS: usize = 14;
const STEPS: usize = 1_000;
/// Steps within the limits after which a flagged satellite is believed again: the 2 s of the receiver.
const READMIT_STEPS: usize = 2_000;
/// C/N0 of every satellite, dB-Hz.
const CN0_DBHZ: f64 = 44.0;
/// Deviation of a pseudorange beside the loop's jitter, and with it, m.
const NOISE_M: f64 = 1.0;
const SIGMA_M: f64 = 2.5;
/// Z over the error of the loop.
const SLOPE: f64 = 0.65;
/// False alarms of residual RAIM, an epoch.
const RAIM_FALSE_ALARM: f64 = 1e-4;
/// Length of a chip, m.
const CHIP_M: f64 = SPEED_OF_LIGHT_MPS / CA_CODE_RATE_HZ;

/// How a position is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Least squares of all.
    Plain,
    /// Residual test and exclusion.
    Raim,
    /// Flagged satellites left out.
    Exclude,
    /// Flagged satellites weighted by 1 / (s^2 + (Z / slope)^2).
    Weight,
    /// Flagged satellites left out, then residual test and exclusion.
    Both,
    /// Satellites with a reflection left out.
    Known,
}

impl Way {
    /// All, in the order of tables.
    pub const ALL: [Self; 6] = [
        Self::Plain,
        Self::Raim,
        Self::Exclude,
        Self::Weight,
        Self::Both,
        Self::Known,
    ];

    /// Words for it, and an independent prototype's 3-D rms for one to four satellites, m.
    #[must_use]
    pub const fn words(self) -> (&'static str, [f64; MOST]) {
        match self {
            Self::Plain => ("plain least squares", [16.8, 28.8, 30.5, 36.3]),
            Self::Raim => ("residual RAIM", [5.3, 10.1, 15.4, 25.3]),
            Self::Exclude => ("chart, exclusion", [5.6, 7.0, 8.2, 10.7]),
            Self::Weight => ("chart, weight", [5.6, 7.0, 8.1, 10.6]),
            Self::Both => ("chart, exclusion, then RAIM", [4.9, 5.8, 6.3, 8.8]),
            Self::Known => ("reflections known", [4.4, 4.7, 5.2, 5.6]),
        }
    }
}

/// What all scenarios of a number of reflections say.
#[derive(Debug, Clone, PartialEq)]
pub struct Urban {
    /// Satellites with a reflection.
    pub reflected: usize,
    /// 3-D error by [`Way::ALL`], rms and 95th percentile, m.
    pub errors_m: Vec<(f64, f64)>,
    /// Part of the epochs of satellites with a reflection that are flagged.
    pub flagged: f64,
    /// Epochs of other satellites that are flagged, and how many there are.
    pub false_flags: (usize, usize),
}

/// One to [`MOST`] satellites with a reflection.
///
/// # Errors
/// Where a sky or a solution cannot be made.
pub fn urban(scenarios: usize) -> Result<Vec<Urban>> {
    (1..=MOST)
        .map(|reflected| of_number(reflected, scenarios))
        .collect()
}

fn of_number(reflected: usize, scenarios: usize) -> Result<Urban> {
    let seed = |k: usize| (reflected * 100_000 + k) as u64;
    let epochs: Vec<Epoch> = in_parallel(scenarios, |k| scenario(reflected, seed(k)))?
        .into_iter()
        .flatten()
        .collect();
    let sum = |count: fn(&Epoch) -> usize| epochs.iter().map(count).sum::<usize>();
    let errors = |way: usize| -> (f64, f64) {
        let all = || epochs.iter().map(|e| e.errors_m[way]);
        (rms(all()), quantile(all(), 0.95))
    };
    Ok(Urban {
        reflected,
        errors_m: (0..Way::ALL.len()).map(errors).collect(),
        flagged: sum(|e| e.flagged) as f64 / (reflected * epochs.len()) as f64,
        false_flags: (
            sum(|e| e.false_flags),
            (SATELLITES - reflected) * epochs.len(),
        ),
    })
}

/// What one epoch says.
struct Epoch {
    errors_m: Vec<f64>,
    flagged: usize,
    false_flags: usize,
}

/// A satellite and its loop.
struct Satellite {
    state: SatelliteState,
    range_m: f64,
    channel: Channel,
    reflection: Option<Reflection>,
    fading_hz: f64,
    /// Steps for which it is still not believed.
    suspended: usize,
}

impl Satellite {
    /// A second of signal; what is seen at its end, and whether the satellite is flagged: outside the
    /// limits, or not yet for long enough within them.
    fn second(&mut self) -> (Seen, bool) {
        let mut seen = self.step();
        (1..STEPS).for_each(|_| seen = self.step());
        (seen, self.suspended > 0)
    }

    fn step(&mut self) -> Seen {
        let seen = self.channel.step(self.reflection.as_slice());
        self.suspended = if seen.is_outside() {
            READMIT_STEPS
        } else {
            self.suspended.saturating_sub(1)
        };
        if let Some(reflection) = &mut self.reflection {
            reflection.phase_rad += TAU * self.fading_hz / STEPS as f64;
        }
        seen
    }
}

fn scenario(reflected: usize, seed: u64) -> Result<Vec<Epoch>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let place = Geodetic::from_degrees(41.93, 123.41, 60.0).to_ecef();
    let (time, sky) = sky(&place, &mut rng)?;
    let chart = closed_loop_chart(CN0_DBHZ);
    let satellite = |(k, (state, range_m)): (usize, (SatelliteState, f64))| {
        let reflection = (k < reflected).then(|| Reflection {
            amplitude: rng.random_range(0.3..0.8),
            delay_chips: rng.random_range(0.1..1.0),
            phase_rad: rng.random_range(0.0..TAU),
        });
        Ok(Satellite {
            state,
            range_m,
            channel: Channel::new(Setting::paper(CN0_DBHZ), chart, rng.random())?,
            fading_hz: rng.random_range(0.0..0.3),
            reflection,
            suspended: 0,
        })
    };
    let mut satellites = sky
        .into_iter()
        .enumerate()
        .map(satellite)
        .collect::<Result<Vec<_>>>()?;
    satellites.iter_mut().for_each(|s| _ = s.second());
    (0..EPOCHS)
        .map(|_| epoch(&mut satellites, &place, time, &mut rng))
        .collect()
}

fn epoch(
    satellites: &mut [Satellite],
    place: &Vector3<f64>,
    time: GpsTime,
    rng: &mut ChaCha8Rng,
) -> Result<Epoch> {
    let seen: Vec<(Seen, bool)> = satellites.iter_mut().map(Satellite::second).collect();
    let measurements: Vec<Measurement> = satellites
        .iter()
        .zip(&seen)
        .enumerate()
        .map(|(k, (satellite, (seen, _)))| {
            let noise: f64 = rng.sample(StandardNormal);
            Measurement {
                satellite: SatelliteId::gps(k as u8 + 1),
                receive_time: time,
                pseudorange_m: satellite.range_m + CHIP_M * seen.late_chips + NOISE_M * noise,
                range_rate_mps: 0.0,
                pseudorange_variance_m2: SIGMA_M * SIGMA_M,
                range_rate_variance_m2_s2: f64::INFINITY,
                cn0_dbhz: CN0_DBHZ,
                state: satellite.state,
                user_range_accuracy_m: 0.0,
            }
        })
        .collect();
    let is_reflected: Vec<bool> = satellites.iter().map(|s| s.reflection.is_some()).collect();
    let error = |way| error_m(way, &measurements, &seen, &is_reflected, place);
    let flags = |reflected: bool| {
        let both = seen.iter().zip(&is_reflected);
        both.filter(|((_, flagged), r)| *flagged && **r == reflected)
            .count()
    };
    Ok(Epoch {
        errors_m: Way::ALL.into_iter().map(error).collect::<Result<_>>()?,
        flagged: flags(true),
        false_flags: flags(false),
    })
}

fn error_m(
    way: Way,
    measurements: &[Measurement],
    seen: &[(Seen, bool)],
    is_reflected: &[bool],
    place: &Vector3<f64>,
) -> Result<f64> {
    let those = |keep: &dyn Fn(usize) -> bool| -> Vec<Measurement> {
        let all = measurements.iter().enumerate();
        all.filter(|(k, _)| keep(*k)).map(|(_, m)| *m).collect()
    };
    let used = match way {
        Way::Plain | Way::Raim => measurements.to_vec(),
        Way::Exclude | Way::Both => those(&|k| !seen[k].1),
        Way::Known => those(&|k| !is_reflected[k]),
        Way::Weight => {
            let mut all = measurements.to_vec();
            for (m, (seen, _)) in all.iter_mut().zip(seen).filter(|(_, s)| s.1) {
                m.pseudorange_variance_m2 += (CHIP_M * seen.mean_chips / SLOPE).powi(2);
            }
            all
        }
    };
    let model = model();
    let solution = match way {
        Way::Raim | Way::Both => {
            let settings = IntegritySettings {
                false_alarm_probability: RAIM_FALSE_ALARM,
                ..IntegritySettings::default()
            };
            integrity::solve(&used, &model, place, &settings)?.solution
        }
        _ => solve(&used, &model, place)?,
    };
    debug_assert!(solution.consistency != Consistency::Untested || way != Way::Raim);
    Ok((solution.position_ecef_m - place).norm())
}

/// No delays, and no errors but those of tracking.
const fn model() -> MeasurementModel {
    MeasurementModel {
        ionosphere: None,
        troposphere: false,
        elevation_mask_rad: -1.0,
        errors: ErrorModel::TRACKING_NOISE_ONLY,
    }
}

/// A time, and twelve satellites in random order: of the nominal constellation and of a second one, which
/// stands as the first does some hours later. Their states and pseudoranges without clock.
fn sky(
    place: &Vector3<f64>,
    rng: &mut ChaCha8Rng,
) -> Result<(GpsTime, Vec<(SatelliteState, f64)>)> {
    /// Skies looked at: most have twelve satellites.
    const TRIES: usize = 100;
    let model = model();
    for _ in 0..TRIES {
        let time = GpsTime::new(2350, rng.random_range(0.0..86_400.0));
        let mut up = Vec::new();
        for shell_s in [0.0, 11_000.0] {
            let at = time + shell_s;
            for ephemeris in nominal(at)? {
                let (_, state) = ephemeris.state_at_transmission(at)?;
                let predicted = model.predict(&state, place, time);
                if predicted.look.elevation_rad > MASK_RAD {
                    up.push((rng.random::<u64>(), (state, predicted.pseudorange_m)));
                }
            }
        }
        if up.len() >= SATELLITES {
            up.sort_by_key(|(order, _)| *order);
            up.truncate(SATELLITES);
            return Ok((
                time,
                up.into_iter().map(|(_, satellite)| satellite).collect(),
            ));
        }
    }
    None.context("no sky of twelve satellites")
}
