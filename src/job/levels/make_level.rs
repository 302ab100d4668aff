//! Step 7, once for each coarser tile: reads the meshes of its children back from their files, joins and simplifies them.

use crate::geometry::Bounds;
use crate::job::durable::directory::{JobDirectory, create_folder};
use crate::job::index::NodeIndex;
use crate::job::levels::hierarchy::{ChildTile, Hierarchy, LevelSizes};
use crate::job::records::{LevelSummary, StepOutput, Store, TileSummary};
use crate::job::tiles::style::TileStyle;
use crate::job::tiles::write_tile::write_glb;
use crate::output::frame::Frame;
use crate::output::gltf::read::{TileFile, read_tile};
use crate::output::lod::join::join;
use crate::output::lod::simplify::simplify;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;
use std::path::PathBuf;

/// The figures of one coarser tile, or of all.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct LevelStats {
    /// GLB files in `levels`.
    pub files: u64,
    /// Triangles in them.
    pub triangles: u64,
    /// Their bytes.
    pub bytes: u64,
    /// The greatest vertical distance between one of them and the exact mesh in metres.
    pub error_m: f64,
}

impl AddAssign for LevelStats {
    fn add_assign(&mut self, other: LevelStats) {
        self.files += other.files;
        self.triangles += other.triangles;
        self.bytes += other.bytes;
        self.error_m = self.error_m.max(other.error_m);
    }
}

/// Makes coarser tile `index` of the hierarchy, whose children must exist. Stores what `tileset.json` says of it and of the exact
/// tiles among its children. With `content` it writes the mesh too.
///
/// # Errors
/// [`Error::Io`] on the output or the store, [`Error::Broken`] if a file is not what an earlier step wrote.
pub fn make_level(
    directory: &JobDirectory,
    store: &Store,
    hierarchy: &Hierarchy,
    index: usize,
    style: &TileStyle,
    sizes: LevelSizes,
    content: bool,
) -> Result<StepOutput<LevelStats>> {
    let coarse = &hierarchy.tiles[index];
    let mut children = ChildMeshes::default();
    for &child in &coarse.children {
        children.add(directory, store, hierarchy, child, content && coarse.content)?;
    }
    let ChildMeshes { files: meshes, leaves, bounds, error } = children;
    let (mut stats, mut files) = (LevelStats::default(), Vec::new());
    let mut own = TileSummary::new(bounds, false);
    if content && coarse.content && !meshes.is_empty() {
        let joined = join(&style.frame, &meshes).map_err(|what| contradiction(coarse.node, &what))?;
        drop(meshes);
        let simple = simplify(&style.frame, &joined, sizes.target(joined.triangles.len()))?;
        // No error is greater than the range of heights: both meshes lie within it.
        own.error = (error + simple.error).min(height_range(&style.frame, bounds));
        own.content = 1;
        create_folder(&directory.output().levels())?;
        let written = write_glb(&directory.output().level(coarse.node.get()), &simple.tile, style)?;
        let triangles = simple.tile.triangles.len() as u64;
        stats = LevelStats { files: 1, triangles, bytes: written.bytes, error_m: own.error };
        files.push(written);
    }
    let record = LevelSummary { own, leaves }.save(store, coarse.node)?;
    Ok(StepOutput { files, ..StepOutput::new(stats, vec![record]) })
}

/// Returns the range of heights in metres.
fn height_range(frame: &Frame, bounds: Option<Bounds<3>>) -> f64 {
    bounds.map_or(0.0, |bounds| bounds.extent(2) as f64 * frame.resolution_metres()[1])
}

fn contradiction(node: NodeIndex, what: &impl std::fmt::Display) -> Error {
    Error::Broken(format!("the tiles below node {node} do not fit together: {what}"))
}

/// The children of a coarser tile.
#[derive(Default)]
struct ChildMeshes {
    files: Vec<TileFile>,
    /// The exact tiles among them.
    leaves: Vec<TileSummary>,
    bounds: Option<Bounds<3>>,
    /// The greatest error of a child in metres.
    error: f64,
}

impl ChildMeshes {
    /// Adds a child, and its mesh if `with_mesh` is set.
    fn add(
        &mut self,
        directory: &JobDirectory,
        store: &Store,
        hierarchy: &Hierarchy,
        child: ChildTile,
        with_mesh: bool,
    ) -> Result<()> {
        match child {
            ChildTile::Exact(tile) => {
                let own = TileSummary::load(store, tile)?;
                self.widen(own.bounds());
                if with_mesh && own.content > 0 {
                    self.files.push(read_own(directory.output().tile(tile.get()))?);
                }
                self.leaves.push(own);
            }
            ChildTile::Coarse(index) => {
                let node = hierarchy.tiles[index].node;
                let own = LevelSummary::load(store, node)?.own;
                self.widen(own.bounds());
                self.error = self.error.max(own.error);
                if with_mesh && own.content > 0 {
                    self.files.push(read_own(directory.output().level(node.get()))?);
                }
            }
        }
        Ok(())
    }

    fn widen(&mut self, bounds: Option<Bounds<3>>) {
        self.bounds = self.bounds.into_iter().chain(bounds).reduce(Bounds::union);
    }
}

/// Reads a tile that this program wrote a moment ago: if it is bad, the program is.
fn read_own(path: PathBuf) -> Result<TileFile> {
    read_tile(&path).map_err(|error| match error {
        Error::Input { .. } => Error::Broken(error.to_string()),
        other => other,
    })
}
