//! Which pixel a site belongs to. Where sites lie evenly, pixels are squares. Where they crowd, as in clusters, columns are narrower there,
//! and so are rows: fewer sites then share a pixel. The mesh is the same with any pixels, because later steps move all sites to their true
//! places and repair what that breaks.
//!
//! Width and height of the pixels follow the sites along each axis alone, so that their order stays along both. They follow the root of
//! the density: where pixels are far from square, the diagram is less like that of the sites, and more edges must be flipped.

use crate::geometry::Site;
use crate::voronoi::texture_request::pixels_along;

/// The parts of each axis that have pixels of one size.
const BINS: usize = 256;
/// About so many sites are looked at to find out how the sites are spread.
const SAMPLE: usize = 1 << 12;
/// The texture has up to so many blocks along each axis, in which the sites of the sample are counted.
const BLOCKS: usize = 32;
/// If a site shares its part of both axes with more others than this, relative to evenly spread sites, the pixels are adapted.
const MAX_CROWDING: f64 = 3.0;
/// The part of an axis that has no sites gets so much of the pixels, relative to a part with the mean number.
const LEAST: f64 = 0.03;

/// So much smaller each side of the texture is where pixels are adapted. Sites crowd within columns and rows too, so a good part of them
/// misses a pixel anyway, while empty pixels cost as much as others.
const CROWDED_SIDE: f64 = 0.84;

/// The unit of `PixelMap::scale`. A pixel is at least a lattice step, and there are at most 2^30 steps, so products fit.
const ONE: u64 = 1 << 31;

/// The map from lattice points to pixels. Pixel (x, y) is column x from the west, row y from the south.
pub(super) struct PixelMap {
    /// The number of columns and rows.
    pub(super) size: [usize; 2],
    low: Site,
    /// Pixels per lattice step, if they are squares, in units of 1 / [`ONE`].
    scale: u64,
    /// Otherwise the columns and the rows.
    adapted: Option<[AxisMap; 2]>,
}

/// The columns or rows of a texture.
struct AxisMap {
    bins_per_step: f64,
    /// The first pixel of every part of the axis, and its number of pixels.
    parts: Vec<[f64; 2]>,
    last: u32,
}

impl PixelMap {
    /// Returns the pixels for `sites`, whose box is `extent` steps wide and high and begins at `low`.
    /// Where they crowd, the texture `may_shrink`.
    pub(super) fn new(sites: &[Site], low: Site, extent: [f64; 2], scale: f64, may_shrink: bool) -> PixelMap {
        let histograms = histograms(sites, low, extent);
        let crowding = histograms.iter().map(|histogram| crowding(histogram, sites.len())).product::<f64>();
        let is_crowded = crowding > MAX_CROWDING;
        let scale = if is_crowded && may_shrink { CROWDED_SIDE * scale } else { scale };
        let size = extent.map(|side| pixels_along(side, scale));
        let axis = |axis: usize| AxisMap::new(&histograms[axis], extent[axis], size[axis]);
        // Rounded down, so that no site is beyond the last pixel.
        let scale = (scale * ONE as f64) as u64;
        PixelMap { size, low, scale, adapted: is_crowded.then(|| [0, 1].map(axis)) }
    }

    /// Appends the pixel (y << 16 | x) of each site to `pixels`.
    pub(super) fn append_to<'a>(&self, pixels: &mut Vec<u32>, sites: impl ExactSizeIterator<Item = &'a Site>) {
        let join = |[x, y]: [u32; 2]| y << 16 | x;
        let pixel = |site: &Site, axis: usize| ((u64::from(self.steps(site, axis)) * self.scale) / ONE) as u32;
        match &self.adapted {
            None => pixels.extend(sites.map(|site| join([0, 1].map(|axis| pixel(site, axis))))),
            Some(axes) => pixels
                .extend(sites.map(|site| join([0, 1].map(|axis| axes[axis].pixel(f64::from(self.steps(site, axis))))))),
        }
    }

    /// Returns about which part of `sites` has no pixel of its own, or less: how the sites are spread within blocks of the texture is left
    /// out. This takes a small part of the time of writing them. Of few sites it says nothing.
    pub(super) fn missing(&self, sites: &[Site]) -> f64 {
        if sites.len() < SAMPLE {
            return 0.0;
        }
        let mut counts = [[0u32; BLOCKS]; BLOCKS];
        let mut pixels = Vec::with_capacity(SAMPLE);
        self.append_to(&mut pixels, sample(sites));
        let shifts = self.size.map(|side| (side.div_ceil(BLOCKS)).next_power_of_two().ilog2());
        for pixel in &pixels {
            counts[(pixel >> 16 >> shifts[1]) as usize][((pixel & 0xffff) >> shifts[0]) as usize] += 1;
        }
        // Sites that lose their pixels may move out of the block, one pixel to the west or east.
        let pixels_per_block = f64::from(((1u32 << shifts[0]) + 2) << shifts[1]);
        let room = pixels_per_block * pixels.len() as f64 / sites.len() as f64;
        let missing = counts.as_flattened().iter().map(|&count| (f64::from(count) - room).max(0.0)).sum::<f64>();
        missing / pixels.len() as f64
    }

    #[inline(always)]
    fn steps(&self, site: &Site, axis: usize) -> u32 {
        (site[axis] - self.low[axis]) as u32
    }
}

