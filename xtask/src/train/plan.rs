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

/// What may differ between draws.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Number of the scenario, and its seed.
    pub number: u32,
    /// Fault.
    pub kind: &'static str,
    /// How severe.
    pub severity: Severity,
    /// C/N0 of all satellites, dB-Hz; `None`: by elevation.
    pub cn0_dbhz: Option<f64>,
}

impl Plan {
    /// Number `number` of a series of `seed`: kinds in turn, severities in turn after them.
    #[must_use]
    pub fn new(number: u32, seed: u64) -> Self {
        let turn = KINDS.len() as u32;
        let mut random =
            ChaCha8Rng::seed_from_u64(seed.wrapping_mul(0x9e37_79b9) ^ u64::from(number));
        let severity = if (number / turn).is_multiple_of(2) {
            Severity::Severe
        } else {
            Severity::Mild
        };
        let even = !(number / (2 * turn)).is_multiple_of(3);
        Self {
            number,
            kind: KINDS[(number % turn) as usize],
            severity,
            cn0_dbhz: even.then(|| random.random_range(30.0..50.0)),
        }
    }

    /// The scenario.
    ///
    /// # Errors
    /// Where the generator has drawn an impossible one.
    pub fn scenario(&self, seed: u64) -> Result<Scenario> {
        let run_seed = seed
            .wrapping_mul(1_000_003)
            .wrapping_add(self.number.into());
        let mut random = ChaCha8Rng::seed_from_u64(run_seed);
        let mut text = self.receiver(&mut random);
        let path = Path::new("");
        let name = format!("training {}", self.number);
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
        let place = |random: &mut dyn FnMut(f64, f64) -> f64, height_m: f64| {
            let (lat, lon) = (random(-65.0, 65.0), random(-180.0, 180.0));
            format!("{{ lat_deg = {lat:.4}, lon_deg = {lon:.4}, height_m = {height_m} }}")
        };
        let mut uniform = |low: f64, high: f64| random.random_range(low..high);
        let tow_s = uniform(0.0, 600_000.0).round();
        let at = place(&mut uniform, 100.0);
        let trajectory = match uniform(0.0, 3.0) as u32 {
            0 => format!("{{ kind = 'static', at = {at} }}"),
            1 => format!(
                "{{ kind = 'circle', start = {at}, heading_deg = {:.1}, speed_mps = {:.1}, radius_m = {:.0} }}",
                uniform(0.0, 360.0),
                uniform(5.0, 40.0),
                uniform(300.0, 2000.0)
            ),
            _ => format!(
                "{{ kind = 'road', start = {at}, heading_deg = {:.1}, speed_mps = {:.1}, leg = [{{ duration_s = 40, acceleration_mps2 = 0 }}] }}",
                uniform(0.0, 360.0),
                uniform(5.0, 250.0)
            ),
        };
        let clock = ["tcxo", "ocxo", "csac"][uniform(0.0, 3.0) as usize];
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
start = {{ week = 2420, tow_s = {tow_s:?} }}
duration_s = {DURATION_S:?}
constellation = {{ elevation_mask_deg = 10 }}
trajectory = {trajectory}
clock = {{ preset = '{clock}', drift = {:e} }}
cn0 = {cn0}
front_end = {{ format = 'ci8', sample_rate_hz = 4e6, bandwidth_hz = 3.6e6 }}
receiver = {{ assisted = true }}
",
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
