//! The public header block of a LAS or LAZ file (LAS 1.4 R15, section 2.4; LAS 1.5 appends times, which no terrain needs). Every field is
//! checked before it is used.

use rust_decimal::Decimal;

use crate::file::random_access::RandomAccessFile;
use crate::las::layout::LEAST_LENGTHS;
use crate::points::axis::{AXIS_NAMES, Axis};
use lattice::shortest_decimal;
use sys::bytes::{float64, uint16, uint32, uint64};
use sys::{Error, Result, Warnings};

/// The size of the header in versions 1.0 to 1.2, the smallest there is.
const LEAST: usize = 227;

/// The size of the header in version 1.4. Version 1.5 appends 18 bytes, and its drafts 16, which are not read.
const MOST: usize = 375;

/// The most points of a file: their numbers must fit 40 bits.
const MOST_RECORDS: u64 = 1 << 40;

/// The limit of an axis' offset in steps of its scale: 2^53, beyond which an `f64` does not distinguish neighbouring integers.
const MOST_STEPS: Decimal = Decimal::from_parts(0, 1 << 21, 0, false, 0);

/// What is wrong with a header.
#[derive(Debug, thiserror::Error)]
pub(crate) enum HeaderError {
    #[error("is too short for a LAS header: {0} bytes of at least {LEAST}; copy it again")]
    TooShort(u64),
    #[error("has LAS version {0}.{1}, but only versions 1.0 to 1.5 can be read; write it again in one of those")]
    Version(u8, u8),
    #[error("claims a header of {size} bytes, but a header of LAS 1.{minor} has {least}; the file is damaged")]
    Size { size: u16, minor: u8, least: usize },
    #[error("has points of format {0}, but only formats 0 to 10 are known; the file is damaged or newer")]
    PointFormat(u8),
    #[error("claims point records of {length} bytes, but format {format} needs {least}; the file is damaged")]
    RecordLength { length: u16, format: u8, least: u16 },
    #[error(
        "claims that its points begin at byte {points_at}, but the header ends at {header} and the file at {file}; the file is damaged \
         or cut short"
    )]
    PointsAt { points_at: u64, header: u16, file: u64 },
    #[error("claims {0} points, more than any file holds; the file is damaged")]
    TooManyPoints(u64),
    #[error("has bounds in its header that are not finite numbers; the file is damaged, so write it again")]
    Bounds,
    #[error("has {value:e} as the {what} of {axis} in its header, which is not a usable number; the file is damaged")]
    Axis { value: f64, what: &'static str, axis: &'static str },
}

/// What the header says.
#[derive(Clone, Debug)]
pub(crate) struct LasHeader {
    /// The minor version, 0 to 5.
    pub(crate) minor: u8,
    /// The point format, 0 to 10, without the compression bits.
    pub(crate) format: u8,
    /// Whether the points are compressed.
    pub(crate) compressed: bool,
    /// The number of bytes of a point record.
    pub(crate) record_length: u16,
    /// The number of bytes of the header; the variable length records follow it.
    pub(crate) size: u64,
    /// The position of the point data.
    pub(crate) points_at: u64,
    /// The number of variable length records, as the header claims it.
    pub(crate) vlrs: u32,
    /// The position and number of extended variable length records, as the header claims them.
    pub(crate) evlrs: (u64, u32),
    /// The number of point records, as the header claims it.
    pub(crate) records: u64,
    /// The number of points by return (5 or 15 returns), as the header claims it.
    pub(crate) by_return: Vec<u64>,
    /// The least x, y, z, as the header claims them; finite.
    pub(crate) min: [f64; 3],
    /// The greatest x, y, z, as the header claims them; finite.
    pub(crate) max: [f64; 3],
    /// What raw integers mean in x, y and z.
    pub(crate) axes: [Axis; 3],
}

impl LasHeader {
    /// Reads and checks the header of `file`.
    pub(crate) fn read(file: &RandomAccessFile, warnings: &mut Warnings) -> Result<LasHeader> {
        let mut bytes = [0; MOST];
        let held = file.size().min(MOST as u64) as usize;
        file.read_exact_at(&mut bytes[..held], 0)?;
        LasHeader::parse(&bytes[..held], file.size(), warnings)
            .map_err(|error| Error::input(file.path(), error.to_string()))
    }

