//! Which way a triangle flows: the rule by which slivers along the hull are left out of what viewers see.
//!
//! An obtuse triangle flows over its longest edge, towards its circumcentre, if that edge is much longer than the spacing of the points.
//! A triangle is **trimmed** if the way from triangle to triangle leads out of the hull. Any other way ends at a triangle that does not
//! flow, as in a river or a void: what is around it stays. This is the flow of Edelsbrunner, Facello and Liang, "On the definition and
//! the construction of pockets in macromolecules" (1998).
//!
//! The edges along a way grow strictly, so it ends. Else the triangles on both sides of an edge would be obtuse over it, and the sum of
//! the two angles above a half turn, which no Delaunay triangulation has. The way depends on the triangles alone.
//!
//! With `[output] max_error` flat ground has obtuse triangles with long edges along the hull too. Those that hold points stay,
//! unless it is a few at their border.
//!
//! No way crosses a piece of a breakline: its closed disc is empty, so no triangle is obtuse over it. So a lake with a closed shore stays.

use crate::plan::job_plan::Plan;
use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;
use selection::HeldPoints;
use std::collections::HashSet;
use std::sync::Arc;
use sys::{Error, Result};

/// An edge is long from this many times the mean spacing of all points on.
const SPACINGS: u64 = 10;
/// The same where classes or returns are chosen, or the ground is found: points on the ground are farther apart than all, often by three times.
const SPACINGS_OF_CHOSEN: u64 = 30;
/// The same where `max_error` selects few of them. A triangle on ground does not flow then, so triangles with such edges are listed: there are
/// at most a few for each thousand points.
const SPACINGS_OF_SELECTED: u64 = 35;
/// A triangle is on ground if it holds at least one of so many points that its area would have if they lay evenly ...
const SHARE_OF_AREA: u64 = 16;
/// ... and one of so many that its longest side would have, as a thin triangle over a bay has a few at its ends ...
const SHARE_OF_SIDE: u64 = 8;
/// ... and if more than a third of its cells hold a point: a triangle between two strips of ground may hold many, all of them along its border. So one
/// with fewer points is on none.
const LEAST_CELLS: u32 = HeldPoints::CELLS / 3 + 1;

/// The rule of a job.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct HullRule {
    /// The square of the longest edge that no triangle flows over, in square lattice steps.
    limit: u64,
    /// Triangles on ground, which stay: corners in ascending order. `None` where all points are corners.
    on_ground: Option<Arc<HashSet<[Site; 3]>>>,
}

impl HullRule {
    /// Returns the rule of a job. It follows from what headers tell, so every step knows it, whatever the parts and tiles; and with `max_error`
    /// from what the selection has found.
    ///
    /// # Errors
    /// [`Error::Broken`] if vertices are to be selected, and are not.
    pub fn of(plan: &Plan) -> Result<HullRule> {
        let rule = HullRule::of_lengths(plan);
        match (plan.options.output.selects(), plan.on_ground.get()) {
            (false, _) => Ok(rule),
            (true, Some(on_ground)) => Ok(HullRule { on_ground: Some(on_ground), ..rule }),
            (true, None) => Err(Error::Broken("the vertices are not selected".into())),
        }
    }

    /// Returns the rule that takes no triangle for one on ground.
    pub(crate) fn of_lengths(plan: &Plan) -> HullRule {
        let spacings = match (plan.options.output.selects(), plan.options.input.chooses_kinds()) {
            (true, _) => SPACINGS_OF_SELECTED,
            (false, true) => SPACINGS_OF_CHOSEN,
            (false, false) => SPACINGS,
        };
        let (records, area) = plan.density();
        HullRule::of_points(records, area, spacings)
    }

    /// Returns a number that differs for rules by other lengths.
    pub(crate) fn key(&self) -> u64 {
        self.limit
    }

    /// Returns the rule where so many points share an `area` in square lattice steps, and an edge is long from so many of their spacings on. No
    /// two points that stay are nearer than a step.
    fn of_points(points: u64, area: u64, spacings: u64) -> HullRule {
        let points = points.max(1);
        let limit = u128::from(spacings * spacings) * u128::from(area.max(points)) / u128::from(points);
        HullRule { limit: rounded(u64::try_from(limit).unwrap_or(u64::MAX)), on_ground: None }
    }

