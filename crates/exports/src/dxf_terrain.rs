//! The terrain as DXF: a 3DFACE for each triangle, and breaklines as polylines in space.

use crate::chunks::write_chunks;
use crate::corners::corners;
use crate::dxf::{DxfHead, DxfWriter, Layer, push_face, push_polyline_3d};
use crate::exact_axis::LatticePlace;
use crate::mesh::{Mesh, Output};
use sys::Result;

const TERRAIN: Layer = Layer { name: "TERRAIN", color: 8 };
const BREAKLINES: Layer = Layer { name: "BREAKLINES", color: 1 };

/// Writes the mesh as DXF.
///
/// # Errors
/// Those of the source and of `out`, and [`sys::Error::Interrupted`].
pub fn write_dxf(mesh: &Mesh, out: &mut Output) -> Result<()> {
    let axes = mesh.axes();
    let place = |at: [i32; 3]| LatticePlace { axes: &axes, at };
    let head = DxfHead {
        comments: &mesh.comments(),
        unit: mesh.units.plane,
        extents: mesh.summary.bounds.map(place),
        layers: if mesh.lines.is_empty() { &[TERRAIN] } else { &[TERRAIN, BREAKLINES] },
    };
    let mut drawing = DxfWriter::begin(&head, out)?;
    let faces = |range| {
        let mut text = Vec::new();
        for triangle in corners(mesh.source, &mesh.source.triangles(range)?)? {
            push_face(&TERRAIN, &triangle.map(place), &mut text);
        }
        Ok(text)
    };
    write_chunks(mesh.summary.triangles, &faces, &mut |bytes: &[u8]| drawing.entities(bytes))?;
    let lines = |range: std::ops::Range<u64>| {
        let mut text = Vec::new();
        for line in &mesh.lines[range.start as usize..range.end as usize] {
            let is_closed = line.len() > 3 && line.first() == line.last();
            let places = if is_closed { &line[1..] } else { &line[..] };
            let places: Vec<LatticePlace> = places.iter().copied().map(place).collect();
            push_polyline_3d(&BREAKLINES, &places, is_closed, &mut text);
        }
        Ok(text)
    };
    write_chunks(mesh.lines.len() as u64, &lines, &mut |bytes: &[u8]| drawing.entities(bytes))?;
    drawing.end()
}
