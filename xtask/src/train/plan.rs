//! Scenarios to learn from, drawn at random: geometry, dynamics, C/N0, clock and fault.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::scenario::built::Scenario;
use crate::scenario::spec::ScenarioFile;

/// Kinds of fault, in turn; the last two befall all reception and are no channel's fault.
pub const KINDS: [&str; 10] = [
    "blocked",
    "attenuated",
    "multipath",
    "reflection_only",
    "step",
    "ramp",
    "counterfeit",
    "none",
    "broadband",
    "tone",
];
/// Signal of a scenario, s.
pub const DURATION_S: f64 = 32.0;
/// Faults begin within these times, s: the filter has settled by then.
const ONSET_S: (f64, f64) = (17.0, 20.0);
/// They end so long before the scenario does, s, half of the time.
const END_S: f64 = 27.0;

/// How severe a fault is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Severity {
    /// Barely above the noise of a channel.
    Mild,
    /// Plain.
    Severe,
}

impl Severity {
    /// Behind the name of a fault.
    #[must_use]
    pub const fn suffix(self) -> &'static str {
        match self {
            Self::Mild => " mild",
            Self::Severe => " severe",
        }
    }
}

/// Scenarios that share nothing with those of another series: seeds, places, and the week they are in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Series {
    /// Seed of everything drawn.
    pub seed: u64,
    /// GPS week.
    pub week: u32,
}

impl Series {
    /// What is learned from.
    pub const TRAINING: Self = Self {
        seed: 1,
        week: 2420,
    };
    /// What training stops by, and calibration and evidence are chosen by.
    pub const VALIDATION: Self = Self {
        seed: 2,
        week: 2433,
    };
    /// What thresholds are found and false alarms counted by.
    pub const HEALTHY: Self = Self {
        seed: 21,
        week: 2603,
    };
    /// What is judged by.
    pub const TEST: Self = Self {
        seed: 22,
        week: 2611,
    };
    /// What models are tested on that have not learned from all there is.
    pub const GENERALISATION: Self = Self {
        seed: 6,
        week: 2483,
    };
}

/// How a receiver moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// It rests.
    Rest,
    /// It goes round a circle.
    Circle,
    /// It drives: speeds up, turns, brakes, again and again.
    Drive,
    /// It goes straight, at up to 1200 m/s.
    Straight,
}

impl Motion {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Rest, Self::Circle, Self::Drive, Self::Straight];
}

/// Clocks of receivers, by preset.
pub const CLOCKS: [&str; 3] = ["tcxo", "ocxo", "csac"];

/// What may differ between draws.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Where it belongs.
    pub series: Series,
    /// Number of the scenario in its series.
    pub number: u32,
    /// Signal, s.
    pub duration_s: f64,
    /// Fault.
    pub kind: &'static str,
    /// How severe.
    pub severity: Severity,
    /// C/N0 of all satellites, dB-Hz; `None`: by elevation.
    pub cn0_dbhz: Option<f64>,
    /// How the receiver moves.
    pub motion: Motion,
    /// Its clock.
    pub clock: &'static str,
}

impl Plan {
    /// Number `number` of a series: kinds in turn, severities in turn after them.
    #[must_use]
    pub fn new(number: u32, series: Series) -> Self {
        let turn = KINDS.len() as u32;
        let mut random =
            ChaCha8Rng::seed_from_u64(series.seed.wrapping_mul(0x9e37_79b9) ^ u64::from(number));
        let severity = if (number / turn).is_multiple_of(2) {
            Severity::Severe
        } else {
            Severity::Mild
        };
        let even = !(number / (2 * turn)).is_multiple_of(3);
        Self {
            series,
            number,
            duration_s: DURATION_S,
            kind: KINDS[(number % turn) as usize],
            severity,
            cn0_dbhz: even.then(|| random.random_range(30.0..50.0)),
            motion: Motion::ALL[random.random_range(0..Motion::ALL.len())],
            clock: CLOCKS[random.random_range(0..3)],
        }
    }

    /// The same without a fault, for `duration_s`.
    #[must_use]
    pub fn healthy(number: u32, series: Series, duration_s: f64) -> Self {
        Self {
            kind: "none",
            duration_s,
            ..Self::new(number, series)
        }
    }

    /// The scenario.
    ///
    /// # Errors
    /// Where the generator has drawn an impossible one.
    pub fn scenario(&self) -> Result<Scenario> {
        let series = self.series;
        let run_seed = series
            .seed
            .wrapping_mul(1_000_003)
            .wrapping_add(self.number.into());
        let mut random = ChaCha8Rng::seed_from_u64(run_seed);
        let mut text = self.receiver(&mut random);
        let path = Path::new("");
        let name = format!("series {} number {}", series.seed, self.number);
        if self.kind == "none" {
            let file = ScenarioFile::parse(&name, &name, path, text)?;
            return Scenario::new(&file, Some(run_seed));
        }
        // Which satellites are heard is known once the scenario stands.
        let bare = ScenarioFile::parse(&name, &name, path, text.clone())?;
        let heard = Scenario::new(&bare, Some(run_seed))?.names();
        let victim = heard[random.random_range(0..heard.len())];
        text += &self.fault(&victim.to_string(), &mut random);
        let file = ScenarioFile::parse(&name, &name, path, text)?;
        Scenario::new(&file, Some(run_seed))
    }

