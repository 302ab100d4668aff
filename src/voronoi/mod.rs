//! The canonical Delaunay triangulation of a leaf by way of its discrete Voronoi diagram: the ten steps of Rong, Tan, Cao and
//! Stephanus 2008, "Computing Two-dimensional Delaunay Triangulation Using Graphics Hardware", here on one CPU thread.
//!
//! [`triangulate`] calls the steps in order; each is a file named after it:
//!
//! | step | file | what it does here |
//! |---|---|---|
//! | G1 | `g1_write_sites` | writes the sites into a texture; losers of a pixel move beside it or are missing |
//! | G2 | `g2_voronoi` | labels each pixel with its nearest site, a row at a time |
//! | G4-G6 | `g6_triangles` | makes triangles, linked, where colours meet; while the row is in the cache, C2's tests and C4's flips |
//! | G3 | `g3_islands` | takes out what pieces of torn regions have made |
//! | C2 | `c2_shift` | mends what is inverted at the sites' true places |
//! | C1 | `c1_hull` | makes the hull convex |
//! | C4 | `c4_flip` | flips what could not be flipped earlier |
//! | C3 | `c3_insert` | inserts what is missing or was taken out, flipping as it goes |
//! | | `accept` | proves the result |
//!
//! Any of them may go wrong on unlucky input; as `accept` proves the result, a fault costs time and never correctness. `closed`
//! is the mesh they all work on, and `edges` tests many edges at once.

mod accept;
mod c1_hull;
mod c2_shift;
mod c3_insert;
mod c4_flip;
mod closed_mesh;
mod edge_tester;
mod g1_write_sites;
mod g2_voronoi;
mod g3_islands;
mod g6_triangles;
#[cfg(test)]
mod tests;

use crate::geometry::Site;
use crate::mesh::half_edge::HalfEdgeMesh;
use std::time::Instant;

/// Why a leaf was not triangulated here. Cut it, or triangulate it another way.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Rejection {
    /// Fewer than three sites have no triangle.
    #[error("too few sites for a triangle")]
    TooFew,
    /// More than 2^26 sites.
    #[error("too many sites for one leaf")]
    TooMany,
    /// A coordinate exceeds `geometry::lattice::REACH`.
    #[error("a coordinate is out of reach")]
    OutOfReach,
    /// So many sites share pixels that the discrete diagram says too little.
    #[error("too many sites share a pixel")]
    Crowded,
    /// The result was wrong, or about to be; the text says how it showed.
    #[error("the mesh was not accepted: {0}")]
    NotAccepted(&'static str),
}

/// How many pixels a texture has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRequest {
    /// How fine it is to be, if it may.
    pub resolution: TextureResolution,
    /// Largest width and height.
    pub most_side: u32,
    /// Most pixels in all.
    pub most_pixels: u64,
}

/// How fine a texture is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TextureResolution {
    /// Pixels per site: fewer make more work for the repair, more make more work for the transform.
    PixelsPerSite(f64),
    /// Pixels along the longer side.
    Side(u32),
}

impl Default for TextureRequest {
    /// What suits the CPU.
    fn default() -> TextureRequest {
        TextureRequest { resolution: TextureResolution::PixelsPerSite(5.0), most_side: 65_535, most_pixels: u64::MAX }
    }
}

/// Somebody who makes discrete Voronoi diagrams (step G2) faster than this thread does.
pub trait DiagramBackend {
    /// The textures that suit.
    fn shape(&self) -> TextureRequest;

    /// The diagram of a texture of `width` x `height` pixels whose sites are in `pixels` (each y << 16 | x).
    fn diagram(&self, width: u32, height: u32, pixels: Vec<u32>) -> DiagramReply;
}

/// What has become of a diagram.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DiagramReply {
    /// The label of every pixel, row by row: the pixel (y << 16 | x) of its nearest site.
    Labels(Vec<u32>),
    /// The texture was too large; [`DiagramBackend::shape`] is smaller now.
    TooLarge,
    /// Do it yourself.
    No,
}

/// The steps that [`PipelineCounts::nanoseconds`] tells apart.
pub const STEP_NAMES: [&str; 9] = [
    "G1 write sites",
    "G2-G6 Voronoi, triangles, most flips",
    "G3 islands",
    "C2 shift",
    "C1 hull",
    "C4 flip",
    "C3 insert",
    "accept",
    "wait for the GPU",
];

/// The last of [`STEP_NAMES`].
const WAIT: usize = STEP_NAMES.len() - 1;

/// What the steps met. All are numbers of sites, triangles or edges, as named.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct PipelineCounts {
    /// Leaves whose Voronoi diagram a GPU made.
    pub on_gpu: u64,
    /// Sites given.
    pub sites: u64,
    /// Sites that found no pixel and were inserted one by one.
    pub missing: u64,
    /// Sites that were given a pixel beside their own.
    pub moved: u64,
    /// Pieces of Voronoi regions that do not hang together with their site.
    pub islands: u64,
    /// Triangles that were not counterclockwise once the sites were at their true places.
    pub inverted: u64,
    /// Sites taken out for that reason and inserted again.
    pub removed: u64,
    /// Edges flipped to make the mesh Delaunay.
    pub flips: u64,
    /// Time by step, see [`STEP_NAMES`].
    pub nanoseconds: [u64; STEP_NAMES.len()],
}

impl std::ops::AddAssign for PipelineCounts {
    fn add_assign(&mut self, other: PipelineCounts) {
        self.on_gpu += other.on_gpu;
        self.sites += other.sites;
        self.missing += other.missing;
        self.moved += other.moved;
        self.islands += other.islands;
        self.inverted += other.inverted;
        self.removed += other.removed;
        self.flips += other.flips;
        for (mine, theirs) in self.nanoseconds.iter_mut().zip(other.nanoseconds) {
            *mine += theirs;
        }
    }
}

