//! Reading Shapefiles: lines and areas in the `.shp`, attributes in the `.dbf`, and the coordinate reference system in the `.prj`. The
//! index, `.shx`, is not needed, because records are read one after the other.
//!
//! A reader of our own checks every count against the length of the record, so a damaged file cannot make it ask for more memory than
//! the file has.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::lines::attribute::WantedAttributes;
use crate::lines::collector::FeatureCollector;
use crate::lines::dbf::DbfTable;
use crate::lines::encoding::Encoding;
use crate::lines::feature::RawGeometry;
use crate::lines::options::{LineOptions, LinePurpose};
use crate::lines::polygons::areas_of;
use crs::from_wkt::parse;
use crs::system::Crs;
use sys::{Error, Result, Warnings, interrupt};

/// Bytes of the file header, and of the header of a record.
const HEADER: usize = 100;
const RECORD_HEADER: usize = 8;

/// No more bytes of a `.prj` are read: well-known text has a few hundred.
const LONGEST_PRJ: u64 = 1 << 20;

/// Bytes of a record before its parts: the type, the box, and two counts.
const BEFORE_PARTS: usize = 44;

/// Hands the features of the file `bytes` to `collector`. Returns the coordinate reference system that the `.prj` says.
///
/// # Errors
/// `Input` if the file is damaged, or lacks attributes that the options name; `Io` if a file beside it cannot be read.
pub(super) fn read(
    path: &Path,
    bytes: &[u8],
    options: &LineOptions,
    collector: &mut FeatureCollector,
    warnings: &mut Warnings,
) -> Result<Crs> {
    let mut table = attributes(path, options)?;
    let mut rest = records(path, bytes)?;
    let mut number = 0u64;
    while !rest.is_empty() {
        interrupt::check()?;
        number += 1;
        let Some((content, after)) = first_record(rest) else {
            let what = format!("is cut off in record {number}: copy it again, all its files together");
            return Err(Error::input(path, what));
        };
        let geometry = match content_of(content).map_err(|what: String| collector.refuse(number, what))? {
            Content::Geometry(geometry) => geometry,
            Content::Rings(rings) => RawGeometry::Areas(areas_of(rings)?),
        };
        let wanted = match &mut table {
            None => WantedAttributes::NONE,
            Some(table) => table.next_record()?.map_err(|what| collector.refuse(number, what))?,
        };
        collector.add(number, geometry, &wanted)?;
        rest = after;
    }
    if options.crs.is_read() { crs(path, options.purpose, warnings) } else { Ok(Crs::default()) }
}

/// Returns the bytes of all records, as far as the header says.
fn records<'a>(path: &Path, bytes: &'a [u8]) -> Result<&'a [u8]> {
    let Some((header, _)) = bytes.split_at_checked(HEADER) else {
        return Err(Error::input(path, "is a Shapefile that is cut off in its header: copy it again"));
    };
    // In words of 16 bits.
    let length = 2 * big(&header[24..]) as usize;
    if length > bytes.len() {
        let what = format!("is cut off: its header gives {length} bytes, but it has {}; copy it again", bytes.len());
        return Err(Error::input(path, what));
    }
    Ok(&bytes[HEADER..length.max(HEADER)])
}

/// Returns the content of the first record, and the records after it; `None` if the first is cut off.
fn first_record(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (header, rest) = bytes.split_at_checked(RECORD_HEADER)?;
    rest.split_at_checked(2 * big(&header[4..]) as usize)
}

/// What a record holds. Which rings belong together is still to be found.
enum Content {
    Geometry(RawGeometry),
    Rings(Vec<Vec<[f64; 3]>>),
}

fn content_of(record: &[u8]) -> std::result::Result<Content, String> {
    let damaged = || "has a damaged record".to_string();
    let (kind, _) = record.split_at_checked(4).ok_or_else(damaged)?;
    let geometry = match little(kind) {
        0 => RawGeometry::Empty,
        kind @ (3 | 13 | 23) => RawGeometry::Lines(parts(record, kind == 13).ok_or_else(damaged)?),
        kind @ (5 | 15 | 25) => return parts(record, kind == 15).map(Content::Rings).ok_or_else(damaged),
        1 | 8 | 11 | 18 | 21 | 28 => RawGeometry::Other("a point"),
        31 => RawGeometry::Other("a surface (MultiPatch)"),
        kind => return Err(format!("has a geometry of the type {kind}, which is not known")),
    };
    Ok(Content::Geometry(geometry))
}

