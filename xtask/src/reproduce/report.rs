//! What all reports share.

use std::fmt::Write as _;

use super::Check;

/// The checks as the last section of a report.
#[must_use]
pub fn checks_table(checks: &[Check]) -> String {
    let mut text =
        String::from("## Checks\n\n| check | paper | ours | holds |\n|---|---|---|---|\n");
    for check in checks {
        let paper = check
            .paper
            .map_or_else(|| "-".to_owned(), |paper| paper.to_string());
        let (name, ours, unit) = (&check.name, check.ours, check.unit);
        let holds = if check.holds { "yes" } else { "**no**" };
        let _ = writeln!(text, "| {name} | {paper} | {ours:.3} {unit} | {holds} |");
    }
    text
}
