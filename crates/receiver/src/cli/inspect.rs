//! `receiver inspect`.

use std::io::Write;
use std::path::Path;

use super::print;
use crate::ReceiverError;
use crate::inspect::{self, Recording};
use crate::{rinex_nav, sigmf};

pub(super) fn inspect(
    file: &Path,
    format: Option<&str>,
    sample_rate_hz: Option<f64>,
    out: &mut dyn Write,
) -> Result<(), ReceiverError> {
    let text = match inspect::kind(file)? {
        inspect::Kind::Result(summary) => inspect::result_text(&summary)?,
        inspect::Kind::Navigation => inspect::navigation_text(&rinex_nav::read(file)?),
        inspect::Kind::Model => inspect::model_text(file)?,
        inspect::Kind::Scenario(scenario) => inspect::scenario_text(&scenario),
        inspect::Kind::Recording => {
            let sidecar = sigmf::read(file)?;
            let format = format.map(str::parse).transpose()?.or(sidecar.format);
            inspect::recording_text(&Recording {
                path: file.to_owned(),
                format,
                sample_rate_hz: sample_rate_hz.or(sidecar.sample_rate_hz),
            })?
        }
    };
    print(out, &format!("{}\n{text}", file.display()))
}
