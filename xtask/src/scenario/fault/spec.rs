//! Faults as a scenario file says them.

use serde::Deserialize;

use super::interference::{Level, PulseSpec};
use super::{RaySpec, Target};

/// A fault of a scenario file. Times are elapsed seconds; without an end a fault stays.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum FaultSpec {
    /// Nothing arrives of a satellite.
    Blocked {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
    },
    /// A satellite arrives weaker.
    Attenuated {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Time in which it grows and vanishes, s.
        #[serde(default)]
        ramp_s: f64,
        /// Loss of power, dB.
        loss_db: f64,
    },
    /// Reflections arrive beside a satellite's direct signal.
    Multipath {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Time in which they grow and vanish, s.
        #[serde(default)]
        ramp_s: f64,
        /// The reflections.
        ray: Vec<RaySpec>,
    },
    /// Reflections arrive in place of a satellite's direct signal.
    ReflectionOnly {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// The reflections.
        ray: Vec<RaySpec>,
    },
    /// Code and carrier of a satellite jump.
    Step {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// By how much the range grows, m.
        size_m: f64,
    },
    /// Code and carrier of a satellite drift away.
    Ramp {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End of the drift, s; the error stays.
        end_s: Option<f64>,
        /// How fast the range grows, m/s.
        rate_mps: f64,
    },
    /// The receiver's clock jumps.
    ClockJump {
        /// When, s.
        begin_s: f64,
        /// By how much, s.
        size_s: f64,
    },
    /// A satellite broadcasts an orbit and clock that it does not fly.
    WrongEphemeris {
        /// Which.
        sat: Target,
        /// When the broadcast changes (to the subframe), s; 0: wrong from the start.
        begin_s: f64,
        /// How far ahead on its orbit it claims to be, m.
        #[serde(default)]
        along_m: f64,
        /// How far out it claims to be, m.
        #[serde(default)]
        radial_m: f64,
        /// How far ahead it claims its clock to be, m.
        #[serde(default)]
        clock_m: f64,
    },
    /// Bits of a satellite's message are wrong.
    BitErrors {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Of each bit.
        probability: f64,
    },
    /// A carrier interferes.
    Tone {
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Power over noise density, dB-Hz, or points (s, dB-Hz).
        level_dbhz: Level,
        /// Offset from L1, Hz.
        #[serde(default)]
        offset_hz: f64,
        /// Pulses.
        pulses: Option<PulseSpec>,
    },
    /// A sweeping carrier interferes.
    Chirp {
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Power over noise density, dB-Hz, or points (s, dB-Hz).
        level_dbhz: Level,
        /// Offset from L1 where a sweep begins, Hz.
        from_hz: f64,
        /// Offset where it ends, Hz.
        to_hz: f64,
        /// Duration of a sweep, s.
        period_s: f64,
        /// Pulses.
        pulses: Option<PulseSpec>,
    },
    /// Noise interferes.
    Broadband {
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Power over noise density, dB-Hz, or points (s, dB-Hz).
        level_dbhz: Level,
        /// Two-sided width, Hz.
        width_hz: f64,
        /// Pulses.
        pulses: Option<PulseSpec>,
    },
    /// Somebody transmits a satellite's signal and leads the receiver away.
    Counterfeit {
        /// Which.
        sat: Target,
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
        /// Time in which it grows and vanishes, s.
        #[serde(default)]
        ramp_s: f64,
        /// Power over that of the satellite, dB.
        power_db: f64,
        /// Time after the onset during which it stays on the true signal, s.
        #[serde(default)]
        hold_s: f64,
        /// How fast its range grows then, m/s.
        #[serde(default)]
        lift_mps: f64,
        /// How fast it moves the receiver's place then, east, north, up, m/s.
        #[serde(default)]
        drag_enu_mps: [f64; 3],
    },
    /// Samples are lost.
    DroppedSamples {
        /// The first one lost, s.
        begin_s: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Nothing arrives of any satellite.
    Outage {
        /// Onset, s.
        begin_s: f64,
        /// End, s.
        end_s: Option<f64>,
    },
}
