//! Any text: nothing in the tree knows the machine it was written on.

use super::{Finding, SourceFile};

/// Where machines keep their own things. In pieces, so that this file does not find itself.
const MACHINE_PATHS: [&str; 6] = [
    concat!("/ho", "me/"),
    concat!("/ro", "ot/"),
    concat!("/wo", "rk/"),
    concat!("/tm", "p/"),
    concat!("/Us", "ers/"),
    concat!("C:", "\\"),
];

/// The registry a lock file may name.
const REGISTRY: &str = "registry+https://github.com/rust-lang/crates.io-index";

/// Checks every text file.
pub(super) fn check(files: &[SourceFile]) -> Vec<Finding> {
    files.iter().flat_map(of_file).collect()
}

fn of_file(file: &SourceFile) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (index, line) in file.text.lines().enumerate() {
        if let Some(path) = MACHINE_PATHS.iter().find(|path| names_path(line, path)) {
            let what = format!("the machine path {path} means nothing elsewhere");
            findings.push(Finding::error(&file.path, index + 1, what));
        }
        if let Some(source) = foreign_registry(file, line) {
            let what = format!("packages come from the public registry alone, not {source}");
            findings.push(Finding::error(&file.path, index + 1, what));
        }
    }
    findings
}

/// Whether `line` has the absolute `path`, not as the end of a longer one.
fn names_path(line: &str, path: &str) -> bool {
    line.match_indices(path).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        !before.is_some_and(|c| c.is_alphanumeric() || "._-/}>".contains(c))
    })
}

/// Another registry or a mirror named in a lock file or cargo configuration.
fn foreign_registry<'a>(file: &SourceFile, line: &'a str) -> Option<&'a str> {
    let line = line.trim();
    if file.path.ends_with("Cargo.lock") {
        let source = line.strip_prefix("source = ")?.trim_matches('"');
        return (source != REGISTRY).then_some(source);
    }
    let configuration = file.path.contains(".cargo/config");
    (configuration && (line.starts_with("[source") || line.starts_with("[registr"))).then_some(line)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(path: &str, text: &str) -> Vec<String> {
        let file = SourceFile {
            path: path.to_owned(),
            text: text.to_owned(),
        };
        check(&[file]).iter().map(Finding::to_string).collect()
    }

    #[test]
    fn machine_paths_are_found_by_line() {
        let text = format!("good\nsee {}someone/notes\n", MACHINE_PATHS[0]);
        let found = found("README.md", &text);
        assert_eq!(found.len(), 1);
        assert!(found[0].starts_with("README.md:2: error: the machine path"));
    }

    #[test]
    fn relative_paths_and_addresses_pass() {
        let text = format!("a{0}b ..{0}c example.org{0}d", MACHINE_PATHS[2]);
        assert_eq!(found("docs/x.md", &text), Vec::<String>::new());
    }

    #[test]
    fn only_the_public_registry_is_locked() {
        let lock =
            format!("source = \"{REGISTRY}\"\nsource = \"registry+https://mirror.example\"\n");
        let found_lock = found("Cargo.lock", &lock);
        assert_eq!(found_lock.len(), 1);
        assert!(found_lock[0].starts_with("Cargo.lock:2: error: packages come from"));
        assert_eq!(found(".cargo/config.toml", "[source.x]\n").len(), 1);
    }
}
