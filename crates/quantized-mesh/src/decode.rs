//! Reading a tile.

use crate::encode::{NORMALS, WATER_MASK};
use crate::mesh::LAST;
use crate::water::is_mask;

/// What a tile holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DecodedTile {
    /// The heights in metres that 0 and 32,767 stand for.
    pub heights: [f32; 2],
    /// Steps from the west, from the south, and of height.
    pub vertices: Vec<[u16; 3]>,
    /// The numbers of their vertices.
    pub triangles: Vec<[u32; 3]>,
    /// The vertices along the west, south, east and north side.
    pub sides: [Vec<u32>; 4],
    /// Normals as two bytes of an octahedron, if there are any.
    pub normals: Vec<[u8; 2]>,
    /// The water mask, if there is one: one number for all of the tile, or those of 256 x 256 cells, from the north-west on, row by row. 255 is water, and
    /// 0 is land.
    pub water: Option<Vec<u8>>,
}

impl DecodedTile {
    /// Returns the height of a vertex in metres.
    pub fn height(&self, vertex: usize) -> f64 {
        let [low, high] = self.heights.map(f64::from);
        let share = f64::from(self.vertices[vertex][2]) / f64::from(LAST);
        low + (high - low) * share
    }

    /// Returns the vertices of the west, south, east or north side: where along it, and at which height in metres.
    pub fn side(&self, side: usize) -> impl Iterator<Item = (u16, f64)> {
        let along = if side.is_multiple_of(2) { 1 } else { 0 };
        self.sides[side].iter().map(move |&v| (self.vertices[v as usize][along], self.height(v as usize)))
    }

    /// Returns what is wrong with the tile, if its mesh does not cover it or does not name the vertices of its sides, or its water mask is none.
    pub fn fault(&self) -> Option<&'static str> {
        let place = |v: u32| {
            let [u, v, _] = self.vertices[v as usize];
            [u, v].map(i64::from)
        };
        let double_area = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(place);
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let (mut sum, mut is_upright) = (0, true);
        for area in self.triangles.iter().map(double_area) {
            sum += area;
            is_upright &= area > 0;
        }
        if !is_upright {
            return Some("a triangle is turned over or flat");
        }
        if sum != 2 * i64::from(LAST) * i64::from(LAST) {
            return Some("its triangles do not cover it");
        }
        if self.water.as_ref().is_some_and(|mask| !is_mask(mask)) {
            return Some("its water mask is none");
        }
        (0..4).find_map(|side| self.fault_of_side(side))
    }

    fn fault_of_side(&self, side: usize) -> Option<&'static str> {
        let (across, end) = (side % 2, if side < 2 { 0 } else { LAST });
        let is_there = |v: &u32| self.vertices[*v as usize][across] == end;
        let along: Vec<u16> = self.side(side).map(|(along, _)| along).collect();
        let count = self.vertices.iter().filter(|vertex| vertex[across] == end).count();
        let is_whole =
            self.sides[side].iter().all(is_there) && along.is_sorted_by(|a, b| a < b) && along.len() == count;
        (!is_whole).then_some("the list of the vertices of a side is wrong")
    }
}

/// Why bytes are no tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotATile {
    /// They end too early.
    #[error("the file ends too early")]
    Short,
    /// A number stands for no vertex, or for none yet.
    #[error("a triangle or a side names a vertex that does not exist")]
    Vertex,
    /// A coordinate is beyond the tile.
    #[error("a vertex lies outside the tile")]
    Outside,
}

/// Returns what a tile holds. Its bytes are no longer packed.
///
/// # Errors
/// [`NotATile`].
pub fn decode(bytes: &[u8]) -> Result<DecodedTile, NotATile> {
    let mut reader = Reader { bytes, at: 24 };
    let heights = [reader.number()?, reader.number()?].map(f32::from_bits);
    reader.at += 56;
    let count = reader.count(6)?;
    let [u, v, h] = [reader.differences(count)?, reader.differences(count)?, reader.differences(count)?];
    let vertices: Vec<[u16; 3]> = (0..count).map(|i| [u[i], v[i], h[i]]).collect();
    let is_long = count > 1 << 16;
    if is_long {
        reader.at = reader.at.next_multiple_of(4);
    }
    let triangles = reader.triangles(count, is_long)?;
    let mut sides: [Vec<u32>; 4] = Default::default();
    for side in &mut sides {
        let along = reader.count(if is_long { 4 } else { 2 })?;
        *side = (0..along).map(|_| reader.index(is_long)).collect::<Result<_, _>>()?;
        if side.iter().any(|&v| v as usize >= count) {
            return Err(NotATile::Vertex);
        }
    }
    let (mut normals, mut water) = (Vec::new(), None);
    while reader.at < bytes.len() {
        let kind = reader.take::<1>()?[0];
        let length = reader.count(1)?;
        let content = bytes.get(reader.at..reader.at + length).ok_or(NotATile::Short)?;
        reader.at += length;
        match kind {
            NORMALS => normals = content.as_chunks::<2>().0.to_vec(),
            WATER_MASK => water = Some(content.to_vec()),
            _ => {}
        }
    }
    Ok(DecodedTile { heights, vertices, triangles, sides, normals, water })
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], NotATile> {
        let taken = self.bytes.get(self.at..).and_then(|left| left.first_chunk::<N>()).ok_or(NotATile::Short)?;
        self.at += N;
        Ok(*taken)
    }

    fn number(&mut self) -> Result<u32, NotATile> {
        self.take().map(u32::from_le_bytes)
    }

    /// Reads a count of things of so many bytes at least, which must follow.
    fn count(&mut self, bytes: usize) -> Result<usize, NotATile> {
        let count = self.number()? as usize;
        let left = self.bytes.len() - self.at;
        if count.checked_mul(bytes).is_none_or(|needed| needed > left) { Err(NotATile::Short) } else { Ok(count) }
    }

    fn index(&mut self, is_long: bool) -> Result<u32, NotATile> {
        if is_long { self.number() } else { self.take().map(|bytes| u16::from_le_bytes(bytes).into()) }
    }

    fn differences(&mut self, count: usize) -> Result<Vec<u16>, NotATile> {
        let mut last = 0i32;
        let numbers = (0..count).map(|_| {
            let bits = i32::from(u16::from_le_bytes(self.take()?));
            last = last.wrapping_add((bits >> 1) ^ -(bits & 1));
            u16::try_from(last).ok().filter(|number| *number <= LAST).ok_or(NotATile::Outside)
        });
        numbers.collect()
    }

    fn triangles(&mut self, vertices: usize, is_long: bool) -> Result<Vec<[u32; 3]>, NotATile> {
        let count = self.count(if is_long { 12 } else { 6 })?;
        let mut highest = 0u32;
        let mut vertex = || {
            let back = self.index(is_long)?;
            let number = highest.checked_sub(back).filter(|number| (*number as usize) < vertices);
            highest += u32::from(back == 0);
            number.ok_or(NotATile::Vertex)
        };
        (0..count).map(|_| Ok([vertex()?, vertex()?, vertex()?])).collect()
    }
}
