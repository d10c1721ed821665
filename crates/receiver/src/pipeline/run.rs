//! The loop over a run's samples.

use std::collections::BTreeSet;

use gnss_nav::lnav::{DEFAULT_PIVOT_WEEK, LnavEvent};
use gnss_nav::{GpsTime, SatelliteId};
use gnss_signal::tracking::{NoiseFloor, Spectrum, TrackingSettings};
use gnss_signal::{AcquisitionHit, CorrelatorBank, FrontEnd, Replica, SignalId, Taps};

use super::discontinuity::{self, Jump};
use super::navigator::{EXCLUSION_FALSE_ALARM, Navigator, Tracked};
use super::outcome::{Outcome, why_no_fix};
use super::report;
use super::schedule::{DopplerRange, Schedule};
use super::settings::Settings;
use super::slot::{Decoded, Slot};
use super::spectrum::SpectrumSense;
use crate::ReceiverError;
use crate::record::{Acquired, Event, EventKind, IonosphereUtcRecord, Record, TapsRecord};

/// An acquisition this far above its threshold is reported at once; any other when the channel
/// finds the data bits, which no chance peak has.
const UNMISTAKABLE: f64 = 2.0;
/// An acquisition not confirmed by the end of the samples is reported above this, dB-Hz: the
/// least that acquisition finds.
const STILL_THERE_DBHZ: f64 = 31.0;
/// Samples brought in at a time, s: short enough to report promptly, long enough to be cheap.
const STEP_S: f64 = 0.02;
/// Doppler of satellites for a receiver slower than 200 m/s, Hz.
const SATELLITE_DOPPLER_HZ: f64 = 6e3;
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
    let mut run = Run {
        noise: NoiseFloor::new(unused, front_end)?,
        navigator: Navigator::new(settings, front_end.sample_rate_hz),
        schedule: Schedule::new(front_end.sample_rate_hz),
        spectrum: SpectrumSense::default(),
        tracking: settings.tracking,
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
    };
    run.until_the_end()
}

/// Whether there is a solution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fixed {
    Never,
    Now,
    Before,
}

struct Run<'a, B> {
    bank: B,
    settings: &'a Settings,
    front_end: FrontEnd,
    sink: &'a mut dyn FnMut(Record) -> Result<(), ReceiverError>,
    noise: NoiseFloor,
    navigator: Navigator,
    schedule: Schedule,
    spectrum: SpectrumSense,
    tracking: TrackingSettings,
    slots: Vec<Slot>,
    acquired: BTreeSet<SignalId>,
    excluded: BTreeSet<SatelliteId>,
    replicas: Vec<Replica>,
    taps: Vec<Taps>,
    fixed: Fixed,
    channel_steps: usize,
    steps: usize,
}

