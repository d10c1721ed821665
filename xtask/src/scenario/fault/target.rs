//! Whom a fault befalls.

use anyhow::Result;
use gnss_nav::SatelliteId;
use serde::Deserialize;

/// Which satellites a fault befalls.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(untagged)]
pub enum Target {
    /// `"G07"`, or `"all"`.
    One(String),
    /// `["G07", "G11"]`.
    Several(Vec<String>),
}

impl Target {
    /// The satellites among those `heard`.
    ///
    /// # Errors
    /// Names one that is not heard or no satellite.
    pub fn satellites(&self, heard: &[SatelliteId]) -> Result<Vec<SatelliteId>> {
        let names = match self {
            Self::One(name) if name == "all" => return Ok(heard.to_vec()),
            Self::One(name) => std::slice::from_ref(name),
            Self::Several(names) => names,
        };
        let find = |name: &String| {
            let found = heard.iter().find(|s| s.to_string() == *name).copied();
            let known: Vec<String> = heard.iter().map(ToString::to_string).collect();
            found.ok_or_else(|| {
                anyhow::anyhow!(
                    "sat is {name:?}: expected \"all\" or one of {}",
                    known.join(" ")
                )
            })
        };
        names.iter().map(find).collect()
    }
}
