//! What befalls the strength of all channels together: interference, a tunnel, a tilted antenna.

use std::collections::BTreeMap;

use super::feature::{DECADE_DB, strength};
use super::usual::Usual;

/// Fewest other channels that tell what is common to all.
const FEWEST_OTHERS: usize = 3;

/// The C/N0 of one channel at one update of the navigation filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelStrength {
    /// Whose, as in [`ChannelStep::satellite`](super::ChannelStep::satellite).
    pub satellite: u32,
    /// C/N0, smoothed, dB-Hz.
    pub cn0_dbhz: f64,
    /// C/N0 by the last integration alone, Hz.
    pub cn0_now_hz: f64,
}

/// By how much the C/N0 of a channel, or of several in the median, is another than before.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct StrengthChange {
    /// Smoothed C/N0 against what the channel is used to, dB.
    pub smoothed_db: f64,
    /// That of the last integration against the smoothed one, dB.
    pub now_db: f64,
}

/// What every channel is used to, and by how much it has changed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CommonStrength {
    /// By satellite, in tens of decibels about 40 dB-Hz.
    usual: BTreeMap<u32, Usual>,
    changes: BTreeMap<u32, StrengthChange>,
}

impl CommonStrength {
    /// Takes in all `channels` of an update that see their signals, well or badly. Another one is forgotten.
    pub fn follow(&mut self, channels: &[ChannelStrength]) {
        let is_here = |satellite: &u32| channels.iter().any(|c| c.satellite == *satellite);
        self.usual.retain(|satellite, _| is_here(satellite));
        let passing: Vec<f64> = channels.iter().map(|c| self.befell(c.satellite)).collect();
        self.changes.clear();
        for (channel, passing) in channels.iter().zip(passing) {
            let Ok((cn0, power)) = strength(channel.cn0_dbhz, channel.cn0_now_hz) else {
                continue;
            };
            let usual = self.usual.entry(channel.satellite);
            let usual = usual.or_insert(Usual::NEW);
            usual.follow(cn0, passing);
            let change = StrengthChange {
                smoothed_db: DECADE_DB * (cn0 - usual.value()),
                now_db: DECADE_DB * power,
            };
            self.changes.insert(channel.satellite, change);
        }
    }

    /// What befell all channels that were there before that of `satellite`, in tens of decibels.
    fn befell(&self, satellite: u32) -> f64 {
        let steps = |satellite| self.usual.get(satellite).map_or(0.0, Usual::steps);
        let own = steps(&satellite);
        let older = self.changes.iter().filter(|(s, _)| steps(s) > own);
        median(older.map(|(_, change)| change.smoothed_db)) / DECADE_DB
    }

    /// By how much all channels but that of `satellite` have changed, in the median; by nothing where fewer than three
    /// others have numbers.
    #[must_use]
    pub fn of_others(&self, satellite: u32) -> StrengthChange {
        let others = self.changes.iter().filter(|(s, _)| **s != satellite);
        let others = others.map(|(_, change)| change);
        StrengthChange {
            smoothed_db: median(others.clone().map(|change| change.smoothed_db)),
            now_db: median(others.map(|change| change.now_db)),
        }
    }
}

/// Zero of too few.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let (below, above) = (sorted.len().saturating_sub(1) / 2, sorted.len() / 2);
    match (sorted.get(below), sorted.get(above)) {
        (Some(below), Some(above)) if sorted.len() >= FEWEST_OTHERS => (below + above) / 2.0,
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;

    /// Satellites 1, 2, ... with this C/N0, dB-Hz, by the last integration too.
    fn channels(cn0_dbhz: &[f64]) -> Vec<ChannelStrength> {
        let strength = |(satellite, cn0_dbhz): (u32, &f64)| ChannelStrength {
            satellite,
            cn0_dbhz: *cn0_dbhz,
            cn0_now_hz: 10_f64.powf(cn0_dbhz / 10.0),
        };
        (1..).zip(cn0_dbhz).map(strength).collect()
    }

    /// After a long time with this C/N0.
    fn used_to(cn0_dbhz: &[f64]) -> CommonStrength {
        let mut common = CommonStrength::default();
        for _ in 0..1000 {
            common.follow(&channels(cn0_dbhz));
        }
        common
    }

    #[test]
    fn what_all_lose_is_common_and_what_one_loses_is_its_own() {
        let mut common = used_to(&[50.0, 48.0, 40.0, 45.0, 36.0]);
        for satellite in 1..6 {
            let others = common.of_others(satellite);
            assert_eq!(others.smoothed_db, 0.0);
            // At 40 to 50 dB-Hz a sum of 20 ms is hardly more than its signal.
            assert!(others.now_db.abs() < 0.1, "{others:?}");
        }
        // The first loses 10 dB, and then all lose 6.
        common.follow(&channels(&[40.0, 48.0, 40.0, 45.0, 36.0]));
        for satellite in 1..6 {
            assert!(common.of_others(satellite).smoothed_db.abs() < 0.1);
        }
        common.follow(&channels(&[34.0, 42.0, 34.0, 39.0, 30.0]));
        for satellite in 1..6 {
            let others = common.of_others(satellite);
            assert_abs_diff_eq!(others.smoothed_db, -6.0, epsilon = 0.1);
        }
    }

    #[test]
    fn the_last_integration_tells_before_the_smoothed_one_does() {
        let mut common = CommonStrength::default();
        let mut now = channels(&[45.0; 6]);
        common.follow(&now);
        now.iter_mut().for_each(|c| c.cn0_now_hz /= 10.0);
        common.follow(&now);
        let others = common.of_others(2);
        assert_eq!(others.smoothed_db, 0.0);
        assert_abs_diff_eq!(others.now_db, -10.0, epsilon = 0.1);
    }

    #[test]
    fn channels_that_come_back_under_interference_do_not_hide_it() {
        let mut common = used_to(&[45.0; 9]);
        for _ in 0..50 {
            common.follow(&channels(&[37.0; 4]));
        }
        for _ in 0..50 {
            common.follow(&channels(&[37.0; 9]));
        }
        for satellite in [1, 9] {
            let smoothed_db = common.of_others(satellite).smoothed_db;
            assert!((-8.0..-6.0).contains(&smoothed_db), "{smoothed_db}");
        }
    }

    #[test]
    fn few_channels_and_those_without_numbers_say_nothing() {
        let nothing = StrengthChange::default();
        let mut common = CommonStrength::default();
        assert_eq!(common.of_others(1), nothing);
        common.follow(&channels(&[45.0; 3]));
        common.follow(&channels(&[35.0; 3]));
        assert_eq!(common.of_others(1), nothing);
        let mut common = used_to(&[45.0, 45.0, 45.0, f64::NAN]);
        common.follow(&channels(&[35.0, 35.0, 35.0, f64::NAN]));
        assert_eq!(common.of_others(1), nothing);
        assert!(common.of_others(4).smoothed_db < -9.0);
        // One that comes back is not held against what it was.
        common.follow(&channels(&[35.0]));
        common.follow(&channels(&[35.0, 25.0, 25.0, 25.0]));
        assert_eq!(common.of_others(1).smoothed_db, 0.0);
    }
}
