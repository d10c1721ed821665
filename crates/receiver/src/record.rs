//! What the pipeline reports: plain records, written by sinks, never read back.

use fault_ml::learned::ChannelStep;
use gnss_nav::{Ephemeris, GpsTime, SatelliteId};
pub use gnss_signal::tracking::Lock;
use nalgebra::{Matrix3, SMatrix, Vector3};
use num_complex::Complex64;

/// One thing the pipeline reports. `time_s` counts from the first sample everywhere.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Record {
    /// Something happened.
    Event(Event),
    /// The solution of a navigation epoch.
    Pvt(PvtRecord),
    /// One channel at a navigation epoch.
    Channel(ChannelRecord),
    /// All observations of a navigation epoch.
    Observations(ObservationEpoch),
    /// An ephemeris decoded from the signal.
    Ephemeris(Ephemeris),
    /// Ionosphere and time parameters decoded from the signal.
    IonosphereUtc(IonosphereUtcRecord),
    /// Correlator sums of one integration.
    Taps(TapsRecord),
}

/// Where a solution came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// Coarse-time solution of a short snapshot.
    Snapshot,
    /// Least squares, without memory.
    LeastSquares,
    /// The navigation filter.
    Filter,
}

impl Source {
    /// Name in the output files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Snapshot => "snapshot",
            Self::LeastSquares => "least_squares",
            Self::Filter => "filter",
        }
    }
}

/// How far a solution can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Enough consistent measurements.
    Fix,
    /// No or too few measurements; the covariance has grown.
    Predicted,
    /// Measurements that contradict each other.
    Unreliable,
}

impl Status {
    /// Name in the output files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fix => "fix",
            Self::Predicted => "predicted",
            Self::Unreliable => "unreliable",
        }
    }
}

/// Position, velocity and time of one navigation epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct PvtRecord {
    /// Seconds since the first sample.
    pub time_s: f64,
    /// GPS time of the epoch, receiver clock corrected.
    pub time: GpsTime,
    /// Position, ECEF, m.
    pub position_ecef_m: Vector3<f64>,
    /// Velocity and clock drift, where they were measured or predicted.
    pub velocity: Option<VelocityRecord>,
    /// Receiver clock bias, m.
    pub clock_bias_m: f64,
    /// Satellites in the solution.
    pub satellites_used: usize,
    /// Position dilution of precision.
    pub pdop: f64,
    /// Where the solution came from.
    pub source: Source,
    /// Standard deviations east, north, up, m.
    pub sigma_enu_m: [f64; 3],
    /// Covariance of the position, ECEF, m^2.
    pub position_covariance_ecef_m2: Matrix3<f64>,
    /// Horizontal protection level, m.
    pub horizontal_protection_m: Option<f64>,
    /// Vertical protection level, m.
    pub vertical_protection_m: Option<f64>,
    /// How far it can be relied on.
    pub status: Status,
    /// What a navigation filter says of its own estimate.
    pub filter: Option<Box<FilterRecord>>,
}

/// How a receiver moves, and what its clock does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VelocityRecord {
    /// ECEF, m/s.
    pub ecef_mps: Vector3<f64>,
    /// Drift of the receiver's clock, m/s.
    pub clock_drift_mps: f64,
    /// Standard deviation of the speed (3-D), m/s.
    pub sigma_mps: f64,
}

/// A navigation filter's own view of an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterRecord {
    /// Covariance of its state by tracking noise and motion alone, m and m/s: what lasts of the errors of
    /// ephemerides and atmosphere is left out. Order x, vx, y, vy, z, vz (ECEF), clock bias, clock drift.
    pub covariance: SMatrix<f64, 8, 8>,
    /// Innovations in sum, each squared over its variance given those before it.
    pub normalised_innovation_squared: f64,
    /// How many.
    pub innovations: usize,
}

/// Who steers a channel's oscillators.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LoopMembership {
    /// The channel's own loops.
    Scalar,
    /// The navigation filter.
    Vector,
}

impl LoopMembership {
    /// Name in the output files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Vector => "vector",
        }
    }
}

