//! Many taps close together, by the samples in which they differ.
//!
//! Of two taps one comes to every chip a little later than the other. Their codes are the same but where the code
//! changes, and there until the later one has come to the change, too. So the sum of any tap is that of the earliest
//! but for the first samples after each change: half of the chips change nothing, and behind the others a window of a
//! few samples holds all that the taps differ by. Windows are added up sample by sample, apart by where between two
//! samples the change lies, for that decides how many of them a tap takes.

use num_complex::Complex64;

use super::baseband::{Baseband, PAD};
use super::interval::{CODE_PERIOD, Interval, ONE_CHIP, within_period};
use crate::MAX_TAPS;

/// Samples of a window, at most.
const MOST_LANES: usize = 32;

/// Places of a change between two samples: at the limit of each tap but the earliest it takes a sample less.
const PLACES: usize = MAX_TAPS;

/// Fractions of a sample are told apart in steps of 2^-12: the taps lie where they should to half of that, at 16 MHz
/// 8e-6 chips or 2 mm.
pub(super) const FRACTION_SHIFT: u32 = 4;

/// A limit that no fraction of a sample passes.
const NEVER: i16 = i16::MAX;

/// A chunk of an interval whose baseband is there.
#[derive(Debug, Clone, Copy)]
pub(super) struct AddedChunk<'a> {
    pub(super) interval: &'a Interval<'a>,
    /// Samples.
    pub(super) len: usize,
    /// Carrier phase at its start, by which its sums are turned.
    pub(super) turn: Complex64,
}

/// Windows of one place, added up over a chunk: those of changes to 1, or to 0.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Window {
    i: [i16; MOST_LANES],
    q: [i16; MOST_LANES],
}

/// Those of changes to 1 less those to 0, turned by the carrier and added up over an interval.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
struct Turned {
    re: [f32; MOST_LANES],
    im: [f32; MOST_LANES],
}

impl Turned {
    #[inline(always)]
    fn at(&self, lane: usize) -> Complex64 {
        Complex64::new(self.re[lane].into(), self.im[lane].into())
    }
}

const EMPTY: Window = Window {
    i: [0; MOST_LANES],
    q: [0; MOST_LANES],
};

const NOTHING: Turned = Turned {
    re: [0.0; MOST_LANES],
    im: [0.0; MOST_LANES],
};

/// Where in the padded baseband of a chunk the earliest tap comes to the chips.
#[derive(Debug)]
pub(super) struct Grid<'a> {
    /// The chip counted from.
    pub(super) first_chip: u16,
    /// Where it comes to that one, 2^-16 samples.
    pub(super) origin: u32,
    /// How long a chip is, 2^-16 samples.
    pub(super) chip_samples: u32,
    /// And how much longer, 2^-32 samples.
    pub(super) rest: u16,
    /// Limits of the taps, in steps of a fraction of a sample.
    pub(super) limits: &'a [i16],
}

/// The windows of a batch of changes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Located<const BATCH: usize> {
    /// First sample of each.
    pub(super) at: [u16; BATCH],
    /// Twice its place, the number of limits passed, and one more where the code changes to 1.
    pub(super) slot: [u16; BATCH],
}

impl Grid<'_> {
    /// Where the windows of `batch` lie.
    pub(super) fn locate<const BATCH: usize>(&self, batch: &[u16; BATCH]) -> Located<BATCH> {
        let positions = batch.map(|change| {
            let chip = u32::from(change / 2 - self.first_chip);
            let rest = (chip * u32::from(self.rest)) >> 16;
            // Changes beyond the chunk may lie beyond 2^16 samples, and are not looked at.
            let whole = chip.wrapping_mul(self.chip_samples);
            self.origin.wrapping_add(whole).wrapping_add(rest)
        });
        let slot = |position: u32, change: u16| {
            let fraction = ((position as u16).wrapping_neg() >> FRACTION_SHIFT) as i16;
            let passed = self.limits.iter().filter(|limit| fraction > **limit);
            2 * passed.count() as u16 + change % 2
        };
        Located {
            at: positions.map(|position| (position.wrapping_add(0xffff) >> 16) as u16),
            slot: std::array::from_fn(|k| slot(positions[k], batch[k])),
        }
    }
}

/// Sums of taps close together beside that of the earliest of them.
#[derive(Debug, Clone)]
pub(super) struct ChangeSums {
    /// Code phase of the earliest tap at the next chunk, 32.32 bits of chips.
    phase: u64,
    /// By how much the last tap is later, 32.32 bits of chips.
    span: u64,
    /// Samples of a chip, 32.32 bits.
    chip_samples: u64,
    /// Samples of a window.
    lanes: usize,
    /// Samples that each tap takes of a window whose change lies right at its first.
    whole: [u8; MAX_TAPS],
    /// How far before its first sample the change may lie before that is one less, in steps.
    limits: [i16; MAX_TAPS],
    /// Of changes to 0 and to 1, for each place.
    windows: [Window; 2 * PLACES],
    turned: [Turned; PLACES],
    /// Which of them there are any of in the interval, one bit each.
    seen: u32,
}

