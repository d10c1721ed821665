//! Vector tracking: one filter knows position, velocity and clock, and steers every channel.
//!
//! This is the one edge along which data goes up: what each channel is steered to follows from the
//! state of the filter, one epoch later.

mod acceleration;
mod bit_slip;
mod clock_step;
mod filter;
mod hindsight;
mod judge;
mod monitors;
mod rate_gate;
mod reach;
mod report;
mod restart;
mod scatter;
mod settings;
mod steering;
mod too_few;
mod watch;

use std::collections::BTreeMap;

use fault_ml::learned::{ChannelStep, CommonStrength};
use gnss_nav::coarse_time::SnapshotSolution;
use gnss_nav::filter::{
    Advice, Disposition, EpochGeometry, FaultLogic, FaultThresholds, Gate, GivenOthers,
    Innovations, NavFilter, Observable, SatelliteInnovation, SkipReason, Update,
};
use gnss_nav::measurement::form;
use gnss_nav::prediction::Expected;
use gnss_nav::{
    EphemerisStore, GpsTime, Measurement, MeasurementModel, NavState, RawMeasurement, SatelliteId,
    Solution,
};
use gnss_signal::tracking::{ChannelEpoch, Lock};
use nalgebra::{Vector3, Vector4};

use super::shape::{ShapeSaid, ShapeWatch};
use super::slot::Slot;
use crate::ReceiverError;
use crate::record::EventKind;

use acceleration::{Velocities, change_of_rate_mps};
use filter::from_solution;
use hindsight::{Hindsight, Taken};
pub(super) use monitors::Monitor;
pub(super) use report::{change, observations};
use scatter::Scatter;
pub use settings::{FilterKind, MeasurementNoise, Policy, VectorSettings};
pub(super) use steering::{RELEASED_VARIANCE_CHIPS2, steering};
use watch::Watch;

/// Satellites of a fix.
const NEEDED: usize = 4;
/// A position is predicted, not measured, once no fix's worth of satellites was used for so long, s.
const STALE_S: f64 = 0.1;
/// Healthy for so long, s, a satellite is believed again.
pub(super) const READMIT_S: f64 = 2.0;
/// A message tells another time than the filter's when they are this far apart, s: half a code period.
const TIME_DISAGREES_S: f64 = 0.5e-3;
/// So many messages are believed rather than the filter: one may be damaged.
const CONTRADICTING: usize = 2;
/// Weak signals may take longer than this to show where their bits begin, s.
const BITS_PATIENCE_S: f64 = 1.0;
/// Past this deviation of a predicted range, m, a signal is likely to lie outside the taps: half a
/// chip.
const LOST_M: f64 = 150.0;

/// How well the receiver's clock is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Time {
    /// To a small part of a code period.
    Exact,
    /// As well as a snapshot tells: before any bit boundary is known.
    Coarse,
}

/// What becomes of vector tracking after an epoch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outlook {
    /// It goes on.
    Goes,
    /// Enough bit boundaries are known for an exact time, which it begins anew with.
    Exact,
    /// The prediction no longer reaches the signals: they have to be found again.
    Lost,
    /// Most channels contradict the filter and no solution reconciles them: not even the time is
    /// certain.
    Contradicted,
    /// The bits of all channels have slipped: the time is wrong by whole code periods.
    Slipped,
}

/// One channel at an epoch.
#[derive(Debug, Clone)]
pub(super) struct Member {
    pub(super) satellite: SatelliteId,
    pub(super) epoch: ChannelEpoch,
    pub(super) raw: Option<RawMeasurement>,
    pub(super) innovation: Option<SatelliteInnovation>,
    /// What its monitors were shown.
    pub(super) shown: Option<ChannelStep>,
    /// What the shape of its correlation says, where that is watched.
    pub(super) shape: Option<ShapeSaid>,
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
    /// Of the filter's update: normalised innovations squared in sum, and how many.
    pub(super) normalised_innovation_squared: f64,
    pub(super) innovations_used: usize,
}

