//! What is known of a model: read by people, and checked when it is loaded.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::calibration::Calibration;
use super::operating_point::OperatingPoint;
use super::{Evidence, EvidenceRule, FeatureSet, LearnedError};

/// What a card says it is.
pub const FORMAT: &str = "channel-monitor";
/// Version of the format that this program writes and reads.
pub const VERSION: u64 = 6;

/// Which kind of model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelKind {
    /// Support-vector machine.
    Svm,
    /// Long short-term memory.
    Lstm,
}

impl ModelKind {
    /// Name in options and results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Svm => "svm",
            Self::Lstm => "lstm",
        }
    }
}

/// How a model goes over the steps of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// It judges the last steps, as many as the window has, and nothing before.
    Window,
    /// It remembers: its state is carried from step to step.
    Streaming,
}

/// The card of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// [`FORMAT`].
    pub format: String,
    /// [`VERSION`].
    pub version: u64,
    /// Which kind.
    pub kind: ModelKind,
    /// What it looks at.
    pub features: FeatureSet,
    /// Steps before it judges, and in [`Mode::Window`] those it judges by.
    pub window: usize,
    /// How it goes over them.
    pub mode: Mode,
    /// Time between steps, s.
    pub interval_s: f64,
    /// It judges anew every so many steps.
    pub decide_every: usize,
    /// From its raw score to log-odds.
    pub calibration: Calibration,
    /// What of the log-odds of a step is evidence that gathers over steps; absent: every step is judged by its own.
    pub evidence: Option<EvidenceRule>,
    /// Where it alarms.
    pub operating_point: OperatingPoint,
    /// Check sum of the weights (FNV-1a, 64 bits, hexadecimal).
    pub weights_fnv1a: String,
    /// Data, seeds, settings and figures of the training.
    pub training: Value,
}

impl Card {
    /// Reads a card.
    ///
    /// # Errors
    /// [`LearnedError::Model`] where it is damaged, foreign, newer or impossible.
    pub fn parse(text: &str) -> Result<Self, LearnedError> {
        let refuse = |what: String| LearnedError::model("card", what);
        let value: Value =
            serde_json::from_str(text).map_err(|e| refuse(format!("damaged: {e}")))?;
        let format = value
            .get("format")
            .and_then(Value::as_str)
            .unwrap_or_default();
        if format != FORMAT {
            return Err(refuse(format!("format is {format:?}: expected {FORMAT:?}")));
        }
        let version = value
            .get("version")
            .and_then(Value::as_u64)
            .unwrap_or_default();
        // Those before it learned from other features.
        if version != VERSION {
            let what = format!("version is {version}: expected {VERSION}");
            return Err(refuse(what));
        }
        let card: Self =
            serde_json::from_value(value).map_err(|e| refuse(format!("damaged: {e}")))?;
        card.check()?;
        Ok(card)
    }

    fn check(&self) -> Result<(), LearnedError> {
        let refuse = |what: &str| Err(LearnedError::model("card", what));
        if !(1..=10_000).contains(&self.window) {
            return refuse("window: expected 1 to 10000 steps");
        }
        if !(self.interval_s > 0.0 && self.interval_s <= 10.0) {
            return refuse("interval_s: expected above 0 and at most 10");
        }
        if !(1..=1000).contains(&self.decide_every) {
            return refuse("decide_every: expected 1 to 1000 steps");
        }
        if self.kind == ModelKind::Svm && self.mode == Mode::Streaming {
            return refuse("mode: a support-vector machine has no state to carry");
        }
        let gathers = |rule: EvidenceRule| rule.offset.is_finite() && rule.most > rule.offset;
        if !self.evidence.is_none_or(gathers) {
            return refuse("evidence: expected an offset below the most that counts");
        }
        if !self.operating_point.threshold.is_finite() {
            return refuse("threshold: expected a number");
        }
        Ok(self.calibration.check()?)
    }

    /// What gathers over steps, where something does. Twice what an alarm takes is enough to keep.
    #[must_use]
    pub fn no_evidence_yet(&self) -> Option<Evidence> {
        let largest = 2.0 * self.operating_point.threshold.max(0.0);
        Some(Evidence::new(self.evidence?, largest))
    }

    /// The text of the card, with a line break at its end.
    #[must_use]
    pub fn to_text(&self) -> String {
        // Plain data with text for keys: nothing of it can fail.
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }
}

/// FNV-1a of 64 bits: finds damage and mix-ups, not malice.
#[must_use]
pub(super) fn fnv1a(bytes: &[u8]) -> String {
    let fold = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, fold))
}
