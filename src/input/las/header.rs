//! The public header block of a LAS or LAZ file (LAS 1.4 R15, section 2.4), every field checked before it is used.

use rust_decimal::Decimal;

use crate::geometry::lattice::shortest_decimal;
use crate::input::file::bytes::{float64, uint16, uint32, uint64};
use crate::input::file::random_access::RandomAccessFile;
use crate::input::las::layout::LENGTHS;
use crate::input::points::axis::Axis;
use crate::{Error, Result};

/// The header's size in versions 1.0 to 1.2, the least there is.
const LEAST: usize = 227;

/// The header's size in version 1.4, the most that is read.
const MOST: usize = 375;

/// The most points of a file: their numbers must fit 40 bits.
const MOST_RECORDS: u64 = 1 << 40;

/// The most steps of its scale that an axis' offset may have: 2^53, as many as an f64 tells apart.
const MOST_STEPS: Decimal = Decimal::from_parts(0, 1 << 21, 0, false, 0);

/// A value, or what is wrong with the file.
type Checked<T> = std::result::Result<T, String>;

/// What the header says.
#[derive(Clone, Debug)]
pub(crate) struct LasHeader {
    /// The minor version, 0 to 4.
    pub(crate) minor: u8,
    /// Point format 0 to 10, without the compression bits.
    pub(crate) format: u8,
    /// Whether the points are compressed.
    pub(crate) compressed: bool,
    /// Bytes of a point record.
    pub(crate) record_length: u16,
    /// Bytes of the header, after which the variable length records begin.
    pub(crate) size: u64,
    /// Position of the point data.
    pub(crate) points_at: u64,
    /// Number of variable length records, not to be trusted.
    pub(crate) vlrs: u32,
    /// Position and number of extended variable length records, not to be trusted.
    pub(crate) evlrs: (u64, u32),
    /// Number of point records, not to be trusted.
    pub(crate) records: u64,
    /// Number of points by return, 5 or 15 of them, not to be trusted.
    pub(crate) by_return: Vec<u64>,
    /// Least x, y, z, not to be trusted.
    pub(crate) min: [f64; 3],
    /// Greatest x, y, z, not to be trusted.
    pub(crate) max: [f64; 3],
    /// The way from raw integers to coordinates.
    pub(crate) axes: [Axis; 3],
}

impl LasHeader {
    /// Reads and checks the header of `file`; the texts are what the user should know.
    pub(crate) fn read(file: &RandomAccessFile) -> Result<(LasHeader, Vec<String>)> {
        let mut bytes = [0; MOST];
        let held = file.size().min(MOST as u64) as usize;
        file.read_exact_at(&mut bytes[..held], 0)?;
        LasHeader::parse(&bytes[..held], file.size()).map_err(|what| Error::input(file.path(), what))
    }

    /// Reads the header from the first bytes of a file of `file_size` bytes, or says what is wrong with it.
    pub(crate) fn parse(bytes: &[u8], file_size: u64) -> Checked<(LasHeader, Vec<String>)> {
        if bytes.len() < LEAST {
            return Err(format!("is too short for a LAS header: {file_size} bytes of at least {LEAST}; copy it again"));
        }
        let minor = version(bytes)?;
        let size = uint16(bytes, 94);
        let least = [LEAST, LEAST, LEAST, 235, MOST][minor as usize];
        if (size as usize) < least || bytes.len() < least {
            return Err(format!(
                "says its header has {size} bytes, but that of LAS 1.{minor} has {least}; the file is damaged"
            ));
        }
        let (format, compressed) = (bytes[104] & 0x3f, bytes[104] & 0xc0 != 0);
        let record_length = record_length(format, uint16(bytes, 105))?;
        let points_at = uint32(bytes, 96) as u64;
        if points_at < size as u64 || points_at > file_size {
            return Err(format!(
                "says its points begin at byte {points_at}, but the header ends at {size} and the file at {file_size}; \
                 the file is damaged or cut short"
            ));
        }
        let mut warnings = Vec::new();
        let (records, by_return) = counts(bytes, minor, &mut warnings);
        if records > MOST_RECORDS {
            return Err(format!("says it has {records} points, more than any file holds; the file is damaged"));
        }
        let [min, max] = bounds(bytes)?;
        let header = LasHeader {
            minor,
            format,
            compressed,
            record_length,
            size: size as u64,
            points_at,
            vlrs: uint32(bytes, 100),
            evlrs: if minor >= 4 { (uint64(bytes, 235), uint32(bytes, 243)) } else { (0, 0) },
            records,
            by_return,
            min,
            max,
            axes: axes(bytes)?,
        };
        Ok((header, warnings))
    }
}

