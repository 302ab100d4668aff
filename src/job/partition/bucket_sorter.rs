//! Sorting points by bucket on one thread, before they go to the buckets that all threads share.

use crate::Result;
use crate::geometry::Bounds;
use crate::input::Point;
use crate::job::partition::buckets::Buckets;
use crate::job::partition::grid::Grid;

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
        self.count(points);
        self.sorted.resize(points.len(), bytemuck::Zeroable::zeroed());
        for (point, &bucket) in points.iter().zip(&self.bucket_of).rev() {
            let end = &mut self.ends[bucket as usize];
            *end -= 1;
            self.sorted[*end as usize] = *point;
        }
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

    /// Finds the bucket of every point, where the run of each bucket ends in sorted order, and the box of all points.
    fn count(&mut self, points: &[Point]) {
        self.ends.clear();
        self.ends.resize(self.grid.buckets(), 0);
        self.bucket_of.clear();
        let Some(first) = points.first().map(Point::corner) else { return };
        let mut bounds = self.bounds.unwrap_or(Bounds::of_point(first));
        for point in points {
            let bucket = self.grid.bucket(point.position);
            self.bucket_of.push(bucket);
            self.ends[bucket as usize] += 1;
            bounds.include(point.corner());
        }
        self.bounds = Some(bounds);
        let mut end = 0;
        for count in &mut self.ends {
            end += *count;
            *count = end;
        }
    }
}
