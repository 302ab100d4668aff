//! Projections compared with those of PROJ, if there is a Python that has them.

use std::process::Command;

use crs::{Crs, CrsTransform, DatumRule, NamedCrs};

/// The codes of longitude and latitude and of the map, and the area: west, south, east, north.
const MAPS: [(u32, u32, [f64; 4]); 26] = [
    (4326, 32633, [9.0, 0.0, 21.0, 84.0]),
    (4326, 32733, [9.0, -80.0, 21.0, 0.0]),
    (4269, 26915, [-126.0, 10.0, -60.0, 80.0]),
    (4277, 27700, [-9.0, 49.0, 3.0, 61.0]),
    (4171, 2154, [-10.0, 40.0, 12.0, 52.0]),
    (4269, 2277, [-107.0, 25.0, -93.0, 37.0]),
    (4242, 24200, [-80.0, 16.0, -74.0, 20.0]),
    (4269, 5070, [-130.0, 20.0, -60.0, 55.0]),
    (4283, 3577, [110.0, -45.0, 155.0, -9.0]),
    (4326, 3395, [-180.0, -80.0, 180.0, 84.0]),
    (4326, 3857, [-180.0, -85.0, 180.0, 85.0]),
    (4326, 32661, [-180.0, 60.0, 180.0, 90.0]),
    (4326, 3413, [-180.0, 60.0, 180.0, 90.0]),
    (4326, 3031, [-180.0, -90.0, 180.0, -60.0]),
    (4289, 28992, [2.0, 49.0, 9.0, 55.0]),
    (4258, 3035, [-30.0, 25.0, 60.0, 80.0]),
    (4326, 6933, [-180.0, -86.0, 180.0, 86.0]),
    (4150, 2056, [2.0, 42.0, 14.0, 52.0]),
    (4237, 23700, [13.0, 43.0, 26.0, 52.0]),
    (4156, 5514, [9.0, 44.0, 26.0, 54.0]),
    (4742, 3375, [94.0, -3.0, 110.0, 12.0]),
    (4298, 29873, [105.0, -3.0, 124.0, 12.0]),
    (4269, 26931, [-145.0, 50.0, -125.0, 63.0]),
    (4314, 3068, [12.0, 51.0, 15.0, 54.0]),
    // Beside the equator PROJ loses digits.
    (4674, 5880, [-74.0, -36.0, -34.0, -1.0]),
    (4148, 2053, [25.0, -35.0, 33.0, -20.0]),
];

fn crs(code: u32) -> Crs {
    *NamedCrs::try_from(format!("EPSG:{code}")).unwrap().crs
}

#[test]
fn maps_are_those_of_proj() {
    let Ok(python) = std::env::var("GDT_PYPROJ") else {
        println!("skipped: GDT_PYPROJ names no Python with the package pyproj");
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("places");
    let mut command = Command::new(python);
    command.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/projections.py")).arg(&file);
    for (base, code, area) in MAPS {
        command.args([base, code].map(|code| code.to_string())).args(area.map(|degrees| degrees.to_string()));
    }
    assert!(command.status().unwrap().success());
    let bytes = std::fs::read(file).unwrap();
    let numbers: Vec<f64> = bytes.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect();
    for ((base, code, _), places) in MAPS.iter().zip(numbers.chunks(numbers.len() / MAPS.len())) {
        let (base, map) = (crs(*base), crs(*code));
        let unit = map.metres_per_unit().unwrap();
        let there = CrsTransform::between(&base, &map, DatumRule::Strict).unwrap();
        let back = CrsTransform::between(&map, &base, DatumRule::Strict).unwrap();
        let mut off = [0.0f64; 2];
        for place in places.chunks_exact(4) {
            let [longitude, latitude, x, y] = [place[0], place[1], place[2], place[3]];
            let found = there.apply([longitude, latitude]).unwrap_or_else(|| panic!("{code}: {place:?}"));
            off[0] = off[0].max((found[0] - x).abs().max((found[1] - y).abs()) * unit);
            let again = back.apply([x, y]).unwrap_or_else(|| panic!("{code}: {place:?}"));
            let turn = ((again[0] - longitude + 540.0).rem_euclid(360.0) - 180.0).abs() * latitude.to_radians().cos();
            off[1] = off[1].max(turn.max((again[1] - latitude).abs()) * 111_320.0);
        }
        println!("EPSG:{code}: {} places, at most {:.1e} m off there, {:.1e} m back", places.len() / 4, off[0], off[1]);
        // PROJ has the ellipsoid of Krovak's projection to fewer digits.
        let most = if *code == 5514 { 5e-6 } else { 1e-6 };
        assert!(off[0] < most && off[1] < most, "EPSG:{code}: {off:?}");
    }
}
