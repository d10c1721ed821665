//! From scalar to vector tracking and back, and the epochs between.

use gnss_nav::least_squares::{Consistency, Solution};
use gnss_signal::CorrelatorBank;

use super::fixes::tracked;
use super::navigated::Navigated;
use super::navigator::{Navigator, Tracked};
use super::report;
use super::run::{Fixed, Run};
use super::vector::{self, Outlook, Surroundings, Time, VectorTracking};
use crate::ReceiverError;
use crate::record::{ChannelRecord, EventKind, LoopMembership, Record};

/// Successive consistent fixes before the filter takes over: one may agree by chance.
const FIXES_TO_SWITCH: u32 = 3;
/// Range rates of a snapshot that fit one velocity miss it by less, m/s; those of an inverted spectrum by
/// hundreds.
const RATE_AGREEMENT_MPS: f64 = 10.0;

impl<B: CorrelatorBank> Run<'_, B> {
    /// Switches to vector tracking once fixes agree with themselves and the clock is exact.
    pub(super) fn consider_vector_tracking(
        &mut self,
        now: u64,
        navigated: &Navigated,
    ) -> Result<(), ReceiverError> {
        let time_s = self.time_s(now);
        let Some(settings) = self.settings.filter_at(time_s) else {
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
        let Some(around) = surroundings(&self.navigator, now, Time::Exact) else {
            return Ok(());
        };
        let model = self.navigator.model();
        let (raw, monitors) = (&navigated.raw, self.monitors.clone());
        let started = VectorTracking::start(&around, solution, raw, model, settings, monitors);
        let Some(tracking) = where_numbers_allow(started)? else {
            self.consistent_fixes = 0;
            return Ok(());
        };
        self.take_helm(now, tracking, Time::Exact)
    }

    /// Begins vector tracking before any bit boundary is known, by a snapshot that agrees with itself.
    pub(super) fn consider_early_tracking(&mut self, now: u64) -> Result<(), ReceiverError> {
        let time_s = self.time_s(now);
        let Some(settings) = self.settings.filter_at(time_s) else {
            return Ok(());
        };
        let waits = self.vector.is_none() && self.navigator.coarse_time(now).is_some();
        if !waits || self.slots.iter().any(|slot| slot.bits_found) {
            return Ok(());
        }
        let tracked = tracked(now, &mut self.slots);
        let found = self.navigator.snapshot(now, &tracked);
        let found = found.filter(|found| agrees(&found.solution));
        let around = surroundings(&self.navigator, now, Time::Coarse);
        let (Some(found), Some(around)) = (found, around) else {
            return Ok(());
        };
        let epochs: Vec<_> = tracked
            .iter()
            .map(|t| (t.slot.satellite, t.epoch))
            .collect();
        let model = self.navigator.model();
        let monitors = self.monitors.clone();
        let started =
            VectorTracking::start_early(&around, &found, &epochs, model, settings, monitors);
        let Some(tracking) = where_numbers_allow(started)? else {
            return Ok(());
        };
        self.take_helm(now, tracking, Time::Coarse)?;
        self.report_fix(now, Fixed::Now)
    }

    /// Steers all channels from here on.
    fn take_helm(
        &mut self,
        now: u64,
        tracking: VectorTracking,
        time: Time,
    ) -> Result<(), ReceiverError> {
        if let Some(around) = surroundings(&self.navigator, now, time) {
            tracking.steer(&around, &[], &mut self.slots);
        }
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
        let Some(around) = surroundings(&self.navigator, now, tracking.time()) else {
            self.vector = Some(tracking);
            return self.leave_vector_tracking(now);
        };
        let model = self.navigator.model();
        let Some(epoch) = where_numbers_allow(tracking.epoch(&around, &model, &mut self.slots))?
        else {
            self.vector = Some(tracking);
            return self.leave_vector_tracking(now);
        };
        self.navigator.follow(now, tracking.state());
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
            Outlook::Exact => self.leave_vector_tracking(now),
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
            slot.channel.release(vector::RELEASED_VARIANCE_CHIPS2);
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

/// Whether code phases and Dopplers of a snapshot fit one position and one velocity.
fn agrees(solution: &Solution) -> bool {
    let misses = |residual_mps: f64| residual_mps.abs() > RATE_AGREEMENT_MPS;
    let mut residuals = solution
        .satellites
        .iter()
        .filter_map(|s| s.range_rate_residual_mps);
    solution.consistency == Consistency::Passed
        && solution.velocity.is_some()
        && !residuals.any(misses)
}

/// What the channels of an epoch share; `None` where the clock is not known so.
pub(super) fn surroundings(
    navigator: &Navigator,
    tick: u64,
    time: Time,
) -> Option<Surroundings<'_>> {
    let receive_time = match time {
        Time::Exact => navigator.receive_time(tick),
        Time::Coarse => navigator.coarse_time(tick),
    };
    Some(Surroundings {
        tick,
        receive_time: receive_time?,
        store: &navigator.store,
    })
}
