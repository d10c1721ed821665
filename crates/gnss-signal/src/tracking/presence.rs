//! Whether the signal of a steered channel is there, and how strong.

/// Averaging time of C/N0, s.
const MEMORY_S: f64 = 1.0;
/// ... below [`WEAK_HZ`], where one second is not enough.
const WEAK_MEMORY_S: f64 = 4.0;
/// 25 dB-Hz.
const WEAK_HZ: f64 = 316.0;
/// A signal is gone below this, Hz (8.5 dB-Hz): three deviations of noise alone over the memory.
const GONE_HZ: f64 = 7.0;

/// Follows C/N0 from interval to interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Presence {
    cn0_hz: f64,
    /// Intervals averaged.
    intervals: f64,
    present: bool,
}

impl Presence {
    /// A signal that is there, with a C/N0 known as well as it can be.
    pub(super) const fn known(cn0_hz: f64) -> Self {
        Self {
            cn0_hz,
            intervals: f64::INFINITY,
            present: true,
        }
    }

    /// A signal that is not there, or not known to be.
    pub(super) const fn absent() -> Self {
        Self {
            cn0_hz: 0.0,
            intervals: 0.0,
            present: false,
        }
    }

    pub(super) const fn cn0_hz(&self) -> f64 {
        self.cn0_hz
    }

    pub(super) const fn is_present(&self) -> bool {
        self.present
    }

    /// Takes the C/N0 of one interval of `interval_s`, as its power says, Hz.
    ///
    /// Noise alone has a mean of 0 and a deviation of 1 / interval.
    pub(super) fn observe(&mut self, cn0_hz: f64, interval_s: f64) {
        let memory_s = if self.cn0_hz > WEAK_HZ {
            MEMORY_S
        } else {
            WEAK_MEMORY_S
        };
        self.intervals = (self.intervals + 1.0).min(memory_s / interval_s);
        self.cn0_hz += (cn0_hz - self.cn0_hz) / self.intervals;
        if self.present {
            self.present = self.cn0_hz > GONE_HZ;
        } else if exceeds_noise(cn0_hz * interval_s, 1.0) {
            // What was averaged before was not this signal.
            *self = Self {
                cn0_hz,
                intervals: 1.0,
                present: true,
            };
        } else {
            self.present = exceeds_noise(self.cn0_hz * interval_s, self.intervals);
        }
    }
}

/// Whether the mean signal over noise of `n` intervals is more than noise alone shows once in 1e6.
fn exceeds_noise(snr: f64, n: f64) -> bool {
    snr > 5.0 / n.sqrt() + 9.0 / n
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// C/N0 of an interval of 20 ms by its power, of a signal of `cn0_hz`.
    fn interval(cn0_hz: f64, rng: &mut ChaCha8Rng) -> f64 {
        let radius = (-(1.0 - rng.random::<f64>()).ln()).sqrt();
        let angle = std::f64::consts::TAU * rng.random::<f64>();
        let re = (cn0_hz * 0.02).sqrt() + radius * angle.cos();
        (re * re + (radius * angle.sin()).powi(2) - 1.0) / 0.02
    }

    #[test]
    fn noise_is_no_signal() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut presence = Presence::absent();
        // 1000 s; what crosses once in 1e6 intervals of one second's correlation does not here.
        for _ in 0..50_000 {
            presence.observe(interval(0.0, &mut rng), 0.02);
            assert!(!presence.is_present());
        }
    }

    #[test]
    fn a_strong_signal_is_back_at_once_and_a_weak_one_in_time() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        // 45, 30 and 16 dB-Hz: within the intervals that their power needs, and a margin of two.
        for (cn0_hz, most) in [(31_623.0, 1), (1_000.0, 3), (40.0, 400)] {
            let mut presence = Presence::absent();
            let needed = (1..=most).find(|_| {
                presence.observe(interval(cn0_hz, &mut rng), 0.02);
                presence.is_present()
            });
            assert!(needed.is_some(), "{cn0_hz} Hz");
        }
    }

    #[test]
    fn a_weak_signal_is_kept_and_one_that_fades_into_the_noise_is_gone() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut presence = Presence::known(20.0);
        // 13 dB-Hz lies five deviations above where it would be gone.
        for _ in 0..10_000 {
            presence.observe(interval(20.0, &mut rng), 0.02);
            assert!(presence.is_present());
        }
        let gone = (0..1000).find(|_| {
            presence.observe(interval(0.0, &mut rng), 0.02);
            !presence.is_present()
        });
        assert!(gone.is_some());
    }
}
