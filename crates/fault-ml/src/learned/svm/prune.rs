//! Fewer support vectors for nearly the same decision.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::learned::LearnedError;

/// Added to the diagonal, against rows that nearly repeat each other.
const RIDGE: f64 = 1e-3;

/// Rows and weights of a machine in double precision.
#[derive(Debug, Clone)]
pub(super) struct Machine {
    pub(super) rows: Vec<Vec<f64>>,
    pub(super) weights: Vec<f64>,
    pub(super) bias: f64,
    pub(super) gamma: f64,
}

impl Machine {
    pub(super) fn kernel(&self, a: &[f64], b: &[f64]) -> f64 {
        let apart = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
        (-self.gamma * apart.sum::<f64>()).exp()
    }

    /// Keeps the `largest` rows of most weight and refits their weights, by least squares in the space of the
    /// kernel: with K over what is kept and L from it to all, (K + ridge) v = L w.
    pub(super) fn pruned(&self, largest: usize) -> Result<Self, LearnedError> {
        if self.rows.len() <= largest {
            return Ok(self.clone());
        }
        let mut order: Vec<usize> = (0..self.rows.len()).collect();
        // Weights at the bound are all alike: the order of training decides among them.
        order.sort_by(|a, b| self.weights[*b].abs().total_cmp(&self.weights[*a].abs()));
        order.truncate(largest);
        order.sort_unstable();
        let rows: Vec<Vec<f64>> = order.iter().map(|k| self.rows[*k].clone()).collect();
        let entry = |a: usize, b: usize| {
            let ridge = if a == b { RIDGE } else { 0.0 };
            self.kernel(&rows[a], &rows[b]) + ridge
        };
        let inner = DMatrix::from_fn(rows.len(), rows.len(), entry);
        let to_all = |row: &Vec<f64>| {
            let all = self.rows.iter().zip(&self.weights);
            all.map(|(other, weight)| weight * self.kernel(row, other))
                .sum::<f64>()
        };
        let right = DVector::from_iterator(rows.len(), rows.iter().map(to_all));
        let solved = Cholesky::new(inner).map(|c| c.solve(&right));
        let solved = solved.ok_or_else(|| LearnedError::training("support vectors repeat"))?;
        Ok(Self {
            rows,
            weights: solved.iter().copied().collect(),
            ..self.clone()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_lie_between_others_can_go() {
        // A smooth decision along a line needs few of many rows.
        let rows: Vec<Vec<f64>> = (0..60).map(|k| vec![f64::from(k) * 0.05]).collect();
        let weights: Vec<f64> = (0..60).map(|k| (f64::from(k) * 0.2).sin()).collect();
        let all = Machine {
            rows,
            weights,
            bias: 0.1,
            gamma: 1.0,
        };
        let few = all.pruned(20).unwrap();
        assert_eq!(few.rows.len(), 20);
        let decide = |m: &Machine, x: f64| {
            let terms = m.rows.iter().zip(&m.weights);
            m.bias + terms.map(|(r, w)| w * m.kernel(r, &[x])).sum::<f64>()
        };
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        for k in 0..30 {
            let x = f64::from(k) * 0.1;
            worst = worst.max((decide(&all, x) - decide(&few, x)).abs());
            largest = largest.max(decide(&all, x).abs());
        }
        // A few percent of the decision's range, by the ridge.
        assert!(worst < 0.05 * largest, "{worst} of {largest}");
        assert_eq!(all.pruned(60).unwrap().rows.len(), 60);
    }
}
