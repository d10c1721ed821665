//! Project tasks: made-up signals, experiments on them, and the checks of the tree.

pub mod ci;
pub mod code_noise;
pub mod constellation;
pub mod demo;
pub mod reproduce;
pub mod synthesis;
pub mod tidy;
