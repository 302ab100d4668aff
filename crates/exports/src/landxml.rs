//! LandXML 1.2: a surface of the type TIN, with its breaklines as source data. Places are northing, easting and elevation, in this order.

use crate::chunks::write_chunks;
use crate::exact_axis::ExactAxis;
use crate::mesh::{LengthUnit, Mesh, Output, SystemNames};
use crate::text::{push_padded, xml_value};
use rust_decimal::Decimal;
use rust_decimal::prelude::FromPrimitive;
use sys::Result;

/// Writes the mesh as LandXML.
///
/// # Errors
/// Those of the source and of `out`, and [`sys::Error::Interrupted`].
pub fn write_landxml(mesh: &Mesh, out: &mut Output) -> Result<()> {
    let axes = mesh.axes();
    out(head(mesh).as_bytes())?;
    write_breaklines(mesh, &axes, out)?;
    out(definition(mesh, &axes).as_bytes())?;
    let points = |range: std::ops::Range<u64>| {
        let (mut text, first) = (Vec::new(), range.start);
        for (number, place) in (first + 1..).zip(mesh.source.vertices(range)?) {
            text.extend_from_slice(b"<P id=\"");
            push_padded(number, 1, &mut text);
            text.extend_from_slice(b"\">");
            push_place(&axes, place, &mut text);
            text.extend_from_slice(b"</P>\n");
        }
        Ok(text)
    };
    out(b"<Pnts>\n")?;
    write_chunks(mesh.summary.vertices.into(), &points, out)?;
    out(b"</Pnts>\n<Faces>\n")?;
    let faces = |range| {
        let mut text = Vec::new();
        for [a, b, c] in mesh.source.triangles(range)? {
            for (before, corner) in [("<F>", a), (" ", b), (" ", c)] {
                text.extend_from_slice(before.as_bytes());
                push_padded(u64::from(corner) + 1, 1, &mut text);
            }
            text.extend_from_slice(b"</F>\n");
        }
        Ok(text)
    };
    write_chunks(mesh.summary.triangles, &faces, out)?;
    out(b"</Faces>\n</Definition>\n</Surface>\n</Surfaces>\n</LandXML>\n")
}

/// Appends a place in the order of LandXML.
fn push_place(axes: &[ExactAxis; 3], [x, y, z]: [i32; 3], text: &mut Vec<u8>) {
    axes[1].push(y, text);
    text.push(b' ');
    axes[0].push(x, text);
    text.push(b' ');
    axes[2].push(z, text);
}

/// Returns everything before the breaklines. The schema wants a day and a time; the same terrain has the same bytes on any day, so they are
/// those that the time of computers counts from.
fn head(mesh: &Mesh) -> String {
    let copyright = mesh.copyright.map(|text| format!(" desc=\"{}\"", xml_value(text)));
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <LandXML xmlns=\"http://www.landxml.org/schema/LandXML-1.2\" \
         xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" \
         xsi:schemaLocation=\"http://www.landxml.org/schema/LandXML-1.2 \
         http://www.landxml.org/schema/LandXML-1.2/LandXML-1.2.xsd\" \
         version=\"1.2\" date=\"1970-01-01\" time=\"00:00:00\" language=\"English\" readOnly=\"false\">\n\
         {}{}<Project name=\"terrain\"{}/>\n<Application name=\"gdt-batch\"/>\n\
         <Surfaces>\n<Surface name=\"terrain\" desc=\"{}\">\n",
        units(mesh.units.plane),
        coordinate_system(&mesh.system),
        copyright.unwrap_or_default(),
        xml_value(&mesh.units.text()),
    )
}

/// Returns the element of the units; nothing for a unit that LandXML has no word for.
fn units(unit: LengthUnit) -> String {
    let angles = "angularUnit=\"decimal degrees\" directionUnit=\"decimal degrees\"";
    let imperial = |name: &str| {
        format!(
            "<Units>\n<Imperial areaUnit=\"squareFoot\" linearUnit=\"{name}\" volumeUnit=\"cubicYard\" \
             temperatureUnit=\"fahrenheit\" pressureUnit=\"inchHG\" {angles}/>\n</Units>\n"
        )
    };
    match unit {
        LengthUnit::Metre => format!(
            "<Units>\n<Metric areaUnit=\"squareMeter\" linearUnit=\"meter\" volumeUnit=\"cubicMeter\" \
             temperatureUnit=\"celsius\" pressureUnit=\"milliBars\" {angles}/>\n</Units>\n"
        ),
        LengthUnit::Foot => imperial("foot"),
        LengthUnit::UsFoot => imperial("USSurveyFoot"),
        LengthUnit::Other => String::new(),
    }
}

/// Returns the element of the coordinate reference system; nothing if nothing is known.
fn coordinate_system(system: &SystemNames) -> String {
    let Some(text) = system.text() else { return String::new() };
    let text = text.trim_start_matches("CRS: ").to_owned();
    let attribute = |name: &str, value: Option<String>| {
        value.map(|value| format!(" {name}=\"{}\"", xml_value(&value))).unwrap_or_default()
    };
    let code = |code: Option<u32>| code.map(|code| code.to_string());
    let of_heights = system.vertical_name.clone().or(system.vertical_code.map(|code| format!("EPSG:{code}")));
    format!(
        "<CoordinateSystem{}{}{}{}/>\n",
        attribute("desc", Some(text)),
        attribute("name", system.name.clone()),
        attribute("epsgCode", code(system.code)),
        attribute("verticalCoordinateSystemName", of_heights),
    )
}

/// Writes the breaklines, if there are any.
fn write_breaklines(mesh: &Mesh, axes: &[ExactAxis; 3], out: &mut Output) -> Result<()> {
    if mesh.lines.is_empty() {
        return Ok(());
    }
    out(b"<SourceData>\n<Breaklines>\n")?;
    let lines = |range: std::ops::Range<u64>| {
        let mut text = Vec::new();
        for line in &mesh.lines[range.start as usize..range.end as usize] {
            text.extend_from_slice(b"<Breakline brkType=\"standard\"><PntList3D>");
            for (number, place) in line.iter().enumerate() {
                if number > 0 {
                    text.push(b' ');
                }
                push_place(axes, *place, &mut text);
            }
            text.extend_from_slice(b"</PntList3D></Breakline>\n");
        }
        Ok(text)
    };
    write_chunks(mesh.lines.len() as u64, &lines, out)?;
    out(b"</Breaklines>\n</SourceData>\n")
}

/// Returns the area of the mesh in the plane in square source units, if it does not need too many digits.
fn area(mesh: &Mesh) -> Option<Decimal> {
    let square = mesh.lattice.resolution.checked_mul(mesh.lattice.resolution)?;
    let half = Decimal::from_u128(mesh.summary.twice_area)?.checked_mul(Decimal::new(5, 1))?;
    Some(half.checked_mul(square)?.normalize())
}

/// Returns the beginning of the surface's definition.
fn definition(mesh: &Mesh, axes: &[ExactAxis; 3]) -> String {
    let [low, high] = mesh.summary.bounds;
    let height = |z: i32| {
        let mut text = Vec::new();
        axes[2].push(z, &mut text);
        String::from_utf8_lossy(&text).into_owned()
    };
    let area = area(mesh).map(|area| format!(" area2DSurf=\"{area}\"")).unwrap_or_default();
    format!("<Definition surfType=\"TIN\"{area} elevMax=\"{}\" elevMin=\"{}\">\n", height(high[2]), height(low[2]))
}
