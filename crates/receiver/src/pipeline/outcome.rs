//! How a run ended, and why it has no fix where it has none.

use std::collections::BTreeMap;

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
    let mut by_lack: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for slot in slots.iter().filter(|s| s.announced) {
        let satellites = by_lack.entry(lack(slot, store, near)).or_default();
        satellites.push(slot.satellite.to_string());
    }
    let ready = by_lack.get(READY).map_or(0, Vec::len);
    let list: Vec<String> = by_lack
        .iter()
        .map(|(lack, satellites)| format!("{} {lack}", satellites.join(" ")))
        .collect();
    let list = if list.is_empty() {
        "none is tracked at the end".to_owned()
    } else {
        list.join("; ")
    };
    format!(
        "{acquired} satellites acquired, {ready} ready of the {NEEDED} that a fix needs after \
         {signal_s:.3} s of signal: {list}"
    )
}

const READY: &str = "ready";

fn lack(slot: &Slot, store: &EphemerisStore, near: Option<GpsTime>) -> String {
    let known = near.is_some_and(|t| store.select(slot.satellite, t).is_some());
    match (
        slot.channel.lock(),
        slot.bits_found,
        slot.has_frame(),
        known,
    ) {
        (Lock::Lost, ..) => "lost".to_owned(),
        (_, false, ..) => "without bit synchronisation".to_owned(),
        (_, _, false, true) => "without the time of week".to_owned(),
        (_, _, false, false) => "without frame synchronisation and an ephemeris".to_owned(),
        (.., false) => {
            let missing: Vec<String> = (1..=3)
                .filter(|id| slot.subframes & (1 << (id - 1)) == 0)
                .map(|id| id.to_string())
                .collect();
            if missing.is_empty() {
                "without an ephemeris (subframes disagree or have expired)".to_owned()
            } else {
                format!("without subframe {}", missing.join(" and "))
            }
        }
        _ => READY.to_owned(),
    }
}