impl Epoch {
    /// How old what was measured is, s, in the mean: intervals end with the bits of their satellites, and
    /// what is measured over one is that of its middle.
    fn age_s(&self) -> f64 {
        let measured = self.members.iter().filter(|m| m.raw.is_some());
        let ages = measured.map(|m| m.epoch.doppler_age_s);
        let (sum, count) = ages.fold((0.0, 0), |(sum, count), age_s| (sum + age_s, count + 1));
        sum / f64::from(count.max(1))
    }
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
    monitors: Vec<Monitor>,
    faults: FaultLogic,
    scatter: Scatter,
    strengths: CommonStrength,
    watches: BTreeMap<SatelliteId, Watch>,
    geometry: Option<EpochGeometry>,
    /// Channels whose message tells another time, at the last epoch.
    contradicting: usize,
    /// Whether satellites found faulty were weighted at the last epoch, as too few would have been left.
    too_few_left: bool,
    velocities: Velocities,
    hindsight: Hindsight,
    acceleration_mps2: Vector3<f64>,
    /// The last epoch.
    pub(super) tick: u64,
    started: GpsTime,
    /// When enough satellites for a fix were last used.
    fixed: GpsTime,
    /// What an error of the coarse time makes of position (ECEF) and clock bias, m, one deviation; `None`
    /// where time is exact.
    coarse_shift_m: Option<Vector4<f64>>,
    pub(super) outlook: Outlook,
}

impl VectorTracking {
    /// Starts from a solution of least squares of `raw`.
    ///
    /// # Errors
    /// Where the solution or the settings make no filter.
    pub(super) fn start(
        around: &Surroundings,
        solution: &Solution,
        raw: &[RawMeasurement],
        model: MeasurementModel,
        settings: &VectorSettings,
        monitors: Vec<Monitor>,
    ) -> Result<Self, ReceiverError> {
        let measurements = form(around.receive_time, raw, around.store).measurements;
        Ok(Self {
            filter: from_solution(solution, &measurements, &model, settings)?,
            model,
            monitors,
            faults: FaultLogic::new(FaultThresholds::default())?,
            scatter: Scatter::new(),
            strengths: CommonStrength::default(),
            watches: BTreeMap::new(),
            geometry: None,
            contradicting: 0,
            too_few_left: false,
            velocities: Velocities::default(),
            hindsight: Hindsight::default(),
            acceleration_mps2: Vector3::zeros(),
            tick: around.tick,
            started: solution.gps_time(),
            fixed: solution.gps_time(),
            coarse_shift_m: None,
            outlook: Outlook::Goes,
            settings: settings.clone(),
        })
    }

