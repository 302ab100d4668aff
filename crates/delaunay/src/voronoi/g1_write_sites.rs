//! Step G1: write the sites into a texture. One site wins a pixel. Another site of that pixel moves to a free pixel next to it in the
//! row, or is missing.
//!
//! The sites are numbered by row and column of their pixels, which is the order in which all later steps meet them.

use crate::geometry::REACH;
use crate::geometry::{Bounds, Site};
use crate::mesh::index::SiteIndex;
use crate::voronoi::c3_insert::MissingSite;
use crate::voronoi::counts::PipelineCounts;
use crate::voronoi::index::VertexIndex;
use crate::voronoi::pixel_map::PixelMap;
use crate::voronoi::rejection::Rejection;
use crate::voronoi::texture_request::{TextureRequest, TextureResolution};

/// The largest fraction of missing sites with which the pipeline is still worthwhile.
pub(super) const MAX_MISSING: f64 = 0.4;

/// A pixel of the row at hand that has no site.
const EMPTY: u32 = u32::MAX;

/// A site of a row of the texture.
#[derive(Clone, Copy, Default)]
struct RowSite {
    /// The column of its pixel.
    x: u32,
    /// Its position in the input.
    index: SiteIndex,
    site: Site,
}

impl RowSite {
    /// Sites that share a pixel come from the west to the east by this key.
    #[inline(always)]
    fn key(&self) -> (Site, SiteIndex) {
        (self.site, self.index)
    }
}

/// A texture with the sites in it. Pixel (x, y) is column x from the west, row y from the south.
#[derive(Default)]
pub(super) struct SiteTexture {
    pub(super) width: usize,
    pub(super) height: usize,
    /// Words of 64 pixels in a row.
    pub(super) words: usize,
    /// Bit x % 64 of word `y * words + x / 64` says whether pixel (x, y) has a site.
    pub(super) occupied: Vec<u64>,
    /// The vertex in a pixel that has a site, at `64 * words * y + x`. Other entries are left from earlier leaves.
    pub(super) vertices: Vec<VertexIndex>,
    /// The position of every site in the input, by vertex: first the sites in the texture, then the missing ones.
    pub(super) order: Vec<SiteIndex>,
    /// The site of every vertex, with one more entry for the vertex at infinity.
    pub(super) sites: Vec<Site>,
    /// The number of sites in the texture.
    pub(super) placed: usize,
    /// The pixel (y << 16 | x) to which each missing site belongs.
    missing: Vec<u32>,
    /// The pixel (y << 16 | x) of every site of the input.
    pixels: Vec<u32>,
    /// The missing sites, in the order of `missing`.
    missing_sites: Vec<RowSite>,
    /// The end of every row in `rows`.
    row_ends: Vec<u32>,
    /// The sites, row by row.
    rows: Vec<RowSite>,
    /// The position in `rows` of the site in each pixel of the row at hand.
    row: Vec<u32>,
    /// The positions in `rows` of the sites that have lost their pixels.
    losers: Vec<u32>,
}

impl SiteTexture {
    /// Scales and writes `sites`.
    pub(super) fn write(
        &mut self,
        sites: &[Site],
        request: &TextureRequest,
        counts: &mut PipelineCounts,
    ) -> Result<(), Rejection> {
        let map = self.fit(sites, request)?;
        self.sort_by_row(sites, &map);
        self.clear(sites.len());
        let max_missing = (MAX_MISSING * sites.len() as f64) as usize;
        for y in 0..self.height {
            self.write_row(y, counts);
            // Stop early: a caller that cuts a crowded leaf may have to try many times.
            if self.missing.len() > max_missing {
                return Err(Rejection::Crowded);
            }
        }
        self.append_missing();
        counts.missing += self.missing.len() as u64;
        Ok(())
    }

    /// Chooses a width and height in the proportions of the sites' bounding box; returns where the pixels lie.
    fn fit(&mut self, sites: &[Site], request: &TextureRequest) -> Result<PixelMap, Rejection> {
        let bounds = Bounds::of_points(sites.iter().copied()).ok_or(Rejection::TooFew)?;
        let within_reach = |c: &i32| (-REACH..=REACH).contains(c);
        if !bounds.min.iter().chain(&bounds.max).all(within_reach) {
            return Err(Rejection::OutOfReach);
        }
        let extent = [0, 1].map(|axis| bounds.extent(axis) as f64 + 1.0);
        let scale = request.scale(extent, sites.len());
        // A size that somebody asked for stays.
        let may_shrink = matches!(request.resolution, TextureResolution::PixelsPerSite(_));
        let map = PixelMap::new(sites, bounds.min, extent, scale, may_shrink);
        [self.width, self.height] = map.size;
        self.words = self.width.div_ceil(64);
        match map.missing(sites) > MAX_MISSING {
            true => Err(Rejection::Crowded),
            false => Ok(map),
        }
    }

    /// Returns the missing sites, each with its pixel (y << 16 | x).
    pub(super) fn missing(&self) -> impl Iterator<Item = MissingSite> {
        let vertices = (self.placed as u32..).map(VertexIndex);
        vertices.zip(&self.missing).map(|(vertex, &place)| MissingSite { vertex, place })
    }

