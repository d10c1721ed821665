//! What a run found, in the form of `summary.json`.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use gnss_nav::geodesy::Geodetic;
use serde::{Deserialize, Serialize};

use crate::record::{
    Acquired, ChannelRecord, Event, EventKind, LoopMembership, PvtRecord, Record, Status,
};
use crate::sink::rounded;

/// `summary.json`; what does not apply is absent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Signal received, s.
    pub signal_s: f64,
    /// Satellites acquired, by number.
    pub acquired: Vec<AcquiredSatellite>,
    /// Satellites whose ephemeris was decoded from the signal, by number.
    pub ephemerides_decoded: Vec<u8>,
    /// Time of the first fix since the first sample, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first_fix_s: Option<f64>,
    /// Epochs with status `fix`.
    pub fixes: u64,
    /// Time of the switch from scalar to vector tracking, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mode_switch_s: Option<f64>,
    /// Why there was no fix.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_fix_reason: Option<String>,
    /// The last position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<Position>,
    /// The last velocity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity: Option<Velocity>,
    /// GPS time of the last position.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<Time>,
    /// Errors against the truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<ErrorStatistics>,
    /// Satellites found faulty, in the order of their alarms.
    pub faults: Vec<Fault>,
}

/// A satellite as acquired.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AcquiredSatellite {
    /// Its name, for instance `G07`.
    pub sat: String,
    /// Its number.
    pub prn: u8,
    /// Doppler, Hz.
    pub doppler_hz: f64,
    /// Code phase at the first sample, chips, in [0, 1023).
    pub code_phase_chips: f64,
    /// Detection statistic.
    pub statistic: f64,
    /// C/N0, dB-Hz.
    pub cn0_dbhz: f64,
}

impl From<&Acquired> for AcquiredSatellite {
    fn from(acquired: &Acquired) -> Self {
        // Rounding must not reach the end of the code, which is its beginning.
        let code_phase_chips = rounded(acquired.code_phase_chips, 4);
        Self {
            sat: acquired.satellite.to_string(),
            prn: acquired.satellite.prn,
            doppler_hz: rounded(acquired.doppler_hz, 3),
            code_phase_chips: if code_phase_chips >= 1023.0 {
                0.0
            } else {
                code_phase_chips
            },
            statistic: rounded(acquired.statistic, 3),
            cn0_dbhz: rounded(acquired.cn0_dbhz, 2),
        }
    }
}

/// A position, geodetic (WGS-84, ellipsoidal height) and ECEF.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Position {
    /// Latitude, degrees north.
    pub lat_deg: f64,
    /// Longitude, degrees east.
    pub lon_deg: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
    /// ECEF x, m.
    pub x_m: f64,
    /// ECEF y, m.
    pub y_m: f64,
    /// ECEF z, m.
    pub z_m: f64,
}

/// A velocity in ECEF.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Velocity {
    /// Along x, m/s.
    pub vx_mps: f64,
    /// Along y, m/s.
    pub vy_mps: f64,
    /// Along z, m/s.
    pub vz_mps: f64,
}

/// GPS time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// Week, unrolled.
    pub week: i32,
    /// Time of week, s.
    pub tow_s: f64,
}

/// Errors against the truth, and how often there was a solution to compare.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ErrorStatistics {
    /// Epochs with status fix or predicted over epochs due from the first fix to the end.
    pub availability: f64,
    /// Root mean square of the horizontal error, m.
    pub horizontal_rms_m: f64,
    /// 95 % of the horizontal errors are at most this, m.
    pub horizontal_p95_m: f64,
    /// Largest horizontal error, m.
    pub horizontal_max_m: f64,
    /// Root mean square of the height error, m.
    pub vertical_rms_m: f64,
    /// Largest error in three dimensions, m.
    pub position_3d_max_m: f64,
    /// Root mean square of the velocity error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity_rms_mps: Option<VelocityError>,
}

