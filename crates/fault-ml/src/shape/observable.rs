//! How late a replica stands, by where the correlation is largest.

/// Offsets of the taps of the paper, chips; above zero late.
pub const SHAPE_TAPS_CHIPS: [f64; 9] = [-0.4, -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4];

/// Magnitudes that differ by less than this part of the largest are the same but for rounding.
const ROUNDING: f64 = 1e-9;

/// Equation (4): how much earlier than prompt the largest of the taps stands, chips; of several the
/// one nearest to prompt.
///
/// `magnitudes` of the correlator sums at `offsets_chips` (above zero late); `None` without taps, or
/// where a magnitude is no number.
#[must_use]
pub fn largest_tap(offsets_chips: &[f64], magnitudes: &[f64]) -> Option<f64> {
    let largest = magnitudes.iter().copied().fold(f64::MIN, f64::max);
    if magnitudes.iter().any(|m| !m.is_finite()) {
        return None;
    }
    let within = largest - ROUNDING * largest.abs();
    let taps = offsets_chips.iter().zip(magnitudes);
    let at_peak = taps.filter(|(_, m)| **m >= within);
    at_peak
        .map(|(offset, _)| 0.0 - offset)
        .min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

/// The same between the taps: where a parabola through all of them, by least squares, is largest,
/// chips; not beyond the outermost tap.
///
/// `None` with fewer than three offsets, or where no parabola has a peak.
#[must_use]
pub fn fitted_peak(offsets_chips: &[f64], magnitudes: &[f64]) -> Option<f64> {
    let taps = || {
        offsets_chips
            .iter()
            .copied()
            .zip(magnitudes.iter().copied())
    };
    let moment = |power: i32| taps().map(|(x, _)| x.powi(power)).sum::<f64>();
    let product = |power: i32| taps().map(|(x, y)| x.powi(power) * y).sum::<f64>();
    let normal = nalgebra::Matrix3::from_fn(|row, column| moment((row + column) as i32));
    let right = nalgebra::Vector3::from_fn(|row, _| product(row as i32));
    let fit = normal.lu().solve(&right)?;
    let reach = taps().map(|(x, _)| x.abs()).fold(0.0, f64::max);
    let peak = fit[1] / (2.0 * fit[2]);
    (fit[2] < 0.0 && peak.is_finite()).then(|| peak.clamp(-reach, reach))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(late_chips: f64) -> [f64; 9] {
        SHAPE_TAPS_CHIPS.map(|x| 1.0 - (x + late_chips).abs())
    }

    #[test]
    fn the_largest_tap_is_that_nearest_to_the_peak() {
        let observed = |late| largest_tap(&SHAPE_TAPS_CHIPS, &triangle(late)).unwrap();
        assert_eq!(observed(0.0), 0.0);
        assert_eq!(observed(0.04), 0.0);
        assert_eq!(observed(0.23), 0.2);
        assert_eq!(observed(-0.17), -0.2);
        assert_eq!(observed(0.9), 0.4);
    }

    #[test]
    fn of_equal_taps_the_one_nearest_to_prompt_counts() {
        let offsets = SHAPE_TAPS_CHIPS;
        assert_eq!(largest_tap(&offsets, &[1.0; 9]), Some(0.0));
        // Half way between two taps: rounding does not decide.
        assert_eq!(largest_tap(&offsets, &triangle(0.25)), Some(0.2));
        assert_eq!(largest_tap(&offsets, &triangle(-0.15)), Some(-0.1));
        // Any set of taps, in any order.
        assert_eq!(largest_tap(&[0.3, -0.5], &[1.0, 1.0]), Some(-0.3));
    }

    #[test]
    fn what_is_no_number_has_no_peak() {
        assert_eq!(largest_tap(&[], &[]), None);
        assert_eq!(largest_tap(&[0.0, 0.1], &[1.0, f64::NAN]), None);
        assert_eq!(fitted_peak(&[0.0, 0.1], &[1.0, 0.5]), None);
        assert_eq!(fitted_peak(&SHAPE_TAPS_CHIPS, &[f64::NAN; 9]), None);
        assert_eq!(fitted_peak(&[-0.1, 0.0, 0.1], &[1.0, 0.5, 1.0]), None);
    }

    #[test]
    fn a_parabola_is_found_exactly_and_a_triangle_nearly() {
        let parabola = SHAPE_TAPS_CHIPS.map(|x| 3.0 - 2.0 * (x + 0.07).powi(2));
        let peak = fitted_peak(&SHAPE_TAPS_CHIPS, &parabola).unwrap();
        // Rounding.
        assert!((peak - 0.07).abs() < 1e-12, "{peak}");
        for late in [-0.1, -0.02, 0.05, 0.1] {
            let slope = fitted_peak(&SHAPE_TAPS_CHIPS, &triangle(late)).unwrap() / late;
            // A triangle is no parabola: 0.77 about the tip, by the normal equations.
            assert!((0.76..0.86).contains(&slope), "{late}: {slope}");
        }
    }
}
