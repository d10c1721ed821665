//! How a run ended, and why it has no fix where it has none.

use gnss_nav::{EphemerisStore, GpsTime};
use gnss_signal::tracking::Lock;

use super::settings::Settings;
use super::slot::Slot;

/// How a run ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Signal received, s.
    pub signal_s: f64,
    /// Mean number of channels over the run.
    pub channels_mean: f64,
    /// Why there was no fix, where there was none.
    pub no_fix_reason: Option<String>,
}

/// Fewest satellites of a fix.
const NEEDED: usize = 4;

/// Says which satellites were there and what each lacked.
pub(super) fn why_no_fix(
    slots: &[Slot],
    acquired: usize,
    store: &EphemerisStore,
    near: Option<GpsTime>,
    settings: &Settings,
    signal_s: f64,
) -> String {
    if acquired == 0 {
        return format!(
            "no satellite acquired in {signal_s:.3} s of signal: looked for {} satellites within \
             +-{:.1} kHz; wrong format, sample rate or intermediate frequency?",
            settings.signals.len(),
            settings.doppler_half_width_hz / 1e3
        );
    }
    let lacks: Vec<String> = slots
        .iter()
        .map(|slot| format!("{} {}", slot.satellite, lack(slot, store, near)))
        .collect();
    let ready = lacks.iter().filter(|l| l.ends_with(READY)).count();
    let list = if lacks.is_empty() {
        "none is tracked at the end".to_owned()
    } else {
        lacks.join(", ")
    };
    format!(
        "{acquired} satellites acquired, {ready} ready of the {NEEDED} that a fix needs after \
         {signal_s:.3} s of signal: {list}"
    )
}

const READY: &str = "ready";

fn lack(slot: &Slot, store: &EphemerisStore, near: Option<GpsTime>) -> String {
    let known = near.is_some_and(|t| store.select(slot.satellite, t).is_some());
    match (slot.channel.lock(), slot.bits_found, slot.has_frame(), known) {
        (Lock::Lost, ..) => "lost".to_owned(),
        (_, false, ..) => "lacks bit synchronisation".to_owned(),
        (_, _, false, true) => "lacks the time of week".to_owned(),
        (_, _, false, false) => "lacks frame synchronisation and an ephemeris".to_owned(),
        (.., false) => {
            let missing: Vec<String> = (1..=3)
                .filter(|id| slot.subframes & (1 << (id - 1)) == 0)
                .map(|id| id.to_string())
                .collect();
            if missing.is_empty() {
                "lacks an ephemeris (subframes disagree or have expired)".to_owned()
            } else {
                format!("lacks subframe {}", missing.join(" and "))
            }
        }
        _ => READY.to_owned(),
    }
}
