//! The list of terrain tiles, `layer.json`: which tiles of each zoom there are.

use quantized_mesh::Scheme;
use serde::Deserialize;
use std::ops::RangeInclusive;
use std::path::Path;

/// Finer zooms than this are not written.
const MOST_ZOOM: usize = 30;

/// The list of terrain tiles.
#[derive(Deserialize)]
pub(crate) struct Layer {
    projection: String,
    pub(crate) extensions: Vec<String>,
    pub(crate) available: Vec<Vec<Rectangle>>,
}

impl Layer {
    /// Returns its scheme; `None` if that is another one.
    pub(crate) fn scheme(&self) -> Option<Scheme> {
        [Scheme::Geographic, Scheme::WebMercator].into_iter().find(|scheme| scheme.projection() == self.projection)
    }
}

/// Columns and rows of tiles, first and last.
#[derive(Clone, Copy, Deserialize)]
pub(crate) struct Rectangle {
    #[serde(rename = "startX")]
    west: i32,
    #[serde(rename = "endX")]
    east: i32,
    #[serde(rename = "startY")]
    south: i32,
    #[serde(rename = "endY")]
    north: i32,
}

/// Tells whether the tile at `path`, `zoom/column/row.terrain`, is one of those that are `available`.
pub(crate) fn is_listed(available: &[Vec<Rectangle>], path: &Path) -> bool {
    let numbers: Vec<Option<i32>> =
        path.with_extension("").iter().map(|part| part.to_str().and_then(|part| part.parse().ok())).collect();
    let &[Some(zoom), Some(column), Some(row)] = numbers.as_slice() else { return false };
    if path != Path::new(&format!("{zoom}/{column}/{row}.terrain")) {
        return false;
    }
    let of_zoom = usize::try_from(zoom).ok().and_then(|zoom| available.get(zoom));
    let holds = |all: &Rectangle| (all.west..=all.east).contains(&column) && (all.south..=all.north).contains(&row);
    of_zoom.is_some_and(|rectangles| rectangles.iter().any(holds))
}

/// Tells whether all rectangles lie within their zooms.
pub(crate) fn is_possible(scheme: Scheme, available: &[Vec<Rectangle>]) -> bool {
    let is_in = |low: i32, high: i32, count: i64| 0 <= low && low <= high && i64::from(high) < count;
    let fits = |(zoom, rectangles): (u8, &Vec<Rectangle>)| {
        let [columns, rows] = [scheme.columns(zoom).into(), 1i64 << zoom];
        rectangles.iter().all(|all| is_in(all.west, all.east, columns) && is_in(all.south, all.north, rows))
    };
    available.len() < MOST_ZOOM && (0..).zip(available).all(fits)
}

/// Returns the rows of rectangles from the south, each with runs of its columns from the west.
pub(crate) fn rows(mut rectangles: Vec<Rectangle>) -> impl Iterator<Item = (i32, Vec<RangeInclusive<i32>>)> {
    rectangles.sort_unstable_by_key(|rectangle| std::cmp::Reverse(rectangle.south));
    let (mut open, mut row): (Vec<Rectangle>, i32) = (Vec::new(), -1);
    std::iter::from_fn(move || {
        open.retain(|rectangle| rectangle.north > row);
        row = match (open.is_empty(), rectangles.last()) {
            (false, _) => row + 1,
            (true, next) => next?.south,
        };
        while let Some(next) = rectangles.pop_if(|next| next.south == row) {
            open.push(next);
        }
        Some((row, runs(&open)))
    })
}

/// Returns the columns of rectangles, each once.
fn runs(rectangles: &[Rectangle]) -> Vec<RangeInclusive<i32>> {
    let mut ends: Vec<[i32; 2]> = rectangles.iter().map(|rectangle| [rectangle.west, rectangle.east]).collect();
    ends.sort_unstable();
    let mut runs: Vec<[i32; 2]> = Vec::new();
    for [west, east] in ends {
        match runs.last_mut() {
            Some(last) if west <= last[1] => last[1] = last[1].max(east),
            _ => runs.push([west, east]),
        }
    }
    runs.into_iter().map(|[west, east]| west..=east).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    proptest! {
        #[test]
        fn rows_have_all_tiles_of_the_rectangles_once(
            rectangles in prop::collection::vec((0..20i32, 0..20i32, 0..4i32, 0..4i32), 0..12),
        ) {
            let rectangle = |&(west, south, wide, high): &(i32, i32, i32, i32)| {
                Rectangle { west, east: west + wide, south, north: south + high }
            };
            let rectangles: Vec<Rectangle> = rectangles.iter().map(rectangle).collect();
            let expected: BTreeSet<[i32; 2]> = rectangles
                .iter()
                .flat_map(|all| (all.south..=all.north).flat_map(|y| (all.west..=all.east).map(move |x| [y, x])))
                .collect();
            let found: Vec<[i32; 2]> =
                rows(rectangles).flat_map(|(y, runs)| runs.into_iter().flatten().map(move |x| [y, x])).collect();
            prop_assert_eq!(found, expected.into_iter().collect::<Vec<_>>());
        }
    }
}
