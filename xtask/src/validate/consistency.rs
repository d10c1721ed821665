//! Whether the filter of vector tracking errs as it says: its errors and innovations over many runs in
//! which receiver and clock move as its models say.

use std::fmt;
use std::fmt::Write as _;

use anyhow::{Context, Result};
use gnss_nav::Geodetic;
use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_nav::dynamics::{AccelerationNoise, ClockNoise, ProcessNoise};
use gnss_nav::filter::Gate;
use gnss_nav::measurement::ErrorModel;
use gnss_signal::tracking::FrequencyPairs;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use receiver::pipeline::{Settings, VectorSettings};
use receiver::record::{FilterRecord, Source};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::verdict;
use crate::judged::{in_parallel, receive, settings};
use crate::scenario::built::Scenario;
use crate::scenario::make::Level;
use crate::scenario::spec::ScenarioFile;

/// Density of the acceleration, m^2/s^3, and the clock (that of the preset `tcxo`).
const ACCELERATION_M2_PER_S3: f64 = 1.0;
const H0_S: f64 = 1e-21;
const H_MINUS_2_HZ: f64 = 2e-20;
/// Signal of a run, s, and what is judged of it: the filter has settled.
const RUN_S: f64 = 20.0;
const SETTLED_S: f64 = 8.0;
/// Between two points of a trajectory, s.
const POINT_S: f64 = 0.01;
/// Between two updates of the filter, s.
const INTERVAL_S: f64 = 0.02;
const STATES: usize = 8;
/// Part of the epochs whose means over the runs lie within their bounds.
pub const SMALLEST_SHARE: f64 = 0.9;

/// A receiver that moves by white acceleration.
fn scenario(seed: u64) -> Result<Scenario> {
    let folder = tempfile::tempdir().context("a folder for a trajectory")?;
    let path = folder.path().join("trajectory.csv");
    std::fs::write(&path, trajectory(seed)).context("a trajectory")?;
    let text = format!(
        "description = 'moved by white acceleration'
start = {{ week = 2350, tow_s = 392400 }}
duration_s = {RUN_S:?}
constellation = {{ elevation_mask_deg = 10 }}
trajectory = {{ kind = 'csv', file = 'trajectory.csv' }}
clock = {{ preset = 'tcxo', drift = 2e-7 }}
propagation = {{ ionosphere = 'none', troposphere = 'none' }}
cn0 = {{ fixed_dbhz = 45 }}
receiver = {{ assisted = true }}
front_end = {{ format = 'ci8', sample_rate_hz = 50.3e6 }}"
    );
    let file = ScenarioFile::parse(
        "white acceleration",
        "white acceleration",
        folder.path(),
        text,
    )?;
    Scenario::new(&file, Some(seed))
}

/// Rows of a trajectory file.
fn trajectory(seed: u64) -> String {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let step_mps = (ACCELERATION_M2_PER_S3 * POINT_S).sqrt();
    let mut position = Geodetic::from_degrees(52.3, 10.5, 120.0).to_ecef();
    let mut velocity = Vector3::zeros();
    let mut rows = String::from("time_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps\n");
    for point in -200..=((RUN_S + 2.0) / POINT_S) as i64 {
        let time_s = point as f64 * POINT_S;
        let (p, v) = (position, velocity);
        let _ = writeln!(
            rows,
            "{time_s:.2},{:?},{:?},{:?},{:?},{:?},{:?}",
            p.x, p.y, p.z, v.x, v.y, v.z
        );
        let change: Vector3<f64> = Vector3::from_fn(|_, _| {
            step_mps * Distribution::<f64>::sample(&StandardNormal, &mut random)
        });
        position += (velocity + 0.5 * change) * POINT_S;
        velocity += change;
    }
    rows
}

/// How the receiver measures frequencies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// The product's: by the angle between the halves of an interval.
    Halves,
    /// With the carrier's phase where it is locked.
    CarrierPhase,
    /// Equation (6) of Jiang2017, each interval with the one before.
    Overlapping,
}

impl Form {
    const ALL: [Self; 3] = [Self::Halves, Self::CarrierPhase, Self::Overlapping];

    const fn name(self) -> &'static str {
        match self {
            Self::Halves => "halves, bounded",
            Self::CarrierPhase => "carrier phase",
            Self::Overlapping => "overlapping, equation (6)",
        }
    }

    fn settings(self, scenario: &Scenario) -> Settings {
        let mut settings = settings(scenario);
        settings.errors = ErrorModel::TRACKING_NOISE_ONLY;
        settings.vector = Some(VectorSettings {
            interval_s: INTERVAL_S,
            process_noise: ProcessNoise {
                acceleration: AccelerationNoise::isotropic(ACCELERATION_M2_PER_S3),
                clock: ClockNoise::from_allan(H0_S, H_MINUS_2_HZ),
            },
            gate: Gate::Off,
            monitor: None,
            ..VectorSettings::default()
        });
        let steered = &mut settings.tracking.steered;
        steered.carrier_phase = self == Self::CarrierPhase;
        if self == Self::Overlapping {
            steered.pairs = FrequencyPairs::Successive;
        }
        settings
    }
}

/// One epoch of one run.
#[derive(Debug, Clone, Copy)]
struct Epoch {
    /// Error of the state by its covariance, squared.
    error: f64,
    innovation: f64,
    innovations: usize,
    /// Squares of the errors of position and velocity, and what the covariance says of them.
    position: (f64, f64),
    velocity: (f64, f64),
}

