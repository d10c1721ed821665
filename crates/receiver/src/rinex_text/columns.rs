//! Columns of a line.

/// Columns `from..to` of a line, as far as there are any, without blanks around them.
pub(crate) fn columns(line: &[u8], from: usize, to: usize) -> &[u8] {
    let end = to.min(line.len());
    line.get(from..end).unwrap_or_default().trim_ascii()
}

/// The label of a header line.
pub(crate) fn label(line: &[u8]) -> &[u8] {
    columns(line, 60, 80)
}

/// The number in columns `from..to`; none where they hold none.
pub(crate) fn number<T: std::str::FromStr>(line: &[u8], from: usize, to: usize) -> Option<T> {
    std::str::from_utf8(columns(line, from, to))
        .ok()?
        .parse()
        .ok()
}

/// Bytes for an error message.
pub(crate) fn shown(text: &[u8]) -> String {
    const MOST: usize = 40;
    let cut = text.get(..MOST).unwrap_or(text);
    String::from_utf8_lossy(cut)
        .chars()
        .map(|c| if c.is_control() { '?' } else { c })
        .collect()
}