    /// Parses the first bytes of a file of `file_size` bytes.
    fn parse(bytes: &[u8], file_size: u64, warnings: &mut Warnings) -> std::result::Result<LasHeader, HeaderError> {
        if bytes.len() < LEAST {
            return Err(HeaderError::TooShort(file_size));
        }
        let minor = version(bytes)?;
        let size = uint16(bytes, 94);
        let least = [LEAST, LEAST, LEAST, 235, MOST, MOST][minor as usize];
        if (size as usize) < least || bytes.len() < least {
            return Err(HeaderError::Size { size, minor, least });
        }
        let (format, compressed) = (bytes[104] & 0x3f, bytes[104] & 0xc0 != 0);
        let record_length = record_length(format, uint16(bytes, 105))?;
        let points_at = uint32(bytes, 96) as u64;
        if points_at < size as u64 || points_at > file_size {
            return Err(HeaderError::PointsAt { points_at, header: size, file: file_size });
        }
        let (records, by_return) = counts(bytes, minor, warnings);
        if records > MOST_RECORDS {
            return Err(HeaderError::TooManyPoints(records));
        }
        let [min, max] = bounds(bytes)?;
        Ok(LasHeader {
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
            axes: [axis(bytes, 0)?, axis(bytes, 1)?, axis(bytes, 2)?],
        })
    }
}

fn version(bytes: &[u8]) -> std::result::Result<u8, HeaderError> {
    match (bytes[24], bytes[25]) {
        (1, minor @ 0..=5) => Ok(minor),
        (major, minor) => Err(HeaderError::Version(major, minor)),
    }
}

fn record_length(format: u8, length: u16) -> std::result::Result<u16, HeaderError> {
    let least = *LEAST_LENGTHS.get(format as usize).ok_or(HeaderError::PointFormat(format))?;
    if length < least { Err(HeaderError::RecordLength { length, format, least }) } else { Ok(length) }
}

/// Returns the number of records and the number by return. 64-bit counts, if there are any, win over the older 32-bit counts.
fn counts(bytes: &[u8], minor: u8, warnings: &mut Warnings) -> (u64, Vec<u64>) {
    let old = uint32(bytes, 107) as u64;
    let new = if minor >= 4 { uint64(bytes, 247) } else { 0 };
    if new == 0 {
        return (old, (0..5).map(|i| uint32(bytes, 111 + 4 * i) as u64).collect());
    }
    if old != 0 && old != new {
        warnings.push(format!("its header has two point counts that differ: {old} (32 bit) and {new} (64 bit, used)"));
    }
    (new, (0..15).map(|i| uint64(bytes, 255 + 8 * i)).collect())
}

fn bounds(bytes: &[u8]) -> std::result::Result<[[f64; 3]; 2], HeaderError> {
    let max = [179, 195, 211].map(|at| float64(bytes, at));
    let min = [187, 203, 219].map(|at| float64(bytes, at));
    if min.iter().chain(&max).all(|value| value.is_finite()) { Ok([min, max]) } else { Err(HeaderError::Bounds) }
}

fn axis(bytes: &[u8], index: usize) -> std::result::Result<Axis, HeaderError> {
    let (scale, offset) = (float64(bytes, 131 + 8 * index), float64(bytes, 155 + 8 * index));
    axis_of(scale, offset).map_err(|(what, value)| HeaderError::Axis { value, what, axis: AXIS_NAMES[index] })
}

/// Returns the axis with this scale and offset, or the one that is not usable, and its value.
pub(crate) fn axis_of(scale: f64, offset: f64) -> std::result::Result<Axis, (&'static str, f64)> {
    let step = written_decimal(scale).filter(|step| *step > Decimal::ZERO).ok_or(("scale", scale))?;
    let in_steps = |origin: &Decimal| origin.checked_div(step).is_some_and(|steps| steps.abs() < MOST_STEPS);
    let origin = written_decimal(offset).filter(in_steps).ok_or(("offset", offset))?;
    Ok(Axis { offset: origin, scale: step })
}

/// Returns the number that the writer meant by `value`. If a decimal of 15 digits is within two units in the last place, as
/// after the writer's own arithmetic, it is that decimal (0.000001 for 0.0000010000000000000002), else the shortest decimal.
fn written_decimal(value: f64) -> Option<Decimal> {
    let round: f64 = format!("{value:.14e}").parse().ok()?;
    let near = (round - value).abs() <= 2.0 * f64::EPSILON * value.abs();
    shortest_decimal(if near { round } else { value })
}
