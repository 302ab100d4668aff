//! The objects of a bucket that a pattern means.

use std::collections::{BTreeSet, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::Read;

use glob::{MatchOptions, Pattern};

use crate::remote::network::client::{Address, Headers, refusal};
use crate::remote::network::failure::{Failure, FailureKind};
use crate::remote::network::signature::encoded;
use crate::remote::network::timeouts::{Timeouts, persist};
use crate::remote::network::window::Pending;
use sys::{Error, Result};

/// As on the command line: a star does not reach beyond a slash.
const RULES: MatchOptions =
    MatchOptions { case_sensitive: true, require_literal_separator: true, require_literal_leading_dot: false };

/// The characters that make a key a pattern.
const SPECIAL: [char; 3] = ['*', '?', '['];

/// The longest answer that is read; a thousand keys of the greatest length are shorter.
const LONGEST: u64 = 1 << 23;

/// The most elements and texts of an answer; a thousand objects have some ten thousand.
const MOST_NODES: u32 = 200_000;

/// The most answers of a list, of a thousand objects each. Objects may appear while the list is read, but no list goes on for ever.
const MOST_PAGES: usize = 20_000;

/// The most objects that a pattern may match, and the most bytes of their names: they are held in memory.
const MOST_OBJECTS: usize = 1_000_000;
const MOST_BYTES: usize = 1 << 26;

/// One answer of S3: a thousand keys at most.
struct Page {
    keys: Vec<String>,
    /// Where the next page begins.
    next: Option<String>,
}

/// Returns the public names of the files that a public name means, in the order of their keys: several if it is a pattern in a bucket,
/// otherwise itself.
///
/// # Errors
/// [`Error::Config`] if it is no pattern or there is no such bucket, [`Error::Io`] if it cannot be listed.
pub(crate) fn files_at(name: &str) -> Result<Vec<String>> {
    let object = name.strip_prefix("s3://").and_then(|rest| rest.split_once('/'));
    let Some((bucket, key)) = object.filter(|(_, key)| key.contains(SPECIAL)) else { return Ok(vec![name.into()]) };
    let pattern = Pattern::new(key).map_err(|error| Error::Config(format!("{name}: {error}")))?;
    let literal = &key[..key.find(SPECIAL).unwrap_or(key.len())];
    // Without a pattern in a folder's name, one folder is enough.
    let is_in_one_folder = !key[literal.len()..].contains('/') && !key.contains("**");
    let wanted = |key: &String| !key.ends_with('/') && pattern.matches_with(key, RULES);
    let mut list = ObjectList::default();
    let mut next = None;
    loop {
        let address = Address::List { bucket: bucket.into(), query: query(literal, is_in_one_folder, next.as_deref()) };
        next = list.add(page(address, name)?, wanted).map_err(|error| Error::Config(format!("{name}: {error}")))?;
        if next.is_none() {
            return Ok(list.found.into_iter().map(|key| format!("s3://{bucket}/{key}")).collect());
        }
    }
}

/// Why a list is not read to its end.
#[derive(Debug, thiserror::Error)]
enum ListError {
    #[error("the server repeats parts of the bucket's list, so the list never ends: name each object")]
    Repeated,
    #[error(
        "the list of the bucket has more than {MOST_PAGES} pages of objects: use a longer prefix before the first star"
    )]
    Pages,
    #[error(
        "more than {MOST_OBJECTS} objects match, or their names have more than {} MiB: split the job, with narrower patterns",
        MOST_BYTES >> 20
    )]
    Objects,
}

/// The objects that were found, and what tells a list that never ends.
#[derive(Default)]
struct ObjectList {
    found: BTreeSet<String>,
    /// The bytes of the names in `found`.
    bytes: usize,
    pages: usize,
    /// Hashes of the tokens that lead to next pages, and of the last key of every page.
    known: HashSet<u64>,
}

impl ObjectList {
    /// Adds the wanted keys of a page, and returns the token of the next one.
    fn add(&mut self, page: Page, wanted: impl Fn(&String) -> bool) -> std::result::Result<Option<String>, ListError> {
        self.pages += 1;
        let marks =
            page.keys.last().map(|key| ("key", key)).into_iter().chain(page.next.as_ref().map(|next| ("next", next)));
        for mark in marks {
            let mut hasher = DefaultHasher::new();
            mark.hash(&mut hasher);
            if !self.known.insert(hasher.finish()) {
                return Err(ListError::Repeated);
            }
        }
        for key in page.keys.into_iter().filter(wanted) {
            self.bytes += key.len();
            self.found.insert(key);
        }
        match page.next {
            _ if self.found.len() > MOST_OBJECTS || self.bytes > MOST_BYTES => Err(ListError::Objects),
            Some(_) if self.pages >= MOST_PAGES => Err(ListError::Pages),
            next => Ok(next),
        }
    }
}

/// Returns the query for a page, with its parameters in the order that signatures want.
fn query(prefix: &str, is_in_one_folder: bool, next: Option<&str>) -> String {
    let parameters = [
        ("continuation-token", next),
        ("delimiter", is_in_one_folder.then_some("/")),
        ("list-type", Some("2")),
        ("prefix", Some(prefix)),
    ];
    let text = |(name, value): (&str, Option<&str>)| value.map(|value| format!("{name}={}", encoded(value, "")));
    parameters.into_iter().filter_map(text).collect::<Vec<_>>().join("&")
}

