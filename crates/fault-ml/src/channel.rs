//! Monitors of one channel.

use crate::{Health, Judgement, MonitorError};

/// Which step of a channel a monitor takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Cadence {
    /// Every integration of the correlators, 1 to 20 ms.
    Integration,
    /// Every navigation epoch.
    NavigationEpoch,
}

/// What the navigation solution did not expect of a channel: measurement minus prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    /// Of the pseudorange, m; above zero: the measured range is longer than predicted.
    pub code_m: f64,
    /// Its predicted standard deviation, m.
    pub code_sigma_m: f64,
    /// Of the range rate, m/s.
    pub rate_mps: f64,
    /// Its predicted standard deviation, m/s.
    pub rate_sigma_mps: f64,
}

/// What a monitor says of one channel at one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChannelVerdict {
    /// Judged.
    Judged(Judgement),
    /// Too few steps seen yet.
    WarmingUp {
        /// Steps still needed.
        remaining_steps: usize,
    },
    /// This step cannot be judged.
    Unavailable,
}

impl ChannelVerdict {
    /// Health of the channel.
    #[must_use]
    pub fn health(&self) -> Health {
        match self {
            Self::Judged(judgement) => judgement.health(),
            Self::WarmingUp { .. } => Health::WarmingUp,
            Self::Unavailable => Health::Unavailable,
        }
    }

    /// Whether the channel was judged and found faulty.
    #[must_use]
    pub fn is_faulty(&self) -> bool {
        self.health() == Health::Faulty
    }

    /// Score and threshold, where there are any.
    #[must_use]
    pub const fn judgement(&self) -> Option<&Judgement> {
        match self {
            Self::Judged(judgement) => Some(judgement),
            Self::WarmingUp { .. } | Self::Unavailable => None,
        }
    }
}

/// Watches one channel, one step at a time.
///
/// Causal: a verdict rests on the steps seen so far and is never revised.
pub trait ChannelMonitor {
    /// What one step brings.
    type Input;

    /// Name in results and options.
    fn name(&self) -> &str;

    /// Which steps it takes.
    fn cadence(&self) -> Cadence;

    /// Takes the next step and judges the channel.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where the input holds a number it cannot work with; the step then
    /// leaves no trace.
    fn step(&mut self, input: &Self::Input) -> Result<ChannelVerdict, MonitorError>;

    /// Forgets all steps, as after a loss of lock.
    fn reset(&mut self);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Judges the mean of the last `length` values.
    struct WindowMean {
        length: usize,
        limit: f64,
        held: Vec<f64>,
    }

    impl ChannelMonitor for WindowMean {
        type Input = f64;

        fn name(&self) -> &str {
            "window-mean"
        }

        fn cadence(&self) -> Cadence {
            Cadence::Integration
        }

        fn step(&mut self, input: &f64) -> Result<ChannelVerdict, MonitorError> {
            Judgement::new(*input, self.limit)?;
            self.held.push(*input);
            if self.held.len() < self.length {
                let remaining_steps = self.length - self.held.len();
                return Ok(ChannelVerdict::WarmingUp { remaining_steps });
            }
            let window = &self.held[self.held.len() - self.length..];
            let mean = window.iter().sum::<f64>() / self.length as f64;
            Ok(ChannelVerdict::Judged(Judgement::new(mean, self.limit)?))
        }

        fn reset(&mut self) {
            self.held.clear();
        }
    }

    #[test]
    fn a_monitor_warms_up_judges_and_starts_again() {
        let (length, limit) = (3, 1.0);
        let held = Vec::new();
        let mut monitor = WindowMean {
            length,
            limit,
            held,
        };
        let healths = [0.0, 0.0, 2.9, 0.5, f64::NAN, 2.9]
            .map(|x| monitor.step(&x).map_or(Health::Unavailable, |v| v.health()));
        use Health::{Faulty, Healthy, Unavailable, WarmingUp};
        let expected = [WarmingUp, WarmingUp, Healthy, Faulty, Unavailable, Faulty];
        assert_eq!(healths, expected);
        monitor.reset();
        let verdict = monitor.step(&9.0).unwrap();
        assert_eq!(verdict, ChannelVerdict::WarmingUp { remaining_steps: 2 });
        assert!(!verdict.is_faulty());
        assert_eq!(verdict.judgement(), None);
    }
}
