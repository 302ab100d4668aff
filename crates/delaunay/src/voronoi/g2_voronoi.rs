//! Step G2: the exact discrete Voronoi diagram. The label of a pixel is the vertex of its nearest site: the site whose pixel has
//! the least (d^2, x, y). This rule for ties keeps the mesh clean.
//!
//! Columns come first: for the whole texture, the distance of every pixel to the nearest site north of it in its column. Then come
//! rows, from the south: the distance to the nearest site south in the column, the nearer of both as one 16-bit key per column, and
//! for every pixel the least key over the columns around it. The key is `d^2 << 8 | (dx + 8) << 4 | (dy + 8)`, so that one `min`
//! decides distance, tie rule and label. Keys reach seven pixels far. Pixels without a site that near use the lower envelope of the
//! columns' parabolas (Felzenszwalb and Huttenlocher 2012), which is exact at any distance.

use crate::voronoi::g1_write_sites::SiteTexture;
use crate::voronoi::index::VertexIndex;

/// The least key that means "no site within seven pixels".
const FAR: i16 = 64 << 8;
/// How many pixels far keys reach.
const REACH: usize = 7;
/// Keys are computed for this many pixels at a time.
const BLOCK: usize = 32;
/// The distance in a column that stands for itself and for all larger ones.
const LONG: u8 = u8::MAX;

/// Computes the rows of labels, from the south.
#[derive(Default)]
pub(super) struct LabelRows {
    stride: usize,
    /// The distance of every pixel to the nearest site at or north of it.
    north: Vec<u8>,
    /// For the row at hand, the distance to the nearest site at or south of it.
    south: Vec<u8>,
    /// For the row at hand, the row of that site + 1, or 0.
    south_row: Vec<u32>,
    /// One key per column, with `REACH` + 1 more on either side.
    columns: Vec<i16>,
    keys: Vec<i16>,
    /// For every pixel of the row at hand, the pixel of its nearest site, as the number `stride * y + x`.
    nearest: Vec<u32>,
    envelope: Vec<Parabola>,
}

/// A site seen from a row. It is the nearest from pixel `from` on, until the next parabola starts.
#[derive(Clone, Copy)]
struct Parabola {
    from: i64,
    column: i64,
    height: i64,
    pixel: u32,
}

impl LabelRows {
    /// Prepares for the rows of `texture`.
    pub(super) fn start(&mut self, texture: &SiteTexture) {
        self.stride = texture.words * 64;
        self.south.clear();
        self.south.resize(self.stride, LONG);
        self.south_row.clear();
        self.south_row.resize(self.stride, 0);
        self.columns.clear();
        self.columns.resize(self.stride + 2 * (REACH + 1), FAR);
        self.keys.resize(self.stride, FAR);
        self.nearest.resize(texture.width, 0);
        self.measure_north(texture);
    }

    fn measure_north(&mut self, texture: &SiteTexture) {
        self.north.resize(self.stride * texture.height, LONG);
        let mut running = vec![LONG; self.stride];
        for y in (0..texture.height).rev() {
            grow(&mut running, &texture.occupied[y * texture.words..][..texture.words]);
            self.north[y * self.stride..][..self.stride].copy_from_slice(&running);
        }
    }

    /// Writes the labels of row `y` to `labels[1..=width]`. Callers must ask for the rows in order.
    #[inline(always)]
    pub(super) fn row(&mut self, texture: &SiteTexture, y: usize, labels: &mut [VertexIndex]) {
        let occupied = &texture.occupied[y * texture.words..][..texture.words];
        grow(&mut self.south, occupied);
        note_row(&mut self.south_row, occupied, y as u32 + 1);
        let north = &self.north[y * self.stride..][..self.stride];
        column_keys(&self.south, north, &mut self.columns[REACH + 1..][..self.stride]);
        bring_near(texture, y + REACH);
        let far = nearest_keys(&self.columns, &mut self.keys, texture.width);
        nearest_pixels(&self.keys, texture.words, y, &mut self.nearest);
        if far {
            self.far_runs(texture, y);
        }
        for (label, &pixel) in labels[1..=texture.width].iter_mut().zip(&self.nearest) {
            *label = texture.vertices[pixel as usize];
        }
    }

