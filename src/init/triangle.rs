//! Whether there is a triangle in the points of a job.

use job::plan::job_plan::Plan;
use points::Point;
use sys::{Result, interrupt};

/// The most chunks in which a triangle is looked for. Nearly every cloud has one in its first points.
const MOST_CHUNKS: usize = 64;

/// Points on one line, as far as they were looked at.
#[derive(Default)]
struct Line {
    /// Two different places.
    ends: Vec<[i32; 2]>,
    /// Whether a third place is not on their line.
    is_left: bool,
}

impl Line {
    fn add(&mut self, place: [i32; 2]) {
        self.is_left |= match self.ends[..] {
            [a, b] => is_beside(a, b, place),
            _ => false,
        };
        if self.ends.len() < 2 && !self.ends.contains(&place) {
            self.ends.push(place);
        }
    }
}

/// Tells whether `c` is not on the line through `a` and `b`.
fn is_beside(a: [i32; 2], b: [i32; 2], c: [i32; 2]) -> bool {
    let [u, v] = [b, c].map(|to| [0, 1].map(|axis| i64::from(to[axis]) - i64::from(a[axis])));
    i128::from(u[0]) * i128::from(v[1]) != i128::from(u[1]) * i128::from(v[0])
}

/// Returns whether the points that the job keeps may have a triangle: false only if all of them were looked at, and have none.
///
/// # Errors
/// Those of reading the files.
pub(crate) fn may_have_triangle(plan: &Plan) -> Result<bool> {
    let mut line = Line::default();
    let mut looked_at = 0;
    for input in &plan.inputs {
        let chunks = input.source.decoded_chunks(input.rules.bounds.as_ref());
        for chunk in (0..chunks.len()).map(|at| chunks.chunk(at)) {
            if line.is_left || looked_at == MOST_CHUNKS {
                return Ok(true);
            }
            looked_at += 1;
            interrupt::check()?;
            let mut sink = |points: &[Point]| {
                points.iter().for_each(|point| line.add(point.position));
                Ok(())
            };
            input.source.decode(chunk, &input.rules, &mut sink)?;
        }
    }
    Ok(line.is_left)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_left(places: &[[i32; 2]]) -> bool {
        let mut line = Line::default();
        places.iter().for_each(|place| line.add(*place));
        line.is_left
    }

    #[test]
    fn a_triangle_takes_three_places_that_are_not_on_one_line() {
        let far = i32::MAX;
        assert!(!is_left(&[]) && !is_left(&[[1, 1]; 5]) && !is_left(&[[0, 0], [1, 1], [0, 0], [-3, -3]]));
        assert!(is_left(&[[0, 0], [0, 0], [1, 1], [2, 2], [2, 3]]));
        assert!(is_left(&[[-far, -far], [far, far], [far, far - 1]]) && !is_left(&[[-far, -far], [far, far], [0, 0]]));
    }
}
