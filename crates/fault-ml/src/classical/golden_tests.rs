//! The classical detectors against the reference figures of 560 epochs with a step of 20 m.

use super::*;
use crate::Sight;
use crate::golden::{assert_close, rows};

/// Sights and expected outputs of every epoch.
fn epochs() -> Option<Vec<(Vec<Sight>, Vec<f64>)>> {
    let designs = rows("golden_H.csv")?;
    let residuals = rows("golden_y_seed0_mix1.8_b20.csv")?;
    let expected = rows("golden_baseline.csv")?;
    let epoch = |((designs, residuals), expected): ((Vec<f64>, Vec<f64>), Vec<f64>)| {
        let rows = designs.chunks(4).zip(residuals);
        let sights = (0..).zip(rows).map(|(id, (design, residual_m))| Sight {
            id,
            design: design.try_into().unwrap(),
            residual_m,
            sigma_m: 3.0,
        });
        (sights.collect(), expected)
    };
    Some(
        designs
            .into_iter()
            .zip(residuals)
            .zip(expected)
            .map(epoch)
            .collect(),
    )
}

// The files hold residuals to 1e-9 m and outputs to 1e-9; sums over 30 epochs come to a few 1e-9.

#[test]
fn least_squares_is_the_reference() {
    let Some(epochs) = epochs() else { return };
    assert_eq!(epochs.len(), 560);
    for (k, (sights, expected)) in epochs.iter().enumerate() {
        let fit = LeastSquaresFit::new(sights).unwrap();
        assert_close(fit.chi_square, expected[1], &format!("chi-square at {k}"));
        for (s, standardised) in fit.standardised.iter().enumerate() {
            assert_close(
                *standardised,
                expected[2 + s],
                &format!("residual {s} at {k}"),
            );
        }
    }
}

#[test]
fn the_kalman_bank_is_the_reference() {
    let Some(epochs) = epochs() else { return };
    let mut bank = KalmanBank::new(&KalmanParameters::default(), 9, 100.0);
    for (k, (sights, expected)) in epochs.iter().enumerate() {
        let increments = bank.epoch(sights);
        assert_close(
            bank.normalised_square(),
            expected[11],
            &format!("NIS at {k}"),
        );
        for (d, state) in bank.state_m().into_iter().enumerate() {
            assert_close(state, expected[12 + d], &format!("state {d} at {k}"));
        }
        for (q, increment) in increments.iter().enumerate() {
            assert_close(increment.paper, expected[16 + q], &format!("F1 {q} at {k}"));
            assert_close(
                increment.sound,
                expected[25 + q],
                &format!("F3c {q} at {k}"),
            );
        }
    }
}

#[test]
fn the_innovation_ratio_is_the_reference() {
    let Some(epochs) = epochs() else { return };
    let mut glr = InnovationGlr::new(&KalmanParameters::default(), 30);
    for (k, (sights, expected)) in epochs.iter().enumerate() {
        for (q, ratio) in glr.epoch(1.0, sights).into_iter().enumerate() {
            assert_close(ratio, expected[34 + q], &format!("GLR {q} at {k}"));
        }
    }
}

#[test]
fn ratios_name_the_stepped_satellite_soon_after_the_step() {
    let Some(epochs) = epochs() else { return };
    let mut glr = ParityGlr::new(30);
    for (k, (sights, _)) in epochs.iter().enumerate() {
        let ratios = glr.epoch(sights, &LeastSquaresFit::new(sights).unwrap());
        let largest = ratios.iter().copied().fold(0.0, f64::max);
        // A step of 20 m at k = 500 adds 20^2 0.61 / 18 = 13.6 an epoch on average.
        if k < 500 {
            assert!(largest < 20.0, "{largest} at {k}");
        } else if k >= 503 {
            assert!(largest > 20.0 && ratios[0] == largest, "{ratios:?} at {k}");
        }
    }
}
