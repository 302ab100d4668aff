//! Synthetic clouds with whole coordinates, each difficult in a different way: those of `common/scattered.rs`, and regular ones.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use crate::random::Random;
use crate::scattered::rounded;
pub(crate) use crate::scattered::with_heights;
pub(crate) use crate::scattered::{Cloud, clusters, gaussian, uniform, write};

/// A square lattice: the corners of every cell are cocircular.
pub(crate) fn grid(columns: i64, rows: i64) -> Cloud {
    with_heights((0..rows).flat_map(|y| (0..columns).map(move |x| [x * 500, y * 500])))
}

/// Points ten steps apart, as close to one circle as whole numbers allow.
pub(crate) fn circle(count: usize) -> Cloud {
    let radius = count as f64 * 10.0 / TAU;
    with_heights((0..count).map(|i| {
        let (sin, cos) = (i as f64 * TAU / count as f64).sin_cos();
        rounded(radius * cos, radius * sin)
    }))
}

/// All points with whole coordinates on the circle of this radius around the origin: exactly cocircular.
pub(crate) fn exact_circle(radius: i64) -> Cloud {
    let height = |x: i64| ((radius * radius - x * x) as f64).sqrt().round() as i64;
    let on = (-radius..=radius).map(|x| (x, height(x))).filter(|&(x, y)| x * x + y * y == radius * radius);
    let points: BTreeSet<[i64; 2]> = on.flat_map(|(x, y)| [[x, y], [x, -y]]).collect();
    with_heights(points)
}

/// Points along a sloping line, at most `noise` steps away from it.
pub(crate) fn line(count: usize, noise: i64) -> Cloud {
    let mut random = Random(3);
    with_heights((0..count as i64).map(|k| [10 * k, 5 * k + random.below(2 * noise as u64 + 1) as i64 - noise]))
}
