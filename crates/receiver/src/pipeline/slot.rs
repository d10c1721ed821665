//! One satellite being received: its channel, its message, and what its code phase means in time.

use gnss_nav::lnav::{LnavDecoder, LnavEvent, NavBit, Polarity, nearest_time};
use gnss_nav::prediction::Expected;
use gnss_nav::{GpsTime, SatelliteId};
use gnss_signal::tracking::{
    Channel, ChannelEpoch, ChannelUpdate, Lock, NoiseFloor, TrackingSettings,
};
use gnss_signal::{AcquisitionHit, FrontEnd, Replica, Signal, SignalId, Taps};

use super::shape::ShapeWatch;
use super::vector::{Time, steering};

/// One satellite being received.
#[derive(Debug, Clone)]
pub(super) struct Slot {
    pub(super) satellite: SatelliteId,
    pub(super) channel: Channel,
    /// Where the channel began.
    pub(super) hit: AcquisitionHit,
    decoder: LnavDecoder,
    frame: Option<Frame>,
    /// Subframes received with every word good since the channel began, bit 0 = subframe 1.
    pub(super) subframes: u8,
    pub(super) lock_reported: Lock,
    /// Whether the channel began where navigation predicts a signal, without an acquisition.
    pub(super) predicted: bool,
    /// Whether the acquisition was reported.
    pub(super) announced: bool,
    pub(super) bits_found: bool,
    /// The shape of its correlation, where that is watched.
    pub(super) shape: Option<ShapeWatch>,
    /// Cycles added to the carrier phase so that it agrees with the first pseudorange.
    phase_offset_cycles: Option<f64>,
}

/// Transmit time as decoded from the message.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Frame {
    code_period: i64,
    tow_s: u32,
    polarity: Polarity,
}

/// What of a satellite's message concerns the rest of the receiver.
pub(super) type Decoded = LnavEvent;

impl Slot {
    pub(super) fn new(
        hit: &AcquisitionHit,
        front_end: FrontEnd,
        tracking: TrackingSettings,
        pivot_week: i32,
    ) -> Self {
        let satellite = SatelliteId::gps(hit.signal.prn());
        Self {
            satellite,
            hit: *hit,
            channel: Channel::new(hit, front_end, tracking),
            decoder: LnavDecoder::new(satellite, pivot_week),
            frame: None,
            subframes: 0,
            lock_reported: Lock::PullIn,
            predicted: false,
            announced: false,
            bits_found: false,
            shape: None,
            phase_offset_cycles: None,
        }
    }

    /// A slot on a signal that navigation expects at `tick`.
    pub(super) fn predicted(
        signal: SignalId,
        front_end: FrontEnd,
        tracking: TrackingSettings,
        tick: u64,
        expected: &Expected,
    ) -> Self {
        let steering = steering(tick, expected, Time::Exact);
        let hit = AcquisitionHit {
            signal,
            tick,
            code_phase_chips: steering.code_phase_chips,
            doppler_hz: steering.doppler_hz,
            statistic: 0.0,
            threshold: 0.0,
            cn0_dbhz: 0.0,
        };
        Self {
            channel: Channel::predicted(signal, front_end, tracking, &steering),
            lock_reported: Lock::Lost,
            predicted: true,
            bits_found: true,
            ..Self::new(&hit, front_end, tracking, expected.transmit_time.week())
        }
    }

    /// This slot under watch by `shape`.
    pub(super) fn watched(mut self, shape: Option<ShapeWatch>) -> Self {
        self.shape = shape;
        self
    }

    /// This slot in place of `old`: what was reported of that one stays reported.
    pub(super) const fn succeeding(mut self, old: &Self) -> Self {
        self.announced = old.announced;
        self.lock_reported = old.lock_reported;
        self
    }

    /// Takes the sums of a replica; returns the channel's update and what its message says.
    pub(super) fn update(
        &mut self,
        replica: &Replica,
        taps: &Taps,
        noise: &NoiseFloor,
    ) -> (ChannelUpdate, Vec<Decoded>) {
        let update = self.channel.update(replica, taps, noise);
        if let Some(shape) = &mut self.shape {
            shape.step(replica, taps, &self.channel);
        }
        self.bits_found |= update.bit_sync.is_some();
        let decoded = update.bit.map_or_else(Vec::new, |bit| {
            self.decoder.push(NavBit {
                soft: bit.soft,
                code_period: bit.code_period,
            })
        });
        decoded.iter().for_each(|event| self.follow(event));
        (update, decoded)
    }

    fn follow(&mut self, event: &Decoded) {
        match *event {
            LnavEvent::Sync {
                start_code_period,
                tow_s,
                polarity,
            } => {
                self.frame = Some(Frame {
                    code_period: start_code_period,
                    tow_s,
                    polarity,
                });
            }
            LnavEvent::Subframe {
                id,
                tow_s,
                start_code_period,
                words_valid,
                polarity,
                ..
            } => {
                if words_valid == 0x3FF {
                    self.subframes |= 1 << (id - 1);
                }
                if let Some(frame) = &mut self.frame {
                    frame.code_period = start_code_period;
                    frame.tow_s = tow_s;
                    frame.polarity = polarity.unwrap_or(frame.polarity);
                }
            }
            LnavEvent::SyncLost { .. } => self.frame = None,
            _ => {}
        }
    }

    /// Whether the message tells the transmit time.
    pub(super) const fn has_frame(&self) -> bool {
        self.frame.is_some()
    }

    /// Transmit time at the epoch by the satellite's clock, from the message; its week is the one
    /// nearest to `near`.
    pub(super) fn transmit_time(&self, epoch: &ChannelEpoch, near: GpsTime) -> Option<GpsTime> {
        let frame = self.frame?;
        let periods = (epoch.code_period - frame.code_period) as f64;
        let spec = Signal::GpsL1Ca.spec();
        Some(
            nearest_time(frame.tow_s, near)
                + periods * spec.code_period_s()
                + transmit_fraction_s(epoch),
        )
    }

    /// Carrier phase in the sense of RINEX, near the pseudorange in cycles, and whether half a
    /// cycle is unresolved.
    pub(super) fn carrier_phase(
        &mut self,
        epoch: &ChannelEpoch,
        pseudorange_cycles: f64,
    ) -> (f64, bool) {
        let cycles = -epoch.doppler_cycles;
        if epoch.phase_slipped {
            self.phase_offset_cycles = None;
        }
        let offset = *self
            .phase_offset_cycles
            .get_or_insert_with(|| (pseudorange_cycles - cycles).round());
        let half = match self.frame.map(|f| f.polarity) {
            Some(Polarity::Inverted) => 0.5,
            _ => 0.0,
        };
        (cycles + offset + half, self.frame.is_none())
    }
}

/// Code phase of an epoch as a time in the code period, s.
pub(super) fn transmit_fraction_s(epoch: &ChannelEpoch) -> f64 {
    epoch.code_phase_chips / epoch.signal.spec().code_rate_hz
}
