//! The records of merges: what a node passes up to the merge above it, and what a merge decides.

use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::index::{NodeIndex, TileIndex};
use crate::records::{BorderVertex, SeamTriangle, StepRecord, Store};
use bytemuck::{Pod, Zeroable};
use delaunay::geometry::Site;
use sys::Result;

/// A merge reads a question, asks it above or answers it, and writes that: all in all less memory than a fifth of what a site takes.
const QUESTIONS_PER_SITE: u64 = 5;

/// What a node passes to the merge node above it.
#[derive(Debug, Default)]
pub struct Frontier {
    /// The sites that the merge above still needs, ascending.
    pub sites: Vec<BorderVertex>,
    /// The directed edges around the final ground, as positions in `sites`.
    pub boundary: Vec<[u32; 2]>,
    /// Edges of the boundary over which a way to the hull comes in that goes out again, each with the edge where it does.
    pub passes: Vec<[u32; 2]>,
    /// What tiles ask about edges of the boundary.
    pub questions: Vec<FlowQuestion>,
    /// The number of triangles that the node and those below have made final.
    pub triangles: u64,
}

/// A tile asks whether the way that leaves over an edge of a node's boundary leads out of the hull.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct FlowQuestion {
    /// The tile.
    pub tile: TileIndex,
    /// The edge of the boundary, as its position there.
    pub exit: u32,
    /// The edge of the tile from which the way comes, counterclockwise in the triangle before it.
    pub edge: [Site; 2],
    /// The number of triangles of the tile whose ways lead over that edge. Of those that touch several tiles, one question counts.
    pub triangles: u32,
}

/// An edge of a triangle that touches a tile, from which the way leads out of the hull.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Pod, Zeroable)]
pub struct TrimmedEdge {
    /// The tile.
    pub tile: TileIndex,
    /// The edge, counterclockwise in the triangle before it.
    pub edge: [Site; 2],
}

/// How many triangles are slivers along the hull, by the rule, of how many. Only the root of the tree knows.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct HullCount {
    /// The slivers.
    pub slivers: u64,
    /// All triangles.
    pub triangles: u64,
}

impl HullCount {
    /// Tells whether the slivers are most of the mesh. Then the points lie along a curve, and without slivers hardly anything is left.
    pub fn is_most(&self) -> bool {
        self.slivers > self.triangles / 2
    }
}

/// Returns the tiles that own some of `sites`, which are sorted by tile, or ask some of `questions`, ascending.
pub fn tiles_of(sites: &[BorderVertex], questions: &[FlowQuestion]) -> Vec<TileIndex> {
    let mut tiles: Vec<TileIndex> = sites.iter().map(|vertex| vertex.tile).collect();
    tiles.dedup();
    tiles.extend(questions.iter().map(|question| question.tile));
    tiles.sort_unstable();
    tiles.dedup();
    tiles
}

impl Frontier {
    /// Writes the record of `node`.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub fn save(&self, store: &Store, node: NodeIndex) -> Result<()> {
        let counted = ColumnWriter::default().push(&self.sites).push(&self.questions);
        let ground = counted.push(&self.boundary).push(&self.passes).push(std::slice::from_ref(&self.triangles));
        ground.write(store, StepRecord::Frontier(node))
    }

    /// Reads the record of `node`.
    ///
    /// # Errors
    /// [`sys::Error::Io`], or [`sys::Error::Broken`] if there is none.
    pub fn load(store: &Store, node: NodeIndex) -> Result<Frontier> {
        let mut columns = ColumnReader::open(store, StepRecord::Frontier(node))?;
        let (sites, questions) = (columns.column()?, columns.column()?);
        let (boundary, passes) = (columns.column()?, columns.column()?);
        let triangles = columns.column::<u64>()?.iter().sum();
        Ok(Frontier { sites, boundary, passes, questions, triangles })
    }

    /// Returns how many sites' worth of memory it takes to merge the frontier of `node`: its sites, and a site for every
    /// few questions. Does not read the rest of its record.
    ///
    /// # Errors
    /// As [`Frontier::load`].
    pub fn count(store: &Store, node: NodeIndex) -> Result<u64> {
        let mut columns = ColumnReader::open(store, StepRecord::Frontier(node))?;
        let sites = columns.skip_column::<BorderVertex>()? as u64;
        Ok(sites + columns.skip_column::<FlowQuestion>()? as u64 / QUESTIONS_PER_SITE)
    }

    /// Returns the tiles that own sites of it or ask something, ascending.
    pub fn tiles(&self) -> Vec<TileIndex> {
        tiles_of(&self.sites, &self.questions)
    }
}

/// The triangles that a merge node makes final, sorted by tile. A triangle is listed once for each tile that owns a corner of it.
#[derive(Debug, Default)]
pub struct Seam {
    /// Tile, first triangle and number of triangles, by ascending tile.
    index: Vec<[u32; 3]>,
    triangles: Vec<SeamTriangle>,
    /// The edges from which ways lead out of the hull, sorted.
    trimmed: Vec<TrimmedEdge>,
    hull: HullCount,
}

/// The part of seams that touches a tile.
#[derive(Clone, Debug, Default)]
pub struct SeamOfTile {
    /// The triangles that touch it.
    pub triangles: Vec<SeamTriangle>,
    /// The edges of triangles of it, and of these, from which ways lead out of the hull.
    pub trimmed: Vec<[Site; 2]>,
}

