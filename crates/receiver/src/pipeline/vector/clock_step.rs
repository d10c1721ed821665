//! Steps of the receiver's clock: all pseudoranges jump alike, and nothing is wrong with any of them.

use gnss_nav::filter::Innovations;

/// Fewest channels that tell a step of the clock from an error of their own.
const FEWEST: usize = 4;
/// A step stands out by this many deviations of a typical innovation, ...
const STEP_SIGMAS: f64 = 4.0;
/// ... and innovations agree on it to this many of their own.
const AGREEMENT_SIGMAS: f64 = 3.0;

/// A step on which most channels agree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ClockStep {
    /// By how much all pseudoranges are longer, m.
    pub(super) size_m: f64,
    /// Variance of that, m^2.
    pub(super) variance_m2: f64,
}

/// The step that most of the pseudoranges' innovations agree on, if there is one.
pub(super) fn find(innovations: &Innovations) -> Option<ClockStep> {
    let codes: Vec<(f64, f64)> = innovations
        .satellites()
        .iter()
        .map(|s| (s.code.value(), s.code.variance().sqrt()))
        .collect();
    among(&codes)
}

/// As [`find`], of values and deviations.
fn among(codes: &[(f64, f64)]) -> Option<ClockStep> {
    if codes.len() < FEWEST {
        return None;
    }
    let size_m = median(codes.iter().map(|c| c.0));
    let sigma_m = median(codes.iter().map(|c| c.1));
    let agree = |c: &&(f64, f64)| (c.0 - size_m).abs() < AGREEMENT_SIGMAS * c.1;
    let agreeing = codes.iter().filter(agree).count();
    let stands_out = size_m.abs() > STEP_SIGMAS * sigma_m;
    (stands_out && 4 * agreeing > 3 * codes.len()).then_some(ClockStep {
        size_m,
        variance_m2: sigma_m * sigma_m,
    })
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_all_have_in_common_is_a_step() {
        let codes = [
            (88.0, 8.0),
            (93.0, 10.0),
            (80.0, 20.0),
            (95.0, 9.0),
            (-300.0, 12.0),
        ];
        let step = among(&codes).unwrap();
        assert_eq!((step.size_m, step.variance_m2), (88.0, 100.0));
    }

    #[test]
    fn noise_a_single_fault_and_disagreement_are_none() {
        let noise = [
            (8.0, 8.0),
            (-13.0, 10.0),
            (20.0, 20.0),
            (5.0, 9.0),
            (0.0, 12.0),
        ];
        assert_eq!(among(&noise), None);
        let fault = [
            (88.0, 8.0),
            (-3.0, 10.0),
            (8.0, 20.0),
            (5.0, 9.0),
            (0.0, 12.0),
        ];
        assert_eq!(among(&fault), None);
        let apart = [(88.0, 8.0), (193.0, 10.0), (-80.0, 9.0), (295.0, 9.0)];
        assert_eq!(among(&apart), None);
        assert_eq!(among(&[(90.0, 8.0); 3]), None);
    }
}
