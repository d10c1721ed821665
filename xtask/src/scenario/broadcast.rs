//! The message of a satellite in a scenario: its bits, what is wrong in them and since when.

use anyhow::Result;
use gnss_nav::constants::{MU_M3_PER_S2, SPEED_OF_LIGHT_MPS};
use gnss_nav::lnav::{SUBFRAME_S, quantise};
use gnss_nav::{Ephemeris, GpsTime};

use super::fault::Span;
use super::message::{BitStream, Message};

/// Bits in a second.
const BITS_PER_SECOND: u64 = 50;

/// Errors of single bits.
#[derive(Debug, Clone, PartialEq)]
pub struct BitErrors {
    /// When, s after the start.
    pub span: Span,
    /// Of each bit.
    pub probability: f64,
}

/// What a satellite broadcasts.
#[derive(Debug, Clone)]
pub struct Broadcast {
    start: GpsTime,
    bits: BitStream,
    /// What is sent from an instant on, s after the start.
    later: Option<(f64, BitStream)>,
    errors: Vec<BitErrors>,
    seed: u64,
}

impl Broadcast {
    /// Broadcasts `message`, and from the first subframe at or after `later` (s after `start`)
    /// another one; single bits are wrong as `errors` say, drawn with `seed`.
    #[must_use]
    pub fn new(
        start: GpsTime,
        message: Message,
        later: Option<(f64, Message)>,
        errors: Vec<BitErrors>,
        seed: u64,
    ) -> Self {
        Self {
            start,
            bits: BitStream::new(message),
            later: later.map(|(at_s, message)| (at_s, BitStream::new(message))),
            errors,
            seed,
        }
    }

    /// Sign of bit `index` (0 to 49) of the second that begins at `second`: a one is negative.
    ///
    /// # Errors
    /// Where the message cannot be encoded.
    pub fn sign(&mut self, second: GpsTime, index: usize) -> Result<f32> {
        let into_subframe_s = second.second() % SUBFRAME_S as i32;
        let subframe_s = second - self.start - f64::from(into_subframe_s);
        let stream = match &mut self.later {
            Some((from_s, stream)) if subframe_s >= *from_s => stream,
            _ => &mut self.bits,
        };
        let sign = stream.sign(second, index)?;
        let time_s = second - self.start + index as f64 / BITS_PER_SECOND as f64;
        let active = self.errors.iter().filter(|e| e.span.contains(time_s));
        let probability = active.map(|e| e.probability).fold(0.0, f64::max);
        let bit = second.second() as u64 * BITS_PER_SECOND + index as u64;
        let wrong = probability > 0.0 && uniform(self.seed, bit) < probability;
        Ok(if wrong { -sign } else { sign })
    }
}

/// `ephemeris` with the satellite ahead on its orbit, further out and its clock ahead, m, under
/// another issue of data.
///
/// # Errors
/// Where LNAV cannot hold it.
pub fn wrong(
    ephemeris: &Ephemeris,
    along_m: f64,
    radial_m: f64,
    clock_m: f64,
) -> Result<Ephemeris> {
    let axis_m = ephemeris.sqrt_a * ephemeris.sqrt_a;
    let mean_motion_rad_s = |axis_m: f64| (MU_M3_PER_S2 / axis_m.powi(3)).sqrt();
    let issue = ephemeris.iode ^ 0x80;
    Ok(quantise(&Ephemeris {
        iode: issue,
        iodc: issue.into(),
        m0_rad: ephemeris.m0_rad + along_m / axis_m,
        sqrt_a: (axis_m + radial_m).sqrt(),
        // It goes round in the same time.
        delta_n_rad_s: ephemeris.delta_n_rad_s + mean_motion_rad_s(axis_m)
            - mean_motion_rad_s(axis_m + radial_m),
        af0_s: ephemeris.af0_s + clock_m / SPEED_OF_LIGHT_MPS,
        ..*ephemeris
    })?)
}

