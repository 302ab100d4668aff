//! The outlines of a Shapefile's polygon are one list of rings. This finds which of them are islands, and of which area.

use sys::{Result, interrupt};

type Ring = Vec<[f64; 3]>;

/// An outline with what is asked of it for every island.
struct Outline {
    /// Its least x.
    left: f64,
    right: f64,
    low: f64,
    high: f64,
    size: f64,
    /// Its place among the areas.
    area: usize,
}

/// Returns the areas that `rings` make: the outline of each, and then those of its islands. Outlines run clockwise and islands do not. If
/// no ring runs clockwise, the file has them the other way round.
///
/// # Errors
/// [`sys::Error::Interrupted`].
pub(super) fn areas_of(rings: Vec<Ring>) -> Result<Vec<Vec<Ring>>> {
    let is_turned = !rings.iter().any(|ring| double_area(ring) < 0.0);
    let is_outline = |ring: &Ring| (double_area(ring) < 0.0) != is_turned;
    let (outlines, islands): (Vec<Ring>, Vec<Ring>) = rings.into_iter().partition(is_outline);
    let mut areas: Vec<Vec<Ring>> = outlines.into_iter().map(|outline| vec![outline]).collect();
    if let [area] = areas.as_mut_slice() {
        area.extend(islands);
        return Ok(areas);
    }
    // An island may have a lake that has an island, so the smallest outline comes first. Of equal ones, the first in the file does.
    let mut by_size: Vec<Outline> =
        areas.iter().enumerate().map(|(area, rings)| Outline::of(&rings[0], area)).collect();
    by_size.sort_by(|a, b| a.size.total_cmp(&b.size));
    for island in islands {
        interrupt::check()?;
        let around =
            by_size.iter().find(|outline| outline.may_hold(&island) && holds(&areas[outline.area][0], &island));
        match around.map(|outline| outline.area) {
            Some(area) => areas[area].push(island),
            // A ring in no area is an area that runs the wrong way.
            None => areas.push(vec![island]),
        }
    }
    Ok(areas)
}

impl Outline {
    fn of(ring: &Ring, area: usize) -> Outline {
        let all = |axis: usize| ring.iter().map(move |vertex| vertex[axis]);
        let [least, most] = [f64::INFINITY, f64::NEG_INFINITY];
        Outline {
            left: all(0).fold(least, f64::min),
            right: all(0).fold(most, f64::max),
            low: all(1).fold(least, f64::min),
            high: all(1).fold(most, f64::max),
            size: double_area(ring).abs(),
            area,
        }
    }

    /// Tells whether a vertex that is looked at lies in the box of the outline. Most outlines are passed over by this.
    fn may_hold(&self, island: &Ring) -> bool {
        looked_at(island).any(|[x, y, _]| *x >= self.left && *x <= self.right && *y >= self.low && *y <= self.high)
    }
}

/// Twice the area, above 0 if the ring runs counterclockwise. It counts from the first vertex, so that far from zero no digits are lost.
fn double_area(ring: &Ring) -> f64 {
    let Some(first) = ring.first() else { return 0.0 };
    let from_first = |vertex: &[f64; 3]| [vertex[0] - first[0], vertex[1] - first[1]];
    let pairs = ring.windows(2).map(|pair| (from_first(&pair[0]), from_first(&pair[1])));
    pairs.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum()
}

/// Returns the vertices of an island that are compared with outlines.
fn looked_at(island: &Ring) -> impl Iterator<Item = &[f64; 3]> {
    const VERTICES: usize = 3;
    island.iter().step_by((island.len() / VERTICES).max(1)).take(VERTICES)
}

/// Tells whether most of the vertices of `island` that are looked at are within `outline`, which is closed: they may touch it.
pub(super) fn holds(outline: &Ring, island: &Ring) -> bool {
    let (mut within, mut all) = (0, 0);
    for vertex in looked_at(island) {
        within += usize::from(is_within(outline, vertex));
        all += 1;
    }
    2 * within > all
}

fn is_within(outline: &Ring, &[x, y, _]: &[f64; 3]) -> bool {
    let crosses = |pair: &&[[f64; 3]]| {
        let ([ax, ay, _], [bx, by, _]) = (pair[0], pair[1]);
        (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax)
    };
    outline.windows(2).filter(crosses).count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square, clockwise.
    fn square(at: f64, side: f64) -> Ring {
        let corners = [[at, at], [at, at + side], [at + side, at + side], [at + side, at], [at, at]];
        corners.map(|[x, y]| [x + 6e5, y + 5e6, 1.0]).to_vec()
    }

    fn turned(ring: Ring) -> Ring {
        ring.into_iter().rev().collect()
    }

    #[test]
    fn islands_belong_to_the_smallest_area_around_them() {
        let rings = vec![
            turned(square(3.0, 4.0)),
            square(0.0, 10.0),
            square(4.0, 2.0),
            turned(square(4.5, 1.0)),
            square(20.0, 1.0),
        ];
        let areas = areas_of(rings.clone()).unwrap();
        assert_eq!(areas.len(), 3);
        assert_eq!(areas[0], [rings[1].clone(), rings[0].clone()]);
        assert_eq!(areas[1], [rings[2].clone(), rings[3].clone()]);
        assert_eq!(areas[2], [rings[4].clone()]);
    }

    #[test]
    fn rings_that_all_run_the_wrong_way_are_areas() {
        assert_eq!(areas_of(vec![turned(square(0.0, 1.0)), turned(square(5.0, 1.0))]).unwrap().len(), 2);
        // An island in no area. Of a single one, all are islands.
        assert_eq!(areas_of(vec![square(0.0, 1.0), square(9.0, 1.0), turned(square(5.0, 1.0))]).unwrap().len(), 3);
        assert_eq!(areas_of(vec![square(0.0, 9.0), turned(square(5.0, 1.0))]).unwrap().len(), 1);
        assert_eq!(areas_of(Vec::new()).unwrap().len(), 0);
        assert_eq!(areas_of(vec![Vec::new()]).unwrap().len(), 1);
    }

    /// Each island would be compared with all vertices of each outline.
    #[test]
    fn thousands_of_rings_find_their_areas() {
        let side = 60.0;
        let at = |i: usize| [(i % 60) as f64 * side, (i / 60) as f64 * side];
        let moved =
            |ring: Ring, [x, y]: [f64; 2]| ring.into_iter().map(|v| [v[0] + x, v[1] + y, v[2]]).collect::<Ring>();
        let outlines = (0..3600).map(|i| moved(square(0.0, 50.0), at(i)));
        let islands = (0..3600).map(|i| moved(turned(square(10.0, 20.0)), at(i)));
        let areas = areas_of(outlines.chain(islands).collect()).unwrap();
        assert!(areas.len() == 3600 && areas.iter().all(|area| area.len() == 2));
    }
}