/// What the navigation solution does with a satellite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Disposition {
    /// Used with its own variance.
    Use,
    /// Used with its variance multiplied.
    Deweight {
        /// Factor on the variance.
        variance_factor: f64,
    },
    /// Left out.
    Exclude,
    /// Not usable yet: no lock, no time or no ephemeris.
    Unavailable,
}

impl Disposition {
    /// Name in the output files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Use => "use",
            Self::Deweight { .. } => "deweight",
            Self::Exclude => "exclude",
            Self::Unavailable => "unavailable",
        }
    }
}

/// An innovation and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnovationRecord {
    /// Measurement minus prediction.
    pub value: f64,
    /// Its predicted standard deviation.
    pub sigma: f64,
}

/// A monitor's score of a channel; faulty exactly when the score exceeds the threshold.
#[derive(Debug, Clone, PartialEq)]
pub struct ScoreRecord {
    /// The monitor.
    pub monitor: String,
    /// Its score.
    pub score: f64,
    /// Its threshold.
    pub threshold: f64,
}

/// How a channel tracks its signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackingRecord {
    /// What the channel sees.
    pub lock: Lock,
    /// Who steers it.
    pub membership: LoopMembership,
    /// Prompt sum of the last integration, normalised to unit noise variance.
    pub prompt: Complex64,
    /// Code error, chips.
    pub code_error_chips: f64,
    /// Frequency error, Hz.
    pub frequency_error_hz: f64,
}

/// One channel, or one satellite observed elsewhere, at a navigation epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelRecord {
    /// Seconds since the first sample.
    pub time_s: f64,
    /// The satellite tracked.
    pub satellite: SatelliteId,
    /// C/N0, dB-Hz, where it is known.
    pub cn0_dbhz: Option<f64>,
    /// State of the tracking; absent where observations come from elsewhere.
    pub tracking: Option<TrackingRecord>,
    /// Pseudorange, m.
    pub pseudorange_m: Option<f64>,
    /// Range rate, m/s.
    pub range_rate_mps: Option<f64>,
    /// Innovation of the pseudorange, m.
    pub innovation_code_m: Option<InnovationRecord>,
    /// Innovation of the range rate, m/s.
    pub innovation_rate_mps: Option<InnovationRecord>,
    /// What its monitors were shown, where it is steered by the filter.
    pub shown: Option<ChannelStep>,
    /// What the solution does with it.
    pub disposition: Disposition,
    /// Scores of the running monitors.
    pub scores: Vec<ScoreRecord>,
}

/// One satellite's observation.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// The satellite.
    pub satellite: SatelliteId,
    /// Pseudorange, m.
    pub pseudorange_m: f64,
    /// Doppler, Hz, where it is measured; positive when approaching.
    pub doppler_hz: Option<f64>,
    /// C/N0, dB-Hz, where it is known.
    pub cn0_dbhz: Option<f64>,
    /// Carrier phase, where one is tracked.
    pub carrier_phase: Option<CarrierPhase>,
    /// Azimuth (from north through east), rad.
    pub azimuth_rad: Option<f64>,
    /// Elevation, rad.
    pub elevation_rad: Option<f64>,
}

/// A tracked carrier phase, in the RINEX sense: it grows with the range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CarrierPhase {
    /// Phase, cycles.
    pub cycles: f64,
    /// Whether lock was lost since the previous epoch.
    pub loss_of_lock: bool,
    /// Whether half a cycle is unresolved.
    pub half_cycle: bool,
}

/// All observations of a navigation epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservationEpoch {
    /// Seconds since the first sample.
    pub time_s: f64,
    /// Time of the epoch by the receiver's clock.
    pub time: GpsTime,
    /// The observations, by satellite.
    pub observations: Vec<Observation>,
}

/// Ionosphere and UTC parameters as broadcast (IS-GPS-200, 20.3.3.5.1.6 and .7).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IonosphereUtcRecord {
    /// Klobuchar alpha, s, s/semicircle, ...
    pub alpha: [f64; 4],
    /// Klobuchar beta, s, s/semicircle, ...
    pub beta: [f64; 4],
    /// UTC offset A0, s.
    pub a0_s: f64,
    /// UTC drift A1, s/s.
    pub a1: f64,
    /// Reference time of the UTC parameters.
    pub reference: GpsTime,
    /// Leap seconds, GPS minus UTC.
    pub leap_seconds: i32,
}

