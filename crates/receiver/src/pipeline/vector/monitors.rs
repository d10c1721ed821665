//! The monitors of a channel, whichever they are.

use fault_ml::learned::{ChannelStep, LearnedMonitor};
use fault_ml::{ChannelMonitor, ChannelVerdict, Innovation, InnovationTest};
use gnss_nav::filter::SatelliteInnovation;
use gnss_signal::tracking::ChannelEpoch;

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

/// What the monitors of a channel are shown of an epoch.
pub(super) fn step(innovation: &SatelliteInnovation, epoch: &ChannelEpoch) -> ChannelStep {
    let (rate_mps, rate_sigma_mps) = innovation.rate.map_or((0.0, f64::INFINITY), |rate| {
        (rate.value(), rate.variance().sqrt())
    });
    ChannelStep {
        satellite: innovation.satellite.prn.into(),
        innovation: Innovation {
            code_m: innovation.code.value(),
            code_sigma_m: innovation.code.variance().sqrt(),
            rate_mps,
            rate_sigma_mps,
        },
        cn0_dbhz: epoch.cn0_dbhz,
        prompt_power: epoch.prompt.norm_sqr(),
    }
}
