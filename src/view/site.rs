//! From the target of a request to a result in the output directory.

use std::fs::File;
use std::path::{Path, PathBuf};

use percent_encoding::percent_decode_str;

use crate::view::hosts::Hosts;
use crate::view::results::Results;

/// What is served.
pub(super) struct Site {
    /// The output directory, without links.
    pub(super) root: PathBuf,
    /// The files that may be served.
    pub(super) results: Results,
    /// The page that shows it, if it is built in.
    pub(super) page: Option<String>,
    /// Whom it is for.
    pub(super) hosts: Hosts,
    /// Whether pages of other servers may read the files.
    pub(super) cors: bool,
}

/// What a request is for.
pub(super) enum Target {
    Page(String),
    File(PathBuf, File),
    Nothing,
}

impl Site {
    /// Returns what the request target `url` names.
    pub(super) fn target(&self, url: &str) -> Target {
        let Some(names) = names_in(url) else { return Target::Nothing };
        if names.is_empty() || names == ["index.html"] {
            return self.page.clone().map_or(Target::Nothing, Target::Page);
        }
        self.file(&names).map_or(Target::Nothing, |(path, file)| Target::File(path, file))
    }

    /// Opens the result with these names below the output directory. No part of its path may be a link, and its letters must be those of
    /// its name on systems that take others for the same. Opening a pipe would wait.
    fn file(&self, names: &[String]) -> Option<(PathBuf, File)> {
        if !self.results.contain(&names.join("/")) {
            return None;
        }
        let path = self.root.join(names.iter().collect::<PathBuf>());
        let is_itself = path.canonicalize().ok()?.as_os_str() == path.as_os_str();
        let file = (is_itself && path.is_file()).then(|| File::open(&path).ok())??;
        Some((path, file))
    }
}

/// Returns the names in the path of a request target, or `None` if one of them could lead elsewhere. Two slashes count as one.
fn names_in(url: &str) -> Option<Vec<String>> {
    let path = url.split(['?', '#']).next()?.strip_prefix('/')?;
    path.split('/').filter(|name| !name.is_empty()).map(name_of).collect()
}

fn name_of(encoded: &str) -> Option<String> {
    let name = percent_decode_str(encoded).decode_utf8().ok()?;
    // A colon would name another disk of Windows, or a stream beside a file.
    let is_plain = name != "." && name != ".." && !name.contains(['/', '\\', ':', '\0']);
    // As the last check, what the system itself takes for a plain name.
    let mut parts = Path::new(name.as_ref()).components();
    let is_one = matches!(parts.next(), Some(std::path::Component::Normal(_))) && parts.next().is_none();
    (is_plain && is_one).then(|| name.into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_page_the_root_is_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().canonicalize().unwrap();
        let site = |page: Option<&str>| Site {
            results: Results::new(&root),
            root: root.clone(),
            page: page.map(Into::into),
            hosts: Hosts::new(&[]),
            cors: true,
        };
        for url in ["/", "/index.html"] {
            assert!(matches!(site(None).target(url), Target::Nothing), "{url}");
            assert!(matches!(site(Some("<p>")).target(url), Target::Page(page) if page == "<p>"), "{url}");
        }
    }

    #[test]
    fn a_path_has_plain_names_only() {
        assert_eq!(names_in("/tiles/000%30.glb?x=/../y").unwrap(), ["tiles", "0000.glb"]);
        assert_eq!(names_in("//tiles//a%20b").unwrap(), ["tiles", "a b"]);
        for bad in
            ["/..", "/a/../b", "/%2e%2e/x", "/.%2E/x", "/a%2f..%2fb", "/%5c..", "/C%3a", "/a%00", "/%ff", "/./a", "x"]
        {
            assert_eq!(names_in(bad), None, "{bad}");
        }
        assert_eq!(names_in("http://other/x"), None);
    }
}
