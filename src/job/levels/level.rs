//! Step 7 of a job, by inner tile of the pyramid: the meshes of its children, read back from their files, joined and simplified.

use crate::job::durable::directory::Directory;
use crate::job::durable::journal::Done;
use crate::job::durable::store::Store;
use crate::job::levels::hierarchy::{Child, Pyramid, Sizes};
use crate::job::records::{Level, LevelTile};
use crate::job::tiles::write::{Look, write_tile};
use crate::output::frame::Frame;
use crate::output::gltf::read::{TileFile, read_tile};
use crate::output::lod::join::join;
use crate::output::lod::simplify::simplify;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;
use std::path::PathBuf;

/// What one coarser tile, or all of them, came to.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct LevelFigures {
    /// GLB files in `levels`.
    pub files: u64,
    /// Triangles in them.
    pub triangles: u64,
    /// Bytes of them.
    pub bytes: u64,
    /// The greatest vertical distance between one of them and the exact mesh, metres.
    pub error_m: f64,
}

impl AddAssign for LevelFigures {
    fn add_assign(&mut self, other: LevelFigures) {
        self.files += other.files;
        self.triangles += other.triangles;
        self.bytes += other.bytes;
        self.error_m = self.error_m.max(other.error_m);
    }
}

/// Makes inner tile `at` of the pyramid, whose children must be there. Leaves in the job directory what `tileset.json` will say of
/// it and of the exact tiles below it; with `content` its mesh in `levels` too.
///
/// # Errors
/// [`Error::Io`] on the output or the job directory, [`Error::Broken`] if a file there is not what an earlier step has written.
pub fn run(
    directory: &Directory,
    store: &Store,
    pyramid: &Pyramid,
    at: usize,
    look: &Look,
    sizes: Sizes,
    content: bool,
) -> Result<Done<LevelFigures>> {
    let inner = &pyramid.inner[at];
    let mut below = Below::default();
    for &child in &inner.children {
        below.add(directory, store, pyramid, child, content && inner.content)?;
    }
    let Below { files, leaves, bounds, error } = below;
    let (mut figures, mut results) = (LevelFigures::default(), Vec::new());
    let mut own = LevelTile::new(bounds, false);
    if content && inner.content && !files.is_empty() {
        let joined = join(&look.frame, &files).map_err(|what| broken(inner.node, &what))?;
        drop(files);
        let simple = simplify(&look.frame, &joined, sizes.target(joined.triangles.len()))?;
        // Both lie between the lowest and the highest vertex.
        own.error = (error + simple.error).min(height_range(&look.frame, bounds));
        own.content = 1;
        directory.create_levels()?;
        let written = write_tile(&directory.level(inner.node), &simple.tile, look)?;
        let triangles = simple.tile.triangles.len() as u64;
        figures = LevelFigures { files: 1, triangles, bytes: written.bytes, error_m: own.error };
        results.push(written);
    }
    let stored = Level { own, leaves }.save(store, inner.node)?;
    Ok(Done { results, ..Done::new(figures, vec![stored]) })
}

/// Metres.
fn height_range(frame: &Frame, bounds: Option<[[i32; 3]; 2]>) -> f64 {
    bounds.map_or(0.0, |[low, high]| (high[2] as f64 - low[2] as f64) * frame.resolution_metres()[1])
}

fn broken(node: usize, what: &str) -> Error {
    Error::Broken(format!("the tiles below node {node} do not go together: {what}"))
}

/// What the children of a tile come to.
#[derive(Default)]
struct Below {
    files: Vec<TileFile>,
    leaves: Vec<LevelTile>,
    bounds: Option<[[i32; 3]; 2]>,
    /// The greatest of a child, metres.
    error: f64,
}

impl Below {
    fn add(&mut self, directory: &Directory, store: &Store, pyramid: &Pyramid, child: Child, keep: bool) -> Result<()> {
        match child {
            Child::Leaf(tile) => {
                let own = LevelTile::load(store, tile)?;
                self.widen(own.bounds());
                if keep && own.content > 0 {
                    self.files.push(read(directory.tile(tile))?);
                }
                self.leaves.push(own);
            }
            Child::Inner(at) => {
                let node = pyramid.inner[at].node;
                let own = Level::load(store, node)?.own;
                self.widen(own.bounds());
                self.error = self.error.max(own.error);
                if keep && own.content > 0 {
                    self.files.push(read(directory.level(node))?);
                }
            }
        }
        Ok(())
    }

    fn widen(&mut self, bounds: Option<[[i32; 3]; 2]>) {
        self.bounds = self.bounds.into_iter().chain(bounds).reduce(crate::job::partition::read::around);
    }
}

/// What this program has written a moment ago.
fn read(path: PathBuf) -> Result<TileFile> {
    read_tile(&path).map_err(|error| match error {
        Error::Input { .. } => Error::Broken(error.to_string()),
        other => other,
    })
}