fn page(address: Address, name: &str) -> Result<Page> {
    let fetch = move || {
        persist(Timeouts::standard(), false, || {
            let answer = address.ask(&Headers::new()).map_err(|failure| (0, failure))?;
            if answer.status() != 200 {
                return Err((0, refusal(answer, &address)));
            }
            let mut text = Vec::new();
            let read = answer.into_body().into_reader().take(LONGEST).read_to_end(&mut text);
            let broken = |error| (0, Failure::new(FailureKind::Passing, format!("the list broke off: {error}")));
            read.map(|_| text).map_err(broken)
        })
    };
    let outcome = Pending::begin(0..0, fetch).wait()?;
    let text = outcome.map_err(|failure| failure.into_error(name.as_ref(), "the list of the bucket: "))?;
    let text = String::from_utf8_lossy(&text.bytes);
    parse(&text)
        .ok_or_else(|| Error::Config(format!("{name}: the server does not list buckets as S3 does: name each object")))
}

fn parse(text: &str) -> Option<Page> {
    let options = roxmltree::ParsingOptions { nodes_limit: MOST_NODES, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(text, options).ok()?;
    let root = document.root_element();
    if root.tag_name().name() != "ListBucketResult" {
        return None;
    }
    let value = |node: roxmltree::Node, name: &str| {
        let child = node.children().find(|child| child.tag_name().name() == name);
        child.and_then(|child| child.text()).map(str::to_string)
    };
    let objects = root.children().filter(|node| node.tag_name().name() == "Contents");
    let keys = objects.filter_map(|node| value(node, "Key")).collect();
    let is_cut = value(root, "IsTruncated").is_some_and(|cut| cut == "true");
    let next = value(root, "NextContinuationToken");
    // A server that knows only the first version of the list has no such token, and would give the first page alone.
    if is_cut && next.is_none() {
        return None;
    }
    Some(Page { keys, next: next.filter(|_| is_cut) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sys::ErrorKind;

    #[test]
    fn a_page_has_keys_and_leads_to_the_next() {
        let page = parse(
            "<?xml version=\"1.0\"?><ListBucketResult xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\"><Name>b</Name>\
             <IsTruncated>true</IsTruncated><Contents><Key>a/&amp; b.laz</Key><Size>1</Size></Contents>\
             <Contents><Key>a/c.laz</Key></Contents><CommonPrefixes><Prefix>a/d/</Prefix></CommonPrefixes>\
             <NextContinuationToken>1ue/=</NextContinuationToken></ListBucketResult>",
        );
        let page = page.unwrap();
        assert_eq!(page.keys, ["a/& b.laz", "a/c.laz"]);
        assert_eq!(page.next.as_deref(), Some("1ue/="));
        let cut =
            "<ListBucketResult><IsTruncated>true</IsTruncated><Contents><Key>a</Key></Contents></ListBucketResult>";
        assert!(parse(cut).is_none(), "the rest of the list is lost");
        assert!(parse("<html></html>").is_none() && parse("no list").is_none());
    }

    fn page_of(keys: &[String], next: Option<&str>) -> Page {
        Page { keys: keys.to_vec(), next: next.map(str::to_string) }
    }

    #[test]
    fn a_list_that_repeats_itself_ends() {
        let [one, two] = ["a", "b"].map(|key| [key.to_string()]);
        let added = |pages: &[(&[String], &str)]| {
            let mut list = ObjectList::default();
            pages
                .iter()
                .map(|&(keys, next)| list.add(page_of(keys, Some(next)), |_| true))
                .find_map(|added| added.err())
        };
        assert!(added(&[(&one, "1"), (&two, "2"), (&[], "3"), (&[], "4")]).is_none(), "pages may be empty");
        for pages in [[(&one[..], "1"), (&two, "1")], [(&one, "1"), (&one, "2")], [(&[], "1"), (&[], "1")]] {
            assert!(matches!(added(&pages), Some(ListError::Repeated)), "{pages:?}");
        }
        assert!(matches!(added(&[(&one, "1"), (&two, "2"), (&[], "1")]), Some(ListError::Repeated)));
    }

    #[test]
    fn a_list_that_never_ends_does_not_fill_the_memory() {
        let mut list = ObjectList::default();
        let long = |at: usize| [format!("{at}{}", "x".repeat(MOST_BYTES / 50))];
        let outcome = (0..).find_map(|at| list.add(page_of(&long(at), Some(&at.to_string())), |_| true).err());
        let error = outcome.unwrap();
        assert!(matches!(error, ListError::Objects) && list.found.len() == 50, "{error}");
        assert!(error.to_string().contains("64 MiB"), "{error}");
        let mut list = ObjectList::default();
        let pages =
            (0..).find_map(|at| list.add(page_of(&[], Some(&at.to_string())), |_| true).err().map(|e| (at + 1, e)));
        assert!(matches!(pages, Some((MOST_PAGES, ListError::Pages))), "{pages:?}");
    }

    #[test]
    fn a_query_is_in_the_order_of_its_names() {
        assert_eq!(
            query("a b/", true, Some("1/=")),
            "continuation-token=1%2F%3D&delimiter=%2F&list-type=2&prefix=a%20b%2F"
        );
        assert_eq!(query("", false, None), "list-type=2&prefix=");
    }

    #[test]
    fn what_is_no_pattern_is_not_listed() {
        for name in ["s3://bucket/a/b.laz", "https://host/a.laz?...", "http://host/[a].laz"] {
            assert_eq!(files_at(name).unwrap(), [name]);
        }
        assert_eq!(files_at("s3://bucket/[.laz").unwrap_err().kind(), ErrorKind::Usage);
    }
}
