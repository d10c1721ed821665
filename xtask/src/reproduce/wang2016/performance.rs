//! False alarms, delays and names of one statistic over many runs.

use serde::Serialize;

use super::setting::{STEPPED, STEPS_M};
use super::simulate::Run;
use crate::order::{median, quantile};

/// How one statistic does at one threshold; arrays are by step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Performance {
    /// Threshold.
    pub threshold: f64,
    /// Share of runs with an alarm in the 480 s before the onset.
    pub false_alarm_runs: f64,
    /// Share of runs with an alarm in the 60 s from the onset on.
    pub detected: [f64; 3],
    /// Median delay of the alarm, s; a run without one counts as 60 s.
    pub delay_median_s: [f64; 3],
    /// 95 % of delays are no longer, s.
    pub delay_p95_s: [f64; 3],
    /// Of the runs with an alarm, share that name the right satellite.
    pub identified: [f64; 3],
}

/// Delay (s) and whether the right satellite was named, of the first alarm after the onset.
fn alarm(run: &Run, statistic: usize, step: usize, threshold: f64) -> Option<(f64, bool)> {
    let decisions = &run.steps[step].decisions[statistic];
    let delay = decisions.iter().position(|(beta, _)| *beta > threshold)?;
    Some((delay as f64, decisions[delay].1 == STEPPED))
}

/// Delay of the first alarm after the onset, s; 60 without one.
#[must_use]
pub fn delay_s(run: &Run, statistic: usize, step: usize, threshold: f64) -> f64 {
    let undetected = run.steps[step].decisions[statistic].len() as f64;
    alarm(run, statistic, step, threshold).map_or(undetected, |(delay, _)| delay)
}

impl Performance {
    /// Of `statistic` in `runs` at `threshold`.
    #[must_use]
    pub fn new(runs: &[Run], statistic: usize, threshold: f64) -> Self {
        let false_alarms = runs
            .iter()
            .filter(|r| r.clean_largest[statistic] > threshold);
        let mut performance = Self {
            threshold,
            false_alarm_runs: false_alarms.count() as f64 / runs.len() as f64,
            detected: [0.0; 3],
            delay_median_s: [0.0; 3],
            delay_p95_s: [0.0; 3],
            identified: [0.0; 3],
        };
        for step in 0..STEPS_M.len() {
            let delays: Vec<f64> = runs
                .iter()
                .map(|r| delay_s(r, statistic, step, threshold))
                .collect();
            let alarms = runs
                .iter()
                .filter_map(|r| alarm(r, statistic, step, threshold));
            let named = alarms.clone().filter(|(_, right)| *right).count() as f64;
            let alarms = alarms.count() as f64;
            performance.detected[step] = alarms / runs.len() as f64;
            performance.identified[step] = if alarms > 0.0 { named / alarms } else { 0.0 };
            performance.delay_median_s[step] = median(delays.iter().copied());
            performance.delay_p95_s[step] = quantile(delays, 0.95);
        }
        performance
    }

    /// At the threshold that `share` of the runs exceed before the onset, at most.
    #[must_use]
    pub fn at_false_alarm_share(runs: &[Run], statistic: usize, share: f64) -> Self {
        let largest = runs.iter().map(|r| r.clean_largest[statistic]);
        Self::new(runs, statistic, quantile(largest, 1.0 - share))
    }
}

/// Mean.
#[must_use]
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::wang2016::simulate::StepRun;

    /// Alarms of one statistic at the given delay, naming the given satellite.
    fn run(clean: f64, delay: usize, satellite: usize) -> Run {
        let mut decisions = vec![(0.0, satellite); 60];
        for decision in decisions.iter_mut().skip(delay) {
            decision.0 = 30.0;
        }
        let step = StepRun {
            decisions: vec![decisions],
            effective: 40.0,
            error_m: 1.0,
        };
        Run {
            clean_largest: vec![clean],
            clean_square_m2: 1.0,
            spread_m: 1.0,
            steps: vec![step; 3],
        }
    }

    #[test]
    fn delays_names_and_false_alarms_are_counted() {
        let runs = [
            run(1.0, 2, 0),
            run(25.0, 4, 0),
            run(3.0, 60, 0),
            run(2.0, 10, 5),
        ];
        let found = Performance::new(&runs, 0, 20.0);
        assert_eq!(found.false_alarm_runs, 0.25);
        assert_eq!(found.detected, [0.75; 3]);
        assert_eq!(found.delay_median_s, [7.0; 3]);
        assert_eq!(found.delay_p95_s, [60.0; 3]);
        assert_eq!(found.identified, [2.0 / 3.0; 3]);
        let equal = Performance::at_false_alarm_share(&runs, 0, 0.25);
        assert_eq!((equal.threshold, equal.false_alarm_runs), (3.0, 0.25));
    }

    #[test]
    fn a_mean_is_that_of_all() {
        assert_eq!(mean((1..=20).map(f64::from)), 10.5);
    }
}
