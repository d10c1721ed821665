//! What sampling does to the replica's code phase, and taps that undo it.
//!
//! A sampled replica changes chip at samples only: a chip edge at x samples takes effect at
//! ceil(x) - 1/2, half way between the last sample of the old chip and the first of the new. Over
//! many edges that averages out, but not where a chip holds a whole number of samples (4.092,
//! 16.368 Msps), or a simple fraction more, or nearly: then all edges are off alike, and the
//! correlation is only to be had at code phases one step apart. Taps at any other phase act as if
//! in the middle of their step, up to half a sample off.
//!
//! There taps are placed in the middle of steps, and early and late are weighted sums of their
//! neighbours. Behind a front-end filter the correlation is smooth, so that values a step apart
//! hold those in between. The weights are a B-spline of order n, which is zero-free in the passband
//! and suppresses what the steps would fold into it by (sinc f)^n (f in cycles a step, near one).
//! To early and late alike it is a slight smoothing, which leaves their balance where it was.

use num_complex::Complex64;

use super::discriminator::EarlyPromptLate;
use crate::{Replica, TapOffsets, Taps};

/// A chip of this many samples, or a part of it with a denominator up to this, can be whole.
const LARGEST_DENOMINATOR: u32 = 4;
/// Turns of the sample grid against the chips in an interval from which edges average out.
const AVERAGED_TURNS: f64 = 4.0;

/// Order of the spline, and neighbours that it takes, where steps are coarse. An edge of the
/// passband at 0.4 of the sample rate is folded down to 0.05 of itself; straight lines leave 0.25.
const COARSE_ORDER: u32 = 6;
/// Order where a chip has at least [`FINE_STEPS`] steps: straight lines, which cost fewer taps.
const FINE_ORDER: u32 = 2;
/// Steps in a chip from which straight lines follow the correlation to 0.1 m.
const FINE_STEPS: f64 = 12.0;

/// `replica` with the taps from which [`early_prompt_late`] makes early, prompt and late.
pub(super) fn with_taps(replica: Replica, spacing_chips: f64, sample_rate_hz: f64) -> Replica {
    let plain = TapOffsets::early_prompt_late(spacing_chips);
    let tap_offsets = Steps::of(&replica, spacing_chips, sample_rate_hz)
        .and_then(|steps| TapOffsets::new(&steps.offsets_chips()).ok())
        .unwrap_or(plain);
    Replica {
        tap_offsets,
        ..replica
    }
}

/// Early, prompt and late of a replica made by [`with_taps`]; `None` where a sum is missing.
///
/// Prompt is the nearest tap, at most half a step off.
pub(super) fn early_prompt_late(
    taps: &Taps,
    replica: &Replica,
    spacing_chips: f64,
    sample_rate_hz: f64,
) -> Option<EarlyPromptLate> {
    match Steps::of(replica, spacing_chips, sample_rate_hz) {
        Some(steps) => steps.early_prompt_late(taps.as_slice()),
        None => {
            let [early, prompt, late, ..] = *taps.as_slice() else {
                return None;
            };
            Some(EarlyPromptLate {
                early,
                prompt,
                late,
            })
        }
    }
}

/// The steps in which the replica of an interval moves. Node k is the middle of a step; node 0 is
/// that nearest to prompt.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Steps {
    step_chips: f64,
    /// Node 0 from prompt, steps, above zero late.
    nearest: f64,
    /// Late from prompt, steps.
    late: f64,
    /// Order of the spline.
    order: u32,
}

impl Steps {
    /// Those of `replica`; `None` where the edges average out.
    fn of(replica: &Replica, spacing_chips: f64, sample_rate_hz: f64) -> Option<Self> {
        let samples_per_chip = sample_rate_hz / replica.code_rate_hz;
        let samples = replica.end_tick.checked_sub(replica.start_tick)? as f64;
        let parts = f64::from(parts_of_a_sample(samples_per_chip, samples)?);
        // Steps are looked at in the middle of the interval: drift is then alike on both sides.
        let chips = replica.code_phase_chips + 0.5 * samples / samples_per_chip;
        let edge = 0.5 * samples + (chips.floor() + 1.0 - chips) * samples_per_chip;
        let place = parts * edge;
        let steps_per_chip = parts * samples_per_chip;
        Some(Self {
            step_chips: steps_per_chip.recip(),
            // A delay moves the edge on; half way between samples it acts where it is.
            nearest: place.floor() + 0.5 - place,
            late: 0.5 * spacing_chips * steps_per_chip,
            order: if steps_per_chip < FINE_STEPS {
                COARSE_ORDER
            } else {
                FINE_ORDER
            },
        })
    }

