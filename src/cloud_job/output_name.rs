//! What the output directory of point clouds is called that the command line gives no name.

use crate::init::plain;
use std::path::{Path, PathBuf};
use sys::path_text::PATTERN_SIGNS;

/// What the name ends with, and what it is where the clouds have no name in common.
const TERRAIN: &str = "terrain";

/// What the names of COPC files have before their ending.
const COPC: &str = ".copc";

/// Returns `cloud-terrain` for `cloud.laz`, `tiles-terrain` for the folder `tiles` or for files in it, and `terrain` for several files of
/// the current folder or of several folders.
pub(crate) fn output_name(clouds: &[PathBuf]) -> String {
    let name = match clouds {
        [one] if one.is_dir() => name_of(&one.canonicalize().unwrap_or_else(|_| one.clone())),
        [one] if folder_of_pattern(one).is_none() => of_ept(one).or_else(|| stem(one)),
        many => common_folder(many).and_then(|folder| name_of(&folder)),
    };
    match name.map(|name| plain(&name)).filter(|name| !name.is_empty()) {
        Some(name) => format!("{name}-{TERRAIN}"),
        None => TERRAIN.into(),
    }
}

/// Returns the folder in which all clouds are, if there is one.
fn common_folder(clouds: &[PathBuf]) -> Option<PathBuf> {
    let folder = |cloud: &PathBuf| folder_of_pattern(cloud).or_else(|| cloud.parent().map(Path::to_path_buf));
    let first = folder(clouds.first()?)?;
    clouds.iter().all(|cloud| folder(cloud).as_ref() == Some(&first)).then_some(first)
}

/// Returns the folder before the first sign of a pattern, or `None` if the path has no such sign or is that of a file.
fn folder_of_pattern(cloud: &Path) -> Option<PathBuf> {
    let text = cloud.to_str()?;
    let text = if points::is_url(text) { text.split('?').next().unwrap_or_default() } else { text };
    let before = &text[..text.find(PATTERN_SIGNS)?];
    let end = before.rfind(std::path::is_separator).unwrap_or(0);
    (!cloud.exists()).then(|| PathBuf::from(&before[..end]))
}

/// Returns the name of the folder of an EPT; `None` for any other file.
fn of_ept(cloud: &Path) -> Option<String> {
    let text = cloud.to_string_lossy();
    let path = if points::is_url(&text) { text.split('?').next().unwrap_or_default() } else { &text };
    points::is_ept(cloud).then(|| Path::new(path).parent().and_then(name_of)).flatten()
}

/// Returns the name of a file without its ending.
fn stem(cloud: &Path) -> Option<String> {
    let text = cloud.to_string_lossy();
    let path = if points::is_url(&text) { text.split('?').next().unwrap_or_default() } else { &text };
    let stem = Path::new(path).file_stem()?.to_string_lossy().into_owned();
    Some(stem.strip_suffix(COPC).unwrap_or(&stem).to_string())
}

fn name_of(folder: &Path) -> Option<String> {
    Some(folder.file_name()?.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_output_is_called_as_the_clouds_are() {
        for (clouds, name) in [
            (&["cloud.laz"][..], "cloud-terrain"),
            (&["/data/cloud.copc.laz"], "cloud-terrain"),
            (&["tile.01.LAS"], "tile.01-terrain"),
            (&["Gelände Ost/Straße 1.csv"], "Straße 1-terrain"),
            (&["a$b.laz"], "a_b-terrain"),
            (&["a.laz", "b.laz"], "terrain"),
            (&["tiles/a.laz", "tiles/b.laz"], "tiles-terrain"),
            (&["east/a.laz", "west/b.laz"], "terrain"),
            (&["tiles/*.laz"], "tiles-terrain"),
            (&["/data/tiles/**/*.laz"], "tiles-terrain"),
            (&["*.laz"], "terrain"),
            (&["tiles/a.laz", "tiles/b*.laz"], "tiles-terrain"),
            (&["https://host/dir/a.copc.laz?X-Amz-Signature=SECRET"], "a-terrain"),
            (&["s3://bucket/clouds/*.laz"], "clouds-terrain"),
            (&["https://host/valley/ept.json?key=a"], "valley-terrain"),
            (&["ept.json"], "ept-terrain"),
            (&["lists/north.vpc"], "north-terrain"),
            (&["/"], "terrain"),
        ] {
            let clouds: Vec<PathBuf> = clouds.iter().map(PathBuf::from).collect();
            assert_eq!(output_name(&clouds), name, "{clouds:?}");
        }
    }

    #[test]
    fn the_output_of_a_folder_has_its_name() {
        let root = tempfile::tempdir().unwrap();
        let tiles = root.path().join("my tiles");
        std::fs::create_dir(&tiles).unwrap();
        for folder in [tiles.clone(), tiles.join("."), tiles.join("../my tiles/")] {
            assert_eq!(output_name(&[folder]), "my tiles-terrain");
        }
        let odd = root.path().join("a[1].laz");
        std::fs::write(&odd, "").unwrap();
        assert_eq!(output_name(&[odd]), "a_1_-terrain");
    }
}
