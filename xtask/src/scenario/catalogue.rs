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

    #[test]
    fn impossible_scenarios_are_named_by_file_and_line() {
        let message = |replaced: &str| {
            let file = find("jiang2017-1").unwrap();
            let file = file.with(&[replaced.to_owned()]).unwrap();
            Scenario::new(&file, None).err().unwrap().to_string()
        };
        let absent = message("fault=[{kind=\"blocked\", sat=\"G05\", begin_s=3}]");
        assert!(
            absent.contains("line ") && absent.contains("G05"),
            "{absent}"
        );
        let folded = message("front_end.if_hz=9e6");
        assert!(
            folded.contains("line ") && folded.contains("if_hz is 9000000"),
            "{folded}"
        );
        let below = message("constellation.satellites=[7, 1]");
        assert!(below.contains("G01 stands at -"), "{below}");
        let unknown = message("constellation.satellites=[7, 32]");
        assert!(unknown.contains("G32 has no orbit"), "{unknown}");
        let nowhere = format!("{:#}", find("nowhere.toml").unwrap_err());
        assert!(
            nowhere.starts_with("scenario \"nowhere.toml\""),
            "{nowhere}"
        );
        for text in [absent, folded, below, unknown, nowhere] {
            assert!(!text.contains('\n'), "{text}");
        }
    }
}
