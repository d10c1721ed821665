//! One step of the layer, all gates at once, in single precision.

use pulp::{Arch, Simd, WithSimd};

use super::weights::{GATES, LstmWeights};
use crate::MonitorError;
use crate::learned::activation::{LANES, sigmoid, tanh};

/// The gates of [`LANES`] units.
type Gates = [[f32; LANES]; GATES];

/// f = sigmoid(Wf [h, x] + bf), i, o likewise, g = tanh(Wc [h, x] + bc), C = f C + i g, h = o tanh(C)
/// (Zhu2020, equations (11) to (15)); the score is a weighted sum of h.
#[derive(Debug, Clone, PartialEq)]
pub struct LstmCell {
    weights: LstmWeights,
    /// Blocks of units, in each a bias, then the weights of every feature, then those of every unit.
    blocks: Vec<Vec<Gates>>,
    /// Weights of the output by block; units that fill the last block up weigh nothing and stay zero.
    head: Vec<[f32; LANES]>,
}

/// What a layer remembers of a channel.
#[derive(Debug, Clone, PartialEq)]
pub struct LstmState {
    hidden: Vec<[f32; LANES]>,
    cell: Vec<[f32; LANES]>,
    /// What goes into the gates, in the order of [`Gates`], while a step is worked out.
    sums: [Vec<[f32; LANES]>; GATES],
}

impl LstmState {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.hidden.fill([0.0; LANES]);
        self.cell.fill([0.0; LANES]);
    }
}

impl LstmCell {
    /// Arranges `weights`.
    ///
    /// # Errors
    /// As [`LstmWeights::check`].
    pub fn new(weights: LstmWeights) -> Result<Self, MonitorError> {
        weights.check()?;
        let blocks = weights.hidden.div_ceil(LANES);
        let head = weights.head.chunks(LANES).map(|part| {
            let mut lanes = [0.0; LANES];
            lanes
                .iter_mut()
                .zip(part)
                .for_each(|(lane, weight)| *lane = *weight);
            lanes
        });
        Ok(Self {
            head: head.collect(),
            blocks: (0..blocks).map(|block| arranged(&weights, block)).collect(),
            weights,
        })
    }

    /// The weights as they were given.
    #[must_use]
    pub const fn weights(&self) -> &LstmWeights {
        &self.weights
    }

    /// A state that remembers nothing.
    #[must_use]
    pub fn zero_state(&self) -> LstmState {
        let zeros = vec![[0.0; LANES]; self.blocks.len()];
        LstmState {
            hidden: zeros.clone(),
            cell: zeros.clone(),
            sums: std::array::from_fn(|_| zeros.clone()),
        }
    }

    /// Takes the features of a step and returns the score after it; above zero: faulty.
    pub fn step(&self, state: &mut LstmState, features: &[f32]) -> f32 {
        Arch::new().dispatch(Steps {
            cell: self,
            state,
            features,
        })
    }

    /// The score of a whole window from a state that remembers nothing.
    #[must_use]
    pub fn window(&self, state: &mut LstmState, window: &[f32]) -> f32 {
        state.clear();
        self.step(state, window)
    }

    #[inline(always)]
    fn advance(&self, state: &mut LstmState, features: &[f32]) -> f32 {
        for (number, block) in self.blocks.iter().enumerate() {
            let hidden = state.hidden.as_flattened().iter().take(self.weights.hidden);
            let sums = gates(block, features, hidden);
            for (all, sums) in state.sums.iter_mut().zip(sums) {
                all[number] = sums;
            }
        }
        let cell = state.cell.as_flattened_mut();
        activate(cell, state.hidden.as_flattened_mut(), &state.sums);
        let mut score = [0.0; LANES];
        for (head, hidden) in self.head.iter().zip(&state.hidden) {
            for ((score, weight), unit) in score.iter_mut().zip(head).zip(hidden) {
                *score += weight * unit;
            }
        }
        self.weights.head_bias + score.iter().sum::<f32>()
    }
}

/// Cell and hidden state after a step, from what goes into the gates.
#[inline(always)]
fn activate(cell: &mut [f32], hidden: &mut [f32], sums: &[Vec<[f32; LANES]>; GATES]) {
    let [input, forget, candidate, output] = sums.each_ref().map(|sums| sums.as_flattened());
    let of_cell = input.iter().zip(forget).zip(candidate);
    for (cell, ((input, forget), candidate)) in cell.iter_mut().zip(of_cell) {
        *cell = sigmoid(*forget) * *cell + sigmoid(*input) * tanh(*candidate);
    }
    for ((hidden, cell), output) in hidden.iter_mut().zip(cell).zip(output) {
        *hidden = sigmoid(*output) * tanh(*cell);
    }
}

/// A step, or several, compiled for each width of vectors; products and sums are rounded one by one in all, so that
/// all give the same bits.
struct Steps<'a> {
    cell: &'a LstmCell,
    state: &'a mut LstmState,
    features: &'a [f32],
}

impl WithSimd for Steps<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f32 {
        let steps = self.features.chunks(self.cell.weights.inputs);
        steps.fold(0.0, |_, features| self.cell.advance(self.state, features))
    }
}

