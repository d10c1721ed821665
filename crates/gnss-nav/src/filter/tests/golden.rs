//! Updates computed by an independent program. Its file is no part of the project: the test looks
//! for it beside the recorded data and says so where it is absent.

use std::path::PathBuf;

use nalgebra::{DMatrix, DVector, Vector4};
use serde_json::Value;

use super::super::batch::Batch;
use super::super::sequential::Sequential;
use super::*;

/// Both programs round their sums of some hundred products near 1; the matrices inverted have
/// conditions below 1e3.
const ROUNDING: f64 = 1e-12;

#[allow(clippy::print_stderr, reason = "says aloud what it skips")]
fn golden() -> Option<Value> {
    let data = std::env::var_os("GNSS_TEST_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let text = std::fs::read_to_string(data.join("../oracle/golden.json"));
    match text {
        Ok(text) => Some(serde_json::from_str(&text).unwrap()),
        Err(error) => {
            eprintln!("SKIPPED: no figures of the independent program ({error})");
            None
        }
    }
}

fn vector(value: &Value) -> DVector<f64> {
    let numbers: Vec<f64> = serde_json::from_value(value.clone()).unwrap();
    DVector::from_vec(numbers)
}

fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = serde_json::from_value(value.clone()).unwrap();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

fn covariance(value: &Value) -> Covariance {
    Covariance::from_column_slice(matrix(value).as_slice())
}

fn state(value: &Value) -> States {
    States::from_column_slice(vector(value).as_slice())
}

#[test]
fn the_reference_gives_the_dense_update() {
    let Some(golden) = golden() else { return };
    let case = &golden["kf8"];
    let (h, y, r) = (
        matrix(&case["H"]),
        vector(&case["z"]),
        vector(&case["Rdiag"]),
    );
    let (x, p) = reference::update(&covariance(&case["P"]), &h, &y, &r);
    assert!(state_difference(&x, &state(&case["dx"]), &p) < ROUNDING);
    let variances = state(&case["Pdiag"]);
    for i in 0..STATES {
        assert!((p[(i, i)] / variances[i] - 1.0).abs() < ROUNDING);
    }
}

#[test]
fn both_ways_give_the_sparse_update() {
    let Some(golden) = golden() else { return };
    let case = &golden["kf8_sparse"];
    let (prior, posterior) = (covariance(&case["P"]), covariance(&case["P_post"]));
    let (h, y, r) = (
        matrix(&case["H"]),
        vector(&case["z"]),
        vector(&case["Rdiag"]),
    );
    let rows: Vec<Row> = (0..y.len()).map(|i| sparse_row(&h, &y, &r, i)).collect();
    let (x, p) = reference::update_rows(&prior, &rows);
    for (error, after, _) in [
        (x, p, 0.0),
        correct::<Batch>(&prior, &rows),
        correct::<Sequential>(&prior, &rows),
    ] {
        assert!(state_difference(&error, &state(&case["dx"]), &posterior) < ROUNDING);
        assert!(covariance_difference(&after, &posterior) < ROUNDING);
    }
    for (row, s) in rows.iter().zip(vector(&case["S_diag"]).iter()) {
        let variance = row.state_variance(&Blocks::from_interleaved(&prior)) + row.variance;
        assert!((variance / s - 1.0).abs() < ROUNDING);
    }
}

/// Row `i`, which must have the zeros of a receiver's.
fn sparse_row(h: &DMatrix<f64>, y: &DVector<f64>, r: &DVector<f64>, i: usize) -> Row {
    let observable = if i.is_multiple_of(2) {
        Observable::Pseudorange
    } else {
        Observable::RangeRate
    };
    let first = i % 2;
    let row = Row {
        observable,
        gradient: Vector4::from_fn(|k, _| h[(i, first + 2 * k)]),
        residual: y[i],
        variance: r[i],
    };
    assert_eq!(dense(&row).transpose(), h.fixed_view::<1, 8>(i, 0));
    row
}
