//! The fault logic of Li2019: what skipped measurements of several epochs add up to.

use std::collections::BTreeMap;

use super::disposition::{SkipReason, Skipped, Update};
use super::innovation::Innovations;
use crate::{NavError, SatelliteId};

/// Longest window, epochs: one bit each.
const LONGEST_WINDOW: u32 = 64;

/// When skipped measurements mean more than chance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FaultThresholds {
    /// Epochs looked back on, 1 to 64. Default 10: a second at 10 Hz.
    pub window_epochs: u32,
    /// A channel disagrees when in so many of these the gate skipped one of its measurements.
    /// Default 5: with a gate of 4 standard deviations a healthy channel gets there by chance once
    /// in 1e17 windows, a lost one after half a second.
    pub epochs_to_isolate: u32,
    /// A reset is due when more than this fraction of the channels (and more than one) disagree.
    /// Default 0.5: then it is more likely the filter that is wrong.
    pub fraction_to_reset: f64,
}

impl Default for FaultThresholds {
    fn default() -> Self {
        Self {
            window_epochs: 10,
            epochs_to_isolate: 5,
            fraction_to_reset: 0.5,
        }
    }
}

/// What the skipped measurements call for. It is advice: nothing here acts on it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Advice {
    /// No channel disagrees.
    Nothing,
    /// Isolate these channels, in order.
    Isolate(Vec<SatelliteId>),
    /// Most channels disagree: reset the filter. In order, the ones that do.
    Reset(Vec<SatelliteId>),
}

/// Counts skipped measurements by satellite and epoch.
#[derive(Debug, Clone)]
pub struct FaultLogic {
    thresholds: FaultThresholds,
    channels: BTreeMap<SatelliteId, History>,
}

/// The epochs of the window, the newest in the lowest bit.
#[derive(Debug, Clone, Copy, Default)]
struct History {
    offered: u64,
    skipped: u64,
}

impl History {
    fn shift(&mut self, window_epochs: u32) {
        let window = u64::MAX >> (LONGEST_WINDOW - window_epochs);
        self.offered = (self.offered << 1) & window;
        self.skipped = (self.skipped << 1) & window;
    }
}

impl FaultLogic {
    /// With nothing counted yet.
    ///
    /// # Errors
    /// [`NavError::Value`] for a window outside 1 to 64 epochs, a count outside it, or a fraction
    /// outside 0 to 1.
    pub fn new(thresholds: FaultThresholds) -> Result<Self, NavError> {
        let t = &thresholds;
        let refuse = |name, value: String, expected| {
            Err(NavError::Value {
                name,
                value,
                expected,
            })
        };
        if !(1..=LONGEST_WINDOW).contains(&t.window_epochs) {
            return refuse(
                "fault window, epochs",
                t.window_epochs.to_string(),
                "1 to 64",
            );
        }
        if !(1..=t.window_epochs).contains(&t.epochs_to_isolate) {
            let value = t.epochs_to_isolate.to_string();
            return refuse("epochs to isolate", value, "1 to the length of the window");
        }
        if !(0.0..=1.0).contains(&t.fraction_to_reset) {
            return refuse(
                "fraction to reset",
                t.fraction_to_reset.to_string(),
                "0 to 1",
            );
        }
        Ok(Self {
            thresholds,
            channels: BTreeMap::new(),
        })
    }

    /// Takes in an epoch and says what the window now calls for. Satellites excluded or below the
    /// mask take no part in it; one that does not for a whole window is forgotten.
    pub fn observe(&mut self, innovations: &Innovations, update: &Update) -> Advice {
        for history in self.channels.values_mut() {
            history.shift(self.thresholds.window_epochs);
        }
        for one in innovations.satellites() {
            let mut reasons = reasons(one.satellite, &update.skipped);
            if reasons.clone().all(|reason| reason == SkipReason::Gate) {
                let history = self.channels.entry(one.satellite).or_default();
                history.offered |= 1;
                history.skipped |= u64::from(reasons.next().is_some());
            }
        }
        self.channels.retain(|_, history| history.offered != 0);
        self.advice()
    }

    fn advice(&self) -> Advice {
        let disagreeing: Vec<SatelliteId> = self
            .channels
            .iter()
            .filter(|(_, h)| h.skipped.count_ones() >= self.thresholds.epochs_to_isolate)
            .map(|(&satellite, _)| satellite)
            .collect();
        let most = self.thresholds.fraction_to_reset * self.channels.len() as f64;
        match disagreeing.len() {
            0 => Advice::Nothing,
            n if n > 1 && n as f64 > most => Advice::Reset(disagreeing),
            _ => Advice::Isolate(disagreeing),
        }
    }

    /// Epochs of the window in which a measurement of `satellite` was skipped by the gate.
    #[must_use]
    pub fn skipped_epochs(&self, satellite: SatelliteId) -> u32 {
        self.channels
            .get(&satellite)
            .map_or(0, |history| history.skipped.count_ones())
    }

    /// Forgets one channel, as after a loss of lock.
    pub fn forget(&mut self, satellite: SatelliteId) {
        self.channels.remove(&satellite);
    }

    /// Forgets everything, as after a reset.
    pub fn clear(&mut self) {
        self.channels.clear();
    }
}

/// Why measurements of `satellite` were skipped.
fn reasons(
    satellite: SatelliteId,
    skipped: &[Skipped],
) -> impl Iterator<Item = SkipReason> + Clone + '_ {
    skipped
        .iter()
        .filter(move |s| s.satellite == satellite)
        .map(|s| s.reason)
}
