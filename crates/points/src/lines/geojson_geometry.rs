//! The geometry of a GeoJSON feature. Numbers go straight from the text into vertices: a document of many megabytes may be one feature, and
//! trees of values take many times as much memory.

use std::fmt;

use serde::de::{Error as _, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::Error;
use serde_json::value::RawValue;

use crate::lines::feature::RawGeometry;

/// The members of a geometry, as texts.
#[derive(Deserialize)]
struct Members<'a> {
    #[serde(rename = "type")]
    kind: String,
    #[serde(borrow, default)]
    coordinates: Option<&'a RawValue>,
    #[serde(borrow, default)]
    geometries: Option<Vec<&'a RawValue>>,
}

/// A number of a position, or null.
struct Number(Option<f64>);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Number, D::Error> {
        deserializer.deserialize_any(NumberVisitor)
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = Number;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a number, as in [1.0, 2.0, 3.0]")
    }

    fn visit_f64<E>(self, number: f64) -> Result<Number, E> {
        Ok(Number(Some(number)))
    }

    fn visit_i64<E>(self, number: i64) -> Result<Number, E> {
        Ok(Number(Some(number as f64)))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Number, E> {
        Ok(Number(Some(number as f64)))
    }

    fn visit_unit<E>(self) -> Result<Number, E> {
        Ok(Number(None))
    }
}

/// A vertex: x, y, and its height or NaN, where there is none or null. More numbers say nothing here.
struct Position([f64; 3]);

impl<'de> Deserialize<'de> for Position {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Position, D::Error> {
        deserializer.deserialize_seq(PositionVisitor)
    }
}

struct PositionVisitor;

impl<'de> Visitor<'de> for PositionVisitor {
    type Value = Position;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a position, such as [1.0, 2.0, 3.0]")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut numbers: A) -> Result<Position, A::Error> {
        let mut position = [f64::NAN; 3];
        for number in &mut position[..2] {
            match numbers.next_element()? {
                Some(Number(Some(found))) => *number = found,
                Some(Number(None)) => return Err(A::Error::custom("a vertex has null in place of x or y")),
                None => return Ok(Position(position)),
            }
        }
        match numbers.next_element()? {
            Some(Number(height)) => position[2] = height.unwrap_or(f64::NAN),
            None => return Ok(Position(position)),
        }
        while numbers.next_element::<IgnoredAny>()?.is_some() {}
        Ok(Position(position))
    }
}

/// Collections in collections are rare, and no file has them deeper.
const DEEPEST: usize = 16;

/// Returns the geometry that `text` is.
///
/// # Errors
/// If it is none.
pub(super) fn geometry(text: &RawValue) -> Result<RawGeometry, Error> {
    geometry_in(text, 0)
}

fn geometry_in(text: &RawValue, depth: usize) -> Result<RawGeometry, Error> {
    if depth > DEEPEST {
        return Err(Error::custom("its collections in collections are too deep"));
    }
    let members: Members = serde_json::from_str(text.get())?;
    let coordinates = || members.coordinates.ok_or_else(|| Error::missing_field("coordinates")).map(RawValue::get);
    match members.kind.as_str() {
        "Point" | "MultiPoint" => Ok(RawGeometry::Other("a point")),
        "LineString" => Ok(RawGeometry::Lines(vec![line(serde_json::from_str(coordinates()?)?)])),
        "MultiLineString" => Ok(RawGeometry::Lines(lines(serde_json::from_str(coordinates()?)?))),
        "Polygon" => Ok(RawGeometry::Areas(vec![lines(serde_json::from_str(coordinates()?)?)])),
        "MultiPolygon" => {
            let areas: Vec<Vec<Vec<Position>>> = serde_json::from_str(coordinates()?)?;
            Ok(RawGeometry::Areas(areas.into_iter().map(lines).collect()))
        }
        "GeometryCollection" => {
            let members = members.geometries.ok_or_else(|| Error::missing_field("geometries"))?;
            let members = members.into_iter().map(|member| geometry_in(member, depth + 1));
            Ok(RawGeometry::Several(members.collect::<Result<_, _>>()?))
        }
        kind => Err(Error::custom(format!("its geometry has the type {kind:?}, which is not known"))),
    }
}

fn lines(lines: Vec<Vec<Position>>) -> Vec<Vec<[f64; 3]>> {
    lines.into_iter().map(line).collect()
}

fn line(positions: Vec<Position>) -> Vec<[f64; 3]> {
    positions.into_iter().map(|Position(position)| position).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<RawGeometry, Error> {
        geometry(serde_json::from_str(text).unwrap())
    }

    #[test]
    fn members_come_in_any_order() {
        let line = RawGeometry::Lines(vec![vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]]);
        let text = r#"{"bbox": [0], "coordinates": [[1, 2, 3, 9, "m"], [4, 5, 6]], "type": "LineString"}"#;
        assert_eq!(read(text).unwrap(), line);
        let all = format!(r#"{{"geometries": [{text}], "type": "GeometryCollection"}}"#);
        assert_eq!(read(&all).unwrap(), RawGeometry::Several(vec![line]));
    }

    #[test]
    fn what_is_no_geometry_is_refused() {
        let mut deep = r#"{"type": "Point"}"#.to_string();
        for _ in 0..20 {
            deep = format!(r#"{{"type": "GeometryCollection", "geometries": [{deep}]}}"#);
        }
        for (text, word) in [
            (r#"{"type": "Circle"}"#, "Circle"),
            (r#"{"type": "LineString"}"#, "coordinates"),
            (r#"{"type": "LineString", "coordinates": [[1, "2"]]}"#, "string \"2\", expected a number"),
            (r#"{"type": "LineString", "coordinates": [[1, 2, "3"]]}"#, "string \"3\", expected a number"),
            (r#"{"type": "LineString", "coordinates": [[1, null, 3]]}"#, "null in place of x or y"),
            (r#"{"type": "Polygon", "coordinates": [[1, 2], [3, 4]]}"#, "position"),
            (&deep, "deep"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