/// Returns the parts of a record of lines or areas; `None` if its counts do not fit its length.
fn parts(record: &[u8], has_z: bool) -> Option<Vec<Vec<[f64; 3]>>> {
    let (head, rest) = record.split_at_checked(BEFORE_PARTS)?;
    let [parts, vertices] = [36, 40].map(|at| little(&head[at..]) as usize);
    let (starts, rest) = rest.split_at_checked(parts.checked_mul(4)?)?;
    let (places, rest) = rest.split_at_checked(vertices.checked_mul(16)?)?;
    let heights = match has_z {
        // Before the heights, there are the least and the greatest.
        true => rest.get(16..16 + vertices * 8)?,
        false => &[],
    };
    let vertex = |index: usize| {
        let [x, y] = [0, 8].map(|at| number(&places[16 * index + at..]));
        [x, y, if has_z { number(&heights[8 * index..]) } else { f64::NAN }]
    };
    let starts: Vec<usize> = starts.chunks_exact(4).map(|start| little(start) as usize).collect();
    let ends = starts.iter().skip(1).copied().chain([vertices]);
    let range = |(&start, end): (&usize, usize)| (start <= end && end <= vertices).then_some(start..end);
    starts.iter().zip(ends).map(|ends| Some(range(ends)?.map(vertex).collect())).collect()
}

fn attributes(path: &Path, options: &LineOptions) -> Result<Option<DbfTable>> {
    let is_needed = options.kind_field.is_some() || options.height_field.is_some();
    if !is_needed && !options.purpose.has_names() {
        return Ok(None);
    }
    match beside(path, "dbf") {
        None if !is_needed => Ok(None),
        Some(dbf) => {
            let encoding = Encoding::of(beside(path, "cpg").as_deref());
            let (kind, height) = (options.kind_field.as_deref(), options.height_field.as_deref());
            DbfTable::open(&dbf, encoding, kind, height, options.purpose.has_names()).map(Some)
        }
        None => Err(Error::input(
            path,
            "its attributes are missing, the .dbf file next to it: copy all files of the Shapefile, or leave out kind_field and \
             height_field",
        )),
    }
}

fn crs(path: &Path, purpose: LinePurpose, warnings: &mut Warnings) -> Result<Crs> {
    let Some(prj) = beside(path, "prj") else {
        warnings.push(format!(
            "it has no .prj file, so its CRS is unknown: its {} are taken to be in that of the points; fix: copy the .prj file too, or \
             set crs in its table",
            purpose.features()
        ));
        return Ok(Crs::default());
    };
    let mut text = Vec::new();
    let file = File::open(&prj).map_err(Error::io("read", &prj))?;
    file.take(LONGEST_PRJ).read_to_end(&mut text).map_err(Error::io("read", &prj))?;
    let text = String::from_utf8_lossy(&text);
    parse(text.trim_start_matches('\u{feff}').trim())
        .ok_or_else(|| Error::input(&prj, format!("is not well-known text of a CRS: {}", purpose.remedy_of_crs(path))))
}

/// Returns the files that are read with the `.shp` at `path`: itself, its attributes, its CRS, and how its texts are written.
pub(super) fn all_files(path: &Path) -> Vec<PathBuf> {
    [path.to_path_buf()]
        .into_iter()
        .chain(["dbf", "prj", "cpg"].iter().filter_map(|ending| beside(path, ending)))
        .collect()
}

/// Returns the file with this ending beside the `.shp`, in small letters or capitals.
fn beside(path: &Path, ending: &str) -> Option<PathBuf> {
    [ending.to_string(), ending.to_uppercase()]
        .iter()
        .map(|ending| path.with_extension(ending))
        .find(|path| path.is_file())
}

/// The first four bytes as a whole number. Callers have checked that they are there.
fn big(bytes: &[u8]) -> u32 {
    bytes[..4].iter().fold(0, |word, &byte| word << 8 | u32::from(byte))
}

