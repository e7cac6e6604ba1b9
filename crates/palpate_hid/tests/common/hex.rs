//! Parsing of data files: hexadecimal bytes, comments after `#`, parts that begin with a name in brackets.

pub use crate::bytes::bytes;

/// Lines of the part `name`.
pub fn part(text: &str, name: &str) -> Vec<String> {
    let head = format!("[{name}]");
    let after = text.lines().skip_while(|line| *line != head).skip(1);
    let lines = after.take_while(|line| !line.starts_with('[')).map(|line| without_comment(line).trim());
    let lines: Vec<String> = lines.filter(|line| !line.is_empty()).map(str::to_owned).collect();
    assert!(!lines.is_empty(), "no part {head}");
    lines
}

fn without_comment(line: &str) -> &str {
    line.split('#').next().unwrap_or_default()
}

/// Formats a report as a line of the same form.
pub fn line(verb: &str, bytes: &[u8]) -> String {
    bytes.iter().fold(verb.to_owned(), |line, byte| format!("{line} {byte:02x}"))
}
