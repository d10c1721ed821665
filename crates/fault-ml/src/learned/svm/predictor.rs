//! The decision of a trained machine, flat and in single precision.

use pulp::{Arch, Simd, WithSimd};

use crate::MonitorError;
use crate::error::within;
use crate::learned::activation::{LANES, exp};

/// sum of w exp(-gamma |x - s|^2) over the support vectors s, plus a bias; above zero: faulty.
#[derive(Debug, Clone, PartialEq)]
pub struct SvmPredictor {
    dimensions: usize,
    gamma: f32,
    bias: f32,
    /// Blocks of [`LANES`] support vectors, in each the first coordinate of all, then the second; the
    /// last block is filled up with zeros that weigh nothing.
    support: Vec<[f32; LANES]>,
    weights: Vec<[f32; LANES]>,
    count: usize,
}

impl SvmPredictor {
    /// From `support` vectors of `dimensions` coordinates, one after the other, and as many `weights`.
    ///
    /// # Errors
    /// [`MonitorError::Value`] where the sizes do not agree, a number is none or `gamma` not above zero.
    pub fn new(
        dimensions: usize,
        support: &[f32],
        weights: &[f32],
        bias: f32,
        gamma: f32,
    ) -> Result<Self, MonitorError> {
        let numbers = dimensions as f64 * weights.len() as f64;
        within("dimensions", dimensions as f64, (1.0, 1e6), "1 to 1e6")?;
        within(
            "support vectors",
            weights.len() as f64,
            (1.0, 1e6),
            "1 to 1e6",
        )?;
        let found = support.len() as f64;
        within(
            "coordinates of support vectors",
            found,
            (numbers, numbers),
            "a row a weight",
        )?;
        within("gamma", f64::from(gamma), (1e-12, 1e12), "above 0")?;
        for number in support.iter().chain(weights).chain([&bias]) {
            within("weight", f64::from(*number), (-1e30, 1e30), "a number")?;
        }
        let rows: Vec<&[f32]> = support.chunks(dimensions).collect();
        let mut blocks = Vec::new();
        for block in rows.chunks(LANES) {
            blocks.extend((0..dimensions).map(|k| lanes(block.iter().map(|row| row.get(k)))));
        }
        let weigh = |block: &[f32]| lanes((0..LANES).map(|k| block.get(k)));
        Ok(Self {
            dimensions,
            gamma,
            bias,
            support: blocks,
            weights: weights.chunks(LANES).map(weigh).collect(),
            count: weights.len(),
        })
    }

    /// Coordinates of a window.
    #[must_use]
    pub const fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Support vectors.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Bias and gamma.
    #[must_use]
    pub const fn bias_and_gamma(&self) -> (f32, f32) {
        (self.bias, self.gamma)
    }

    /// Support vectors, row by row, and their weights.
    #[must_use]
    pub fn parts(&self) -> (Vec<f32>, Vec<f32>) {
        let row = |n: usize| {
            let block = self.support.iter().skip(n / LANES * self.dimensions);
            let of_block = block.take(self.dimensions);
            of_block.filter_map(move |lanes| lanes.get(n % LANES).copied())
        };
        let support = (0..self.count).flat_map(row).collect();
        let weights = self.weights.iter().flatten().take(self.count);
        (support, weights.copied().collect())
    }

    /// The decision for `window`; coordinates that are missing are those of the support vectors.
    #[must_use]
    pub fn decision(&self, window: &[f32]) -> f32 {
        let machine = self;
        Arch::new().dispatch(Decision { machine, window })
    }
}

/// A decision, compiled for each width of vectors; products and sums are rounded one by one in all, so that all give the
/// same bits.
struct Decision<'a> {
    machine: &'a SvmPredictor,
    window: &'a [f32],
}

impl WithSimd for Decision<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f32 {
        let Self { machine, window } = self;
        let mut sums = [0.0; LANES];
        let blocks = machine.support.chunks_exact(machine.dimensions);
        for (block, weights) in blocks.zip(&machine.weights) {
            let mut squares = [0.0; LANES];
            for (coordinates, x) in block.iter().zip(window) {
                for (square, coordinate) in squares.iter_mut().zip(coordinates) {
                    let apart = x - coordinate;
                    *square += apart * apart;
                }
            }
            for ((sum, square), weight) in sums.iter_mut().zip(squares).zip(weights) {
                *sum += weight * exp(-machine.gamma * square);
            }
        }
        machine.bias + sums.iter().sum::<f32>()
    }
}

/// The first values, then zeros.
fn lanes<'a>(values: impl Iterator<Item = Option<&'a f32>>) -> [f32; LANES] {
    let mut lanes = [0.0; LANES];
    for (lane, value) in lanes.iter_mut().zip(values) {
        *lane = value.copied().unwrap_or_default();
    }
    lanes
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn it_is_the_sum_in_double_precision(
            support in prop::collection::vec(-3.0..3.0f32, 57),
            weights in prop::collection::vec(-1.0..1.0f32, 19),
            window in prop::collection::vec(-3.0..3.0f32, 3),
        ) {
            let machine = SvmPredictor::new(3, &support, &weights, 0.25, 0.5).unwrap();
            let kernel = |s: &[f32]| {
                let apart = s.iter().zip(&window).map(|(a, b)| f64::from(a - b).powi(2));
                (-0.5 * apart.sum::<f64>()).exp()
            };
            let terms = support.chunks(3).zip(&weights).map(|(s, w)| f64::from(*w) * kernel(s));
            let exact = 0.25 + terms.sum::<f64>();
            // 19 terms of at most one, each with a few roundings of 6e-8.
            prop_assert!((f64::from(machine.decision(&window)) - exact).abs() < 1e-5);
            prop_assert_eq!(machine.parts(), (support, weights));
        }
    }

    #[test]
    fn sizes_that_do_not_agree_are_refused() {
        assert!(SvmPredictor::new(2, &[0.0; 3], &[1.0], 0.0, 1.0).is_err());
        assert!(SvmPredictor::new(2, &[], &[], 0.0, 1.0).is_err());
        assert!(SvmPredictor::new(1, &[f32::NAN], &[1.0], 0.0, 1.0).is_err());
        assert!(SvmPredictor::new(1, &[0.0], &[1.0], 0.0, 0.0).is_err());
    }
}
