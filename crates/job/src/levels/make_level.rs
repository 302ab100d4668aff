//! Step 7, once for each coarser tile: reads the meshes of its children back from their files, joins and simplifies them.

use crate::durable::atomic_file::PendingFile;
use crate::durable::directory::JobDirectory;
use crate::index::{NodeIndex, PartIndex};
use crate::levels::hierarchy::{BYTES_PER_LEVEL_VERTEX, ChildTile, Hierarchy, LevelSizes};
use crate::levels::level_mesh::{load_mesh, save_mesh};
use crate::levels::shares::{Share, share_of};
use crate::partition::tree::{NodeKind, Tree};
use crate::plan::job_plan::Plan;
use crate::records::{ExactTile, LevelSummary, StepRecord, Store, TileSummary};
use crate::tiles::style::TileStyle;
use crate::tiles::write_tile::write_glb;
use delaunay::geometry::{Bounds, bounds_of};
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use sys::{Error, Result};
use tiles::frame::Frame;
use tiles::gltf::read::{TileFile, read_tile};
use tiles::lod::join::Joining;
use tiles::lod::simplify::{Simplified, simplify};
use tiles::tile::Tile;

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
    /// Coarser tiles without a mesh, because the tiles below them take too much memory.
    pub left_out: u64,
}

impl LevelStats {
    /// Returns what the user should know about coarser tiles without a mesh.
    pub(crate) fn left_out_warning(&self, plan: &Plan) -> Option<String> {
        (self.left_out > 0).then(|| {
            format!(
                "{} of {} coarser tiles are left out for lack of memory ([limits] memory = \"{}\"): viewers load the finer ones at once; \
                 fix: more [limits] memory, or a lower [triangulation] max_points_per_tile",
                self.left_out,
                self.files + self.left_out,
                plan.options.limits.memory
            )
        })
    }
}

impl AddAssign for LevelStats {
    fn add_assign(&mut self, other: LevelStats) {
        self.files += other.files;
        self.triangles += other.triangles;
        self.bytes += other.bytes;
        self.error_m = self.error_m.max(other.error_m);
        self.left_out += other.left_out;
    }
}

/// Where the coarser tiles of a job are made.
pub(crate) struct LevelContext<'a> {
    /// Holds the tiles, finer and coarser.
    pub directory: &'a JobDirectory,
    /// Holds what `tileset.json` says of them.
    pub store: &'a Store,
    /// The coarser tiles.
    pub hierarchy: &'a Hierarchy,
    /// How tiles look.
    pub style: &'a TileStyle,
    /// How large coarser tiles are to be.
    pub sizes: LevelSizes,
    /// Whether they have meshes.
    pub meshes: bool,
    /// The part that they belong to; for those above the parts, the number of parts.
    pub part: PartIndex,
    /// Returns the topmost tile of a part.
    pub top_of: TopOf<'a>,
    /// Whether an update may make a tile again from the meshes of those below.
    pub keeps_meshes: bool,
}

/// Returns the topmost tile of a part.
pub(crate) type TopOf<'a> = &'a (dyn Fn(PartIndex) -> Result<Child> + Sync);

/// The greatest part of a tile's width that its error is. A tile of a few vertices is worth showing from afar all the same.
const PART_OF_WIDTH: f64 = 0.5;

/// How far the surface is off on average, for each metre that its vertices are. In woods, vertices stand out of the surface.
const SURFACE_TO_VERTICES: f64 = 0.5;

/// Returns the error in metres by which viewers choose the level of a tile within `bounds`: the distance between its vertices, because
/// nothing smaller than that is left in it, and the height by which it misses the surface on average. With the greatest distance instead,
/// every tree would make all levels equally bad, and viewers would load the exact tiles.
fn seen_error(spacing: f64, typical_error: f64, frame: &Frame, bounds: Bounds<3>) -> f64 {
    let width = bounds.extent(0).max(bounds.extent(1)) as f64 * frame.resolution_metres()[0];
    (spacing + SURFACE_TO_VERTICES * typical_error).min(PART_OF_WIDTH * width)
}

