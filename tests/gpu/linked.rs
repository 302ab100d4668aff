//! Linked meshes as step G6 makes them, before any flip, for the tests of flips.

use delaunay::geometry::Site;
use delaunay_gpu::atlas::{Atlas, AtlasLeaf, BLOCK_SIDE};
use delaunay_gpu::options::VoronoiMethod;
use delaunay_gpu::reference_kernels;
use delaunay_gpu::reference_kernels::atlas::{AtlasDiagram, make_triangles};
use delaunay_gpu::reference_kernels::c4_flip::AT_INFINITY;
use delaunay_gpu::texture_size::TextureSize;
use std::collections::HashMap;

/// A closed mesh: eight numbers for each triangle, and the site of every vertex. The last vertex is at infinity.
pub(crate) struct LinkedMesh {
    pub(crate) records: Vec<u32>,
    pub(crate) sites: Vec<Site>,
    /// How many sites found no pixel.
    pub(crate) missing: usize,
}

/// The sites of a texture: which site has which pixel.
struct Placed {
    size: TextureSize,
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
    let pixel = |site: Site| [0, 1].map(|k| ((f64::from(site[k]) - f64::from(least[k])) * scale) as u32);
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
    Placed::new(TextureSize { width, height }, taken)
}

impl Placed {
    /// Takes the site of each pixel [y, x] that has one.
    fn new(size: TextureSize, taken: impl IntoIterator<Item = ([u32; 2], Site)>) -> Placed {
        let mut rows: Vec<_> = taken.into_iter().collect();
        rows.sort_unstable();
        let pixels = rows.iter().map(|&([y, x], _)| y << 16 | x).collect();
        Placed { size, sites: rows.into_iter().map(|(_, site)| site).collect(), pixels }
    }
}

impl LinkedMesh {
    /// Makes the mesh of the discrete Voronoi diagram of `sites` in a texture with about `pixels_per_site`.
    pub(crate) fn new(sites: &[Site], pixels_per_site: f64) -> LinkedMesh {
        LinkedMesh::of(place(sites, pixels_per_site), sites.len())
    }

    /// Makes the mesh of a texture in which somebody has written `count` sites; `taken` has those that are not missing, by [y, x].
    pub(crate) fn of_texture(size: TextureSize, taken: Vec<([u32; 2], Site)>, count: usize) -> LinkedMesh {
        LinkedMesh::of(Placed::new(size, taken), count)
    }

    fn of(placed: Placed, count: usize) -> LinkedMesh {
        let TextureSize { width, height } = placed.size;
        let sites = placed.sites.len() as u32;
        let leaf = AtlasLeaf {
            base: 0,
            stride: (width / BLOCK_SIDE + 1) * BLOCK_SIDE,
            width,
            height,
            first_site: 0,
            sites,
            first_record: 0,
            first_block: 0,
            low: [0, 0],
            factor: 1,
        };
        let blocks = leaf.blocks_x() * leaf.blocks_y();
        let pixels = blocks * BLOCK_SIDE * BLOCK_SIDE;
        let atlas = Atlas { leaves: vec![leaf], pixels, vertices: sites + 1, records: leaf.records(), blocks };
        let mut texture = vec![0; pixels as usize];
        for (&pixel, i) in placed.pixels.iter().zip(0..) {
            texture[leaf.at(pixel & 0xffff, pixel >> 16) as usize] = !i;
        }
        let mut labels = reference_kernels::atlas::voronoi(&atlas, &texture, VoronoiMethod::Exact);
        reference_kernels::atlas::remove_islands(&atlas, &mut labels);
        let missing = count - placed.sites.len();
        let sites = [placed.sites.as_slice(), &[[AT_INFINITY, 0]]].concat();
        let diagram = AtlasDiagram { atlas: &atlas, labels: &labels, texture: &texture, sites: &sites };
        let mut records = make_triangles(diagram, &mut [0]);
        let used = records.chunks_exact(8).take_while(|record| record[0] != u32::MAX).count();
        records.truncate(8 * used);
        LinkedMesh { records, sites, missing }
    }
}
