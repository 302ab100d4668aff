//! PLY: binary, little endian, with source coordinates as doubles, and with the colours of vertices if there are any.

use crate::chunks::write_chunks;
use crate::mesh::{Mesh, Output};
use crate::text::ascii_line;
use std::ops::Range;
use sys::Result;

/// Writes the mesh as PLY.
///
/// # Errors
/// Those of the source and of `out`, and [`sys::Error::Interrupted`].
pub fn write_ply(mesh: &Mesh, out: &mut Output) -> Result<()> {
    let axes = mesh.axes();
    out(head(mesh)?.as_bytes())?;
    let vertices = |range: Range<u64>| {
        let places = mesh.source.vertices(range.clone())?;
        let colors = mesh.source.colors(range)?.unwrap_or_default();
        let mut bytes = Vec::with_capacity(places.len() * 27);
        for (number, place) in places.iter().enumerate() {
            bytes.extend([0, 1, 2].map(|axis| axes[axis].number(place[axis]).to_le_bytes()).as_flattened());
            bytes.extend(colors.get(number).into_iter().flatten());
        }
        Ok(bytes)
    };
    write_chunks(mesh.summary.vertices.into(), &vertices, out)?;
    let faces = |range| {
        let triangles = mesh.source.triangles(range)?;
        let mut bytes = Vec::with_capacity(triangles.len() * 13);
        for triangle in triangles {
            bytes.push(3);
            triangle.iter().for_each(|corner| bytes.extend(corner.to_le_bytes()));
        }
        Ok(bytes)
    };
    write_chunks(mesh.summary.triangles, &faces, out)
}

fn head(mesh: &Mesh) -> Result<String> {
    let colors = match mesh.source.colors(0..0)? {
        Some(_) => "property uchar red\nproperty uchar green\nproperty uchar blue\n",
        None => "",
    };
    let comments: String = mesh.comments().iter().map(|comment| format!("comment {}\n", ascii_line(comment))).collect();
    Ok(format!(
        "ply\nformat binary_little_endian 1.0\n{comments}comment x is east, y is north, z is up\n\
         element vertex {}\nproperty double x\nproperty double y\nproperty double z\n{colors}\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.summary.vertices, mesh.summary.triangles
    ))
}
