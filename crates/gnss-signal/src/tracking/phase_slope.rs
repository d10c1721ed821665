//! Doppler of a locked carrier, by the slope of its phase.

use super::epoch::PhaseLine;

/// Weight of a new difference of Dopplers in the acceleration that carries them to the epoch.
const ACCELERATION_GAIN: f64 = 0.2;

/// Slopes of successive epochs, as long as the phase stays locked.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PhaseSlope {
    last: Option<PhaseLine>,
    acceleration_hz_s: f64,
}

impl PhaseSlope {
    /// Takes the line of an epoch and returns the Doppler at `time_s`, Hz.
    pub(super) fn doppler_hz(&mut self, line: PhaseLine, time_s: f64) -> f64 {
        if let Some(before) = self.last.replace(line) {
            let slope = (line.slope_hz - before.slope_hz) / (line.middle_s - before.middle_s);
            self.acceleration_hz_s += ACCELERATION_GAIN * (slope - self.acceleration_hz_s);
        }
        let ahead_s = time_s - line.middle_s;
        line.slope_hz + self.acceleration_hz_s * ahead_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_doppler_is_carried_to_the_epoch_by_the_acceleration() {
        let mut slope = PhaseSlope::default();
        let line = |middle_s: f64| PhaseLine {
            middle_s,
            slope_hz: 1000.0 + 8.0 * middle_s,
            spread_s2: 1e-3,
        };
        assert_eq!(
            slope.doppler_hz(line(0.0), 0.05),
            1000.0,
            "no acceleration yet"
        );
        for epoch in 1..60 {
            slope.doppler_hz(line(0.1 * f64::from(epoch)), 0.0);
        }
        let doppler_hz = slope.doppler_hz(line(6.0), 6.05);
        assert!((doppler_hz - 1048.4).abs() < 1e-3, "{doppler_hz}");
    }
}
