//! What a list says of a point cloud.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::ept::name::EPT;
use crate::remote::name::{is_url, public_name};
use crate::remote::places::{last_name, resolved};

/// A point cloud that a list names.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedCloud {
    /// Its path, or its public name on another machine.
    pub path: PathBuf,
    /// Where it lies, if the list says that.
    pub claim: Option<ListedBox>,
    /// Names the item, and what the list says in the place of a box that can be used.
    pub unusable_box: Option<String>,
}

/// Where a point cloud lies, as a list says.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedBox {
    /// The system of the box, as the list has it: a code such as `EPSG:2056`, or well-known text.
    pub crs: Arc<str>,
    /// Least x and y, greatest x and y.
    pub bounds: [f64; 4],
}

/// Returns what a list at `list` means by `reference`: a path, or a public name.
///
/// # Errors
/// A sentence about a name that no file can have.
pub(super) fn place_of(list: &Path, reference: &str) -> Result<PathBuf, String> {
    let place = resolved(list, reference).map_err(|error| error.to_string())?;
    match place.to_str().filter(|place| is_url(place)) {
        Some(url) => public_name(url).map(PathBuf::from),
        None => Ok(place),
    }
}

/// Returns the file name in what a list has for a place, in lower case and without a query.
pub(super) fn name_in(reference: &str) -> String {
    last_name(reference.split('?').next().unwrap_or_default()).to_ascii_lowercase()
}

/// Tells whether the file name in what a list has for a place is that of LAS, LAZ or EPT.
pub(super) fn is_cloud(reference: &str) -> bool {
    let name = name_in(reference);
    name == EPT || name.ends_with(".las") || name.ends_with(".laz")
}
