//! `Zhang2014`: a control chart on the shape of the correlation.

pub mod closed_loop;
pub mod correlation;
pub mod map;
