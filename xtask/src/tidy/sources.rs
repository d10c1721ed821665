//! Rust sources: what every file begins with, and which may touch the world.

use std::collections::BTreeSet;

use super::{Finding, SourceFile};

/// Lines after which a file is listed: is it still one idea?
const LONG_FILE_LINES: usize = 450;

/// What only `receiver` and `xtask` may use, with what it stands for.
const WORLD: [(&str, &str); 5] = [
    ("std::fs", "opens paths"),
    ("std::env", "reads the environment"),
    ("SystemTime", "reads the clock"),
    ("Instant", "reads the clock"),
    ("toml::", "parses TOML"),
];

/// Folders whose library code touches nothing but its arguments.
const PURE: [&str; 3] = [
    "crates/gnss-signal/src/",
    "crates/gnss-nav/src/",
    "crates/fault-ml/src/",
];

/// Checks every Rust source among `files`.
pub(super) fn check(files: &[SourceFile]) -> Vec<Finding> {
    let tests = test_modules(files);
    let rust = files.iter().filter(|f| f.path.ends_with(".rs"));
    let of_file = |file: &SourceFile| {
        let mut findings = Vec::from_iter(first_line(file));
        findings.extend(length(file));
        let pure = PURE.iter().any(|folder| file.path.starts_with(folder));
        if pure && !tests.iter().any(|test| belongs_to(&file.path, test)) {
            findings.extend(world(file));
        }
        findings
    };
    rust.flat_map(of_file).collect()
}

fn first_line(file: &SourceFile) -> Option<Finding> {
    let begins = file.text.starts_with("//!");
    let what = "a source begins with '//!' and what it is for";
    (!begins).then(|| Finding::error(&file.path, 1, what))
}

fn length(file: &SourceFile) -> Option<Finding> {
    let lines = file.text.lines().count();
    let what = format!("{lines} lines (more than {LONG_FILE_LINES}): is it still one idea?");
    (lines > LONG_FILE_LINES).then(|| Finding::warning(&file.path, lines, what))
}

/// Uses of the world outside comments and the inline test module, which ends a file.
fn world(file: &SourceFile) -> Vec<Finding> {
    let end = file.text.find("\n#[cfg(test)]\nmod tests {");
    let library = &file.text[..end.unwrap_or(file.text.len())];
    let mut findings = Vec::new();
    for (index, line) in library.lines().enumerate() {
        let code = line.split("//").next().unwrap_or_default();
        for (name, does) in WORLD {
            if has_word(code, name) {
                let what = format!("{name} {does}: only receiver and xtask do");
                findings.push(Finding::error(&file.path, index + 1, what));
            }
        }
    }
    findings
}

/// Whether `word` occurs in `code` and is not part of a longer name.
fn has_word(code: &str, word: &str) -> bool {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    code.match_indices(word).any(|(at, _)| {
        let before = code[..at].chars().next_back();
        let after = code[at + word.len()..].chars().next();
        !before.is_some_and(part) && (word.ends_with(':') || !after.is_some_and(part))
    })
}

/// Path stems of modules that are compiled for tests alone.
fn test_modules(files: &[SourceFile]) -> BTreeSet<String> {
    let mut stems = BTreeSet::new();
    for file in files.iter().filter(|f| f.path.ends_with(".rs")) {
        let folder = module_folder(&file.path);
        let lines: Vec<&str> = file.text.lines().map(str::trim).collect();
        for pair in lines.windows(2) {
            let name = pair[1]
                .split("mod ")
                .nth(1)
                .and_then(|m| m.strip_suffix(';'));
            if let ("#[cfg(test)]", Some(name)) = (pair[0], name) {
                stems.insert(format!("{folder}/{name}"));
            }
        }
    }
    stems
}

/// Folder in which the modules of the file at `path` lie.
fn module_folder(path: &str) -> &str {
    let stem = path.strip_suffix(".rs").unwrap_or(path);
    ["/mod", "/lib", "/main"]
        .iter()
        .find_map(|end| stem.strip_suffix(end))
        .unwrap_or(stem)
}

/// Whether the file at `path` is the module at `stem` or lies below it.
fn belongs_to(path: &str, stem: &str) -> bool {
    let rest = path.strip_prefix(stem);
    rest.is_some_and(|rest| rest == ".rs" || rest.starts_with('/'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(files: &[(&str, &str)]) -> Vec<String> {
        let files: Vec<_> = files
            .iter()
            .map(|(path, text)| SourceFile {
                path: (*path).to_owned(),
                text: (*text).to_owned(),
            })
            .collect();
        check(&files).iter().map(Finding::to_string).collect()
    }

    #[test]
    fn every_source_says_what_it_is_for() {
        let found = found(&[
            ("xtask/src/a.rs", "fn a() {}\n"),
            ("xtask/src/b.rs", "//! B.\n"),
        ]);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("xtask/src/a.rs:1: error: a source begins"));
    }

    #[test]
    fn lower_crates_do_not_touch_the_world() {
        let text = "//! X.\nuse std::fs;\n// std::env in a comment\nfn instantly() {}\n";
        assert_eq!(
            found(&[
                ("crates/gnss-nav/src/x.rs", text),
                ("crates/receiver/src/x.rs", text)
            ]),
            ["crates/gnss-nav/src/x.rs:2: error: std::fs opens paths: only receiver and xtask do"]
        );
    }

    #[test]
    fn tests_may() {
        let inline = "//! X.\nfn a() {}\n#[cfg(test)]\nmod tests {\n    use std::fs;\n}\n";
        let parent = "//! X.\n#[cfg(test)]\nmod seen;\nmod unseen;\n";
        let child = "//! X.\nlet t = Instant::now();\n";
        let files = [
            ("crates/gnss-signal/src/a.rs", inline),
            ("crates/gnss-signal/src/b/mod.rs", parent),
            ("crates/gnss-signal/src/b/seen.rs", child),
            ("crates/gnss-signal/src/b/seen/deep.rs", child),
            ("crates/gnss-signal/tests/c.rs", child),
        ];
        assert_eq!(found(&files), Vec::<String>::new());
        let unseen = found(&[files[1], ("crates/gnss-signal/src/b/unseen.rs", child)]);
        assert_eq!(unseen.len(), 1);
        assert!(unseen[0].starts_with("crates/gnss-signal/src/b/unseen.rs:2: error: Instant"));
    }

    #[test]
    fn a_module_for_tests_does_not_hide_what_follows_it() {
        let text =
            "//! X.\n#[cfg(test)]\nmod support;\nuse std::env;\n#[cfg(test)]\nmod tests {\n}\n";
        let found = found(&[("crates/fault-ml/src/lib.rs", text)]);
        assert_eq!(found.len(), 1);
        assert!(
            found[0].starts_with("crates/fault-ml/src/lib.rs:4:"),
            "{}",
            found[0]
        );
    }

    #[test]
    fn long_files_are_listed_not_refused() {
        let text = format!("//! Long.\n{}", "\n".repeat(LONG_FILE_LINES));
        assert!(found(&[("xtask/src/long.rs", &text)])[0].contains("warning: 451 lines"));
    }
}
