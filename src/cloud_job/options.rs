//! The flags of a job without a configuration, as the command line has them.

use crate::config;
use clap::builder::PossibleValuesParser;
use clap::{Args, ValueHint};
use points::is_url;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// What to make of point clouds without a configuration.
#[derive(Args, Debug, Default)]
#[command(next_help_heading = "Options for point clouds")]
pub struct CloudOptions {
    /// The output directory. Default: the name of the file or the folder with -terrain, in the current folder.
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub output: Option<PathBuf>,
    /// The surface: ground is bare earth from classified points, bare-earth finds the ground itself, first has roofs and tree tops.
    #[arg(long, value_name = "NAME", value_parser = choice("[input]", "surface"))]
    pub surface: Option<String>,
    /// Fewer triangles: keep every point within this height of the mesh, in the unit of heights.
    #[arg(long, value_name = "HEIGHT", value_parser = number, allow_negative_numbers = true)]
    pub max_error: Option<f64>,
    /// Flat slivers between the terrain and the convex hull of all points: trimmed leaves them out, whole keeps them.
    #[arg(long, value_name = "WHAT", value_parser = choice("[output]", "hull"))]
    pub hull: Option<String>,
    /// Also write the heights as terrain.tif, with cells of this side, in the unit of x and y.
    #[arg(long, value_name = "SIDE", value_parser = number, allow_negative_numbers = true)]
    pub raster: Option<f64>,
    /// Also write the triangles for CAD and other programs: landxml, dxf, obj, ply; several with commas.
    #[arg(long, value_name = "FORMATS", value_delimiter = ',', value_parser = choice("[output]", "export"))]
    pub export: Vec<String>,
    /// Also write contour lines as contours.gpkg, with this height from one to the next, in the unit of heights. With --export dxf, also as
    /// contours.dxf.
    #[arg(long, value_name = "INTERVAL", value_parser = number, allow_negative_numbers = true)]
    pub contours: Option<f64>,
    /// Also write index.html, a page that shows the terrain: put the output on a web server.
    #[arg(long)]
    pub page: bool,
    /// Write the page, which drapes map tiles over the terrain for all visitors: a URL with {z}, {x} and {y}, whose server sends CORS headers.
    #[arg(long, value_name = "URL")]
    pub imagery: Option<String>,
    /// Also write terrain tiles for globes such as CesiumJS to terrain/. They need --height-offset if heights are above sea level.
    #[arg(long)]
    pub terrain: bool,
    /// Keep only the points in this rectangle, in the coordinates of the files; with --to-crs, in that CRS.
    #[arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", allow_hyphen_values = true)]
    pub bounds: Option<Bounds>,
    /// Keep only the points within the polygons of this file: GeoJSON, GeoPackage or Shapefile, in any coordinate reference system.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub clip: Option<PathBuf>,
    /// Transform all points into this coordinate reference system: utm, or a code such as EPSG:26915.
    #[arg(long, value_name = "CRS")]
    pub to_crs: Option<String>,
    /// The coordinate reference system of all files, if they name none or a wrong one.
    #[arg(long, value_name = "CRS")]
    pub crs: Option<String>,
    /// The unit of x and y, if the files name none.
    #[arg(long, value_name = "UNIT", value_parser = choice("[input]", "unit"))]
    pub unit: Option<String>,
    /// The unit of z, if the files name none; foot is the international one. Default: that of x and y. Results keep it, unless --to-crs names
    /// another.
    #[arg(long, value_name = "UNIT", value_parser = choice("[input]", "height_unit"))]
    pub height_unit: Option<String>,
    /// Colours of the vertices: an orthophoto (GeoTIFF, also by URL), or rgb, elevation, class or none.
    #[arg(long, value_name = "COLOR", value_parser = color)]
    pub color: Option<String>,
    /// What to add to heights to get heights above the ellipsoid, which globes need: egm96, a geoid grid, or metres.
    #[arg(long, value_name = "OFFSET", value_parser = offset, allow_negative_numbers = true)]
    pub height_offset: Option<Offset>,
    /// What to do about a file that is damaged or not a point cloud: stop, or skip it.
    #[arg(long, value_name = "WHAT", value_parser = choice("[input]", "on_bad_file"))]
    pub on_bad_file: Option<String>,
    /// Write these options to a configuration file instead of running a job; - for standard output.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub write_config: Option<PathBuf>,
}

/// Returns what reads one of the words that an option of a configuration takes.
fn choice(table: &str, key: &str) -> PossibleValuesParser {
    PossibleValuesParser::new(config::choices(table, key))
}

/// What to add to heights.
#[derive(Clone, Debug)]
pub enum Offset {
    /// The heights of a geoid that is built in.
    Egm96,
    /// So many metres.
    Metres(f64),
    /// The heights of this geoid grid.
    Grid(String),
}

fn offset(text: &str) -> Result<Offset, String> {
    match (text, text.parse()) {
        ("egm96", _) => Ok(Offset::Egm96),
        (_, Ok(metres)) => Ok(Offset::Metres(metres)),
        _ if Path::new(text).extension().is_some() => whole_path(text).map(Offset::Grid),
        _ => Err("give egm96, a geoid grid such as geoid.tif, or a number of metres".into()),
    }
}

/// Returns a colour option, in which the path of a picture is whole: a configuration counts paths from its own folder.
fn color(text: &str) -> Result<String, String> {
    match !is_url(text) && Path::new(text).extension().is_some() {
        true => whole_path(text),
        false => Ok(text.into()),
    }
}

fn whole_path(text: &str) -> Result<String, String> {
    let whole = std::path::absolute(text).map_err(|error| error.to_string())?;
    whole
        .into_os_string()
        .into_string()
        .map_err(|_| "the path of the current folder is no Unicode: work in another folder".into())
}

fn number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "give a number such as 0.5".into())
}

/// A rectangle as the command line has it.
#[derive(Clone, Copy, Debug)]
pub struct Bounds(pub [f64; 4]);

impl FromStr for Bounds {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Bounds, String> {
        let numbers = text.split(['(', '[', ',', ' ', ']', ')']).filter(|number| !number.is_empty());
        let numbers: std::result::Result<Vec<f64>, _> = numbers.map(str::parse).collect();
        let sides = numbers.ok().and_then(|numbers| <[f64; 4]>::try_from(numbers).ok());
        // PDAL writes ([xmin, xmax], [ymin, ymax]).
        let is_by_axis = text.trim_start().starts_with('(');
        let sides = sides.map(|[a, b, c, d]| if is_by_axis { [a, c, b, d] } else { [a, b, c, d] });
        sides.map(Bounds).ok_or("give four numbers, xmin,ymin,xmax,ymax, such as 565000,5933000,565400,5933400".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_is_four_numbers() {
        for text in ["1,-2.5,3,4", "[1, -2.5, 3, 4]", "1 -2.5 3 4"] {
            assert_eq!(text.parse::<Bounds>().unwrap().0, [1.0, -2.5, 3.0, 4.0]);
        }
        assert_eq!("([1, 3], [-2.5, 4])".parse::<Bounds>().unwrap().0, [1.0, -2.5, 3.0, 4.0]);
        for text in ["", "1,2,3", "1,2,3,4,5", "1;2;3;4", "a,b,c,d"] {
            assert!(text.parse::<Bounds>().unwrap_err().contains("xmin,ymin,xmax,ymax"), "{text}");
        }
    }
}
