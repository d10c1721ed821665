//! The two reflections on samples of one satellite, as in the paper, through the whole receiver set as the paper's.

use anyhow::Result;
use fault_ml::shape::{ChartSettings, EwmaChart, SHAPE_TAPS_CHIPS, largest_tap};
use gnss_nav::SatelliteId;
use gnss_signal::tracking::TrackingSettings;
use gnss_signal::{IfCorrelatorBank, InstructionSet, SignalId, TapOffsets};
use receiver::pipeline::{self, Settings};
use receiver::record::{Record, TapsRecord};

use super::channel::Seen;
use super::closed_loop::{ClosedLoop, Setting};
use super::rays::{Run, reflections};
use crate::judged::in_parallel;
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::if_signal::Synthesiser;

/// Samples a receiver keeps, s.
const HISTORY_S: f64 = 2.0;
/// The satellite with the reflections in the scenario.
const PRN: u8 = 24;
/// C/N0 at which a loop has no noise to speak of, dB-Hz.
const NOISELESS_DBHZ: f64 = 120.0;
/// The loop is settled from here on, s.
const SETTLED_S: f64 = 1.5;

/// Runs of `seeds` scenarios: the chart over the sums of the receiver's channel, beside the error of a
/// loop without noise.
///
/// # Errors
/// Where a signal cannot be made or received.
pub fn runs(seeds: usize) -> Result<Vec<Run>> {
    in_parallel(seeds, |seed| run(700 + seed as u64))
}

fn run(seed: u64) -> Result<Run> {
    let file = catalogue::find("zhang2014-multipath")?;
    let alone = format!("constellation.satellites=[{PRN}]");
    let scenario = Scenario::new(&file.with(&[alone])?, Some(seed))?;
    let source = Synthesiser::new(scenario.scene())?;
    let bank = IfCorrelatorBank::new(source, HISTORY_S, InstructionSet::detect())?;
    let settings = Settings {
        signals: vec![SignalId::gps_l1_ca(PRN)?],
        dump_taps: true,
        tracking: TrackingSettings {
            integration_periods: 1,
            spacing_chips: 1.0,
            code_locked_hz: 3.0,
            further_taps: Some(TapOffsets::new(&SHAPE_TAPS_CHIPS)?),
            ..TrackingSettings::default()
        },
        ..Settings::default()
    };
    let mut chart = EwmaChart::new(ChartSettings::default())?;
    let mut noiseless = ClosedLoop::new(Setting::paper(NOISELESS_DBHZ), 0);
    let mut run = Run::new();
    pipeline::run(bank, &settings, &mut |record| {
        if let Record::Taps(taps) = record
            && taps.satellite == SatelliteId::gps(PRN)
        {
            run.extend(step(&taps, &mut chart, &mut noiseless));
        }
        Ok(())
    })?;
    Ok(run)
}

fn step(
    taps: &TapsRecord,
    chart: &mut EwmaChart,
    noiseless: &mut ClosedLoop,
) -> Option<(f64, Seen)> {
    let settled = taps.time_s > SETTLED_S && taps.offsets_chips.ends_with(&SHAPE_TAPS_CHIPS);
    let sums = taps.sums.last_chunk::<9>().filter(|_| settled)?;
    let observed_chips = largest_tap(&SHAPE_TAPS_CHIPS, &sums.map(|s| s.norm()))?;
    noiseless.step(&reflections(taps.time_s));
    let seen = Seen {
        observed_chips,
        mean_chips: chart.step(observed_chips),
        limit_chips: chart.limit(),
        late_chips: noiseless.late_chips(),
    };
    Some((taps.time_s, seen))
}