fn little(bytes: &[u8]) -> u32 {
    bytes[..4].iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte))
}

fn number(bytes: &[u8]) -> f64 {
    let mut eight = [0; 8];
    eight.copy_from_slice(&bytes[..8]);
    f64::from_le_bytes(eight)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lines::feature::{LineFeature, LineShape};

    /// A record of this type with these parts.
    fn record(kind: i32, parts: &[&[[f64; 3]]]) -> Vec<u8> {
        let vertices: Vec<[f64; 3]> = parts.concat();
        let mut bytes = kind.to_le_bytes().to_vec();
        bytes.extend([0; 32]);
        bytes.extend((parts.len() as u32).to_le_bytes());
        bytes.extend((vertices.len() as u32).to_le_bytes());
        let mut start = 0u32;
        for part in parts {
            bytes.extend(start.to_le_bytes());
            start += part.len() as u32;
        }
        vertices.iter().for_each(|[x, y, _]| bytes.extend([x.to_le_bytes(), y.to_le_bytes()].concat()));
        if kind > 10 {
            bytes.extend([0; 16]);
            vertices.iter().for_each(|vertex| bytes.extend(vertex[2].to_le_bytes()));
        }
        bytes
    }

    fn file(records: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = vec![0; HEADER];
        bytes[..4].copy_from_slice(&9994u32.to_be_bytes());
        for (number, record) in (1u32..).zip(records) {
            bytes.extend(number.to_be_bytes());
            bytes.extend((record.len() as u32 / 2).to_be_bytes());
            bytes.extend(record);
        }
        let words = bytes.len() as u32 / 2;
        bytes[24..28].copy_from_slice(&words.to_be_bytes());
        bytes
    }

    fn read_bytes(bytes: &[u8]) -> Result<Vec<LineFeature>> {
        let options: LineOptions = toml::from_str("files = [\"a\"]").unwrap();
        let path = Path::new("/nowhere/a.shp");
        let (mut collector, mut warnings) = (FeatureCollector::new(path, &options), Warnings::default());
        read(path, bytes, &options, &mut collector, &mut warnings)?;
        assert!(warnings.iter().any(|warning| warning.contains(".prj")));
        Ok(collector.finish().0)
    }

    const LINE: [[f64; 3]; 3] = [[0.0, 0.0, 1.0], [1.0, 0.0, 2.0], [1.0, 1.0, 3.0]];

    #[test]
    fn lines_and_areas_are_read() {
        let ring = [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.0, 0.0, 1.0]];
        let features =
            read_bytes(&file(&[record(13, &[&LINE, &LINE[1..]]), record(0, &[]), record(15, &[&ring])])).unwrap();
        let numbers: Vec<u64> = features.iter().map(|feature| feature.number).collect();
        assert_eq!(numbers, [1, 1, 3]);
        assert_eq!(features[1].shape, LineShape::Line(LINE[1..].to_vec()));
        assert_eq!(features[2].shape, LineShape::Area(vec![ring[..3].to_vec()]));
    }

    #[test]
    fn what_is_damaged_is_named() {
        let sound = file(&[record(13, &[&LINE]), record(13, &[&LINE])]);
        for length in 0..sound.len() {
            assert!(read_bytes(&sound[..length]).is_err(), "{length}");
        }
        // The header may say less than there is, but then a record is cut off.
        let mut short = sound.clone();
        short[24..28].copy_from_slice(&(sound.len() as u32 / 2 - 4).to_be_bytes());
        assert!(read_bytes(&short).unwrap_err().to_string().contains("record 2"));
        for (at, value, word) in
            [(100 + 8, 77u32, "type 77"), (108 + 36, u32::MAX, "damaged"), (108 + 40, 1 << 31, "damaged")]
        {
            let mut damaged = sound.clone();
            damaged[at..at + 4].copy_from_slice(&value.to_le_bytes());
            let error = read_bytes(&damaged).unwrap_err().to_string();
            assert!(error.contains("feature 1") && error.contains(word), "{error}");
        }
        assert!(read_bytes(&file(&[record(3, &[&LINE])])).unwrap_err().to_string().contains("no heights"));
        assert!(read_bytes(&file(&[record(11, &[])])).unwrap_err().to_string().contains("is a point"));
    }
}
