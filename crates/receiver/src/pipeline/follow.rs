//! Following the signals: correlation, loops, messages, and what befalls them.

use gnss_nav::SatelliteId;
use gnss_nav::lnav::LnavEvent;
use gnss_signal::tracking::Spectrum;
use gnss_signal::{CorrelatorBank, Replica, Taps};

use super::discontinuity::Jump;
use super::run::Run;
use super::slot::{Decoded, Slot};
use crate::ReceiverError;
use crate::record::{EventKind, IonosphereUtcRecord, Record, TapsRecord};

impl<B: CorrelatorBank> Run<'_, B> {
    /// Correlates and updates all channels, interval by interval, until none has an interval
    /// that ends by `now`.
    pub(super) fn track(&mut self, now: u64) -> Result<(), ReceiverError> {
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
    pub(super) fn invert(&mut self, now: u64) -> Result<(), ReceiverError> {
        self.tracking.spectrum = Spectrum::Inverted;
        self.emit(now, None, EventKind::SpectrumInverted)?;
        let slots = self.slots.iter();
        self.slots = slots
            .map(|old| self.slot(&old.hit).succeeding(old))
            .collect();
        self.track(now)
    }

    /// Starts every channel anew after a jump of the samples.
    pub(super) fn jump(&mut self, now: u64, jump: &Jump) -> Result<(), ReceiverError> {
        let kind = EventKind::Discontinuity {
            jump_s: jump.jump_s,
            channels: jump.channels,
        };
        self.emit(jump.tick.min(now), None, kind)?;
        self.navigator.time_jumped();
        self.leave_vector_tracking(now)?;
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
    pub(super) fn drop_lost(&mut self, now: u64) -> Result<(), ReceiverError> {
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
}
