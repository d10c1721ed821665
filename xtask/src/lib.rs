//! Project tasks: made-up signals, experiments on them, and the checks of the tree.

pub mod campaign;
pub mod ci;
pub mod code_noise;
pub mod demo;
pub mod judged;
pub mod order;
pub mod reproduce;
pub mod scenario;
pub mod tidy;
pub mod train;
pub mod validate;