impl ChangeSums {
    pub(super) const fn new() -> Self {
        Self {
            phase: 0,
            span: 0,
            chip_samples: 0,
            lanes: 0,
            whole: [0; MAX_TAPS],
            limits: [NEVER; MAX_TAPS],
            windows: [EMPTY; 2 * PLACES],
            turned: [NOTHING; PLACES],
            seen: 0,
        }
    }

    /// Makes ready for the taps of `interval` and returns the earliest of them; none where one by one they are faster, or
    /// too far apart.
    pub(super) fn start(&mut self, interval: &Interval<'_>) -> Option<usize> {
        /// Where the other taps have fewer samples of a chip, all together, a window takes longer than those.
        const FEWEST: f64 = 80.0;
        let chip_samples = interval.code_step_chips.recip();
        if (interval.taps - 1) as f64 * chip_samples < FEWEST {
            return None;
        }
        let phases = &interval.phases[..interval.taps];
        let behind = |tap: u64, other: u64| within_period(tap + CODE_PERIOD - other);
        let ahead = |a: usize, b: usize| behind(phases[b], phases[a]) < CODE_PERIOD / 2;
        let earliest = (1..phases.len()).fold(0, |a, b| if ahead(a, b) { b } else { a });
        let delays = phases.iter().map(|phase| behind(phases[earliest], *phase));
        self.span = delays.clone().max()?;
        if self.span as f64 * chip_samples > (MOST_LANES - 1) as f64 * ONE_CHIP {
            return None;
        }
        self.phase = phases[earliest];
        self.chip_samples = (chip_samples * ONE_CHIP).round() as u64;
        self.limits = [NEVER; MAX_TAPS];
        self.whole = [0; MAX_TAPS];
        let mut latest = 0;
        for ((delay, whole), limit) in delays.zip(&mut self.whole).zip(&mut self.limits) {
            if delay > 0 {
                let samples = (u128::from(delay) * u128::from(self.chip_samples)) >> 32;
                // Whole samples, and one of which there is more than nothing.
                let less = (samples as u64).saturating_sub(1);
                *whole = (less >> 32) as u8 + 1;
                *limit = ((less as u32 >> (15 + FRACTION_SHIFT)).div_ceil(2) as i32 - 1) as i16;
                if *limit < 0 {
                    *whole -= 1;
                    *limit = NEVER;
                }
                latest = latest.max(*whole);
            }
        }
        self.lanes = if usize::from(latest) <= MOST_LANES / 2 {
            MOST_LANES / 2
        } else {
            MOST_LANES
        };
        self.turned = [NOTHING; PLACES];
        self.seen = 0;
        Some(earliest)
    }

