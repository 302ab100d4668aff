//! What inputs of other machines are called. A URL stands where the path of a file could stand, and most of the program does not tell them
//! apart.
//!
//! The query of a URL may be a signature or a token. So the program calls a file by its URL with dots in place of the query: that is its
//! public name, which plans, reports, logs and messages have. The query itself stays in the memory of the process that read the
//! configuration.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use sys::{Error, Result};

/// The schemes that can be read.
const SCHEMES: [&str; 3] = ["https", "http", "s3"];

/// What stands in a public name in place of a query.
const HIDDEN: &str = "?...";

/// The queries by the URLs before them, each in the order in which the program met them.
static QUERIES: Mutex<BTreeMap<String, Vec<String>>> = Mutex::new(BTreeMap::new());

/// Returns the scheme of a URL, whether it can be read or not; `None` for the path of a file.
fn scheme(name: &str) -> Option<&str> {
    let (scheme, _) = name.split_once("://")?;
    let is_one = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_one.then_some(scheme)
}

/// Tells whether `name` is a URL and no path of a file.
pub fn is_url(name: &str) -> bool {
    scheme(name).is_some()
}

/// Tells whether `path` is the name of a file of another machine.
pub(crate) fn is_remote(path: &Path) -> bool {
    path.to_str().is_some_and(is_url)
}

/// Returns the public name of the file or of the files at a URL, and keeps its query for those who open it.
///
/// # Errors
/// A sentence about a URL that no file can be read by. It does not tell the query.
pub fn public_name(url: &str) -> std::result::Result<String, String> {
    let found = scheme(url).unwrap_or_default();
    let rest = url.get(found.len() + 3..).unwrap_or_default();
    let Some(known) = SCHEMES.into_iter().find(|known| found.eq_ignore_ascii_case(known)) else {
        return Err(format!(
            "files can be read by https://, http:// and s3://, not by {found}://: download them, or use an https:// URL"
        ));
    };
    if known == "s3" {
        return object_name(rest);
    }
    let rest = rest.split('#').next().unwrap_or_default();
    let (place, query) = rest.split_once('?').map_or((rest, None), |(place, query)| (place, Some(query)));
    let (host, path) = place.split_once('/').unwrap_or((place, ""));
    if host.contains('@') {
        return Err(format!(
            "{known}://: a URL with a user and a password is refused, because it would be shown: use one with a signature in its \
             query, or download the file"
        ));
    }
    let place = format!("{known}://{place}");
    if host.is_empty() || path.is_empty() || path.ends_with('/') {
        return Err(format!("{place} names no file: name each file of the server"));
    }
    if path.contains('*') {
        return Err(format!(
            "{place}: web servers do not list their files, so name each one (%2A is a star in a name)"
        ));
    }
    if !place.chars().all(|c| c.is_ascii_graphic()) {
        return Err(format!(
            "{place}: a URL must not contain spaces or non-ASCII characters: encode them, such as %20 for a space"
        ));
    }
    Ok(query.map_or(place.clone(), |query| hide(place, query)))
}

/// Returns the public name of an object, or of those that a pattern means.
fn object_name(rest: &str) -> std::result::Result<String, String> {
    let name = format!("s3://{rest}");
    let (bucket, key) = rest.split_once('/').unwrap_or((rest, ""));
    if bucket.is_empty() || bucket.contains(['@', ':', '?', '*']) {
        return Err("s3:// needs the name of a bucket and of an object: s3://bucket/key.laz".into());
    }
    match key.is_empty() || key.ends_with('/') {
        true => {
            let folder = name.trim_end_matches('/');
            Err(format!("{name} is a folder; name the objects in it, for example {folder}/*.laz"))
        }
        false => Ok(name),
    }
}

/// Keeps the query of the URL that begins with `place`, and returns the public name.
fn hide(place: String, query: &str) -> String {
    if query.starts_with("...") && address(&format!("{place}?{query}")).is_ok() {
        return format!("{place}?{query}");
    }
    let mut queries = QUERIES.lock().unwrap_or_else(PoisonError::into_inner);
    let known = queries.entry(place.clone()).or_default();
    let number = known.iter().position(|known| known == query).unwrap_or_else(|| {
        known.push(query.into());
        known.len() - 1
    });
    if number == 0 { format!("{place}{HIDDEN}") } else { format!("{place}{HIDDEN}({})", number + 1) }
}

/// Returns the whole URL of a file with this public name.
///
/// # Errors
/// [`Error::Config`] if this process has not read the configuration that has it.
pub(crate) fn address(name: &str) -> Result<String> {
    let Some((place, number)) = name.split_once(HIDDEN) else { return Ok(name.into()) };
    let number = number.trim_matches(['(', ')']).parse().unwrap_or(1_usize);
    let queries = QUERIES.lock().unwrap_or_else(PoisonError::into_inner);
    let query = queries.get(place).and_then(|known| known.get(number.saturating_sub(1)));
    query.map(|query| format!("{place}?{query}")).ok_or_else(|| {
        Error::Config(format!(
            "{name}: the query of this URL is not stored: write the whole URL into the configuration"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sys::ErrorKind;

    #[test]
    fn a_query_is_hidden_and_kept() {
        let name = |url| public_name(url).unwrap();
        assert_eq!(name("HTTPS://host/a%20b.laz"), "https://host/a%20b.laz");
        let first = name("https://name.test/a.laz?X-Amz-Signature=abc");
        assert_eq!(first, "https://name.test/a.laz?...");
        let second = name("https://name.test/a.laz?X-Amz-Signature=def#part");
        assert_eq!(second, "https://name.test/a.laz?...(2)");
        assert_eq!(name("https://name.test/a.laz?X-Amz-Signature=abc"), first, "the same URL has the same name");
        assert_eq!(name(&second), second, "a public name stays as it is");
        assert_eq!(address(&second).unwrap(), "https://name.test/a.laz?X-Amz-Signature=def");
        assert_eq!(address("https://name.test/a.laz").unwrap(), "https://name.test/a.laz");
        assert_eq!(address("https://name.test/b.laz?...").unwrap_err().kind(), ErrorKind::Usage);
        assert_eq!(name("s3://bucket/a?[b]*.laz"), "s3://bucket/a?[b]*.laz", "in a bucket these are a pattern");
    }

    #[test]
    fn what_names_no_file_is_refused() {
        for (url, words) in [
            ("ftp://host/a.laz", "not by ftp://"),
            ("gs://bucket/a.laz", "not by gs://"),
            ("https://user:secret@host/a.laz?token=secret", "a user and a password"),
            ("https://host/", "names no file"),
            ("https://host", "names no file"),
            ("https:///a.laz", "names no file"),
            ("https://host/clouds/?token=secret", "names no file"),
            ("https://host/*.laz?token=secret", "name each one"),
            ("https://host/a b.laz", "%20"),
            ("s3://bucket", "s3://bucket/*.laz"),
            ("s3://bucket/clouds/", "s3://bucket/clouds/*.laz"),
            ("s3://", "needs the name of a bucket"),
        ] {
            let what = public_name(url).unwrap_err();
            assert!(what.contains(words) && !what.contains("secret"), "{url}: {what}");
        }
        for path in ["a.laz", "/a/b.laz", "C:\\a.laz", "a:b", "://", "1a://b", "clouds/*.laz"] {
            assert!(!is_url(path), "{path}");
        }
    }
}
