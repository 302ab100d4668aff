//! Point clouds of every kind: real ones against what is known about them and against another reader, made-up ones of every
//! point format, and broken ones.

#[path = "../common/cloud.rs"]
mod cloud;
#[path = "../common/mod.rs"]
mod common;
#[path = "../common/copc_file.rs"]
mod copc_file;
#[path = "../common/ept_files.rs"]
mod ept_files;
#[path = "../common/las_file.rs"]
mod las_file;

mod copc;
mod damaged;
mod ept;
mod formats;
mod headers;
mod layouts;
mod meanings;
mod projections;
mod real;
mod rules;
mod starts;
mod written_down;

use cloud::{Cloud, read_bytes, rules};
use las_file::LasFile;
use points::Point;

/// Returns the first warning about the file; empty if there is none.
pub(crate) fn first_warning(cloud: &Cloud) -> &str {
    cloud.source.warnings.iter().next().unwrap_or_default()
}

/// Returns the points that a file made by `LasFile::new` must give.
fn expected(file: &LasFile, cloud: &Cloud) -> Vec<Point> {
    let rules = rules(&cloud.source, &cloud.lattice);
    let rgb_at = match file.format {
        2 => Some(20),
        3 | 5 => Some(28),
        7 | 8 | 10 => Some(30),
        _ => None,
    };
    let mut points = Vec::new();
    for (order, bytes) in file.records.chunks_exact(file.length() as usize).enumerate() {
        if order % 17 == 3 {
            continue;
        }
        let raw = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as i64;
        let [x, y, z] = [0, 1, 2].map(|axis| rules.maps[axis].apply(raw(4 * axis)).unwrap().0);
        let color = |at: usize| u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap());
        let rgb = rgb_at.map_or([0; 3], |at| [color(at), color(at + 2), color(at + 4)]);
        let class = if file.format >= 6 { (order % 70) as u8 } else { (order % 19) as u8 };
        points.push(Point::new([x, y], z, rgb, class, order as u64));
    }
    points
}

fn assert_reads(file: &LasFile, name: &str, bytes: &[u8]) -> Cloud {
    let cloud = read_bytes(".laz", bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
    assert_eq!(cloud.counts.malformed, 0, "{name}: {:?}", cloud.counts.examples);
    assert!(cloud.points == expected(file, &cloud), "{name}: points differ");
    cloud
}
