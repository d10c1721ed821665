//! The data bits on a signal.

use anyhow::Result;
use gnss_nav::GpsTime;
use gnss_nav::lnav::{LnavEncoder, SUBFRAME_BITS, SUBFRAME_S};

/// What a signal carries.
#[derive(Debug, Clone)]
pub enum Message {
    /// The navigation message of GPS L1 C/A.
    Lnav(Box<LnavEncoder>),
    /// No data.
    Unmodulated,
}

/// Bits of a message in time, with the present subframe at hand.
#[derive(Debug, Clone)]
pub struct BitStream {
    message: Message,
    present: Option<(i32, u32, [bool; SUBFRAME_BITS])>,
}

impl BitStream {
    /// The bits of `message`.
    #[must_use]
    pub const fn new(message: Message) -> Self {
        Self {
            message,
            present: None,
        }
    }

    /// Sign of bit `index` (0 to 49) of the second that begins at `second`: a one is negative.
    ///
    /// # Errors
    /// Where the message cannot be encoded.
    pub fn sign(&mut self, second: GpsTime, index: usize) -> Result<f32> {
        let Message::Lnav(encoder) = &self.message else {
            return Ok(1.0);
        };
        let number = second.second() as u32 / SUBFRAME_S;
        let bits = match self.present {
            Some((week, subframe, bits)) if (week, subframe) == (second.week(), number) => bits,
            _ => {
                let bits = encoder.subframe(second)?;
                self.present = Some((second.week(), number, bits));
                bits
            }
        };
        let into = (second.second() as u32 % SUBFRAME_S) as usize * 50 + index;
        Ok(if bits[into] { -1.0 } else { 1.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::constellation::nominal;

    #[test]
    fn bits_are_those_of_the_encoder() {
        let start = GpsTime::new(2350, 604_790.0);
        let encoder = LnavEncoder::new(&nominal(start).unwrap()[0]).unwrap();
        let mut stream = BitStream::new(Message::Lnav(Box::new(encoder.clone())));
        // Across the end of the week.
        for second in 0..20 {
            let time = start + f64::from(second);
            for index in [0, 1, 17, 49] {
                let expected = encoder.bit_at(time + (index as f64 + 0.5) * 0.02).unwrap();
                let sign = if expected { -1.0 } else { 1.0 };
                assert_eq!(stream.sign(time, index).unwrap(), sign);
            }
        }
    }
}
