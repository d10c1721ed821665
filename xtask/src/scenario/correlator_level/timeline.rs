//! Ticks that are delivered against samples at the antenna, which include those lost.

use crate::scenario::antenna::{Gap, Scene};

/// Where delivered ticks lie among the samples at the antenna.
///
/// A gap takes the samples at or after its begin and before its end.
#[derive(Debug, Clone)]
pub(super) struct Timeline {
    pub(super) rate_hz: f64,
    /// Ticks delivered in all.
    pub(super) length_ticks: u64,
    /// First tick after each gap, and samples lost up to there.
    gaps: Vec<(u64, u64)>,
}

impl Timeline {
    pub(super) fn new(scene: &Scene) -> Self {
        let rate_hz = scene.reception.samples.sample_rate_hz;
        let mut lost = 0;
        let mut gaps = Vec::new();
        for Gap {
            begin_s,
            duration_s,
        } in &scene.gaps
        {
            let (first, end) = (
                sample_at(*begin_s, rate_hz),
                sample_at(begin_s + duration_s, rate_hz),
            );
            let tick = first.saturating_sub(lost);
            lost += end.saturating_sub(first);
            gaps.push((tick, lost));
        }
        Self {
            rate_hz,
            length_ticks: scene.length_ticks(),
            gaps,
        }
    }

    /// Samples lost before `tick`, and the end of the ticks that follow it without a gap.
    pub(super) fn run(&self, tick: u64) -> (u64, u64) {
        let before = self.gaps.partition_point(|(first, _)| *first <= tick);
        let lost = self.gaps[..before].last().map_or(0, |(_, lost)| *lost);
        let end = self.gaps.get(before).map_or(u64::MAX, |(first, _)| *first);
        (lost, end)
    }

    /// Elapsed time at `tick`, s.
    pub(super) fn elapsed_s(&self, tick: u64) -> f64 {
        (tick + self.run(tick).0) as f64 / self.rate_hz
    }
}

/// The first sample at or after `elapsed_s`.
pub(super) fn sample_at(elapsed_s: f64, rate_hz: f64) -> u64 {
    // An instant meant to be that of a sample is off by rounding.
    (elapsed_s * rate_hz - 1e-6).ceil().max(0.0) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_lost_moves_what_follows() {
        let timeline = Timeline {
            rate_hz: 1e6,
            length_ticks: 1_000,
            gaps: vec![(100, 50), (300, 60)],
        };
        assert_eq!(timeline.run(99), (0, 100));
        assert_eq!(timeline.run(100), (50, 300));
        assert_eq!(timeline.run(300), (60, u64::MAX));
        // Sample 150 is the hundredth delivered.
        assert_eq!(timeline.elapsed_s(100), 150e-6);
    }

    #[test]
    fn instants_take_the_sample_at_or_after_them() {
        // 0.3 * 1e6 is not a whole number in binary.
        assert_eq!(sample_at(0.3, 1e6), 300_000);
        assert_eq!(sample_at(0.300_000_4, 1e6), 300_001);
        assert_eq!(sample_at(-1.0, 1e6), 0);
    }
}
