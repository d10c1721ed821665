//! Whole receivers over whole signals, real and made: one binary, so that they share the processor.

mod flight;
mod front_ends;
mod raim;
mod rebuilt_static;
mod recordings;
mod shape;
mod simulated_static;
mod solve;
mod vector;