/// Correlator sums of one integration of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct TapsRecord {
    /// Seconds since the first sample, end of the integration.
    pub time_s: f64,
    /// The satellite.
    pub satellite: SatelliteId,
    /// Duration of the integration, s.
    pub duration_s: f64,
    /// Offsets of the taps, chips; above zero is late.
    pub offsets_chips: Vec<f64>,
    /// Sums, normalised to unit noise variance.
    pub sums: Vec<Complex64>,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Seconds since the first sample.
    pub time_s: f64,
    /// The satellite concerned.
    pub satellite: Option<SatelliteId>,
    /// What happened.
    pub kind: EventKind,
}

/// Kinds of events.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum EventKind {
    /// A satellite was acquired.
    Acquired(Acquired),
    /// A channel's lock changed.
    LockChanged {
        /// Before.
        from: Lock,
        /// After.
        to: Lock,
    },
    /// A channel found the boundaries of the data bits.
    BitSync,
    /// A channel found the subframes.
    FrameSync {
        /// GPS time of week at the start of the subframe, s.
        tow_s: f64,
    },
    /// A channel was given up.
    Dropped,
    /// Samples are missing or repeated.
    Discontinuity {
        /// Seconds by which the signals jumped (above zero: samples are missing).
        jump_s: f64,
        /// How many channels saw it.
        channels: usize,
    },
    /// The spectrum runs the other way: I and Q exchanged, or mixed from above.
    SpectrumInverted,
    /// An ephemeris was decoded.
    EphemerisDecoded {
        /// Issue of data, ephemeris.
        iode: u8,
        /// Issue of data, clock.
        iodc: u16,
    },
    /// Ionosphere and UTC parameters were decoded.
    IonosphereUtcDecoded,
    /// The first solution.
    FirstFix,
    /// The solution was lost.
    FixLost,
    /// A satellite was left out of the solution.
    Excluded {
        /// Who found it faulty.
        monitor: String,
        /// Its score.
        score: f64,
        /// Its threshold.
        threshold: f64,
        /// By how much its pseudorange is off, m, where that was found.
        residual_m: Option<f64>,
    },
    /// A satellite was taken back into the solution, or is no longer held faulty.
    Readmitted,
    /// A satellite was found faulty, and is used all the same.
    Alarm {
        /// Who found it faulty.
        monitor: String,
        /// Its score.
        score: f64,
        /// Its threshold.
        threshold: f64,
    },
    /// Protection levels can be stated from here on, or no longer.
    IntegrityChanged {
        /// Whether they can.
        is_available: bool,
    },
    /// Another steers the channels from here on.
    ModeSwitched {
        /// Who.
        to: LoopMembership,
    },
    /// An epoch of a file is not later than the one before, and is left out.
    EpochSkipped {
        /// Line of the file it begins in.
        line: u64,
    },
    /// An epoch of a file announces satellites that it does not hold.
    EpochShort {
        /// Line of the file it begins in.
        line: u64,
        /// How many.
        missing: usize,
    },
    /// All pseudoranges jumped alike: the receiver's clock made a step.
    ClockStep {
        /// By how much they are longer, m.
        size_m: f64,
    },
    /// Without the satellites found faulty too few would be left: they are weighted from here on, or left out
    /// again.
    TooFewLeft {
        /// How many are weighted; none where they are left out again.
        weighted: usize,
    },
    /// Most channels contradicted the filter; it starts anew from least squares.
    FilterReset {
        /// How many.
        channels: usize,
    },
}

/// A satellite as acquired.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acquired {
    /// The satellite.
    pub satellite: SatelliteId,
    /// Doppler, Hz.
    pub doppler_hz: f64,
    /// Code phase at the first sample of the recording, chips, in [0, 1023).
    pub code_phase_chips: f64,
    /// Detection statistic.
    pub statistic: f64,
    /// C/N0, dB-Hz.
    pub cn0_dbhz: f64,
}
