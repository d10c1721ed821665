//! Acquisition of the recordings of the data folder, judged by its independent reference.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // a test, which says when it is skipped

use std::path::PathBuf;

use gnss_signal::sample::{ReaderSource, SampleDescription, SampleRing};
use gnss_signal::{
    AcquisitionEngine, AcquisitionHit, FrontEnd, SearchReport, SearchRequest, SignalId,
    default_search,
};

/// Weakest satellite that has to be found, dB-Hz (issue 2).
const MUST_FIND_DBHZ: f64 = 39.0;
/// Tolerance of the code phase, chips (issue 2).
const CODE_PHASE_CHIPS: f64 = 0.15;

struct Recording {
    front_end: FrontEnd,
    samples: Vec<i8>,
}

impl Recording {
    /// The first `duration_s` of a file of the data folder; `None` (said aloud) without the data.
    fn open(file: &str, format: &str, rate_hz: f64, if_hz: f64, duration_s: f64) -> Option<Self> {
        let path = data_folder().join("if").join(file);
        let Ok(stream) = std::fs::File::open(path) else {
            println!("SKIPPED: no test data");
            return None;
        };
        let description = SampleDescription {
            format: format.parse().unwrap(),
            sample_rate_hz: rate_hz,
            intermediate_frequency_hz: if_hz,
            swap_iq: false,
        };
        let mut ring = SampleRing::new(ReaderSource::new(stream, description), 1.0).unwrap();
        let end = ring.advance_to((duration_s * rate_hz) as u64).unwrap();
        let mut samples = Vec::new();
        ring.unpack(0, end, &mut samples).unwrap();
        Some(Self {
            front_end: description.front_end(),
            samples,
        })
    }

    fn duration_ms(&self) -> u32 {
        let values = self.samples.len() / if self.front_end.complex { 2 } else { 1 };
        (values as f64 / self.front_end.sample_rate_hz * 1e3).round() as u32
    }

    fn search(&self, request: &SearchRequest) -> SearchReport {
        let values = if self.front_end.complex { 2 } else { 1 };
        let start = values * request.start_tick as usize;
        let mut engine = AcquisitionEngine::new(self.front_end).unwrap();
        engine.search(&self.samples[start..], request).unwrap()
    }

    fn search_all(&self, plan: (u32, u32)) -> SearchReport {
        self.search(&SearchRequest {
            signals: (1..=32)
                .map(|prn| SignalId::gps_l1_ca(prn).unwrap())
                .collect(),
            start_tick: 0,
            doppler_centre_hz: 0.0,
            doppler_half_width_hz: 12e3,
            coherent_periods: plan.0,
            noncoherent_sums: plan.1,
            false_alarm_probability: 1e-3,
        })
    }

    /// Whether `hit` is there again in each half of the recording by itself, with the code phase
    /// that it should then have. By chance a peak agrees to a chip once in 500 times.
    fn confirms(&self, hit: &AcquisitionHit) -> bool {
        let half_ms = self.duration_ms().min(240) / 2;
        [0, half_ms].iter().all(|start_ms| {
            let start_tick = (f64::from(*start_ms) * 1e-3 * self.front_end.sample_rate_hz) as u64;
            let report = self.search(&SearchRequest {
                signals: vec![hit.signal],
                start_tick,
                doppler_centre_hz: hit.doppler_hz,
                doppler_half_width_hz: 100.0,
                coherent_periods: if half_ms < 20 { 1 } else { 4 },
                noncoherent_sums: if half_ms < 20 { half_ms } else { half_ms / 4 },
                false_alarm_probability: 0.05,
            });
            let chips = start_tick as f64 * 1.023e6 / self.front_end.sample_rate_hz;
            let due = hit.code_phase_chips + chips;
            // The code Doppler over 120 ms is below 1 chip up to 12 kHz.
            report
                .hits
                .iter()
                .any(|again| code_difference(again.code_phase_chips, due).abs() < 1.0)
        })
    }
}

