//! Whether the outline is one convex polygon, turning once.

use crate::geometry::Site;
use crate::verify::exact::side;
use std::cmp::Ordering;

/// Checks directed edges with the inside on their left, in any order; collinear corners are allowed. A sentence where they
/// are not the outline of a convex polygon.
pub(super) fn check(mut edges: Vec<[Site; 2]>) -> Result<(), String> {
    edges.sort_unstable();
    let Some(&start) = edges.first() else { return Err("there is no boundary".into()) };
    let (mut edge, mut length, mut rounds) = (start, 0, 0);
    loop {
        let next = following(&edges, edge[1])?;
        if !turns_left(edge, next) {
            return Err("the boundary is not convex".into());
        }
        rounds += (lower_half(edge) && !lower_half(next)) as u32;
        (edge, length) = (next, length + 1);
        if edge == start {
            break;
        }
        if length > edges.len() {
            return Err("the boundary is not one closed loop".into());
        }
    }
    if length != edges.len() {
        return Err(format!("the boundary is more than one loop: one has {length} of {} edges", edges.len()));
    }
    if rounds != 1 { Err(format!("the boundary turns {rounds} times round")) } else { Ok(()) }
}

/// The only edge that starts at `site`.
fn following(edges: &[[Site; 2]], site: Site) -> Result<[Site; 2], String> {
    let first = edges.partition_point(|edge| edge[0] < site);
    match edges[first..].iter().take_while(|edge| edge[0] == site).count() {
        1 => Ok(edges[first]),
        _ => Err("the boundary is not one closed loop".into()),
    }
}

/// Left or straight on, not back.
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

    fn outline(corners: &[Site]) -> Vec<[Site; 2]> {
        (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]).collect()
    }

    #[test]
    fn convex_outlines_hold() {
        assert_eq!(check(outline(&[[0, 0], [5, 0], [9, 0], [9, 9], [9, 10], [0, 10], [0, 3]])), Ok(()));
        assert_eq!(check(outline(&[[0, 0], [5, -3], [4, 8]])), Ok(()));
    }

    #[test]
    fn other_outlines_do_not() {
        let dented = outline(&[[0, 0], [9, 0], [5, 2], [9, 9], [0, 9]]);
        let back = outline(&[[0, 0], [9, 0], [5, 0], [9, 9]]);
        let clockwise = outline(&[[0, 0], [0, 9], [9, 0]]);
        let mut two = outline(&[[0, 0], [9, 0], [0, 9]]);
        two.extend(outline(&[[20, 0], [29, 0], [20, 9]]));
        let star = outline(&[[0, 0], [9, 6], [-3, 6], [6, 0], [3, 10]]);
        let open = vec![[[0, 0], [9, 0]], [[9, 0], [0, 9]]];
        for edges in [dented, back, clockwise, two, star, open, vec![]] {
            assert!(check(edges.clone()).is_err(), "{edges:?}");
        }
    }
}
