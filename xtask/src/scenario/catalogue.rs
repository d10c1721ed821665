//! The named scenarios embedded in this tool.

use std::path::Path;

use anyhow::{Context, Result};

use super::spec::ScenarioFile;

macro_rules! catalogue {
    ($($name:literal),* $(,)?) => {
        &[$((
            $name,
            include_str!(concat!("../../../assets/scenarios/", $name, ".toml")),
        )),*]
    };
}

/// Name and text of each, in the order in which they are listed.
const CATALOGUE: &[(&str, &str)] = catalogue![
    "demo",
    "static-open-sky",
    "jiang2017-1",
    "jiang2017-2",
    "zhu2020",
    "zhang2014-direct",
    "zhang2014-multipath",
    "li2019-vehicle",
    "urban-canyon",
    "vehicle-turns",
    "outage-2s",
    "outage-10s",
    "cn0-ramp",
    "jamming-sweep",
    "spoof-liftoff",
];

/// Names of the embedded scenarios.
pub fn names() -> impl Iterator<Item = &'static str> {
    CATALOGUE.iter().map(|(name, _)| *name)
}

/// The scenario called `name`, or the one in the file of that name.
///
/// # Errors
/// Where there is neither, or the file is wrong.
pub fn find(name: &str) -> Result<ScenarioFile> {
    if let Some((_, text)) = CATALOGUE.iter().find(|(known, _)| *known == name) {
        return ScenarioFile::parse(name, name, Path::new(""), (*text).to_owned());
    }
    let all: Vec<_> = names().collect();
    ScenarioFile::read(Path::new(name)).with_context(|| {
        format!(
            "scenario {name:?}: expected a TOML file or one of {}",
            all.join(" ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::built::Scenario;

    #[test]
    fn every_scenario_can_be_made() {
        for name in names() {
            let scenario = Scenario::new(&find(name).unwrap(), None).unwrap();
            assert!(scenario.scene().check().is_ok(), "{name}");
            assert!(!scenario.description.is_empty(), "{name}");
        }
    }
}
