//! The working meshes of coarser tiles: what the tile above is made from. They have all vertices on the outline, and viewers do not get them.

use crate::durable::columns::{ColumnReader, ColumnWriter};
use crate::durable::packing::{pack, unpack};
use crate::index::NodeIndex;
use crate::records::{StepRecord, Store};
use sys::{Error, Result};
use tiles::Tile;
use tiles::attributes::PointAttributes;

/// One in the numbers that normals are stored in.
const ONE: f32 = i16::MAX as f32;

/// The number of values in each column of a record: vertices, triangles, normals, colours, classes, intensities.
type Counts = [u64; 6];

/// Writes the record of the coarser tile at `node`.
///
/// # Errors
/// [`Error::Io`].
pub(crate) fn save_mesh(store: &Store, node: NodeIndex, tile: &Tile) -> Result<()> {
    let (normals, colors) = (tile.normals.as_deref().unwrap_or_default(), tile.colors.as_deref().unwrap_or_default());
    let PointAttributes { classification, intensity } = &tile.attributes;
    let (classes, intensities) =
        (classification.as_deref().unwrap_or_default(), intensity.as_deref().unwrap_or_default());
    let counts: Counts =
        [tile.positions.len(), tile.triangles.len(), normals.len(), colors.len(), classes.len(), intensities.len()]
            .map(|count| count as u64);
    let mut bytes = Vec::new();
    pack(&tile.positions, |position| position.map(|value| value as u32), &mut bytes);
    pack(&tile.triangles, |&[a, b, c]| [a, b.wrapping_sub(a), c.wrapping_sub(a)], &mut bytes);
    pack(normals, |normal| normal.map(|value| (value * ONE).round() as i32 as u32), &mut bytes);
    pack(colors, |color| color.map(u32::from), &mut bytes);
    pack(classes, |&class| [u32::from(class)], &mut bytes);
    pack(intensities, |&intensity| [u32::from(intensity)], &mut bytes);
    ColumnWriter::default().push(&counts).push(&bytes).write(store, StepRecord::LevelMesh(node))
}

/// Reads the record of the coarser tile at `node`.
///
/// # Errors
/// [`Error::Io`], or [`Error::Broken`] if it is missing or damaged.
pub(crate) fn load_mesh(store: &Store, node: NodeIndex) -> Result<Tile> {
    let mut columns = ColumnReader::open(store, StepRecord::LevelMesh(node))?;
    let (counts, bytes) = (columns.column::<u64>()?, columns.column::<u8>()?);
    let counts = Counts::try_from(&counts[..]).ok();
    let tile = counts.and_then(|counts| unpacked(counts, &bytes));
    tile.ok_or_else(|| Error::Broken(format!("the mesh of the coarser tile at node {node} in the store is damaged")))
}

fn unpacked(counts: Counts, bytes: &[u8]) -> Option<Tile> {
    let counts = counts.map(|count| count as usize);
    let mut tile = Tile::default();
    let (mut normals, mut colors, mut classes, mut intensities) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let rest = unpack(bytes, counts[0], |position| position.map(|value| value as i32), &mut tile.positions)?;
    let triangle = |[a, b, c]: [u32; 3]| [a, a.wrapping_add(b), a.wrapping_add(c)];
    let rest = unpack(rest, counts[1], triangle, &mut tile.triangles)?;
    let rest = unpack(rest, counts[2], |normal| normal.map(|value| value as i32 as f32 / ONE), &mut normals)?;
    let rest = unpack(rest, counts[3], |color| color.map(|value| value as u16), &mut colors)?;
    let rest = unpack(rest, counts[4], |[class]| class as u8, &mut classes)?;
    let rest = unpack(rest, counts[5], |[intensity]| intensity as u16, &mut intensities)?;
    let is_whole = rest.is_empty() && tile.triangles.as_flattened().iter().all(|&v| (v as usize) < counts[0]);
    tile.normals = (counts[2] > 0).then_some(normals);
    tile.colors = (counts[3] > 0).then_some(colors);
    tile.attributes = PointAttributes {
        classification: (counts[4] > 0).then_some(classes),
        intensity: (counts[5] > 0).then_some(intensities),
    };
    is_whole.then_some(tile)
}
