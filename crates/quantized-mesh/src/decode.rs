//! Reading a tile.

use crate::encode::NORMALS;
use crate::mesh::LAST;

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
}

impl DecodedTile {
    /// Returns the height of a vertex in metres.
    pub fn height(&self, vertex: usize) -> f64 {
        let [low, high] = self.heights.map(f64::from);
        let share = f64::from(self.vertices[vertex][2]) / f64::from(LAST);
        low + (high - low) * share
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
    let mut normals = Vec::new();
    while reader.at < bytes.len() {
        let kind = reader.take::<1>()?[0];
        let length = reader.count(1)?;
        let content = bytes.get(reader.at..reader.at + length).ok_or(NotATile::Short)?;
        reader.at += length;
        if kind == NORMALS {
            normals = content.as_chunks::<2>().0.to_vec();
        }
    }
    Ok(DecodedTile { heights, vertices, triangles, sides, normals })
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
