//! A trained model that watches a channel.

use std::sync::Arc;

use super::card::Mode;
use super::feature::WIDEST;
use super::lstm::LstmState;
use super::model::{LearnedModel, Network};
use super::{ChannelStep, Evidence, FeatureTrack, SlidingWindow};
use crate::{Cadence, ChannelMonitor, ChannelVerdict, Judgement, MonitorError};

/// Judges a channel by a trained model; the score is the log-odds of a fault, or the evidence for one that has
/// gathered.
///
/// It warms up over the model's window, and again when the channel is handed to another satellite. A step
/// that holds no numbers is refused and leaves no trace.
#[derive(Debug, Clone)]
pub struct LearnedMonitor {
    model: Arc<LearnedModel>,
    satellite: Option<u32>,
    track: FeatureTrack,
    memory: Memory,
    /// Steps seen, as far as it matters: up to the window.
    seen: usize,
    /// Steps until it judges anew.
    due: usize,
    evidence: Option<Evidence>,
    score: f64,
}

/// What it keeps of the past.
#[derive(Debug, Clone)]
enum Memory {
    /// The last steps; a layer goes over them from nothing.
    Window(SlidingWindow, Option<LstmState>),
    /// A state that is carried.
    State(LstmState),
}

impl LearnedMonitor {
    /// A monitor that has seen nothing.
    #[must_use]
    pub fn new(model: Arc<LearnedModel>) -> Self {
        let card = model.card();
        let state = match model.network() {
            Network::Svm(_) => None,
            Network::Lstm(cell) => Some(cell.zero_state()),
        };
        let memory = match (card.mode, state) {
            (Mode::Streaming, Some(state)) => Memory::State(state),
            (_, state) => {
                let window = SlidingWindow::new(card.window, card.features.width());
                Memory::Window(window, state)
            }
        };
        let evidence = card.no_evidence_yet();
        Self {
            track: FeatureTrack::new(card.features),
            model,
            satellite: None,
            memory,
            seen: 0,
            due: 0,
            evidence,
            score: 0.0,
        }
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> &LearnedModel {
        &self.model
    }

    /// Takes a step and, where one is due, returns the raw score.
    fn raw_score(&mut self, step: &ChannelStep) -> Result<Option<f32>, MonitorError> {
        let features = if self.satellite == Some(step.satellite) {
            self.track.next(step)?
        } else {
            let mut track = FeatureTrack::new(self.model.card().features);
            let features = track.next(step)?;
            self.reset();
            self.satellite = Some(step.satellite);
            self.track = track;
            features
        };
        let model = Arc::clone(&self.model);
        let card = model.card();
        self.seen = (self.seen + 1).min(card.window);
        let warm = self.seen == card.window;
        let judges = warm && self.due == 0;
        if warm {
            self.due = (self.due + 1) % card.decide_every;
        }
        let scaled = model.scaler().scaled(&features);
        Ok(match (&mut self.memory, model.network()) {
            (Memory::State(state), Network::Lstm(cell)) => {
                let mut row = [0.0; WIDEST];
                let row = row.get_mut(..model.scaler().width()).unwrap_or_default();
                row.iter_mut()
                    .zip(scaled)
                    .for_each(|(slot, value)| *slot = value);
                let score = cell.step(state, row);
                judges.then_some(score)
            }
            (Memory::Window(window, state), network) => {
                window.push(scaled);
                match (network, state) {
                    _ if !judges => None,
                    (Network::Svm(svm), _) => Some(svm.decision(window.values())),
                    (Network::Lstm(cell), Some(state)) => Some(cell.window(state, window.values())),
                    (Network::Lstm(_), None) => None,
                }
            }
            (Memory::State(_), Network::Svm(_)) => None,
        })
    }
}

impl ChannelMonitor for LearnedMonitor {
    type Input = ChannelStep;

    fn name(&self) -> &str {
        self.model.card().kind.name()
    }

    fn cadence(&self) -> Cadence {
        Cadence::NavigationEpoch
    }

    fn step(&mut self, input: &ChannelStep) -> Result<ChannelVerdict, MonitorError> {
        let raw = self.raw_score(input)?;
        let card = self.model.card();
        if let Some(raw) = raw {
            let log_odds = card.calibration.log_odds(f64::from(raw));
            let evidence = self.evidence.as_mut();
            self.score = evidence.map_or(log_odds, |evidence| evidence.gather(log_odds));
        }
        if self.seen < card.window {
            let remaining_steps = card.window - self.seen;
            return Ok(ChannelVerdict::WarmingUp { remaining_steps });
        }
        let threshold = card.operating_point.threshold;
        Ok(ChannelVerdict::Judged(Judgement::new(
            self.score, threshold,
        )?))
    }

    fn reset(&mut self) {
        match &mut self.memory {
            Memory::Window(window, _) => window.clear(),
            Memory::State(state) => state.clear(),
        }
        self.track = FeatureTrack::new(self.model.card().features);
        self.satellite = None;
        if let Some(evidence) = &mut self.evidence {
            evidence.clear();
        }
        self.seen = 0;
        self.due = 0;
    }
}
