//! What a trained monitor is, by its card.

use std::fs;
use std::path::Path;

use fault_ml::learned::{Card, FeatureSet, LearnedModel, Mode};

use super::file_error;
use crate::ReceiverError;

/// Kind, window, threshold and checks of the model of which `path` is weights or card.
///
/// # Errors
/// [`ReceiverError::File`] where one of both cannot be read, [`ReceiverError::Content`] where they are damaged or not of
/// one another.
pub fn model_text(path: &Path) -> Result<String, ReceiverError> {
    let weights = path.with_extension("safetensors");
    let card = path.with_extension("json");
    let bytes = fs::read(&weights).map_err(|source| file_error(&weights, source))?;
    let text = fs::read_to_string(&card).map_err(|source| file_error(&card, source))?;
    let model = LearnedModel::load(&bytes, &text).map_err(|error| ReceiverError::Content {
        path: path.to_owned(),
        what: error.to_string(),
    })?;
    Ok(card_text(model.card()))
}

fn card_text(card: &Card) -> String {
    let features = match card.features {
        FeatureSet::Paper => "paper",
        FeatureSet::Full => "full",
    };
    let mode = match card.mode {
        Mode::Window => "window by window",
        Mode::Streaming => "state carried",
    };
    let gathers = card.evidence.map_or_else(String::new, |rule| {
        let (most, offset) = (rule.most, rule.offset);
        format!(", gathered over steps (at most {most} less {offset} of each)")
    });
    let point = &card.operating_point;
    format!(
        "channel monitor {}, model of version {}: {features} features, {} steps of {} s, {mode}\n\
         alarms above {:.2} log-odds{gathers}: {} false alarms a channel and hour, by {:.0} healthy channel-hours\n",
        card.kind.name(),
        card.version,
        card.window,
        card.interval_s,
        point.threshold,
        point.false_alarms_per_hour,
        point.channel_hours,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_told_by_its_card_or_its_weights_and_a_foreign_pair_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/models");
        for name in ["lstm.json", "lstm.safetensors", "svm.json"] {
            fs::copy(models.join(name), path(name)).unwrap();
        }
        for name in ["lstm.json", "lstm.safetensors"] {
            assert_eq!(
                super::super::kind(&path(name)).unwrap(),
                super::super::Kind::Model
            );
            let text = model_text(&path(name)).unwrap();
            assert!(
                text.starts_with("channel monitor lstm, model of version"),
                "{text}"
            );
        }
        let missing = model_text(&path("svm.json")).unwrap_err().to_string();
        assert!(missing.contains("svm.safetensors"), "{missing}");
        fs::copy(path("lstm.safetensors"), path("svm.safetensors")).unwrap();
        let foreign = model_text(&path("svm.json")).unwrap_err().to_string();
        assert!(foreign.contains("check sum"), "{foreign}");
    }
}
