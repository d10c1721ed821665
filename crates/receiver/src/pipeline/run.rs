//! The loop over a run's samples.

use std::collections::{BTreeMap, BTreeSet};

use fault_ml::shape::SHAPE_TAPS_CHIPS;
use gnss_nav::SatelliteId;
use gnss_signal::tracking::{NoiseFloor, Spectrum, TrackingSettings};
use gnss_signal::{CorrelatorBank, FrontEnd, Replica, SignalId, TapOffsets, Taps};

use super::discontinuity;
use super::navigator::Navigator;
use super::outcome::{Outcome, why_no_fix};
use super::schedule::Schedule;
use super::settings::Settings;
use super::shape::ShapeWatch;
use super::slot::Slot;
use super::spectrum::SpectrumSense;
use super::vector::{Monitor, VectorSettings, VectorTracking};
use crate::ReceiverError;
use crate::record::{Event, EventKind, Record};

/// Samples brought in at a time, s: short enough to report promptly, long enough to be cheap.
const STEP_S: f64 = 0.02;
/// A code that no satellite transmits, to listen to the noise.
const NOISE_PRN: u8 = 37;

/// Runs the receiver over all samples of `bank` and hands every record to `sink`.
///
/// # Errors
/// Where the samples cannot be read or `sink` fails.
pub fn run<B: CorrelatorBank>(
    bank: B,
    settings: &Settings,
    sink: &mut dyn FnMut(Record) -> Result<(), ReceiverError>,
) -> Result<Outcome, ReceiverError> {
    let front_end = bank.front_end();
    let unused = SignalId::gps_l1_ca(NOISE_PRN)?;
    let monitors = settings.vector.as_ref().map(VectorSettings::monitors);
    let mut run = Run {
        noise: NoiseFloor::new(unused, front_end)?,
        navigator: Navigator::new(settings, front_end.sample_rate_hz)?,
        schedule: Schedule::new(front_end.sample_rate_hz),
        spectrum: SpectrumSense::default(),
        tracking: tracking(settings)?,
        shape: ShapeWatch::new(settings)?,
        bank,
        settings,
        front_end,
        sink,
        slots: Vec::new(),
        acquired: BTreeSet::new(),
        excluded: BTreeSet::new(),
        replicas: Vec::new(),
        taps: Vec::new(),
        fixed: Fixed::Never,
        channel_steps: 0,
        steps: 0,
        monitors: monitors.transpose()?.unwrap_or_default(),
        vector: None,
        consistent_fixes: 0,
        next_look_s: 0.0,
        silent_until_s: BTreeMap::new(),
    };
    run.until_the_end()
}

/// Tracking, with the taps of whoever watches.
fn tracking(settings: &Settings) -> Result<TrackingSettings, ReceiverError> {
    let taps = settings.shape.map(|_| TapOffsets::new(&SHAPE_TAPS_CHIPS));
    Ok(TrackingSettings {
        further_taps: taps.transpose()?.or(settings.tracking.further_taps),
        ..settings.tracking
    })
}

/// Whether there is a solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fixed {
    Never,
    Now,
    Before,
}

/// A run under way.
pub(super) struct Run<'a, B> {
    pub(super) bank: B,
    pub(super) settings: &'a Settings,
    pub(super) front_end: FrontEnd,
    pub(super) sink: &'a mut dyn FnMut(Record) -> Result<(), ReceiverError>,
    pub(super) noise: NoiseFloor,
    pub(super) navigator: Navigator,
    pub(super) schedule: Schedule,
    pub(super) spectrum: SpectrumSense,
    pub(super) tracking: TrackingSettings,
    /// The chart of a channel that has seen nothing.
    pub(super) shape: Option<ShapeWatch>,
    pub(super) slots: Vec<Slot>,
    pub(super) acquired: BTreeSet<SignalId>,
    pub(super) excluded: BTreeSet<SatelliteId>,
    pub(super) replicas: Vec<Replica>,
    pub(super) taps: Vec<Taps>,
    pub(super) fixed: Fixed,
    pub(super) channel_steps: usize,
    pub(super) steps: usize,
    /// The monitors of a channel, which have seen nothing.
    pub(super) monitors: Vec<Monitor>,
    pub(super) vector: Option<VectorTracking>,
    /// Successive fixes whose measurements agree.
    pub(super) consistent_fixes: u32,
    /// When vector tracking next looks for satellites that rise or set, s.
    pub(super) next_look_s: f64,
    /// Predicted signals that were not there, and until when they are left alone, s.
    pub(super) silent_until_s: BTreeMap<SignalId, f64>,
}

