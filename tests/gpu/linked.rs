//! Linked meshes as step G6 makes them, before any flip, for the tests of flips.

use gdt_batch::geometry::Site;
use gdt_batch::geometry::predicates::{in_circle, orient2d};
use gdt_batch::gpu::texture_size::TextureSize;
use gdt_batch::gpu::twins::{self, c4_flip::AT_INFINITY};
use std::collections::HashMap;

/// Pixels along a side of a block.
const BLOCK_SIDE: u32 = 32;

/// A closed mesh: eight numbers for each triangle, and the site of every vertex. The last vertex is at infinity. The triangles of a block
/// of pixels follow each other.
pub(crate) struct LinkedMesh {
    pub(crate) records: Vec<u32>,
    pub(crate) sites: Vec<Site>,
    /// How many sites found no pixel.
    pub(crate) missing: usize,
    /// The first record of each block.
    pub(crate) block_starts: Vec<u32>,
    pub(crate) grid: PixelGrid,
}

/// Which pixel a site belongs to.
#[derive(Clone, Copy)]
pub(crate) struct PixelGrid {
    low: Site,
    scale: f64,
    size: TextureSize,
}

impl PixelGrid {
    fn pixel(&self, site: Site) -> [u32; 2] {
        [0, 1].map(|k| ((f64::from(site[k]) - f64::from(self.low[k])) * self.scale) as u32)
    }

    /// Returns the number of blocks in a row, and of rows. They have room for one more row and column of pixels.
    fn blocks(&self) -> [u32; 2] {
        [self.size.width, self.size.height].map(|pixels| pixels / BLOCK_SIDE + 1)
    }

    /// Returns the number of the block that a site belongs to.
    pub(crate) fn block(&self, site: Site) -> u32 {
        let [x, y] = self.pixel(site).map(|c| c / BLOCK_SIDE);
        y * self.blocks()[0] + x
    }
}

/// The directions of the four arms of a corner, counterclockwise.
const STEPS: [[i32; 2]; 4] = [[0, -1], [1, 0], [0, 1], [-1, 0]];
const SOUTH: usize = 0;
const EAST: usize = 1;
const NORTH: usize = 2;
const WEST: usize = 3;

/// The sites of a texture: which site has which pixel.
struct Placed {
    grid: PixelGrid,
    sites: Vec<Site>,
    pixels: Vec<u32>,
}

/// Gives every site a pixel in a texture of about `pixels_per_site` pixels for each. A site whose pixel is taken, or the one that took
/// it, moves to the next pixel in the east or west, so that both keep the order of their x. Otherwise it is missing.
fn place(sites: &[Site], pixels_per_site: f64) -> Placed {
    let [least, most] = [i32::min, i32::max].map(|pick: fn(i32, i32) -> i32| {
        [0, 1].map(|k| sites.iter().map(|site| site[k]).reduce(pick).expect("there are sites"))
    });
    let extent = [0, 1].map(|k| f64::from(most[k]) - f64::from(least[k]) + 1.0);
    let scale = (sites.len() as f64 * pixels_per_site / (extent[0] * extent[1])).sqrt();
    let [width, height] = extent.map(|length| (length * scale).ceil().max(1.0) as u32);
    let grid = PixelGrid { low: least, scale, size: TextureSize { width, height } };
    let pixel = |site: Site| grid.pixel(site);
    let mut taken = HashMap::new();
    let mut losers = Vec::new();
    for &site in sites {
        let [x, y] = pixel(site);
        if *taken.entry([y, x]).or_insert(site) != site {
            losers.push(site);
        }
    }
    for site in losers {
        let [x, y] = pixel(site);
        let winner = taken[&[y, x]];
        let (west, east) = (site.min(winner), site.max(winner));
        if x + 1 < width && !taken.contains_key(&[y, x + 1]) {
            taken.extend([([y, x], west), ([y, x + 1], east)]);
        } else if x > 0 && !taken.contains_key(&[y, x - 1]) {
            taken.extend([([y, x - 1], west), ([y, x], east)]);
        }
    }
    let mut rows: Vec<_> = taken.into_iter().collect();
    rows.sort_unstable();
    let pixels = rows.iter().map(|&([y, x], _)| y << 16 | x).collect();
    Placed { grid, sites: rows.into_iter().map(|(_, site)| site).collect(), pixels }
}

/// The colours of the pixels, and which triangles each corner makes.
struct Diagram {
    size: TextureSize,
    sites: Vec<Site>,
    colours: Vec<u32>,
    /// The number of the first triangle of each corner.
    first: Vec<u32>,
}

impl Diagram {
    fn colour(&self, x: i32, y: i32) -> u32 {
        let inside = (0..self.size.width as i32).contains(&x) && (0..self.size.height as i32).contains(&y);
        if inside { self.colours[(y * self.size.width as i32 + x) as usize] } else { self.sites.len() as u32 - 1 }
    }

    /// Returns the colours around a corner: southwest, southeast, northeast, northwest.
    fn around(&self, [x, y]: [i32; 2]) -> [u32; 4] {
        [self.colour(x - 1, y - 1), self.colour(x, y - 1), self.colour(x, y), self.colour(x - 1, y)]
    }

    /// Returns whether the corner has an arm to the south, east, north, west.
    fn arms(&self, corner: [i32; 2]) -> [bool; 4] {
        let [sw, se, ne, nw] = self.around(corner);
        [sw != se, se != ne, ne != nw, nw != sw]
    }

