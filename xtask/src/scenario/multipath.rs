//! What reflections do to an ideal code loop.

use std::f64::consts::TAU;

use num_complex::Complex64;

use super::antenna::Ray;

/// Chips per second of satellite time.
const CODE_RATE_HZ: f64 = 1.023e6;
/// Offset of early and late from prompt, chips.
const HALF_SPACING_CHIPS: f64 = 0.5;
/// Steps of the loop; each removes a third of what is left.
const STEPS: usize = 200;

/// Error of a code loop that has settled on `rays`, chips; above zero: late, the range too long.
///
/// Non-coherent early minus late with a chip between them on the triangle of an unlimited
/// bandwidth (`Zhang2014`, equation 3): where |E| = |L|, followed from no error. The first ray is
/// the direct one.
#[must_use]
pub fn tracking_error_chips(rays: &[Ray]) -> f64 {
    // A signal by itself has no error.
    let [direct, _, ..] = rays else {
        return 0.0;
    };
    let relative: Vec<(Complex64, f64)> = rays
        .iter()
        .map(|ray| {
            let cycles = ray.arrival.carrier_cycles - direct.arrival.carrier_cycles;
            let delay_s = direct.arrival.code_time - ray.arrival.code_time;
            (
                Complex64::from_polar(ray.amplitude, TAU * cycles),
                delay_s * CODE_RATE_HZ,
            )
        })
        .collect();
    let correlation = |late_chips: f64| {
        let part = |(amplitude, delay): &(Complex64, f64)| {
            amplitude * (1.0 - (late_chips - delay).abs()).max(0.0)
        };
        relative.iter().map(part).sum::<Complex64>().norm()
    };
    let mut late_chips = 0.0;
    for _ in 0..STEPS {
        let early = correlation(late_chips - HALF_SPACING_CHIPS);
        let late = correlation(late_chips + HALF_SPACING_CHIPS);
        if early + late <= 0.0 {
            break;
        }
        let next = late_chips - (early - late) / (early + late) / 3.0;
        if next == late_chips {
            break;
        }
        late_chips = next;
    }
    late_chips
}

#[cfg(test)]
mod tests {
    use gnss_nav::GpsTime;

    use super::*;
    use crate::scenario::antenna::Arrival;

    fn error(amplitude: f64, delay_chips: f64, phase_deg: f64) -> f64 {
        let time = GpsTime::new(2350, 100.0);
        let ray = |amplitude, delay_chips: f64, cycles| Ray {
            amplitude,
            arrival: Arrival {
                code_time: time - delay_chips / CODE_RATE_HZ,
                carrier_cycles: cycles,
            },
        };
        tracking_error_chips(&[
            ray(1.0, 0.0, 0.0),
            ray(amplitude, delay_chips, phase_deg / 360.0),
        ])
    }

    #[test]
    fn the_envelope_is_that_of_the_triangle() {
        // In phase: a d / (1 + a) on the flanks, at most a / 2 for a spacing of a chip; in
        // opposition the reflection of -a.
        let expected = [
            (0.5, 0.3, 0.0, 0.1),
            (0.5, 0.75, 0.0, 0.25),
            (0.5, 0.25, 180.0, -0.25),
            (0.5, 1.5, 0.0, 0.0),
            (0.2, 0.5, 0.0, 0.5 * 0.2 / 1.2),
        ];
        for (amplitude, delay, phase, chips) in expected {
            let found = error(amplitude, delay, phase);
            assert!((found - chips).abs() < 1e-6, "{found}, not {chips}");
        }
        assert_eq!(tracking_error_chips(&[]), 0.0);
    }
}
