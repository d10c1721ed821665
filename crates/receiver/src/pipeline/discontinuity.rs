//! Samples lost or repeated: all signals vanish at once and are found again, shifted alike.

use gnss_signal::{AcquisitionHit, CorrelatorBank, Replica, SearchRequest, Taps, default_search};

use super::settings::Settings;
use super::slot::Slot;
use crate::ReceiverError;

/// A jump of the samples.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Jump {
    /// First tick after the jump, to a millisecond.
    pub(super) tick: u64,
    /// Seconds by which the code jumped, modulo a code period; above zero: samples are missing.
    pub(super) jump_s: f64,
    /// Channels that agree.
    pub(super) channels: usize,
    /// Where every signal is now.
    pub(super) hits: Vec<AcquisitionHit>,
}

/// How far back a fade can lie to be looked into, s; longer ones are outages.
const MEMORY_S: f64 = 0.06;
/// Samples needed after the jump, s, to find the signals again.
const LEAST_AFTER_S: f64 = 0.004;
/// The shift at which signals count as jumped, and to which they agree, chips.
const LEAST_JUMP_CHIPS: f64 = 1.0;
/// Prompt among the taps of a channel.
const PROMPT: usize = 1;
/// Doppler range around the last one, Hz.
const HALF_WIDTH_HZ: f64 = 200.0;

/// Looks for a jump where most strong signals have just vanished together.
pub(super) fn find<B: CorrelatorBank>(
    bank: &mut B,
    slots: &[Slot],
    settings: &Settings,
    now: u64,
) -> Result<Option<Jump>, ReceiverError> {
    let rate_hz = bank.front_end().sample_rate_hz;
    let memory = (MEMORY_S * rate_hz) as u64;
    let strong = slots.iter().filter(|s| s.channel.is_strong()).count();
    let faded: Vec<(&Slot, u64)> = slots
        .iter()
        .filter_map(|s| Some((s, s.channel.faded_since()?)))
        .filter(|(_, since)| since + memory >= now)
        .collect();
    if faded.len() < 2 || 2 * faded.len() < strong {
        return Ok(None);
    }
    let Some(tick) = last_heard(bank, &faded, now)? else {
        return Ok(None);
    };
    if ((now - tick) as f64) < LEAST_AFTER_S * rate_hz {
        return Ok(None);
    }
    let hits = search_again(bank, &faded, settings, tick, now)?;
    Ok(agreement(&hits, slots, rate_hz, tick))
}

/// The tick at which the signals vanished, by sums of one code period along the old replicas.
fn last_heard<B: CorrelatorBank>(
    bank: &mut B,
    faded: &[(&Slot, u64)],
    now: u64,
) -> Result<Option<u64>, ReceiverError> {
    let period = bank.front_end().sample_rate_hz * 1e-3;
    let Some(first) = faded.iter().map(|(_, since)| *since).min() else {
        return Ok(None);
    };
    let start = first
        .saturating_sub((10.0 * period) as u64)
        .max(bank.oldest_tick());
    let count = ((now - start) as f64 / period) as usize;
    let mut power = vec![0.0; count];
    let mut taps: Vec<Taps> = Vec::new();
    for (slot, _) in faded {
        let Some(replica) = slot.channel.replica() else {
            continue;
        };
        let replicas: Vec<Replica> = (0..count)
            .map(|k| {
                let from = start + (k as f64 * period) as u64;
                moved(
                    &replica,
                    from,
                    from + period as u64,
                    bank.front_end().sample_rate_hz,
                )
            })
            .collect();
        bank.correlate(&replicas, &mut taps)?;
        for (sum, taps) in power.iter_mut().zip(&taps) {
            *sum += taps.as_slice().get(PROMPT).map_or(0.0, |s| s.norm_sqr());
        }
    }
    Ok(change_point(&power).map(|k| start + (k as f64 * period) as u64))
}

/// Index at which a series falls from its upper to its lower level.
fn change_point(power: &[f64]) -> Option<usize> {
    let highest = power.iter().copied().fold(0.0, f64::max);
    let level = highest / 3.0;
    let mut total = 0.0;
    let mut best = (0.0, None);
    for (k, p) in power.iter().enumerate() {
        total += p - level;
        if total > best.0 {
            best = (total, Some(k + 1));
        }
    }
    best.1
}

/// The same oscillators over another interval.
fn moved(replica: &Replica, start_tick: u64, end_tick: u64, rate_hz: f64) -> Replica {
    let elapsed_s = (start_tick as f64 - replica.start_tick as f64) / rate_hz;
    let length = f64::from(replica.signal.spec().code_length_chips);
    let phase = (replica.code_phase_chips + replica.code_rate_hz * elapsed_s).rem_euclid(length);
    let carrier = replica.carrier_phase_cycles + replica.carrier_frequency_hz * elapsed_s;
    Replica {
        start_tick,
        end_tick,
        code_phase_chips: if phase < length { phase } else { 0.0 },
        carrier_phase_cycles: carrier.rem_euclid(1.0),
        ..*replica
    }
}