impl<B: CorrelatorBank> Run<'_, B> {
    fn until_the_end(&mut self) -> Result<Outcome, ReceiverError> {
        // A step is never longer than the filter's interval.
        let vector = self.settings.vector.as_ref();
        let step_s = vector.map_or(STEP_S, |v| v.interval_s.min(STEP_S));
        let (mut step, mut epoch) = (1, 1);
        let last = self.settings.duration_s.map_or(u64::MAX, |s| self.tick(s));
        loop {
            let (next_step, next_epoch) = (
                self.tick(f64::from(step) * step_s),
                self.tick(f64::from(epoch) / self.settings.rate_hz),
            );
            let target = next_step.min(next_epoch).min(last);
            let now = self.bank.advance_to(target)?.min(target);
            let ended = now < target || now == last;
            self.receive(now, ended)?;
            let due = now == next_epoch || (ended && epoch == 1);
            if self.vector.is_some() {
                self.navigate_by_filter(now, due)?;
            } else {
                if due {
                    self.navigate(now)?;
                }
                self.consider_early_tracking(now)?;
            }
            if ended {
                self.announce_rest(now)?;
                return Ok(self.outcome(now));
            }
            step += u32::from(now == next_step);
            epoch += u32::from(now == next_epoch);
        }
    }

    pub(super) fn tick(&self, time_s: f64) -> u64 {
        (time_s * self.front_end.sample_rate_hz).round() as u64
    }

    pub(super) fn time_s(&self, tick: u64) -> f64 {
        tick as f64 / self.front_end.sample_rate_hz
    }

    pub(super) fn emit(
        &mut self,
        now: u64,
        satellite: Option<SatelliteId>,
        kind: EventKind,
    ) -> Result<(), ReceiverError> {
        let time_s = self.time_s(now);
        (self.sink)(Record::Event(Event {
            time_s,
            satellite,
            kind,
        }))
    }

    /// Everything up to `now` but navigation.
    fn receive(&mut self, now: u64, ended: bool) -> Result<(), ReceiverError> {
        self.listen_to_noise(now)?;
        self.search(now, ended)?;
        self.track(now)?;
        if self.spectrum.is_inverted() && self.tracking.spectrum == Spectrum::Upright {
            self.invert(now)?;
        }
        if let Some(jump) = discontinuity::find(&mut self.bank, &self.slots, self.settings, now)? {
            self.jump(now, &jump)?;
            self.track(now)?;
        }
        self.steps += 1;
        self.channel_steps += self.slots.len();
        self.drop_lost(now)
    }

    fn listen_to_noise(&mut self, now: u64) -> Result<(), ReceiverError> {
        let period = self.tick(1e-3);
        // The first step is heard in full, so that the floor is known from the start.
        let periods = if self.steps == 0 { now / period } else { 1 };
        for k in (1..=periods).rev() {
            if let Some(tick) = now.checked_sub(k * period + 1) {
                self.noise.measure(&mut self.bank, tick)?;
            }
        }
        Ok(())
    }

    fn outcome(&self, now: u64) -> Outcome {
        let signal_s = self.time_s(now);
        let no_fix_reason = (self.fixed == Fixed::Never).then(|| {
            why_no_fix(
                &self.slots,
                self.acquired.len(),
                &self.navigator.store,
                self.navigator.near(),
                self.settings,
                signal_s,
            )
        });
        Outcome {
            signal_s,
            channels_mean: self.channel_steps as f64 / self.steps.max(1) as f64,
            no_fix_reason,
        }
    }
}
