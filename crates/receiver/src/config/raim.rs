//! `--raim` of either command.

use gnss_nav::integrity::IntegritySettings;

use super::check::Checks;
use super::{RunOptions, SolveOptions};
use crate::ReceiverError;
use crate::raim::Raim;

impl Checks<'_> {
    pub(super) fn run_raim(&self, given: &RunOptions) -> Result<Raim, ReceiverError> {
        let tested = IntegritySettings::default();
        // Contradictions are told all the same: vector tracking must not start from one.
        let told = Raim::LeastSquares(IntegritySettings {
            most_faults: 0,
            ..tested
        });
        self.chosen(given.raim.as_deref(), told, tested)
    }

    pub(super) fn solve_raim(&self, given: &SolveOptions) -> Result<Raim, ReceiverError> {
        self.number("false-alarm", given.false_alarm, "1e-12 to 0.1", |p| {
            (1e-12..=0.1).contains(&p)
        })?;
        let default = IntegritySettings::default();
        let settings = IntegritySettings {
            false_alarm_probability: given.false_alarm.unwrap_or(default.false_alarm_probability),
            ..default
        };
        self.chosen(given.raim.as_deref(), Raim::None, settings)
    }

    fn chosen(
        &self,
        given: Option<&str>,
        none: Raim,
        settings: IntegritySettings,
    ) -> Result<Raim, ReceiverError> {
        let [ls, glr, pf, swarm] = [
            Raim::LeastSquares(settings),
            Raim::LikelihoodRatio(settings),
            Raim::Particles,
            Raim::Swarm,
        ]
        .map(|raim| (raim.name(), raim));
        let choices = [(Raim::None.name(), none), ls, glr, pf, swarm];
        self.choice("raim", given, ls.0, &choices)
    }
}