impl AxisMap {
    fn new(histogram: &[u32; BINS], extent: f64, pixels: usize) -> AxisMap {
        let mean = f64::from(histogram.iter().sum::<u32>()) / BINS as f64;
        let weight = |bin: usize| {
            // Pixels whose size changes by degrees keep more of the diagram.
            let around = [bin.saturating_sub(1), bin, bin, (bin + 1).min(BINS - 1)];
            let density = around.map(|i| f64::from(histogram[i])).iter().sum::<f64>() / (4.0 * mean);
            density.sqrt() + LEAST
        };
        let weights: Vec<f64> = (0..BINS).map(weight).collect();
        let pixels_per_weight = pixels as f64 / weights.iter().sum::<f64>();
        let mut first = 0.0;
        let part = |weight: &f64| {
            let part = [first, weight * pixels_per_weight];
            first += part[1];
            part
        };
        let parts = weights.iter().map(part).collect();
        AxisMap { bins_per_step: BINS as f64 / extent, parts, last: pixels as u32 - 1 }
    }

    /// Returns the pixel at `steps` lattice steps from the first one.
    #[inline(always)]
    fn pixel(&self, steps: f64) -> u32 {
        let bins = steps * self.bins_per_step;
        let bin = (bins as usize).min(BINS - 1);
        let [first, pixels] = self.parts[bin];
        ((first + (bins - bin as f64) * pixels) as u32).min(self.last)
    }
}

/// Returns every site of a few, a sample of many: one of each run of sites, at a place in the run that follows no rule. Sites of a raster
/// come row by row, and one of every so many would see only some of the columns.
fn sample(sites: &[Site]) -> impl ExactSizeIterator<Item = &Site> {
    let run = sites.len().div_ceil(SAMPLE).max(1);
    let place = move |number: usize| {
        let mixed = (number as u32).wrapping_mul(0x9e37_79b9);
        (number * run + ((u64::from(mixed) * run as u64) >> 32) as usize).min(sites.len() - 1)
    };
    (0..sites.len().div_ceil(run)).map(move |number| &sites[place(number)])
}

/// Counts the sites of a sample along both axes.
fn histograms(sites: &[Site], low: Site, extent: [f64; 2]) -> [[u32; BINS]; 2] {
    let bins_per_step = extent.map(|extent| BINS as f64 / extent);
    let mut histograms = [[0; BINS]; 2];
    for site in sample(sites) {
        for axis in 0..2 {
            let bin = (f64::from(site[axis] - low[axis]) * bins_per_step[axis]) as usize;
            histograms[axis][bin.min(BINS - 1)] += 1;
        }
    }
    histograms
}

/// Returns with how many of `sites` a site shares its part of the axis, relative to evenly spread sites.
fn crowding(histogram: &[u32; BINS], sites: usize) -> f64 {
    // The columns of a raster are no crowds, so parts are not narrower than those of a square one.
    let together = (BINS as f64 / (sites as f64).sqrt()).ceil().clamp(1.0, BINS as f64) as usize;
    let counts = || histogram.chunks(together).map(|counts| f64::from(counts.iter().sum::<u32>()));
    let (sum, squares) = (counts().sum::<f64>(), counts().map(|count| count * count).sum::<f64>());
    // Where there are few sites, chance alone puts some together.
    counts().len() as f64 * (squares - sum) / (sum * sum)
}
