//! One page over the reports of all papers.

use std::fmt::Write as _;

use super::Outcome;

/// What holds of each paper, where its report is, and what does not hold.
pub(super) fn page(outcomes: &[Outcome]) -> String {
    let mut text = String::from(
        "# Papers repeated\n\n| paper | checks that hold | figures |\n|---|---|---|\n",
    );
    for outcome in outcomes {
        let paper = outcome.paper;
        let held = outcome.checks.iter().filter(|check| check.holds).count();
        let pictures = outcome.pictures.iter();
        let pictures: Vec<String> = pictures
            .map(|(name, _)| format!("[{}]({paper}/{name})", name.trim_end_matches(".svg")))
            .collect();
        let _ = writeln!(
            text,
            "| [{paper}]({paper}/report.md) | {held} of {} | {} |",
            outcome.checks.len(),
            pictures.join(", ")
        );
    }
    let failed = outcomes.iter().flat_map(|outcome| {
        let failed = outcome.checks.iter().filter(|check| !check.holds);
        failed.map(move |check| (outcome.paper, check))
    });
    let failed: Vec<String> = failed
        .map(|(paper, check)| {
            format!(
                "- {paper}: {}: {:.3} {}\n",
                check.name, check.ours, check.unit
            )
        })
        .collect();
    if !failed.is_empty() {
        text += "\n## What does not hold\n\n";
        text += &failed.concat();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::Check;

    #[test]
    fn an_index_links_reports_and_names_what_fails() {
        let outcome = |paper, ours| Outcome {
            paper,
            figures: serde_json::Value::Null,
            checks: vec![Check::at_most("delay".to_owned(), ours, 2.0, "s")],
            report: String::new(),
            pictures: vec![("figure1.svg".to_owned(), String::new())],
            tables: Vec::new(),
        };
        let good = outcome("nobody1999", 1.0);
        let text = page(std::slice::from_ref(&good));
        assert!(text.contains(
            "| [nobody1999](nobody1999/report.md) | 1 of 1 | [figure1](nobody1999/figure1.svg) |"
        ));
        assert!(!text.contains("does not hold"));
        let text = page(&[good, outcome("noone2000", 3.0)]);
        assert!(text.contains("- noone2000: delay at most 2.0000 s: 3.000 s"));
    }
}
