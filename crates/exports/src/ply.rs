//! PLY: binary, little endian, with source coordinates as doubles.

use crate::chunks::write_chunks;
use crate::mesh::{Mesh, Output};
use crate::text::ascii_line;
use sys::Result;

/// Writes the mesh as PLY.
///
/// # Errors
/// Those of the source and of `out`, and [`sys::Error::Interrupted`].
pub fn write_ply(mesh: &Mesh, out: &mut Output) -> Result<()> {
    let axes = mesh.axes();
    out(head(mesh).as_bytes())?;
    let vertices = |range| {
        let places = mesh.source.vertices(range)?;
        let numbers = places.iter().flat_map(|place| [0, 1, 2].map(|axis| axes[axis].number(place[axis])));
        Ok(numbers.flat_map(f64::to_le_bytes).collect())
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

fn head(mesh: &Mesh) -> String {
    let comments: String = mesh.comments().iter().map(|comment| format!("comment {}\n", ascii_line(comment))).collect();
    format!(
        "ply\nformat binary_little_endian 1.0\n{comments}comment x is east, y is north, z is up\n\
         element vertex {}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.summary.vertices, mesh.summary.triangles
    )
}
