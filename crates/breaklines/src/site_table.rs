//! The places of sites, no two of them within the floor.

use crate::exact::distance2;
use crate::fast_hash::FastMap;
use delaunay::geometry::Site;

/// The places of sites. Any two are farther apart than the floor, so their number is bounded by the length of lines, and so is that of
/// all steps that make new ones.
#[derive(Debug)]
pub(crate) struct SiteTable {
    places: Vec<Site>,
    floor: u32,
    /// The side of a cell in steps: a cell holds one place at most.
    side: i32,
    /// How many cells the floor reaches.
    reach: i32,
    cells: FastMap<[i32; 2], u32>,
}

impl SiteTable {
    /// Returns an empty table.
    pub(crate) fn new(floor: u32) -> SiteTable {
        // Places of one cell are at most (side - 1) * sqrt(2) apart, which is not more than the floor.
        let floor = floor.clamp(1, 1 << 20);
        let side = (u64::from(floor) * u64::from(floor) / 2).isqrt() as i32 + 1;
        SiteTable {
            places: Vec::new(),
            floor,
            side,
            reach: (floor as i32 + side - 1) / side,
            cells: FastMap::default(),
        }
    }

    /// Returns the floor.
    pub(crate) fn floor(&self) -> u32 {
        self.floor
    }

    /// Returns the number of sites.
    pub(crate) fn len(&self) -> usize {
        self.places.len()
    }

    /// Returns the place of a site.
    #[inline]
    pub(crate) fn place(&self, site: u32) -> Site {
        self.places[site as usize]
    }

    /// Returns the nearest site within the floor of `place`. Of several the least in x and y counts.
    pub(crate) fn nearest(&self, place: Site) -> Option<u32> {
        let [column, row] = self.cell(place);
        let rows = row - self.reach..=row + self.reach;
        let cells = rows.flat_map(|row| (column - self.reach..=column + self.reach).map(move |column| [column, row]));
        let found = cells.filter_map(|cell| self.cells.get(&cell).copied());
        let near = found.map(|site| (distance2(self.place(site), place), self.place(site), site));
        let floor2 = i64::from(self.floor) * i64::from(self.floor);
        near.filter(|(distance2, ..)| *distance2 <= floor2).min().map(|(.., site)| site)
    }

    /// Returns the nearest site within the floor of `place`, or a new one there.
    pub(crate) fn nearest_or_new(&mut self, place: Site) -> u32 {
        self.nearest(place).unwrap_or_else(|| {
            let site = self.places.len() as u32;
            self.places.push(place);
            self.cells.insert(self.cell(place), site);
            site
        })
    }

    fn cell(&self, place: Site) -> [i32; 2] {
        place.map(|value| value.div_euclid(self.side))
    }
}
