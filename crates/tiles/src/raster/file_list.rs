//! `terrain.vrt` and its like: the files of a raster, which GDAL and the programs that use it open as one (GDAL's virtual format).

use crate::raster::BLOCK;
use crate::raster::geokeys::RasterSystem;
use crate::raster::options::nodata_text;
use crate::raster::products::RasterProduct;
use std::fmt;

/// A file of a raster.
pub struct ListedFile {
    /// Its path from the folder of the list.
    pub uri: String,
    /// The columns and the rows of the raster that it has, each as the first and the one after the last.
    pub cells: [[u32; 2]; 2],
}

/// All files of a raster.
pub struct RasterList<'a> {
    /// Columns and rows of the whole.
    pub size: [u32; 2],
    /// The x of the western edge and the y of the northern edge.
    pub corner: [f64; 2],
    /// The side of a cell in source units.
    pub cell_size: f64,
    /// What the cells hold.
    pub product: RasterProduct,
    /// What cells without a value hold.
    pub nodata: f32,
    /// What the coordinates are in.
    pub system: &'a RasterSystem,
    /// The files. There is none where there is no terrain.
    pub files: Vec<ListedFile>,
}

impl fmt::Display for RasterList<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let ([columns, rows], [west, north], cell) = (self.size, self.corner, self.cell_size);
        writeln!(f, r#"<VRTDataset rasterXSize="{columns}" rasterYSize="{rows}">"#)?;
        if let Some(system) = self.system.definition() {
            writeln!(f, "  <SRS>{}</SRS>", escaped(&system))?;
        }
        writeln!(f, "  <GeoTransform>{west}, {cell}, 0, {north}, 0, -{cell}</GeoTransform>")?;
        writeln!(f, r#"  <Metadata><MDI key="AREA_OR_POINT">Area</MDI></Metadata>"#)?;
        writeln!(f, r#"  <VRTRasterBand dataType="{}" band="1">"#, self.data_type())?;
        writeln!(f, "    <NoDataValue>{}</NoDataValue>", nodata_text(self.nodata))?;
        self.files.iter().try_for_each(|file| file.write(self.data_type(), f))?;
        writeln!(f, "  </VRTRasterBand>\n</VRTDataset>")
    }
}

impl RasterList<'_> {
    fn data_type(&self) -> &'static str {
        if self.product.is_bytes() { "Byte" } else { "Float32" }
    }
}

impl ListedFile {
    fn write(&self, data_type: &str, f: &mut fmt::Formatter) -> fmt::Result {
        let ([left, top], [width, height]) =
            (self.cells.map(|[first, _]| first), self.cells.map(|[first, past]| past - first));
        // With these properties, programs need not open all files to open the list.
        write!(
            f,
            "    <SimpleSource>\n      <SourceFilename relativeToVRT=\"1\">{}</SourceFilename>\n      <SourceBand>1</SourceBand>\n      \
             <SourceProperties RasterXSize=\"{width}\" RasterYSize=\"{height}\" DataType=\"{data_type}\" BlockXSize=\"{BLOCK}\" \
             BlockYSize=\"{BLOCK}\"/>\n      <SrcRect xOff=\"0\" yOff=\"0\" xSize=\"{width}\" ySize=\"{height}\"/>\n      \
             <DstRect xOff=\"{left}\" yOff=\"{top}\" xSize=\"{width}\" ySize=\"{height}\"/>\n    </SimpleSource>\n",
            escaped(&self.uri)
        )
    }
}

/// Returns a text as it stands in XML.
fn escaped(text: &str) -> String {
    let is_fine = |c: &char| !c.is_control() || *c == '\n';
    text.chars().filter(is_fine).fold(String::with_capacity(text.len()), |mut out, c| {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            _ => out.push(c),
        }
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_names_the_files_and_their_places() {
        let system = RasterSystem { text: Some("LOCAL_CS[\"a < b & c\"]".into()), ..RasterSystem::default() };
        let list = RasterList {
            size: [1500, 700],
            corner: [500_000.5, 4_000_000.0],
            cell_size: 0.5,
            product: RasterProduct::Height,
            nodata: -9999.0,
            system: &system,
            files: vec![ListedFile { uri: "raster/000002.tif".into(), cells: [[1024, 1500], [512, 700]] }],
        };
        let text = list.to_string();
        for part in [
            r#"<VRTDataset rasterXSize="1500" rasterYSize="700">"#,
            r#"<SRS>LOCAL_CS["a &lt; b &amp; c"]</SRS>"#,
            "<GeoTransform>500000.5, 0.5, 0, 4000000, 0, -0.5</GeoTransform>",
            "<NoDataValue>-9999</NoDataValue>",
            r#"<SourceFilename relativeToVRT="1">raster/000002.tif</SourceFilename>"#,
            r#"<SrcRect xOff="0" yOff="0" xSize="476" ySize="188"/>"#,
            r#"<DstRect xOff="1024" yOff="512" xSize="476" ySize="188"/>"#,
        ] {
            assert!(text.contains(part), "{part}\n{text}");
        }
    }
}
