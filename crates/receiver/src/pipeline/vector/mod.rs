//! Vector tracking: one filter knows position, velocity and clock, and steers every channel.
//!
//! This is the one edge along which data goes up: what each channel is steered to follows from the
//! state of the filter, one epoch later.

mod report;
mod settings;
mod steering;
mod watch;

use std::collections::BTreeMap;

use fault_ml::InnovationTest;
use gnss_nav::filter::{
    Advice, BatchFilter, Disposition, EpochGeometry, FaultLogic, FaultThresholds, FilterSettings,
    Innovations, NavFilter, Observable, SatelliteInnovation, SequentialFilter, SkipReason, Update,
};
use gnss_nav::measurement::form;
use gnss_nav::prediction::Expected;
use gnss_nav::{
    EphemerisStore, GpsTime, MeasurementModel, NavState, RawMeasurement, SatelliteId, Solution,
    least_squares,
};
use gnss_signal::tracking::{ChannelEpoch, Lock};

use super::navigator::EXCLUSION_FALSE_ALARM;
use super::slot::Slot;
use crate::ReceiverError;
use crate::record::EventKind;

pub(super) use report::observations;
pub use settings::{FilterKind, MeasurementNoise, Policy, VectorSettings};
use watch::{Change, Watch};

/// Satellites of a fix.
const NEEDED: usize = 4;
/// A position is predicted, not measured, once no fix's worth of satellites was used for so long, s.
const STALE_S: f64 = 0.1;
/// Healthy for so long, s, a satellite is believed again.
const READMIT_S: f64 = 2.0;
/// Past this deviation of a predicted range, m, a signal is likely to lie outside the taps: half a
/// chip.
const LOST_M: f64 = 150.0;

/// What becomes of vector tracking after an epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outlook {
    /// It goes on.
    Goes,
    /// The prediction no longer reaches the signals: they have to be found again.
    Lost,
    /// Most channels contradict the filter and no solution reconciles them: not even the time is
    /// certain.
    Contradicted,
}

/// One channel at an epoch.
#[derive(Debug, Clone)]
pub(super) struct Member {
    pub(super) satellite: SatelliteId,
    pub(super) epoch: ChannelEpoch,
    pub(super) raw: Option<RawMeasurement>,
    pub(super) innovation: Option<SatelliteInnovation>,
    /// What the filter was told of it; `None` where it had nothing to be told of.
    pub(super) disposition: Option<Disposition>,
    /// Whether the filter used its pseudorange.
    pub(super) used: bool,
    pub(super) expected: Expected,
}

/// What an epoch brought.
#[derive(Debug, Clone, Default)]
pub(super) struct Epoch {
    pub(super) members: Vec<Member>,
    pub(super) events: Vec<(Option<SatelliteId>, EventKind)>,
}

/// What stays the same for all channels of an epoch.
#[derive(Clone, Copy)]
pub(super) struct Surroundings<'a> {
    pub(super) tick: u64,
    /// Reading of the receiver's clock.
    pub(super) receive_time: GpsTime,
    pub(super) store: &'a EphemerisStore,
}

/// The filter and what it knows of the satellites.
pub(super) struct VectorTracking {
    filter: Box<dyn NavFilter>,
    settings: VectorSettings,
    model: MeasurementModel,
    monitor: Option<InnovationTest>,
    faults: FaultLogic,
    watches: BTreeMap<SatelliteId, Watch>,
    geometry: Option<EpochGeometry>,
    /// The last epoch.
    pub(super) tick: u64,
    /// When enough satellites for a fix were last used.
    fixed: GpsTime,
    pub(super) outlook: Outlook,
}

impl VectorTracking {
    /// Starts from a solution of least squares at `tick`.
    ///
    /// # Errors
    /// Where the solution or the settings make no filter.
    pub(super) fn start(
        tick: u64,
        solution: &Solution,
        model: MeasurementModel,
        settings: &VectorSettings,
    ) -> Result<Self, ReceiverError> {
        let monitor = settings.monitor.map(InnovationTest::new).transpose()?;
        Ok(Self {
            filter: filter(solution, &model, settings)?,
            model,
            monitor,
            faults: FaultLogic::new(FaultThresholds::default())?,
            watches: BTreeMap::new(),
            geometry: None,
            tick,
            fixed: solution.gps_time(),
            outlook: Outlook::Goes,
            settings: settings.clone(),
        })
    }

