//! Lock: what a channel sees of its signal.

use num_complex::Complex64;

/// What a channel sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lock {
    /// Pulling in after acquisition.
    PullIn,
    /// Code and frequency follow the signal.
    Code,
    /// Carrier phase follows the signal too.
    Carrier,
    /// The signal is gone.
    Lost,
}

impl Lock {
    /// Name in output files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::PullIn => "pull_in",
            Self::Code => "code",
            Self::Carrier => "carrier",
            Self::Lost => "lost",
        }
    }
}

/// Detects code lock by C/N0 and carrier lock by the cosine of twice the phase error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LockDetector {
    cosine: f64,
    carrier: bool,
    below_s: f64,
}

/// Time constant of the phase lock indicator, s.
const COSINE_TIME_S: f64 = 0.1;
/// Carrier lock begins above this mean cosine of twice the phase error (28 degrees rms) ...
const CARRIER_ON: f64 = 0.6;
/// ... and ends below this one (37 degrees rms, near the loss of a Costas loop).
const CARRIER_OFF: f64 = 0.3;

impl LockDetector {
    /// A detector that has seen nothing; `carrier` tells whether phase lock is assumed.
    pub(super) const fn new(carrier: bool) -> Self {
        Self {
            cosine: if carrier { CARRIER_ON } else { 0.0 },
            carrier,
            below_s: 0.0,
        }
    }

    /// Takes carrier lock for lost.
    pub(super) const fn unlock(&mut self) {
        self.cosine = 0.0;
        self.carrier = false;
    }

    /// Takes one prompt sum, and the smoothed C/N0 against its limit.
    pub(super) fn update(
        &mut self,
        prompt: Complex64,
        strong_enough: bool,
        interval_s: f64,
        patience_s: f64,
    ) -> Lock {
        let power = prompt.norm_sqr();
        let cosine = if power > 0.0 {
            (prompt.re * prompt.re - prompt.im * prompt.im) / power
        } else {
            0.0
        };
        self.cosine += (interval_s / COSINE_TIME_S).min(1.0) * (cosine - self.cosine);
        let limit = if self.carrier {
            CARRIER_OFF
        } else {
            CARRIER_ON
        };
        self.carrier = strong_enough && self.cosine > limit;
        self.below_s = if strong_enough {
            0.0
        } else {
            self.below_s + interval_s
        };
        match (self.below_s > patience_s, self.carrier) {
            (true, _) => Lock::Lost,
            (false, true) => Lock::Carrier,
            (false, false) => Lock::Code,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn carrier_lock_comes_with_a_steady_phase_and_goes_with_a_rotating_one() {
        let mut detector = LockDetector::new(false);
        let mut lock = Lock::Code;
        for k in 0..40 {
            let sign = if k % 3 == 0 { -1.0 } else { 1.0 };
            lock = detector.update(Complex64::new(sign * 10.0, 1.0), true, 0.01, 1.0);
        }
        assert_eq!(lock, Lock::Carrier);
        for k in 0..40 {
            lock = detector.update(Complex64::from_polar(1.0, f64::from(k)), true, 0.01, 1.0);
        }
        assert_eq!(lock, Lock::Code);
    }

    #[test]
    fn a_weak_signal_is_lost_after_the_patience() {
        let mut detector = LockDetector::new(true);
        for _ in 0..100 {
            let lock = detector.update(Complex64::new(1.0, 0.0), false, 0.01, 1.005);
            assert_eq!(lock, Lock::Code);
        }
        let lock = detector.update(Complex64::new(1.0, 0.0), false, 0.01, 1.005);
        assert_eq!(lock, Lock::Lost);
    }
}
