//! Weights as safetensors, an open format of named arrays.

use std::collections::BTreeMap;

use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};

use super::lstm::{LstmCell, LstmWeights};
use super::model::Network;
use super::svm::SvmPredictor;
use super::{LearnedError, Scaler};

/// A file that was read.
pub(super) struct Tensors<'a>(SafeTensors<'a>);

fn wrong(what: impl Into<String>) -> LearnedError {
    LearnedError::model("weights", what)
}

impl<'a> Tensors<'a> {
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, LearnedError> {
        let read = SafeTensors::deserialize(bytes);
        read.map(Self)
            .map_err(|e| wrong(format!("damaged, or no safetensors: {e}")))
    }

    /// The array `name` and its shape.
    fn array(&self, name: &str) -> Result<(Vec<f32>, Vec<usize>), LearnedError> {
        let view = self.0.tensor(name);
        let view =
            view.map_err(|_| wrong(format!("no array {name:?}: of another kind of model")))?;
        if view.dtype() != Dtype::F32 {
            let found = view.dtype();
            return Err(wrong(format!("array {name:?} is {found:?}: expected F32")));
        }
        let numbers = view.data().chunks_exact(4).map(|bytes| {
            let bytes: [u8; 4] = bytes.try_into().unwrap_or_default();
            f32::from_le_bytes(bytes)
        });
        Ok((numbers.collect(), view.shape().to_vec()))
    }

    fn vector(&self, name: &str) -> Result<Vec<f32>, LearnedError> {
        Ok(self.array(name)?.0)
    }

    fn number(&self, name: &str) -> Result<f32, LearnedError> {
        let vector = self.vector(name)?;
        match vector.as_slice() {
            [number] => Ok(*number),
            _ => Err(wrong(format!(
                "array {name:?} has {} numbers: expected 1",
                vector.len()
            ))),
        }
    }

    /// Rows and columns, and the numbers row by row.
    fn matrix(&self, name: &str) -> Result<([usize; 2], Vec<f32>), LearnedError> {
        let (numbers, shape) = self.array(name)?;
        let shape: Result<[usize; 2], _> = shape.try_into();
        let shape =
            shape.map_err(|s| wrong(format!("array {name:?} has {} axes: expected 2", s.len())))?;
        Ok((shape, numbers))
    }

    pub(super) fn scaler(&self) -> Result<Scaler, LearnedError> {
        Ok(Scaler::new(
            self.vector("scaler.mean")?,
            self.vector("scaler.deviation")?,
        )?)
    }

    pub(super) fn svm(&self) -> Result<SvmPredictor, LearnedError> {
        let ([_, dimensions], support) = self.matrix("svm.support")?;
        let weights = self.vector("svm.weight")?;
        let (bias, gamma) = (self.number("svm.bias")?, self.number("svm.gamma")?);
        Ok(SvmPredictor::new(
            dimensions, &support, &weights, bias, gamma,
        )?)
    }

    pub(super) fn lstm(&self) -> Result<LstmCell, LearnedError> {
        let ([_, inputs], from_input) = self.matrix("lstm.weight_ih_l0")?;
        let ([_, hidden], from_hidden) = self.matrix("lstm.weight_hh_l0")?;
        Ok(LstmCell::new(LstmWeights {
            inputs,
            hidden,
            from_input,
            from_hidden,
            bias: self.vector("lstm.bias_ih_l0")?,
            head: self.vector("head.weight")?,
            head_bias: self.number("head.bias")?,
        })?)
    }
}

/// Named arrays with their shapes.
type Arrays = BTreeMap<&'static str, (Vec<usize>, Vec<f32>)>;

/// The bytes of a file.
pub(super) fn write(scaler: &Scaler, network: &Network) -> Result<Vec<u8>, LearnedError> {
    let mut arrays = Arrays::new();
    let mut add = |name, shape: &[usize], values: &[f32]| {
        arrays.insert(name, (shape.to_vec(), values.to_vec()));
    };
    let (means, deviations) = scaler.parts();
    add("scaler.mean", &[means.len()], means);
    add("scaler.deviation", &[deviations.len()], deviations);
    match network {
        Network::Svm(svm) => {
            let (support, weights) = svm.parts();
            let (bias, gamma) = svm.bias_and_gamma();
            add("svm.support", &[svm.count(), svm.dimensions()], &support);
            add("svm.weight", &[weights.len()], &weights);
            add("svm.bias", &[1], &[bias]);
            add("svm.gamma", &[1], &[gamma]);
        }
        Network::Lstm(cell) => {
            let w = cell.weights();
            let rows = w.bias.len();
            add("lstm.weight_ih_l0", &[rows, w.inputs], &w.from_input);
            add("lstm.weight_hh_l0", &[rows, w.hidden], &w.from_hidden);
            add("lstm.bias_ih_l0", &[rows], &w.bias);
            add("head.weight", &[1, w.hidden], &w.head);
            add("head.bias", &[1], &[w.head_bias]);
        }
    }
    bytes(&arrays)
}

fn bytes(arrays: &Arrays) -> Result<Vec<u8>, LearnedError> {
    let little = |values: &[f32]| {
        values
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect::<Vec<u8>>()
    };
    let raw: Vec<(&str, &Vec<usize>, Vec<u8>)> = arrays
        .iter()
        .map(|(name, (shape, values))| (*name, shape, little(values)))
        .collect();
    let view = |(name, shape, bytes): &'_ (&'static str, &Vec<usize>, Vec<u8>)| {
        let view = TensorView::new(Dtype::F32, (*shape).clone(), bytes);
        view.map(|_| *name).map_err(|e| wrong(e.to_string()))
    };
    raw.iter().try_for_each(|entry| view(entry).map(|_| ()))?;
    let views = raw.iter().filter_map(|(name, shape, bytes)| {
        let view = TensorView::new(Dtype::F32, (*shape).clone(), bytes).ok()?;
        Some((*name, view))
    });
    serialize(views, None).map_err(|e| wrong(e.to_string()))
}
