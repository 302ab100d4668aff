//! Up to how many triangles a format is written.

use crate::progress::number_text::grouped;
use tiles::options::{ExportFormat, MaxError};

/// Programs hold all of a LandXML file as a tree. With so many triangles it has half a gigabyte, and takes ten times that in memory.
const MAX_TRIANGLES_IN_LANDXML: u64 = 10_000_000;
/// A face is an entity of its own, with 180 bytes: so many have a gigabyte, and CAD programs take hours for more.
const MAX_TRIANGLES_IN_DXF: u64 = 5_000_000;
/// Readers number faces, as vertices, in signed numbers of 32 bits.
const MAX_NUMBERED_TRIANGLES: u64 = i32::MAX as u64;

/// Returns the most triangles that a file of this format may have.
pub(crate) fn most_triangles(format: ExportFormat) -> u64 {
    match format {
        ExportFormat::Landxml => MAX_TRIANGLES_IN_LANDXML,
        ExportFormat::Dxf => MAX_TRIANGLES_IN_DXF,
        ExportFormat::Obj | ExportFormat::Ply => MAX_NUMBERED_TRIANGLES,
    }
}

/// Returns the warning about a terrain that has more triangles than that, if it has.
pub(crate) fn too_large(format: ExportFormat, triangles: u64, max_error: MaxError) -> Option<String> {
    let most = most_triangles(format);
    let cure =
        if max_error.is_none() { "set [output] max_error for fewer" } else { "set a greater [output] max_error" };
    (triangles > most).then(|| {
        format!(
            "{} is not written: {} triangles are more than the {} that programs open in this format; fix: {cure}",
            format.file_name(),
            grouped(triangles),
            grouped(most),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_names_the_number_the_limit_and_the_remedy() {
        assert_eq!(too_large(ExportFormat::Dxf, 5_000_000, MaxError::None), None);
        let said = too_large(ExportFormat::Dxf, 5_000_001, MaxError::None).unwrap();
        assert!(said.starts_with("terrain.dxf is not written: 5 000 001 triangles"), "{said}");
        assert!(said.contains("the 5 000 000 that") && said.ends_with("set [output] max_error for fewer"), "{said}");
        let said = too_large(ExportFormat::Ply, 1 << 31, MaxError::Units(0.1)).unwrap();
        assert!(said.ends_with("set a greater [output] max_error"), "{said}");
    }
}
