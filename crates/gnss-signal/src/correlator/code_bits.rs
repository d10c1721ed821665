//! Ranging codes as the kernels read them.

use std::sync::LazyLock;

use crate::{CA_CODE_LENGTH_CHIPS, Signal, SignalId, ranging_code};

/// Chips beyond a period that the kernels may read: those of a chunk, then a window.
pub(super) const AHEAD_CHIPS: usize = 1024 + 256;

/// A ranging code, 1 where the chip is +1 and 0 where it is -1, continued into the next period so
/// that windows from all chips of a chunk that begins in the first are contiguous.
pub(super) type CodeBits = [u8; CA_CODE_LENGTH_CHIPS + 1 + AHEAD_CHIPS];

static CA_CODE_BITS: LazyLock<Vec<CodeBits>> = LazyLock::new(|| {
    let spec = Signal::GpsL1Ca.spec();
    (spec.first_prn..=spec.last_prn)
        .filter_map(|prn| SignalId::new(Signal::GpsL1Ca, prn).ok())
        .map(|signal| {
            let code = ranging_code(signal);
            std::array::from_fn(|chip| u8::from(code[chip % CA_CODE_LENGTH_CHIPS] > 0))
        })
        .collect()
});

/// The code of `signal`.
pub(super) fn code_bits(signal: SignalId) -> &'static CodeBits {
    &CA_CODE_BITS[usize::from(signal.prn() - signal.spec().first_prn)]
}
