//! From scalar to vector tracking and back, and the epochs between.

use gnss_signal::CorrelatorBank;

use super::navigator::{Navigated, Navigator, Tracked};
use super::report;
use super::run::{Fixed, Run};
use super::vector::{self, Outlook, Surroundings, VectorTracking};
use crate::ReceiverError;
use crate::record::{ChannelRecord, EventKind, LoopMembership, Record};

/// Successive consistent fixes before the filter takes over: one may agree by chance.
const FIXES_TO_SWITCH: u32 = 3;
/// Deviation of the code phase when channels get their own loops back, chips.
const RELEASED_SIGMA_CHIPS: f64 = 0.1;

impl<B: CorrelatorBank> Run<'_, B> {
    /// Switches to vector tracking once fixes agree with themselves and the clock is exact.
    pub(super) fn consider_vector_tracking(
        &mut self,
        now: u64,
        navigated: &Navigated,
    ) -> Result<(), ReceiverError> {
        let Some(settings) = &self.settings.vector else {
            return Ok(());
        };
        let exact = self.navigator.receive_time(now).is_some();
        let Some(solution) = navigated.consistent().filter(|_| exact) else {
            self.consistent_fixes = 0;
            return Ok(());
        };
        self.consistent_fixes += 1;
        if self.consistent_fixes < FIXES_TO_SWITCH {
            return Ok(());
        }
        let Some(around) = surroundings(&self.navigator, now) else {
            return Ok(());
        };
        let model = self.navigator.model();
        let (raw, monitors) = (&navigated.raw, self.monitors.clone());
        let started = VectorTracking::start(&around, solution, raw, model, settings, monitors);
        let Some(tracking) = where_numbers_allow(started)? else {
            self.consistent_fixes = 0;
            return Ok(());
        };
        tracking.steer(&around, &[], &mut self.slots);
        self.vector = Some(tracking);
        let to = LoopMembership::Vector;
        self.emit(now, None, EventKind::ModeSwitched { to })
    }

    /// An epoch of vector tracking; its records are written where they are `due`.
    pub(super) fn navigate_by_filter(&mut self, now: u64, due: bool) -> Result<(), ReceiverError> {
        let Some(mut tracking) = self.vector.take() else {
            return Ok(());
        };
        let since_s = self.time_s(now - tracking.tick);
        // Where the samples end on an epoch they end there once more.
        if now == tracking.tick || !(due || tracking.is_due(since_s)) {
            self.vector = Some(tracking);
            return Ok(());
        }
        let Some(around) = surroundings(&self.navigator, now) else {
            return self.leave_vector_tracking(now);
        };
        let model = self.navigator.model();
        let Some(epoch) = where_numbers_allow(tracking.epoch(&around, &model, &mut self.slots))?
        else {
            self.vector = Some(tracking);
            return self.leave_vector_tracking(now);
        };
        self.navigator.follow(tracking.state());
        self.look_over_sky(now, &tracking)?;
        for (satellite, kind) in epoch.events.clone() {
            self.emit(now, satellite, kind)?;
        }
        let fixed = if tracking.is_fixed() {
            Fixed::Now
        } else {
            Fixed::Before
        };
        self.report_fix(now, fixed)?;
        let outlook = tracking.outlook;
        if due {
            self.report_epoch(now, &tracking, &epoch)?;
        }
        self.vector = Some(tracking);
        match outlook {
            Outlook::Goes => Ok(()),
            Outlook::Lost => {
                self.leave_vector_tracking(now)?;
                self.abandon_channels(now)
            }
            Outlook::Contradicted => {
                self.navigator.time_jumped();
                self.leave_vector_tracking(now)
            }
            Outlook::Slipped => {
                self.navigator.time_jumped();
                self.leave_vector_tracking(now)?;
                self.abandon_channels(now)
            }
        }
    }

    fn report_epoch(
        &mut self,
        now: u64,
        tracking: &VectorTracking,
        epoch: &vector::Epoch,
    ) -> Result<(), ReceiverError> {
        let time_s = self.time_s(now);
        if let Some(time) = self.navigator.receive_time(now) {
            let observations = vector::observations(time_s, time, epoch, &mut self.slots);
            (self.sink)(Record::Observations(observations))?;
        }
        let mut records: Vec<ChannelRecord> = epoch
            .members
            .iter()
            .map(|member| tracking.channel(time_s, member))
            .collect();
        records.extend(self.unsteered(now));
        records.sort_by_key(|record| record.satellite);
        for record in records {
            (self.sink)(Record::Channel(record))?;
        }
        (self.sink)(Record::Pvt(tracking.pvt(time_s, epoch)))
    }

    /// Records of the channels that still pull in.
    fn unsteered(&mut self, now: u64) -> Vec<ChannelRecord> {
        let time_s = self.time_s(now);
        let unsteered = self.slots.iter_mut().filter(|s| !s.channel.is_steered());
        unsteered
            .filter_map(|slot| {
                let epoch = slot.channel.epoch(now)?;
                let tracked = Tracked { slot, epoch };
                Some(report::channel(time_s, &tracked, &Navigated::nothing()))
            })
            .collect()
    }

    /// Gives every channel its own loops back.
    pub(super) fn leave_vector_tracking(&mut self, now: u64) -> Result<(), ReceiverError> {
        self.consistent_fixes = 0;
        if self.vector.take().is_none() {
            return Ok(());
        }
        for slot in &mut self.slots {
            slot.channel
                .release(RELEASED_SIGMA_CHIPS * RELEASED_SIGMA_CHIPS);
        }
        let to = LoopMembership::Scalar;
        self.emit(now, None, EventKind::ModeSwitched { to })
    }

    /// Lets go of all channels and looks for their signals where they were.
    fn abandon_channels(&mut self, now: u64) -> Result<(), ReceiverError> {
        let now_s = self.time_s(now);
        for slot in std::mem::take(&mut self.slots) {
            let signal = slot.channel.signal();
            self.schedule.lost(signal, slot.channel.doppler_hz(), now_s);
            self.emit(now, Some(slot.satellite), EventKind::Dropped)?;
        }
        Ok(())
    }
}

/// A result, or none where numbers made it impossible: a singular geometry, a covariance that overflows,
/// an innovation that is none. Scalar tracking then goes on; other errors end the run.
fn where_numbers_allow<T>(result: Result<T, ReceiverError>) -> Result<Option<T>, ReceiverError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(ReceiverError::Nav(_) | ReceiverError::Monitor(_)) => Ok(None),
        Err(other) => Err(other),
    }
}

/// What the channels of an epoch share; `None` before the clock is exact.
pub(super) fn surroundings(navigator: &Navigator, tick: u64) -> Option<Surroundings<'_>> {
    Some(Surroundings {
        tick,
        receive_time: navigator.receive_time(tick)?,
        store: &navigator.store,
    })
}
