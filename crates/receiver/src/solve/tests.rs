//! Made-up observations, solved.
