//! The conditions of a recording that an independent simulator made, made again by our generator:
//! the receiver measures the same of both.
#![allow(clippy::unwrap_used, reason = "a failure here is a failed test")]

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use end_to_end_tests::{STATIC, test_data};
use gnss_nav::constants::{EARTH_RATE_RAD_S, SPEED_OF_LIGHT_MPS};
use gnss_nav::{Ephemeris, Geodetic, GpsTime, Klobuchar};
use gnss_signal::sample::{ReaderSource, SampleDescription, SampleFormat, SampleSource};
use gnss_signal::{IfCorrelatorBank, InstructionSet};
use nalgebra::Vector3;
use receiver::pipeline::{Aiding, Settings, run};
use receiver::record::Record;
use receiver::rinex_nav;
use xtask::scenario::built::Scenario;
use xtask::scenario::if_signal::Synthesiser;
use xtask::scenario::spec::ScenarioFile;

/// Satellites of the recording; 22 is there though it calls itself unhealthy.
const PRNS: [u8; 9] = [3, 16, 18, 22, 25, 26, 29, 31, 32];
const RATE_HZ: f64 = 2.6e6;
const CHIP_M: f64 = SPEED_OF_LIGHT_MPS / 1.023e6;
/// Seconds of signal received, and those before the code loops have come to rest (their time
/// constant is 5 s at the end).
const RECEIVED_S: f64 = 60.0;
const SETTLED_S: f64 = 15.0;
/// Early to late of the receiver's code loop, chips.
const SPACING_CHIPS: f64 = 0.5;
/// Stretches whose means are independent of each other.
const BATCHES: usize = 9;

fn place() -> Geodetic {
    Geodetic::from_degrees(35.681_298, 139.766_247, 10.0)
}

fn start() -> GpsTime {
    GpsTime::new(2190, 540_000.0)
}

fn navigation_file(data: &Path) -> PathBuf {
    data.join("if/simulated_static/brdc0010.22n")
}