    /// Everything but the fault.
    fn receiver(&self, random: &mut impl Rng) -> String {
        let mut uniform = |low: f64, high: f64| random.random_range(low..high);
        let tow_s = uniform(0.0, 600_000.0).round();
        let place = |latitude_deg: f64, longitude_deg: f64| {
            format!(
                "{{ lat_deg = {latitude_deg:.4}, lon_deg = {longitude_deg:.4}, height_m = 100.0 }}"
            )
        };
        let (latitude_deg, longitude_deg) = (uniform(-65.0, 65.0), uniform(-179.0, 179.0));
        let at = place(latitude_deg, longitude_deg);
        let trajectory = match self.motion {
            Motion::Rest => format!("{{ kind = 'static', at = {at} }}"),
            Motion::Circle => format!(
                "{{ kind = 'circle', start = {at}, heading_deg = {:.1}, speed_mps = {:.1}, radius_m = {:.0} }}",
                uniform(0.0, 360.0),
                uniform(5.0, 40.0),
                uniform(300.0, 2000.0)
            ),
            Motion::Drive => {
                let (push, turn) = (uniform(0.5, 3.0), uniform(-4.0, 4.0));
                format!(
                    "{{ kind = 'road', start = {at}, heading_deg = {:.1}, speed_mps = {:.1}, repeat = true, leg = [\
                     {{ duration_s = 4, acceleration_mps2 = {push:.2} }}, {{ duration_s = 3 }}, \
                     {{ duration_s = 5, lateral_mps2 = {turn:.2} }}, {{ duration_s = 2 }}, \
                     {{ duration_s = 4, acceleration_mps2 = -{push:.2} }}] }}",
                    uniform(0.0, 360.0),
                    uniform(5.0, 30.0),
                )
            }
            Motion::Straight => {
                let heading_rad = uniform(0.0, 360.0_f64).to_radians();
                format!(
                    "{{ kind = 'great_circle', from = {at}, to = {}, speed_mps = {:.1} }}",
                    place(
                        latitude_deg + heading_rad.cos(),
                        longitude_deg + heading_rad.sin()
                    ),
                    uniform(5.0_f64.ln(), 1200.0_f64.ln()).exp()
                )
            }
        };
        let cn0 = match self.cn0_dbhz {
            Some(cn0) => format!("{{ fixed_dbhz = {cn0:.2} }}"),
            None => format!(
                "{{ zenith_dbhz = {:.1}, horizon_dbhz = {:.1} }}",
                uniform(44.0, 52.0),
                uniform(32.0, 42.0)
            ),
        };
        format!(
            "description = 'training'
start = {{ week = {}, tow_s = {tow_s:?} }}
duration_s = {:?}
constellation = {{ elevation_mask_deg = 10 }}
trajectory = {trajectory}
clock = {{ preset = '{}', drift = {:e} }}
cn0 = {cn0}
front_end = {{ format = 'ci8', sample_rate_hz = 4e6, bandwidth_hz = 3.6e6 }}
receiver = {{ assisted = true }}
",
            self.series.week,
            self.duration_s,
            self.clock,
            uniform(-5e-7, 5e-7)
        )
    }

    /// The fault of `victim`.
    fn fault(&self, victim: &str, random: &mut impl Rng) -> String {
        let severe = self.severity == Severity::Severe;
        let mut uniform = |low: f64, high: f64| random.random_range(low..high);
        let begin_s = uniform(ONSET_S.0, ONSET_S.1);
        let mut text = format!(
            "\n[[fault]]\nkind = '{}'\nbegin_s = {begin_s:.3}\n",
            self.kind
        );
        if uniform(0.0, 1.0) < 0.5 {
            let _ = writeln!(text, "end_s = {END_S:?}");
        }
        if !matches!(self.kind, "broadband" | "tone") {
            let _ = writeln!(text, "sat = '{victim}'");
        }
        let sign = if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let size = |mild: (f64, f64), hard: (f64, f64)| if severe { hard } else { mild };
        let mut within = |(low, high): (f64, f64)| uniform(low, high);
        text += &match self.kind {
            "attenuated" => {
                format!(
                    "loss_db = {:.1}\nramp_s = {:.2}\n",
                    within(size((6.0, 10.0), (10.0, 20.0))),
                    within((0.0, 1.0))
                )
            }
            "multipath" => ray(within(size((0.3, 0.6), (0.6, 0.95))), &mut within),
            "reflection_only" => ray(within(size((0.3, 0.6), (0.6, 1.0))), &mut within),
            "step" => format!(
                "size_m = {:.1}\n",
                sign * within(size((5.0, 20.0), (20.0, 100.0)))
            ),
            "ramp" => format!(
                "rate_mps = {:.2}\n",
                sign * within(size((0.5, 3.0), (3.0, 15.0)))
            ),
            "counterfeit" => format!(
                "power_db = {:.1}\nlift_mps = {:.1}\n",
                within(size((0.0, 3.0), (3.0, 10.0))),
                sign * within(size((1.0, 5.0), (5.0, 30.0)))
            ),
            "broadband" => format!("level_dbhz = {:.1}\nwidth_hz = 2e6\n", within((50.0, 70.0))),
            "tone" => format!(
                "level_dbhz = {:.1}\noffset_hz = {:.0}\n",
                within((40.0, 55.0)),
                within((-5e4, 5e4))
            ),
            _ => String::new(),
        };
        text
    }
}

/// One reflection.
fn ray(amplitude: f64, within: &mut impl FnMut((f64, f64)) -> f64) -> String {
    format!(
        "ray = [{{ amplitude = {amplitude:.2}, delay_chips = {:.3}, phase_deg = {:.0}, fading_hz = {:.3} }}]\n",
        within((0.05, 0.9)),
        within((0.0, 360.0)),
        within((0.0, 0.3))
    )
}
