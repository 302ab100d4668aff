//! ASCII DXF of the version R12 (AC1009): the oldest one in use, which every program reads that reads DXF, and which needs the fewest bytes
//! for a face.
//!
//! [`DxfWriter`] writes what is around the entities. Entities are appended to buffers, by any thread, and handed over in the order wanted:
//! [`push_face`], [`push_polyline_3d`] and [`push_polyline_2d`], such as a contour line with its elevation.

use crate::mesh::{LengthUnit, Output};
use crate::place::Place;
use crate::text::ascii_line;
use sys::Result;

/// A layer of a drawing.
#[derive(Clone, Copy, Debug)]
pub struct Layer {
    /// Its name: capital letters, digits, `_` and `-`, up to 31 of them.
    pub name: &'static str,
    /// Its colour in AutoCAD's table of 255: 1 is red, 7 is black or white.
    pub color: u8,
}

/// What is said at the beginning of a drawing.
pub struct DxfHead<'a, P> {
    /// Lines of comments.
    pub comments: &'a [String],
    /// The unit of coordinates.
    pub unit: LengthUnit,
    /// The least and the greatest coordinates.
    pub extents: [P; 2],
    /// The layers, besides layer 0.
    pub layers: &'a [Layer],
}

/// Writes a drawing.
pub struct DxfWriter<'a, 'b> {
    out: &'a mut Output<'b>,
}

impl<'a, 'b> DxfWriter<'a, 'b> {
    /// Writes everything before the entities.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn begin<P: Place>(head: &DxfHead<P>, out: &'a mut Output<'b>) -> Result<DxfWriter<'a, 'b>> {
        let mut text = Vec::new();
        head.comments.iter().for_each(|comment| push(999, &ascii_line(comment), &mut text));
        push_header(head, &mut text);
        push_tables(head.layers, &mut text);
        push_all(&[(0, "SECTION"), (2, "ENTITIES")], &mut text);
        out(&text)?;
        Ok(DxfWriter { out })
    }

    /// Returns what goes on writing a drawing whose head is in `out` already.
    pub fn continued(out: &'a mut Output<'b>) -> DxfWriter<'a, 'b> {
        DxfWriter { out }
    }

    /// Writes whole entities.
    ///
    /// # Errors
    /// Those of the output.
    pub fn entities(&mut self, entities: &[u8]) -> Result<()> {
        (self.out)(entities)
    }

    /// Ends the drawing.
    ///
    /// # Errors
    /// Those of the output.
    pub fn end(self) -> Result<()> {
        let mut text = Vec::new();
        push_all(&[(0, "ENDSEC"), (0, "EOF")], &mut text);
        (self.out)(&text)
    }
}