    /// Finds the nearest sites of the runs of pixels whose nearest site is more than seven pixels away.
    #[cold]
    fn far_runs(&mut self, texture: &SiteTexture, y: usize) {
        let (width, mut x) = (texture.width, 0);
        while x < width {
            if self.keys[x] < FAR {
                x += 1;
                continue;
            }
            let end = (x..width).find(|&i| self.keys[i] < FAR).unwrap_or(width);
            // Along a row, the columns of the nearest sites never decrease: those of the run lie between those of its neighbours.
            let column = |i: usize| self.nearest[i] as usize % self.stride;
            let (first, last) =
                (x.checked_sub(1).map_or(0, column), if end == width { width - 1 } else { column(end) });
            self.build_envelope(texture, y, first..last + 1, x as i64);
            let mut at = 0;
            for (i, pixel) in self.nearest[x..end].iter_mut().enumerate() {
                while at + 1 < self.envelope.len() && self.envelope[at + 1].from <= (x + i) as i64 {
                    at += 1;
                }
                *pixel = self.envelope[at].pixel;
            }
            x = end;
        }
    }

    /// Builds the lower envelope, from pixel `start` on, of the sites nearest to row `y` in `columns`.
    fn build_envelope(&mut self, texture: &SiteTexture, y: usize, columns: std::ops::Range<usize>, start: i64) {
        self.envelope.clear();
        for x in columns {
            let Some(row) = self.nearest_in_column(texture.height, x, y) else { continue };
            let height = (row as i64 - y as i64).pow(2);
            let pixel = (self.stride * row + x) as u32;
            let mut new = Parabola { from: start, column: x as i64, height, pixel };
            while let Some(top) = self.envelope.last() {
                new.from = new.overtakes(top).max(start);
                if new.from > top.from {
                    break;
                }
                self.envelope.pop();
                new.from = start;
            }
            self.envelope.push(new);
        }
    }

    /// Returns the row of the site in column `x` that is nearest to row `y`. Of two at the same distance, the southern one wins.
    fn nearest_in_column(&self, height: usize, x: usize, y: usize) -> Option<usize> {
        let south = (self.south_row[x] as usize).checked_sub(1);
        let mut north = y;
        while north < height && self.north[north * self.stride + x] == LONG {
            north += LONG as usize;
        }
        let north = (north < height).then(|| north + self.north[north * self.stride + x] as usize);
        match (south, north) {
            (Some(s), Some(n)) => Some(if y - s <= n - y { s } else { n }),
            (s, n) => s.or(n),
        }
    }
}

impl Parabola {
    /// Returns the first pixel at which `self`, whose column is further east, is strictly nearer than `other`.
    fn overtakes(&self, other: &Parabola) -> i64 {
        let squares = self.column.pow(2) - other.column.pow(2) + self.height - other.height;
        squares.div_euclid(2 * (self.column - other.column)) + 1
    }
}

/// Reads row `y` of the vertices, so that it is in the cache when labels come from there in any order. In a row that takes next to no time.
#[inline(always)]
fn bring_near(texture: &SiteTexture, y: usize) {
    const LINE: usize = 16;
    let row = texture.vertices.get(64 * texture.words * y..).unwrap_or_default();
    let lines = row.iter().take(64 * texture.words).step_by(LINE);
    std::hint::black_box(lines.fold(0, |all, vertex| all ^ vertex.0));
}

/// Moves distances to the nearest occupied pixel on one side by one row.
#[inline(always)]
fn grow(distances: &mut [u8], occupied: &[u64]) {
    for (distances, &word) in distances.as_chunks_mut::<64>().0.iter_mut().zip(occupied) {
        for (distance, is_free) in distances.iter_mut().zip(free_bytes(word)) {
            *distance = distance.saturating_add(1) & is_free;
        }
    }
}

