//! How long the edges along lines are.

use crate::plan::extent::{Extent, to_float};
use lattice::Lattice;
use points::lines::options::{LineOptions, LineSpacing};
use sys::{Error, Result};

/// Longer subsegments than this need no rule: no terrain has points so far apart.
const LONGEST: u32 = 1 << 24;

/// Returns the length of subsegments in lattice steps. With "auto" it is the mean distance of the `records` points that have the boxes of
/// `extent`, and so depends on headers alone. `area` is that of the box around all of them, in square lattice steps.
///
/// # Errors
/// [`Error::Config`] if two entries say different lengths: lines of both may meet.
pub(super) fn spacing(all: &[LineOptions], lattice: &Lattice, extent: &Extent, area: u64, records: u64) -> Result<u32> {
    let lengths = all.iter().filter_map(|options| match options.spacing {
        LineSpacing::Auto => None,
        LineSpacing::Length(length) => Some(length),
    });
    let mut lengths: Vec<f64> = lengths.collect();
    lengths.dedup();
    match lengths.as_slice() {
        [] => Ok(mean_distance(lattice, extent, area, records)),
        [length] => Ok((length / to_float(lattice.resolution)).round().clamp(1.0, f64::from(LONGEST)) as u32),
        [first, second, ..] => Err(Error::Config(format!(
            "[[breaklines]] spacing is {first} in one entry and {second} in another: set the same in all entries, because lines that \
             meet are divided alike"
        ))),
    }
}

/// Where files lie side by side, their own areas count, and not what is between them. Where they overlap, the box around all of them does.
fn mean_distance(lattice: &Lattice, extent: &Extent, area: u64, records: u64) -> u32 {
    let step = to_float(lattice.resolution);
    let side = |min: f64, max: f64| ((max - min).max(0.0) / step).round() as u128 + 1;
    let of_box = |[min, max]: &[[f64; 3]; 2]| side(min[0], max[0]) * side(min[1], max[1]);
    let of_files: u128 = extent.boxes.iter().flatten().map(of_box).fold(0, u128::saturating_add);
    let area = of_files.min(u128::from(area));
    let distance = (area / u128::from(records.max(1))).isqrt();
    distance.clamp(1, u128::from(LONGEST)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use rust_decimal::Decimal;

    fn lattice() -> Lattice {
        let step = Decimal::new(1, 2);
        Lattice::new([Decimal::ZERO; 3], step, step).unwrap()
    }

    fn extent(boxes: &[[f64; 4]]) -> Extent {
        let boxes = boxes.iter().map(|[a, b, c, d]| Some([[*a, *b, 0.0], [*c, *d, 9.0]])).collect();
        Extent { min: [0.0; 3], max: [0.0; 3], boxes }
    }

    fn options(text: &str) -> Vec<LineOptions> {
        text.split('|').map(|rest| toml::from_str(&format!("files = [\"a\"]\n{rest}")).unwrap()).collect()
    }

    #[test]
    fn the_mean_distance_follows_from_the_boxes() {
        let auto = options("");
        let distance = |boxes: &[[f64; 4]], area| spacing(&auto, &lattice(), &extent(boxes), area, 100).unwrap();
        // Ten by ten metres, and a hundred points: a metre.
        assert_eq!(distance(&[[0.0, 0.0, 10.0, 10.0]], 1001 * 1001), 100);
        // Two strips over the same area.
        assert_eq!(distance(&[[0.0, 0.0, 10.0, 10.0]; 2], 1001 * 1001), 100);
        // Two places far apart.
        assert_eq!(distance(&[[0.0, 0.0, 5.0, 10.0], [1e4, 0.0, 10_005.0, 10.0]], 1 << 40), 100);
        assert_eq!(distance(&[], 0), 1);
    }

    #[test]
    fn all_entries_say_the_same() {
        let of = |text| spacing(&options(text), &lattice(), &extent(&[]), 1, 1);
        assert_eq!(of("spacing = 2.5|").unwrap(), 250);
        assert_eq!(of("spacing = 1e-9|spacing = 1e-9").unwrap(), 1);
        assert!(of("spacing = 1|spacing = 2").unwrap_err().to_string().contains("1 in one entry and 2"));
    }
}
