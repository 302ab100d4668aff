//! The flags of a job without a configuration, as the command line has them.

use crate::config;
use clap::builder::PossibleValuesParser;
use clap::{Args, ValueHint};
use std::path::PathBuf;
use std::str::FromStr;

/// What to make of point clouds without a configuration.
#[derive(Args, Debug, Default)]
#[command(next_help_heading = "Options for point clouds")]
pub struct CloudOptions {
    /// The output directory. Default: the name of the file or the folder with -terrain, in the current folder.
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub output: Option<PathBuf>,
    /// The surface to make: ground is bare earth by the classes of points, bare-earth finds the ground, first has roofs and tree tops.
    #[arg(long, value_name = "NAME", value_parser = choice("[input]", "surface"))]
    pub surface: Option<String>,
    /// Fewer triangles: keep every point within this height of the mesh, in the unit of heights.
    #[arg(long, value_name = "HEIGHT", value_parser = number, allow_negative_numbers = true)]
    pub max_error: Option<f64>,
    /// Also write the heights as terrain.tif, with cells of this side, in the unit of x and y.
    #[arg(long, value_name = "SIDE", value_parser = number, allow_negative_numbers = true)]
    pub raster: Option<f64>,
    /// Keep only the points in this rectangle, in the coordinates of the files; with --to-crs, in those of that system.
    #[arg(long, value_name = "XMIN,YMIN,XMAX,YMAX", allow_hyphen_values = true)]
    pub bounds: Option<Bounds>,
    /// Transform all points into this coordinate reference system: utm, or a code such as EPSG:26915.
    #[arg(long, value_name = "CRS")]
    pub to_crs: Option<String>,
    /// The coordinate reference system of all files, if they name none or a wrong one.
    #[arg(long, value_name = "CRS")]
    pub crs: Option<String>,
    /// The unit of x and y, if the files name none.
    #[arg(long, value_name = "UNIT", value_parser = choice("[input]", "unit"))]
    pub unit: Option<String>,
    /// What to do about a file that is damaged or no point cloud: stop, or leave it out.
    #[arg(long, value_name = "WHAT", value_parser = choice("[input]", "on_bad_file"))]
    pub on_bad_file: Option<String>,
    /// Write the configuration that these options mean, and run nothing; - for standard output.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub write_config: Option<PathBuf>,
}

/// Returns what reads one of the words that an option of a configuration takes.
fn choice(table: &str, key: &str) -> PossibleValuesParser {
    PossibleValuesParser::new(config::choices(table, key))
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
        let numbers: Vec<&str> =
            text.trim_matches(['[', ']', ' ']).split([',', ' ']).filter(|n| !n.is_empty()).collect();
        let numbers: std::result::Result<Vec<f64>, _> = numbers.iter().map(|number| number.parse()).collect();
        let sides = numbers.ok().and_then(|numbers| numbers.try_into().ok());
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
        for text in ["", "1,2,3", "1,2,3,4,5", "1;2;3;4", "a,b,c,d"] {
            assert!(text.parse::<Bounds>().unwrap_err().contains("xmin,ymin,xmax,ymax"), "{text}");
        }
    }
}
