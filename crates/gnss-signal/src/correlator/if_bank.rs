//! A correlator bank over intermediate-frequency samples.

use super::{Correlator, InstructionSet};
use crate::{
    AcquisitionEngine, CorrelatorBank, FrontEnd, Replica, SearchReport, SearchRequest, SignalError,
    Taps,
    sample::{SampleRing, SampleSource},
};

mod window;

use window::SampleWindow;

/// Correlates and searches the samples of one source.
///
/// The last 40 ms are kept unpacked and shared by all channels; older samples, down to the end of
/// the ring, are unpacked for each interval that asks for them.
pub struct IfCorrelatorBank<S> {
    ring: SampleRing<S>,
    front_end: FrontEnd,
    correlator: Correlator,
    window: SampleWindow,
    /// Samples from before the window.
    older: Vec<i8>,
    acquisition: AcquisitionEngine,
}

impl<S: SampleSource> IfCorrelatorBank<S> {
    /// A bank that holds at least the last `history_s` seconds of `source`.
    ///
    /// # Errors
    /// [`SignalError::Parameter`] where the description of the source or `history_s` makes no
    /// sense, or this processor lacks `instruction_set`.
    pub fn new(
        source: S,
        history_s: f64,
        instruction_set: InstructionSet,
    ) -> Result<Self, SignalError> {
        let ring = SampleRing::new(source, history_s)?;
        let front_end = ring.description().front_end();
        Ok(Self {
            ring,
            front_end,
            correlator: Correlator::new(front_end, instruction_set)?,
            window: SampleWindow::new(front_end),
            older: Vec::new(),
            acquisition: AcquisitionEngine::new(front_end)?,
        })
    }

    /// Spreads searches over up to `threads` threads; what is found does not depend on it.
    #[must_use]
    pub fn with_search_threads(mut self, threads: usize) -> Self {
        self.acquisition = self.acquisition.with_threads(threads);
        self
    }

    fn correlate_one(&mut self, replica: &Replica) -> Result<Taps, SignalError> {
        let (start, end) = (replica.start_tick, replica.end_tick);
        if let Some((samples, power)) = self.window.get(start, end) {
            return self.correlator.correlate(samples, power, replica);
        }
        self.older.clear();
        self.ring.unpack(start, end, &mut self.older)?;
        let power = mean_square(&self.older, end - start);
        self.correlator.correlate(&self.older, power, replica)
    }
}

impl<S: SampleSource> CorrelatorBank for IfCorrelatorBank<S> {
    fn front_end(&self) -> FrontEnd {
        self.front_end
    }

    fn advance_to(&mut self, tick: u64) -> Result<u64, SignalError> {
        let newest = self.ring.advance_to(tick)?;
        self.window.follow(&self.ring)?;
        Ok(newest)
    }

    fn oldest_tick(&self) -> u64 {
        self.ring.oldest_tick()
    }

    fn correlate(&mut self, replicas: &[Replica], taps: &mut Vec<Taps>) -> Result<(), SignalError> {
        taps.clear();
        for replica in replicas {
            taps.push(self.correlate_one(replica)?);
        }
        Ok(())
    }

    fn search(&mut self, request: &SearchRequest) -> Result<SearchReport, SignalError> {
        let needed = AcquisitionEngine::samples_needed(self.front_end, request);
        // Where the source ends early the engine makes do with what there is.
        let end = request.start_tick.saturating_add(needed);
        let end = end.min(self.ring.newest_tick().max(request.start_tick));
        let mut samples = Vec::new();
        self.ring.unpack(request.start_tick, end, &mut samples)?;
        self.acquisition.search(&samples, request)
    }
}

/// Sum of the squares of `values`.
fn square_sum(values: &[i8]) -> u64 {
    let part = |values: &[i8]| -> u32 {
        values
            .iter()
            .map(|&v| u32::from((i16::from(v) * i16::from(v)) as u16))
            .sum()
    };
    // 4096 squares of at most 2^14 fit 32 bits.
    values
        .chunks(4096)
        .map(|chunk| u64::from(part(chunk)))
        .sum()
}

/// Mean square of `ticks` samples; zero where there are none.
fn mean_square(values: &[i8], ticks: u64) -> f64 {
    square_sum(values) as f64 / ticks.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        SignalId, TapOffsets,
        sample::{ReaderSource, SampleDescription, SampleFormat},
    };

    const RATE_HZ: f64 = 2.6e6;

    fn bytes(count: usize) -> Vec<u8> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        (0..count).map(|_| next()).collect()
    }

    fn bank(bytes: &[u8]) -> IfCorrelatorBank<ReaderSource<&[u8]>> {
        let description = SampleDescription {
            format: SampleFormat::C1Msb,
            sample_rate_hz: RATE_HZ,
            intermediate_frequency_hz: 0.0,
            swap_iq: false,
        };
        let source = ReaderSource::new(bytes, description);
        IfCorrelatorBank::new(source, 0.2, InstructionSet::detect()).unwrap()
    }

    fn replica(start_tick: u64, end_tick: u64) -> Replica {
        Replica {
            signal: SignalId::gps_l1_ca(9).unwrap(),
            start_tick,
            end_tick,
            code_phase_chips: 77.7,
            code_rate_hz: 1.023e6,
            carrier_phase_cycles: 0.3,
            carrier_frequency_hz: 1234.0,
            tap_offsets: TapOffsets::early_prompt_late(0.5),
        }
    }

    #[test]
    fn sums_do_not_depend_on_where_the_samples_are_held() {
        let bytes = bytes(200_000);
        let (mut early, mut late) = (bank(&bytes), bank(&bytes));
        let replicas = [replica(100_001, 102_607), replica(130_000, 182_000)];
        let (mut from_window, mut from_ring) = (Vec::new(), Vec::new());
        for tick in (0..190_000).step_by(2_613) {
            early.advance_to(tick).unwrap();
        }
        early.correlate(&replicas, &mut from_window).unwrap();
        late.advance_to(600_000).unwrap();
        late.correlate(&replicas, &mut from_ring).unwrap();
        assert_eq!(from_window, from_ring);
        assert_eq!(from_window[0].samples, 2_606);
        // One bit for each of I and Q: |x|^2 is always 2.
        assert_eq!(from_window[0].sample_power, 2.0);
    }

    #[test]
    fn what_is_not_held_is_an_error() {
        let bytes = bytes(400_000);
        let mut bank = bank(&bytes);
        bank.advance_to(1_000_000).unwrap();
        let mut taps = Vec::new();
        for (start, end) in [(0, 2_600), (999_000, 1_000_100), (990_000, 980_000)] {
            let result = bank.correlate(&[replica(start, end)], &mut taps);
            assert!(matches!(result, Err(SignalError::NotHeld { .. })));
        }
        assert!(bank.oldest_tick() > 400_000);
    }
}
