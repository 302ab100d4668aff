//! The corners of the convex hull.

use delaunay::geometry::Site;
use delaunay::geometry::predicates::orient2d;

/// Returns the corners of the convex hull of `points` with their heights, counterclockwise (Andrew's monotone chain). Points on its edges are
/// none. Of points on a line these are the two ends.
pub(crate) fn hull_corners(mut points: Vec<[i32; 3]>) -> Vec<[i32; 3]> {
    leave_out_inner(&mut points);
    points.sort_unstable();
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    ring(&points)
}

/// Returns the corners of the hull of points in order, of which there are three at least.
fn ring(points: &[[i32; 3]]) -> Vec<[i32; 3]> {
    let mut hull = chain(points.iter());
    hull.extend(chain(points.iter().rev()));
    hull
}

/// Removes points that lie inside the quadrilateral of those that are outermost along the diagonals, which are nearly all (Akl and Toussaint
/// 1978, "A fast convex hull algorithm").
fn leave_out_inner(points: &mut Vec<[i32; 3]>) {
    let along = |sign: i64| move |p: &&[i32; 3]| i64::from(p[0]) + sign * i64::from(p[1]);
    let [up, down] = [along(1), along(-1)];
    let ends = |along: &dyn Fn(&&[i32; 3]) -> i64| [points.iter().min_by_key(along), points.iter().max_by_key(along)];
    let mut outermost: Vec<[i32; 3]> = [ends(&up), ends(&down)].into_iter().flatten().flatten().copied().collect();
    outermost.sort_unstable();
    outermost.dedup();
    if outermost.len() < 3 {
        return;
    }
    let ring: Vec<Site> = ring(&outermost).iter().map(|p| [p[0], p[1]]).collect();
    let is_inside =
        |[x, y, _]: &[i32; 3]| (0..ring.len()).all(|k| orient2d(ring[k], ring[(k + 1) % ring.len()], [*x, *y]) > 0);
    points.retain(|point| !is_inside(point));
}

/// Returns the chain that turns left from the first point to the last, without the last.
fn chain<'a>(points: impl Iterator<Item = &'a [i32; 3]>) -> Vec<[i32; 3]> {
    let site = |p: [i32; 3]| -> Site { [p[0], p[1]] };
    let mut chain: Vec<[i32; 3]> = Vec::new();
    for &point in points {
        while let [.., before, last] = chain[..]
            && orient2d(site(before), site(last), site(point)) <= 0
        {
            chain.pop();
        }
        chain.push(point);
    }
    chain.pop();
    chain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_corners_are_on_the_hull() {
        let square: Vec<[i32; 3]> = (0..25).map(|i| [i % 5, i / 5, i]).collect();
        assert_eq!(hull_corners(square), [[0, 0, 0], [4, 0, 4], [4, 4, 24], [0, 4, 20]]);
        let line: Vec<[i32; 3]> = (0..5).map(|i| [i, 2 * i, 0]).collect();
        assert_eq!(hull_corners(line), [[0, 0, 0], [4, 8, 0]]);
        assert_eq!(hull_corners(vec![[7, 7, 7]]), [[7, 7, 7]]);
    }
}
