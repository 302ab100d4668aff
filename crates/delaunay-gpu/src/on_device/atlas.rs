//! The atlas: the textures of many leaves one after another in one buffer, so that one submission serves them all.
//!
//! Each leaf is covered by blocks of 32 x 32 pixels, in rows from the south. They have room for at least one more row and column, so
//! that every corner of the texture belongs to a block. Pixel (x, y) of a leaf is number `base + y * stride + x` of the buffer. What
//! lies outside the width and height has the colour of the frame, "infinity", so no colour bleeds from leaf to leaf.

use delaunay::geometry::REACH;
use delaunay::geometry::{Bounds, Site};
use delaunay::voronoi::texture_request::TextureRequest;

/// Pixels along a side of a block.
pub const BLOCK_SIDE: u32 = 32;
/// Numbers in an entry of the table of leaves.
pub const LEAF_NUMBERS: usize = 16;
/// Bits of a fraction in [`AtlasLeaf::factor`].
const FACTOR_BITS: u32 = 31;

/// The place of a leaf in the atlas.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AtlasLeaf {
    /// The number of the leaf's first pixel.
    pub base: u32,
    /// Pixels from a row to the next: a multiple of [`BLOCK_SIDE`] that is greater than `width`.
    pub stride: u32,
    /// Pixels in a row of the texture.
    pub width: u32,
    /// Rows of the texture.
    pub height: u32,
    /// The number of the leaf's first site. After its sites comes the vertex at infinity, number `first_site + sites`.
    pub first_site: u32,
    /// The number of sites.
    pub sites: u32,
    /// The number of the leaf's first record of a triangle. There is room for `2 * sites` records, or 64 if that is more, rounded up
    /// to a multiple of 64.
    pub first_record: u32,
    /// The number of the leaf's first block.
    pub first_block: u32,
    /// The southwestern corner of the sites' bounding box.
    pub low: Site,
    /// Pixels in a lattice step, times 2^31; at most 2^31.
    pub factor: u32,
}

impl AtlasLeaf {
    /// Returns the pixel (x, y) of a site: the whole part of `(site - low + 1/2) * factor / 2^31`.
    pub fn pixel(&self, site: Site) -> [u32; 2] {
        [0, 1].map(|axis| along(site[axis].wrapping_sub(self.low[axis]) as u32, self.factor))
    }

    /// Returns how many records there is room for.
    pub fn records(&self) -> u32 {
        (2 * self.sites).max(64).next_multiple_of(64)
    }

    /// Returns the number of blocks in a row.
    pub fn blocks_x(&self) -> u32 {
        self.stride / BLOCK_SIDE
    }

    /// Returns the number of rows of blocks.
    pub fn blocks_y(&self) -> u32 {
        self.height / BLOCK_SIDE + 1
    }

    /// Returns the number of the block, counted from the leaf's first one, to which a site belongs.
    pub fn block_of(&self, site: Site) -> u32 {
        let [x, y] = self.pixel(site).map(|c| c / BLOCK_SIDE);
        y * self.blocks_x() + x
    }

    /// Returns the number of a pixel.
    pub fn at(&self, x: u32, y: u32) -> u32 {
        self.base + y * self.stride + x
    }

    fn numbers(&self) -> [u32; LEAF_NUMBERS] {
        let [low_x, low_y] = self.low.map(|c| c as u32);
        [
            self.base,
            self.stride,
            self.width,
            self.height,
            self.first_site,
            self.sites,
            self.first_record,
            self.records(),
            low_x,
            low_y,
            self.factor,
            self.first_block,
            0,
            0,
            0,
            0,
        ]
    }
}

/// Returns the pixel that is `steps` lattice steps from the first one.
fn along(steps: u32, factor: u32) -> u32 {
    ((u64::from(2 * steps + 1) * u64::from(factor)) >> (FACTOR_BITS + 1)) as u32
}

/// Which leaves are in the atlas, and where.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Atlas {
    /// The leaves, in the order of their pixels, sites, records and blocks.
    pub leaves: Vec<AtlasLeaf>,
    /// The number of pixels, with those of the frame.
    pub pixels: u32,
    /// The number of sites, with a vertex at infinity for each leaf.
    pub vertices: u32,
    /// The number of records that there is room for.
    pub records: u32,
    /// The number of blocks.
    pub blocks: u32,
}