    /// Returns the longest edge that no triangle flows over, in lattice steps.
    pub fn length(&self) -> f64 {
        (self.limit as f64).sqrt()
    }

    /// Tells whether a triangle may flow over the edge from `a` to `b`.
    #[inline]
    pub fn is_long(&self, a: Site, b: Site) -> bool {
        dot(a, b, b) as u64 > self.limit
    }

    /// Returns the corner at which the edge begins that the triangle flows over.
    #[inline]
    pub fn flow(&self, corners: [Site; 3]) -> Option<usize> {
        let [a, b, c] = corners;
        // Few triangles have a long edge, so the processor predicts this branch. Half of all triangles are obtuse.
        if !(self.is_long(a, b) | self.is_long(b, c) | self.is_long(c, a)) {
            return None;
        }
        let is_obtuse = |&apex: &usize| dot(corners[apex], corners[(apex + 1) % 3], corners[(apex + 2) % 3]) < 0;
        let from = ((0..3).find(is_obtuse)? + 1) % 3;
        (self.is_long(corners[from], corners[(from + 1) % 3]) && !self.is_on_ground(corners)).then_some(from)
    }

    fn is_on_ground(&self, mut corners: [Site; 3]) -> bool {
        corners.sort_unstable();
        self.on_ground.as_ref().is_some_and(|known| known.contains(&corners))
    }

    /// Tells whether a triangle that holds such points is on ground. A few, or those at its border, do not make it so.
    pub(crate) fn has_ground(&self, held: &HeldPoints) -> bool {
        let HeldPoints { corners: [a, b, c], count, .. } = *held;
        let area = orient2d(a, b, c).unsigned_abs() / 2;
        let longest =
            [[a, b], [b, c], [c, a]].map(|[from, to]| dot(from, to, to) as u64).into_iter().max().unwrap_or(0);
        // The limit is the square of so many spacings.
        let is_enough = |points: u128, size: u64| {
            points * u128::from(self.limit)
                >= u128::from(size) * u128::from(SPACINGS_OF_SELECTED * SPACINGS_OF_SELECTED)
        };
        held.occupied() >= LEAST_CELLS
            && is_enough(u128::from(count * SHARE_OF_AREA), area)
            && is_enough(u128::from(count * SHARE_OF_SIDE).pow(2), longest)
    }
}

/// Returns a number rounded down to three bits, so that a few points more or less leave the rule of a job as it is.
fn rounded(number: u64) -> u64 {
    let below = u64::BITS.saturating_sub(number.leading_zeros() + 3);
    number >> below << below
}