    /// The present estimate.
    pub(super) fn state(&self) -> &NavState {
        self.filter.state()
    }

    /// Takes in what the channels measured up to an epoch, and steers them on.
    ///
    /// # Errors
    /// Where the filter meets what is no number.
    pub(super) fn epoch(
        &mut self,
        around: &Surroundings,
        slots: &mut [Slot],
    ) -> Result<Epoch, ReceiverError> {
        let to = self.state().gps_time(around.receive_time);
        self.filter.predict(to)?;
        self.tick = around.tick;
        let mut epoch = Epoch::default();
        for slot in slots.iter_mut().filter(|s| s.channel.is_steered()) {
            epoch.members.extend(self.member(around, slot));
        }
        self.update(around, &mut epoch)?;
        self.steer(around, slots);
        Ok(epoch)
    }

    /// What a steered channel measured.
    fn member(&mut self, around: &Surroundings, slot: &mut Slot) -> Option<Member> {
        let satellite = slot.satellite;
        let expected = self.expected(around, satellite)?;
        let epoch = slot.channel.epoch(around.tick)?;
        if epoch.lock == Lock::Lost {
            self.watch(satellite).lost();
        }
        let raw = steering::raw_measurement(
            &epoch,
            satellite,
            around.receive_time,
            &expected,
            &self.settings,
        );
        Some(Member {
            satellite,
            epoch,
            raw,
            innovation: None,
            disposition: None,
            used: false,
            expected,
        })
    }

    fn watch(&mut self, satellite: SatelliteId) -> &mut Watch {
        let clean = (READMIT_S / self.settings.interval_s) as u32;
        self.watches
            .entry(satellite)
            .or_insert_with(|| Watch::new(self.monitor.clone(), clean))
    }

    fn expected(&self, around: &Surroundings, satellite: SatelliteId) -> Option<Expected> {
        let ephemeris = around.store.select(satellite, self.state().time)?;
        let expected = self
            .state()
            .expect(ephemeris, around.receive_time, &self.model);
        expected.ok()
    }

    fn update(&mut self, around: &Surroundings, epoch: &mut Epoch) -> Result<(), ReceiverError> {
        let raw: Vec<RawMeasurement> = epoch.members.iter().filter_map(|m| m.raw).collect();
        let formed = form(around.receive_time, &raw, around.store);
        let innovations = self.filter.innovations(&formed.measurements)?;
        let dispositions = self.judge(&innovations, epoch)?;
        let update = self.filter.update(&innovations, &dispositions)?;
        self.note(&innovations, &dispositions, &update, epoch);
        match self.faults.observe(&innovations, &update) {
            Advice::Reset(channels) => {
                let solution = least_squares::solve_with_exclusion(
                    &formed.measurements,
                    &self.model,
                    &self.state().position_ecef_m.clone(),
                    EXCLUSION_FALSE_ALARM,
                );
                self.reset(solution.ok(), channels.len(), epoch)?;
            }
            Advice::Nothing | Advice::Isolate(_) => {}
        }
        let covariance = self.filter.covariance();
        let position: f64 = [0, 2, 4].iter().map(|i| covariance[(*i, *i)]).sum();
        if (position / 3.0 + covariance[(6, 6)]).sqrt() > LOST_M {
            self.outlook = Outlook::Lost;
        }
        Ok(())
    }

    /// Every monitor's say, and what follows from it.
    fn judge(
        &mut self,
        innovations: &Innovations,
        epoch: &mut Epoch,
    ) -> Result<Vec<(SatelliteId, Disposition)>, ReceiverError> {
        let policy = self.settings.policy;
        let mut dispositions = Vec::new();
        for innovation in innovations.satellites() {
            let satellite = innovation.satellite;
            let watch = self.watch(satellite);
            let change = watch.judge(innovation)?;
            dispositions.push((satellite, watch.disposition(policy)));
            if let Some(change) = change {
                report::change(satellite, &change, policy, &mut epoch.events);
                if change == Change::Cleared {
                    self.faults.forget(satellite);
                }
            }
        }
        Ok(dispositions)
    }