    /// The first of the nodes around `place` steps from prompt that the spline does not leave out.
    fn first_node(&self, place: f64) -> i32 {
        (place - self.nearest - 0.5 * f64::from(self.order)).floor() as i32 + 1
    }

    /// The nodes in use, in order: those around early, prompt and late.
    fn nodes(&self) -> impl Iterator<Item = i32> {
        let order = self.order as i32;
        let early = self.first_node(-self.late);
        let late = self.first_node(self.late);
        (early..late + order).filter(move |k| *k < early + order || *k == 0 || *k >= late)
    }

    fn offsets_chips(&self) -> Vec<f64> {
        self.nodes()
            .map(|k| (f64::from(k) + self.nearest) * self.step_chips)
            .collect()
    }

    fn early_prompt_late(&self, sums: &[Complex64]) -> Option<EarlyPromptLate> {
        let zero = Complex64::default();
        let (mut early, mut prompt, mut late) = (zero, zero, zero);
        let mut sums = sums.iter();
        for k in self.nodes() {
            let (place, sum) = (f64::from(k) + self.nearest, sums.next()?);
            early += sum * spline(self.order, place + self.late);
            late += sum * spline(self.order, place - self.late);
            if k == 0 {
                prompt = *sum;
            }
        }
        Some(EarlyPromptLate {
            early,
            prompt,
            late,
        })
    }
}

/// Parts of a sample in which all chip edges of an interval lie at nearly the same place: 1 where
/// a chip holds a whole number of samples, 2 where it holds half a sample more, and so on.
fn parts_of_a_sample(samples_per_chip: f64, samples: f64) -> Option<u32> {
    let chips = samples / samples_per_chip;
    (1..=LARGEST_DENOMINATOR).find(|&q| {
        let advance = f64::from(q) * samples_per_chip;
        (advance - advance.round()).abs() * chips / f64::from(q) < AVERAGED_TURNS
    })
}