/// A number in [0, 1) that depends on `seed` and `counter` alone (SplitMix64, `Steele2014`).
fn uniform(seed: u64, counter: u64) -> f64 {
    let mut z = seed.wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use gnss_nav::lnav::LnavEncoder;

    use super::*;
    use crate::scenario::constellation::nominal;

    fn message(start: GpsTime, satellite: usize) -> Message {
        Message::Lnav(Box::new(
            LnavEncoder::new(&nominal(start).unwrap()[satellite]).unwrap(),
        ))
    }

    #[test]
    fn a_wrong_ephemeris_is_wrong_by_what_was_asked() {
        let start = GpsTime::new(2350, 392_400.0);
        let right = nominal(start).unwrap()[5];
        let wrong = wrong(&right, 300.0, 100.0, 30.0).unwrap();
        for time_s in [0.0, 600.0] {
            let (a, b) = (
                right.state_at(start + time_s).unwrap(),
                wrong.state_at(start + time_s).unwrap(),
            );
            let error = b.position_ecef_m - a.position_ecef_m;
            let out = a.position_ecef_m.normalize();
            // LNAV resolves 0.05 m of axis and 0.02 m along the orbit; 2^-43 semicircles/s add
            // up to centimetres.
            assert!((error.dot(&out) - 100.0).abs() < 1.0);
            assert!((error.norm() - 316.2).abs() < 2.0);
            let clock_m = (b.clock_bias_s - a.clock_bias_s) * SPEED_OF_LIGHT_MPS;
            assert!((clock_m - 30.0).abs() < 0.2);
        }
    }

    fn differences(a: &mut Broadcast, b: &mut Broadcast, seconds: std::ops::Range<i32>) -> usize {
        let start = a.start;
        let bit = |k: i32| (start + f64::from(k / 50), (k % 50) as usize);
        let bits = (seconds.start * 50..seconds.end * 50).map(bit);
        bits.filter(|&(second, index)| {
            a.sign(second, index).unwrap() != b.sign(second, index).unwrap()
        })
        .count()
    }

    #[test]
    fn another_message_comes_with_a_subframe() {
        let start = GpsTime::new(2350, 392_403.0);
        let mut plain = Broadcast::new(start, message(start, 0), None, vec![], 0);
        let later = Some((10.0, message(start, 1)));
        let mut changed = Broadcast::new(start, message(start, 0), later, vec![], 0);
        // Subframes begin at 392 400, 406, 412, 418: the first after 10 s begins at 15 s. It and
        // the next are pages that all satellites share; ephemerides come at 27 s.
        assert_eq!(differences(&mut plain, &mut changed, 0..27), 0);
        assert_ne!(differences(&mut plain, &mut changed, 27..45), 0);
        let early = Some((3.0, message(start, 1)));
        let mut changed = Broadcast::new(start, message(start, 0), early, vec![], 0);
        assert_eq!(differences(&mut plain, &mut changed, 0..3), 0);
        assert_ne!(differences(&mut plain, &mut changed, 3..15), 0);
    }

    #[test]
    fn bits_are_wrong_as_often_as_said() {
        let start = GpsTime::new(2350, 392_400.0);
        let errors = vec![BitErrors {
            span: Span {
                begin_s: 10.0,
                end_s: Some(110.0),
                ramp_s: 0.0,
            },
            probability: 0.1,
        }];
        let mut plain = Broadcast::new(start, message(start, 0), None, vec![], 0);
        let mut wrong = Broadcast::new(start, message(start, 0), None, errors, 9);
        assert_eq!(differences(&mut plain, &mut wrong, 0..10), 0);
        assert_eq!(differences(&mut plain, &mut wrong, 110..120), 0);
        // 5000 bits: 500 with a deviation of 21.
        let count = differences(&mut plain, &mut wrong, 10..110);
        assert!((415..585).contains(&count), "{count}");
    }
}
