//! All campaigns of the reproduction.

use std::ops::Range;

use anyhow::{Context, Result};
use fault_ml::classical::KalmanParameters;
use fault_ml::particle::{
    ClockState, Likelihood, Movement, ParticleParameters, SwarmOrder, SwarmSettings,
};

use super::detector::Kind;
use super::setting::{Geometry, TrueNoise, Truth};
use super::simulate::{Campaign, Run};

/// Seeds of the main campaigns.
pub const SEEDS: Range<u64> = 0..200;
/// Seeds of what only compares.
const FEWER_SEEDS: Range<u64> = 0..100;
/// Seeds where one unstated choice after the other is varied.
const SCAN_SEEDS: Range<u64> = 0..20;
/// Noise of the paper's setting: overstated by the detectors.
const PAPER_TRUTH: Truth = Truth {
    noise: TrueNoise::Mixture,
    sigma_m: 1.8,
};
/// Heavy tails of the standard deviation the detectors assume.
const MATCHED_TRUTH: Truth = Truth {
    noise: TrueNoise::Mixture,
    sigma_m: 3.0,
};
const CORRELATED_TRUTH: Truth = Truth {
    noise: TrueNoise::Correlated,
    sigma_m: 1.8,
};
/// Satellite biases of 2 m and little else, the deviation known.
const BIASED_TRUTH: Truth = Truth {
    noise: TrueNoise::Biased,
    sigma_m: 2.1,
};
/// Assumed standard deviation of a pseudorange, m.
const SIGMA_M: f64 = 3.0;
/// Process noise under matched noise, m.
const MATCHED_PROCESS_M: f64 = 0.3;

/// Inertia and attraction used with a swarm: of those scanned, the ones that bring both tables of the
/// paper closest. They are fitted to the paper; nothing else here is.
pub const SWARM: SwarmSettings = SwarmSettings {
    iterations: 10,
    inertia: 0.6,
    attraction: 1.2,
    order: SwarmOrder::WeighThenMove,
};
/// The coefficients most often used elsewhere.
pub const USUAL_SWARM: SwarmSettings = SwarmSettings {
    inertia: 0.729,
    attraction: 1.494,
    ..SWARM
};

/// Inertia and attraction tried, from soft to hard.
const COEFFICIENTS: [(f64, f64); 5] = [
    (0.4, 0.8),
    (0.5, 1.0),
    (0.6, 1.2),
    (0.65, 1.3),
    (0.729, 1.494),
];

/// One campaign and its runs.
#[derive(Debug, Clone)]
pub struct Case {
    /// Key in the summary.
    pub key: &'static str,
    /// What people read.
    pub label: String,
    /// What was run.
    pub campaign: Campaign,
    /// By seed.
    pub runs: Vec<Run>,
}

/// All campaigns.
#[derive(Debug, Clone)]
pub struct Study {
    /// The paper's setting.
    pub paper: Vec<Case>,
    /// Heavy tails, matched deviation.
    pub matched: Vec<Case>,
    /// Time-correlated noise.
    pub correlated: Vec<Case>,
    /// Satellite biases.
    pub biased: Vec<Case>,
    /// The paper's setting with one unstated choice changed.
    pub scan: Vec<Case>,
}

/// The case called `key`.
///
/// # Errors
/// Where there is none.
pub fn case<'a>(cases: &'a [Case], key: &str) -> Result<&'a Case> {
    let found = cases.iter().find(|case| case.key == key);
    found.with_context(|| format!("no case {key}"))
}