fn version(bytes: &[u8]) -> Checked<u8> {
    match (bytes[24], bytes[25]) {
        (1, minor @ 0..=4) => Ok(minor),
        (major, minor) => Err(format!(
            "is of LAS version {major}.{minor}; versions 1.0 to 1.4 can be read, so write it again in one of those"
        )),
    }
}

fn record_length(format: u8, length: u16) -> Checked<u16> {
    let Some(&least) = LENGTHS.get(format as usize) else {
        return Err(format!(
            "has points of format {format}; formats 0 to 10 are known, so the file is damaged or newer"
        ));
    };
    if length < least {
        return Err(format!(
            "says a point record has {length} bytes, but format {format} needs {least}; the file is damaged"
        ));
    }
    Ok(length)
}

/// The number of records and those by return; 64-bit counts, where there are any, win over the older 32-bit ones.
fn counts(bytes: &[u8], minor: u8, warnings: &mut Vec<String>) -> (u64, Vec<u64>) {
    let old = uint32(bytes, 107) as u64;
    let new = if minor >= 4 { uint64(bytes, 247) } else { 0 };
    if new == 0 {
        return (old, (0..5).map(|i| uint32(bytes, 111 + 4 * i) as u64).collect());
    }
    if old != 0 && old != new {
        warnings.push(format!("the header's two point counts differ: {old} (32 bit) and {new} (64 bit, used)"));
    }
    (new, (0..15).map(|i| uint64(bytes, 255 + 8 * i)).collect())
}

fn bounds(bytes: &[u8]) -> Checked<[[f64; 3]; 2]> {
    let max = [179, 195, 211].map(|at| float64(bytes, at));
    let min = [187, 203, 219].map(|at| float64(bytes, at));
    if min.iter().chain(&max).any(|value| !value.is_finite()) {
        return Err(
            "has bounds in its header that are not finite numbers; the file is damaged, so write it again".into()
        );
    }
    Ok([min, max])
}

fn axes(bytes: &[u8]) -> Checked<[Axis; 3]> {
    Ok([axis(bytes, 0)?, axis(bytes, 1)?, axis(bytes, 2)?])
}

fn axis(bytes: &[u8], index: usize) -> Checked<Axis> {
    let name = ["x", "y", "z"][index];
    let (scale, offset) = (float64(bytes, 131 + 8 * index), float64(bytes, 155 + 8 * index));
    let unusable = |what: &str, value: f64| {
        format!(
            "has {value:e} as the {what} of {name} in its header, which is not a usable number; the file is damaged"
        )
    };
    let step = written_decimal(scale).filter(|step| *step > Decimal::ZERO).ok_or_else(|| unusable("scale", scale))?;
    // Farther out, floating point no longer tells one step from the next.
    let in_steps = |origin: &Decimal| origin.checked_div(step).is_some_and(|steps| steps.abs() < MOST_STEPS);
    let origin = written_decimal(offset).filter(in_steps).ok_or_else(|| unusable("offset", offset))?;
    Ok(Axis { offset: origin, scale: step })
}

/// The number that the writer meant by `value`: where a decimal of 15 digits is within two units in the last place,
/// as after the writer's own arithmetic, that one (0.000001 for 0.0000010000000000000002), else the shortest.
fn written_decimal(value: f64) -> Option<Decimal> {
    let round: f64 = format!("{value:.14e}").parse().ok()?;
    let near = (round - value).abs() <= 2.0 * f64::EPSILON * value.abs();
    shortest_decimal(if near { round } else { value })
}
