//! All rates side by side.

use std::fmt;

use anyhow::Result;

use super::{BANDWIDTHS, Case, CodeError, DOPPLERS_HZ, INTEGER_AND_BESIDE_HZ, RATES_HZ};

const CHIP_M: f64 = 299_792_458.0 / 1.023e6;

/// One code error over another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ratio {
    /// Root mean square over root mean square.
    pub value: f64,
    /// Standard error.
    pub deviation: f64,
}

/// `error` over `reference`, measured apart.
#[must_use]
pub fn ratio(error: CodeError, reference: CodeError) -> Ratio {
    let value = error.rms_chips / reference.rms_chips;
    let part = |e: CodeError| e.rms_deviation_chips / e.rms_chips;
    Ratio {
        value,
        deviation: value * part(error).hypot(part(reference)),
    }
}

/// Every case with its result.
#[derive(Debug, Clone)]
pub struct Table(pub Vec<(Case, CodeError)>);

/// Applies `measure` to all rates, Dopplers and front ends, two at a time.
///
/// # Errors
/// As `measure`.
pub fn table(measure: impl Fn(Case) -> Result<CodeError> + Sync) -> Result<Table> {
    let mut cases = Vec::new();
    for bandwidth in BANDWIDTHS {
        for doppler_hz in DOPPLERS_HZ {
            cases.extend(RATES_HZ.map(|sample_rate_hz| Case {
                sample_rate_hz,
                bandwidth,
                doppler_hz,
            }));
        }
    }
    let half = cases.len() / 2;
    let rows = |cases: &[Case]| -> Result<Vec<_>> {
        cases.iter().map(|c| Ok((*c, measure(*c)?))).collect()
    };
    let (first, second) = std::thread::scope(|scope| {
        let other = scope.spawn(|| rows(&cases[half..]));
        (rows(&cases[..half]), other.join())
    });
    let second = second.map_err(|_| anyhow::anyhow!("a measurement panicked"))?;
    let mut all = first?;
    all.extend(second?);
    Ok(Table(all))
}

impl Table {
    /// Cases at a rate with an integer number of samples per chip, each over the rate next to it
    /// at the same Doppler behind the same front end.
    #[must_use]
    pub fn ratios(&self) -> Vec<(Case, Ratio)> {
        let of = |case: Case| {
            let beside = INTEGER_AND_BESIDE_HZ
                .iter()
                .find(|(integer_hz, _)| *integer_hz == case.sample_rate_hz)?;
            let reference = Case {
                sample_rate_hz: beside.1,
                ..case
            };
            self.0.iter().find(|(c, _)| *c == reference)
        };
        let rows = self.0.iter();
        rows.filter_map(|&(case, error)| Some((case, ratio(error, of(case)?.1))))
            .collect()
    }
}

fn filter_name(bandwidth: Option<f64>) -> String {
    bandwidth.map_or("none".to_owned(), |b| format!("{b} fs"))
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "| fs (MHz) | filter | Doppler (Hz) | rms (m) | standard error (m) | mean (m) | stated (m) \
             | epochs |"
        )?;
        write!(f, "|---|---|---|---|---|---|---|---|")?;
        for (case, error) in &self.0 {
            write!(
                f,
                "\n| {} | {} | {} | {:.3} | {:.3} | {:+.3} | {:.3} | {} |",
                case.sample_rate_hz / 1e6,
                filter_name(case.bandwidth),
                case.doppler_hz,
                error.rms_chips * CHIP_M,
                error.rms_deviation_chips * CHIP_M,
                error.mean_chips * CHIP_M,
                error.stated_chips * CHIP_M,
                error.epochs
            )?;
        }
        for (case, ratio) in self.ratios() {
            write!(
                f,
                "\n{} MHz over the rate beside it, filter {}, {} Hz: {:.3} +- {:.3}",
                case.sample_rate_hz / 1e6,
                filter_name(case.bandwidth),
                case.doppler_hz,
                ratio.value,
                ratio.deviation
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_pair_each_integer_rate_with_its_neighbour() {
        let row = |sample_rate_hz, doppler_hz, rms_chips| {
            let case = Case {
                sample_rate_hz,
                bandwidth: None,
                doppler_hz,
            };
            let error = CodeError {
                rms_chips,
                rms_deviation_chips: 0.1 * rms_chips,
                mean_chips: 0.0,
                stated_chips: 0.0,
                epochs: 1,
            };
            (case, error)
        };
        let rows = vec![
            row(4.0e6, 20.0, 1.0),
            row(4.0e6, 1e3, 0.5),
            row(4.092e6, 20.0, 3.0),
            row(16.369e6, 20.0, 2.0),
        ];
        let ratios = Table(rows).ratios();
        let [(case, ratio)] = ratios[..] else {
            panic!("{ratios:?}");
        };
        assert_eq!((case.sample_rate_hz, ratio.value), (4.092e6, 3.0));
        // A tenth from either side.
        assert!((ratio.deviation - 0.3 * 2f64.sqrt()).abs() < 1e-12);
    }
}
