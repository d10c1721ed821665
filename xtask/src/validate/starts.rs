//! Many starts of vector tracking: none may diverge or hang, wherever in a frame and a sky it happens.

use std::fmt;

use anyhow::{Context, Result, ensure};
use gnss_nav::{Geodetic, GpsTime};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use receiver::pipeline::{Settings, VectorSettings};
use receiver::record::{EventKind, LoopMembership, Status};

use super::verdict;
use crate::judged::{Judged, in_parallel, receive, rms, settings};
use crate::scenario::built::Scenario;
use crate::scenario::catalogue;
use crate::scenario::constellation::nominal;
use crate::scenario::make::Level;

/// Signal of a run, s: all turns of the vehicle.
const RUN_S: f64 = 100.0;
/// A satellite rises or sets in this part of a run, s, in which most receivers switch.
const SWITCH_S: (f64, f64) = (15.0, 40.0);
/// Latest switch, s: two frames and what came before them.
const LATEST_SWITCH_S: f64 = 70.0;
/// Horizontal error beyond which a run has diverged, m.
const DIVERGED_M: f64 = 10.0;
/// Largest error of the receiver's clock at the start, s.
const CLOCK_S: f64 = 0.1;
/// Runs made once more, on one thread.
const REPEATED: usize = 4;

/// How a run begins.
#[derive(Debug, Clone, Copy)]
struct Start {
    name: &'static str,
    assisted: bool,
    tow_s: f64,
    clock_s: f64,
    seed: u64,
}

impl Start {
    fn new(number: usize) -> Result<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(number as u64);
        let tow_s = 345_600.0 + random.random_range(0.0..86_400.0);
        Ok(Self {
            name: if number.is_multiple_of(2) {
                "static-open-sky"
            } else {
                "vehicle-turns"
            },
            assisted: number % 4 >= 2,
            tow_s: before_a_crossing(tow_s)?,
            clock_s: random.random_range(-CLOCK_S..CLOCK_S),
            seed: 1_000 + number as u64,
        })
    }

    fn scenario(&self) -> Result<Scenario> {
        let values = [
            format!("start.tow_s={:?}", self.tow_s),
            format!("duration_s={RUN_S:?}"),
            format!("clock.bias_s={:?}", self.clock_s),
            "constellation.elevation_mask_deg=0".to_owned(),
            format!("receiver.assisted={}", self.assisted),
        ];
        Scenario::new(&catalogue::find(self.name)?.with(&values)?, Some(self.seed))
    }

    fn run(&self) -> Result<Judged> {
        let scenario = self.scenario()?;
        let settings = Settings {
            vector: Some(VectorSettings::default()),
            ..settings(&scenario)
        };
        receive(&scenario, Level::Correlator, &settings)
    }
}

/// The first start from `tow_s` on after which a satellite rises or sets while a receiver switches.
fn before_a_crossing(tow_s: f64) -> Result<f64> {
    let place = Geodetic::from_degrees(48.15, 11.57, 560.0);
    let up = |tow_s: f64| -> Result<Vec<bool>> {
        let time = GpsTime::new(2350, tow_s);
        let looks = nominal(time)?.into_iter().map(|ephemeris| {
            let path = ephemeris.state_at(time)?.position_ecef_m - place.to_ecef();
            Ok(place.look(&path.normalize()).elevation_rad > 0.0)
        });
        looks.collect()
    };
    for step in 0..500 {
        let tow_s = tow_s + f64::from(step) * (SWITCH_S.1 - SWITCH_S.0);
        if up(tow_s + SWITCH_S.0)? != up(tow_s + SWITCH_S.1)? {
            return Ok(tow_s);
        }
    }
    anyhow::bail!("no satellite rises or sets after {tow_s} s")
}

/// What became of a start.
#[derive(Debug, Clone, Copy)]
struct Outcome {
    start: Start,
    /// Last switch to vector tracking that was not followed by one back.
    switched_s: Option<f64>,
    /// Switches back.
    fallen_back: usize,
    /// From that switch on, m.
    rms_m: f64,
    largest_m: f64,
    /// Epochs from that switch on without a fix.
    without_fix: usize,
}

