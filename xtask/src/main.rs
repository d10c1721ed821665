//! Command line of the project tasks.

fn main() {}
