//! Satellites set aside, and the evidence that they have recovered.

/// Satellites not in use. Each is taken back once the odds of its health over a uniform fault say so.
#[derive(Debug, Clone, Default)]
pub(crate) struct Readmission {
    ids: Vec<u32>,
    /// Of each, cumulative ln p(y | healthy) - ln p(y | fault), held at zero from below.
    recoveries: Vec<f64>,
}

impl Readmission {
    /// The satellites, in the order they were set aside.
    pub(crate) fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// Sets a satellite aside.
    pub(crate) fn insert(&mut self, id: u32) {
        self.ids.push(id);
        self.recoveries.push(0.0);
    }

    /// Takes in an epoch of the satellite `id`, if it is set aside: the log density (1/m) of its
    /// pseudorange were it healthy, against a uniform density over `fault_width_m`.
    pub(crate) fn weigh(&mut self, id: u32, log_healthy: f64, fault_width_m: f64) {
        let pairs = self.ids.iter().zip(&mut self.recoveries);
        for (_, recovery) in pairs.filter(|(own, _)| **own == id) {
            *recovery = (*recovery + log_healthy + fault_width_m.ln()).max(0.0);
        }
    }

    /// Takes back the first satellite for whose health the logarithm of the odds exceeds `threshold`.
    pub(crate) fn take_back(&mut self, threshold: f64) -> Option<u32> {
        let at = self.recoveries.iter().position(|r| *r > threshold)?;
        self.recoveries.remove(at);
        Some(self.ids.remove(at))
    }
}