/// Buffers that [`triangulate`] uses again and again. One for each thread.
#[derive(Default)]
pub struct PipelineBuffers {
    shape: TextureRequest,
    texture: g1_write_sites::SiteTexture,
    voronoi: g2_voronoi::LabelRows,
    scan: g6_triangles::TextureScan,
    closed: closed_mesh::ClosedMesh,
    islands: g3_islands::IslandSearch,
    shift: c2_shift::ShiftRepair,
    flips: c4_flip::FlipQueue,
    acceptance: accept::AcceptanceCheck,
    mesh: HalfEdgeMesh,
}

impl PipelineBuffers {
    /// Buffers for textures of this `shape` where the diagrams are made on this thread. The mesh is the same with any.
    pub fn with_shape(shape: TextureRequest) -> PipelineBuffers {
        PipelineBuffers { shape, ..PipelineBuffers::default() }
    }

    /// Hands back a mesh that is no longer needed: its memory serves the next leaf.
    pub fn recycle(&mut self, mesh: HalfEdgeMesh) {
        self.mesh = mesh;
    }
}

/// The canonical Delaunay triangulation of `sites`, which must be distinct; the order is free: rows from the
/// south, or any other in which neighbours are close, spare some cache misses.
/// The mesh's corners are positions in `sites`.
///
/// # Errors
/// [`Rejection`] where this is not the way to do it; never a wrong mesh.
pub fn triangulate(sites: &[Site], buffers: &mut PipelineBuffers) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection> {
    triangulate_with(sites, None, buffers)
}

/// As [`triangulate`], with the Voronoi diagram made by `diagrams` if they will. They need not be trusted.
///
/// # Errors
/// As [`triangulate`].
pub fn triangulate_with(
    sites: &[Site],
    backend: Option<&dyn DiagramBackend>,
    buffers: &mut PipelineBuffers,
) -> Result<(HalfEdgeMesh, PipelineCounts), Rejection> {
    check_size(sites)?;
    let PipelineBuffers { shape, texture, voronoi, scan, closed, islands, shift, flips, acceptance, mesh } = buffers;
    let mut counts = PipelineCounts { sites: sites.len() as u64, ..PipelineCounts::default() };
    let mut clock = StepTimer::start();
    shift.clear();
    flips.reset(sites.len());

    discretise(sites, backend, shape, texture, voronoi, &mut counts)?;
    clock.done(&mut counts, 0);
    counts.nanoseconds[0] = counts.nanoseconds[0].saturating_sub(counts.nanoseconds[WAIT]);
    scan.run(texture, voronoi, closed, shift, flips)?;
    counts.inverted = shift.inverted.len() as u64;
    clock.done(&mut counts, 1);
    let at = &texture.sites;
    islands.remove(closed, at, texture.placed, shift, &mut counts)?;
    clock.done(&mut counts, 2);
    // Before C1, so that the hull is completed but once, where it really is.
    shift.repair(closed, at)?;
    clock.done(&mut counts, 3);
    c1_hull::complete_hull(closed, at, shift)?;
    counts.removed = shift.removed.len() as u64;
    clock.done(&mut counts, 4);
    // Before C3, so that sites are inserted into a Delaunay mesh, where walks are short and sure to end.
    std::mem::swap(&mut flips.suspects, &mut shift.suspects);
    flips.run(closed, at)?;
    clock.done(&mut counts, 5);
    c3_insert::insert_all(closed, texture, scan, &shift.removed, flips)?;
    counts.flips = flips.done;
    clock.done(&mut counts, 6);
    closed.compact();
    acceptance.accept(closed, at, &texture.order, mesh)?;
    clock.done(&mut counts, 7);
    Ok((std::mem::take(mesh), counts))
}

/// Steps G1 and G2. On this thread G2 is only prepared: its rows are made when the scan needs them.
fn discretise(
    sites: &[Site],
    backend: Option<&dyn DiagramBackend>,
    shape: &TextureRequest,
    texture: &mut g1_write_sites::SiteTexture,
    voronoi: &mut g2_voronoi::LabelRows,
    counts: &mut PipelineCounts,
) -> Result<(), Rejection> {
    if let Some(backend) = backend {
        let before = *counts;
        loop {
            texture.write(sites, &backend.shape(), counts)?;
            let asked = Instant::now();
            let answer = backend.diagram(texture.width as u32, texture.height as u32, texture.placed_pixels());
            counts.nanoseconds[WAIT] += asked.elapsed().as_nanos() as u64;
            match answer {
                DiagramReply::Labels(labels) => {
                    if voronoi.take(texture, labels) {
                        counts.on_gpu = 1;
                        return Ok(());
                    }
                    break;
                }
                DiagramReply::TooLarge => *counts = before,
                DiagramReply::No => break,
            }
        }
        *counts = before;
    }
    texture.write(sites, shape, counts)?;
    voronoi.start(texture);
    Ok(())
}

struct StepTimer(Instant);

impl StepTimer {
    fn start() -> StepTimer {
        StepTimer(Instant::now())
    }

    /// Adds the time since the last call to `step`.
    fn done(&mut self, counts: &mut PipelineCounts, step: usize) {
        let now = Instant::now();
        counts.nanoseconds[step] += (now - self.0).as_nanos() as u64;
        self.0 = now;
    }
}

fn check_size(sites: &[Site]) -> Result<(), Rejection> {
    match sites.len() {
        0..3 => Err(Rejection::TooFew),
        n if n > 1 << 26 => Err(Rejection::TooMany),
        _ => Ok(()),
    }
}