    /// Adds the windows of a chunk.
    #[inline(always)]
    pub(super) fn add<const BATCH: usize>(
        &mut self,
        chunk: &AddedChunk<'_>,
        baseband: &mut Baseband,
        locate: impl Fn(&Grid<'_>, &[u16; BATCH]) -> Located<BATCH>,
    ) {
        if self.lanes == MOST_LANES {
            self.add_windows::<MOST_LANES, BATCH>(chunk, baseband, locate);
        } else {
            self.add_windows::<{ MOST_LANES / 2 }, BATCH>(chunk, baseband, locate);
        }
        self.phase = within_period(self.phase + chunk.interval.code_step(chunk.len));
    }

    #[inline(always)]
    fn add_windows<const LANES: usize, const BATCH: usize>(
        &mut self,
        chunk: &AddedChunk<'_>,
        baseband: &mut Baseband,
        locate: impl Fn(&Grid<'_>, &[u16; BATCH]) -> Located<BATCH>,
    ) {
        let AddedChunk {
            interval,
            len,
            turn,
        } = *chunk;
        let [i, q] = baseband.padded(len);
        // A period on where the last tap is still in the one before.
        let phase = if self.phase < self.span {
            self.phase + CODE_PERIOD
        } else {
            self.phase
        };
        let chips = ((phase - self.span) >> 32) + 1..((phase + interval.code_step(len)) >> 32) + 1;
        let (batches, count) = interval
            .changes
            .within(chips.start as usize..chips.end as usize);
        let ahead = (i128::from(chips.start) << 32) - i128::from(phase);
        let origin = ((ahead * i128::from(self.chip_samples)) >> 48) as i32 + ((PAD as i32) << 16);
        let grid = Grid {
            first_chip: chips.start as u16,
            origin: origin.cast_unsigned(),
            chip_samples: (self.chip_samples >> 16) as u32,
            rest: self.chip_samples as u16,
            limits: &self.limits[..interval.taps],
        };
        let mut seen = 0_u32;
        for (batch, done) in batches.iter().zip((0..count).step_by(BATCH)) {
            let Located { at, slot } = locate(&grid, batch);
            let within = BATCH.min(count - done);
            for (at, slot) in at[..within].iter().zip(&slot[..within]) {
                let (at, slot) = (usize::from(*at), usize::from(*slot) % (2 * PLACES));
                let i = i.get(at..).and_then(|part| part.first_chunk::<LANES>());
                let q = q.get(at..).and_then(|part| part.first_chunk::<LANES>());
                let (Some(i), Some(q)) = (i, q) else {
                    break;
                };
                add(&mut self.windows[slot].i, i);
                add(&mut self.windows[slot].q, q);
                seen |= 1 << slot;
            }
        }
        self.turn_windows::<LANES>(seen, turn);
    }

    /// Empties the windows that are `seen`, turned by `turn`.
    #[inline(always)]
    fn turn_windows<const LANES: usize>(&mut self, mut seen: u32, turn: Complex64) {
        self.seen |= seen;
        let (re, im) = (turn.re as f32, turn.im as f32);
        let (windows, _) = self.windows.as_chunks_mut::<2>();
        while seen != 0 {
            let place = seen.trailing_zeros() as usize / 2 % PLACES;
            seen &= !(3 << (2 * place));
            // Copied, so that the compiler need not ask whether sums and windows overlap.
            let [to_0, to_1] = windows[place];
            windows[place] = [EMPTY; 2];
            let (i, q) = (difference(&to_1.i, &to_0.i), difference(&to_1.q, &to_0.q));
            let turned = &mut self.turned[place];
            for lane in 0..LANES {
                turned.re[lane] += i[lane] * re - q[lane] * im;
                turned.im[lane] += i[lane] * im + q[lane] * re;
            }
        }
    }

    /// Takes from the sum of the earliest tap, which all `sums` hold, the changes that the others have not come to yet.
    pub(super) fn finish(&self, sums: &mut [Complex64]) {
        // Lanes of all windows, then those before each.
        let mut re = [0.0; MOST_LANES];
        let mut im = [0.0; MOST_LANES];
        for place in (0..PLACES).filter(|place| self.seen >> (2 * place) & 3 != 0) {
            let turned = &self.turned[place];
            for lane in 0..MOST_LANES {
                re[lane] += f64::from(turned.re[lane]);
                im[lane] += f64::from(turned.im[lane]);
            }
        }
        let mut before = [Complex64::default(); MOST_LANES];
        for lane in 1..self.lanes {
            before[lane] = before[lane - 1] + Complex64::new(re[lane - 1], im[lane - 1]);
        }
        for ((sum, whole), limit) in sums.iter_mut().zip(self.whole).zip(self.limits) {
            let Some(last) = usize::from(whole).checked_sub(1) else {
                continue;
            };
            // The last of its samples it takes where its limit is not passed.
            let lower = self.limits.iter().filter(|other| **other < limit).count();
            let taken = self.turned[..=lower].iter().map(|turned| turned.at(last));
            *sum -= before[last] + taken.sum::<Complex64>();
        }
    }
}

/// Fits 16 bits: a chunk has fewer than 256 chips where windows are taken.
#[inline(always)]
fn difference(a: &[i16; MOST_LANES], b: &[i16; MOST_LANES]) -> [f32; MOST_LANES] {
    std::array::from_fn(|lane| f32::from(a[lane].wrapping_sub(b[lane])))
}

/// Fits 16 bits (see [`difference`]).
#[inline(always)]
fn add<const LANES: usize>(sums: &mut [i16; MOST_LANES], samples: &[i8; LANES]) {
    for (sum, sample) in sums.iter_mut().zip(samples) {
        *sum = sum.wrapping_add(i16::from(*sample));
    }
}

#[cfg(test)]
pub(super) mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Holds a vector form of [`Grid::locate`] against it.
    pub(in crate::correlator) fn is_located_as_in_plain_rust<const BATCH: usize>(
        locate: impl Fn(&Grid<'_>, &[u16; BATCH]) -> Located<BATCH>,
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..2000 {
            let limits: [i16; 11] = std::array::from_fn(|_| rng.random_range(0..4096));
            let first_chip = rng.random_range(0..1030);
            let grid = Grid {
                first_chip,
                origin: rng.random_range(32 << 16..130 << 16),
                chip_samples: rng.random_range(5 << 16..32 << 16),
                rest: rng.random(),
                limits: &limits,
            };
            let batch =
                std::array::from_fn(|_| rng.random_range(2 * first_chip..2 * first_chip + 400));
            assert_eq!(
                locate(&grid, &batch),
                grid.locate(&batch),
                "{grid:?} {batch:?}"
            );
        }
    }
}