    /// Remembers what an update used.
    fn note(
        &mut self,
        innovations: &Innovations,
        dispositions: &[(SatelliteId, Disposition)],
        update: &Update,
        epoch: &mut Epoch,
    ) {
        for (innovation, (satellite, disposition)) in
            innovations.satellites().iter().zip(dispositions)
        {
            if let Some(member) = epoch.members.iter_mut().find(|m| m.satellite == *satellite) {
                member.innovation = Some(*innovation);
                let skipped = |reason| {
                    let code = Observable::Pseudorange;
                    let mut all = update.skipped.iter();
                    all.any(|s| {
                        s.satellite == *satellite && s.observable == code && s.reason == reason
                    })
                };
                member.used = !skipped(SkipReason::Gate) && !skipped(SkipReason::Excluded);
                member.disposition = Some(*disposition).filter(|_| !skipped(SkipReason::BelowMask));
            }
        }
        let used = |satellite| {
            let is_used =
                |m: &Member| m.satellite == satellite && m.used && m.disposition.is_some();
            epoch.members.iter().any(is_used)
        };
        if let Ok(geometry) = innovations.geometry(used)
            && geometry.satellites >= NEEDED
        {
            self.geometry = Some(geometry);
            self.fixed = self.state().time;
        }
    }

    /// Starts anew from least squares where that is consistent.
    fn reset(
        &mut self,
        solution: Option<Solution>,
        channels: usize,
        epoch: &mut Epoch,
    ) -> Result<(), ReceiverError> {
        self.faults.clear();
        let consistent = solution.filter(|s| s.consistency == least_squares::Consistency::Passed);
        let Some(solution) = consistent else {
            self.outlook = Outlook::Contradicted;
            return Ok(());
        };
        epoch
            .events
            .push((None, EventKind::FilterReset { channels }));
        self.filter = filter(&solution, &self.model, &self.settings)?;
        self.watches.clear();
        Ok(())
    }

    /// Whether the position rests on measurements of this epoch or shortly before.
    pub(super) fn is_fixed(&self) -> bool {
        self.state().time - self.fixed < STALE_S
    }

    /// Takes another model of the delays: what the old one may have been wrong by is no longer known.
    ///
    /// # Errors
    /// Where the state makes no filter.
    pub(super) fn remodel(&mut self, model: MeasurementModel) -> Result<(), ReceiverError> {
        let covariance = self.filter.covariance();
        let wider = self
            .geometry
            .map_or(covariance, |g| g.with_lasting(&covariance));
        self.model = model;
        let settings = filter_settings(&model, &self.settings);
        let state = *self.state();
        self.filter = match self.settings.filter {
            FilterKind::Batch => Box::new(BatchFilter::new(state, wider, settings)?),
            FilterKind::Sequential => Box::new(SequentialFilter::new(state, wider, settings)?),
        };
        Ok(())
    }

    /// The model of delays in use.
    pub(super) const fn model(&self) -> &MeasurementModel {
        &self.model
    }
}

fn filter(
    solution: &Solution,
    model: &MeasurementModel,
    settings: &VectorSettings,
) -> Result<Box<dyn NavFilter>, ReceiverError> {
    let filter_settings = filter_settings(model, settings);
    Ok(match settings.filter {
        FilterKind::Batch => Box::new(BatchFilter::from_solution(solution, filter_settings)?),
        FilterKind::Sequential => {
            Box::new(SequentialFilter::from_solution(solution, filter_settings)?)
        }
    })
}

fn filter_settings(model: &MeasurementModel, settings: &VectorSettings) -> FilterSettings {
    FilterSettings {
        process_noise: settings.process_noise,
        model: *model,
        gate: settings.gate,
    }
}
