//! Acquisitions drawn, against those of the engine on samples.

use gnss_signal::sample::SampleFormat;
use gnss_signal::{
    AcquisitionHit, CorrelatorBank, IfCorrelatorBank, InstructionSet, SearchRequest, SignalId,
};

use super::support::{PRN, TestEmitter, lnav, path, reception, scene};
use crate::scenario::antenna::Scene;
use crate::scenario::correlator_level::CorrelatorLevelBank;
use crate::scenario::if_signal::Synthesiser;
use crate::scenario::path::{SignalPath, UniformPath};

const RATE_HZ: f64 = 2.6e6;

/// How hard is searched, and for what.
#[derive(Debug, Clone, Copy)]
struct Case {
    cn0_dbhz: f64,
    coherent_periods: u32,
    noncoherent_sums: u32,
    searches: u64,
}

/// Errors of the hits.
struct Errors {
    code_chips: Vec<f64>,
    doppler_hz: Vec<f64>,
    cn0_db: Vec<f64>,
    statistics: Vec<f64>,
}

impl Case {
    fn duration_s(self) -> f64 {
        1e-3 * f64::from(self.coherent_periods * self.noncoherent_sums)
    }

    /// Searches follow each other closely, each in its own noise; Doppler and code phase move
    /// over the cells.
    fn scene(self, path: UniformPath) -> Scene {
        let emitter = TestEmitter::new(self.cn0_dbhz, path, lnav(path.code_time));
        let duration_s = self.searches as f64 * (self.duration_s() + 0.004) + 0.1;
        scene(
            reception(SampleFormat::Ci8, RATE_HZ, Some(0.8)),
            duration_s,
            vec![emitter],
        )
    }

    fn errors(self, mut bank: impl CorrelatorBank, path: UniformPath) -> Errors {
        let step = ((self.duration_s() + 0.003_7) * RATE_HZ) as u64;
        let mut errors = Errors {
            code_chips: vec![],
            doppler_hz: vec![],
            cn0_db: vec![],
            statistics: vec![],
        };
        for k in 0..self.searches {
            let request = SearchRequest {
                signals: vec![SignalId::gps_l1_ca(PRN).unwrap()],
                start_tick: k * step,
                doppler_centre_hz: path.doppler_hz + 37.0 * (k as f64 * 0.618).fract() - 18.0,
                doppler_half_width_hz: 500.0,
                coherent_periods: self.coherent_periods,
                noncoherent_sums: self.noncoherent_sums,
                false_alarm_probability: 1e-3,
            };
            bank.advance_to((k + 1) * step + 2600).unwrap();
            let report = bank.search(&request).unwrap();
            if let [hit] = report.hits[..] {
                errors.add(hit, path, self.cn0_dbhz);
            }
        }
        errors
    }
}

impl Errors {
    fn add(&mut self, hit: AcquisitionHit, path: UniformPath, cn0_dbhz: f64) {
        let time = path.arrival(hit.tick as f64 / RATE_HZ).unwrap().code_time;
        let code = hit.code_phase_chips - time.fraction_s() * 1.023e6;
        self.code_chips
            .push((code + 511.5).rem_euclid(1023.0) - 511.5);
        self.doppler_hz.push(hit.doppler_hz - path.doppler_hz);
        self.cn0_db.push(hit.cn0_dbhz - cn0_dbhz);
        self.statistics.push(hit.statistic);
    }
}

/// Mean and deviation.
fn spread(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0)).sqrt())
}

#[test]
fn acquisitions_err_as_the_engine_on_samples() {
    for (coherent_periods, noncoherent_sums, cn0_dbhz) in
        [(1, 10, 43.0), (4, 10, 38.0), (10, 10, 43.0)]
    {
        let case = Case {
            cn0_dbhz,
            coherent_periods,
            noncoherent_sums,
            searches: 50,
        };
        let path = path(1_234.0);
        let drawn = case.errors(CorrelatorLevelBank::new(case.scene(path)).unwrap(), path);
        let source = Synthesiser::new(case.scene(path)).unwrap();
        let bank = IfCorrelatorBank::new(source, 0.5, InstructionSet::detect()).unwrap();
        let sampled = case.errors(bank, path);
        assert_eq!(drawn.code_chips.len(), 50, "{case:?}");
        assert_eq!(sampled.code_chips.len(), 50, "{case:?}");
        for (name, a, b) in [
            ("code phase", &drawn.code_chips, &sampled.code_chips),
            ("Doppler", &drawn.doppler_hz, &sampled.doppler_hz),
            ("C/N0", &drawn.cn0_db, &sampled.cn0_db),
        ] {
            let ((mean_a, a), (mean_b, b)) = (spread(a), spread(b));
            // Three standard errors of a ratio of deviations of 50 numbers, 0.43, and what the laws
            // leave, an eighth.
            assert!((a / b).ln().abs() < 0.55, "{case:?}: {name} {a} and {b}");
            // Each mean errs by a seventh of its deviation; the engine is off by a fiftieth of a chip and
            // 0.15 dB where its grids are coarse.
            let off = (mean_a - mean_b).abs();
            let systematic = if name == "C/N0" { 0.15 } else { 0.02 };
            assert!(
                off < 3.0 * a.hypot(b) / 7.0 + systematic,
                "{case:?}: {name} {mean_a} and {mean_b}"
            );
        }
        let (a, b) = (spread(&drawn.statistics).0, spread(&sampled.statistics).0);
        // Fifty statistics that err by a fifth each leave 3 % of either mean.
        assert!((a / b).ln().abs() < 0.1, "{case:?}: statistics {a} and {b}");
    }
}
