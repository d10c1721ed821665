//! What is true of a channel at a time: the faults of a scenario, beside what a receiver saw.

use fault_ml::learned::{Dataset, Label, LabelledStep, Sequence};
use gnss_nav::SatelliteId;
use receiver::record::ChannelRecord;

use crate::scenario::fault::Account;

/// Steps farther apart than this belong to different sequences, s.
const LONGEST_GAP_S: f64 = 0.15;
/// Faults that leave the measurements of a channel as they are.
const HARMLESS: [&str; 1] = ["bit_errors"];
/// Faults whose error stays when they end.
const LASTING: [&str; 2] = ["ramp", "wrong_ephemeris"];

/// The fault that befalls `satellite` in the scenario, if any.
fn account_of(accounts: &[Account], satellite: SatelliteId) -> Option<&Account> {
    let harmful = accounts.iter().filter(|a| !HARMLESS.contains(&a.kind));
    let of_all = harmful.clone().find(|a| a.satellites.is_empty());
    harmful
        .into_iter()
        .find(|a| a.satellites.contains(&satellite))
        .or(of_all)
}

/// Whether a fault of the channel is on at `elapsed_s`; what befalls all reception is no channel's.
fn label(account: Option<&Account>, elapsed_s: f64) -> Label {
    let own = account.filter(|account| !account.satellites.is_empty());
    let is_on = own.is_some_and(|account| {
        let span = &account.span;
        let lasts = LASTING.contains(&account.kind);
        let ended = span.end_s.is_some_and(|end_s| elapsed_s >= end_s);
        elapsed_s >= span.begin_s && (lasts || !ended)
    });
    if is_on { Label::Faulty } else { Label::Healthy }
}

/// The channels of a run as labelled sequences, by satellite; `elapsed_s` turns a record's time into that of
/// the faults.
#[must_use]
pub fn labelled(
    scenario: u32,
    channels: &[ChannelRecord],
    accounts: &[Account],
    elapsed_s: impl Fn(f64) -> f64,
) -> Dataset {
    let mut satellites: Vec<SatelliteId> = channels.iter().map(|c| c.satellite).collect();
    satellites.sort_unstable();
    satellites.dedup();
    let mut data = Dataset::default();
    for satellite in satellites {
        let account = account_of(accounts, satellite);
        let fault = account.map_or("", |account| account.kind);
        let mut last_s = f64::NEG_INFINITY;
        for record in channels.iter().filter(|c| c.satellite == satellite) {
            let Some(step) = record.shown else { continue };
            let time_s = record.time_s;
            if time_s - last_s > LONGEST_GAP_S {
                data.sequences.push(Sequence {
                    scenario,
                    fault: fault.to_owned(),
                    steps: Vec::new(),
                });
            }
            last_s = time_s;
            let label = label(account, elapsed_s(time_s));
            if let Some(sequence) = data.sequences.last_mut() {
                sequence.steps.push(LabelledStep {
                    time_s,
                    step,
                    label,
                });
            }
        }
    }
    data
}