type Plan = (&'static str, String, Kind);

fn plan(key: &'static str, label: &str, kind: Kind) -> Plan {
    (key, label.to_owned(), kind)
}

/// The bootstrap filter in the setting of the paper.
#[must_use]
pub fn bootstrap() -> ParticleParameters {
    ParticleParameters::wang2016(Movement::Bootstrap)
}

/// PSO-PF in the setting of the paper.
#[must_use]
pub fn swarmed(settings: SwarmSettings) -> ParticleParameters {
    ParticleParameters::wang2016(Movement::Swarm(settings))
}

fn ordered(settings: SwarmSettings, order: SwarmOrder) -> ParticleParameters {
    swarmed(SwarmSettings { order, ..settings })
}

fn classical(process_noise_m: f64) -> [Plan; 4] {
    let parameters = KalmanParameters {
        process_noise_m,
        ..KalmanParameters::default()
    };
    [
        plan("kalman_bank", "Kalman bank", Kind::KalmanBank(parameters)),
        plan(
            "innovation_glr",
            "GLR on Kalman innovations",
            Kind::InnovationGlr(parameters),
        ),
        plan(
            "parity_glr",
            "GLR on least-squares residuals",
            Kind::ParityGlr,
        ),
        plan("chi_square", "chi-square of one epoch", Kind::ChiSquare),
    ]
}

fn paper_plans() -> Vec<Plan> {
    let literal = format!(
        "PSO-PF, weights then move, w {} c {}",
        SWARM.inertia, SWARM.attraction
    );
    let usual = format!(
        "PSO-PF, move then weights, w {} c {}",
        USUAL_SWARM.inertia, USUAL_SWARM.attraction
    );
    let particle = Kind::Particle;
    let mut plans = vec![
        plan("pf", "PF", particle(bootstrap())),
        plan("pso_weigh_move", &literal, particle(swarmed(SWARM))),
        plan(
            "pso_move_weigh",
            &usual,
            particle(ordered(USUAL_SWARM, SwarmOrder::MoveThenWeigh)),
        ),
        plan(
            "pso_corrected",
            "swarm as a proposal, weights corrected",
            particle(ordered(SWARM, SwarmOrder::Corrected)),
        ),
        plan(
            "pf_marginal",
            "PF, clock integrated out",
            particle(marginal()),
        ),
    ];
    plans.extend(classical(0.25));
    plans
}

fn matched_plans() -> Vec<Plan> {
    let gaussian = ParticleParameters {
        position_noise_m: MATCHED_PROCESS_M,
        clock_noise_m: MATCHED_PROCESS_M,
        ..bootstrap()
    };
    let mixture = ParticleParameters {
        likelihood: Likelihood::HEAVY_TAILED,
        ..gaussian
    };
    let mut plans = vec![
        plan(
            "pf_gaussian",
            "PF, Gaussian likelihood",
            Kind::Particle(gaussian),
        ),
        plan(
            "pf_mixture",
            "PF, mixture likelihood",
            Kind::Particle(mixture),
        ),
    ];
    plans.extend(classical(MATCHED_PROCESS_M));
    plans
}

fn correlated_plans() -> Vec<Plan> {
    let mut plans = vec![
        plan("pf", "PF", Kind::Particle(bootstrap())),
        plan("pso_weigh_move", "PSO-PF", Kind::Particle(swarmed(SWARM))),
    ];
    plans.extend(classical(0.25));
    plans
}

fn biased_plans() -> Vec<Plan> {
    let mixture = ParticleParameters {
        likelihood: Likelihood::HEAVY_TAILED,
        ..bootstrap()
    };
    let particle = Kind::Particle;
    let mut plans = vec![
        plan("pf", "PF", particle(bootstrap())),
        plan(
            "pf_marginal",
            "PF, clock integrated out",
            particle(marginal()),
        ),
        plan("pf_mixture", "PF, mixture likelihood", particle(mixture)),
    ];
    for (key, deviation_factor) in [("pf_1.5", 1.5), ("pf_2", 2.0)] {
        let overstated = ParticleParameters {
            deviation_factor,
            ..marginal()
        };
        let label = format!("PF, clock integrated out, deviation times {deviation_factor}");
        plans.push((key, label, particle(overstated)));
    }
    plans.extend(classical(0.25));
    plans
}

/// The bootstrap filter with the clock integrated out.
fn marginal() -> ParticleParameters {
    ParticleParameters {
        clock: ClockState::Marginalised,
        ..bootstrap()
    }
}

fn scan_plans() -> Vec<Plan> {
    let mut plans = Vec::new();
    for (inertia, attraction) in COEFFICIENTS {
        for order in [SwarmOrder::WeighThenMove, SwarmOrder::MoveThenWeigh] {
            let settings = SwarmSettings {
                inertia,
                attraction,
                ..SWARM
            };
            let words = match order {
                SwarmOrder::WeighThenMove => "weights then move",
                _ => "move then weights",
            };
            let label = format!("PSO-PF, {words}, w {inertia} c {attraction}");
            plans.push(("scan", label, Kind::Particle(ordered(settings, order))));
        }
    }
    for noise_m in [0.15, 0.5, 1.0] {
        let parameters = ParticleParameters {
            position_noise_m: noise_m,
            clock_noise_m: noise_m,
            ..bootstrap()
        };
        let label = format!("PF, process noise {noise_m} m");
        plans.push(("scan", label, Kind::Particle(parameters)));
    }
    let half = ParticleParameters {
        resample_below: 0.5,
        ..bootstrap()
    };
    plans.push(plan(
        "scan",
        "PF, resampled below N/2",
        Kind::Particle(half),
    ));
    plans
}

impl Study {
    /// Runs everything.
    ///
    /// # Errors
    /// Where a campaign cannot be run.
    pub fn run(geometry: &Geometry) -> Result<Self> {
        let campaigns = |plans: Vec<Plan>, truth: Truth, sigma_m: f64, seeds: Range<u64>| {
            let run = |(key, label, kind): Plan| {
                let campaign = Campaign {
                    truth,
                    sigma_m,
                    kind,
                };
                let runs = campaign.runs(geometry, seeds.clone())?;
                Ok(Case {
                    key,
                    label,
                    campaign,
                    runs,
                })
            };
            plans.into_iter().map(run).collect::<Result<Vec<_>>>()
        };
        let mut scan = campaigns(scan_plans(), PAPER_TRUTH, SIGMA_M, SCAN_SEEDS)?;
        for sigma_m in [2.0, 4.0] {
            let label = format!("PF, assumed deviation {sigma_m} m");
            let plans = vec![("scan", label, Kind::Particle(bootstrap()))];
            scan.extend(campaigns(plans, PAPER_TRUTH, sigma_m, SCAN_SEEDS)?);
        }
        Ok(Self {
            paper: campaigns(paper_plans(), PAPER_TRUTH, SIGMA_M, SEEDS)?,
            matched: campaigns(matched_plans(), MATCHED_TRUTH, SIGMA_M, SEEDS)?,
            correlated: campaigns(correlated_plans(), CORRELATED_TRUTH, SIGMA_M, FEWER_SEEDS)?,
            biased: campaigns(
                biased_plans(),
                BIASED_TRUTH,
                BIASED_TRUTH.sigma_m,
                FEWER_SEEDS,
            )?,
            scan,
        })
    }
}