fn search_again<B: CorrelatorBank>(
    bank: &mut B,
    faded: &[(&Slot, u64)],
    settings: &Settings,
    tick: u64,
    now: u64,
) -> Result<Vec<AcquisitionHit>, ReceiverError> {
    // A period more than searched is needed, and the change point is only good to one.
    let start_tick = tick + (1e-3 * bank.front_end().sample_rate_hz) as u64;
    let held_ms = (now - start_tick) as f64 / bank.front_end().sample_rate_hz * 1e3;
    let (coherent_periods, noncoherent_sums) = default_search((held_ms as u32).saturating_sub(1));
    let mut hits = Vec::new();
    for (slot, _) in faded {
        let request = SearchRequest {
            signals: vec![slot.channel.signal()],
            start_tick,
            doppler_centre_hz: slot.channel.doppler_hz(),
            doppler_half_width_hz: HALF_WIDTH_HZ,
            coherent_periods,
            noncoherent_sums,
            false_alarm_probability: settings.false_alarm_probability,
        };
        hits.extend(bank.search(&request)?.hits);
    }
    Ok(hits)
}

/// The jump on which most of the signals found agree.
fn agreement(hits: &[AcquisitionHit], slots: &[Slot], rate_hz: f64, tick: u64) -> Option<Jump> {
    let shifts: Vec<f64> = hits
        .iter()
        .filter_map(|hit| {
            let slot = slots.iter().find(|s| s.channel.signal() == hit.signal)?;
            let expected = moved(&slot.channel.replica()?, hit.tick, hit.tick + 1, rate_hz);
            Some(wrapped(hit.code_phase_chips - expected.code_phase_chips))
        })
        .collect();
    let near = |a: f64| {
        let close = |b: &&f64| wrapped(**b - a).abs() < LEAST_JUMP_CHIPS;
        shifts.iter().filter(close).count()
    };
    let shift = shifts.iter().copied().max_by_key(|s| near(*s))?;
    let channels = near(shift);
    if channels < 2 || 2 * channels < shifts.len() || shift.abs() < LEAST_JUMP_CHIPS {
        return None;
    }
    let start = hits.first()?.tick;
    let now = slots
        .iter()
        .filter_map(|slot| {
            let found = hits.iter().find(|h| h.signal == slot.channel.signal());
            let good = |h: &&AcquisitionHit| shift_of(h, slot, rate_hz, shift);
            found
                .filter(good)
                .copied()
                .or_else(|| assumed(slot, start, shift, rate_hz))
        })
        .collect();
    Some(Jump {
        tick,
        jump_s: shift / slots.first()?.channel.signal().spec().code_rate_hz,
        channels,
        hits: now,
    })
}

fn shift_of(hit: &AcquisitionHit, slot: &Slot, rate_hz: f64, shift: f64) -> bool {
    slot.channel.replica().is_some_and(|replica| {
        let expected = moved(&replica, hit.tick, hit.tick + 1, rate_hz);
        let own = hit.code_phase_chips - expected.code_phase_chips;
        wrapped(own - shift).abs() < LEAST_JUMP_CHIPS
    })
}

/// Where a signal that was not found again should be.
fn assumed(slot: &Slot, tick: u64, shift: f64, rate_hz: f64) -> Option<AcquisitionHit> {
    let at = moved(&slot.channel.replica()?, tick, tick + 1, rate_hz);
    let length = f64::from(at.signal.spec().code_length_chips);
    let phase = (at.code_phase_chips + shift).rem_euclid(length);
    Some(AcquisitionHit {
        signal: at.signal,
        tick,
        code_phase_chips: if phase < length { phase } else { 0.0 },
        doppler_hz: slot.channel.doppler_hz(),
        statistic: 0.0,
        threshold: 0.0,
        cn0_dbhz: 0.0,
    })
}

/// A difference of code phases in the middle of its range, chips.
fn wrapped(chips: f64) -> f64 {
    (chips + 511.5).rem_euclid(1023.0) - 511.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_change_point_is_where_the_power_ends() {
        let power: Vec<f64> = (0..30).map(|k| if k < 17 { 9.0 } else { 1.0 }).collect();
        assert_eq!(change_point(&power), Some(17));
        assert_eq!(change_point(&[0.0; 5]), None);
    }

    #[test]
    fn differences_wrap_in_the_middle() {
        assert_eq!(wrapped(1022.0), -1.0);
        assert_eq!(wrapped(-1022.5), 0.5);
        assert_eq!(wrapped(3.0), 3.0);
    }
}
