//! Width of comments, which `cargo fmt` does not change.

use std::path::Path;

use crate::files::texts;
use crate::step::Stop;

/// Greatest width in characters: the `max_width` of rustfmt.toml.
const WIDTH: usize = 110;

/// Checks all Rust files under `root`.
///
/// # Errors
/// The lines of comments that are wider, with file and line number.
pub(crate) fn check(root: &Path) -> Result<(), Stop> {
    let mut wide = Vec::new();
    for (file, text) in texts(root, ".rs")? {
        let file = file.strip_prefix(root).unwrap_or(&file);
        let is_wide = |line: &str| line.trim_start().starts_with("//") && line.chars().count() > WIDTH;
        let lines = text.lines().enumerate().filter(|(_, line)| is_wide(line));
        wide.extend(lines.map(|(index, _)| format!("{}:{}", file.display(), index + 1)));
    }
    wide.sort();
    if wide.is_empty() {
        return Ok(());
    }
    let wide = wide.join("\n");
    Err(Stop::failed(format!(
        "comments of more than {WIDTH} columns:\n{wide}"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_that_is_wider_than_code_is_named_with_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let comment = |width: usize| format!("    // {}\n", "µ".repeat(width - 7));
        let code = format!("let _ = \"{}\";\n", "x".repeat(WIDTH));
        std::fs::write(dir.path().join("a.rs"), code + &comment(WIDTH)).unwrap();
        check(dir.path()).unwrap();
        std::fs::write(dir.path().join("b.rs"), comment(WIDTH) + &comment(WIDTH + 1)).unwrap();
        let told = check(dir.path()).unwrap_err().message;
        assert_eq!(told, "comments of more than 110 columns:\nb.rs:2");
    }
}
