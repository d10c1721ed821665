//! Weights of a layer and of the sum that decides.

use crate::MonitorError;
use crate::error::within;

/// Gates: input, forget, cell, output, in this order.
pub(super) const GATES: usize = 4;

/// Weights, rows one after the other; the rows of a gate follow those of the one before.
#[derive(Debug, Clone, PartialEq)]
pub struct LstmWeights {
    /// Features of a step.
    pub inputs: usize,
    /// Units of the layer.
    pub hidden: usize,
    /// 4 x hidden rows of inputs.
    pub from_input: Vec<f32>,
    /// 4 x hidden rows of hidden.
    pub from_hidden: Vec<f32>,
    /// 4 x hidden.
    pub bias: Vec<f32>,
    /// Of the output: hidden.
    pub head: Vec<f32>,
    /// Added to it.
    pub head_bias: f32,
}

impl LstmWeights {
    /// Refuses sizes that do not agree and numbers that are none.
    ///
    /// # Errors
    /// [`MonitorError::Value`].
    pub fn check(&self) -> Result<(), MonitorError> {
        within(
            "features of a step",
            self.inputs as f64,
            (1.0, 1e4),
            "1 to 1e4",
        )?;
        within("units", self.hidden as f64, (1.0, 1e4), "1 to 1e4")?;
        let rows = GATES * self.hidden;
        for (name, found, expected) in [
            (
                "weights of the input",
                self.from_input.len(),
                rows * self.inputs,
            ),
            (
                "weights of the layer",
                self.from_hidden.len(),
                rows * self.hidden,
            ),
            ("biases of the layer", self.bias.len(), rows),
            ("weights of the output", self.head.len(), self.hidden),
        ] {
            let expected = expected as f64;
            within(
                name,
                found as f64,
                (expected, expected),
                "as many as the sizes tell",
            )?;
        }
        let all = [&self.from_input, &self.from_hidden, &self.bias, &self.head];
        for number in all.into_iter().flatten().chain([&self.head_bias]) {
            within("weight", f64::from(*number), (-1e30, 1e30), "a number")?;
        }
        Ok(())
    }
}
