//! The names of the buffers that the steps share.

use wgpu::BufferUsages;

/// A buffer of the pipeline. It holds one number (`u32`) per pixel unless its description says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BufferId {
    /// The parameters of all dispatches, one block of bytes each.
    Params,
    /// The complement of the number of the site in a pixel, or 0.
    Texture,
    /// Which of the 32 rows of a band have a site: one number per column and band.
    Words,
    /// The nearest row with a site south of a band: one number per column and band.
    South,
    /// The nearest row with a site north of a band: one number per column and band.
    North,
    /// The label of a pixel: the pixel (y << 16 | x) of its nearest site.
    Labels,
    /// The other copy of the labels, between which jump flooding alternates.
    Flood,
    /// Two coordinates for each site; the x of the vertex at infinity is the least of all.
    Sites,
    /// The mesh: eight numbers for each triangle, three corners, a note, three twins, a partner.
    Records,
    /// The highest claim on each triangle.
    Claims,
    /// Bits for each triangle; see `flip_marks`.
    Marks,
    /// The answers of the exact predicates, one for each four sites.
    Decisions,
    /// The table of leaves of an atlas; see `atlas`.
    Leaves,
    /// The table of blocks of an atlas; see `atlas`.
    Blocks,
    /// For each leaf of an atlas, why it must go to the CPU; 0 if it need not.
    Flags,
    /// A bit for each vertex of an atlas: the site has lost its pixel to another.
    Losers,
    /// A bit for each vertex of an atlas: the site has no pixel.
    Missing,
    /// The corners of an atlas, four numbers for each 32 in a row; see `shaders/atlas/g4_vertices.wgsl`.
    CornerRows,
    /// The numbers of triangles in the blocks of an atlas, then their prefix sums.
    BlockStarts,
    /// What comes back from an atlas; see `returned`.
    Returned,
    /// The copy of a result that the CPU reads.
    Staging,
}

impl BufferId {
    /// The number of buffers.
    pub(super) const COUNT: usize = BufferId::Staging as usize + 1;

    /// Returns what wgpu must allow the buffer to be used for.
    pub(super) fn usage(self) -> BufferUsages {
        match self {
            BufferId::Params => BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            BufferId::Staging => BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            _ => BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        }
    }
}
