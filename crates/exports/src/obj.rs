//! Wavefront OBJ. Many programs read it with single precision, so coordinates count from a place near the centre of the terrain.

use crate::chunks::write_chunks;
use crate::exact_axis::ExactAxis;
use crate::mesh::{Mesh, Output};
use crate::text::push_padded;
use lattice::Lattice;
use rust_decimal::Decimal;
use rust_decimal::prelude::ToPrimitive;
use sys::{Error, Result};

/// What the coordinates of an OBJ file count from: whole numbers of source units for x, y and z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjOffset(pub [i64; 3]);

impl ObjOffset {
    /// Returns the whole numbers near the centre of a mesh; heights count from zero.
    ///
    /// # Errors
    /// [`Error::Broken`] if its coordinates are no numbers that programs count with.
    pub fn of(mesh: &Mesh) -> Result<ObjOffset> {
        let [low, high] = mesh.summary.bounds;
        let centre = |axis: usize| {
            let middle = i64::midpoint(low[axis].into(), high[axis].into());
            let steps = mesh.lattice.step(axis).checked_mul(Decimal::from(middle))?;
            steps.checked_add(mesh.lattice.offset[axis])?.round().to_i64()
        };
        let offset = centre(0).zip(centre(1)).map(|(x, y)| ObjOffset([x, y, 0]));
        offset.ok_or_else(|| Error::Broken("the coordinates of the terrain are too large for OBJ".into()))
    }

    /// Returns the axes that count from here.
    fn axes(self, lattice: &Lattice) -> Result<[ExactAxis; 3]> {
        let mut local = lattice.clone();
        for (own, offset) in local.offset.iter_mut().zip(self.0) {
            let shifted = own.checked_sub(Decimal::from(offset));
            *own = shifted.ok_or_else(|| Error::Broken(format!("{own} has too many digits for OBJ")))?;
        }
        Ok([0, 1, 2].map(|axis| ExactAxis::of(&local, axis)))
    }
}

/// Writes the mesh as OBJ.
///
/// # Errors
/// Those of the source and of `out`, and [`sys::Error::Interrupted`].
pub fn write_obj(mesh: &Mesh, offset: ObjOffset, out: &mut Output) -> Result<()> {
    let axes = offset.axes(mesh.lattice)?;
    out(head(mesh, offset).as_bytes())?;
    let vertices = |range| {
        let mut text = Vec::new();
        for place in mesh.source.vertices(range)? {
            text.push(b'v');
            for (axis, i) in axes.iter().zip(place) {
                text.push(b' ');
                axis.push(i, &mut text);
            }
            text.push(b'\n');
        }
        Ok(text)
    };
    write_chunks(mesh.summary.vertices.into(), &vertices, out)?;
    let faces = |range| {
        let mut text = Vec::new();
        for triangle in mesh.source.triangles(range)? {
            text.push(b'f');
            for corner in triangle {
                text.push(b' ');
                push_padded(u64::from(corner) + 1, 1, &mut text);
            }
            text.push(b'\n');
        }
        Ok(text)
    };
    write_chunks(mesh.summary.triangles, &faces, out)
}

fn head(mesh: &Mesh, ObjOffset([x, y, z]): ObjOffset) -> String {
    let own = [
        "x is east, y is north, z is up".to_owned(),
        format!("offset: add {x} {y} {z} to x y z for the coordinates of the source"),
        format!("{} vertices, {} triangles", mesh.summary.vertices, mesh.summary.triangles),
    ];
    let comments = mesh.comments().into_iter().chain(own);
    let line = |comment: String| format!("# {}\n", comment.replace(char::is_control, " "));
    let comments: String = comments.map(line).collect();
    format!("{comments}o terrain\n")
}
