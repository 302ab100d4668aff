//! Sorting points by bucket on one thread, before they go to the buckets that all threads share.

use crate::partition::buckets::Buckets;
use crate::partition::grid::Grid;
use delaunay::geometry::Bounds;
use multiversion::multiversion;
use points::Point;
use sys::Result;

/// Sorts points by bucket before they go to the shared buffers, so that each bucket is locked once for many points.
pub(crate) struct BucketSorter<'a> {
    grid: &'a Grid,
    buckets: &'a Buckets<'a>,
    bucket_of: Vec<u32>,
    ends: Vec<u32>,
    sorted: Vec<Point>,
    bounds: Option<Bounds<3>>,
}

impl<'a> BucketSorter<'a> {
    pub(crate) fn new(grid: &'a Grid, buckets: &'a Buckets<'a>) -> BucketSorter<'a> {
        let (bucket_of, ends, sorted) = (Vec::new(), Vec::new(), Vec::new());
        BucketSorter { grid, buckets, bucket_of, ends, sorted, bounds: None }
    }

    /// Returns the box of all points so far.
    pub(crate) fn bounds(&self) -> Option<Bounds<3>> {
        self.bounds
    }

    /// Adds `points` to their buckets.
    pub(crate) fn add(&mut self, points: &[Point]) -> Result<()> {
        let Some(first) = points.first().map(Point::corner) else { return Ok(()) };
        let bounds = self.bounds.unwrap_or(Bounds::of_point(first));
        self.bounds = Some(sort(self, points, bounds));
        // Each end has come down to where its bucket starts.
        self.ends.push(points.len() as u32);
        for bucket in 0..self.grid.buckets() {
            let run = self.ends[bucket] as usize..self.ends[bucket + 1] as usize;
            if !run.is_empty() {
                self.buckets.extend(bucket, &self.sorted[run])?;
            }
        }
        Ok(())
    }
}

/// Sorts `points` by bucket, leaves in `ends` where the run of each bucket starts, and returns the union of `bounds` and their box.
// With the instructions of today's processors this takes less time.
#[multiversion(targets("x86_64+avx2+bmi1+bmi2+lzcnt+popcnt"))]
fn sort(sorter: &mut BucketSorter, points: &[Point], mut bounds: Bounds<3>) -> Bounds<3> {
    let BucketSorter { grid, bucket_of, ends, sorted, .. } = sorter;
    ends.clear();
    ends.resize(grid.buckets(), 0);
    bucket_of.resize(points.len(), 0);
    for (point, bucket) in points.iter().zip(bucket_of.iter_mut()) {
        *bucket = grid.bucket(point.position);
        ends[*bucket as usize] += 1;
        bounds.include(point.corner());
    }
    let mut end = 0;
    for count in ends.iter_mut() {
        end += *count;
        *count = end;
    }
    sorted.resize(points.len(), bytemuck::Zeroable::zeroed());
    for (point, &bucket) in points.iter().zip(bucket_of.iter()).rev() {
        let end = &mut ends[bucket as usize];
        *end -= 1;
        sorted[*end as usize] = *point;
    }
    bounds
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::partition::point_file::{PointFile, PointFiles};
    use proptest::prelude::*;
    use rayon::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// Several threads add slices of any length, and buffers are full now and then.
        #[test]
        fn every_point_gets_into_its_bucket(
            places in prop::collection::vec(prop::array::uniform3(-50i32..150), 0..2000),
            slice in 1usize..700,
            memory in 0u64..50_000,
        ) {
            let folder = tempfile::tempdir().unwrap();
            let file = PointFile::create(&folder.path().join("points"), 0).unwrap();
            let point = |(order, &[x, y, z]): (u64, &[i32; 3])| Point::new([x, y], z, [0; 3], 0, order);
            let points: Vec<Point> = (0..).zip(&places).map(point).collect();
            let grid = Grid::over(Bounds { min: [0, 0], max: [99, 49] }, 8);
            let buckets = Buckets::new(&file, grid.buckets(), memory);
            let add = |points: &[Point]| {
                let mut sorter = BucketSorter::new(&grid, &buckets);
                points.chunks(slice).try_for_each(|points| sorter.add(points))?;
                Ok(sorter.bounds())
            };
            let bounds: Result<Vec<_>> = points.par_chunks(1000).map(add).collect();
            let buckets = buckets.finish().unwrap();
            let bounds = bounds.unwrap().into_iter().flatten().reduce(Bounds::union);
            prop_assert_eq!(bounds, Bounds::of_points(places));
            let files = PointFiles::open(&[]).unwrap().and(file);
            for (index, bucket) in buckets.iter().enumerate() {
                let mut found = Vec::new();
                bucket.blocks.iter().for_each(|&block| files.read(block, &mut found).unwrap());
                found.sort_by_key(Point::order);
                let expected: Vec<_> =
                    points.iter().copied().filter(|p| grid.bucket(p.position) as usize == index).collect();
                prop_assert_eq!(bucket.points, found.len() as u64);
                prop_assert_eq!(found, expected);
            }
        }
    }
}
