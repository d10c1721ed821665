//! What is true of a scenario, as files: truth.csv, satellites.csv, faults.csv, navigation.rnx.

use std::path::Path;

use anyhow::Result;
use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use receiver::record::{IonosphereUtcRecord, Record};
use receiver::sink::file::OutputFile;
use receiver::sink::navigation::NavigationRinex;
use receiver::sink::{EventSink, Fixed};

use super::antenna::Emitter;
use super::built::Scenario;
use super::multipath::tracking_error_chips;

/// Rows of satellites.csv a second and satellite, at most.
const SATELLITE_RATE_HZ: f64 = 10.0;
const CODE_RATE_HZ: f64 = 1.023e6;
const CODE_CHIPS: f64 = 1023.0;
const CHIP_M: f64 = SPEED_OF_LIGHT_MPS / CODE_RATE_HZ;

/// Writes all of them into `directory`.
///
/// # Errors
/// Where a file cannot be written.
pub fn write(scenario: &Scenario, directory: &Path) -> Result<()> {
    receiver_truth(scenario, directory)?;
    satellites(scenario, directory)?;
    faults(scenario, directory)?;
    navigation(scenario, directory)
}

/// Instants of `rate_hz` from the first sample to the last, s of samples.
fn instants(scenario: &Scenario, rate_hz: f64) -> impl Iterator<Item = f64> {
    let rows = (scenario.duration_s * rate_hz + 1e-9).floor() as u64;
    (0..=rows).map(move |row| row as f64 / rate_hz)
}

/// Position, velocity and clock; `time_s` counts samples.
fn receiver_truth(scenario: &Scenario, directory: &Path) -> Result<()> {
    let mut file = OutputFile::create(directory, "truth.csv")?;
    writeln!(
        file,
        "time_s,x_m,y_m,z_m,vx_mps,vy_mps,vz_mps,clock_bias_m,clock_drift_mps"
    )?;
    for time_s in instants(scenario, scenario.truth_rate_hz) {
        let elapsed_s = scenario.elapsed_s(time_s);
        let (bias_m, drift_mps) = scenario.truth.clock.metres_at(elapsed_s);
        let motion = scenario
            .truth
            .trajectory
            .at(elapsed_s - bias_m / SPEED_OF_LIGHT_MPS);
        let (p, v) = (motion.position_ecef_m, motion.velocity_ecef_mps);
        writeln!(
            file,
            "{},{},{},{},{},{},{},{},{}",
            Fixed(time_s, 6),
            Fixed(p.x, 4),
            Fixed(p.y, 4),
            Fixed(p.z, 4),
            Fixed(v.x, 5),
            Fixed(v.y, 5),
            Fixed(v.z, 5),
            Fixed(bias_m, 4),
            Fixed(drift_mps, 5),
        )?;
    }
    Ok(file.commit()?)
}

/// Where each satellite's code and carrier truly stand.
///
/// `pseudorange_m` is c times (start + elapsed time - transmit time); after a clock jump or lost
/// samples it shows them. `multipath_error_m` is that of an ideal code loop.
fn satellites(scenario: &Scenario, directory: &Path) -> Result<()> {
    let mut file = OutputFile::create(directory, "satellites.csv")?;
    writeln!(
        file,
        "time_s,sat,prn,azimuth_deg,elevation_deg,pseudorange_m,code_phase_chips,doppler_hz,\
         cn0_dbhz,multipath_error_m"
    )?;
    let mut satellites = scenario.satellites();
    let mut rays = Vec::new();
    for time_s in instants(scenario, SATELLITE_RATE_HZ.min(scenario.truth_rate_hz)) {
        let elapsed_s = scenario.elapsed_s(time_s);
        for (heard, satellite) in scenario.heard.iter().zip(&mut satellites) {
            let bias_s = scenario.truth.clock.at(elapsed_s, elapsed_s).0;
            let look = satellite.link().look(elapsed_s - bias_s);
            let code_time = satellite.direct(elapsed_s, elapsed_s).arrival.code_time;
            let received = scenario.truth.start + elapsed_s;
            rays.clear();
            satellite.rays(elapsed_s, elapsed_s, &mut rays)?;
            write!(
                file,
                "{},{},{},{},{},{},{},{},",
                Fixed(time_s, 6),
                heard.satellite,
                heard.satellite.prn,
                Fixed(look.azimuth_rad.to_degrees(), 3),
                Fixed(look.elevation_rad.to_degrees(), 3),
                Fixed(SPEED_OF_LIGHT_MPS * (received - code_time), 4),
                Fixed(
                    (code_time.fraction_s() * CODE_RATE_HZ).rem_euclid(CODE_CHIPS),
                    6
                ),
                Fixed(satellite.doppler_hz(elapsed_s), 4),
            )?;
            match satellite.cn0_dbhz(elapsed_s) {
                Some(cn0_dbhz) => writeln!(
                    file,
                    "{},{}",
                    Fixed(cn0_dbhz, 3),
                    Fixed(CHIP_M * tracking_error_chips(&rays), 4)
                )?,
                None => writeln!(file, ",")?,
            }
        }
    }
    Ok(file.commit()?)
}

/// One row for each fault and satellite; no satellite: all reception.
fn faults(scenario: &Scenario, directory: &Path) -> Result<()> {
    let mut file = OutputFile::create(directory, "faults.csv")?;
    writeln!(file, "kind,sat,begin_s,end_s,ramp_s,detail")?;
    for account in &scenario.accounts {
        let (span, end_s) = (account.span, account.span.end_s);
        let end = end_s.map_or_else(String::new, |end_s| end_s.to_string());
        let rest = format!("{},{end},{},{}", span.begin_s, span.ramp_s, account.detail);
        if account.satellites.is_empty() {
            writeln!(file, "{},,{rest}", account.kind)?;
        }
        for satellite in &account.satellites {
            writeln!(file, "{},{satellite},{rest}", account.kind)?;
        }
    }
    Ok(file.commit()?)
}

/// What the satellites broadcast at the start.
fn navigation(scenario: &Scenario, directory: &Path) -> Result<()> {
    let mut file = NavigationRinex::create(directory)?;
    for heard in &scenario.heard {
        file.record(&Record::Ephemeris(heard.broadcast))?;
    }
    file.record(&Record::IonosphereUtc(IonosphereUtcRecord {
        alpha: scenario.ionosphere.alpha,
        beta: scenario.ionosphere.beta,
        a0_s: 0.0,
        a1: 0.0,
        reference: gnss_nav::GpsTime::new(scenario.truth.start.week(), 0.0),
        leap_seconds: super::built::LEAP_SECONDS.into(),
    }))?;
    Ok(file.finish()?)
}