fn data_folder() -> PathBuf {
    std::env::var_os("GNSS_TEST_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    )
}

fn code_difference(a: f64, b: f64) -> f64 {
    (a - b + 511.5).rem_euclid(1023.0) - 511.5
}

/// PRN, Doppler (Hz), code phase at sample 0 (chips) and C/N0 (dB-Hz) of one recording.
fn reference(name: &str) -> Vec<(u8, f64, f64, f64)> {
    let text = std::fs::read(data_folder().join("if/reference_acquisition.json")).unwrap();
    let all: serde_json::Value = serde_json::from_slice(&text).unwrap();
    let number = |v: &serde_json::Value, key: &str| v[key].as_f64().unwrap();
    all[name]["sats"]
        .as_array()
        .unwrap()
        .iter()
        .map(|sat| {
            let phase = number(sat, "code_phase_chips_at_sample0");
            let prn = number(sat, "prn") as u8;
            (
                prn,
                number(sat, "doppler_hz"),
                phase,
                number(sat, "cn0_dbhz"),
            )
        })
        .collect()
}

/// Holds what the default plan finds against the reference.
fn judge(name: &str, recording: &Recording) {
    let plan = default_search(recording.duration_ms());
    let report = recording.search_all(plan);
    let reference = reference(name);
    let tolerance_hz = if recording.duration_ms() < 20 {
        40.0
    } else {
        10.0
    };
    for (prn, _, _, cn0_dbhz) in &reference {
        let found = report.hits.iter().any(|hit| hit.signal.prn() == *prn);
        assert!(
            found || *cn0_dbhz < MUST_FIND_DBHZ,
            "{name} {plan:?}: G{prn:02} at {cn0_dbhz} dB-Hz not found"
        );
    }
    for hit in &report.hits {
        let known = reference.iter().find(|sat| sat.0 == hit.signal.prn());
        let Some((_, doppler_hz, phase_chips, cn0_dbhz)) = known else {
            println!("{name}: not in the reference: {hit:?}");
            assert!(recording.confirms(hit), "{name}: {hit:?} is not there");
            continue;
        };
        let doppler_error_hz = hit.doppler_hz - doppler_hz;
        let code_error_chips = code_difference(hit.code_phase_chips, *phase_chips);
        let cn0_error_db = hit.cn0_dbhz - cn0_dbhz;
        assert!(doppler_error_hz.abs() < tolerance_hz, "{name}: {hit:?}");
        assert!(code_error_chips.abs() < CODE_PHASE_CHIPS, "{name}: {hit:?}");
        // 1 dB of bias, 2 dB of the reference's own and our noise over 4 ms.
        assert!(cn0_error_db.abs() < 3.0, "{name}: {hit:?}");
    }
}

#[test]
fn braunschweig_flight() {
    let file = "braunschweig_flight/sxnsr_test_data_flight.stream";
    if let Some(found) = Recording::open(file, "r2_lsb", 20.48e6, 5_499_998.474_121_09, 1.0) {
        judge("braunschweig_flight", &found);
    }
}

#[test]
fn pocketsdr_4_mhz() {
    let file = "pocketsdr/L1_20211202_084700_4MHz_IQ.bin";
    if let Some(found) = Recording::open(file, "ci8", 4e6, 0.0, 0.5) {
        judge("pocketsdr_4MHz", &found);
    }
}

#[test]
fn pocketsdr_12_mhz() {
    let file = "pocketsdr/L1_20211125_004000_12MHz_I.bin";
    if let Some(found) = Recording::open(file, "ri8", 12e6, 3e6, 1.0) {
        judge("pocketsdr_12MHz", &found);
    }
}

#[test]
fn cttc_in_4_ms() {
    let file = "cttc/GSoC_CTTC_capture_2012_07_26_4Msps_4ms.dat";
    if let Some(found) = Recording::open(file, "cf32_le", 4e6, 0.0, 1.0) {
        judge("cttc", &found);
    }
}

#[test]
fn peregrine_in_11_ms() {
    let file = "peregrine/test_samples.dat";
    if let Some(found) = Recording::open(file, "ri8", 16.368e6, 4.092e6, 1.0) {
        judge("peregrine", &found);
    }
}

#[test]
fn simulated_static_down_to_33_dbhz() {
    // data/README.md; a strength is given there to about 0.1 dB, ours over 60 ms to about 1 dB.
    let present = [
        (3, 33.5),
        (16, 35.1),
        (18, 33.0),
        (22, 33.4),
        (25, 37.0),
        (26, 40.8),
        (29, 40.1),
        (31, 42.1),
        (32, 40.0),
    ];
    let file = "simulated_static/gpsl1_static_2600k_1bit.iq1";
    let Some(found) = Recording::open(file, "c1_msb", 2.6e6, 0.0, 0.06) else {
        return;
    };
    let hits = found.search_all(default_search(60)).hits;
    let prns: Vec<u8> = hits.iter().map(|hit| hit.signal.prn()).collect();
    assert_eq!(prns, present.map(|(prn, _)| prn));
    for (hit, (_, cn0_dbhz)) in hits.iter().zip(present) {
        assert!((hit.cn0_dbhz - cn0_dbhz).abs() < 1.5, "{hit:?}");
    }
}