impl Atlas {
    /// Adds a leaf of `sites`, in a texture as `request` says. Returns false, and changes nothing, if there are fewer than three sites,
    /// if one is beyond the lattice's reach, or if the atlas would have more than `max_pixels` pixels.
    pub fn add(&mut self, sites: &[Site], request: &TextureRequest, max_pixels: u32) -> bool {
        let is_within_reach = |b: &Bounds<2>| b.min.iter().chain(&b.max).all(|c| (-REACH..=REACH).contains(c));
        let bounds = Bounds::of_points(sites.iter().copied()).filter(is_within_reach);
        let Some(bounds) = bounds.filter(|_| sites.len() >= 3) else { return false };
        let steps = [0, 1].map(|axis| bounds.extent(axis) as u32);
        let scale = request.scale(steps.map(|steps| f64::from(steps) + 1.0), sites.len());
        let factor = ((scale * f64::from(1u32 << FACTOR_BITS)) as u32).max(1);
        let [width, height] = steps.map(|steps| along(steps, factor) + 1);
        let leaf = AtlasLeaf {
            base: self.pixels,
            stride: (width / BLOCK_SIDE + 1) * BLOCK_SIDE,
            width,
            height,
            first_site: self.vertices,
            sites: sites.len() as u32,
            first_record: self.records,
            first_block: self.blocks,
            low: bounds.min,
            factor,
        };
        let pixels = u64::from(leaf.stride) * u64::from(leaf.blocks_y() * BLOCK_SIDE);
        if u64::from(self.pixels) + pixels > u64::from(max_pixels) {
            return false;
        }
        self.pixels += pixels as u32;
        self.vertices += leaf.sites + 1;
        self.records += leaf.records();
        self.blocks += leaf.blocks_x() * leaf.blocks_y();
        self.leaves.push(leaf);
        true
    }

    /// Takes the last leaf out again.
    pub fn remove_last(&mut self) {
        if let Some(leaf) = self.leaves.pop() {
            self.pixels = leaf.base;
            self.vertices = leaf.first_site;
            self.records = leaf.first_record;
            self.blocks = leaf.first_block;
        }
    }

    /// Returns the table of leaves: [`LEAF_NUMBERS`] numbers for each, in the order of the fields that `struct Leaf` of the shaders has.
    pub fn leaf_table(&self) -> Vec<u32> {
        self.leaves.iter().flat_map(AtlasLeaf::numbers).collect()
    }

    /// Returns the table of blocks: the number of the leaf, and the southwestern pixel (y << 16 | x) of each.
    pub fn block_table(&self) -> Vec<u32> {
        let mut table = Vec::with_capacity(2 * self.blocks as usize);
        for (i, leaf) in self.leaves.iter().enumerate() {
            for y in 0..leaf.blocks_y() {
                table
                    .extend((0..leaf.blocks_x()).flat_map(|x| [i as u32, ((y * BLOCK_SIDE) << 16) | (x * BLOCK_SIDE)]));
            }
        }
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request() -> TextureRequest {
        TextureRequest { max_side: 16_384, ..TextureRequest::default() }
    }

    #[test]
    fn leaves_lie_one_after_another() {
        let mut atlas = Atlas::default();
        let square: Vec<Site> = (0..64).flat_map(|y| (0..64).map(move |x| [100 * x - 7, 100 * y + 9])).collect();
        assert!(atlas.add(&square, &request(), 1 << 24));
        assert!(atlas.add(&[[0, 0], [5, 5], [9, 0]], &request(), 1 << 24));
        let [a, b] = [atlas.leaves[0], atlas.leaves[1]];
        assert_eq!((a.base, a.first_site, a.first_record, a.first_block), (0, 0, 0, 0));
        assert_eq!((b.base, b.first_site, b.first_record), (a.stride * a.blocks_y() * BLOCK_SIDE, 4097, 8192));
        assert_eq!(b.first_block, a.blocks_x() * a.blocks_y());
        assert_eq!(atlas.block_table().len() as u32, 2 * atlas.blocks);
        assert_eq!(atlas.pixels, BLOCK_SIDE * BLOCK_SIDE * atlas.blocks);
        assert_eq!((atlas.vertices, atlas.records), (4101, 8256));
        for leaf in [a, b] {
            assert!(leaf.stride > leaf.width && leaf.blocks_y() * BLOCK_SIDE > leaf.height);
        }
        for site in square {
            let [x, y] = a.pixel(site);
            assert!(x < a.width && y < a.height);
        }
    }

    #[test]
    fn a_full_atlas_takes_no_leaf() {
        let mut atlas = Atlas::default();
        assert!(atlas.add(&[[0, 0], [5, 5], [9, 0]], &request(), 1024));
        let before = atlas.clone();
        assert!(!atlas.add(&[[0, 0], [5, 5], [9, 0]], &request(), 2047));
        assert!(!atlas.add(&[[0, 0], [5, 5]], &request(), 1 << 24));
        assert!(!atlas.add(&[[0, 0], [5, 5], [REACH + 1, 0]], &request(), 1 << 24));
        assert_eq!(atlas, before);
        assert!(atlas.add(&[[0, 0], [5, 5], [9, 0]], &request(), 2048));
        atlas.remove_last();
        assert_eq!(atlas, before);
    }

    #[test]
    fn at_the_finest_scale_every_step_has_a_pixel() {
        let mut atlas = Atlas::default();
        assert!(atlas.add(&[[3, 3], [4, 3], [3, 4]], &request(), 1 << 24));
        assert_eq!(atlas.leaves[0].pixel([4, 3]), [1, 0]);
    }

    #[test]
    fn sites_as_far_apart_as_can_be_fit() {
        let reach = REACH;
        let mut atlas = Atlas::default();
        let corners = [[-reach, -reach], [reach, reach], [-reach, reach], [reach, 0]];
        assert!(atlas.add(&corners, &request(), 1 << 24));
        let leaf = atlas.leaves[0];
        assert_eq!(leaf.pixel([reach, reach]), [leaf.width - 1, leaf.height - 1]);
    }
}