/// The centred cardinal B-spline of an order, by the recursion of Cox and de Boor.
fn spline(order: u32, x: f64) -> f64 {
    if order <= 1 {
        return f64::from((-0.5..0.5).contains(&x));
    }
    let half = 0.5 * f64::from(order);
    ((half + x) * spline(order - 1, x + 0.5) + (half - x) * spline(order - 1, x - 0.5))
        / f64::from(order - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::discriminator::CodeDiscriminator;
    use crate::{SignalId, ranging_code};
    use approx::assert_abs_diff_eq;
    use statrs::function::erf::erf;

    const SPACING_CHIPS: f64 = 0.5;

    fn replica(sample_rate_hz: f64, code_phase_chips: f64, code_rate_hz: f64) -> Replica {
        let replica = Replica {
            signal: SignalId::gps_l1_ca(1).unwrap(),
            start_tick: 0,
            end_tick: (sample_rate_hz * 0.001).round() as u64,
            code_phase_chips,
            code_rate_hz,
            carrier_phase_cycles: 0.0,
            carrier_frequency_hz: 0.0,
            tap_offsets: TapOffsets::early_prompt_late(SPACING_CHIPS),
        };
        with_taps(replica, SPACING_CHIPS, sample_rate_hz)
    }

    /// Chip at a code phase, with edges rounded by a Gaussian of deviation `edge_chips`.
    fn smooth_chip(phase_chips: f64, edge_chips: f64) -> f64 {
        let code = ranging_code(SignalId::gps_l1_ca(1).unwrap());
        let chip = |k: f64| f64::from(code[k.rem_euclid(1023.0) as usize]);
        let nearest = phase_chips.round();
        let x = (phase_chips - nearest) / edge_chips;
        let (before, after) = (chip(nearest - 1.0), chip(nearest));
        0.5 * (before + after) + 0.5 * (after - before) * erf(x * std::f64::consts::FRAC_1_SQRT_2)
    }

    /// Code error, chips, of `replica` on a signal whose phase is ahead by `ahead_chips`.
    fn error_chips(replica: &Replica, sample_rate_hz: f64, ahead_chips: f64) -> f64 {
        let code = ranging_code(replica.signal);
        let phases: Vec<f64> = (replica.start_tick..replica.end_tick)
            .map(|n| replica.code_phase_chips + n as f64 * replica.code_rate_hz / sample_rate_hz)
            .collect();
        // Half the sample rate is down by 21 dB, three quarters by 47 dB.
        let edge_chips = 0.7 * replica.code_rate_hz / sample_rate_hz;
        let sums = replica.tap_offsets.as_slice().iter().map(|offset| {
            let product = |phase: &f64| {
                let chip = (phase - offset).floor().rem_euclid(1023.0);
                f64::from(code[chip as usize]) * smooth_chip(phase + ahead_chips, edge_chips)
            };
            Complex64::from(phases.iter().map(product).sum::<f64>())
        });
        let taps = Taps::new(&sums.collect::<Vec<_>>(), phases.len() as u32, 1.0);
        let sums = early_prompt_late(&taps, replica, SPACING_CHIPS, sample_rate_hz).unwrap();
        CodeDiscriminator::Envelope.error_chips(&sums, SPACING_CHIPS)
    }

    #[test]
    fn a_smooth_signal_has_no_error_wherever_it_stands_on_the_grid() {
        // Whole samples in a chip, half a sample more, and with a Doppler of 1 kHz.
        for (sample_rate_hz, code_rate_hz) in [
            (4.092e6, 1.023e6),
            (4.092e6, 1.023_000_65e6),
            (2.5575e6, 1.023e6),
            (8.184e6, 1.023e6),
            (16.368e6, 1.023e6),
        ] {
            for part in 0..16 {
                let phase = 100.0 + 1.023e6 / sample_rate_hz * f64::from(part) / 16.0;
                let replica = replica(sample_rate_hz, phase, code_rate_hz);
                let error = error_chips(&replica, sample_rate_hz, 0.0);
                // 0.1 m: half of the noise of the narrow loop at 45 dB-Hz.
                assert!(error.abs() < 3.4e-4, "{sample_rate_hz}, {part}: {error}");
                let ahead = error_chips(&replica, sample_rate_hz, 0.02);
                // The peak is round: two samples and a half of a chip leave the least slope.
                let slope = (ahead - error) / 0.02;
                assert!((0.6..1.2).contains(&slope), "{sample_rate_hz}: {slope}");
            }
        }
    }

    #[test]
    fn taps_stand_half_way_between_samples() {
        let replica = replica(4.092e6, 100.07, 1.023e6);
        for offset in replica.tap_offsets.as_slice() {
            // Edges fall on whole chips of the delayed phase, four samples each.
            let edge = 4.0 * (101.0 - replica.code_phase_chips + offset);
            assert_abs_diff_eq!(edge.rem_euclid(1.0), 0.5, epsilon = 1e-9);
        }
        // Six around early, six around late, four of them the same.
        assert_eq!(replica.tap_offsets.as_slice().len(), 8);
    }

    #[test]
    fn other_rates_keep_their_three_taps() {
        for sample_rate_hz in [2.6e6, 4.0e6, 20.48e6] {
            let replica = replica(sample_rate_hz, 0.01, 1.023e6);
            let plain = TapOffsets::early_prompt_late(SPACING_CHIPS);
            assert_eq!(replica.tap_offsets, plain);
            let sums = [3.0, 2.0, 1.0].map(Complex64::from);
            let taps = Taps::new(&sums, 2600, 1.0);
            let made = early_prompt_late(&taps, &replica, SPACING_CHIPS, sample_rate_hz).unwrap();
            assert_eq!([made.early, made.prompt, made.late], sums);
        }
    }

    #[test]
    fn sums_that_are_missing_are_noticed() {
        let replica = replica(4.092e6, 0.01, 1.023e6);
        let taps = Taps::new(&[Complex64::default(); 3], 4092, 1.0);
        assert!(early_prompt_late(&taps, &replica, SPACING_CHIPS, 4.092e6).is_none());
    }

    #[test]
    fn splines_are_those_of_the_tables() {
        // Values at whole numbers: 1/6, 2/3, 1/6 of the cubic, 1, 26, 66, 26, 1 over 120 of the
        // quintic.
        assert_abs_diff_eq!(spline(2, 0.25), 0.75, epsilon = 1e-15);
        assert_abs_diff_eq!(spline(4, 0.0), 2.0 / 3.0, epsilon = 1e-15);
        assert_abs_diff_eq!(spline(6, 1.0), 26.0 / 120.0, epsilon = 1e-15);
        for place in [-0.5, -0.2, 0.0, 0.37] {
            let sum: f64 = (-4..=4).map(|k| spline(6, f64::from(k) + place)).sum();
            assert_abs_diff_eq!(sum, 1.0, epsilon = 1e-14);
        }
    }
}
