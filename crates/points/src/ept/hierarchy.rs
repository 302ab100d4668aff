//! The hierarchy of an EPT: which nodes there are, and how many points each has. It is read page by page, as far as bounds need it.

use std::fmt;
use std::path::Path;

use rayon::prelude::*;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::ept::files::page;
use crate::ept::key::NodeKey;
use crate::ept::name::page_name;
use crate::remote::places::name_beside;
use sys::{Error, Result, interrupt};

/// The most nodes of a data set: they are held in memory.
const MOST_NODES: usize = 1 << 23;

/// What a hierarchy has for a node whose points, and those below it, are in a page of their own.
const PAGE: i64 = -1;

/// A node and its number of points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Node {
    pub(crate) key: NodeKey,
    pub(crate) points: u64,
}

/// The nodes that are wanted.
#[derive(Debug, Default)]
pub(crate) struct Hierarchy {
    /// Those with points, by their keys.
    pub(crate) nodes: Vec<Node>,
    /// The points of all nodes in the pages that were read.
    pub(crate) points: u64,
    /// Whether all pages were read.
    pub(crate) is_whole: bool,
}

impl Hierarchy {
    /// Reads the nodes of the EPT at `index` for which `is_wanted`, and of whose ancestors that is true too.
    ///
    /// # Errors
    /// [`Error::Input`] names the page that is wrong, [`Error::Io`] if one cannot be read.
    pub(crate) fn read(index: &Path, is_wanted: impl Fn(NodeKey) -> bool + Sync) -> Result<Hierarchy> {
        let mut found = Hierarchy { is_whole: true, ..Hierarchy::default() };
        let mut pages = vec![NodeKey::default()];
        while !pages.is_empty() {
            let read = pages.par_iter().map(|root| entries(index, *root)).collect::<Result<Vec<_>>>()?;
            let mut next = Vec::new();
            for entries in read {
                interrupt::check()?;
                for (key, points) in entries {
                    match u64::try_from(points) {
                        Ok(0) => {}
                        Ok(points) => {
                            found.points = found.points.saturating_add(points);
                            found.nodes.extend(is_wanted(key).then_some(Node { key, points }));
                        }
                        Err(_) if is_wanted(key) => next.push(key),
                        Err(_) => found.is_whole = false,
                    }
                }
            }
            if found.nodes.len() + next.len() > MOST_NODES {
                return Err(Error::input(
                    index,
                    format!("has more than {MOST_NODES} nodes: divide it by [input] bounds"),
                ));
            }
            pages = next;
        }
        found.nodes.sort_unstable_by_key(|node| node.key);
        match found.nodes.windows(2).find(|pair| pair[0].key == pair[1].key) {
            Some(pair) => Err(Error::input(index, format!("has the node {} twice in its hierarchy", pair[0].key))),
            None => Ok(found),
        }
    }
}

/// Returns the entries of a page, each with its number of points, or [`PAGE`].
fn entries(index: &Path, root: NodeKey) -> Result<Vec<(NodeKey, i64)>> {
    let refused = |what: String| Error::input(name_beside(index, &page_name(root)), what);
    let bytes = page(index, root)?;
    let Entries(entries) = serde_json::from_slice(bytes.as_ref())
        .map_err(|error| refused(format!("is not a readable page of the hierarchy: {error}")))?;
    let entry = |(text, points): (String, i64)| {
        let key = NodeKey::parse(&text).filter(|key| key.is_within(root));
        let key = key.ok_or_else(|| refused(format!("has the node {text:?}, which does not belong to it")))?;
        // A page that leads to itself would never end.
        let is_number = points >= 0 || points == PAGE && key != root;
        is_number.then_some((key, points)).ok_or_else(|| refused(format!("has {points} as the points of node {key}")))
    };
    let mut entries = entries.into_iter().map(entry).collect::<Result<Vec<_>>>()?;
    entries.sort_unstable();
    match entries.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some(pair) => Err(refused(format!("has the node {} twice: build or copy the data set again", pair[0].0))),
        None => Ok(entries),
    }
}

/// The members of an object, also those of one name.
struct Entries(Vec<(String, i64)>);

impl<'de> Deserialize<'de> for Entries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Entries, D::Error> {
        deserializer.deserialize_map(EntriesVisitor)
    }
}

struct EntriesVisitor;

impl<'de> Visitor<'de> for EntriesVisitor {
    type Value = Entries;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object of nodes and their points")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> std::result::Result<Entries, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(Entries(entries))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sys::ErrorKind;

    fn read(pages: &[(&str, &str)], is_wanted: fn(NodeKey) -> bool) -> Result<Hierarchy> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("ept-hierarchy")).unwrap();
        for (root, text) in pages {
            std::fs::write(folder.path().join("ept-hierarchy").join(format!("{root}.json")), text).unwrap();
        }
        Hierarchy::read(&folder.path().join("ept.json"), is_wanted)
    }

    const PAGES: [(&str, &str); 2] = [
        ("0-0-0-0", r#"{"0-0-0-0": 5, "1-1-0-0": -1, "1-0-0-0": 3, "2-0-0-0": 0}"#),
        ("1-1-0-0", r#"{"1-1-0-0": 7, "2-2-0-0": 2}"#),
    ];

    #[test]
    fn pages_are_read_as_needed() {
        let all = read(&PAGES, |_| true).unwrap();
        let nodes: Vec<(String, u64)> = all.nodes.iter().map(|node| (node.key.to_string(), node.points)).collect();
        let expected = [("0-0-0-0", 5), ("1-0-0-0", 3), ("1-1-0-0", 7), ("2-2-0-0", 2)];
        assert_eq!(nodes, expected.map(|(key, points)| (key.to_string(), points)));
        assert_eq!((all.points, all.is_whole), (17, true));
        // The second page is not there, and not asked for.
        let west = read(&PAGES[..1], |key| key.0 == 0 || key.1[0] == 0).unwrap();
        assert_eq!((west.nodes.len(), west.points, west.is_whole), (2, 8, false));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_page() {
        for (pages, words) in [
            (&PAGES[..1], "ept-hierarchy/1-1-0-0.json of its hierarchy is not there"),
            (&[("0-0-0-0", "{\"0-0-0-0\": 5")], "0-0-0-0.json: is not a readable page of the hierarchy"),
            (&[("0-0-0-0", r#"{"0-0-0-0": -1}"#)], "has -1 as the points of node 0-0-0-0"),
            (&[("0-0-0-0", r#"{"0-0-0-0": -2}"#)], "has -2 as the points"),
            (&[("0-0-0-0", r#"{"1-2-0-0": 2}"#)], "has the node \"1-2-0-0\", which does not belong"),
            (&[PAGES[0], ("1-1-0-0", r#"{"1-0-0-0": 7}"#)], "1-1-0-0.json: has the node \"1-0-0-0\""),
            (&[PAGES[0], ("1-1-0-0", r#"{"1-1-0-0": 7, "01-1-0-0": 7}"#)], "1-1-0-0.json: has the node 1-1-0-0 twice"),
            (&[("0-0-0-0", r#"{"0-0-0-0": 7, "1-0-0-0": 1, "0-0-0-0": 8}"#)], "has the node 0-0-0-0 twice"),
            (&[("0-0-0-0", "[5]")], "expected an object of nodes"),
        ] {
            let error = read(pages, |_| true).unwrap_err();
            assert!(error.kind() == ErrorKind::Input && error.to_string().contains(words), "{words}: {error}");
        }
    }
}