/// Velocity error by axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VelocityError {
    /// East, m/s.
    pub east: f64,
    /// North, m/s.
    pub north: f64,
    /// Up, m/s.
    pub up: f64,
}

/// A satellite found faulty.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    /// Its name.
    pub sat: String,
    /// Its number.
    pub prn: u8,
    /// Who found it.
    pub monitor: String,
    /// When, s.
    pub alarm_s: f64,
    /// When it was left out, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub excluded_s: Option<f64>,
    /// When it was taken back, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub readmitted_s: Option<f64>,
}

impl fmt::Display for Summary {
    /// One line for each thing found; the reason for no fix comes last.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        line(f, "signal", &format!("{:.3} s", self.signal_s))?;
        let strengths = self
            .acquired
            .iter()
            .map(|s| format!("{} {:.0}", s.sat, s.cn0_dbhz));
        line(f, "acquired", &strengths.collect::<Vec<_>>().join("  "))?;
        let decoded = self
            .ephemerides_decoded
            .iter()
            .map(|prn| format!("G{prn:02}"));
        line(f, "ephemerides", &decoded.collect::<Vec<_>>().join(" "))?;
        if let Some(first_s) = self.first_fix_s {
            line(
                f,
                "fixes",
                &format!("{}, the first at {first_s:.3} s", self.fixes),
            )?;
        }
        if let Some(p) = &self.position {
            let place = format!("{:.7}° {:.7}° {:.2} m", p.lat_deg, p.lon_deg, p.height_m);
            line(f, "position", &place)?;
        }
        if let Some(v) = &self.velocity {
            let velocity = format!("{:.3} {:.3} {:.3} m/s (ECEF)", v.vx_mps, v.vy_mps, v.vz_mps);
            line(f, "velocity", &velocity)?;
        }
        if let Some(time) = &self.time {
            line(
                f,
                "time",
                &format!("GPS week {}, {:.6} s", time.week, time.tow_s),
            )?;
        }
        if let Some(error) = &self.error {
            line(f, "error", &error.to_string())?;
        }
        for fault in &self.faults {
            line(
                f,
                "fault",
                &format!(
                    "{} at {:.2} s ({})",
                    fault.sat, fault.alarm_s, fault.monitor
                ),
            )?;
        }
        line(
            f,
            "no fix",
            self.no_fix_reason.as_deref().unwrap_or_default(),
        )
    }
}

impl fmt::Display for ErrorStatistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "horizontal {:.2} m rms, {:.2} m at most; vertical {:.2} m rms; available {:.1} %",
            self.horizontal_rms_m,
            self.horizontal_max_m,
            self.vertical_rms_m,
            100.0 * self.availability
        )
    }
}

/// A name and its value, or nothing where there is no value.
fn line(f: &mut fmt::Formatter<'_>, name: &str, value: &str) -> fmt::Result {
    if value.is_empty() {
        return Ok(());
    }
    writeln!(f, "{name:<12}{value}")
}

/// Builds a [`Summary`] from the records of a run.
#[derive(Debug, Clone, Default)]
pub struct SummaryBuilder {
    acquired: BTreeMap<u8, AcquiredSatellite>,
    decoded: BTreeSet<u8>,
    first_fix_s: Option<f64>,
    fixes: u64,
    last: Option<PvtRecord>,
    mode_switch_s: Option<f64>,
    faults: Vec<Fault>,
    channel_rows: u64,
    channel_epochs: u64,
    channel_time_s: Option<f64>,
}

impl SummaryBuilder {
    /// Takes one record.
    pub fn record(&mut self, record: &Record) {
        match record {
            Record::Event(event) => self.event(event),
            Record::Pvt(pvt) => self.solution(pvt),
            Record::Channel(channel) => self.channel(channel),
            Record::Ephemeris(ephemeris) => {
                self.decoded.insert(ephemeris.satellite.prn);
            }
            Record::Observations(_) | Record::IonosphereUtc(_) | Record::Taps(_) => {}
        }
    }

