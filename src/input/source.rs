//! A point cloud that has been looked at and can be decoded chunk by chunk.

use std::path::{Path, PathBuf};

use rust_decimal::Decimal;
use serde::{Deserialize, Serialize};

use crate::input::crs::system::Crs;
use crate::input::file::random_access::RandomAccessFile;
use crate::input::las::crs_records;
use crate::input::las::header::LasHeader;
use crate::input::las::layout::RecordLayout;
use crate::input::las::laz::CompressedPoints;
use crate::input::las::uncompressed::UncompressedPoints;
use crate::input::las::vlr;
use crate::input::points::axis::Axis;
use crate::input::points::filter::PointFilter;
use crate::input::points::point::Point;
use crate::input::points::rules::{PointCounts, PointRules};
use crate::input::text::options::TextOptions;
use crate::input::text::table::TextTable;
use crate::{Error, Result};

/// How a file holds its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FileFormat {
    /// Uncompressed LAS.
    Las,
    /// Compressed LAS, COPC included.
    Laz,
    /// A table of numbers as text.
    Text,
}

/// A point cloud file whose header, or text, has been looked at. Nothing it says of its points is to be trusted but
/// what [`Source::decode`] gives.
#[derive(Clone, Debug)]
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// Its size in bytes when it was looked at; a change later is an error.
    pub size: u64,
    /// How it holds its points.
    pub format: FileFormat,
    /// LAS version, major and minor; `None` for text.
    pub version: Option<[u8; 2]>,
    /// LAS point format, 0 to 10; `None` for text.
    pub point_format: Option<u8>,
    /// The number of records, those included that the file promises and does not have.
    pub records: u64,
    /// How many of them the file is known not to have; decoding counts these as malformed.
    pub missing: u64,
    /// Least x, y, z: of all points for text, what the header claims for LAS (often wrong).
    pub min: [f64; 3],
    /// Greatest x, y, z, likewise.
    pub max: [f64; 3],
    /// What raw integers mean in x, y, z.
    pub axes: [Axis; 3],
    /// A step in x and in y of which every coordinate is a whole multiple, counted from the axis' offset: the coarsest
    /// there is for text, the scale for LAS.
    pub grid: [Decimal; 2],
    /// Whether points have a colour.
    pub has_rgb: bool,
    /// Whether points have a classification.
    pub has_class: bool,
    /// The coordinate reference system.
    pub crs: Crs,
    /// The number of points by return, from the first on, as a LAS header claims it; empty for text.
    pub by_return: Vec<u64>,
    /// What the user should know.
    pub warnings: Vec<String>,
    body: PointData,
}

#[derive(Clone, Debug)]
enum PointData {
    Las(UncompressedPoints),
    Laz(CompressedPoints),
    Text(TextTable),
}

/// Looks at the file at `path`: reads the header of LAS or LAZ, or all of a text once, on the threads of the current
/// rayon pool.
///
/// # Errors
/// `Input` where the file is not a point cloud or is damaged beyond reading, `Io` where it cannot be read, `Config` where
/// `text` contradicts itself.
pub fn open(path: &Path, text: &TextOptions) -> Result<Source> {
    let file = RandomAccessFile::open(path)?;
    let mut start = [0; 64];
    let held = file.size().min(start.len() as u64) as usize;
    file.read_exact_at(&mut start[..held], 0)?;
    let start = &start[..held];
    if start.starts_with(b"LASF") {
        return open_las(&file);
    }
    refuse(path, start)?;
    open_text(&file, text)
}

