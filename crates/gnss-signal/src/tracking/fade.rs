//! Whether a strong signal has given way to noise.

/// Ratio of signal to noise in one integration from which a fade is told from noise.
const STRONG_SNR: f64 = 20.0;

/// A strong signal below this ratio in an integration is not there: what is left is noise.
const SILENT_SNR: f64 = 4.0;

/// Where the signal stands well out of the noise, a quarter of its power is no accident.
const FADED_SHARE: f64 = 0.25;

/// A signal that was silent is heard again after so many integrations with power. By chance so many happen once in 3e6.
const HEARD_AFTER: u32 = 3;

/// After so many integrations a signal is gone. By chance so many happen once in 1e11.
const GONE_AFTER: u32 = 5;

/// Successive integrations without the power that the C/N0 promises.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Fade {
    since_tick: u64,
    integrations: u32,
    /// Whether the last of them held noise alone.
    is_silent: bool,
    /// Successive integrations with power since it was silent.
    heard: u32,
}

impl Fade {
    /// As [`Self::watch`], of a signal whose usual C/N0 follows it down: once silent it stays so until it is heard again.
    pub(super) fn watch_on(&mut self, now_hz: f64, usual_hz: f64, interval_s: f64, tick: u64) {
        if !self.is_silent() {
            return self.watch(now_hz, usual_hz, interval_s, tick);
        }
        self.integrations = self.integrations.saturating_add(1);
        self.heard = if now_hz * interval_s < SILENT_SNR {
            0
        } else {
            self.heard + 1
        };
        if self.heard >= HEARD_AFTER {
            *self = Self::default();
        }
    }

    /// Takes the C/N0 of one integration that began at `tick`, of a signal of `usual_hz`.
    pub(super) fn watch(&mut self, now_hz: f64, usual_hz: f64, interval_s: f64, tick: u64) {
        let faded = is_strong(usual_hz, interval_s) && now_hz < FADED_SHARE * usual_hz;
        if !faded {
            *self = Self::default();
            return;
        }
        if self.integrations == 0 {
            self.since_tick = tick;
        }
        self.integrations += 1;
        self.is_silent = now_hz * interval_s < SILENT_SNR;
    }

    /// Start of the first integration of it.
    pub(super) fn since_tick(&self) -> Option<u64> {
        (self.integrations > 0).then_some(self.since_tick)
    }

    /// Whether the last integration held noise alone.
    pub(super) const fn holds_noise(&self) -> bool {
        self.is_silent
    }

    /// Whether the signal has given way to noise: once is chance.
    pub(super) const fn is_silent(&self) -> bool {
        self.is_silent && self.integrations > 1
    }

    /// Whether the last integration shows the signal to be gone.
    pub(super) const fn shows_it_gone(&self) -> bool {
        self.integrations == GONE_AFTER
    }
}

/// Whether a signal of that C/N0 stands well out of the noise of one integration.
pub(super) fn is_strong(cn0_hz: f64, interval_s: f64) -> bool {
    cn0_hz * interval_s > STRONG_SNR
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fade_begins_where_the_power_went_and_ends_where_it_returns() {
        let mut fade = Fade::default();
        for (tick, now_hz) in [(0, 1e4), (10, 2400.0), (20, 300.0), (30, 300.0)] {
            fade.watch(now_hz, 1e4, 0.01, tick);
        }
        assert_eq!(fade.since_tick(), Some(10));
        assert!(fade.is_silent() && !fade.shows_it_gone());
        fade.watch(300.0, 1e4, 0.01, 40);
        fade.watch(300.0, 1e4, 0.01, 50);
        assert!(fade.shows_it_gone());
        fade.watch(2600.0, 1e4, 0.01, 60);
        assert_eq!(fade.since_tick(), None);
        assert!(!fade.is_silent());
    }

    #[test]
    fn silence_lasts_while_the_usual_power_falls_with_it() {
        let mut fade = Fade::default();
        for tick in 0..500 {
            // Smoothed over a second; noise alone has power now and then.
            let usual_hz = 1e4 * (-0.01 * tick as f64).exp();
            let now_hz = if tick % 50 < 2 { 500.0 } else { 50.0 };
            fade.watch_on(now_hz, usual_hz, 0.01, tick);
            assert!(fade.is_silent() || tick < 4, "{tick}");
        }
        // It comes back weaker than it was.
        for tick in 500..503 {
            assert!(fade.is_silent());
            fade.watch_on(1000.0, 10.0, 0.01, tick);
        }
        assert!(!fade.is_silent() && fade.since_tick().is_none());
    }

    #[test]
    fn a_weak_signal_never_fades() {
        let mut fade = Fade::default();
        fade.watch(0.0, 100.0 * STRONG_SNR, 0.01, 0);
        assert_eq!(fade.since_tick(), None);
        assert!(!fade.holds_noise());
    }
}
