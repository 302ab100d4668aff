//! The areas of a file, cut into triangles on the common lattice.

use crate::common_lattice::CommonLattice;
use crate::places::read_places;
use overlay::{Comparison, Point, TriangleMesh, Zones, compare};
use points::lines::{LineFeature, LineShape};
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::path::Path;
use sys::{Error, Result, Warnings, interrupt};
use terrain::TerrainSystem;

/// Edges of an area are looked for in this many rows.
const ROWS: usize = 1024;

/// Areas with their names.
pub(crate) struct Areas {
    /// The number and the name of each feature.
    pub(crate) features: Vec<(u64, Option<String>)>,
    pub(crate) zones: Zones,
}

/// Reads the areas of the file at `path`. Their corners are moved to the lattice.
///
/// # Errors
/// [`Error::Input`] if a feature is no area, or its outlines cross; those of [`read_places`].
pub(crate) fn read_areas(
    path: &Path,
    system: &TerrainSystem,
    lattice: &CommonLattice,
    memory: u64,
    warnings: &mut Warnings,
) -> Result<Areas> {
    let file = read_places(path, system, memory, warnings)?;
    let (mut features, mut meshes) = (Vec::new(), Vec::new());
    for parts in file.features.chunk_by(|a, b| a.number == b.number) {
        interrupt::check()?;
        let refuse = |what: &str| Error::input(path, format!("feature {} {what}", parts[0].number));
        meshes.push(mesh_of(parts, lattice).map_err(refuse)?);
        features.push((parts[0].number, parts[0].name.clone()));
    }
    if features.is_empty() {
        return Err(Error::input(path, "has no areas: name a file with polygons"));
    }
    Ok(Areas { features, zones: Zones::new(meshes) })
}

fn mesh_of(parts: &[LineFeature], lattice: &CommonLattice) -> std::result::Result<TriangleMesh, &'static str> {
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let mut meshes = Vec::with_capacity(parts.len());
    for part in parts {
        let LineShape::Area(outlines) = &part.shape else {
            return Err("is a line, and only areas have volumes: make it a polygon, or leave it out");
        };
        let place = |vertex: &[f64; 3]| lattice.nearest_point([vertex[0], vertex[1]]);
        let rings = outlines.iter().map(|ring| ring.iter().map(place).collect::<Option<Vec<_>>>());
        let rings = rings
            .collect::<Option<Vec<_>>>()
            .ok_or("lies far outside of the terrain: correct its coordinates or its CRS")?;
        let first = u32::try_from(vertices.len()).unwrap_or(u32::MAX);
        let (more, corners) = triangulated(rings)?;
        meshes.push(mesh_of_triangles(more.clone(), corners.clone())?);
        vertices.extend(more);
        triangles.extend(corners.into_iter().map(|corners| corners.map(|v| v.saturating_add(first))));
    }
    if overlap(&meshes) {
        return Err("has parts that overlap, whose volume would be counted twice: merge them (in QGIS: \"Dissolve\")");
    }
    mesh_of_triangles(vertices, triangles)
}

fn mesh_of_triangles(
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
) -> std::result::Result<TriangleMesh, &'static str> {
    TriangleMesh::new(vertices, triangles).map_err(|_| "cannot be cut into triangles: simplify its outlines")
}

/// Tells whether some parts have an area in common. What moving their corners to the lattice may have made of a common border is none.
fn overlap(parts: &[TriangleMesh]) -> bool {
    const ROUNDING: f64 = 1e-6;
    let area_of = |part: &TriangleMesh| part.double_area() as f64 / 2.0;
    let others = |k: usize| parts[..k].iter().filter(move |other| other.bounds().overlaps(&parts[k].bounds()));
    (0..parts.len()).flat_map(|k| others(k).map(move |other| [&parts[k], other])).any(|[own, other]| {
        let mut common = Comparison::new(0);
        compare(own, other, 0.0, None, &mut common);
        let least = area_of(own).min(area_of(other)) * ROUNDING;
        common.all.area.value().is_none_or(|area| area > least)
    })
}

type Triangles = (Vec<Point>, Vec<[u32; 3]>);

/// Cuts the area that closed rings enclose into triangles: what is inside an odd number of them.
fn triangulated(mut rings: Vec<Vec<[i64; 2]>>) -> std::result::Result<Triangles, &'static str> {
    const CROSSING: &str = "has outlines that cross, or touch along an edge: repair them (in QGIS: \"Fix geometries\")";
    for ring in &mut rings {
        ring.dedup();
        while ring.len() > 1 && ring.first() == ring.last() {
            ring.pop();
        }
    }
    rings.retain(|ring| ring.len() >= 3);
    let mut net = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    for ring in &rings {
        let insert = |place: &[i64; 2]| net.insert(Point2::new(place[0] as f64, place[1] as f64)).map_err(|_| CROSSING);
        let corners = ring.iter().map(insert).collect::<std::result::Result<Vec<FixedVertexHandle>, _>>()?;
        for (k, from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % corners.len()];
            if *from == to || !net.can_add_constraint(*from, to) {
                return Err(CROSSING);
            }
            net.add_constraint(*from, to);
        }
    }
    let place = |position: Point2<f64>| [position.x as i64, position.y as i64, 0];
    let vertices: Vec<Point> = net.vertices().map(|vertex| place(vertex.position())).collect();
    let number = |vertex: FixedVertexHandle| u32::try_from(vertex.index()).unwrap_or(u32::MAX);
    let inside = Inside::new(&rings);
    let faces = net.inner_faces().map(|face| face.vertices().map(|vertex| vertex.fix()));
    let triangles = faces.map(|corners| corners.map(number)).filter(|corners| {
        let corners = corners.map(|v| vertices[v as usize]);
        inside.holds([0, 1].map(|axis| corners.iter().map(|corner| corner[axis]).sum()))
    });
    let triangles = triangles.collect();
    Ok((vertices, triangles))
}