/// Sums before the activations.
#[inline(always)]
fn gates<'a>(block: &[Gates], features: &'a [f32], hidden: impl Iterator<Item = &'a f32>) -> Gates {
    let mut rows = block.iter();
    let mut sums = rows.next().copied().unwrap_or_default();
    for (row, x) in rows.zip(features.iter().chain(hidden)) {
        for (sum, weights) in sums.iter_mut().zip(row) {
            for (sum, weight) in sum.iter_mut().zip(weights) {
                *sum += weight * x;
            }
        }
    }
    sums
}

/// The rows of block number `block`.
fn arranged(weights: &LstmWeights, block: usize) -> Vec<Gates> {
    let (inputs, hidden) = (weights.inputs, weights.hidden);
    let gather = |of: &dyn Fn(usize) -> Option<f32>| {
        let mut gates = Gates::default();
        for (gate, lanes) in gates.iter_mut().enumerate() {
            for (lane, value) in lanes.iter_mut().enumerate() {
                let unit = block * LANES + lane;
                let row = (unit < hidden).then_some(gate * hidden + unit);
                *value = row.and_then(of).unwrap_or_default();
            }
        }
        gates
    };
    let bias = gather(&|row| weights.bias.get(row).copied());
    let mut rows = vec![bias];
    rows.extend(
        (0..inputs).map(|k| gather(&|row| weights.from_input.get(row * inputs + k).copied())),
    );
    rows.extend(
        (0..hidden).map(|k| gather(&|row| weights.from_hidden.get(row * hidden + k).copied())),
    );
    rows
}

#[cfg(test)]
pub(in crate::learned) mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Weights within -0.5 to 0.5.
    pub(in crate::learned) fn weights(inputs: usize, hidden: usize, seed: u64) -> LstmWeights {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |count: usize| -> Vec<f32> {
            (0..count).map(|_| random.random_range(-0.5..0.5)).collect()
        };
        LstmWeights {
            inputs,
            hidden,
            from_input: draw(4 * hidden * inputs),
            from_hidden: draw(4 * hidden * hidden),
            bias: draw(4 * hidden),
            head: draw(hidden),
            head_bias: 0.1,
        }
    }

    /// The same in double precision, as the equations stand.
    fn reference(w: &LstmWeights, window: &[f32]) -> f64 {
        let sigmoid = |x: f64| 1.0 / (1.0 + (-x).exp());
        let (mut h, mut c) = (vec![0.0; w.hidden], vec![0.0; w.hidden]);
        for x in window.chunks(w.inputs) {
            let sum = |gate: usize, unit: usize| {
                let row = gate * w.hidden + unit;
                let a = x.iter().zip(&w.from_input[row * w.inputs..]);
                let b = h.iter().zip(&w.from_hidden[row * w.hidden..]);
                f64::from(w.bias[row])
                    + a.map(|(x, w)| f64::from(*x) * f64::from(*w)).sum::<f64>()
                    + b.map(|(h, w)| h * f64::from(*w)).sum::<f64>()
            };
            let gates: Vec<[f64; 4]> = (0..w.hidden)
                .map(|unit| [0, 1, 2, 3].map(|gate| sum(gate, unit)))
                .collect();
            for (unit, [i, f, g, o]) in gates.into_iter().enumerate() {
                c[unit] = sigmoid(f) * c[unit] + sigmoid(i) * g.tanh();
                h[unit] = sigmoid(o) * c[unit].tanh();
            }
        }
        let head = h.iter().zip(&w.head).map(|(h, w)| h * f64::from(*w));
        f64::from(w.head_bias) + head.sum::<f64>()
    }

    #[test]
    fn it_is_the_equations_in_double_precision() {
        // Units that fill blocks, and that do not.
        for (inputs, hidden) in [(2, 32), (4, 13)] {
            let cell = LstmCell::new(weights(inputs, hidden, 3)).unwrap();
            let mut random = ChaCha8Rng::seed_from_u64(4);
            let window: Vec<f32> = (0..50 * inputs)
                .map(|_| random.random_range(-3.0..3.0))
                .collect();
            let mut state = cell.zero_state();
            let found = f64::from(cell.window(&mut state, &window));
            // Sums of 40 terms in single precision, forgotten within a few steps.
            let exact = reference(cell.weights(), &window);
            assert!((found - exact).abs() < 1e-5, "{found} {exact}");
            // A window starts from nothing; steps go on.
            assert_eq!(f64::from(cell.window(&mut state, &window)), found);
            let twice = cell.step(&mut state, &window[..inputs]);
            let longer: Vec<f32> = window.iter().chain(&window[..inputs]).copied().collect();
            assert_eq!(cell.window(&mut state, &longer), twice);
        }
    }

    #[test]
    fn sizes_that_do_not_agree_are_refused() {
        let mut short = weights(2, 8, 1);
        short.head.pop();
        let error = LstmCell::new(short).unwrap_err().to_string();
        assert!(error.starts_with("weights of the output is 7"), "{error}");
        let mut bad = weights(2, 8, 1);
        bad.bias[0] = f32::NAN;
        assert!(LstmCell::new(bad).is_err());
    }
}
