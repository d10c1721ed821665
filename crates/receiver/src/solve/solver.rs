//! Takes observations epoch by epoch and reports what they give.

use std::collections::BTreeSet;

use gnss_nav::measurement::{self, Formed};
use gnss_nav::{
    EphemerisStore, GpsTime, Measurement, MeasurementModel, RawMeasurement, SatelliteId,
};
use nalgebra::Vector3;

use super::kinematic::{Estimate, Kinematic};
use super::single_point::{self, Chosen, Fix};
use super::{InjectedFault, SolveSettings, report};
use crate::ReceiverError;
use crate::raim::{Raim, RaimWatch};
use crate::record::{Event, EventKind, PvtRecord, Record, ScoreRecord, Status};
use crate::rinex_obs::{ObservedEpoch, ObservedSatellite};

/// Takes a record.
pub(super) type Sink<'a> = dyn FnMut(Record) -> Result<(), ReceiverError> + 'a;

/// Solves epoch after epoch.
#[derive(Debug)]
pub struct Solver {
    settings: SolveSettings,
    store: EphemerisStore,
    model: MeasurementModel,
    first: Option<GpsTime>,
    last_s: Option<f64>,
    /// Where the next solution starts, ECEF, m.
    position_ecef_m: Vector3<f64>,
    excluded: BTreeSet<SatelliteId>,
    fixed: Option<bool>,
    is_assured: Option<bool>,
    counts: Counts,
    /// Injected faults whose satellite has been observed.
    occurred: Vec<bool>,
    kinematic: Option<Kinematic>,
    watch: RaimWatch,
}

/// What an epoch gave.
pub(super) struct Solved {
    /// By itself.
    pub(super) fix: Option<Fix>,
    /// By the filter.
    pub(super) estimate: Option<Estimate>,
    /// What is reported of it.
    pub(super) pvt: Option<PvtRecord>,
}

/// What the epochs amounted to.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    epochs: u64,
    fixes: u64,
    most_observed: usize,
    most_formed: usize,
}

/// How it ended.
#[derive(Debug, Clone, PartialEq)]
pub struct SolveOutcome {
    /// Time from the first epoch to the last, s.
    pub signal_s: f64,
    /// Epochs solved or not.
    pub epochs: u64,
    /// Why there was no fix, where there was none.
    pub no_fix_reason: Option<String>,
    /// Injected faults whose satellite was never observed after their onset.
    pub absent: Vec<InjectedFault>,
}

impl Solver {
    /// With these ephemerides; `position_ecef_m` is where to begin, any place.
    ///
    /// # Errors
    /// [`ReceiverError::Monitor`] where a monitor cannot be set up.
    pub fn new(
        settings: SolveSettings,
        store: EphemerisStore,
        position_ecef_m: Vector3<f64>,
    ) -> Result<Self, ReceiverError> {
        let model = MeasurementModel {
            ionosphere: settings.ionosphere,
            troposphere: settings.troposphere,
            elevation_mask_rad: settings.elevation_mask_rad,
            errors: settings.weights.errors(),
        };
        Ok(Self {
            watch: RaimWatch::new(settings.raim, settings.seed)?,
            kinematic: settings
                .kinematic
                .map(|kinematic| Kinematic::new(kinematic, model)),
            occurred: vec![false; settings.faults.len()],
            settings,
            store,
            model,
            first: None,
            last_s: None,
            position_ecef_m,
            excluded: BTreeSet::new(),
            fixed: None,
            is_assured: None,
            counts: Counts::default(),
        })
    }

