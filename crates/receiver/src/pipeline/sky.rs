//! What is in the sky: searches, and channels opened on what they find.

use std::collections::BTreeSet;

use gnss_nav::lnav::DEFAULT_PIVOT_WEEK;
use gnss_nav::{GpsTime, SatelliteId};
use gnss_signal::{AcquisitionHit, CorrelatorBank, FrontEnd, SignalId};

use super::run::Run;
use super::schedule::DopplerRange;
use super::slot::Slot;
use crate::ReceiverError;
use crate::record::{Acquired, EventKind};

/// An acquisition this far above its threshold is reported at once; any other when the channel
/// finds the data bits, which no chance peak has.
const UNMISTAKABLE: f64 = 2.0;
/// An acquisition not confirmed by the end of the samples is reported above this, dB-Hz: the
/// least that acquisition finds.
const STILL_THERE_DBHZ: f64 = 31.0;
/// Doppler of satellites for a receiver slower than 200 m/s, Hz.
const SATELLITE_DOPPLER_HZ: f64 = 6e3;

impl<B: CorrelatorBank> Run<'_, B> {
    pub(super) fn search(&mut self, now: u64, ended: bool) -> Result<(), ReceiverError> {
        let tracked: BTreeSet<_> = self.slots.iter().map(|s| s.channel.signal()).collect();
        let wanted: Vec<_> = self
            .settings
            .signals
            .iter()
            .copied()
            .filter(|s| !tracked.contains(s))
            .filter(|s| {
                let satellite = SatelliteId::gps(s.prn());
                let joins = self.vector.is_some() && self.navigator.knows(satellite);
                !joins && !self.navigator.is_below_horizon(satellite, now)
            })
            .collect();
        if wanted.is_empty() {
            return Ok(());
        }
        let range = self.doppler_range();
        let idle = self.slots.is_empty();
        for request in self.schedule.due(now, (ended, idle), &wanted, &range) {
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
    pub(super) fn announce(&mut self, now: u64, signal: SignalId) -> Result<(), ReceiverError> {
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
    pub(super) fn announce_rest(&mut self, now: u64) -> Result<(), ReceiverError> {
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

    pub(super) fn slot(&self, hit: &AcquisitionHit) -> Slot {
        let near = self.navigator.near();
        let pivot_week = near.map_or(DEFAULT_PIVOT_WEEK, GpsTime::week);
        Slot::new(hit, self.front_end, self.tracking, pivot_week).watched(self.shape.clone())
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
