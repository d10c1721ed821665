//! The bank: a main filter and one for every satellite left out, and what their densities betray.

use rand_chacha::ChaCha8Rng;

use super::filter::{Epoch, Filter, Outcome};
use super::parameters::{CheckedParticleParameters, RatioForm, Response};
use crate::error::check_later;
use crate::readmission::Readmission;
use crate::window::CumulativeRatio;
use crate::{MonitorError, STATES, Sight, check_sights};

/// Satellites in use below which nothing can be judged: one more than there are states.
const FEWEST_TO_JUDGE: usize = STATES + 1;
/// Satellites in use below which the faulty one cannot be named: leaving out any one of five
/// explains the rest alike.
const FEWEST_TO_NAME: usize = STATES + 2;
/// Assumed before the first epoch, s.
const FIRST_ELAPSED_S: f64 = 1.0;

/// What the bank decides of one epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Decision {
    /// The clouds are coming to rest.
    WarmingUp,
    /// Fewer than five satellites in use.
    Unavailable,
    /// Judged: an alarm where the score exceeds the threshold.
    Judged {
        /// Decision beta: the largest cumulative ratio over satellites and window starts.
        score: f64,
        /// The satellite it belongs to; none with five satellites, which cannot tell.
        worst: Option<u32>,
    },
}

/// What the bank says of one epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RaimEpoch {
    /// By the ratio the parameters choose.
    pub decision: Decision,
    /// Weighted mean of the main filter, m about the reference point; of the filter that has
    /// become it where a satellite is set aside.
    pub estimate_m: [f64; STATES],
    /// Effective particles of the main filter.
    pub effective_main: f64,
    /// Mean effective particles of all filters.
    pub effective_mean: f64,
    /// The satellite set aside in this epoch.
    pub excluded: Option<u32>,
    /// The satellite taken back in this epoch.
    pub readmitted: Option<u32>,
}

/// One filter that never sees its satellite, and how much better it explains things.
#[derive(Debug, Clone)]
struct Subfilter {
    id: u32,
    filter: Filter,
    paper: CumulativeRatio,
    sound: CumulativeRatio,
    outcome: Outcome,
}

impl Subfilter {
    fn ratio(&self, form: RatioForm) -> f64 {
        match form {
            RatioForm::Paper => self.paper.largest(),
            RatioForm::Sound => self.sound.largest(),
        }
    }

    fn restart(&mut self, from: &Filter) {
        self.filter.copy_from(from);
        self.paper.clear();
        self.sound.clear();
    }
}

/// Particle-filter integrity monitoring over line-of-sight snapshots, Wang2016.
///
/// A main filter takes all satellites in use, sub filter q all but satellite q. The one that
/// leaves the faulty satellite out goes on explaining its measurements; the decision is the largest
/// sum of log-likelihood ratios over satellites and window starts. A satellite alarmed on is set
/// aside: its sub filter, which never saw it, becomes the main filter. It is taken back when the
/// same odds speak for it.
///
/// The reference point is the caller's. A moving receiver takes the position its own filter predicts
/// for each epoch ([`Reference::sight`](crate::Reference::sight)); the particles are then errors of that
/// prediction, and the process noise is what the prediction may drift by.
#[derive(Debug, Clone)]
pub struct ParticleRaim {
    parameters: CheckedParticleParameters,
    random: ChaCha8Rng,
    main: Filter,
    subfilters: Vec<Subfilter>,
    in_use: Vec<Sight>,
    aside: Readmission,
    log_without: Vec<f64>,
    last_time_s: Option<f64>,
    epochs: usize,
}

impl ParticleRaim {
    /// A bank about the reference point; `random` is all the chance it takes.
    #[must_use]
    pub fn new(parameters: CheckedParticleParameters, mut random: ChaCha8Rng) -> Self {
        let main = Filter::new(&parameters, &mut random);
        Self {
            parameters,
            random,
            main,
            subfilters: Vec::new(),
            in_use: Vec::new(),
            aside: Readmission::default(),
            log_without: Vec::new(),
            last_time_s: None,
            epochs: 0,
        }
    }

    /// The parameters.
    #[must_use]
    pub const fn parameters(&self) -> &CheckedParticleParameters {
        &self.parameters
    }

    /// Satellites alarmed on and not yet taken back.
    #[must_use]
    pub fn set_aside(&self) -> &[u32] {
        self.aside.ids()
    }

    /// Cumulative ratio of every satellite in use, maximised over window starts; minus infinity
    /// before the first judged epoch.
    pub fn ratios(&self, form: RatioForm) -> impl Iterator<Item = (u32, f64)> {
        self.subfilters.iter().map(move |s| (s.id, s.ratio(form)))
    }

    /// The largest ratio and its satellite: the decision by either form, whichever is chosen.
    #[must_use]
    pub fn largest_ratio(&self, form: RatioForm) -> Option<(u32, f64)> {
        let largest = |best: Option<(u32, f64)>, (id, ratio): (u32, f64)| match best {
            Some((_, highest)) if ratio <= highest => best,
            _ => Some((id, ratio)),
        };
        self.ratios(form).fold(None, largest)
    }

    /// Standard deviation of the main filter's particles in three dimensions, m.
    #[must_use]
    pub fn spread_m(&self) -> f64 {
        let (_, covariance) = self.main.cloud().moments();
        covariance.fixed_view::<3, 3>(0, 0).trace().sqrt()
    }

    /// Moves the reference point: what was at x is at x + `offset_m` now.
    pub fn shift(&mut self, offset_m: &[f64; STATES]) {
        self.main.shift(offset_m);
        for sub in &mut self.subfilters {
            sub.filter.shift(offset_m);
        }
    }

