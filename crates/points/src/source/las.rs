//! Opening LAS and LAZ.

use crate::file::random_access::RandomAccessFile;
use crate::las::crs_records;
use crate::las::header::LasHeader;
use crate::las::layout::RecordLayout;
use crate::las::laz::CompressedPoints;
use crate::las::uncompressed::UncompressedPoints;
use crate::las::vlr;
use crate::source::{FileFormat, PointData, Source, is_box};
use crate::text::row_choice::RowChoice;
use crs::plausible::plausible;
use sys::{Result, Warnings};

impl Source {
    /// Opens a LAS or LAZ file.
    pub(super) fn open_las(file: &RandomAccessFile, choice: &RowChoice) -> Result<Source> {
        let mut warnings = Warnings::default();
        let header = LasHeader::read(file, &mut warnings)?;
        let vlrs = vlr::list(file, &header, &mut warnings)?;
        let crs = crs_records::read(file, &vlrs, &mut warnings)?;
        // Bounds that no writer has filled in, or wrong ones, say nothing about the points.
        let has_box = is_box(header.min, header.max) && [header.min, header.max] != [[0.0; 3]; 2];
        let crs = if has_box { plausible(crs, header.min, header.max, &mut warnings) } else { crs };
        let (missing, points) = if header.compressed {
            let points = CompressedPoints::read(file, &header, &vlrs, choice.use_index, &mut warnings)?;
            (points.missing, PointData::Laz(points))
        } else {
            let points = UncompressedPoints::new(&header, file.size());
            (points.missing, PointData::Las(points))
        };
        if missing > 0 {
            let held = header.records - missing;
            warnings.push(format!(
                "the header gives {} points, but the file has only {held}; fix: copy the file again",
                header.records
            ));
        }
        let format = if header.compressed { FileFormat::Laz } else { FileFormat::Las };
        let source = Source {
            version: Some([1, header.minor]),
            point_format: Some(header.format),
            records: header.records,
            missing,
            min: header.min,
            max: header.max,
            has_rgb: RecordLayout::new(header.format, header.record_length).has_rgb(),
            crs,
            by_return: header.by_return,
            warnings,
            ..Source::of(file, format, header.axes, points)
        };
        source.with_choice(choice)
    }
}