/// Makes coarser tile `index` of the hierarchy, whose children must exist. Stores what `tileset.json` says of it and of the exact
/// tiles among its children. It has no mesh if its children have too many vertices for the memory, or if one of them has none for
/// that reason.
///
/// # Errors
/// [`Error::Io`] on the output or the store, [`Error::Broken`] if a file is not what an earlier step wrote.
pub(crate) fn make_level(context: &LevelContext, index: usize) -> Result<(LevelStats, Vec<PendingFile>)> {
    let coarse = &context.hierarchy.tiles[index];
    let children = coarse.children.iter().map(|&child| Child::find(context, child)).collect::<Result<Vec<_>>>()?;
    let bounds = children.iter().filter_map(|child| child.own.bounds()).reduce(Bounds::union);
    let (mut stats, mut files) = (LevelStats::default(), Vec::new());
    let mut own = TileSummary::new(bounds, 0);
    children.iter().filter_map(|child| child.own.drawn()).for_each(|bounds| own.draw(bounds));
    if let (true, Some(bounds)) = (context.meshes, bounds) {
        match memory_for(&children).filter(|bytes| *bytes <= context.sizes.memory) {
            None => stats.left_out = 1,
            Some(_) => {
                let share = share_of(context.store, context.hierarchy, context.sizes, index)?;
                let Level { shown, surface, working, simple } = Level::of(context, coarse.node, &children, share)?;
                let of_children =
                    |error: fn(&TileSummary) -> f64| children.iter().map(|c| error(&c.own)).fold(0.0, f64::max);
                shown.bounds().into_iter().for_each(|bounds| own.draw(bounds));
                // No distance is greater than the range of heights: all meshes lie within it.
                let range = height_range(&context.style.frame, bounds.union(surface));
                let of_meshes = of_children(|own| own.mesh_error);
                own.mesh_error = (of_meshes + simple.working_error).min(range);
                own.greatest_error = (of_meshes + simple.shown_error).min(range);
                // What one level adds to the error has little to do with what the next one adds.
                let before = of_children(|own| own.typical_error);
                own.typical_error = (before * before + simple.typical_error * simple.typical_error).sqrt();
                let seen = seen_error(simple.spacing, own.typical_error, &context.style.frame, bounds);
                own.error = seen.max(of_children(|own| own.error));
                own.vertices = working.positions.len() as u32;
                save_mesh(context.store, coarse.node, &working)?;
                let path = context.directory.output().level(context.part.node_number(coarse.node));
                let written = write_glb(&path, &shown, context.style)?;
                let triangles = shown.triangles.len() as u64;
                stats =
                    LevelStats { files: 1, triangles, bytes: written.bytes, error_m: own.greatest_error, left_out: 0 };
                files.push(written);
            }
        }
    }
    for child in children.iter().filter(|_| !context.keeps_meshes) {
        if let ChildMesh::Record(node) = child.mesh {
            context.store.free(StepRecord::LevelMesh(node))?;
        }
    }
    let leaves = children.iter().filter(|child| child.exact).map(|child| child.own).collect();
    LevelSummary { own, leaves }.save(context.store, coarse.node)?;
    Ok((stats, files))
}

/// Returns the bytes of memory that making coarser tile `index` takes, whose children must exist: 0 if it is left out.
///
/// # Errors
/// [`Error::Io`] or [`Error::Broken`] on the store.
pub(crate) fn level_memory(context: &LevelContext, index: usize) -> Result<u64> {
    let children = context.hierarchy.tiles[index].children.iter().map(|&child| Child::find(context, child));
    let needed = memory_for(&children.collect::<Result<Vec<_>>>()?);
    Ok(needed.filter(|bytes| *bytes <= context.sizes.memory).unwrap_or(0))
}

/// Returns the bytes of memory that joining and simplifying `children` takes; `None` if one of them has been left out.
fn memory_for(children: &[Child]) -> Option<u64> {
    let vertices: u64 = children.iter().map(|child| u64::from(child.own.vertices)).sum();
    let whole = children.iter().all(|child| child.own.vertices > 0 || child.own.bounds().is_none());
    whole.then(|| vertices.saturating_mul(BYTES_PER_LEVEL_VERTEX))
}

/// A coarser tile.
struct Level {
    /// What viewers get.
    shown: Tile,
    /// The box of it without its skirts.
    surface: Bounds<3>,
    /// What the tile above is made from.
    working: Tile,
    /// What is known of them, without the meshes.
    simple: Simplified,
}