    fn corners_of_block(&self, [left, bottom]: [u32; 2]) -> impl Iterator<Item = [i32; 2]> + use<> {
        let TextureSize { width, height } = self.size;
        let ys = bottom..(bottom + BLOCK_SIDE).min(height + 1);
        ys.flat_map(move |y| (left..(left + BLOCK_SIDE).min(width + 1)).map(move |x| [x as i32, y as i32]))
    }

    fn at(&self, [x, y]: [i32; 2]) -> usize {
        (y * (self.size.width as i32 + 1) + x) as usize
    }

    fn first(&self, corner: [i32; 2]) -> u32 {
        self.first[self.at(corner)]
    }

    /// Returns whether the corner's square is cut from the southwest to the northeast.
    fn is_cut_northeast(&self, corner: [i32; 2]) -> bool {
        let [a, b, c, d] = self.around(corner).map(|v| self.sites[v as usize]);
        orient2d(a, b, c) > 0 && orient2d(a, c, d) > 0 && !in_circle(a, b, c, d)
    }

    /// Returns the triangles of a corner.
    fn triangles(&self, corner: [i32; 2]) -> Vec<[u32; 3]> {
        let [sw, se, ne, nw] = self.around(corner);
        let [south, _, north, west] = self.arms(corner);
        match self.arms(corner).iter().filter(|&&arm| arm).count() {
            3 => vec![[sw, if south { se } else { ne }, if north && west { nw } else { ne }]],
            4 if sw == ne || se == nw => vec![],
            4 if self.is_cut_northeast(corner) => vec![[sw, se, ne], [sw, ne, nw]],
            4 => vec![[sw, se, nw], [se, ne, nw]],
            _ => vec![],
        }
    }

    /// Returns the half-edge that crosses the `arm` of a corner, or the arm with which it is connected if the corner has no triangle.
    fn across(&self, corner: [i32; 2], arm: usize) -> Result<u32, usize> {
        let ([sw, se, ne, nw], arms) = (self.around(corner), self.arms(corner));
        let t = 8 * self.first(corner);
        match arms.iter().filter(|&&arm| arm).count() {
            2 => Err((0..4).find(|&other| other != arm && arms[other]).expect("a second arm")),
            3 => Ok(t + [0, arms[SOUTH] as u32, 2 - arms[WEST] as u32, 2][arm]),
            _ if sw == ne => Err([EAST, SOUTH, WEST, NORTH][arm]),
            _ if se == nw => Err([WEST, NORTH, EAST, SOUTH][arm]),
            _ if self.is_cut_northeast(corner) => Ok(t + [0, 1, 9, 10][arm]),
            _ => Ok(t + [0, 8, 9, 2][arm]),
        }
    }

    /// Follows the Voronoi edge that leaves `corner` along `arm`; returns the half-edge at its other end.
    fn walk(&self, mut corner: [i32; 2], mut arm: usize) -> u32 {
        loop {
            corner = [corner[0] + STEPS[arm][0], corner[1] + STEPS[arm][1]];
            match self.across(corner, (arm + 2) % 4) {
                Ok(half_edge) => return half_edge,
                Err(next) => arm = next,
            }
        }
    }
}

impl LinkedMesh {
    /// Makes the mesh of the discrete Voronoi diagram of `sites` in a texture with about `pixels_per_site`.
    pub(crate) fn new(sites: &[Site], pixels_per_site: f64) -> LinkedMesh {
        let placed = place(sites, pixels_per_site);
        let (grid, size) = (placed.grid, placed.grid.size);
        let texture = twins::write_sites(size, &placed.pixels);
        let mut labels = twins::voronoi_exact(size, &texture);
        twins::remove_islands(size, &mut labels);
        let colour = |label: u32| !texture[((label >> 16) * size.width + (label & 0xffff)) as usize];
        let colours = labels.into_iter().map(colour).collect();
        let missing = sites.len() - placed.sites.len();
        let sites = [placed.sites.as_slice(), &[[AT_INFINITY, 0]]].concat();
        let corners = (size.width as usize + 1) * (size.height as usize + 1);
        let mut diagram = Diagram { size, sites, colours, first: vec![0; corners] };
        let (mut records, mut block_starts): (Vec<u32>, _) = (Vec::new(), Vec::new());
        let [blocks_x, blocks_y] = grid.blocks();
        let blocks = (0..blocks_y).flat_map(|y| (0..blocks_x).map(move |x| [x, y].map(|c| c * BLOCK_SIDE)));
        for block in blocks.clone() {
            block_starts.push(records.len() as u32 / 8);
            for corner in diagram.corners_of_block(block) {
                let at = diagram.at(corner);
                diagram.first[at] = records.len() as u32 / 8;
                for [a, b, c] in diagram.triangles(corner) {
                    records.extend([a, b, c, 0, u32::MAX, u32::MAX, u32::MAX, 0]);
                }
            }
        }
        for corner in blocks.flat_map(|block| diagram.corners_of_block(block)) {
            diagram.link(corner, &mut records);
        }
        LinkedMesh { records, sites: diagram.sites, missing, block_starts, grid }
    }
}

impl Diagram {
    /// Links the triangles of a corner to their neighbours.
    fn link(&self, corner: [i32; 2], records: &mut [u32]) {
        let count = self.triangles(corner).len();
        if count == 0 {
            return;
        }
        for arm in (0..4).filter(|&arm| self.arms(corner)[arm]) {
            if let Ok(half_edge) = self.across(corner, arm) {
                records[half_edge as usize + 4] = self.walk(corner, arm);
            }
        }
        if count == 2 {
            let t = 8 * self.first(corner);
            let (a, b) = if self.is_cut_northeast(corner) { (t + 2, t + 8) } else { (t + 1, t + 10) };
            records[a as usize + 4] = b;
            records[b as usize + 4] = a;
        }
    }
}
