//! Heights for lines without heights, from the points around.

use crate::breaklines::result::Breaklines;
use crate::geometry::Site;
use serde::{Deserialize, Serialize};

/// Finds for every site without a height the nearest point of the cloud. Of points at the same distance the lowest counts, so neither
/// the order of points nor the cut into chunks matters: threads collect for themselves, and join.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NearestHeights {
    places: Vec<Site>,
    /// For each site the square of the distance, and the height.
    nearest: Vec<Option<(u64, i32)>>,
}

impl NearestHeights {
    /// Returns a collection for the sites of `breaklines` that have no height.
    pub fn new(breaklines: &Breaklines) -> NearestHeights {
        let places: Vec<Site> =
            breaklines.sites().iter().filter(|site| site.z.is_none()).map(|site| site.place).collect();
        NearestHeights { nearest: vec![None; places.len()], places }
    }

    /// Returns whether no site needs a height.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Takes a point of the cloud into account, one that is dropped too.
    pub fn offer(&mut self, place: Site, z: i32) {
        for (site, nearest) in self.places.iter().zip(&mut self.nearest) {
            let along = |axis: usize| i64::from(site[axis] - place[axis]).unsigned_abs();
            let found = (along(0) * along(0) + along(1) * along(1), z);
            *nearest = Some(nearest.map_or(found, |before| before.min(found)));
        }
    }

    /// Takes into account what another collection for the same breaklines has found.
    pub fn join(&mut self, other: &NearestHeights) {
        for (mine, theirs) in self.nearest.iter_mut().zip(&other.nearest) {
            *mine = mine.into_iter().chain(*theirs).min();
        }
    }

    /// Gives `breaklines` the heights. Returns whether each site got one: it does not if no point was near.
    pub fn settle(&self, breaklines: &mut Breaklines) -> bool {
        breaklines.set_missing_heights(self.nearest.iter().map(|found| found.map_or(0, |(_, z)| z)));
        self.nearest.iter().all(Option::is_some)
    }
}
