//! Training by linfa-svm: C-SVC, minimise |w|^2 / 2 + C sum xi.

use linfa::prelude::*;
use linfa_svm::Svm;
use ndarray::{Array1, Array2};

use super::SvmPredictor;
use super::prune::Machine;
use crate::learned::LearnedError;
use crate::learned::windows::Windows;

/// Rows at most: the solver holds a square of them.
const LARGEST_ROWS: usize = 10_000;
/// Weights below this are none: those of the solver's own accuracy.
const SMALLEST_WEIGHT: f64 = 1e-9;

/// How a machine is trained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SvmTraining {
    /// C: cost of a window on the wrong side. Default 10.
    pub cost: f64,
    /// gamma times the number of coordinates: a window is about that far from another of its kind.
    /// Default 0.5.
    pub relative_gamma: f64,
    /// Support vectors kept at most. Default 256.
    pub largest: usize,
}

impl Default for SvmTraining {
    fn default() -> Self {
        Self {
            cost: 10.0,
            relative_gamma: 0.5,
            largest: 256,
        }
    }
}

/// A trained machine.
#[derive(Debug, Clone)]
pub struct SvmFit {
    /// What decides.
    pub predictor: SvmPredictor,
    /// Support vectors before pruning.
    pub unpruned: usize,
}

impl SvmTraining {
    /// Trains on `windows`.
    ///
    /// # Errors
    /// [`LearnedError::Training`] for one kind of window alone, or more than 10 000.
    pub fn fit(&self, windows: &Windows) -> Result<SvmFit, LearnedError> {
        let (machine, _) = self.solve(windows)?;
        let pruned = machine.pruned(self.largest)?;
        Ok(SvmFit {
            predictor: flat(&pruned, windows.dimensions())?,
            unpruned: machine.rows.len(),
        })
    }

    fn solve(&self, windows: &Windows) -> Result<(Machine, Svm<f64, bool>), LearnedError> {
        let (count, dimensions) = (windows.len(), windows.dimensions());
        if count > LARGEST_ROWS {
            let what = format!("{count} windows: expected at most {LARGEST_ROWS}");
            return Err(LearnedError::training(what));
        }
        if !windows.has_both_kinds() {
            return Err(LearnedError::training(
                "expected healthy and faulty windows",
            ));
        }
        let values = windows.values().iter().copied().map(f64::from).collect();
        let records = Array2::from_shape_vec((count, dimensions), values);
        let records = records.map_err(LearnedError::training)?;
        let faulty: Array1<bool> = windows.labels().iter().map(|l| l.is_faulty()).collect();
        let gamma = self.relative_gamma / dimensions as f64;
        let svm = Svm::<f64, bool>::params()
            .pos_neg_weights(self.cost, self.cost)
            // Its argument is the reciprocal.
            .gaussian_kernel(1.0 / gamma)
            .fit(&DatasetBase::new(records.clone(), faulty))
            .map_err(LearnedError::training)?;
        let kept: Vec<usize> = (0..count)
            .filter(|k| svm.alpha[*k].abs() > SMALLEST_WEIGHT)
            .collect();
        let machine = Machine {
            rows: kept.iter().map(|k| records.row(*k).to_vec()).collect(),
            weights: kept.iter().map(|k| svm.alpha[*k]).collect(),
            bias: -svm.rho,
            gamma,
        };
        Ok((machine, svm))
    }
}

fn flat(machine: &Machine, dimensions: usize) -> Result<SvmPredictor, LearnedError> {
    let support: Vec<f32> = machine.rows.iter().flatten().map(|v| *v as f32).collect();
    let weights: Vec<f32> = machine.weights.iter().map(|w| *w as f32).collect();
    let (bias, gamma) = (machine.bias as f32, machine.gamma as f32);
    Ok(SvmPredictor::new(
        dimensions, &support, &weights, bias, gamma,
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::learned::windows::testing::rings;

    #[test]
    fn the_flat_machine_decides_as_linfa_s() {
        let windows = rings(240, 4);
        let training = SvmTraining::default();
        let (machine, svm) = training.solve(&windows).unwrap();
        let flat = flat(&machine, windows.dimensions()).unwrap();
        for window in rings(100, 5).values().chunks(windows.dimensions()) {
            let record: Array1<f64> = window.iter().copied().map(f64::from).collect();
            let theirs = svm.weighted_sum(&record) - svm.rho;
            let ours = f64::from(flat.decision(window));
            // Some hundred terms of up to C = 10 in single precision.
            assert!((ours - theirs).abs() < 1e-3, "{ours} {theirs}");
        }
    }

    #[test]
    fn what_no_line_parts_is_told_apart_also_by_fewer_support_vectors() {
        let windows = rings(400, 6);
        let fit = SvmTraining {
            cost: 0.1,
            largest: 12,
            ..SvmTraining::default()
        }
        .fit(&windows)
        .unwrap();
        assert!(fit.predictor.count() == 12 && fit.unpruned > 12);
        let test = rings(400, 7);
        let decisions = test.values().chunks(test.dimensions());
        let right = decisions
            .zip(test.labels())
            .filter(|(window, label)| (fit.predictor.decision(window) > 0.0) == label.is_faulty());
        // Rings of radius 1 and 3 with noise of 0.3: three deviations from the middle.
        assert!(right.count() >= 390);
        let again = SvmTraining {
            cost: 0.1,
            largest: 12,
            ..SvmTraining::default()
        };
        assert_eq!(again.fit(&windows).unwrap().predictor, fit.predictor);
    }

    #[test]
    fn data_that_cannot_be_trained_on_is_refused() {
        let one_kind = rings(50, 8).filtered(|label| label.is_faulty());
        let error = SvmTraining::default().fit(&one_kind).unwrap_err();
        assert!(error.to_string().contains("healthy and faulty"), "{error}");
    }
}
