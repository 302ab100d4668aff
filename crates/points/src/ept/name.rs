//! What the files of an EPT are called.

use std::path::Path;

use crate::ept::key::NodeKey;
use crate::remote::places::last_name;

/// The name of its index.
pub(crate) const EPT: &str = "ept.json";

/// The folders of its pages and its nodes.
pub(crate) const PAGES: &str = "ept-hierarchy";
pub(crate) const NODES: &str = "ept-data";

/// Tells whether a path or a public name is that of the index of an EPT.
pub fn is_ept(path: &Path) -> bool {
    last_name(&path.to_string_lossy()).eq_ignore_ascii_case(EPT)
}

/// Returns the name of a page of the hierarchy, from the folder of the index.
pub(crate) fn page_name(root: NodeKey) -> String {
    format!("{PAGES}/{root}.json")
}

/// Returns the name of a node with this ending, likewise.
pub(crate) fn node_name(node: NodeKey, ending: &str) -> String {
    format!("{NODES}/{node}.{ending}")
}
