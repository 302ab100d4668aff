//! Places that a file names relative to its own: what a link in a list leads to, and the files beside an index.

use std::path::{Path, PathBuf};

use crate::remote::name::{address, is_remote, is_url};
use sys::Result;

/// Returns the path or the whole URL of what the file at `base` calls `reference`. A query of `base` is not passed on.
///
/// # Errors
/// [`sys::Error::Config`] if nobody knows the query of `base`.
pub(crate) fn resolved(base: &Path, reference: &str) -> Result<PathBuf> {
    if is_url(reference) && !reference.starts_with("file://") {
        return Ok(reference.into());
    }
    if is_remote(base) {
        return Ok(resolved_url(&address(&base.to_string_lossy())?, reference).into());
    }
    let path = reference.strip_prefix("file://").unwrap_or(reference);
    let found = |path: &str| base.parent().unwrap_or(Path::new("")).join(path.strip_prefix("./").unwrap_or(path));
    let as_written = found(path);
    let decoded = percent_decoded(path).map(|path| found(&path));
    let is_decoded = !as_written.exists() && decoded.as_ref().is_some_and(|path| path.exists());
    Ok(decoded.filter(|_| is_decoded).unwrap_or(as_written))
}

/// Returns the whole URL of the file of this relative name beside the one at `url`, with the same query: a signature may be for all of a
/// folder.
pub(crate) fn beside(url: &str, name: &str) -> String {
    let (place, query) = split_query(url);
    let folder = place.rfind('/').map_or("", |at| &place[..at]);
    match query {
        Some(query) => format!("{folder}/{name}?{query}"),
        None => format!("{folder}/{name}"),
    }
}

/// Returns the name of the file of this relative name beside the one at `path`, for messages and for files of this machine.
pub(crate) fn name_beside(path: &Path, name: &str) -> PathBuf {
    match path.to_str().filter(|_| is_remote(path)) {
        Some(url) => beside(split_query(url).0, name).into(),
        None => path.parent().unwrap_or(Path::new("")).join(name),
    }
}

/// Returns the last name of a path or a URL, without a query.
pub(crate) fn last_name(place: &str) -> &str {
    let place = if is_url(place) { split_query(place).0 } else { place };
    place.rsplit(std::path::is_separator).next().unwrap_or_default()
}

/// Splits the query off the URL of a web server. A bucket has names with question marks.
fn split_query(url: &str) -> (&str, Option<&str>) {
    match url.split_once('?') {
        Some((place, query)) if !url.starts_with("s3://") => (place, Some(query)),
        _ => (url, None),
    }
}

fn resolved_url(base: &str, reference: &str) -> String {
    let place = split_query(base).0;
    let (scheme, rest) = place.split_once("://").unwrap_or(("", place));
    let (host, path) = rest.split_once('/').unwrap_or((rest, ""));
    if let Some(other) = reference.strip_prefix("//") {
        return format!("{scheme}://{other}");
    }
    let (name, query) = match scheme {
        "s3" => (reference, ""),
        _ => reference.split_at(reference.find('?').unwrap_or(reference.len())),
    };
    let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let joined = match (name.strip_prefix('/'), name) {
        (Some(absolute), _) => absolute.to_string(),
        (None, "") => path.to_string(),
        (None, _) => format!("{folder}/{name}"),
    };
    let mut steps: Vec<&str> = Vec::new();
    for step in joined.split('/') {
        match step {
            "." => {}
            ".." => drop(steps.pop()),
            _ => steps.push(step),
        }
    }
    format!("{scheme}://{host}/{}{query}", steps.join("/").trim_start_matches('/'))
}

/// Returns a text with the bytes that `%20` and the like stand for; `None` if there are none, or they are no text.
fn percent_decoded(text: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        let code = after.get(..2).filter(|_| *first == b'%').and_then(|code| std::str::from_utf8(code).ok());
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            None => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).ok().filter(|decoded| decoded != text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_of_a_list_by_url_are_resolved() {
        let list = "https://host/a/b/list.json?token=1";
        for (reference, url) in [
            ("c.laz", "https://host/a/b/c.laz"),
            ("./c.laz", "https://host/a/b/c.laz"),
            ("../d/c.laz?x=1/../2", "https://host/a/d/c.laz?x=1/../2"),
            ("../../../c.laz", "https://host/c.laz"),
            ("/c.laz", "https://host/c.laz"),
            ("//other/c.laz", "https://other/c.laz"),
            ("?page=2", "https://host/a/b/list.json?page=2"),
            ("s3://bucket/c.laz", "s3://bucket/c.laz"),
            ("http://other/c.laz?q", "http://other/c.laz?q"),
        ] {
            assert_eq!(resolved_url_of(list, reference), url, "{reference}");
        }
        assert_eq!(resolved_url_of("s3://bucket/list.json", "a/b?.laz"), "s3://bucket/a/b?.laz");
        assert_eq!(resolved_url_of("s3://bucket/a/list.json", "../b.laz"), "s3://bucket/b.laz");
    }

    /// As [`resolved`], of a list with its query.
    fn resolved_url_of(list: &str, reference: &str) -> String {
        match is_url(reference) {
            true => resolved(Path::new(list), reference).unwrap().to_string_lossy().into_owned(),
            false => resolved_url(list, reference),
        }
    }

    #[test]
    fn links_of_a_list_of_this_machine_are_paths() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a b.laz"), "").unwrap();
        let list = folder.path().join("list.vpc");
        let path = |reference: &str| resolved(&list, reference).unwrap();
        let own = |name: &str| folder.path().join(name);
        assert_eq!(path("./c.laz"), own("c.laz"));
        assert_eq!(path("d/c.laz"), own("d/c.laz"));
        assert_eq!((path("a%20b.laz"), path("a b.laz")), (own("a b.laz"), own("a b.laz")));
        assert_eq!(path("c%20d.laz"), own("c%20d.laz"), "what is not there is named as it is written");
        assert_eq!(path("/x/c.laz"), Path::new("/x/c.laz"));
        assert_eq!(path("file:///x/c.laz"), Path::new("/x/c.laz"));
        assert_eq!(path("https://host/c.laz"), Path::new("https://host/c.laz"));
    }

    #[test]
    fn files_beside_an_index_have_its_query() {
        assert_eq!(beside("https://host/a/ept.json?sig=1", "ept-data/0.laz"), "https://host/a/ept-data/0.laz?sig=1");
        assert_eq!(beside("s3://bucket/ept.json", "ept-data/0.laz"), "s3://bucket/ept-data/0.laz");
        let name = |path: &str| name_beside(Path::new(path), "x/0.laz").to_string_lossy().into_owned();
        assert_eq!(name("https://host/a/ept.json?..."), "https://host/a/x/0.laz");
        assert_eq!((name("a/ept.json"), name("ept.json")), ("a/x/0.laz".into(), "x/0.laz".into()));
        assert_eq!((last_name("https://host/ept.json?a/b"), last_name("a/ept.json")), ("ept.json", "ept.json"));
    }
}