    /// Starts from a snapshot of what channels said before their bit boundaries were known.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub(super) fn start_early(
        around: &Surroundings,
        snapshot: &SnapshotSolution,
        epochs: &[(SatelliteId, ChannelEpoch)],
        model: MeasurementModel,
        settings: &VectorSettings,
        monitors: Vec<Monitor>,
    ) -> Result<Self, ReceiverError> {
        let state = NavState::from(&snapshot.solution);
        let raw = epochs.iter().filter_map(|(satellite, epoch)| {
            let ephemeris = around.store.select(*satellite, state.time)?;
            let expected = state.expect(ephemeris, around.receive_time, &model).ok()?;
            steering::raw_measurement(epoch, *satellite, around.receive_time, &expected, settings)
        });
        let raw: Vec<RawMeasurement> = raw.collect();
        let started = Self::start(around, &snapshot.solution, &raw, model, settings, monitors)?;
        Ok(Self {
            coarse_shift_m: Some(snapshot.time_shift_m),
            ..started
        })
    }

    pub(super) const fn time(&self) -> Time {
        match self.coarse_shift_m {
            Some(_) => Time::Coarse,
            None => Time::Exact,
        }
    }

    const fn model(&self) -> &MeasurementModel {
        &self.model
    }

    /// The present estimate.
    pub(super) fn state(&self) -> &NavState {
        self.filter.state()
    }

    /// Whether the next update is due `since_s` after the last.
    pub(super) fn is_due(&self, since_s: f64) -> bool {
        self.settings.is_due(since_s)
    }

    /// Takes in what the channels measured up to an epoch, and steers them on.
    ///
    /// # Errors
    /// Where the filter meets what is no number.
    pub(super) fn epoch(
        &mut self,
        around: &Surroundings,
        model: &MeasurementModel,
        slots: &mut [Slot],
    ) -> Result<Epoch, ReceiverError> {
        let mut now = self.predict(around.receive_time)?;
        self.tick = around.tick;
        let mut epoch = Epoch::default();
        self.contradicting = 0;
        for slot in slots.iter_mut().filter(|s| s.channel.is_steered()) {
            epoch.members.extend(self.member(around, slot));
        }
        let raw: Vec<RawMeasurement> = epoch.members.iter().filter_map(|m| m.raw).collect();
        let measurements = form(around.receive_time, &raw, around.store).measurements;
        if *model != self.model {
            self.remodel(*model, &measurements)?;
        }
        now.measurements = measurements;
        let ages = epoch.members.iter().filter(|m| m.raw.is_some());
        now.ages_s = ages.map(|m| (m.satellite, m.epoch.doppler_age_s)).collect();
        let reaches = epoch.members.iter();
        now.reaches = reaches
            .filter_map(|m| Some((m.satellite, m.epoch.doppler_reach?)))
            .collect();
        self.update(now, &mut epoch)?;
        if self.contradicting >= CONTRADICTING {
            self.outlook = Outlook::Contradicted;
        }
        if self.time() == Time::Coarse && self.bits_tell_time(slots) {
            self.outlook = Outlook::Exact;
        }
        let channels = slots.iter().map(|slot| &slot.channel);
        if let Some(size_m) = bit_slip::find(channels) {
            self.outlook = Outlook::Slipped;
            epoch.events.push((None, EventKind::ClockStep { size_m }));
        }
        self.velocities
            .remember(self.filter.state(), &self.filter.covariance());
        self.steer(around, &epoch.members, slots);
        Ok(epoch)
    }

    /// Whether bit boundaries can take the place of the coarse time: all are known, or enough of them and
    /// the others take long.
    fn bits_tell_time(&self, slots: &[Slot]) -> bool {
        let known = slots.iter().filter(|slot| slot.bits_found).count();
        let age_s = self.state().time - self.started;
        known >= NEEDED && (known == slots.len() || age_s > BITS_PATIENCE_S)
    }

    /// What a steered channel measured.
    fn member(&mut self, around: &Surroundings, slot: &mut Slot) -> Option<Member> {
        let satellite = slot.satellite;
        let expected = self.expected(around, satellite)?;
        let epoch = slot.channel.epoch(around.tick)?;
        if let Some(sent) = slot.transmit_time(&epoch, around.receive_time) {
            let apart_s = sent - expected.transmit_time;
            self.contradicting += usize::from(apart_s.abs() > TIME_DISAGREES_S);
        }
        if epoch.lock == Lock::Lost {
            self.watch(satellite).lost();
            self.hindsight.forget(satellite);
        }
        let raw = steering::raw_measurement(
            &epoch,
            satellite,
            around.receive_time,
            &expected,
            &self.settings,
        );
        let raw = raw.map(|raw| self.scattered(self.carried(raw, epoch.doppler_age_s, &expected)));
        Some(Member {
            satellite,
            epoch,
            raw,
            innovation: None,
            shown: None,
            shape: slot.shape.as_ref().and_then(ShapeWatch::said),
            disposition: None,
            used: false,
            expected,
        })
    }

    /// A range rate measured `age_s` ago, carried to the epoch by the receiver's acceleration.
    fn carried(&self, raw: RawMeasurement, age_s: f64, expected: &Expected) -> RawMeasurement {
        let change_mps = change_of_rate_mps(
            &self.acceleration_mps2,
            &expected.state.position_ecef_m,
            &self.state().position_ecef_m,
            age_s,
        );
        RawMeasurement {
            range_rate_mps: raw.range_rate_mps + change_mps,
            ..raw
        }
    }

    /// `raw` with the variance that range rates have in excess of the stated one.
    fn scattered(&self, raw: RawMeasurement) -> RawMeasurement {
        let excess = match self.settings.noise {
            MeasurementNoise::Measured => self.scatter.rate_variance_m2_s2(),
            MeasurementNoise::Fixed { .. } => 0.0,
        };
        RawMeasurement {
            range_rate_variance_m2_s2: raw.range_rate_variance_m2_s2 + excess,
            ..raw
        }
    }

    /// What is expected of a satellite at the epoch.
    pub(super) fn expected(
        &self,
        around: &Surroundings,
        satellite: SatelliteId,
    ) -> Option<Expected> {
        let ephemeris = around.store.select(satellite, self.state().time)?;
        let expected = self
            .state()
            .expect(ephemeris, around.receive_time, &self.model);
        expected.ok()
    }

    fn update(&mut self, mut now: Taken, epoch: &mut Epoch) -> Result<(), ReceiverError> {
        let measurements = &now.measurements;
        if measurements
            .iter()
            .any(|m| m.range_rate_variance_m2_s2.is_finite())
        {
            let white = self.settings.process_noise.clock.white_m2_per_s;
            now.drift_variance_m2_s2 = white / self.settings.interval_s;
            self.filter.loosen_drift(now.drift_variance_m2_s2)?;
        }
        let mut innovations = self.filter.innovations(measurements)?;
        if let Some(step) = clock_step::find(&innovations) {
            self.step_clock(&step, epoch)?;
            innovations = self.filter.innovations(measurements)?;
        }
        let mut heard = measurements.clone();
        let corrected = self.was_corrected(now.receive_time);
        if corrected && reach::leave_out(&mut heard, &innovations, &now.reaches) {
            innovations = self.filter.innovations(&heard)?;
        }
        let given = self.deviations(&innovations)?;
        self.show(&innovations, &given, &mut epoch.members)?;
        let shown = epoch
            .members
            .iter()
            .filter_map(|m| Some((m.satellite, m.shown?)));
        now.shown = shown.collect();
        if self.closes_rates(&mut heard, &given) {
            innovations = self.filter.innovations(&heard)?;
        }
        now.told = self.believe(&innovations, epoch);
        if let Some(again) = self.take_back(&mut now)? {
            innovations = again;
            for member in &mut epoch.members {
                member.shown = now.step(member.satellite);
            }
        }
        let dispositions = &now.told;
        let update = self.filter.update(&innovations, dispositions)?;
        self.note(&innovations, dispositions, &update, epoch);
        match self.faults.observe(&innovations, &update) {
            Advice::Reset(channels) => {
                self.reset(&heard, channels.len(), epoch)?;
            }
            Advice::Isolate(channels) => self.isolate(&channels, epoch),
            Advice::Nothing => {}
        }
        if self.settings.takes_back() {
            self.hindsight.keep(now, self.settings.hindsight_s);
        }
        let covariance = self.filter.covariance();
        let position: f64 = [0, 2, 4].iter().map(|i| covariance[(*i, *i)]).sum();
        if (position / 3.0 + covariance[(6, 6)]).sqrt() > LOST_M {
            self.outlook = Outlook::Lost;
        }
        Ok(())
    }

    /// Takes range rates out of `heard` that contradict those of the others, where there is a gate.
    fn closes_rates(&self, heard: &mut [Measurement], given: &[GivenOthers]) -> bool {
        self.settings.gate != Gate::Off && rate_gate::close(heard, given)
    }

    /// Remembers what an update used.
    fn note(
        &mut self,
        innovations: &Innovations,
        dispositions: &[(SatelliteId, Disposition)],
        update: &Update,
        epoch: &mut Epoch,
    ) {
        epoch.normalised_innovation_squared = update.normalised_innovation_squared;
        epoch.innovations_used = update.used;
        for (innovation, (satellite, disposition)) in
            innovations.satellites().iter().zip(dispositions)
        {
            if let Some(member) = epoch.members.iter_mut().find(|m| m.satellite == *satellite) {
                member.innovation = Some(*innovation);
                let code = Observable::Pseudorange;
                let mut skipped = update.skipped.iter();
                let skipped = skipped.find(|s| s.satellite == *satellite && s.observable == code);
                let below_mask = skipped.is_some_and(|s| s.reason == SkipReason::BelowMask);
                member.used = skipped.is_none();
                member.disposition = Some(*disposition).filter(|_| !below_mask);
            }
        }
        let used = |satellite| {
            let mut members = epoch.members.iter();
            members.any(|m| m.satellite == satellite && m.used)
        };
        if let Ok(geometry) = innovations.geometry(used)
            && geometry.satellites >= NEEDED
        {
            self.geometry = Some(geometry);
            self.fixed = self.state().time;
        }
    }

    /// Whether the position rests on measurements of this epoch or shortly before.
    pub(super) fn is_fixed(&self) -> bool {
        self.state().time - self.fixed < STALE_S
    }
}
