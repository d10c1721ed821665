//! The last seconds of a stream of samples, as compact as they came.

use super::{
    SampleDescription, SampleSource,
    unpack::Unpacker,
    wide::{GAIN_CHUNK_SAMPLES, WideReader},
};
use crate::SignalError;

/// Most bytes asked of a source at a time.
const READ_BYTES: usize = 1 << 16;

/// Sample rates that make sense, Hz.
const SAMPLE_RATES_HZ: std::ops::RangeInclusive<f64> = 1e3..=1e9;

/// History that makes sense, s.
const HISTORIES_S: std::ops::RangeInclusive<f64> = 0.0..=60.0;

/// Reads a [`SampleSource`] and holds its last samples in bounded memory.
///
/// Packed samples stay packed, 8-bit ones stay as they are, wider ones are held as 8 bits
/// (see [`SampleFormat`](super::SampleFormat)). The memory is reserved once and touched only as far as samples come in. A
/// partial sample at the end of the stream is dropped.
#[derive(Debug)]
pub struct SampleRing<S> {
    source: S,
    description: SampleDescription,
    unpacker: Unpacker,
    bits_per_sample: u64,
    bytes: Box<[u8]>,
    stored_bytes: u64,
    ended: bool,
    wide: Option<WideReader>,
}

impl<S: SampleSource> SampleRing<S> {
    /// A ring that holds at least the last `history_s` seconds of `source`.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] unless the sample rate is 1 kHz to 1 GHz, the intermediate
    /// frequency finite, and the history 0 to 60 s.
    pub fn new(source: S, history_s: f64) -> Result<Self, SignalError> {
        let description = source.description();
        check(&description, history_s)?;
        let component = description.format.component();
        let stored_bits = component.bits().min(8) * description.format.components();
        let history_samples = (description.sample_rate_hz * history_s).ceil() as usize;
        // Room for what reading may run ahead of the tick asked for.
        let samples = history_samples + 2 * GAIN_CHUNK_SAMPLES;
        let capacity = (samples * stored_bits).div_ceil(8).next_multiple_of(8);
        let wide = WideReader::new(component, description.format.components());
        Ok(Self {
            source,
            description,
            unpacker: Unpacker::new(description.format, description.swap_iq),
            bits_per_sample: stored_bits as u64,
            bytes: vec![0; capacity].into_boxed_slice(),
            stored_bytes: 0,
            ended: false,
            wide,
        })
    }

    /// How the source describes its samples.
    #[must_use]
    pub const fn description(&self) -> SampleDescription {
        self.description
    }

    /// Oldest tick held.
    #[must_use]
    pub const fn oldest_tick(&self) -> u64 {
        let oldest_byte = self.stored_bytes.saturating_sub(self.bytes.len() as u64);
        (oldest_byte * 8).div_ceil(self.bits_per_sample)
    }

    /// End of the ticks held (exclusive).
    #[must_use]
    pub const fn newest_tick(&self) -> u64 {
        self.stored_bytes * 8 / self.bits_per_sample
    }

    /// Reads until `tick` (exclusive) is held or the source ends, and returns the end of the ticks
    /// held. A little more than asked for is read where samples share bytes or a gain.
    ///
    /// # Errors
    /// [`SignalError::Read`] where the source fails, [`SignalError::NotFinite`] at a sample that
    /// is no number.
    pub fn advance_to(&mut self, tick: u64) -> Result<u64, SignalError> {
        while self.newest_tick() < tick && !self.ended {
            if self.wide.is_some() {
                self.read_wide()?;
            } else {
                self.read_stored(tick)?;
            }
        }
        Ok(self.newest_tick())
    }

    /// Appends the values of the samples from `start_tick` to `end_tick` (exclusive), I and Q
    /// interleaved where complex.
    ///
    /// # Errors
    /// [`SignalError::NotHeld`] unless all of them are held.
    pub fn unpack(
        &self,
        start_tick: u64,
        end_tick: u64,
        out: &mut Vec<i8>,
    ) -> Result<(), SignalError> {
        let (oldest, newest) = (self.oldest_tick(), self.newest_tick());
        if start_tick < oldest || end_tick > newest || start_tick > end_tick {
            return Err(SignalError::NotHeld {
                start: start_tick,
                end: end_tick,
                oldest,
                newest,
            });
        }
        let components = self.description.format.components() as u64;
        let per_byte = self.unpacker.values_per_byte() as u64;
        let (first_value, end_value) = (start_tick * components, end_tick * components);
        let first = out.len();
        self.append_bytes(first_value / per_byte, end_value.div_ceil(per_byte), out);
        out.drain(first..first + (first_value % per_byte) as usize);
        out.truncate(first + (end_value - first_value) as usize);
        Ok(())
    }