/// Says what a file is that is certainly no point cloud.
fn refuse(path: &Path, start: &[u8]) -> Result<()> {
    if start.is_empty() {
        return Err(Error::input(path, "is empty"));
    }
    if start.starts_with(b"version https://git-lfs.github.com/spec") {
        let what = "is a Git LFS pointer, not the point cloud itself; fetch that with `git lfs pull`";
        return Err(Error::input(path, what));
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if extension == "las" || extension == "laz" {
        let what = "does not begin with the letters LASF, so it is not LAS or LAZ; copy or download it again";
        return Err(Error::input(path, what));
    }
    if start.starts_with(&[0xff, 0xfe]) || start.starts_with(&[0xfe, 0xff]) {
        return Err(Error::input(path, "is text in UTF-16; save it as UTF-8"));
    }
    if start.contains(&0) {
        let what = "is neither LAS nor LAZ nor UTF-8 text; convert it to one of those first";
        return Err(Error::input(path, what));
    }
    Ok(())
}

fn open_las(file: &RandomAccessFile) -> Result<Source> {
    let (header, mut warnings) = LasHeader::read(file)?;
    let vlrs = vlr::list(file, &header, &mut warnings)?;
    let crs = crs_records::read(file, &vlrs, &mut warnings)?;
    let (missing, body) = if header.compressed {
        let chunks = CompressedPoints::read(file, &header, &vlrs, &mut warnings)?;
        (chunks.missing, PointData::Laz(chunks))
    } else {
        let records = UncompressedPoints::new(&header, file.size());
        (records.missing, PointData::Las(records))
    };
    if missing > 0 {
        let held = header.records - missing;
        warnings.push(format!("the header promises {} points, but the file has only {held}", header.records));
    }
    Ok(Source {
        path: file.path().to_path_buf(),
        size: file.size(),
        format: if header.compressed { FileFormat::Laz } else { FileFormat::Las },
        version: Some([1, header.minor]),
        point_format: Some(header.format),
        records: header.records,
        missing,
        min: header.min,
        max: header.max,
        axes: header.axes,
        grid: [header.axes[0].scale, header.axes[1].scale],
        has_rgb: RecordLayout::new(header.format, header.record_length).has_rgb(),
        has_class: true,
        crs,
        by_return: header.by_return,
        warnings,
        body,
    })
}

fn open_text(file: &RandomAccessFile, options: &TextOptions) -> Result<Source> {
    let (table, warnings) = TextTable::scan(file, options)?;
    Ok(Source {
        path: file.path().to_path_buf(),
        size: file.size(),
        format: FileFormat::Text,
        version: None,
        point_format: None,
        records: table.records,
        missing: 0,
        min: table.min,
        max: table.max,
        axes: table.axes(),
        grid: table.grid(),
        has_rgb: table.has_rgb(),
        has_class: table.has_class(),
        crs: Crs::default(),
        by_return: Vec::new(),
        warnings,
        body: PointData::Text(table),
    })
}

impl Source {
    /// The number of independent parts, of about 50,000 records each where the format allows; 0 for a file without records.
    pub fn chunks(&self) -> usize {
        match &self.body {
            PointData::Las(records) => records.chunks(),
            PointData::Laz(chunks) => chunks.chunks(),
            PointData::Text(table) => table.chunks(),
        }
    }

    /// Decodes part `chunk` (below [`Source::chunks`]) and hands the points that pass `rules` to `sink` in record order, at
    /// most 65,536 at a time. The point of record `i` of the source gets the order `rules.first_order + i`. UncompressedPoints that
    /// cannot be read are counted as malformed; whether that is too many is for the caller to say.
    ///
    /// # Errors
    /// `Io` or `Input` where the file cannot be read or has changed since, and what `sink` returns.
    pub fn decode(
        &self,
        chunk: usize,
        rules: &PointRules,
        sink: &mut dyn FnMut(&[Point]) -> Result<()>,
    ) -> Result<PointCounts> {
        let file = RandomAccessFile::reopen(&self.path, self.size)?;
        let mut filter = PointFilter::new(&self.path, &self.axes, rules, sink);
        match &self.body {
            PointData::Las(records) => records.decode(&file, chunk, rules, &mut filter)?,
            PointData::Laz(chunks) => chunks.decode(&file, chunk, rules, &mut filter)?,
            PointData::Text(table) => table.decode(&file, chunk, &mut filter)?,
        }
        filter.finish()
    }
}