    /// Mean number of channels over the navigation epochs that had any.
    #[must_use]
    pub fn channels_mean(&self) -> f64 {
        self.channel_rows as f64 / self.channel_epochs.max(1) as f64
    }

    /// The summary of `signal_s` seconds of signal; the reason is kept where there was no fix.
    #[must_use]
    pub fn finish(self, signal_s: f64, no_fix_reason: Option<String>) -> Summary {
        Summary {
            signal_s: rounded(signal_s, 9),
            acquired: self.acquired.into_values().collect(),
            ephemerides_decoded: self.decoded.into_iter().collect(),
            first_fix_s: self.first_fix_s.map(|time_s| rounded(time_s, 6)),
            fixes: self.fixes,
            mode_switch_s: self.mode_switch_s.map(|time_s| rounded(time_s, 6)),
            no_fix_reason: no_fix_reason.filter(|_| self.first_fix_s.is_none()),
            position: self.last.as_ref().map(position),
            velocity: self.last.as_ref().and_then(velocity),
            time: self.last.as_ref().map(|pvt| Time {
                week: pvt.time.week(),
                tow_s: rounded(pvt.time.tow_s(), 9),
            }),
            error: None,
            faults: self.faults,
        }
    }

    fn event(&mut self, event: &Event) {
        match (&event.kind, event.satellite) {
            (EventKind::Acquired(acquired), _) => {
                self.acquired
                    .entry(acquired.satellite.prn)
                    .or_insert_with(|| acquired.into());
            }
            (EventKind::Excluded { monitor, .. }, Some(satellite)) => self.faults.push(Fault {
                sat: satellite.to_string(),
                prn: satellite.prn,
                monitor: monitor.clone(),
                alarm_s: rounded(event.time_s, 6),
                excluded_s: Some(rounded(event.time_s, 6)),
                readmitted_s: None,
            }),
            (EventKind::Alarm { monitor, .. }, Some(satellite)) => self.faults.push(Fault {
                sat: satellite.to_string(),
                prn: satellite.prn,
                monitor: monitor.clone(),
                alarm_s: rounded(event.time_s, 6),
                excluded_s: None,
                readmitted_s: None,
            }),
            (
                EventKind::ModeSwitched {
                    to: LoopMembership::Vector,
                },
                _,
            ) => {
                self.mode_switch_s.get_or_insert(event.time_s);
            }
            (EventKind::Readmitted, Some(satellite)) => {
                let open =
                    |fault: &&mut Fault| fault.prn == satellite.prn && fault.readmitted_s.is_none();
                if let Some(fault) = self.faults.iter_mut().rev().find(open) {
                    fault.readmitted_s = Some(rounded(event.time_s, 6));
                }
            }
            _ => {}
        }
    }

    fn solution(&mut self, pvt: &PvtRecord) {
        if pvt.status == Status::Fix {
            self.fixes += 1;
            self.first_fix_s.get_or_insert(pvt.time_s);
        }
        self.last = Some(pvt.clone());
    }

    fn channel(&mut self, channel: &ChannelRecord) {
        self.channel_rows += 1;
        if self.channel_time_s != Some(channel.time_s) {
            self.channel_time_s = Some(channel.time_s);
            self.channel_epochs += 1;
        }
    }
}

fn position(pvt: &PvtRecord) -> Position {
    let geodetic = Geodetic::from_ecef(&pvt.position_ecef_m);
    Position {
        lat_deg: rounded(geodetic.lat_rad.to_degrees(), 9),
        lon_deg: rounded(geodetic.lon_rad.to_degrees(), 9),
        height_m: rounded(geodetic.height_m, 4),
        x_m: rounded(pvt.position_ecef_m.x, 4),
        y_m: rounded(pvt.position_ecef_m.y, 4),
        z_m: rounded(pvt.position_ecef_m.z, 4),
    }
}