    fn append_bytes(&self, first_byte: u64, end_byte: u64, out: &mut Vec<i8>) {
        let mut at = first_byte;
        while at < end_byte {
            let start = self.position(at);
            let len = (self.bytes.len() - start).min((end_byte - at) as usize);
            self.unpacker.append(&self.bytes[start..start + len], out);
            at += len as u64;
        }
    }

    fn position(&self, stream_byte: u64) -> usize {
        (stream_byte % self.bytes.len() as u64) as usize
    }

    /// One read straight into the ring.
    fn read_stored(&mut self, tick: u64) -> Result<(), SignalError> {
        let wanted = tick.saturating_mul(self.bits_per_sample).div_ceil(8) - self.stored_bytes;
        let start = self.position(self.stored_bytes);
        let len = (self.bytes.len() - start)
            .min(READ_BYTES)
            .min(wanted as usize);
        let read = self.source.read(&mut self.bytes[start..start + len])?;
        self.stored_bytes += read as u64;
        self.ended = read == 0;
        Ok(())
    }
    /// One gain chunk, reduced and copied into the ring.
    fn read_wide(&mut self) -> Result<(), SignalError> {
        let start_tick = self.newest_tick();
        let Some(wide) = &mut self.wide else {
            return Ok(());
        };
        let chunk = wide.next_chunk(&mut self.source, start_tick)?;
        let capacity = self.bytes.len();
        let start = (self.stored_bytes % capacity as u64) as usize;
        let (head, tail) = chunk.split_at(chunk.len().min(capacity - start));
        self.bytes[start..start + head.len()].copy_from_slice(head);
        self.bytes[..tail.len()].copy_from_slice(tail);
        self.stored_bytes += chunk.len() as u64;
        self.ended = chunk.len() as u64 * 8 < GAIN_CHUNK_SAMPLES as u64 * self.bits_per_sample;
        Ok(())
    }
}