/// Returns the dot product of the vectors from `o` to `a` and to `b`, which is below 2^62.
#[inline]
fn dot(o: Site, a: Site, b: Site) -> i64 {
    (0..2).map(|k| (a[k] as i64 - o[k] as i64) * (b[k] as i64 - o[k] as i64)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use delaunay::mesh::index::HalfEdgeIndex;
    use delaunay::triangulation::divide_and_conquer;
    use proptest::prelude::*;

    #[test]
    fn only_obtuse_triangles_with_a_long_edge_flow() {
        let rule = HullRule::of_points(1, 1, SPACINGS);
        assert_eq!(rule.flow([[0, 0], [11, 0], [5, 1]]), Some(0));
        assert_eq!(rule.flow([[5, 1], [0, 0], [11, 0]]), Some(1));
        assert_eq!(rule.flow([[0, 0], [9, 0], [5, 1]]), None, "not long");
        assert_eq!(rule.flow([[0, 0], [40, 0], [20, 20]]), None, "a right angle");
        let known = HashSet::from([[[0, 0], [5, 1], [11, 0]]]);
        let of_selected = HullRule { on_ground: Some(Arc::new(known)), ..rule.clone() };
        assert_eq!(of_selected.flow([[5, 1], [0, 0], [11, 0]]), None, "on ground");
        assert_eq!(of_selected.flow([[0, 0], [11, 0], [5, 2]]), Some(0), "another");
        let reach = 1 << 29;
        assert_eq!(rule.flow([[-reach, -reach], [reach, reach], [0, -1]]), Some(0), "the greatest extent");
    }

    /// Returns every so many-th of the lattice points inside a triangle that `is_wanted` takes, at most `count`.
    fn some_inside(corners: [Site; 3], count: usize, step: usize, is_wanted: impl Fn(Site) -> bool) -> HeldPoints {
        let [width, height] = [0, 1].map(|axis: usize| corners.map(|corner| corner[axis]).into_iter().max().unwrap());
        let all = (0..width).flat_map(|x| (0..height).map(move |y| [x, y]));
        let inside = all.filter(|&p| is_wanted(p) && HeldPoints::of(corners, [p]).count > 0);
        HeldPoints::of(corners, inside.step_by(step).take(count))
    }

    #[test]
    fn a_few_points_at_its_border_do_not_put_a_triangle_on_ground() {
        // A point for each step, or 1,225 / 1,024 in three bits: half of 1,600 squares.
        let (rule, corners) = (HullRule::of_points(1, 1, SPACINGS_OF_SELECTED), [[0, 0], [0, 40], [40, 0]]);
        let has_ground = |count| rule.has_ground(&some_inside(corners, count, 12, |_| true));
        assert!(has_ground(60) && !has_ground(59) && !has_ground(0));
        // Of a thin one the longest side decides: 800 spacings, of which there must be one of eight.
        let (rule, thin) = (HullRule::of_points(1, 100, SPACINGS_OF_SELECTED), [[0, 0], [4_000, 10], [8_000, 0]]);
        let has_ground = |count| rule.has_ground(&some_inside(thin, count, 300, |_| true));
        assert!(has_ground(104) && !has_ground(103));
    }

    #[test]
    fn many_points_along_one_side_do_not_put_a_triangle_on_ground() {
        let (rule, corners) = (HullRule::of_points(1, 1, SPACINGS_OF_SELECTED), [[0, 0], [0, 80], [80, 0]]);
        let strip = |width: i32| some_inside(corners, usize::MAX, 1, |p| p[0] < width);
        // A row of cells is ten steps wide. The first has 15 cells, the second 13.
        assert!(strip(10).count > 3 * 62 && !rule.has_ground(&strip(10)));
        assert!(rule.has_ground(&strip(20)));
    }

    proptest! {
        #[test]
        fn a_triangle_flows_over_its_longest_edge_if_that_is_long(
            corners in prop::array::uniform3(prop::array::uniform2(-60i32..60)),
            limit in 0u64..20_000,
        ) {
            let rule = HullRule { limit, on_ground: None };
            let square = |from: usize| {
                let [a, b] = [corners[from], corners[(from + 1) % 3]];
                dot(a, b, b)
            };
            let (longest, sum) = (0..3).map(square).fold((0, 0), |(most, sum), s| (most.max(s), sum + s));
            let flow = (2 * longest > sum && longest as u64 > limit).then_some(longest);
            prop_assert_eq!(rule.flow(corners).map(square), flow);
        }

        /// Even where many sites lie on one circle, so that there are several triangulations.
        #[test]
        fn edges_grow_along_a_way(sites in prop::collection::btree_set(prop::array::uniform2(-30i32..30), 3..120)) {
            let sites: Vec<Site> = sites.into_iter().collect();
            let mesh = divide_and_conquer::triangulate(&sites).unwrap();
            let rule = HullRule { limit: 0, on_ground: None };
            let flow = |t: usize| {
                let from = rule.flow(mesh.triangles[t].map(|v| sites[v.get()]))?;
                Some(HalfEdgeIndex::of_triangle(t)[from])
            };
            let length = |h: HalfEdgeIndex| {
                let [a, b] = [mesh.origin(h), mesh.destination(h)].map(|v| sites[v.get()]);
                dot(a, b, b)
            };
            for h in (0..mesh.triangles.len()).filter_map(flow) {
                let twin = mesh.twin(h);
                if twin != HalfEdgeIndex::HULL && let Some(next) = flow(twin.triangle()) {
                    prop_assert!(length(next) > length(h));
                }
            }
        }
    }
}
