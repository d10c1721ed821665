//! `cargo xtask campaign`: many seeded runs of scenarios, one row each, taken up again where it was left.

mod plan;
mod rows;

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

pub use plan::{Case, Plan, Seeds};

use self::rows::{Row, Rows};
use crate::judged::in_parallel;
use crate::order::quantile;
use crate::scenario::command::receive;

/// Runs between two writes: little is lost by an end in between, and all cores are kept busy.
const BATCH: usize = 8;
/// Copy of the plan beside the rows, by which the same campaign is known again.
const PLAN_NAME: &str = "campaign.toml";

/// Makes and receives every run of the campaign in `file` that `folder` has no row of yet; returns what is to be said.
///
/// # Errors
/// Where the plan is wrong, `folder` holds another campaign, or a run fails; rows that are written stay.
pub fn campaign(file: &Path, folder: &Path) -> Result<String> {
    let plan = Plan::read(file)?;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    claim(&plan, folder)?;
    let runs = plan.runs();
    let named: Vec<(&str, u64)> = runs
        .iter()
        .map(|(case, seed)| (case.name.as_str(), *seed))
        .collect();
    let mut rows = Rows::open(folder, &named)?;
    let begun = rows.all().len();
    for due in runs[begun..].chunks(BATCH) {
        let made = in_parallel(due.len(), |number| run(&plan, due[number], folder))?;
        rows.append(made)?;
    }
    let mut text = format!(
        "{} runs, {begun} of them from before, are in {}\n\n",
        runs.len(),
        rows.path().display()
    );
    text += &table(&plan, rows.all())?;
    Ok(text)
}

/// Leaves a copy of the plan in `folder`, which must not hold the rows of another one.
fn claim(plan: &Plan, folder: &Path) -> Result<()> {
    let path = folder.join(PLAN_NAME);
    match fs::read_to_string(&path) {
        Ok(text) => anyhow::ensure!(
            text == plan.text,
            "{}: another campaign was begun here: expected the same plan or another --out",
            path.display()
        ),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            fs::write(&path, &plan.text)
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        Err(error) => {
            return Err(error).with_context(|| format!("cannot read {}", path.display()));
        }
    }
    Ok(())
}

fn run(plan: &Plan, (case, seed): (&Case, u64), folder: &Path) -> Result<Row> {
    let name = format!("{}-{seed}", case.name);
    let scenario = plan.scenario(case, seed).with_context(|| name.clone())?;
    let out = folder.join("runs").join(&name);
    let received = receive(&scenario, plan.level, &out, &plan.options(case));
    let summary = received.with_context(|| name.clone())?;
    if !plan.keep {
        fs::remove_dir_all(&out).with_context(|| format!("cannot remove {}", out.display()))?;
    }
    Ok(Row::new(&case.name, seed, &summary))
}

/// A line for each case.
fn table(plan: &Plan, rows: &[Row]) -> Result<String> {
    let mut text = "| case | runs | with a fix | first fix, median (s) | availability, least | horizontal rms, median and 95 % of runs (m) | \
                    largest horizontal error (m) | runs with an alarm |\n|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for case in &plan.cases {
        let of_case: Vec<&Row> = rows.iter().filter(|row| row.case() == case.name).collect();
        let values = |column| of_case.iter().filter_map(move |row| row.number(column));
        writeln!(
            text,
            "| {} | {} | {} | {:.2} | {:.4} | {:.2}, {:.2} | {:.2} | {} |",
            case.name,
            of_case.len(),
            values("first_fix_s").count(),
            quantile(values("first_fix_s"), 0.5),
            quantile(values("availability"), 0.0),
            quantile(values("horizontal_rms_m"), 0.5),
            quantile(values("horizontal_rms_m"), 0.95),
            quantile(values("horizontal_max_m"), 1.0),
            values("alarms").filter(|alarms| *alarms > 0.0).count(),
        )?;
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: &str = "seeds = { first = 3, count = 2 }\noptions = [\"--mode\", \"vector\"]\n\
        [[case]]\nname = \"clean\"\nscenario = \"static-open-sky\"\n\
        set = [\"duration_s=4.0\", \"receiver={assisted=true}\"]\n\
        [[case]]\nname = \"stepped\"\nscenario = \"static-open-sky\"\n\
        set = [\"duration_s=6.0\", \"receiver={assisted=true}\", \"fault=[{kind=\\\"step\\\",sat=\\\"G17\\\",begin_s=4,size_m=200}]\"]\n";

    #[test]
    fn it_goes_on_where_it_was_left_and_gives_the_same_rows() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("plan.toml");
        fs::write(&file, PLAN).unwrap();
        let (whole, broken) = (folder.path().join("a"), folder.path().join("b"));
        let said = campaign(&file, &whole).unwrap();
        assert!(said.starts_with("4 runs, 0 of them from before"), "{said}");
        let rows = |folder: &Path| fs::read_to_string(folder.join("runs.csv")).unwrap();
        let expected = rows(&whole);
        assert_eq!(expected.lines().count(), 5);
        let stepped = expected.lines().nth(3).unwrap();
        assert!(
            stepped.starts_with("stepped,3,6.000,") && stepped.contains(",G17,"),
            "{stepped}"
        );
        // It ended in the middle of the third row.
        let cut = expected.lines().nth(2).unwrap();
        let kept = expected.find(cut).unwrap() + cut.len() + 9;
        fs::create_dir_all(&broken).unwrap();
        fs::write(broken.join("campaign.toml"), PLAN).unwrap();
        fs::write(broken.join("runs.csv"), &expected[..kept]).unwrap();
        let said = campaign(&file, &broken).unwrap();
        assert!(said.starts_with("4 runs, 2 of them from before"), "{said}");
        assert_eq!(rows(&broken), expected);
        // Another plan has no business here.
        fs::write(&file, PLAN.replace("first = 3", "first = 4")).unwrap();
        let refused = campaign(&file, &broken).unwrap_err().to_string();
        assert!(refused.contains("another campaign"), "{refused}");
    }
}