fn run(form: Form, seed: u64) -> Result<Vec<Epoch>> {
    let scenario = scenario(seed)?;
    let judged = receive(&scenario, Level::Correlator, &form.settings(&scenario))?;
    let by_filter = judged
        .between(SETTLED_S, RUN_S)
        .filter(|e| e.pvt.source == Source::Filter);
    by_filter
        .map(|epoch| {
            let filter = epoch.pvt.filter.as_ref().context("a filter's record")?;
            let velocity_record = epoch.pvt.velocity.context("a filter's velocity")?;
            let (position, velocity) = (epoch.position_ecef_m(), epoch.velocity_ecef_mps());
            let elapsed_s = scenario.elapsed_s(epoch.pvt.time_s);
            let bias_m = |elapsed_s| scenario.truth.clock.metres_at(elapsed_s).0;
            // White frequency noise has no value at an instant: the mean over the filter's interval.
            let before_m = bias_m(elapsed_s - INTERVAL_S);
            let bias_m = bias_m(elapsed_s);
            let drift_mps = (bias_m - before_m) / INTERVAL_S;
            // The receiver reads its own clock, whose bias says what time it is.
            let clock = scenario.truth.start + elapsed_s;
            let late_s = (clock - epoch.pvt.time) - bias_m / SPEED_OF_LIGHT_MPS;
            let error = nalgebra::SVector::<f64, STATES>::from_column_slice(&[
                position.x,
                velocity.x,
                position.y,
                velocity.y,
                position.z,
                velocity.z,
                SPEED_OF_LIGHT_MPS * late_s,
                velocity_record.clock_drift_mps - drift_mps,
            ]);
            epoch_of(filter, &error)
        })
        .collect()
}

fn epoch_of(filter: &FilterRecord, error: &nalgebra::SVector<f64, STATES>) -> Result<Epoch> {
    let covariance = &filter.covariance;
    let factor = nalgebra::Cholesky::new(*covariance).context("a covariance is not one")?;
    let part = |first: usize| {
        let indices = [first, first + 2, first + 4];
        (
            indices.iter().map(|i| error[*i].powi(2)).sum(),
            indices.iter().map(|i| covariance[(*i, *i)]).sum(),
        )
    };
    Ok(Epoch {
        error: error.dot(&factor.solve(error)),
        innovation: filter.normalised_innovation_squared,
        innovations: filter.innovations,
        position: part(0),
        velocity: part(1),
    })
}

/// Consistency of one form over all runs.
#[derive(Debug, Clone)]
pub struct Row {
    form: Form,
    /// Mean normalised errors squared over their number (1 is consistent).
    error: f64,
    innovation: f64,
    /// Part of the epochs at which the mean over runs lies within its 95 % bounds.
    error_share: f64,
    innovation_share: f64,
    /// Error over stated deviation (rms).
    position: f64,
    velocity: f64,
}

impl Row {
    fn new(form: Form, runs: &[Vec<Epoch>]) -> Result<Self> {
        let epochs = runs.iter().map(Vec::len).min().unwrap_or(0);
        let all = || runs.iter().flatten();
        let sum = |value: fn(&Epoch) -> f64| all().map(value).sum::<f64>();
        let share = |value: fn(&Epoch) -> (f64, usize)| -> Result<f64> {
            let mut inside = 0;
            for k in 0..epochs {
                let at = runs.iter().map(|run| value(&run[k]));
                let (total, freedom) = at.fold((0.0, 0), |(a, n), (b, m)| (a + b, n + m));
                let law = ChiSquared::new(freedom as f64)?;
                inside += usize::from((0.025..0.975).contains(&law.cdf(total)));
            }
            Ok(inside as f64 / epochs as f64)
        };
        let count = all().count() as f64;
        Ok(Self {
            form,
            error: sum(|e| e.error) / (STATES as f64 * count),
            innovation: sum(|e| e.innovation) / sum(|e| e.innovations as f64),
            error_share: share(|e| (e.error, STATES))?,
            innovation_share: share(|e| (e.innovation, e.innovations))?,
            position: (sum(|e| e.position.0) / sum(|e| e.position.1)).sqrt(),
            velocity: (sum(|e| e.velocity.0) / sum(|e| e.velocity.1)).sqrt(),
        })
    }

    fn holds(&self) -> bool {
        self.error_share >= SMALLEST_SHARE && self.innovation_share >= SMALLEST_SHARE
    }
}

/// All forms.
#[derive(Debug, Clone)]
pub struct Table {
    runs: usize,
    rows: Vec<Row>,
}

/// Receives `runs` runs with each form.
///
/// # Errors
/// Where a signal cannot be made or the receiver fails.
pub fn table(runs: usize) -> Result<Table> {
    let row = |form: Form| {
        let epochs = in_parallel(runs, |number| run(form, number as u64))?;
        Row::new(form, &epochs)
    };
    let rows = Form::ALL.into_iter().map(row).collect::<Result<_>>()?;
    Ok(Table { runs, rows })
}

impl Table {
    /// Whether the product's own form is consistent.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.rows
            .iter()
            .any(|row| row.form == Form::Halves && row.holds())
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            f,
            "{} runs; means of NEES / 8 and NIS a measurement, part of the epochs within 95 % bounds, error over stated deviation:",
            self.runs
        )?;
        for row in &self.rows {
            writeln!(
                f,
                "{:26} NEES {:.3} ({:.1} %)  NIS {:.3} ({:.1} %)  position {:.2}  velocity {:.2}",
                row.form.name(),
                row.error,
                100.0 * row.error_share,
                row.innovation,
                100.0 * row.innovation_share,
                row.position,
                row.velocity
            )?;
        }
        write!(
            f,
            "halves: {} % of the epochs or more within their bounds: {}",
            100.0 * SMALLEST_SHARE,
            verdict(self.holds())
        )
    }
}
