//! The points of a finished line.

/// Returns the points of a line without repetitions of the one before. A ring ends with its first point. Returns `None` if nothing but a
/// point is left, or of a ring only a way there and back.
pub fn line_points(mut points: Vec<[f64; 2]>, is_closed: bool) -> Option<Vec<[f64; 2]>> {
    points.dedup();
    if !is_closed {
        return (points.len() > 1).then_some(points);
    }
    while points.len() > 1 && points.last() == points.first() {
        points.pop();
    }
    let first = *points.first().filter(|_| points.len() > 2)?;
    points.push(first);
    Some(points)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(xs: &[i32], is_closed: bool) -> Option<Vec<i32>> {
        let points = xs.iter().map(|x| [f64::from(*x), 0.0]).collect();
        line_points(points, is_closed).map(|points| points.iter().map(|[x, _]| *x as i32).collect())
    }

    #[test]
    fn points_are_not_repeated_and_rings_are_closed() {
        assert_eq!(of(&[1, 1, 2, 2, 2, 3], false), Some(vec![1, 2, 3]));
        assert_eq!(of(&[1, 1, 2, 3, 3, 1, 1], true), Some(vec![1, 2, 3, 1]));
        assert_eq!(of(&[1, 2, 3], true), Some(vec![1, 2, 3, 1]));
        assert_eq!(of(&[1, 2, 1], false), Some(vec![1, 2, 1]));
        for (xs, is_closed) in
            [(&[7, 7][..], false), (&[7, 7, 7], true), (&[7, 8, 7], true), (&[7, 8], true), (&[], true)]
        {
            assert_eq!(of(xs, is_closed), None, "{xs:?}");
        }
    }
}