impl Outcome {
    fn new(start: Start, judged: &Judged) -> Self {
        let switch = |membership| {
            judged
                .events
                .iter()
                .filter_map(move |event| match event.kind {
                    EventKind::ModeSwitched { to } if to == membership => Some(event.time_s),
                    _ => None,
                })
        };
        let fallen_back = switch(LoopMembership::Scalar).count();
        let back_s = switch(LoopMembership::Scalar).next_back().unwrap_or(-1.0);
        let switched_s = switch(LoopMembership::Vector)
            .next_back()
            .filter(|s| *s > back_s);
        let since = judged.between(switched_s.unwrap_or(RUN_S), f64::INFINITY);
        Self {
            start,
            switched_s,
            fallen_back,
            rms_m: rms(since.clone().map(|e| e.horizontal_m())),
            largest_m: since.clone().map(|e| e.horizontal_m()).fold(0.0, f64::max),
            without_fix: since.filter(|e| e.pvt.status != Status::Fix).count(),
        }
    }

    fn is_good(&self) -> bool {
        self.switched_s.is_some_and(|s| s <= LATEST_SWITCH_S)
            && self.largest_m < DIVERGED_M
            && self.without_fix == 0
    }
}

/// All starts.
#[derive(Debug, Clone)]
pub struct Table {
    outcomes: Vec<Outcome>,
    repeats: bool,
}

/// Makes `runs` starts, at rest and driving, stand-alone and assisted.
///
/// # Errors
/// Where a signal cannot be made or the receiver fails.
pub fn table(runs: usize) -> Result<Table> {
    ensure!(runs > 0, "runs: expected at least one");
    let run = |number: usize| -> Result<(Outcome, Judged)> {
        let start = Start::new(number)?;
        let judged = start.run().with_context(|| format!("{start:?}"))?;
        Ok((Outcome::new(start, &judged), judged))
    };
    let first = in_parallel(REPEATED.min(runs), run)?;
    let mut repeats = true;
    for (number, (_, judged)) in first.iter().enumerate() {
        let again = run(number)?.1;
        let pvt =
            |judged: &Judged| -> Vec<_> { judged.epochs.iter().map(|e| e.pvt.clone()).collect() };
        repeats &= pvt(judged) == pvt(&again);
    }
    let outcomes = in_parallel(runs, |number| Ok(run(number)?.0))?;
    Ok(Table { outcomes, repeats })
}

impl Table {
    /// Whether every start is good.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.repeats && self.outcomes.iter().all(Outcome::is_good)
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for (name, assisted) in [
            ("static-open-sky", false),
            ("static-open-sky", true),
            ("vehicle-turns", false),
            ("vehicle-turns", true),
        ] {
            let group = self.outcomes.iter();
            let group: Vec<&Outcome> = group
                .filter(|o| o.start.name == name && o.start.assisted == assisted)
                .collect();
            let switches = || group.iter().filter_map(|o| o.switched_s);
            writeln!(
                f,
                "{name}{}: {} runs, {} good; switch {:.1} to {:.1} s, {} fell back; rms {:.2} m, largest error {:.2} m",
                if assisted { ", assisted" } else { "" },
                group.len(),
                group.iter().filter(|o| o.is_good()).count(),
                switches().fold(f64::INFINITY, f64::min),
                switches().fold(0.0, f64::max),
                group.iter().filter(|o| o.fallen_back > 0).count(),
                rms(group.iter().map(|o| o.rms_m)),
                group.iter().map(|o| o.largest_m).fold(0.0, f64::max),
            )?;
        }
        for outcome in self.outcomes.iter().filter(|o| !o.is_good()) {
            writeln!(f, "not good: {outcome:?}")?;
        }
        write!(
            f,
            "{} starts, once more on one thread {}: {}",
            self.outcomes.len(),
            if self.repeats { "the same" } else { "others" },
            verdict(self.holds())
        )
    }
}