/// Tells whether places lie inside rings.
struct Inside {
    low: i64,
    height: i64,
    /// The edges that meet each row.
    rows: Vec<Vec<[[i64; 2]; 2]>>,
}

impl Inside {
    fn new(rings: &[Vec<[i64; 2]>]) -> Inside {
        let ys = || rings.iter().flatten().map(|place| place[1]);
        let (low, high) = (ys().min().unwrap_or(0), ys().max().unwrap_or(0));
        let height = (high - low) / ROWS as i64 + 1;
        let mut inside = Inside { low, height, rows: vec![Vec::new(); ROWS] };
        for ring in rings {
            for (k, from) in ring.iter().enumerate() {
                let edge = [*from, ring[(k + 1) % ring.len()]];
                let [first, last] = [edge[0][1].min(edge[1][1]), edge[0][1].max(edge[1][1])].map(|y| inside.row(y));
                inside.rows[first..=last].iter_mut().for_each(|row| row.push(edge));
            }
        }
        inside
    }

    fn row(&self, y: i64) -> usize {
        usize::try_from((y - self.low) / self.height).unwrap_or(0).min(ROWS - 1)
    }

    /// Tells whether a place, given by three times its coordinates, lies inside an odd number of rings. It lies on none of them.
    fn holds(&self, [x, y]: [i64; 2]) -> bool {
        let crosses = |edge: &&[[i64; 2]; 2]| {
            let [[ax, ay], [bx, by]] = edge.map(|place| place.map(|value| 3 * value));
            let lies_left = || {
                let cross = i128::from(bx - ax) * i128::from(y - ay) - i128::from(by - ay) * i128::from(x - ax);
                (cross > 0) == (by > ay)
            };
            (ay > y) != (by > y) && lies_left()
        };
        self.rows[self.row(y.div_euclid(3))].iter().filter(crosses).count() % 2 == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(rings: &[&[[i64; 2]]]) -> std::result::Result<i128, &'static str> {
        let (vertices, triangles) = triangulated(rings.iter().map(|ring| ring.to_vec()).collect())?;
        Ok(TriangleMesh::new(vertices, triangles).unwrap().double_area())
    }

    #[test]
    fn areas_with_holes_and_islands_keep_their_size() {
        let square = |at: i64, side: i64| [[at, at], [at + side, at], [at + side, at + side], [at, at + side]];
        let (outline, hole, island) = (square(0, 1000), square(300, 400), square(400, 100));
        assert_eq!(area(&[&outline]), Ok(2_000_000));
        assert_eq!(area(&[&outline, &hole]), Ok(2 * (1_000_000 - 160_000)));
        assert_eq!(area(&[&outline, &hole, &island]), Ok(2 * (1_000_000 - 160_000 + 10_000)));
        let star = [[0, 0], [50, 10], [100, 0], [60, 50], [100, 100], [50, 60], [0, 100], [40, 50]];
        assert_eq!(area(&[&star]), Ok(7000));
        assert_eq!(area(&[&[[5, 5], [5, 5], [9, 9]]]), Ok(0));
    }

    #[test]
    fn parts_may_touch_but_not_overlap() {
        let square = |x: i64, y: i64, side: i64| {
            let ring = vec![[x, y], [x + side, y], [x + side, y + side], [x, y + side]];
            let (vertices, triangles) = triangulated(vec![ring]).unwrap();
            TriangleMesh::new(vertices, triangles).unwrap()
        };
        let parts = |others: &[[i64; 3]]| others.iter().map(|[x, y, side]| square(*x, *y, *side)).collect::<Vec<_>>();
        assert!(!overlap(&parts(&[[0, 0, 1000], [1000, 0, 1000], [3000, 0, 5], [0, 1000, 500]])));
        // A part within another, and two that cross.
        assert!(overlap(&parts(&[[0, 0, 1000], [3000, 0, 5], [200, 200, 10]])));
        assert!(overlap(&parts(&[[0, 0, 1000], [990, 990, 1000]])));
    }

    #[test]
    fn outlines_that_cross_are_refused() {
        assert!(area(&[&[[0, 0], [10, 10], [10, 0], [0, 10]]]).unwrap_err().contains("cross"));
    }
}
