//! Lists of point clouds: files that name others, on this machine or by URL.
//!
//! A list is a virtual point cloud (`.vpc`, of QGIS and PDAL), another document of STAC (an item, an item collection, a collection or a
//! catalogue), or a text with a path or a URL in each line. Relative names count from the list itself.

pub(crate) mod listed_cloud;
mod stac;
mod text_list;

use std::path::Path;

use crate::ept::name::is_ept;
use crate::lists::listed_cloud::ListedCloud;
use crate::remote::name::is_url;
use crate::remote::places::last_name;
use sys::{Error, Result};

/// Returns the point clouds that a list names, in its order; `None` if the file at `path` is no list, as far as its name tells, and of a
/// text its first lines.
///
/// # Errors
/// [`Error::Input`] names the list and the item that cannot be used, [`Error::Io`] if a list cannot be read, [`Error::Config`] if a list
/// that it leads to is not there.
pub fn listed_clouds(path: &Path) -> Result<Option<Vec<ListedCloud>>> {
    let shown = path.to_string_lossy();
    let name = last_name(&shown).to_ascii_lowercase();
    if is_ept(path) {
        return Ok(None);
    }
    let clouds = match name.rsplit_once('.').map(|(_, ending)| ending) {
        Some("vpc" | "json") => Some(stac::clouds_of(path)?),
        Some("txt" | "lst") => text_list::clouds_of(path)?,
        // A server of catalogues answers with such a list.
        None if is_url(&shown) && ["items", "search"].contains(&name.as_str()) => Some(stac::clouds_of(path)?),
        _ => None,
    };
    match clouds {
        Some(clouds) if clouds.is_empty() => Err(Error::input(path, "is a list that names no point cloud")),
        clouds => Ok(clouds),
    }
}
