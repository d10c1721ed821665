//! Ephemerides by satellite and issue.

use std::collections::BTreeMap;

use super::Ephemeris;
use crate::{GpsTime, SatelliteId};

/// Every issue of ephemeris known of each satellite.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct EphemerisStore {
    issues: BTreeMap<SatelliteId, Vec<Ephemeris>>,
}

impl EphemerisStore {
    /// An empty store.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds `ephemeris`; false if this issue (satellite, IODE, IODC, `toe`, `toc`) is already there.
    pub fn insert(&mut self, ephemeris: Ephemeris) -> bool {
        let issues = self.issues.entry(ephemeris.satellite).or_default();
        let known = issues.iter().any(|other| same_issue(other, &ephemeris));
        if !known {
            issues.push(ephemeris);
        }
        !known
    }

    /// The issue of `satellite` to use at `time`: of those whose curve fit interval contains
    /// `time` the one whose `toe` is nearest, as post-processing programs choose; of two equally
    /// near the later `toe`, of two with the same the one learned last, which corrects the other. Health
    /// is not judged.
    #[must_use]
    pub fn select(&self, satellite: SatelliteId, time: GpsTime) -> Option<&Ephemeris> {
        self.issues
            .get(&satellite)?
            .iter()
            .rev()
            .filter(|ephemeris| ephemeris.is_valid_at(time))
            .min_by(|a, b| {
                let age = |e: &Ephemeris| (time - e.toe).abs();
                age(a)
                    .total_cmp(&age(b))
                    .then((b.toe - a.toe).total_cmp(&0.0))
            })
    }

    /// Satellites with at least one issue, in order.
    pub fn satellites(&self) -> impl Iterator<Item = SatelliteId> + '_ {
        self.issues.keys().copied()
    }

    /// Every issue, by satellite and then in the order of insertion.
    pub fn iter(&self) -> impl Iterator<Item = &Ephemeris> {
        self.issues.values().flatten()
    }

    /// Whether nothing is known.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.issues.is_empty()
    }
}

impl Extend<Ephemeris> for EphemerisStore {
    fn extend<T: IntoIterator<Item = Ephemeris>>(&mut self, ephemerides: T) {
        for ephemeris in ephemerides {
            self.insert(ephemeris);
        }
    }
}

impl FromIterator<Ephemeris> for EphemerisStore {
    fn from_iter<T: IntoIterator<Item = Ephemeris>>(ephemerides: T) -> Self {
        let mut store = Self::new();
        store.extend(ephemerides);
        store
    }
}

fn same_issue(a: &Ephemeris, b: &Ephemeris) -> bool {
    (a.iode, a.iodc, a.toe, a.toc) == (b.iode, b.iodc, b.toe, b.toc)
}