    pub(super) fn main_filter(&self) -> &Filter {
        &self.main
    }

    pub(super) fn filters_without_one(&self) -> impl Iterator<Item = &Filter> {
        self.subfilters.iter().map(|s| &s.filter)
    }

    /// Takes the sights of the epoch `time_s` (s on any clock that only grows).
    ///
    /// # Errors
    /// Where a number cannot be used, a satellite occurs twice, or time has not grown; the epoch
    /// then leaves no trace.
    pub fn epoch(&mut self, time_s: f64, sights: &[Sight]) -> Result<RaimEpoch, MonitorError> {
        check_sights(sights)?;
        let elapsed_s = check_later(time_s, self.last_time_s)?.unwrap_or(FIRST_ELAPSED_S);
        self.last_time_s = Some(time_s);
        self.in_use.clear();
        let aside = self.aside.ids();
        let used = |s: &&Sight| !aside.contains(&s.id);
        let parameters = &self.parameters;
        self.in_use
            .extend(sights.iter().filter(used).map(|s| parameters.believed(s)));
        self.align();
        let main = self.step(elapsed_s);
        let decision = self.decide(main.log_evidence);
        let effective = self.subfilters.iter().map(|s| s.outcome.effective);
        let filters = (1 + self.subfilters.len()) as f64;
        let mut report = RaimEpoch {
            decision,
            estimate_m: main.estimate_m,
            effective_main: main.effective,
            effective_mean: (main.effective + effective.sum::<f64>()) / filters,
            excluded: None,
            readmitted: self.readmit(sights),
        };
        if self.parameters.get().response == Response::Exclude
            && let Some(clean) = self.exclude(&decision)
        {
            report.excluded = Some(clean.id);
            report.estimate_m = clean.outcome.estimate_m;
        }
        Ok(report)
    }

    /// Puts the sub filters in the order of the sights. A satellite new in use gets a copy of the
    /// main filter, which has not seen it either; one out of sight loses its filter.
    fn align(&mut self) {
        for (place, sight) in self.in_use.iter().enumerate() {
            let held = self.subfilters.iter().position(|s| s.id == sight.id);
            match held {
                Some(at) if at >= place => self.subfilters.swap(place, at),
                _ => {
                    let longest = self.parameters.get().window_epochs;
                    let new = Subfilter {
                        id: sight.id,
                        filter: self.main.clone(),
                        paper: CumulativeRatio::new(longest),
                        sound: CumulativeRatio::new(longest),
                        outcome: Outcome {
                            log_evidence: 0.0,
                            effective: 0.0,
                            estimate_m: [0.0; STATES],
                        },
                    };
                    self.subfilters.insert(place, new);
                }
            }
        }
        self.subfilters.truncate(self.in_use.len());
    }

    /// Steps the main filter, then the others in satellite order: one stream of chance for all.
    fn step(&mut self, elapsed_s: f64) -> Outcome {
        let mut epoch = Epoch {
            sights: &self.in_use,
            left_out: None,
            elapsed_s,
        };
        let (parameters, random) = (&self.parameters, &mut self.random);
        let main = self
            .main
            .step(epoch, parameters, Some(&mut self.log_without), random);
        for (s, sub) in self.subfilters.iter_mut().enumerate() {
            epoch.left_out = Some(s);
            sub.outcome = sub.filter.step(epoch, parameters, None, random);
        }
        main
    }

    /// Adds this epoch to the ratios and takes the largest.
    fn decide(&mut self, main_log_evidence: f64) -> Decision {
        self.epochs += 1;
        let settings = self.parameters.get();
        if self.epochs <= settings.warm_up_epochs {
            return Decision::WarmingUp;
        }
        if self.in_use.len() < FEWEST_TO_JUDGE {
            return Decision::Unavailable;
        }
        let log_width = settings.fault_width_m.ln();
        for (sub, log_without) in self.subfilters.iter_mut().zip(&self.log_without) {
            let own = sub.outcome.log_evidence;
            sub.paper.push(own - log_without);
            sub.sound.push(own - log_width - main_log_evidence);
        }
        let Some((id, score)) = self.largest_ratio(settings.ratio) else {
            return Decision::Unavailable;
        };
        let worst = (self.in_use.len() >= FEWEST_TO_NAME).then_some(id);
        Decision::Judged { score, worst }
    }

    /// Sets an alarmed satellite aside. Its own filter never saw it and becomes the main one; all
    /// others did, and start again from there. Returns the filter that took over.
    fn exclude(&mut self, decision: &Decision) -> Option<Subfilter> {
        let Decision::Judged {
            score,
            worst: Some(id),
        } = *decision
        else {
            return None;
        };
        if score <= self.parameters.get().threshold {
            return None;
        }
        let at = self.subfilters.iter().position(|s| s.id == id)?;
        let clean = self.subfilters.remove(at);
        self.main.copy_from(&clean.filter);
        for sub in &mut self.subfilters {
            sub.restart(&self.main);
        }
        self.aside.insert(id);
        Some(clean)
    }

    /// Holds every satellite set aside against the main filter, and takes the first back for which
    /// the odds of health over a uniform fault exceed the threshold.
    fn readmit(&mut self, sights: &[Sight]) -> Option<u32> {
        let settings = self.parameters.get();
        for sight in sights {
            if self.aside.ids().contains(&sight.id) {
                let sight = self.parameters.believed(sight);
                let healthy = self.main.log_expectation(&sight, &self.parameters);
                self.aside.weigh(sight.id, healthy, settings.fault_width_m);
            }
        }
        self.aside.take_back(settings.threshold)
    }
}
