//! The book: docs/ as web pages, by mdBook.

use std::path::Path;

use crate::files::{below, bytes, write};
use crate::step::{CommandLine, Steps, Stop};
use crate::tools;

/// Target of links that leave docs/: the source is not part of the book.
const SOURCE: &str = concat!(env!("CARGO_PKG_REPOSITORY"), "/blob/main/");

/// Renders the book into target/book; installs mdBook first if it is missing.
pub(crate) fn render(steps: &Steps) -> Result<(), Stop> {
    let options = "--no-default-features --features search";
    let mdbook = tools::installed(steps, "mdbook", "0.5.4", options)?;
    let [pages, book] = ["book-pages", "book"].map(|name| steps.target.join(name));
    gather(&steps.root.join("docs"), &pages)?;
    let build = CommandLine::program(mdbook).words("build").arg(&pages);
    steps.run("the book", &build.words("--dest-dir").arg(&book))?;
    let index = steps.built("book/index.html");
    steps.announce(&format!("done. The book: {}", index.display()));
    Ok(())
}

/// Copies the folder of pages. Links that leave it lead to the repository on the web.
fn gather(from: &Path, to: &Path) -> Result<(), Stop> {
    for path in below(from, &|_| true)? {
        let mut bytes = bytes(&path)?;
        if path.extension().is_some_and(|extension| extension == "md") {
            let text = String::from_utf8_lossy(&bytes);
            bytes = text.replace("](../", &format!("]({SOURCE}")).into_bytes();
        }
        write(&to.join(path.strip_prefix(from).unwrap_or(&path)), bytes)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_stay_in_the_book_or_lead_to_the_repository() {
        let (from, to) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        write(&from.path().join("images/a.svg"), b"<svg/>").unwrap();
        let page = b"[here](b.md#c) [there](../firmware/src/main.rs)";
        write(&from.path().join("a.md"), page).unwrap();
        gather(from.path(), to.path()).unwrap();
        let page = std::fs::read_to_string(to.path().join("a.md")).unwrap();
        let expected = format!("[here](b.md#c) [there]({SOURCE}firmware/src/main.rs)");
        assert_eq!(page, expected);
        assert!(SOURCE.starts_with("https://") && to.path().join("images/a.svg").exists());
    }
}
