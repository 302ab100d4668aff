//! Checks that the boundary is one convex polygon that turns round once.

use crate::exact::side;
use delaunay::geometry::Site;
use std::cmp::Ordering;

/// Why a boundary is not one convex polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum BoundaryError {
    #[error("there is no boundary")]
    Missing,
    #[error("the boundary is not one closed loop")]
    NotClosed,
    #[error("the boundary is not convex")]
    NotConvex,
    #[error("the boundary is more than one loop: one has {length} of {edges} edges")]
    SeveralLoops { length: usize, edges: usize },
    #[error("the boundary turns round {0} times")]
    Turns(u32),
}

/// Checks that directed `edges`, in any order, with the inside on their left, are the boundary of a convex polygon. Collinear
/// corners are allowed.
pub(super) fn check_boundary(mut edges: Vec<[Site; 2]>) -> Result<(), BoundaryError> {
    edges.sort_unstable();
    let &start = edges.first().ok_or(BoundaryError::Missing)?;
    let (mut edge, mut length, mut rounds) = (start, 0, 0);
    loop {
        let next = following(&edges, edge[1])?;
        if !turns_left(edge, next) {
            return Err(BoundaryError::NotConvex);
        }
        rounds += (lower_half(edge) && !lower_half(next)) as u32;
        (edge, length) = (next, length + 1);
        if edge == start {
            break;
        }
        if length > edges.len() {
            return Err(BoundaryError::NotClosed);
        }
    }
    if length != edges.len() {
        return Err(BoundaryError::SeveralLoops { length, edges: edges.len() });
    }
    if rounds != 1 { Err(BoundaryError::Turns(rounds)) } else { Ok(()) }
}

/// Returns the only edge that starts at `site`.
fn following(edges: &[[Site; 2]], site: Site) -> Result<[Site; 2], BoundaryError> {
    let first = edges.partition_point(|edge| edge[0] < site);
    match edges[first..].iter().take_while(|edge| edge[0] == site).count() {
        1 => Ok(edges[first]),
        _ => Err(BoundaryError::NotClosed),
    }
}

/// Whether the corner turns left or goes straight on, not back.
fn turns_left(edge: [Site; 2], next: [Site; 2]) -> bool {
    match side(edge[0], edge[1], next[1]) {
        Ordering::Equal => lower_half(edge) == lower_half(next),
        turn => turn.is_gt(),
    }
}

/// Whether a direction is in [180, 360) degrees. A loop of left turns of less than 180 degrees comes back from there to
/// [0, 180) once for every time it turns round.
fn lower_half([a, b]: [Site; 2]) -> bool {
    b[1] < a[1] || (b[1] == a[1] && b[0] < a[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn boundary(corners: &[Site]) -> Vec<[Site; 2]> {
        (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]).collect()
    }

    #[test]
    fn convex_boundaries_pass() {
        assert_eq!(check_boundary(boundary(&[[0, 0], [5, 0], [9, 0], [9, 9], [9, 10], [0, 10], [0, 3]])), Ok(()));
        assert_eq!(check_boundary(boundary(&[[0, 0], [5, -3], [4, 8]])), Ok(()));
    }

    #[test]
    fn other_boundaries_fail() {
        let dented = boundary(&[[0, 0], [9, 0], [5, 2], [9, 9], [0, 9]]);
        let back = boundary(&[[0, 0], [9, 0], [5, 0], [9, 9]]);
        let clockwise = boundary(&[[0, 0], [0, 9], [9, 0]]);
        let mut two = boundary(&[[0, 0], [9, 0], [0, 9]]);
        two.extend(boundary(&[[20, 0], [29, 0], [20, 9]]));
        let star = boundary(&[[0, 0], [9, 6], [-3, 6], [6, 0], [3, 10]]);
        let open = vec![[[0, 0], [9, 0]], [[9, 0], [0, 9]]];
        for edges in [dented, back, clockwise, two, star, open, vec![]] {
            assert!(check_boundary(edges.clone()).is_err(), "{edges:?}");
        }
    }
}