impl Level {
    /// Joins and simplifies the meshes of `children`, the tiles below `node`, to their `share`.
    fn of(context: &LevelContext, node: NodeIndex, children: &[Child], share: Share) -> Result<Level> {
        let vertices = children.iter().map(|child| child.own.vertices as usize).sum();
        let mut joining = Joining::new(&context.style.frame, vertices);
        for child in children.iter().filter(|child| child.own.vertices > 0) {
            match &child.mesh {
                ChildMesh::File(path) => joining.add(read_own(path)?).map_err(|what| contradiction(node, &what))?,
                ChildMesh::Record(of_child) => joining.add_mesh(load_mesh(context.store, *of_child)?),
                ChildMesh::OfPart(store, of_child) => joining.add_mesh(load_mesh(store, *of_child)?),
            }
        }
        let joined = joining.finish();
        let terrain = joined.terrain();
        let target = share.of(context.sizes.target(terrain.triangles.len()));
        let mut simple = simplify(&context.style.frame, &terrain, target, context.style.lines.as_deref())?;
        let (shown, working) = (std::mem::take(&mut simple.shown), std::mem::take(&mut simple.working));
        let surface = bounds_of(&shown.mesh.positions).ok_or_else(|| contradiction(node, &"nothing is left"))?;
        let [shown, working] = joined.tiles(shown, working);
        Ok(Level { shown, surface, working, simple })
    }
}

/// Returns the range of heights in metres.
fn height_range(frame: &Frame, bounds: Bounds<3>) -> f64 {
    bounds.extent(2) as f64 * frame.resolution_metres()[1]
}

fn contradiction(node: NodeIndex, what: &impl std::fmt::Display) -> Error {
    Error::Broken(format!("the tiles below node {node} do not fit together: {what}"))
}

/// A tile that a coarser one is made from.
pub(crate) struct Child {
    /// What `tileset.json` says of it.
    own: TileSummary,
    /// Whether it is an exact tile of the same part.
    exact: bool,
    /// Where its mesh is, if there is one.
    mesh: ChildMesh,
}

/// Where the mesh of a child is.
enum ChildMesh {
    /// In the GLB of an exact tile.
    File(PathBuf),
    /// In the record of a coarser tile of the same part.
    Record(NodeIndex),
    /// In the record of the topmost tile of another part.
    OfPart(Arc<Store>, NodeIndex),
}

impl Child {
    fn find(context: &LevelContext, child: ChildTile) -> Result<Child> {
        match child {
            ChildTile::Exact(tile) => {
                let own = ExactTile::load(context.store, tile)?.summary;
                let path = context.directory.output().tile(tile.number());
                Ok(Child { own, exact: true, mesh: ChildMesh::File(path) })
            }
            ChildTile::Coarse(index) => {
                let node = context.hierarchy.tiles[index].node;
                let own = LevelSummary::load(context.store, node)?.own;
                Ok(Child { own, exact: false, mesh: ChildMesh::Record(node) })
            }
            ChildTile::Part(part) => (context.top_of)(part),
        }
    }

    /// Returns the topmost tile of the part that `tree` cuts.
    ///
    /// # Errors
    /// [`Error::Io`] or [`Error::Broken`] on the part's store.
    pub(crate) fn top(directory: &JobDirectory, store: &Arc<Store>, tree: &Tree) -> Result<Child> {
        let (own, mesh) = match tree.node(NodeIndex::ROOT).kind {
            NodeKind::Leaf(tile) => {
                let path = directory.output().tile(tile.number());
                (ExactTile::load(store, tile)?.summary, ChildMesh::File(path))
            }
            NodeKind::Inner(_) => {
                let own = LevelSummary::load(store, NodeIndex::ROOT)?.own;
                (own, ChildMesh::OfPart(store.clone(), NodeIndex::ROOT))
            }
        };
        Ok(Child { own, exact: false, mesh })
    }
}

/// Reads a tile that this program wrote a moment ago: if it is bad, the program is.
fn read_own(path: &Path) -> Result<TileFile> {
    read_tile(path).map_err(|error| match error {
        Error::Input { .. } => Error::Broken(error.to_string()),
        other => other,
    })
}
