//! When to search for which signals.

use std::collections::BTreeMap;

use gnss_signal::{AcquisitionHit, SearchRequest, SignalId, default_search};

/// The first search looks at this much from the first sample on, ms: enough for 33 dB-Hz.
const FIRST_SEARCH_MS: u32 = 60;
/// Later searches for what is not tracked look at this much, ms, ...
const LATER_SEARCH_MS: u32 = 60;
/// ... this often, s: satellites rise and buildings end slowly.
const LATER_PERIOD_S: f64 = 30.0;
/// ... or this often where nothing at all is tracked, s: a recording may begin before its antenna does.
const IDLE_PERIOD_S: f64 = 1.0;
/// A signal lost is looked for this often, s, ...
const LOST_PERIOD_S: f64 = 0.5;
/// ... for this long, s, ...
const LOST_MEMORY_S: f64 = 30.0;
/// ... this far from its last Doppler, Hz: 10 s of 1 g.
const LOST_HALF_WIDTH_HZ: f64 = 500.0;

/// Decides when to search.
#[derive(Debug)]
pub(super) struct Schedule {
    sample_rate_hz: f64,
    searched: bool,
    next_later_s: f64,
    next_idle_s: f64,
    next_lost_s: f64,
    lost: BTreeMap<SignalId, Lost>,
}

/// Where to look for a satellite of which nothing is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DopplerRange {
    /// Middle, Hz.
    pub(super) centre_hz: f64,
    /// Half the width, Hz.
    pub(super) half_width_hz: f64,
    /// Probability that noise alone yields any acquisition in one search.
    pub(super) false_alarm_probability: f64,
}

#[derive(Debug, Clone, Copy)]
struct Lost {
    since_s: f64,
    doppler_hz: f64,
}

impl Schedule {
    pub(super) fn new(sample_rate_hz: f64) -> Self {
        Self {
            sample_rate_hz,
            searched: false,
            next_later_s: LATER_PERIOD_S,
            next_idle_s: IDLE_PERIOD_S,
            next_lost_s: 0.0,
            lost: BTreeMap::new(),
        }
    }

    /// A channel lost its signal.
    pub(super) fn lost(&mut self, signal: SignalId, doppler_hz: f64, now_s: f64) {
        let lost = Lost {
            since_s: now_s,
            doppler_hz,
        };
        self.lost.insert(signal, lost);
    }

    /// A signal is tracked again.
    pub(super) fn found(&mut self, hit: &AcquisitionHit) {
        self.lost.remove(&hit.signal);
    }

    /// The searches due at `now` (a tick), given whether the samples end here, whether nothing is
    /// tracked, and which signals are wanted.
    pub(super) fn due(
        &mut self,
        now: u64,
        (ended, idle): (bool, bool),
        wanted: &[SignalId],
        range: &DopplerRange,
    ) -> Vec<SearchRequest> {
        let now_s = now as f64 / self.sample_rate_hz;
        if let Some(ms) = self.first_due(now_s, ended) {
            return vec![self.request(wanted.to_vec(), 0, ms, range)];
        }
        let span = (f64::from(LATER_SEARCH_MS + 2) * 1e-3 * self.sample_rate_hz) as u64;
        let start = now.saturating_sub(span);
        if now_s >= self.next_later_s || (idle && now_s >= self.next_idle_s) {
            self.next_later_s = now_s + LATER_PERIOD_S;
            self.next_idle_s = now_s + IDLE_PERIOD_S;
            return vec![self.request(wanted.to_vec(), start, LATER_SEARCH_MS, range)];
        }
        if now_s < self.next_lost_s {
            return Vec::new();
        }
        self.next_lost_s = now_s + LOST_PERIOD_S;
        self.lost.retain(|_, l| now_s - l.since_s < LOST_MEMORY_S);
        let lost = self.lost.iter().filter(|(s, _)| wanted.contains(s));
        lost.map(|(signal, lost)| SearchRequest {
            doppler_centre_hz: lost.doppler_hz,
            doppler_half_width_hz: LOST_HALF_WIDTH_HZ,
            ..self.request(vec![*signal], start, LATER_SEARCH_MS, range)
        })
        .collect()
    }

    /// Milliseconds of the first search where it is due; at the end of short samples, as many as
    /// there are.
    fn first_due(&mut self, now_s: f64, ended: bool) -> Option<u32> {
        if self.searched {
            return None;
        }
        // A last period that lacks a twentieth is taken for whole.
        let held_ms = (now_s * 1e3 + 0.05) as u32;
        self.searched = held_ms >= FIRST_SEARCH_MS || (ended && held_ms > 0);
        self.searched.then_some(held_ms.min(FIRST_SEARCH_MS))
    }

    fn request(
        &self,
        signals: Vec<SignalId>,
        start_tick: u64,
        duration_ms: u32,
        range: &DopplerRange,
    ) -> SearchRequest {
        let (coherent_periods, noncoherent_sums) = default_search(duration_ms);
        SearchRequest {
            signals,
            start_tick,
            doppler_centre_hz: range.centre_hz,
            doppler_half_width_hz: range.half_width_hz,
            coherent_periods,
            noncoherent_sums,
            false_alarm_probability: range.false_alarm_probability,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_nothing_is_tracked_it_searches_every_second() {
        let range = DopplerRange {
            centre_hz: 0.0,
            half_width_hz: 6e3,
            false_alarm_probability: 1e-3,
        };
        let signals = [SignalId::gps_l1_ca(7).unwrap()];
        // Ten seconds, a look a tenth of a second.
        let searches = |idle: bool| {
            let mut schedule = Schedule::new(1e6);
            let ticks = (1..=100).map(|k| k * 100_000);
            let due = ticks.map(|tick| schedule.due(tick, (false, idle), &signals, &range).len());
            due.sum::<usize>()
        };
        assert_eq!((searches(true), searches(false)), (11, 1));
    }
}