/// Notes `row` in the columns of occupied pixels.
#[inline(always)]
fn note_row(rows: &mut [u32], occupied: &[u64], row: u32) {
    for (rows, &word) in rows.as_chunks_mut::<64>().0.iter_mut().zip(occupied) {
        for (noted, is_free) in rows.iter_mut().zip(free_bytes(word)) {
            *noted = if is_free == 0 { row } else { *noted };
        }
    }
}

/// Returns a byte for each bit of a word: 0 if it is set, else 255.
#[inline(always)]
fn free_bytes(word: u64) -> [u8; 64] {
    let mut free = [0; 64];
    for (eight, byte) in free.as_chunks_mut::<8>().0.iter_mut().zip(word.to_le_bytes()) {
        for (free, bit) in eight.iter_mut().zip([1, 2, 4, 8, 16, 32, 64, 128]) {
            *free = if byte & bit == 0 { u8::MAX } else { 0 };
        }
    }
    free
}

/// Computes the key of the nearer of the two sites of each column. At the same distance, the southern one wins.
#[inline(always)]
fn column_keys(south: &[u8], north: &[u8], keys: &mut [i16]) {
    for ((key, &south), &north) in keys.iter_mut().zip(south).zip(north) {
        let distance = south.min(north).min(8) as i16;
        let dy = if south <= north { -distance } else { distance };
        *key = ((distance * distance) << 8) + dy + 8;
    }
}

/// Finds the pixels of the sites that the keys of row `y` tell, in a texture whose rows have `words` words. Where a key is far, the result
/// is arbitrary.
#[inline(always)]
fn nearest_pixels(keys: &[i16], words: usize, y: usize, nearest: &mut [u32]) {
    let first = (64 * words * y) as u32;
    let origin = first.wrapping_sub((8 * 64 * words + 8) as u32);
    for (x, (pixel, &key)) in nearest.iter_mut().zip(keys).enumerate() {
        // Words fit 16 bits, in which a processor multiplies faster.
        let words_north = (key as u16 & 15).wrapping_mul(words as u16);
        *pixel =
            origin.wrapping_add(x as u32).wrapping_add(u32::from(words_north) << 6).wrapping_add(key as u32 >> 4 & 15);
    }
}

/// Computes the least key of every pixel over the columns within reach; returns whether any of the first `width` pixels has none.
#[inline(always)]
fn nearest_keys(columns: &[i16], keys: &mut [i16], width: usize) -> bool {
    let (whole, rest) = (width / BLOCK, width % BLOCK);
    let mut far = false;
    for (i, keys) in keys.chunks_exact_mut(BLOCK).take(whole).enumerate() {
        far |= nearest_keys_of_block(&columns[i * BLOCK..], keys, BLOCK);
    }
    if rest > 0 {
        far |= nearest_keys_of_block(&columns[whole * BLOCK..], &mut keys[whole * BLOCK..], rest);
    }
    far
}

#[inline(always)]
fn nearest_keys_of_block(columns: &[i16], keys: &mut [i16], width: usize) -> bool {
    let columns = &columns[..BLOCK + 2 * (REACH + 1)];
    let mut best = [0i16; BLOCK];
    for (best, &column) in best.iter_mut().zip(&columns[REACH + 1..]) {
        *best = column + (8 << 4);
    }
    let mut worst = i16::MAX;
    for r in 1..=REACH {
        let square = ((r * r) << 8) as i16;
        let (west, east) = (square + ((8 - r as i16) << 4), square + ((8 + r as i16) << 4));
        let (from_west, from_east) = (&columns[REACH + 1 - r..][..BLOCK], &columns[REACH + 1 + r..][..BLOCK]);
        for ((best, &w), &e) in best.iter_mut().zip(from_west).zip(from_east) {
            *best = (*best).min(w + west).min(e + east);
        }
        worst = best[..width].iter().fold(0, |worst, &key| key.max(worst));
        // No site further away can be as near.
        if worst < (((r + 1) * (r + 1)) << 8) as i16 {
            break;
        }
    }
    keys[..BLOCK].copy_from_slice(&best);
    worst >= FAR
}
