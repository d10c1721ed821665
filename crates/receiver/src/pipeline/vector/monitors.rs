//! The monitors of a channel, whichever they are.

use fault_ml::learned::{ChannelStep, ChannelStrength, LearnedMonitor, StrengthChange};
use fault_ml::{ChannelMonitor, ChannelVerdict, Innovation, InnovationTest};
use gnss_nav::SatelliteId;
use gnss_nav::filter::{
    self, Covariance, Deviation, GivenOthers, Innovations, SatelliteInnovation,
};
use gnss_signal::tracking::ChannelEpoch;

use super::scatter::Scatter;
use crate::ReceiverError;

/// One monitor of a channel.
#[derive(Debug, Clone)]
pub(in crate::pipeline) enum Monitor {
    /// The innovation test, which needs no training; its threshold takes long to find.
    Innovation(Box<InnovationTest>),
    /// A trained one.
    Learned(Box<LearnedMonitor>),
}

impl Monitor {
    /// Name in results and options.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Innovation(_) => "innovation",
            Self::Learned(monitor) => monitor.model().card().kind.name(),
        }
    }

    /// Takes a step.
    ///
    /// # Errors
    /// Where the innovation is no number. Strengths that are none, as those of a channel that has just begun,
    /// are no error: a trained monitor does without that step.
    pub(super) fn step(&mut self, step: &ChannelStep) -> Result<ChannelVerdict, ReceiverError> {
        match self {
            Self::Innovation(test) => Ok(test.step(&step.innovation)?),
            Self::Learned(monitor) => Ok(monitor.step(step).unwrap_or(ChannelVerdict::Unavailable)),
        }
    }

    /// Forgets everything.
    pub(super) fn reset(&mut self) {
        match self {
            Self::Innovation(test) => test.reset(),
            Self::Learned(monitor) => monitor.reset(),
        }
    }
}

/// A deviation from what the others say, beyond which a satellite is not one of the others, in deviations.
pub(super) const CONTRADICTS_SIGMAS: f64 = 6.0;
/// Satellites that tell what to expect of another one, at least.
const FEWEST_OTHERS: usize = 5;

/// Every satellite's innovations given those of the others that are `believed` and do not contradict the rest:
/// one that does would show in the deviations of all. Variances are those that `scatter` has found; it takes in what
/// these others deviate.
pub(super) fn deviations(
    innovations: &Innovations,
    covariance: &Covariance,
    scatter: &mut Scatter,
    interval_s: f64,
    believed: impl Fn(SatelliteId) -> bool,
) -> Result<Vec<GivenOthers>, ReceiverError> {
    let all = innovations.satellites().iter().map(|s| s.satellite);
    let mut others: Vec<SatelliteId> = all.filter(|s| believed(*s)).collect();
    let given_by = |others: &[_]| innovations.given_others(covariance, |s| others.contains(&s));
    let mut given = given_by(&others)?;
    let wide = loop {
        let wide: Vec<_> = given.iter().map(|g| scatter.widened(g)).collect();
        let heard = wide.iter().filter(|g| others.contains(&g.satellite));
        let farthest = heard.max_by(|a, b| distance2(a).total_cmp(&distance2(b)));
        match farthest {
            Some(farthest)
                if distance2(farthest) > CONTRADICTS_SIGMAS * CONTRADICTS_SIGMAS
                    && others.len() > FEWEST_OTHERS =>
            {
                let contradicts = farthest.satellite;
                others.retain(|s| *s != contradicts);
                given = given_by(&others)?;
            }
            _ => break wide,
        }
    };
    let most = given.iter().filter(|g| others.contains(&g.satellite));
    scatter.follow(most, interval_s);
    Ok(wide)
}

/// The larger of the normalised deviations, squared.
fn distance2(given: &GivenOthers) -> f64 {
    let rate = given.rate.as_ref();
    let rate = rate.map_or(0.0, Deviation::normalised_squared);
    rate.max(given.code.normalised_squared())
}

/// The strength of a channel at an epoch.
pub(super) fn strength(satellite: SatelliteId, epoch: &ChannelEpoch) -> ChannelStrength {
    ChannelStrength {
        satellite: satellite.prn.into(),
        cn0_dbhz: epoch.cn0_dbhz,
        cn0_now_hz: epoch.cn0_now_hz,
    }
}

/// What the monitors of a channel are shown of an epoch by which the C/N0 of the others changed by `others_change`.
pub(super) fn step(
    innovation: &SatelliteInnovation,
    given: &GivenOthers,
    epoch: &ChannelEpoch,
    others_change: StrengthChange,
) -> ChannelStep {
    ChannelStep {
        satellite: innovation.satellite.prn.into(),
        innovation: of_filter(innovation),
        given_others: of_others(given),
        cn0_dbhz: epoch.cn0_dbhz,
        cn0_now_hz: epoch.cn0_now_hz,
        others_change,
        tap_ratios: epoch.tap_ratios,
    }
}

/// `step` as it would have been had the filter been another.
pub(super) fn step_again(
    step: &ChannelStep,
    innovation: &SatelliteInnovation,
    given: &GivenOthers,
) -> ChannelStep {
    ChannelStep {
        innovation: of_filter(innovation),
        given_others: of_others(given),
        ..*step
    }
}

fn of_filter(innovation: &SatelliteInnovation) -> Innovation {
    let number = |i: &filter::Innovation| (i.value(), i.variance());
    pair(
        number(&innovation.code),
        innovation.rate.as_ref().map(number),
    )
}

fn of_others(given: &GivenOthers) -> Innovation {
    let number = |d: &Deviation| (d.value, d.variance);
    pair(number(&given.code), given.rate.as_ref().map(number))
}

/// Value and variance of a pseudorange and, where there is one, of a range rate.
fn pair(code: (f64, f64), rate: Option<(f64, f64)>) -> Innovation {
    let (rate_mps, rate_variance) = rate.unwrap_or((0.0, f64::INFINITY));
    Innovation {
        code_m: code.0,
        code_sigma_m: code.1.sqrt(),
        rate_mps,
        rate_sigma_mps: rate_variance.sqrt(),
    }
}
