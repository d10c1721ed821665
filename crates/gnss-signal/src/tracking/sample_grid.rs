//! What sampling does to the replica's code phase.
//!
//! A sampled replica changes chip at samples only: a chip edge at x samples takes effect at
//! ceil(x) - 1/2, half way between the last sample of the old chip and the first of the new. Over
//! many edges that averages out, but not where a chip holds a whole number of samples (4.092,
//! 16.368 Msps) or nearly: then every edge is off by the same part of a sample, the discriminator
//! moves in steps, and a signal behind a front-end filter, which has no steps, is measured wrong
//! by up to half a sample.

use crate::Replica;

/// Edges looked at in an interval.
const EDGES: u32 = 128;
/// A chip of this many samples, or a part of it with a denominator up to this, can be whole.
const LARGEST_DENOMINATOR: u32 = 4;
/// Turns of the sample grid against the chips in an interval from which edges average out.
const AVERAGED_TURNS: f64 = 4.0;

/// Code phases over which a replica is shifted in turn, in parts of a sample.
const SHIFTS: u32 = 16;

/// Chips by which to shift the replica of the `turn`-th integration.
///
/// The correction is exact only where the discriminator answers with its full slope, and a
/// band-limited peak answers with less. Shifted over a whole sample in turn, the steps average out
/// whatever the slope. Zero where the edges average out by themselves.
pub(super) fn shift_chips(turn: u32, replica: &Replica, sample_rate_hz: f64) -> f64 {
    if !stands_still(replica, sample_rate_hz) {
        return 0.0;
    }
    // Neighbouring turns lie far apart (7 and 16 have no common divisor).
    let part = (f64::from(7 * (turn % SHIFTS) % SHIFTS) + 0.5) / f64::from(SHIFTS) - 0.5;
    part * replica.code_rate_hz / sample_rate_hz
}

/// Whether all chip edges of an interval lie at nearly the same part of a sample.
fn stands_still(replica: &Replica, sample_rate_hz: f64) -> bool {
    let samples_per_chip = sample_rate_hz / replica.code_rate_hz;
    let chips = (replica.end_tick - replica.start_tick) as f64 / samples_per_chip;
    (1..=LARGEST_DENOMINATOR).any(|q| {
        let advance = f64::from(q) * samples_per_chip;
        (advance - advance.round()).abs() * chips / f64::from(q) < AVERAGED_TURNS
    })
}

/// Chips to add to the code error that early and late taps of `replica` give.
///
/// Zero where the edges average out by themselves. Exact for a signal band-limited to half the
/// sample rate.
pub(super) fn code_error_correction_chips(replica: &Replica, sample_rate_hz: f64) -> f64 {
    let samples_per_chip = sample_rate_hz / replica.code_rate_hz;
    let chips = (replica.end_tick - replica.start_tick) as f64 / samples_per_chip;
    let [early, _, late, ..] = *replica.tap_offsets.as_slice() else {
        return 0.0;
    };
    if !stands_still(replica, sample_rate_hz) {
        return 0.0;
    }
    let lag =
        |offset: f64| mean_lag_samples(replica.code_phase_chips - offset, samples_per_chip, chips);
    -0.5 * (lag(early) + lag(late)) / samples_per_chip
}

/// Mean of ceil(x) - 1/2 - x over chip edges x (samples) of a replica that begins at
/// `phase_chips`.
fn mean_lag_samples(phase_chips: f64, samples_per_chip: f64, chips: f64) -> f64 {
    let first = phase_chips.floor() + 1.0 - phase_chips;
    // A stride of whole multiples keeps the pattern of a fractional number of samples in a chip.
    let stride = (chips / f64::from(EDGES)).floor().max(1.0);
    let total: f64 = (0..EDGES)
        .map(|k| (first + f64::from(k) * stride) * samples_per_chip)
        .map(|x| x.ceil() - 0.5 - x)
        .sum();
    total / f64::from(EDGES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SignalId, TapOffsets};
    use approx::assert_abs_diff_eq;

    fn replica(code_phase_chips: f64) -> Replica {
        Replica {
            signal: SignalId::gps_l1_ca(1).unwrap(),
            start_tick: 0,
            end_tick: 40_920,
            code_phase_chips,
            code_rate_hz: 1.023e6,
            carrier_phase_cycles: 0.0,
            carrier_frequency_hz: 0.0,
            tap_offsets: TapOffsets::early_prompt_late(0.5),
        }
    }

    #[test]
    fn whole_samples_per_chip_are_corrected_by_the_step_that_was_taken() {
        // Four samples a chip: a replica at phase p between two samples acts as if at the middle
        // of its step of a quarter chip.
        for (phase, acts_as) in [(0.01, 0.125), (0.125, 0.125), (0.24, 0.125), (0.26, 0.375)] {
            let correction = code_error_correction_chips(&replica(phase), 4.092e6);
            // Rounding of positions up to 40 000 samples.
            assert_abs_diff_eq!(correction, acts_as - phase, epsilon = 1e-9);
        }
    }

    #[test]
    fn the_shifts_cover_a_sample_evenly() {
        let mut shifts: Vec<f64> = (0..16)
            .map(|turn| shift_chips(turn, &replica(0.0), 4.092e6))
            .collect();
        shifts.sort_by(f64::total_cmp);
        for (k, shift) in shifts.iter().enumerate() {
            // A quarter chip in sixteen steps about zero; rounding only.
            assert_abs_diff_eq!(*shift, (k as f64 - 7.5) / 64.0, epsilon = 1e-12);
        }
        assert_eq!(shift_chips(3, &replica(0.0), 4.0e6), 0.0);
    }

    #[test]
    fn other_rates_need_next_to_none() {
        for rate in [2.6e6, 4.0e6, 16.369e6, 20.48e6] {
            // What two turns and a half of the grid do not average out at 16.369 Msps.
            let correction = code_error_correction_chips(&replica(0.01), rate);
            assert_abs_diff_eq!(correction, 0.0, epsilon = 3e-4);
        }
    }
}