fn check(description: &SampleDescription, history_s: f64) -> Result<(), SignalError> {
    let out_of_range = |name, value: f64, expected| {
        Err(SignalError::Parameter {
            name,
            value: value.to_string(),
            expected,
        })
    };
    let rate_hz = description.sample_rate_hz;
    let if_hz = description.intermediate_frequency_hz;
    if !SAMPLE_RATES_HZ.contains(&rate_hz) {
        return out_of_range("sample rate (Hz)", rate_hz, "1e3 to 1e9");
    }
    if !if_hz.is_finite() {
        return out_of_range("intermediate frequency (Hz)", if_hz, "a finite number");
    }
    if !HISTORIES_S.contains(&history_s) {
        return out_of_range("sample history (s)", history_s, "0 to 60");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::{self, Read};

    use proptest::prelude::*;

    use super::*;
    use crate::sample::{ReaderSource, SampleFormat};

    /// Hands out its bytes in pieces of changing size.
    struct Trickle<'a>(&'a [u8], usize);

    impl Read for Trickle<'_> {
        fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
            self.1 = self.1 * 5 % 251 + 1;
            let len = self.1.min(out.len());
            self.0.read(&mut out[..len])
        }
    }

    fn description(format: SampleFormat, swap_iq: bool) -> SampleDescription {
        SampleDescription {
            format,
            sample_rate_hz: 1e6,
            intermediate_frequency_hz: 0.0,
            swap_iq,
        }
    }

    fn ring<R: Read>(reader: R, format: SampleFormat) -> SampleRing<ReaderSource<R>> {
        SampleRing::new(ReaderSource::new(reader, description(format, false)), 0.01).unwrap()
    }

    fn values(bytes: &[u8], name: &str, swap_iq: bool) -> Vec<i8> {
        let source = ReaderSource::new(bytes, description(name.parse().unwrap(), swap_iq));
        let mut ring = SampleRing::new(source, 0.1).unwrap();
        let end = ring.advance_to(u64::MAX).unwrap();
        let mut out = Vec::new();
        ring.unpack(0, end, &mut out).unwrap();
        out
    }

    #[test]
    fn every_format_has_the_values_it_documents() {
        assert_eq!(values(&[0x80, 0xff, 0, 5], "ri8", false), [-127, -1, 0, 5]);
        assert_eq!(values(&[0, 128, 255], "ru8", false), [-127, 0, 127]);
        assert_eq!(values(&[1, 0xfe, 3], "ci8", false), [1, -2]);
        assert_eq!(values(&[1, 2, 3, 4], "ci8", true), [2, 1, 4, 3]);
        assert_eq!(values(&[129, 127], "cu8", true), [-1, 1]);
        assert_eq!(
            values(&[0b1010_0001], "r1_msb", false),
            [1, -1, 1, -1, -1, -1, -1, 1]
        );
        assert_eq!(
            values(&[0b1010_0001], "r1_lsb", false),
            [1, -1, -1, -1, -1, 1, -1, 1]
        );
        assert_eq!(
            values(&[0b1010_0001], "c1_msb", true),
            [-1, 1, -1, 1, -1, -1, 1, -1]
        );
        assert_eq!(values(&[0b1110_0100], "r2_lsb", false), [1, 3, -3, -1]);
        assert_eq!(values(&[0b1110_0100], "r2_msb", true), [-1, -3, 3, 1]);
        assert_eq!(values(&[0b1110_0100], "r2sm_lsb", false), [1, 3, -1, -3]);
        assert_eq!(values(&[0b1110_0100], "r2sm_msb", false), [-3, -1, 3, 1]);
        // 16 counts are 28 / 16 = 2^0.8 below the target: the gain is 2^0.75.
        assert_eq!(values(&[16, 0, 0xf0, 0xff, 9], "ri16_le", false), [27, -27]);
    }

    #[test]
    fn a_sample_that_is_no_number_is_named() {
        let mut bytes: Vec<u8> = [0.5_f32; 10_000]
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        bytes[4 * 9001..4 * 9002].copy_from_slice(&f32::NAN.to_le_bytes());
        let mut ring = ring(bytes.as_slice(), SampleFormat::Cf32Le);
        let error = ring.advance_to(u64::MAX).unwrap_err();
        assert!(
            matches!(error, SignalError::NotFinite { tick: 4500 }),
            "{error}"
        );
    }

    #[test]
    fn old_samples_are_given_up_and_said_so() {
        let bytes = vec![7; 60_000];
        let mut ring = ring(bytes.as_slice(), SampleFormat::Ri8);
        assert_eq!(ring.advance_to(50_000).unwrap(), 50_000);
        assert!((50_000 - 20_000..=50_000 - 10_000).contains(&ring.oldest_tick()));
        let mut out = Vec::new();
        assert!(matches!(
            ring.unpack(0, 10, &mut out),
            Err(SignalError::NotHeld { newest: 50_000, .. })
        ));
        assert!(ring.unpack(49_999, 50_001, &mut out).is_err());
        assert_eq!(ring.advance_to(70_000).unwrap(), 60_000);
    }

    #[test]
    fn absurd_descriptions_are_refused() {
        for (rate, frequency, history) in [
            (0.0, 0.0, 1.0),
            (f64::NAN, 0.0, 1.0),
            (1e6, f64::INFINITY, 1.0),
            (1e6, 0.0, -1.0),
        ] {
            let description = SampleDescription {
                sample_rate_hz: rate,
                intermediate_frequency_hz: frequency,
                ..description(SampleFormat::Ci8, false)
            };
            let source = ReaderSource::new(io::empty(), description);
            assert!(SampleRing::new(source, history).is_err());
        }
    }

    proptest! {
        #[test]
        fn values_do_not_depend_on_how_the_stream_is_read(
            bytes in proptest::collection::vec(any::<u8>(), 0..40_000),
            format in proptest::sample::select(&SampleFormat::ALL[..]),
            step in 1_u64..3000,
        ) {
            // Floats of arbitrary bytes are mostly not finite; they have their own test.
            prop_assume!(!format.name().contains("f32"));
            let expected = values(&bytes[..bytes.len().min(9000)], format.name(), false);
            let mut ring = ring(Trickle(&bytes[..bytes.len().min(9000)], 1), format);
            let (mut tick, mut out) = (0, Vec::new());
            loop {
                let next = ring.advance_to(tick + step).unwrap();
                if next == tick {
                    break;
                }
                ring.unpack(tick, next, &mut out).unwrap();
                tick = next;
            }
            prop_assert_eq!(out.len() as u64, tick * format.components() as u64);
            prop_assert_eq!(out, expected);
        }

        #[test]
        fn any_window_is_a_part_of_the_whole(
            bytes in proptest::collection::vec(any::<u8>(), 100..200),
            format in proptest::sample::select(&SampleFormat::ALL[..]),
            a in 0_u64..100,
            b in 0_u64..100,
        ) {
            prop_assume!(!format.name().contains("f32"));
            let mut ring = ring(bytes.as_slice(), format);
            let newest = ring.advance_to(u64::MAX).unwrap();
            let (start, end) = (a.min(b).min(newest), a.max(b).min(newest));
            let (mut all, mut part) = (Vec::new(), vec![99]);
            ring.unpack(0, newest, &mut all).unwrap();
            ring.unpack(start, end, &mut part).unwrap();
            let components = format.components();
            let range = start as usize * components..end as usize * components;
            prop_assert_eq!(&part[1..], &all[range]);
        }
    }
}