    /// Fills `rows` and `row_ends`.
    fn sort_by_row(&mut self, sites: &[Site], map: &PixelMap) {
        self.row_ends.clear();
        self.row_ends.resize(self.height + 1, 0);
        self.pixels.clear();
        map.append_to(&mut self.pixels, sites.iter());
        self.rows.resize(sites.len(), RowSite::default());
        let numbered = (0..).map(SiteIndex).zip(self.pixels.iter().zip(sites));
        let row_sites = numbered.map(|(index, (&pixel, &site))| RowSite { x: pixel & 0xffff, index, site });
        if self.pixels.is_sorted_by_key(|pixel| pixel >> 16) {
            find_row_ends(&self.pixels, &mut self.row_ends);
            for (to, site) in self.rows.iter_mut().zip(row_sites) {
                *to = site;
            }
            return;
        }
        for &pixel in &self.pixels {
            self.row_ends[(pixel >> 16) as usize + 1] += 1;
        }
        for y in 0..self.height {
            self.row_ends[y + 1] += self.row_ends[y];
        }
        for (site, &pixel) in row_sites.zip(&self.pixels) {
            let end = &mut self.row_ends[(pixel >> 16) as usize];
            self.rows[*end as usize] = site;
            *end += 1;
        }
    }

    fn clear(&mut self, sites: usize) {
        self.occupied.clear();
        self.occupied.resize(self.words * self.height, 0);
        let pixels = 64 * self.words * self.height;
        if self.vertices.len() < pixels {
            self.vertices.resize(pixels, VertexIndex::default());
        }
        self.order.clear();
        self.order.reserve(sites);
        self.sites.clear();
        self.sites.reserve(sites + 1);
        self.missing.clear();
        self.missing_sites.clear();
        self.row.clear();
        self.row.resize(self.width, EMPTY);
    }

    /// Writes row `y` and numbers its sites from west to east.
    fn write_row(&mut self, y: usize, counts: &mut PipelineCounts) {
        let first = if y == 0 { 0 } else { self.row_ends[y - 1] };
        self.losers.clear();
        for (at, site) in (first..).zip(&self.rows[first as usize..self.row_ends[y] as usize]) {
            let x = site.x as usize;
            if self.row[x] == EMPTY {
                self.row[x] = at;
                self.occupied[y * self.words + x / 64] |= 1 << (x % 64);
            } else {
                self.losers.push(at);
            }
        }
        if self.losers.len() > self.width / 8 {
            // If many sites will be missing, neighbours should be inserted one after the other.
            self.losers.sort_unstable_by_key(|&at| self.rows[at as usize].site);
        }
        for i in 0..self.losers.len() {
            counts.moved += self.place_loser(y, self.losers[i]) as u64;
        }
        for word in y * self.words..(y + 1) * self.words {
            let mut bits = self.occupied[word];
            while bits != 0 {
                let x = (word - y * self.words) * 64 + bits.trailing_zeros() as usize;
                let RowSite { index, site, .. } = self.rows[std::mem::replace(&mut self.row[x], EMPTY) as usize];
                self.vertices[64 * self.words * y + x] = VertexIndex(self.sites.len() as u32);
                self.order.push(index);
                self.sites.push(site);
                bits &= bits - 1;
            }
        }
    }

    /// Places the site at `loser` in `rows`, which has lost its pixel: it or the winner moves one pixel west or east, in the order of their
    /// x. Returns false if the site is missing.
    fn place_loser(&mut self, y: usize, loser: u32) -> bool {
        let site = self.rows[loser as usize];
        let x = site.x as usize;
        let winner = self.row[x];
        let is_west = site.key() < self.rows[winner as usize].key();
        let (west, east) = if is_west { (loser, winner) } else { (winner, loser) };
        if x + 1 < self.width && self.row[x + 1] == EMPTY {
            self.row[x] = west;
            self.row[x + 1] = east;
            self.occupied[y * self.words + (x + 1) / 64] |= 1 << ((x + 1) % 64);
            true
        } else if x > 0 && self.row[x - 1] == EMPTY {
            self.row[x - 1] = west;
            self.row[x] = east;
            self.occupied[y * self.words + (x - 1) / 64] |= 1 << ((x - 1) % 64);
            true
        } else {
            self.missing.push((y << 16 | x) as u32);
            self.missing_sites.push(site);
            false
        }
    }

    /// Gives the missing sites the numbers after those in the texture, and the vertex at infinity the last number.
    fn append_missing(&mut self) {
        self.placed = self.sites.len();
        self.order.extend(self.missing_sites.iter().map(|missing| missing.index));
        self.sites.extend(self.missing_sites.iter().map(|missing| missing.site));
        self.sites.push([0; 2]);
    }
}

/// Finds the end of every row of pixels (y << 16 | x) that come row by row, as in a job. To count them would take longer, because each
/// count waits for the one before.
fn find_row_ends(pixels: &[u32], row_ends: &mut [u32]) {
    let mut first = 0;
    for (i, pair) in (1..).zip(pixels.windows(2)) {
        let [row, next] = [pair[0] >> 16, pair[1] >> 16].map(|row| row as usize);
        if row != next {
            row_ends[row..next].fill(i);
            first = next;
        }
    }
    row_ends[first..].fill(pixels.len() as u32);
}