impl SeamOfTile {
    /// Puts the triangles and the edges in an order that depends on nothing but these: which triangles a merge finds first depends on all of
    /// its sites.
    pub fn sort(&mut self) {
        for triangle in &mut self.triangles {
            let first = (0..3).min_by_key(|&corner| triangle[corner].plane()).unwrap_or(0);
            triangle.rotate_left(first);
        }
        self.triangles.sort_unstable_by_key(|triangle| triangle.map(|corner| corner.plane()));
        self.trimmed.sort_unstable();
    }

    /// Adds what another seam has.
    pub fn add(&mut self, other: SeamOfTile) {
        self.triangles.extend(other.triangles);
        self.trimmed.extend(other.trimmed);
    }
}

impl Seam {
    /// Sorts `count` triangles, which `triangle` returns by their numbers, by the tiles that they touch. The node answers that ways from
    /// `trimmed`, which are sorted, lead out of the hull: those of as many triangles as `hull` says. If that is most of the mesh, nothing is
    /// trimmed.
    pub fn new(
        count: u32,
        triangle: impl Fn(u32) -> SeamTriangle,
        mut trimmed: Vec<TrimmedEdge>,
        hull: HullCount,
    ) -> Seam {
        if hull.is_most() {
            trimmed.clear();
        }
        let mut touching: Vec<(TileIndex, u32)> = Vec::with_capacity(count as usize * 2);
        for at in 0..count {
            let mut tiles = triangle(at).map(|corner| corner.tile);
            tiles.sort_unstable();
            touching.extend((0..3).filter(|&i| i == 0 || tiles[i] != tiles[i - 1]).map(|i| (tiles[i], at)));
        }
        // A stable sort: the triangles of a tile stay in the order of the mesh.
        radsort::sort_by_key(&mut touching, |&(tile, _)| tile.0);
        let mut seam = Seam { index: Vec::new(), triangles: Vec::with_capacity(touching.len()), trimmed, hull };
        for (tile, at) in touching {
            match seam.index.last_mut() {
                Some([last, _, count]) if *last == tile.0 => *count += 1,
                _ => seam.index.push([tile.0, seam.triangles.len() as u32, 1]),
            }
            seam.triangles.push(triangle(at));
        }
        seam
    }

    /// Writes the record of `node`.
    ///
    /// # Errors
    /// [`sys::Error::Io`].
    pub fn save(&self, store: &Store, node: NodeIndex) -> Result<()> {
        let columns = ColumnWriter::default().push(std::slice::from_ref(&self.hull)).push(&self.index);
        columns.push(&self.trimmed).push(&self.triangles).write(store, StepRecord::Seam(node))
    }

    /// Reads how many triangles of the job are slivers, by the rule, from the record of `root`.
    ///
    /// # Errors
    /// As [`Seam::touching`].
    pub fn hull_count(store: &Store, root: NodeIndex) -> Result<HullCount> {
        let mut columns = ColumnReader::open(store, StepRecord::Seam(root))?;
        Ok(columns.column::<HullCount>()?.first().copied().unwrap_or_default())
    }

    /// Reads from the record of `node` what touches `tile`.
    ///
    /// # Errors
    /// [`sys::Error::Io`], or [`sys::Error::Broken`] if there is no record.
    pub fn touching(store: &Store, node: NodeIndex, tile: TileIndex) -> Result<SeamOfTile> {
        let mut columns = ColumnReader::open(store, StepRecord::Seam(node))?;
        columns.skip_column::<HullCount>()?;
        let index = columns.column::<[u32; 3]>()?;
        let all = columns.column::<TrimmedEdge>()?;
        let from = all.partition_point(|trimmed| trimmed.tile < tile);
        let trimmed = all[from..].iter().take_while(|trimmed| trimmed.tile == tile).map(|trimmed| trimmed.edge);
        let trimmed = trimmed.collect();
        let triangles = match index.binary_search_by_key(&tile.0, |entry| entry[0]) {
            Ok(at) => columns.column_part(index[at][1] as usize, index[at][2] as usize)?,
            Err(_) => Vec::new(),
        };
        Ok(SeamOfTile { triangles, trimmed })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use delaunay::mesh::index::SiteIndex;

    #[test]
    fn each_tile_has_its_triangles_in_the_order_of_the_mesh() {
        let corner =
            |tile: u32, site: u32| BorderVertex { tile: TileIndex(tile), site: SiteIndex(site), position: [0; 3] };
        let triangles: Vec<SeamTriangle> =
            (0..200).map(|i| [i * 7 % 5, i * 3 % 4, i / 100 * 250].map(|tile| corner(tile, 1000 - i))).collect();
        let seam = Seam::new(200, |at| triangles[at as usize], Vec::new(), HullCount::default());
        assert!(seam.index.is_sorted_by(|a, b| a[0] < b[0]));
        for &[tile, first, count] in &seam.index {
            let touches = |triangle: &&SeamTriangle| triangle.iter().any(|corner| corner.tile.0 == tile);
            let expected: Vec<SeamTriangle> = triangles.iter().filter(touches).copied().collect();
            assert_eq!(seam.triangles[first as usize..][..count as usize], expected, "{tile}");
        }
        assert_eq!(seam.index.iter().map(|[tile, ..]| *tile).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 250]);
    }
}