fn push_header<P: Place>(head: &DxfHead<P>, text: &mut Vec<u8>) {
    push_all(&[(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009")], text);
    let unit = match head.unit {
        LengthUnit::Other => "0",
        LengthUnit::Foot => "2",
        LengthUnit::Metre => "6",
        LengthUnit::UsFoot => "21",
    };
    push_all(&[(9, "$INSUNITS"), (70, unit)], text);
    for (name, place) in ["$EXTMIN", "$EXTMAX"].iter().zip(&head.extents) {
        push(9, name, text);
        push_place(10, place, text);
    }
    push(0, "ENDSEC", text);
}

fn push_tables(layers: &[Layer], text: &mut Vec<u8>) {
    push_all(&[(0, "SECTION"), (2, "TABLES")], text);
    push_all(&[(0, "TABLE"), (2, "LTYPE"), (70, "1"), (0, "LTYPE"), (2, "CONTINUOUS"), (70, "0")], text);
    push_all(&[(3, "Solid line"), (72, "65"), (73, "0"), (40, "0.0"), (0, "ENDTAB")], text);
    push_all(&[(0, "TABLE"), (2, "LAYER"), (70, &(layers.len() + 1).to_string())], text);
    for Layer { name, color } in [Layer { name: "0", color: 7 }].iter().chain(layers) {
        push_all(&[(0, "LAYER"), (2, name), (70, "0"), (62, &color.to_string()), (6, "CONTINUOUS")], text);
    }
    push_all(&[(0, "ENDTAB"), (0, "ENDSEC")], text);
}

/// Appends a triangle.
pub fn push_face<P: Place>(layer: &Layer, corners: &[P; 3], out: &mut Vec<u8>) {
    push_all(&[(0, "3DFACE"), (8, layer.name)], out);
    let [a, b, c] = corners;
    // A triangle is a quadrangle whose last two corners are the same.
    for (code, corner) in (10..).zip([a, b, c, c]) {
        push_place(code, corner, out);
    }
}

/// The flags of R12 for polylines and their vertices.
const CLOSED: u8 = 1;
const IN_SPACE: u8 = 8;
const VERTEX_IN_SPACE: u8 = 32;

/// Appends a line in space.
pub fn push_polyline_3d<P: Place>(layer: &Layer, places: &[P], is_closed: bool, out: &mut Vec<u8>) {
    let flags = IN_SPACE | if is_closed { CLOSED } else { 0 };
    push_polyline(layer, flags, "0", out);
    for place in places {
        push_all(&[(0, "VERTEX"), (8, layer.name)], out);
        push_place(10, place, out);
        push(70, &VERTEX_IN_SPACE.to_string(), out);
    }
    push_all(&[(0, "SEQEND"), (8, layer.name)], out);
}

/// Appends a line at one elevation. The heights of the places are not looked at.
pub fn push_polyline_2d<P: Place>(layer: &Layer, elevation: &str, places: &[P], is_closed: bool, out: &mut Vec<u8>) {
    push_polyline(layer, if is_closed { CLOSED } else { 0 }, elevation, out);
    for place in places {
        push_all(&[(0, "VERTEX"), (8, layer.name)], out);
        push_coordinate(10, place, 0, out);
        push_coordinate(20, place, 1, out);
        push(30, elevation, out);
    }
    push_all(&[(0, "SEQEND"), (8, layer.name)], out);
}

fn push_polyline(layer: &Layer, flags: u8, elevation: &str, out: &mut Vec<u8>) {
    push_all(&[(0, "POLYLINE"), (8, layer.name), (66, "1"), (10, "0"), (20, "0"), (30, elevation)], out);
    push(70, &flags.to_string(), out);
}

fn push_all(groups: &[(u16, &str)], out: &mut Vec<u8>) {
    groups.iter().for_each(|(code, value)| push(*code, value, out));
}

/// Appends a group: its code, right-aligned to three characters, and its value, each on a line.
fn push(code: u16, value: &str, out: &mut Vec<u8>) {
    push_code(code, out);
    out.extend_from_slice(value.as_bytes());
    out.push(b'\n');
}

fn push_code(code: u16, out: &mut Vec<u8>) {
    let digit = |power: u16| b'0' + (code / power % 10) as u8;
    out.push(if code < 100 { b' ' } else { digit(100) });
    out.push(if code < 10 { b' ' } else { digit(10) });
    out.extend_from_slice(&[digit(1), b'\n']);
}

/// Appends x with `code`, and y and z with the codes that belong to it.
fn push_place(code: u16, place: &impl Place, out: &mut Vec<u8>) {
    (0..3).for_each(|axis| push_coordinate(code + 10 * axis as u16, place, axis, out));
}

fn push_coordinate(code: u16, place: &impl Place, axis: usize, out: &mut Vec<u8>) {
    push_code(code, out);
    place.push(axis, out);
    out.push(b'\n');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawing_is_a_list_of_groups() {
        let layer = Layer { name: "CONTOURS", color: 3 };
        let corner = |at| [["0", "5"][at], "1.5", "-2"];
        let head = DxfHead {
            comments: &["Größe\n0\nEOF".to_owned()],
            unit: LengthUnit::UsFoot,
            extents: [corner(0), corner(1)],
            layers: &[layer],
        };
        let mut bytes = Vec::new();
        let mut out = |more: &[u8]| {
            bytes.extend_from_slice(more);
            Ok(())
        };
        let mut writer = DxfWriter::begin(&head, &mut out).unwrap();
        let mut entities = Vec::new();
        push_polyline_2d(&layer, "12.5", &[corner(0), corner(1)], true, &mut entities);
        push_face(&layer, &[corner(0), corner(1), corner(0)], &mut entities);
        writer.entities(&entities).unwrap();
        writer.end().unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len() % 2, 0);
        let groups: Vec<(u16, &str)> = lines.chunks(2).map(|pair| (pair[0].trim().parse().unwrap(), pair[1])).collect();
        assert_eq!(groups[0], (999, "Gr??e 0 EOF"));
        assert_eq!(groups.iter().filter(|group| **group == (0, "EOF")).count(), 1);
        assert!(groups.windows(2).any(|pair| pair == [(9, "$INSUNITS"), (70, "21")]));
        let from = groups.iter().position(|group| *group == (0, "POLYLINE")).unwrap();
        let expected = [
            (0, "POLYLINE"),
            (8, "CONTOURS"),
            (66, "1"),
            (10, "0"),
            (20, "0"),
            (30, "12.5"),
            (70, "1"),
            (0, "VERTEX"),
            (8, "CONTOURS"),
            (10, "0"),
            (20, "1.5"),
            (30, "12.5"),
            (0, "VERTEX"),
            (8, "CONTOURS"),
            (10, "5"),
            (20, "1.5"),
            (30, "12.5"),
            (0, "SEQEND"),
            (8, "CONTOURS"),
            (0, "3DFACE"),
            (8, "CONTOURS"),
            (10, "0"),
            (20, "1.5"),
            (30, "-2"),
            (11, "5"),
            (21, "1.5"),
            (31, "-2"),
            (12, "0"),
            (22, "1.5"),
            (32, "-2"),
            (13, "0"),
            (23, "1.5"),
            (33, "-2"),
            (0, "ENDSEC"),
            (0, "EOF"),
        ];
        assert_eq!(groups[from..], expected);
    }
}
