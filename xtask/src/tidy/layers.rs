//! Which crate may depend on which.

use anyhow::{Context, Result};
use serde::Deserialize;

use super::Finding;

/// Members from the bottom up, each with the members it may depend on.
const LAYERS: [(&str, &[&str]); 6] = [
    ("gnss-signal", &[]),
    ("gnss-nav", &[]),
    ("fault-ml", &[]),
    ("receiver", &["gnss-signal", "gnss-nav", "fault-ml"]),
    (
        "xtask",
        &["gnss-signal", "gnss-nav", "fault-ml", "receiver"],
    ),
    (
        "end-to-end-tests",
        &["gnss-signal", "gnss-nav", "fault-ml", "receiver", "xtask"],
    ),
];

/// Crates that parse configuration or command lines; the lower crates take values.
const UPPER_ONLY: [&str; 3] = ["toml", "clap", "anyhow"];

#[derive(Debug, Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    workspace_root: String,
}

#[derive(Debug, Deserialize)]
struct Package {
    name: String,
    manifest_path: String,
    dependencies: Vec<Dependency>,
}

#[derive(Debug, Deserialize)]
struct Dependency {
    name: String,
    kind: Option<String>,
}

/// Checks the dependencies in `metadata`, the output of `cargo metadata --no-deps`.
pub(super) fn check(metadata: &str) -> Result<Vec<Finding>> {
    let metadata: Metadata = serde_json::from_str(metadata).context("cargo metadata")?;
    let mut findings = Vec::new();
    for package in &metadata.packages {
        let below_root = package.manifest_path.strip_prefix(&metadata.workspace_root);
        let file = below_root
            .unwrap_or(&package.manifest_path)
            .trim_start_matches('/');
        let Some((_, allowed)) = LAYERS.iter().find(|(name, _)| *name == package.name) else {
            let what = format!(
                "{} has no place in the layers (xtask/src/tidy/layers.rs)",
                package.name
            );
            findings.push(Finding::error(file, 1, what));
            continue;
        };
        findings.extend(package.dependencies.iter().filter_map(|dependency| {
            let what = refusal(package, allowed, dependency)?;
            Some(Finding::error(file, 1, what))
        }));
    }
    Ok(findings)
}

fn refusal(package: &Package, allowed: &[&str], dependency: &Dependency) -> Option<String> {
    let name = dependency.name.as_str();
    let is_member = LAYERS.iter().any(|(member, _)| *member == name);
    if is_member && !allowed.contains(&name) {
        let kind = dependency.kind.as_deref().unwrap_or("normal");
        let may = if allowed.is_empty() {
            "no member".to_owned()
        } else {
            allowed.join(", ")
        };
        return Some(format!(
            "{} depends on {name} ({kind}): of this workspace it may depend on {may}",
            package.name
        ));
    }
    (allowed.is_empty() && UPPER_ONLY.contains(&name) && dependency.kind.is_none()).then(|| {
        format!(
            "{} depends on {name}: only receiver and xtask may",
            package.name
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A package and its dependencies with their kinds.
    type Sketch<'a> = (&'a str, &'a [(&'a str, Option<&'a str>)]);

    fn findings(packages: &[Sketch]) -> Vec<String> {
        let packages: Vec<_> = packages
            .iter()
            .map(|(name, dependencies)| {
                let dependencies: Vec<_> = dependencies
                    .iter()
                    .map(|(name, kind)| serde_json::json!({"name": name, "kind": kind}))
                    .collect();
                serde_json::json!({
                    "name": name,
                    "manifest_path": format!("/x/crates/{name}/Cargo.toml"),
                    "dependencies": dependencies,
                })
            })
            .collect();
        let metadata = serde_json::json!({"packages": packages, "workspace_root": "/x"});
        let found = check(&metadata.to_string()).unwrap();
        found.iter().map(Finding::to_string).collect()
    }

    #[test]
    fn arrows_that_point_down_pass() {
        let found = findings(&[
            ("gnss-nav", &[("nalgebra", None), ("proptest", Some("dev"))]),
            ("receiver", &[("gnss-nav", None), ("toml", None)]),
            ("end-to-end-tests", &[("xtask", Some("dev"))]),
        ]);
        assert_eq!(found, Vec::<String>::new());
    }

    #[test]
    fn arrows_up_or_sideways_fail_even_in_tests() {
        let found = findings(&[
            ("gnss-signal", &[("gnss-nav", Some("dev"))]),
            ("receiver", &[("xtask", None)]),
        ]);
        assert_eq!(
            found,
            [
                "crates/gnss-signal/Cargo.toml:1: error: gnss-signal depends on gnss-nav (dev): \
                 of this workspace it may depend on no member",
                "crates/receiver/Cargo.toml:1: error: receiver depends on xtask (normal): \
                 of this workspace it may depend on gnss-signal, gnss-nav, fault-ml",
            ]
        );
    }

    #[test]
    fn configuration_stays_out_of_the_lower_crates() {
        assert_eq!(findings(&[("fault-ml", &[("toml", None)])]).len(), 1);
    }

    #[test]
    fn a_new_member_needs_a_place() {
        assert!(findings(&[("oddments", &[])])[0].contains("no place in the layers"));
    }
}
