//! The border of a simplified terrain. It is coarser than the outline of the terrain, which neighbours may show in full or simplify in
//! another way. So that no gap is seen between the two, it covers all of the terrain (`covering.rs`), is nowhere below the outline, and has a
//! skirt that reaches below it: who looks across the outline sees one of the two surfaces or the skirt.

use crate::lod::filling::{CoarseMesh, Filling};
use crate::lod::outline::Outline;

/// A simplified terrain for viewers.
#[derive(Debug, Default)]
pub struct ShownMesh {
    /// Its triangles.
    pub mesh: CoarseMesh,
    /// The directed edges around it with vertical triangles below them. The terrain is on their left.
    pub skirts: Vec<[u32; 2]>,
    /// The lower ends of these triangles: vertices of `mesh`, ascending, each with a height on the lattice.
    pub bottoms: Vec<(u32, i32)>,
}

impl ShownMesh {
    /// Returns a mesh that ends at the outline of the terrain.
    pub(crate) fn without_skirts(mesh: CoarseMesh) -> ShownMesh {
        ShownMesh { mesh, ..ShownMesh::default() }
    }
}

/// Returns the triangles of `filling` that `covers` tells of, with a border that is nowhere below the `outline` of the terrain at
/// `positions`. Skirts reach `spare` steps of z below the outline.
pub(crate) fn shown(
    positions: &[[i32; 3]],
    outline: &Outline,
    filling: &Filling,
    covers: &[bool],
    spare: f64,
) -> ShownMesh {
    let mut border = filling.border(covers);
    border.sort_unstable();
    let reaches = reaches(positions, outline, filling, &border);
    let (mut mesh, number) = filling.coarse(covers);
    let heights: Vec<[i32; 2]> =
        filling.positions.iter().zip(&reaches).map(|(p, reach)| reach.around(p[2], spare)).collect();
    let has_height = |edge: &&[u32; 2]| edge.iter().any(|&site| heights[site as usize][0] < heights[site as usize][1]);
    let hanging: Vec<[u32; 2]> = border.iter().filter(has_height).copied().collect();
    let ends_of = |edges: &[[u32; 2]]| {
        let mut ends = edges.as_flattened().to_vec();
        ends.sort_unstable_by_key(|&site| number[site as usize]);
        ends.dedup();
        ends
    };
    for site in ends_of(&border) {
        mesh.positions[number[site as usize] as usize][2] = heights[site as usize][1];
    }
    let bottoms = ends_of(&hanging).iter().map(|&site| (number[site as usize], heights[site as usize][0])).collect();
    let skirts = hanging.iter().map(|edge| edge.map(|site| number[site as usize])).collect();
    ShownMesh { mesh, skirts, bottoms }
}

/// Returns for each site of `filling` how far the outline is above and below the edges of the `border` that end there.
fn reaches(positions: &[[i32; 3]], outline: &Outline, filling: &Filling, border: &[[u32; 2]]) -> Vec<Reach> {
    let mut reaches = vec![Reach::default(); filling.positions.len()];
    let site_of = filling.numbers();
    for ring in &outline.rings {
        let ends: Vec<(usize, u32)> = (0..ring.len())
            .map(|at| (at, site_of[ring[at] as usize]))
            .filter(|&(_, site)| border.binary_search_by_key(&site, |edge| edge[0]).is_ok())
            .collect();
        for (k, &(first, from)) in ends.iter().enumerate() {
            let (last, to) = ends[(k + 1) % ends.len()];
            if border.binary_search(&[from, to]).is_err() {
                continue;
            }
            let edge = BorderEdge { ends: [from, to].map(|site| filling.positions[site as usize]) };
            let count = (last + ring.len() - first) % ring.len() + 1;
            let along = (first..first + count).map(|at| positions[ring[at % ring.len()] as usize]);
            let reach = along.map(|p| edge.distance(p)).fold(Reach::default(), Reach::with);
            for site in [from, to] {
                let of_site = &mut reaches[site as usize];
                *of_site = of_site.with(reach.above).with(reach.below);
            }
        }
    }
    reaches
}

/// An edge of the border, from one lattice point to another.
struct BorderEdge {
    ends: [[i32; 3]; 2],
}

impl BorderEdge {
    /// Returns how far a point is above the place on the edge that is nearest to it in the plane.
    fn distance(&self, point: [i32; 3]) -> f64 {
        let [from, to] = self.ends;
        let along = |p: [i32; 3], axis: usize| f64::from(p[axis]) - f64::from(from[axis]);
        let product = |p: [i32; 3]| along(p, 0) * along(to, 0) + along(p, 1) * along(to, 1);
        let share = (product(point) / product(to)).clamp(0.0, 1.0);
        along(point, 2) - share * along(to, 2)
    }
}

/// How far an outline is above and below the border near a vertex.
#[derive(Clone, Copy, Debug, Default)]
struct Reach {
    /// The greatest distance in steps of z, at least 0.
    above: f64,
    /// The least one, at most 0.
    below: f64,
}

impl Reach {
    /// Returns the height of the lower end of the skirt and that of the border, at a vertex that has been at `height`.
    fn around(self, height: i32, spare: f64) -> [i32; 2] {
        let fitted = f64::from(height);
        [(fitted + self.below - spare).floor() as i32, (fitted + self.above).ceil() as i32]
    }

    fn with(self, distance: f64) -> Reach {
        Reach { above: self.above.max(distance), below: self.below.min(distance) }
    }
}