fn velocity(pvt: &PvtRecord) -> Option<Velocity> {
    pvt.velocity.map(|v| Velocity {
        vx_mps: rounded(v.ecef_mps.x, 5),
        vy_mps: rounded(v.ecef_mps.y, 5),
        vz_mps: rounded(v.ecef_mps.z, 5),
    })
}

#[cfg(test)]
mod tests {
    use gnss_nav::SatelliteId;

    use super::*;
    use crate::sink::sample_records::{channel, ephemeris, pvt};

    fn acquired(prn: u8, doppler_hz: f64) -> Record {
        Record::Event(Event {
            time_s: 0.0,
            satellite: Some(SatelliteId::gps(prn)),
            kind: EventKind::Acquired(Acquired {
                satellite: SatelliteId::gps(prn),
                doppler_hz,
                code_phase_chips: 1_022.999_99,
                statistic: 20.0,
                cn0_dbhz: 45.0,
            }),
        })
    }

    #[test]
    fn the_first_acquisition_of_a_satellite_counts_and_lists_are_sorted() {
        let mut builder = SummaryBuilder::default();
        for record in [acquired(9, 100.0), acquired(3, 5.0), acquired(9, 200.0)] {
            builder.record(&record);
        }
        builder.record(&Record::Ephemeris(ephemeris(9)));
        let summary = builder.finish(1.0, Some("too few satellites".to_owned()));
        let found: Vec<_> = summary
            .acquired
            .iter()
            .map(|a| (a.prn, a.doppler_hz))
            .collect();
        assert_eq!(found, [(3, 5.0), (9, 100.0)]);
        assert_eq!(summary.acquired[0].code_phase_chips, 0.0);
        assert_eq!(summary.ephemerides_decoded, [9]);
        assert_eq!(summary.no_fix_reason.as_deref(), Some("too few satellites"));
        let json = serde_json::to_string(&summary).unwrap();
        assert!(
            !json.contains("first_fix_s") && !json.contains("position"),
            "{json}"
        );
    }

    #[test]
    fn fixes_are_counted_and_the_last_solution_is_reported() {
        let mut builder = SummaryBuilder::default();
        let mut early = pvt(0.1);
        early.status = Status::Unreliable;
        builder.record(&Record::Pvt(early));
        builder.record(&Record::Pvt(pvt(0.2)));
        builder.record(&Record::Pvt(pvt(0.3)));
        for (time_s, prn) in [(0.2, 3), (0.2, 9), (0.3, 3)] {
            builder.record(&Record::Channel(channel(time_s, prn)));
        }
        assert_eq!(builder.channels_mean(), 1.5);
        let summary = builder.finish(1.0, Some("not kept".to_owned()));
        assert_eq!((summary.fixes, summary.first_fix_s), (2, Some(0.2)));
        assert_eq!(summary.no_fix_reason, None);
        assert_eq!(summary.time.unwrap().tow_s, 540_000.3);
        let again: Summary =
            serde_json::from_str(&serde_json::to_string(&summary).unwrap()).unwrap();
        assert_eq!(again, summary);
    }

    #[test]
    fn a_fault_closes_when_its_satellite_is_readmitted() {
        let mut builder = SummaryBuilder::default();
        let satellite = Some(SatelliteId::gps(17));
        let excluded = EventKind::Excluded {
            monitor: "svm".to_owned(),
            score: 2.0,
            threshold: 1.0,
            residual_m: None,
        };
        for (time_s, kind) in [(22.5, excluded), (40.0, EventKind::Readmitted)] {
            builder.record(&Record::Event(Event {
                time_s,
                satellite,
                kind,
            }));
        }
        let fault = builder.finish(60.0, None).faults.remove(0);
        assert_eq!(
            (fault.prn, fault.alarm_s, fault.readmitted_s),
            (17, 22.5, Some(40.0))
        );
    }
}