/// The recording's sky, sampled as `format`, with these C/N0 before the front end.
fn rebuilt(nav: &Path, format: &str, cn0_dbhz: &BTreeMap<u8, f64>) -> Scenario {
    let levels = cn0_dbhz.iter().map(|(prn, c)| format!("G{prn:02} = {c}"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("rebuilt.toml");
    let text = format!(
        "description = 'At rest in Tokyo, without troposphere'
start = {{ week = 2190, tow_s = 540000 }}
duration_s = {RECEIVED_S}
constellation = {{ source = 'rinex', file = '{}', satellites = {PRNS:?} }}
trajectory = {{ kind = 'static', at = {{ lat_deg = 35.681298, lon_deg = 139.766247, height_m = 10 }} }}
propagation = {{ troposphere = 'none' }}
front_end = {{ format = '{format}', sample_rate_hz = {RATE_HZ:?} }}
cn0 = {{ satellite = {{ {} }} }}
",
        nav.canonicalize().unwrap().display(),
        levels.collect::<Vec<_>>().join(", "),
    );
    std::fs::write(&path, text).unwrap();
    Scenario::new(&ScenarioFile::read(&path).unwrap(), None).unwrap()
}

/// What the receiver observes of a satellite at one epoch.
struct Observed {
    time_s: f64,
    /// Reading of the satellite's clock in what arrives.
    transmitted: GpsTime,
    doppler_hz: f64,
    cn0_dbhz: f64,
}

/// By PRN, in time.
type Observations = BTreeMap<u8, Vec<Observed>>;

/// Observations by satellite, from `settled_s` on; assisted, so that they begin at once.
fn observe(
    source: impl SampleSource,
    nav: &Path,
    (settled_s, received_s): (f64, f64),
) -> Observations {
    let bank = IfCorrelatorBank::new(source, 2.0, InstructionSet::detect()).unwrap();
    let navigation = rinex_nav::read(nav).unwrap();
    let settings = Settings {
        troposphere: false,
        duration_s: Some(received_s),
        aiding: Aiding {
            ephemerides: navigation.ephemerides,
            ionosphere: navigation.ionosphere,
            position_ecef_m: Some(place().to_ecef().add_scalar(5e3)),
            time: Some(start() + 3.0),
        },
        ..Settings::default()
    };
    let mut all: Observations = BTreeMap::new();
    run(bank, &settings, &mut |record| {
        if let Record::Observations(epoch) = record
            && epoch.time_s > settled_s
        {
            for one in &epoch.observations {
                all.entry(one.satellite.prn).or_default().push(Observed {
                    time_s: epoch.time_s,
                    transmitted: epoch.time - one.pseudorange_m / SPEED_OF_LIGHT_MPS,
                    doppler_hz: one.doppler_hz.unwrap(),
                    cn0_dbhz: one.cn0_dbhz.unwrap(),
                });
            }
        }
        Ok(())
    })
    .unwrap();
    assert!(all.keys().eq(&PRNS), "{:?}", all.keys());
    all
}

/// Reading of a satellite's clock in what arrives at `at`, from its ephemeris: the light's way in
/// a frame that does not turn, satellite clock, group delay and ionosphere.
fn geometry(ephemeris: &Ephemeris, ionosphere: &Klobuchar, at: GpsTime) -> GpsTime {
    let place = place();
    let travel = |travel_s: f64| {
        let state = ephemeris.state_at(at - travel_s).unwrap();
        let (sin, cos) = (EARTH_RATE_RAD_S * travel_s).sin_cos();
        let p = state.position_ecef_m;
        let turned = Vector3::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x, p.z);
        (turned - place.to_ecef(), state.clock_bias_s)
    };
    // Each pass shrinks the error of 10 ms by 1e-5.
    let travel_s = (0..4).fold(0.075, |t, _| travel(t).0.norm() / SPEED_OF_LIGHT_MPS);
    let (way, clock_s) = travel(travel_s);
    let delay_m = ionosphere.delay_m(&place, &place.look(&way.normalize()), at);
    at - (travel_s + delay_m / SPEED_OF_LIGHT_MPS) + clock_s
}

fn column(rows: &[Observed], value: impl Fn(&Observed) -> f64) -> Vec<f64> {
    rows.iter().map(value).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Mean, and its standard error from the means of batches.
fn batched(values: &[f64]) -> (f64, f64) {
    let means: Vec<f64> = values
        .chunks_exact(values.len() / BATCHES)
        .map(mean)
        .collect();
    let middle = mean(&means);
    let squares: Vec<f64> = means.iter().map(|m| (m - middle).powi(2)).collect();
    let n = means.len() as f64;
    (middle, (mean(&squares) / (n - 1.0)).sqrt())
}

/// Standard error of a code phase averaged over `averaged_s`, m: early minus late by the envelope,
/// 10 ms at a time (`Kaplan2017`, for the noise bandwidth 1 / 2T of a mean).
fn code_error_m(cn0_dbhz: f64, averaged_s: f64) -> f64 {
    let cn0_hz = 10f64.powf(cn0_dbhz / 10.0);
    let squaring = 1.0 + 2.0 / ((2.0 - SPACING_CHIPS) * 0.01 * cn0_hz);
    CHIP_M * (SPACING_CHIPS / (4.0 * averaged_s * cn0_hz) * squaring).sqrt()
}

/// Pseudoranges minus geometry.
struct Residuals {
    /// Mean over all satellites, weighted by their variances, m.
    mean_m: f64,
    /// Its standard error, m.
    error_m: f64,
    /// Mean square over the satellites, each in units of its variance.
    spread: f64,
}

fn against_geometry(scenario: &Scenario, observed: &Observations) -> Residuals {
    let (mut sum, mut weights, mut squares) = (0.0, 0.0, 0.0);
    for heard in &scenario.heard {
        let rows = &observed[&heard.satellite.prn];
        let residual = |row: &Observed| {
            let at = start() + row.time_s;
            let sent = geometry(&heard.broadcast, &scenario.ionosphere, at);
            SPEED_OF_LIGHT_MPS * (sent - row.transmitted)
        };
        let residual_m = mean(&column(rows, residual));
        let averaged_s = rows.len() as f64 / Settings::default().rate_hz;
        let error_m = code_error_m(mean(&column(rows, |r| r.cn0_dbhz)), averaged_s);
        sum += residual_m / error_m.powi(2);
        weights += error_m.powi(-2);
        squares += (residual_m / error_m).powi(2);
    }
    Residuals {
        mean_m: sum / weights,
        error_m: weights.powf(-0.5),
        spread: squares / scenario.heard.len() as f64,
    }
}

/// Factor from C/N0 behind a front end of one bit to those before it.
///
/// Signals of total power p over that of the noise add 2/3 fs / Rc p to its density at a code; a
/// sign keeps 2 / pi of all power and spreads the rest evenly.
fn loss_of_one_bit(behind_dbhz: &BTreeMap<u8, f64>) -> f64 {
    let total_hz: f64 = behind_dbhz.values().map(|c| 10f64.powf(c / 10.0)).sum();
    let per_power = 2.0 / 3.0 * RATE_HZ / 1.023e6 + FRAC_PI_2 - 1.0;
    FRAC_PI_2 / (1.0 - per_power * total_hz / RATE_HZ)
}

fn louder(cn0_dbhz: &BTreeMap<u8, f64>, by_db: f64) -> BTreeMap<u8, f64> {
    cn0_dbhz.iter().map(|(prn, c)| (*prn, c + by_db)).collect()
}

/// The recording itself.
fn recording(data: &Path) -> impl SampleSource {
    let description = SampleDescription {
        format: SampleFormat::C1Msb,
        sample_rate_hz: RATE_HZ,
        intermediate_frequency_hz: 0.0,
        swap_iq: false,
    };
    let file = File::open(data.join(STATIC.file)).unwrap();
    ReaderSource::new(BufReader::new(file), description)
}

#[test]
fn the_receiver_measures_the_same_as_on_an_independent_simulator() {
    let Some(data) = test_data() else { return };
    let nav = navigation_file(&data);
    let judged = (SETTLED_S, RECEIVED_S);
    let theirs = observe(recording(&data), &nav, judged);
    let levels = theirs.iter();
    let levels = levels.map(|(prn, rows)| (*prn, mean(&column(rows, |r| r.cn0_dbhz))));
    let levels: BTreeMap<u8, f64> = levels.collect();
    let before = louder(&levels, 10.0 * loss_of_one_bit(&levels).log10());
    let scenario = rebuilt(&nav, "c1_msb", &before);
    let ours = observe(Synthesiser::new(scenario.scene()).unwrap(), &nav, judged);
    let mut cn0_squares = 0.0;
    for prn in PRNS {
        let (a, b) = (&ours[&prn], &theirs[&prn]);
        assert!(a.iter().map(|r| r.time_s).eq(b.iter().map(|r| r.time_s)));
        let cn0 = |rows: &[Observed]| batched(&column(rows, |r| r.cn0_dbhz));
        let ((x, x_error), (y, y_error)) = (cn0(a), cn0(b));
        cn0_squares += (x - y).powi(2) / (x_error.powi(2) + y_error.powi(2));
        // The bounds asked for; noise is a seventh of them for the weakest.
        let doppler_hz = mean(&column(a, |r| r.doppler_hz)) - mean(&column(b, |r| r.doppler_hz));
        assert!(doppler_hz.abs() < 1.0, "G{prn:02}: {doppler_hz} Hz");
        let code = a
            .iter()
            .zip(b)
            .map(|(a, b)| 1.023e6 * (a.transmitted - b.transmitted));
        let code = mean(&code.collect::<Vec<_>>());
        assert!(code.abs() < 0.01, "G{prn:02}: {code} chips");
    }
    // Three standard errors, jointly: 99.73 % of a chi-square of nine.
    assert!(cn0_squares < 25.26, "C/N0: {cn0_squares}");
    let (a, b) = (
        against_geometry(&scenario, &ours),
        against_geometry(&scenario, &theirs),
    );
    assert!((a.mean_m - b.mean_m).abs() < 3.0 * a.error_m.hypot(b.error_m));
    assert!(a.mean_m.abs() < 3.0 * a.error_m && b.mean_m.abs() < 3.0 * b.error_m);
    // 0.13 % of a ratio of variances of nine each exceed 9.6.
    let ratio = a.spread / b.spread;
    assert!((1.0 / 9.6..9.6).contains(&ratio), "{ratio}");
    what_is_sent_stands_where_geometry_has_it(&scenario);
    loud_pseudoranges_are_those_of_geometry(&nav, &before);
}

/// Before any noise: both are the same formulas in `f64`, but the generator interpolates the orbit
/// (3 nm), the ionosphere (20 um) and broadcasts rounded parameters, as the test reads them too.
fn what_is_sent_stands_where_geometry_has_it(scenario: &Scenario) {
    for (heard, satellite) in scenario.heard.iter().zip(scenario.satellites()) {
        for time_s in [0.0, 17.3, 59.9] {
            let sent = satellite.direct(time_s, time_s).arrival.code_time;
            let expected = geometry(&heard.broadcast, &scenario.ionosphere, start() + time_s);
            let error_m = SPEED_OF_LIGHT_MPS * (sent - expected);
            assert!(error_m.abs() < 1e-3, "{}: {error_m} m", heard.satellite);
        }
    }
}

/// 10 dB stronger and in 8 bits the mean of all satellites is known to 0.03 m.
fn loud_pseudoranges_are_those_of_geometry(nav: &Path, cn0_dbhz: &BTreeMap<u8, f64>) {
    let scenario = rebuilt(nav, "ci8", &louder(cn0_dbhz, 10.0));
    let source = Synthesiser::new(scenario.scene()).unwrap();
    let found = against_geometry(&scenario, &observe(source, nav, (10.0, 30.0)));
    assert!(found.error_m < 0.035, "{} m", found.error_m);
    assert!(found.mean_m.abs() < 0.1, "{} m", found.mean_m);
    // Three standard errors of a chi-square of nine, a loop's own memory of 12 s included: a
    // second-order loop of 0.05 Hz passes 1.1 times what falls into 20 s.
    assert!(found.spread < 1.1 * 25.26 / 9.0, "{}", found.spread);
}
