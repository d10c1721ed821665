//! Options of `receiver solve`, as given and as valid values.

use std::path::PathBuf;

use clap::Args;

use super::check::{Checks, Origin};
use super::{Ionosphere, Troposphere};
use crate::ReceiverError;
use crate::solve::{KinematicSettings, SolveSettings, Weights};

/// Options of `receiver solve`.
#[derive(Debug, Clone, Default, PartialEq, Args)]
pub struct SolveOptions {
    /// RINEX 2 or 3 observation file (plain, Hatanaka, gzip, or both)
    #[arg(long, value_name = "RINEX")]
    pub obs: Option<PathBuf>,
    /// RINEX 2 or 3 navigation files (plain or gzip)
    #[arg(long, value_name = "RINEX", num_args = 1..)]
    pub nav: Vec<PathBuf>,
    /// Receiver autonomous integrity monitoring: none, ls (residuals and parity space), glr (the
    /// same after a likelihood ratio over half a minute of innovations), or particle filters, pf or
    /// pso-pf (proposed to by a swarm) [default: ls]
    #[arg(long, value_name = "RAIM")]
    pub raim: Option<String>,
    /// With ls and glr: probability that the test of a fault-free epoch fails, 1e-12 to 0.1
    /// [default: 1e-5]
    #[arg(long, value_name = "P")]
    pub false_alarm: Option<f64>,
    /// Filter from epoch to epoch: none, or ekf (kinematic, on pseudoranges and Dopplers)
    /// [default: none]
    #[arg(long, value_name = "FILTER")]
    pub filter: Option<String>,
    /// Add an error to a satellite's pseudoranges: SAT:METRES@SECONDS a step,
    /// SAT:METRES_A_SECOND@SECONDS:ramp a ramp, seconds since the first epoch; may be repeated
    #[arg(long, value_name = "FAULT", allow_hyphen_values = true)]
    pub inject: Vec<String>,
    /// Ionosphere model: klobuchar or none [default: klobuchar]
    #[arg(long, value_name = "MODEL")]
    pub ionosphere: Option<String>,
    /// Troposphere model: saastamoinen or none [default: saastamoinen]
    #[arg(long, value_name = "MODEL")]
    pub troposphere: Option<String>,
    /// Use no satellite below this elevation, 0 to 90 degrees [default: 10]
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    pub elevation_mask: Option<f64>,
    /// Use no satellite weaker than this, 0 to 60 dB-Hz [default: 25]
    #[arg(long, value_name = "DBHZ")]
    pub cn0_mask: Option<f64>,
    /// Rely on no solution of a larger position dilution, 1 to 1000 [default: 15]
    #[arg(long, value_name = "PDOP")]
    pub most_pdop: Option<f64>,
    /// What pseudoranges are weighed by: elevation, cn0 or both [default: both]
    #[arg(long, value_name = "WEIGHTS")]
    pub weights: Option<String>,
    /// Truth (time_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps; time_s since the first epoch), compared with
    /// pvt.csv afterwards
    #[arg(long, value_name = "TRUTH.csv")]
    pub truth: Option<PathBuf>,
    /// Seed of the particle filters [default: 0]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Directory for the output files [default: none are written]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// No progress, only errors and the result
    #[arg(long)]
    pub quiet: bool,
}

/// Everything `receiver solve` needs to know.
#[derive(Debug, Clone, PartialEq)]
pub struct SolveConfig {
    /// Observation file.
    pub obs: PathBuf,
    /// Navigation files.
    pub nav: Vec<PathBuf>,
    /// How to solve; the ionosphere's parameters are still to come from the files.
    pub settings: SolveSettings,
    /// Model of the ionosphere.
    pub ionosphere: Ionosphere,
    /// Truth to compare with afterwards.
    pub truth: Option<PathBuf>,
    /// Directory for the output files.
    pub out: Option<PathBuf>,
}

impl SolveOptions {
    /// These options, checked, with defaults.
    ///
    /// # Errors
    /// [`ReceiverError::Option`] naming the option, its value and what was expected.
    pub fn check(&self) -> Result<SolveConfig, ReceiverError> {
        Checks(&Origin::CommandLine).solve(self)
    }
}

impl Checks<'_> {
    fn solve(&self, given: &SolveOptions) -> Result<SolveConfig, ReceiverError> {
        let obs = given.obs.clone();
        let obs = obs.ok_or_else(|| self.missing("obs", "a RINEX observation file"))?;
        if given.nav.is_empty() {
            return Err(self.missing("nav", "a RINEX navigation file of the same day"));
        }
        self.needs_out(given.truth.as_ref(), given.out.as_ref())?;
        self.number("cn0-mask", given.cn0_mask, "0 to 60 (dB-Hz)", |v| {
            (0.0..=60.0).contains(&v)
        })?;
        let defaults = SolveSettings::default();
        let troposphere = self.troposphere(given.troposphere.as_deref())?;
        Ok(SolveConfig {
            obs,
            nav: given.nav.clone(),
            settings: SolveSettings {
                most_pdop: self.most_pdop(given)?,
                ionosphere: None,
                troposphere: troposphere == Troposphere::Saastamoinen,
                elevation_mask_rad: self
                    .elevation_mask(given.elevation_mask)?
                    .unwrap_or(10.0)
                    .to_radians(),
                cn0_mask_dbhz: given.cn0_mask.unwrap_or(defaults.cn0_mask_dbhz),
                weights: self.weights(given)?,
                raim: self.solve_raim(given)?,
                seed: given.seed.unwrap_or(defaults.seed),
                kinematic: self.choice(
                    "filter",
                    given.filter.as_deref(),
                    "none",
                    &[("none", None), ("ekf", Some(KinematicSettings::default()))],
                )?,
                faults: self.faults(given)?,
            },
            ionosphere: self.ionosphere(given.ionosphere.as_deref())?,
            truth: given.truth.clone(),
            out: given.out.clone(),
        })
    }

    fn most_pdop(&self, given: &SolveOptions) -> Result<f64, ReceiverError> {
        self.number("most-pdop", given.most_pdop, "1 to 1000", |v| {
            (1.0..=1e3).contains(&v)
        })?;
        let default = SolveSettings::default().most_pdop;
        Ok(given.most_pdop.unwrap_or(default))
    }

    fn weights(&self, given: &SolveOptions) -> Result<Weights, ReceiverError> {
        let weights = [
            ("elevation", Weights::Elevation),
            ("cn0", Weights::Cn0),
            ("both", Weights::Both),
        ];
        self.choice("weights", given.weights.as_deref(), "both", &weights)
    }

    fn faults(
        &self,
        given: &SolveOptions,
    ) -> Result<Vec<crate::solve::InjectedFault>, ReceiverError> {
        let parse = |text: &String| {
            text.parse()
                .map_err(|expected: String| self.wrong("inject", text, &expected))
        };
        given.inject.iter().map(parse).collect()
    }
}
