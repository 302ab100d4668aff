//! The corners of the textures in an atlas, and the colours around them.

use crate::on_device::atlas::{Atlas, AtlasLeaf, BLOCK_SIDE};
use crate::on_device::reference_kernels::NONE;
use crate::on_device::reference_kernels::predicates::{in_circle, orientation};
use delaunay::geometry::Site;

/// The discrete Voronoi diagrams of the leaves of an atlas: what steps G4 to G6 start from.
#[derive(Clone, Copy, Debug)]
pub struct AtlasDiagram<'a> {
    /// The places of the leaves.
    pub atlas: &'a Atlas,
    /// The label of every pixel: the pixel (y << 16 | x) of its site within its leaf.
    pub labels: &'a [u32],
    /// The complement of the number of the site in each pixel, or 0.
    pub texture: &'a [u32],
    /// The sites of each leaf, and its vertex at infinity.
    pub sites: &'a [Site],
}

/// The directions of the four arms of a corner, counterclockwise.
pub(super) const STEPS: [[i32; 2]; 4] = [[0, -1], [1, 0], [0, 1], [-1, 0]];
pub(super) const SOUTH: usize = 0;
pub(super) const EAST: usize = 1;
pub(super) const NORTH: usize = 2;
pub(super) const WEST: usize = 3;

/// A corner, between pixels (x - 1, y - 1) and (x, y).
pub(super) type Corner = [i32; 2];

/// The diagram of one leaf.
#[derive(Clone, Copy)]
pub(super) struct LeafDiagram<'a> {
    pub(super) leaf: &'a AtlasLeaf,
    all: AtlasDiagram<'a>,
}

impl<'a> AtlasDiagram<'a> {
    pub(super) fn leaves(self) -> impl Iterator<Item = LeafDiagram<'a>> {
        self.atlas.leaves.iter().map(move |leaf| LeafDiagram { leaf, all: self })
    }
}

impl LeafDiagram<'_> {
    /// Returns the rows of corners of all blocks, in the order of the triangles: the first corner of each. Blocks may reach beyond
    /// the texture.
    pub(super) fn rows(self) -> impl Iterator<Item = Corner> {
        let side = BLOCK_SIDE as i32;
        let [width, height] = [self.leaf.blocks_x(), self.leaf.blocks_y()].map(|blocks| blocks as i32);
        let blocks = (0..height).flat_map(move |y| (0..width).map(move |x| [side * x, side * y]));
        blocks.flat_map(move |[x, y]| (y..y + side).map(move |y| [x, y]))
    }

    /// Returns the colour of a pixel: its label, or `NONE` outside.
    fn colour(self, x: i32, y: i32) -> u32 {
        let is_inside = x >= 0 && y >= 0 && x < self.leaf.width as i32 && y < self.leaf.height as i32;
        if is_inside { self.all.labels[self.leaf.at(x as u32, y as u32) as usize] } else { NONE }
    }

    /// Returns the number of the site of a label.
    fn vertex(self, label: u32) -> u32 {
        let AtlasLeaf { first_site, sites, .. } = *self.leaf;
        let place = || self.leaf.at(label & 0xffff, label >> 16) as usize;
        if label == NONE { first_site + sites } else { !self.all.texture[place()] }
    }

    /// Returns the colours around a corner: southwest, southeast, northeast, northwest.
    pub(super) fn around(self, [x, y]: Corner) -> [u32; 4] {
        [self.colour(x - 1, y - 1), self.colour(x, y - 1), self.colour(x, y), self.colour(x - 1, y)]
    }

    /// Returns whether the corner has an arm to the south, east, north, west.
    pub(super) fn arms(self, corner: Corner) -> [bool; 4] {
        let [sw, se, ne, nw] = self.around(corner);
        [sw != se, se != ne, ne != nw, nw != sw]
    }

    /// Returns the number of triangles of a corner.
    pub(super) fn count(self, corner: Corner) -> u32 {
        let [sw, se, ne, nw] = self.around(corner);
        let arms = self.arms(corner).iter().filter(|&&arm| arm).count() as u32;
        if sw == ne || se == nw { 0 } else { arms.saturating_sub(2) }
    }

    /// Returns whether the square of a corner with two triangles is cut from the southwest to the northeast.
    pub(super) fn is_cut_northeast(self, corner: Corner) -> bool {
        let around = self.around(corner);
        if around.contains(&NONE) {
            return false;
        }
        let [a, b, c, d] = around.map(|label| self.all.sites[self.vertex(label) as usize]);
        orientation(a, b, c) > 0 && orientation(a, c, d) > 0 && !in_circle(a, b, c, d)
    }

    /// Returns the corners of the triangles of a corner.
    pub(super) fn triangles(self, corner: Corner) -> Vec<[u32; 3]> {
        let [south, _, north, west] = self.arms(corner);
        let count = self.count(corner);
        if count == 0 {
            return Vec::new();
        }
        let [sw, se, ne, nw] = self.around(corner).map(|label| self.vertex(label));
        match count {
            1 => vec![[sw, if south { se } else { ne }, if north && west { nw } else { ne }]],
            _ if self.is_cut_northeast(corner) => vec![[sw, se, ne], [sw, ne, nw]],
            _ => vec![[sw, se, nw], [se, ne, nw]],
        }
    }
}
