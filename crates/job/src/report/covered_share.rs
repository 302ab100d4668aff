//! How much of the area that the user wants the terrain covers.

use crate::plan::job_plan::Plan;
use lattice::{Lattice, Polygons};
use rust_decimal::prelude::ToPrimitive;

/// A rectangle: the least and the greatest x and y.
type Sides = [[f64; 2]; 2];

/// Returns how much of the clip, of the bounds, or of what both have in common, triangles of this area cover; `None` without either, or if
/// polygons may overlap. The area is doubled, in square lattice steps.
pub(crate) fn covered_share(plan: &Plan, double_area: u64) -> Option<f64> {
    let (places, parts) = plan.lattice.for_places();
    let bounds = plan.options.input.bounds.map(|bounds| in_steps(bounds.0, &places));
    let wanted = match (&plan.clip, bounds) {
        (Some(clip), _) if may_overlap(&clip.polygons) => return None,
        (Some(clip), bounds) => double_area_of(&clip.polygons, bounds),
        (None, Some([min, max])) => 2.0 * (max[0] - min[0]) * (max[1] - min[1]),
        (None, None) => return None,
    };
    // Triangles along a clip reach a little over its corners.
    let covered = double_area as f64 * (parts * parts) as f64;
    (wanted > 0.0).then(|| (covered / wanted).clamp(0.0, 1.0))
}

fn in_steps([west, south, east, north]: [f64; 4], lattice: &Lattice) -> Sides {
    let number = |decimal: rust_decimal::Decimal| decimal.to_f64().unwrap_or(f64::NAN);
    let step = number(lattice.resolution);
    let place = |corner: [f64; 2]| [0, 1].map(|axis| (corner[axis] - number(lattice.offset[axis])) / step);
    [place([west, south]), place([east, north])]
}

/// Tells whether the boxes around two of the polygons have an area in common.
fn may_overlap(polygons: &Polygons) -> bool {
    let box_of = |rings: &Vec<Vec<[i64; 2]>>| {
        let outline = rings.first()?;
        let ends = |axis: usize| {
            let values = outline.iter().map(|vertex| vertex[axis]);
            Some([values.clone().min()?, values.max()?])
        };
        Some([ends(0)?, ends(1)?])
    };
    let mut boxes: Vec<[[i64; 2]; 2]> = polygons.iter().filter_map(box_of).collect();
    boxes.sort_unstable();
    boxes.iter().enumerate().any(|(number, [[_, east], [south, north]])| {
        let mut later = boxes.iter().skip(number + 1).take_while(|other| other[0][0] < *east);
        later.any(|other| other[1][0] < *north && *south < other[1][1])
    })
}

/// Returns twice the area of polygons, as far as it is within the sides. The first ring of a polygon is its outline, the others are holes.
fn double_area_of(polygons: &Polygons, sides: Option<Sides>) -> f64 {
    let of_ring = |ring: &Vec<[i64; 2]>| {
        let ring: Vec<[f64; 2]> = ring.iter().map(|vertex| vertex.map(|value| value as f64)).collect();
        double_area_of_ring(&sides.map_or_else(|| ring.clone(), |sides| within(&ring, sides)))
    };
    let of_polygon = |rings: &Vec<Vec<[i64; 2]>>| match rings.split_first() {
        Some((outline, holes)) => of_ring(outline) - holes.iter().map(of_ring).sum::<f64>(),
        None => 0.0,
    };
    polygons.iter().map(of_polygon).sum()
}

fn double_area_of_ring(ring: &[[f64; 2]]) -> f64 {
    let Some(origin) = ring.first() else { return 0.0 };
    let from_origin = |[x, y]: [f64; 2]| [x - origin[0], y - origin[1]];
    let next = ring.iter().cycle().skip(1);
    let crosses = ring.iter().zip(next).map(|(a, b)| {
        let [[ax, ay], [bx, by]] = [from_origin(*a), from_origin(*b)];
        ax * by - ay * bx
    });
    crosses.sum::<f64>().abs()
}

/// Returns the part of a ring within the sides. Where the ring is not convex, edges along the sides may lie on each other, which adds no area.
fn within(ring: &[[f64; 2]], [min, max]: Sides) -> Vec<[f64; 2]> {
    let mut ring = ring.to_vec();
    for axis in [0, 1] {
        for (side, sign) in [(min[axis], 1.0), (max[axis], -1.0)] {
            let inside = |place: [f64; 2]| (place[axis] - side) * sign;
            let mut kept = Vec::with_capacity(ring.len());
            for (index, &place) in ring.iter().enumerate() {
                let next = ring[(index + 1) % ring.len()];
                let [here, there] = [inside(place), inside(next)];
                if here >= 0.0 {
                    kept.push(place);
                }
                if here * there < 0.0 {
                    let part = here / (here - there);
                    kept.push([0, 1].map(|k| place[k] + part * (next[k] - place[k])));
                }
            }
            ring = kept;
        }
    }
    ring
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn holes_and_sides_take_area_away() {
        let square = |from: i64, to: i64| vec![[from, from], [to, from], [to, to], [from, to]];
        let polygons = vec![vec![square(0, 10), square(2, 4)], vec![square(20, 30)]];
        assert_eq!(double_area_of(&polygons, None), 2.0 * (100.0 - 4.0 + 100.0));
        assert_eq!(double_area_of(&polygons, Some([[3.0, 0.0], [25.0, 100.0]])), 2.0 * (70.0 - 2.0 + 50.0));
        assert_eq!(double_area_of(&polygons, Some([[50.0, 0.0], [60.0, 9.0]])), 0.0);
        assert!(!may_overlap(&polygons));
        assert!(may_overlap(&vec![vec![square(0, 10)], vec![square(20, 30)], vec![square(9, 12)]]));
        // A comb, whose teeth reach over a side.
        let comb = vec![vec![vec![[0, 0], [5, 0], [5, 9], [4, 9], [4, 2], [1, 2], [1, 9], [0, 9]]]];
        assert_eq!(double_area_of(&comb, Some([[0.0, 4.0], [9.0, 9.0]])), 2.0 * 10.0);
    }
}
