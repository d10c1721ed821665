//! Which satellites vector tracking follows: those that rise join by prediction, without a search,
//! those that set leave.

use std::collections::BTreeMap;

use gnss_nav::SatelliteId;
use gnss_nav::prediction::Expected;
use gnss_signal::tracking::Lock;
use gnss_signal::{CorrelatorBank, SignalId};

use super::run::Run;
use super::slot::Slot;
use super::vector::{Time, VectorTracking};
use super::vector_mode::surroundings;
use crate::ReceiverError;
use crate::record::EventKind;

/// How often satellites are looked over, s.
const LOOK_PERIOD_S: f64 = 1.0;
/// A predicted signal that was not heard for so long, s, is not there ...
const PATIENCE_S: f64 = 10.0;
/// ... and is tried again after this, s.
const RETRY_S: f64 = 30.0;
/// A satellite leaves this far below the mask at which it joined, rad (half a degree), so that it does
/// not come and go.
const SETTING_RAD: f64 = 0.0087;

impl<B: CorrelatorBank> Run<'_, B> {
    /// Opens and closes channels by what is expected of the sky, once a second.
    pub(super) fn look_over_sky(
        &mut self,
        now: u64,
        tracking: &VectorTracking,
    ) -> Result<(), ReceiverError> {
        self.announce_heard(now)?;
        let now_s = self.time_s(now);
        if now_s < self.next_look_s {
            return Ok(());
        }
        self.next_look_s = now_s + LOOK_PERIOD_S;
        let Some(around) = surroundings(&self.navigator, now, Time::Exact) else {
            return Ok(());
        };
        let signals = self.settings.signals.iter();
        let sky: BTreeMap<SignalId, Expected> = signals
            .filter_map(|s| Some((*s, tracking.expected(&around, SatelliteId::gps(s.prn()))?)))
            .collect();
        self.let_go(now, &sky)?;
        for (signal, expected) in &sky {
            let tracked = self.slots.iter().any(|s| s.channel.signal() == *signal);
            let waiting = self.silent_until_s.get(signal).is_some_and(|s| now_s < *s);
            if self.is_up(expected) && !tracked && !waiting {
                self.join(now, *signal, expected);
            }
        }
        Ok(())
    }

    fn is_up(&self, expected: &Expected) -> bool {
        expected.look.elevation_rad > self.settings.elevation_mask_rad
    }

    fn join(&mut self, tick: u64, signal: SignalId, expected: &Expected) {
        let slot = Slot::predicted(signal, self.front_end, self.tracking, tick, expected);
        self.slots.push(slot.watched(self.shape.clone()));
        self.slots.sort_by_key(|s| s.satellite);
    }

    /// Reports predicted signals once they are heard.
    fn announce_heard(&mut self, now: u64) -> Result<(), ReceiverError> {
        let heard = |s: &&mut Slot| !s.announced && s.predicted && s.channel.lock() != Lock::Lost;
        let mut signals = Vec::new();
        for slot in self.slots.iter_mut().filter(heard) {
            slot.hit.cn0_dbhz = slot.channel.cn0_dbhz().unwrap_or_default();
            signals.push(slot.channel.signal());
        }
        signals
            .into_iter()
            .try_for_each(|signal| self.announce(now, signal))
    }

    /// Closes the channels of satellites that have set, and of predicted ones that stay silent.
    fn let_go(
        &mut self,
        now: u64,
        sky: &BTreeMap<SignalId, Expected>,
    ) -> Result<(), ReceiverError> {
        let now_s = self.time_s(now);
        let lowest_rad = self.settings.elevation_mask_rad - SETTING_RAD;
        let mut gone = Vec::new();
        for slot in &self.slots {
            let expected = sky.get(&slot.channel.signal());
            let set = expected.is_some_and(|e| e.look.elevation_rad < lowest_rad);
            let age_s = now_s - self.time_s(slot.hit.tick);
            let silent = slot.predicted && !slot.announced && age_s > PATIENCE_S;
            if slot.channel.is_steered() && (set || silent) {
                gone.push((slot.satellite, slot.channel.signal(), slot.announced));
            }
        }
        for (satellite, signal, announced) in gone {
            self.slots.retain(|s| s.satellite != satellite);
            self.silent_until_s.insert(signal, now_s + RETRY_S);
            if announced {
                self.emit(now, Some(satellite), EventKind::Dropped)?;
            }
        }
        Ok(())
    }
}