impl<B: CorrelatorBank> Run<'_, B> {
    fn until_the_end(&mut self) -> Result<Outcome, ReceiverError> {
        let (mut step, mut epoch) = (1, 1);
        let last = self.settings.duration_s.map_or(u64::MAX, |s| self.tick(s));
        loop {
            let (next_step, next_epoch) = (
                self.tick(f64::from(step) * STEP_S),
                self.tick(f64::from(epoch) / self.settings.rate_hz),
            );
            let target = next_step.min(next_epoch).min(last);
            let now = self.bank.advance_to(target)?.min(target);
            let ended = now < target || now == last;
            self.receive(now, ended)?;
            if now == next_epoch || (ended && epoch == 1) {
                self.navigate(now)?;
            }
            if ended {
                self.announce_rest(now)?;
                return Ok(self.outcome(now));
            }
            step += u32::from(now == next_step);
            epoch += u32::from(now == next_epoch);
        }
    }

    fn tick(&self, time_s: f64) -> u64 {
        (time_s * self.front_end.sample_rate_hz).round() as u64
    }

    fn time_s(&self, tick: u64) -> f64 {
        tick as f64 / self.front_end.sample_rate_hz
    }

    fn emit(
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

    fn search(&mut self, now: u64, ended: bool) -> Result<(), ReceiverError> {
        let tracked: BTreeSet<_> = self.slots.iter().map(|s| s.channel.signal()).collect();
        let wanted: Vec<_> = self
            .settings
            .signals
            .iter()
            .copied()
            .filter(|s| !tracked.contains(s))
            .filter(|s| {
                let satellite = SatelliteId::gps(s.prn());
                !self.navigator.is_below_horizon(satellite, now)
            })
            .collect();
        if wanted.is_empty() {
            return Ok(());
        }
        let range = self.doppler_range();
        for request in self.schedule.due(now, ended, &wanted, &range) {
            for hit in self.bank.search(&request)?.hits {
                self.open(now, &hit)?;
            }
        }
        Ok(())
    }

    /// Where to look for a satellite of which nothing is known: after a fix the oscillator's part
    /// of the Doppler is.
    fn doppler_range(&self) -> DopplerRange {
        let sign = self.tracking.spectrum.sign();
        let oscillator_hz = self.navigator.oscillator_doppler_hz();
        let settings = self.settings;
        DopplerRange {
            centre_hz: sign * oscillator_hz.unwrap_or(0.0),
            half_width_hz: oscillator_hz.map_or(settings.doppler_half_width_hz, |_| {
                SATELLITE_DOPPLER_HZ.min(settings.doppler_half_width_hz)
            }),
            false_alarm_probability: settings.false_alarm_probability,
        }
    }

    /// Opens a channel on a signal found.
    fn open(&mut self, now: u64, hit: &AcquisitionHit) -> Result<(), ReceiverError> {
        self.schedule.found(hit);
        let slot = self.slot(hit);
        self.slots.push(slot);
        self.slots.sort_by_key(|s| s.satellite);
        if hit.statistic > UNMISTAKABLE * hit.threshold {
            self.announce(now, hit.signal)?;
        }
        Ok(())
    }

    /// Reports an acquisition, once.
    fn announce(&mut self, now: u64, signal: SignalId) -> Result<(), ReceiverError> {
        let same = |s: &&mut Slot| s.channel.signal() == signal && !s.announced;
        let Some(slot) = self.slots.iter_mut().find(same) else {
            return Ok(());
        };
        slot.announced = true;
        let (satellite, hit) = (slot.satellite, slot.hit);
        self.acquired.insert(signal);
        let acquired = Acquired {
            satellite,
            doppler_hz: hit.doppler_hz,
            code_phase_chips: code_phase_at_first_sample(&hit, self.front_end),
            statistic: hit.statistic,
            cn0_dbhz: hit.cn0_dbhz,
        };
        self.emit(now, Some(satellite), EventKind::Acquired(acquired))
    }

    /// At the end, reports what was acquired and is still there.
    fn announce_rest(&mut self, now: u64) -> Result<(), ReceiverError> {
        let there = |slot: &mut Slot| {
            let cn0_dbhz = slot.channel.epoch(now).map(|e| e.cn0_dbhz);
            cn0_dbhz.is_none_or(|c| c > STILL_THERE_DBHZ)
        };
        let mut rest = Vec::new();
        for slot in &mut self.slots {
            if !slot.announced && there(slot) {
                rest.push(slot.channel.signal());
            }
        }
        rest.into_iter().try_for_each(|s| self.announce(now, s))
    }

    fn slot(&self, hit: &AcquisitionHit) -> Slot {
        let near = self.navigator.near();
        let pivot_week = near.map_or(DEFAULT_PIVOT_WEEK, GpsTime::week);
        Slot::new(hit, self.front_end, self.tracking, pivot_week)
    }

    /// Correlates and updates all channels, interval by interval, until none has an interval
    /// that ends by `now`.
    fn track(&mut self, now: u64) -> Result<(), ReceiverError> {
        loop {
            self.replicas.clear();
            let oldest = self.bank.oldest_tick();
            let due = |r: &Replica| r.end_tick <= now && r.start_tick >= oldest;
            let next = self.slots.iter().filter_map(|s| s.channel.replica());
            self.replicas.extend(next.filter(due));
            if self.replicas.is_empty() {
                return Ok(());
            }
            self.bank.correlate(&self.replicas, &mut self.taps)?;
            let (replicas, taps) = (
                std::mem::take(&mut self.replicas),
                std::mem::take(&mut self.taps),
            );
            for (replica, taps) in replicas.iter().zip(&taps) {
                self.update(now, replica, taps)?;
            }
            (self.replicas, self.taps) = (replicas, taps);
        }
    }

    fn update(&mut self, now: u64, replica: &Replica, taps: &Taps) -> Result<(), ReceiverError> {
        let same = |s: &&mut Slot| s.channel.signal() == replica.signal;
        let Some(slot) = self.slots.iter_mut().find(same) else {
            return Ok(());
        };
        let (update, decoded) = slot.update(replica, taps, &self.noise);
        let satellite = slot.satellite;
        let (from, to) = (slot.lock_reported, slot.channel.lock());
        slot.lock_reported = to;
        if self.settings.dump_taps {
            self.dump(satellite, replica, taps)?;
        }
        if let Some(sync) = update.bit_sync {
            self.spectrum.weigh(&sync);
            self.announce(now, replica.signal)?;
            self.emit(now, Some(satellite), EventKind::BitSync)?;
        }
        if from != to {
            self.emit(now, Some(satellite), EventKind::LockChanged { from, to })?;
        }
        for event in decoded {
            self.learn(now, satellite, event)?;
        }
        Ok(())
    }

    fn dump(
        &mut self,
        satellite: SatelliteId,
        replica: &Replica,
        taps: &Taps,
    ) -> Result<(), ReceiverError> {
        let deviation = self.noise.variance(taps).sqrt();
        let record = TapsRecord {
            time_s: self.time_s(replica.end_tick),
            satellite,
            duration_s: self.time_s(replica.end_tick - replica.start_tick),
            offsets_chips: replica.tap_offsets.as_slice().to_vec(),
            sums: taps.as_slice().iter().map(|s| s / deviation).collect(),
        };
        (self.sink)(Record::Taps(record))
    }

    /// Takes what a message says.
    fn learn(
        &mut self,
        now: u64,
        satellite: SatelliteId,
        event: Decoded,
    ) -> Result<(), ReceiverError> {
        match event {
            LnavEvent::Sync { tow_s, .. } => {
                let tow_s = f64::from(tow_s);
                self.emit(now, Some(satellite), EventKind::FrameSync { tow_s })
            }
            LnavEvent::Week { sent, .. } => {
                self.navigator.learn_time(sent);
                Ok(())
            }
            LnavEvent::Ephemeris(ephemeris) => {
                self.navigator.learn_ephemeris(ephemeris);
                let (iode, iodc) = (ephemeris.iode, ephemeris.iodc);
                let kind = EventKind::EphemerisDecoded { iode, iodc };
                self.emit(now, Some(satellite), kind)?;
                (self.sink)(Record::Ephemeris(ephemeris))
            }
            LnavEvent::IonosphereUtc(parameters) => {
                self.navigator.learn_ionosphere(parameters.klobuchar);
                let Some(near) = self.navigator.near() else {
                    return Ok(());
                };
                self.emit(now, Some(satellite), EventKind::IonosphereUtcDecoded)?;
                (self.sink)(Record::IonosphereUtc(IonosphereUtcRecord {
                    alpha: parameters.klobuchar.alpha,
                    beta: parameters.klobuchar.beta,
                    a0_s: parameters.utc.a0_s,
                    a1: parameters.utc.a1,
                    reference: parameters.utc.reference_time(near),
                    leap_seconds: i32::from(parameters.utc.delta_tls_s),
                }))
            }
            _ => Ok(()),
        }
    }

    /// Starts every channel anew, from its first sample, with the spectrum inverted.
    fn invert(&mut self, now: u64) -> Result<(), ReceiverError> {
        self.tracking.spectrum = Spectrum::Inverted;
        self.emit(now, None, EventKind::SpectrumInverted)?;
        let slots = self.slots.iter();
        self.slots = slots
            .map(|old| self.slot(&old.hit).succeeding(old))
            .collect();
        self.track(now)
    }

    /// Starts every channel anew after a jump of the samples.
    fn jump(&mut self, now: u64, jump: &Jump) -> Result<(), ReceiverError> {
        let kind = EventKind::Discontinuity {
            jump_s: jump.jump_s,
            channels: jump.channels,
        };
        self.emit(jump.tick.min(now), None, kind)?;
        self.navigator.time_jumped();
        for hit in &jump.hits {
            let fresh = self.slot(hit);
            let slot = self
                .slots
                .iter_mut()
                .find(|s| s.satellite == fresh.satellite);
            if let Some(slot) = slot {
                *slot = fresh.succeeding(slot);
            }
        }
        Ok(())
    }

    /// Lets go of channels whose signal is lost, or too old to go on with.
    fn drop_lost(&mut self, now: u64) -> Result<(), ReceiverError> {
        let oldest = self.bank.oldest_tick();
        let gone = |s: &Slot| match s.channel.replica() {
            None => true,
            Some(replica) => replica.start_tick < oldest,
        };
        let lost: Vec<_> = self.slots.iter().filter(|s| gone(s)).cloned().collect();
        self.slots.retain(|s| !gone(s));
        let now_s = self.time_s(now);
        for slot in lost {
            let signal = slot.channel.signal();
            self.schedule.lost(signal, slot.channel.doppler_hz(), now_s);
            self.emit(now, Some(slot.satellite), EventKind::Dropped)?;
        }
        Ok(())
    }

    fn navigate(&mut self, now: u64) -> Result<(), ReceiverError> {
        let time_s = self.time_s(now);
        let mut tracked: Vec<Tracked> = self
            .slots
            .iter_mut()
            .filter_map(|slot| {
                let epoch = slot.channel.epoch(now)?;
                Some(Tracked { slot, epoch })
            })
            .collect();
        let navigated = self.navigator.navigate(now, &mut tracked);
        let observations = report::observations(time_s, &mut tracked, &navigated);
        if let Some(observations) = observations {
            (self.sink)(Record::Observations(observations))?;
        }
        for one in &tracked {
            let record = report::channel(time_s, one, &navigated);
            (self.sink)(Record::Channel(record))?;
        }
        let fix = navigated.fix.as_ref();
        if let Some((solution, source)) = fix {
            self.report_exclusions(now, solution)?;
            self.report_fix(now, Fixed::Now)?;
            let pvt = report::pvt(time_s, solution, *source);
            (self.sink)(Record::Pvt(pvt))
        } else {
            self.report_fix(now, Fixed::Before)
        }
    }

    fn report_fix(&mut self, now: u64, to: Fixed) -> Result<(), ReceiverError> {
        let from = self.fixed;
        match (from, to) {
            (Fixed::Never, Fixed::Now) => {
                self.fixed = to;
                self.emit(now, None, EventKind::FirstFix)
            }
            (Fixed::Now, Fixed::Before) => {
                self.fixed = to;
                self.emit(now, None, EventKind::FixLost)
            }
            (Fixed::Before, Fixed::Now) => {
                self.fixed = to;
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn report_exclusions(
        &mut self,
        now: u64,
        solution: &gnss_nav::Solution,
    ) -> Result<(), ReceiverError> {
        let excluded: BTreeSet<_> = solution.excluded.iter().copied().collect();
        let before = std::mem::replace(&mut self.excluded, excluded.clone());
        for satellite in excluded.difference(&before) {
            let kind = EventKind::Excluded {
                monitor: "residuals".to_owned(),
                score: solution.chi_square,
                threshold: report::residual_threshold(solution, EXCLUSION_FALSE_ALARM),
            };
            self.emit(now, Some(*satellite), kind)?;
        }
        for satellite in before.difference(&excluded) {
            let tracked = self.slots.iter().any(|s| s.satellite == *satellite);
            if tracked {
                self.emit(now, Some(*satellite), EventKind::Readmitted)?;
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

/// Code phase of a hit carried back to the first sample, chips.
fn code_phase_at_first_sample(hit: &AcquisitionHit, front_end: FrontEnd) -> f64 {
    let spec = hit.signal.spec();
    let rate_hz = spec.code_rate_hz * (1.0 + hit.doppler_hz / spec.carrier_hz);
    let elapsed_s = hit.tick as f64 / front_end.sample_rate_hz;
    let length = f64::from(spec.code_length_chips);
    let phase = (hit.code_phase_chips - rate_hz * elapsed_s).rem_euclid(length);
    if phase < length { phase } else { 0.0 }
}