    /// Takes one epoch. One that is not later than the one before is left out, and said to be.
    ///
    /// # Errors
    /// Those of `sink`.
    pub fn epoch(
        &mut self,
        observed: &ObservedEpoch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReceiverError> {
        let first = *self.first.get_or_insert(observed.time);
        let time_s = observed.time - first;
        if self.last_s.is_some_and(|last_s| time_s <= last_s) {
            let kind = EventKind::EpochSkipped {
                line: observed.line,
            };
            return emit(sink, time_s, None, kind);
        }
        self.last_s = Some(time_s);
        self.counts.epochs += 1;
        if observed.missing > 0 {
            let kind = EventKind::EpochShort {
                line: observed.line,
                missing: observed.missing,
            };
            emit(sink, time_s, None, kind)?;
        }
        let raw = self.measurements(observed, time_s);
        let formed = self.form(observed.time, &raw);
        self.counts.most_observed = self.counts.most_observed.max(raw.len());
        self.counts.most_formed = self.counts.most_formed.max(formed.measurements.len());
        let fix = self.solve(time_s, &formed.measurements);
        if let Some(fix) = fix.as_ref().filter(|fix| fix.is_trusted) {
            self.position_ecef_m = fix.solution.position_ecef_m;
        }
        let estimate = self
            .kinematic
            .as_mut()
            .map(|kinematic| kinematic.epoch(observed.time, &formed.measurements, fix.as_ref()));
        let pvt = match &estimate {
            Some(estimate) => estimate.as_ref().map(|e| report::filtered(time_s, e)),
            None => fix.as_ref().map(|fix| report::pvt(time_s, fix)),
        };
        let solved = Solved {
            fix,
            estimate: estimate.flatten(),
            pvt,
        };
        self.report(time_s, observed, &raw, &solved, sink)
    }

    /// The epoch by itself; `None` where it has no solution, which is no error of the run.
    fn solve(&mut self, time_s: f64, measurements: &[Measurement]) -> Option<Fix> {
        let chosen = Chosen::of(measurements, self.settings.cn0_mask_dbhz);
        single_point::solve(
            (time_s, &chosen),
            &self.model,
            &self.position_ecef_m,
            self.settings.most_pdop,
            (self.settings.raim, &mut self.watch),
        )
        .ok()
    }

    /// Ends: how it went.
    #[must_use]
    pub fn finish(self) -> SolveOutcome {
        let faults = self.settings.faults.iter().zip(&self.occurred);
        SolveOutcome {
            signal_s: self.last_s.unwrap_or(0.0),
            epochs: self.counts.epochs,
            no_fix_reason: (self.counts.fixes == 0).then(|| self.counts.why_no_fix()),
            absent: faults
                .filter(|(_, occurred)| !**occurred)
                .map(|(fault, _)| *fault)
                .collect(),
        }
    }

    fn measurements(&mut self, observed: &ObservedEpoch, time_s: f64) -> Vec<RawMeasurement> {
        let faults = &self.settings.faults;
        for (fault, occurred) in faults.iter().zip(&mut self.occurred) {
            let mut satellites = observed.satellites.iter();
            *occurred |= satellites.any(|s| fault.error_m(s.satellite, time_s).is_some());
        }
        let weights = self.settings.weights;
        let one = |o: &ObservedSatellite| weights.measurement(o, observed.time, time_s, faults);
        observed.satellites.iter().map(one).collect()
    }

    /// Joins what healthy satellites sent with their ephemerides.
    fn form(&self, time: GpsTime, raw: &[RawMeasurement]) -> Formed {
        let usable: Vec<RawMeasurement> = raw
            .iter()
            .filter(|r| {
                let issue = self.store.select(r.satellite, r.transmit_time);
                issue.is_some_and(|ephemeris| ephemeris.health == 0)
            })
            .copied()
            .collect();
        measurement::form(time, &usable, &self.store)
    }

    fn report(
        &mut self,
        time_s: f64,
        observed: &ObservedEpoch,
        raw: &[RawMeasurement],
        solved: &Solved,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReceiverError> {
        let satellites = &observed.satellites;
        let fix = solved.fix.as_ref();
        let epoch = report::observations(time_s, observed.time, satellites, raw, fix);
        sink(Record::Observations(epoch))?;
        let scores: Vec<ScoreRecord> = self.watch.score().into_iter().collect();
        for (satellite, raw) in satellites.iter().zip(raw) {
            let mut channel = report::channel(time_s, satellite, raw, solved);
            channel.scores = scores.clone();
            sink(Record::Channel(channel))?;
        }
        self.report_exclusions(time_s, fix, sink)?;
        self.report_availability(time_s, solved, sink)?;
        match &solved.pvt {
            Some(pvt) => sink(Record::Pvt(pvt.clone())),
            None => Ok(()),
        }
    }

    /// Says which satellites are left out from here on, and which no longer.
    fn report_exclusions(
        &mut self,
        time_s: f64,
        fix: Option<&Fix>,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReceiverError> {
        let Some(fix) = fix else { return Ok(()) };
        let now: BTreeSet<SatelliteId> = fix.misfits.iter().map(|m| m.satellite).collect();
        let before = std::mem::replace(&mut self.excluded, now);
        for misfit in &fix.misfits {
            if !before.contains(&misfit.satellite) {
                let kind = self.watch.exclusion(misfit);
                emit(sink, time_s, Some(misfit.satellite), kind)?;
            }
        }
        for satellite in before.difference(&self.excluded) {
            emit(sink, time_s, Some(*satellite), EventKind::Readmitted)?;
        }
        Ok(())
    }

    /// Says when fixes begin and end, and when protection levels do.
    fn report_availability(
        &mut self,
        time_s: f64,
        solved: &Solved,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReceiverError> {
        let is_fixed = solved.pvt.as_ref().is_some_and(|p| p.status == Status::Fix);
        self.counts.fixes += u64::from(is_fixed);
        let kind = match (self.fixed, is_fixed) {
            (None, true) => Some(EventKind::FirstFix),
            (Some(true), false) => Some(EventKind::FixLost),
            _ => None,
        };
        if is_fixed || self.fixed.is_some() {
            self.fixed = Some(is_fixed);
        }
        if let Some(kind) = kind {
            emit(sink, time_s, None, kind)?;
        }
        if self.settings.raim == Raim::None {
            return Ok(());
        }
        let is_available = solved
            .pvt
            .as_ref()
            .is_some_and(|pvt| pvt.horizontal_protection_m.is_some());
        if self.is_assured.replace(is_available) == Some(is_available) {
            return Ok(());
        }
        emit(
            sink,
            time_s,
            None,
            EventKind::IntegrityChanged { is_available },
        )
    }
}

impl Counts {
    fn why_no_fix(&self) -> String {
        if self.epochs == 0 {
            return "the file holds no epoch".to_owned();
        }
        format!(
            "{} epochs, none with 4 satellites that agree: at most {} GPS satellites observed, {} \
             of them healthy and with an ephemeris of that time",
            self.epochs, self.most_observed, self.most_formed
        )
    }
}

fn emit(
    sink: &mut Sink<'_>,
    time_s: f64,
    satellite: Option<SatelliteId>,
    kind: EventKind,
) -> Result<(), ReceiverError> {
    sink(Record::Event(Event {
        time_s,
        satellite,
        kind,
    }))
}
