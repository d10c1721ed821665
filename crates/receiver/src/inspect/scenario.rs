//! What a scenario says arrives at the antenna, as far as its file tells.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use toml::{Table, Value};

/// Keys that every scenario has, and nothing else that is written in TOML here.
const REQUIRED: [&str; 4] = ["description", "duration_s", "trajectory", "front_end"];

/// The scenario in `path`; `None` where it holds none.
pub(super) fn read(path: &Path) -> Option<Table> {
    let is_toml = path
        .extension()
        .is_some_and(|extension| extension == "toml");
    let text = is_toml.then(|| fs::read_to_string(path).ok())??;
    let table: Table = text.parse().ok()?;
    let is_scenario = REQUIRED.iter().all(|key| table.contains_key(*key));
    is_scenario.then_some(table)
}

/// Description, duration, front end and faults. The generator alone knows whether all of it is possible.
#[must_use]
pub fn scenario_text(scenario: &Table) -> String {
    let value = |section: &str, key: &str| {
        let value = scenario.get(section).and_then(|s| s.get(key));
        value.map_or_else(|| "by default".to_owned(), plain)
    };
    let top = |key: &str| scenario.get(key).map(plain).unwrap_or_default();
    let mut text = format!(
        "scenario: {}\n{} s, trajectory {}, clock {}, {} at {} Hz\n",
        top("description"),
        top("duration_s"),
        value("trajectory", "kind"),
        value("clock", "preset"),
        value("front_end", "format"),
        value("front_end", "sample_rate_hz"),
    );
    let faults = scenario.get("fault").and_then(Value::as_array);
    for fault in faults.into_iter().flatten() {
        let field = |key: &str| fault.get(key).map(plain);
        let _ = writeln!(
            text,
            "{} of {} from {} s on",
            field("kind").unwrap_or_else(|| "fault".to_owned()),
            field("sat").unwrap_or_else(|| "all reception".to_owned()),
            field("begin_s").unwrap_or_else(|| "0".to_owned()),
        );
    }
    text
}

/// A string without its quotes.
fn plain(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scenario_is_told_from_a_configuration() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let scenario = "description = \"A walk\"\nduration_s = 20\n[trajectory]\nkind = \"road\"\n\
                        [front_end]\nformat = \"ci8\"\nsample_rate_hz = 4e6\n\
                        [[fault]]\nkind = \"blocked\"\nsat = \"G14\"\nbegin_s = 8\n";
        fs::write(&path, scenario).unwrap();
        let text = scenario_text(&read(&path).unwrap());
        assert!(
            text.starts_with("scenario: A walk\n20 s, trajectory road, clock by default, ci8 at"),
            "{text}"
        );
        assert!(text.ends_with("blocked of G14 from 8 s on\n"), "{text}");
        for other in ["format = \"ci8\"\n", "no TOML ["] {
            fs::write(&path, other).unwrap();
            assert_eq!(read(&path), None);
        }
    }
}
