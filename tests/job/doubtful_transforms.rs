//! Jobs that transform points whose CRS cannot be read, or which does not fit them: no place may be wrong in silence.

use std::fmt::Write;
use std::fs;

use crate::coordinate_systems::{code, keys, text, warnings};
use crate::program::{Job, gdt_batch, number};
use crate::transformed::{las_of, places};

const BASE: &str = r#"GEOGCS["NAD83",DATUM["North_American_Datum_1983",SPHEROID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0]"#;

#[test]
fn what_nobody_can_tell_is_not_taken_for_the_system_of_the_job() {
    let folder = tempfile::tempdir().unwrap();
    let rows: Vec<[f64; 3]> = (0..60).map(|i| [5e5 + f64::from(i % 8), 5e6 + f64::from(i), 1.0]).collect();
    let las = |name: &str, record: (u16, Vec<u8>)| las_of(folder.path(), &rows, name, &[record], 0.01);
    let unnamed = text(&format!(r#"PROJCS["unnamed",{BASE},UNIT["degree",0.0174532925199433]],UNIT["metre",1]]"#));
    let json = text(r#"{"type": "ProjectedCRS"}"#);
    let mygrid = text(&format!(r#"PROJCS["My grid",{BASE}],UNIT["metre",1]]"#));
    let user = keys(&[[1024, 0, 1, 1], [3072, 0, 1, 32767], [3076, 0, 1, 9001]]);
    let radians = keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4269], [2054, 0, 1, 9101]]);
    for (name, record, words) in [
        ("unnamed.las", unnamed.clone(), ["names no CRS", "missing_crs"]),
        ("user.las", user.clone(), ["names no CRS", "missing_crs"]),
        ("json.las", json, ["not well-known text that can be read", "missing_crs"]),
        ("mygrid.las", mygrid, ["My grid has no readable projection", "set [input] crs"]),
        ("unknown.las", code(40_000), ["EPSG:40000 is not in the list of known codes", "set [input] crs"]),
    ] {
        let job = Job::on(&[las(name, record)]).with("input", "to_crs = \"EPSG:26915\"");
        job.run().refused(2, &[&[name], &words[..]].concat());
    }
    let turned: Vec<[f64; 3]> = places(0).into_iter().map(|[x, y, z]| [x.to_radians(), y.to_radians(), z]).collect();
    let radians = las_of(folder.path(), &turned, "radians.las", &[radians], 1e-9);
    let words = ["radians.las", "key 2054, the unit of longitude and latitude", "set [input] crs"];
    Job::on(&[radians]).with("input", "to_crs = \"EPSG:26915\"").run().refused(2, &words);
    // What is missing may be said.
    let expected = Job::on(&[las("good.las", code(26916))]).with("input", "to_crs = \"EPSG:26915\"").digest();
    for record in [unnamed, user] {
        let lines = "to_crs = \"EPSG:26915\"\nmissing_crs = \"EPSG:26916\"";
        assert_eq!(Job::on(&[las("a.las", record)]).with("input", lines).digest(), expected);
    }
    // Degrees without a unit are degrees.
    let degrees = las_of(folder.path(), &places(0), "bare.las", &[text(&format!("{BASE}]"))], 1e-7);
    Job::on(&[&degrees]).run().refused(2, &["bare.las", "in degrees", "to_crs"]);
    // Two ways to round a foot are one foot.
    let feet = |name: &str, size: &str| {
        let plane = format!(
            r#"PROJCS["p",{BASE},UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],
            PARAMETER["central_meridian",-93],PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],UNIT["metre",1]]"#
        );
        let heights = format!(r#"VERT_CS["NAVD88 height",VERT_DATUM["NAVD88",2005],UNIT["US survey foot",{size}]]"#);
        las(name, text(&format!(r#"COMPD_CS["c",{plane},{heights}]"#)))
    };
    let both = [feet("a.las", "0.304800609601219"), feet("b.las", "0.3048006096012192")];
    let report = Job::on(&both).with("input", "to_crs = \"EPSG:26915\"").report();
    assert_eq!(report.get("transformations"), None, "{report}");
}

#[test]
fn columns_of_degrees_are_no_coordinates_of_a_map_and_latitudes_end_at_the_poles() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, header: &str, order: [usize; 2]| {
        let mut rows = format!("{header}\n");
        places(0).iter().for_each(|p| writeln!(rows, "{:.8},{:.8},{:.2}", p[order[0]], p[order[1]], p[2]).unwrap());
        let path = folder.path().join(name);
        fs::write(&path, rows).unwrap();
        path
    };
    let named = write("named.csv", "lat,lon,z", [1, 0]);
    for lines in ["missing_crs = \"EPSG:26915\"", "crs = \"EPSG:26915\""] {
        for more in ["", "\nto_crs = \"EPSG:26916\"", "\nto_crs = \"EPSG:26915\""] {
            let run = Job::on(&[&named]).with("input", &format!("{lines}{more}")).run();
            run.refused(2, &["named.csv", "named as degrees", "unit"]);
        }
    }
    // With a unit, the user says that they are none.
    let metres = "crs = \"EPSG:26915\"\nunit = \"metre\"\noutside_crs_area = \"warn\"";
    Job::on(&[&named]).with("input", metres).run().succeeded();
    let swapped = write("swapped.csv", "x,y,z", [1, 0]);
    // The middle lies at 90 degrees west.
    let fit = fs::read_to_string(&swapped).unwrap().replace(",-9", ",-19").replace(",-8", ",-18");
    fs::write(&swapped, fit).unwrap();
    for to in ["utm", "EPSG:26915"] {
        let lines = format!("missing_crs = \"EPSG:4269\"\nto_crs = \"{to}\"");
        Job::on(&[&swapped]).with("input", &lines).run().refused(2, &["swapped.csv", "end at 90 degrees", "exchanged"]);
    }
    let lengths = write("lengths.csv", "x [m],y [m],z [m]", [0, 1]);
    let lines = "missing_crs = \"EPSG:4269\"\nto_crs = \"EPSG:3857\"\ndatums = \"close\"";
    let said = warnings(&Job::on(&[&lengths]).with("input", lines).report());
    assert!(said.contains("name the unit metre") && said.contains("0.71 m on the ground"), "{said}");
}

#[test]
fn a_stray_row_in_degrees_is_left_out_as_one_in_metres_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut rows = String::from("x,y,z\n");
    places(0).iter().for_each(|[x, y, z]| writeln!(rows, "{x:.8},{y:.8},{z:.2}").unwrap());
    rows.push_str("0,0,0\n");
    let path = folder.path().join("stray.csv");
    fs::write(&path, rows).unwrap();
    let job = |line: &str| {
        let lines = format!("missing_crs = \"EPSG:4269\"\nto_crs = \"EPSG:26915\"\n{line}");
        Job::on(&[&path]).with("input", &lines)
    };
    job("").run().refused(3, &["stray.csv", "0,0,0"]);
    let few = job("max_malformed_fraction = 0.01");
    let report = few.report();
    assert_eq!((number(&report["points"]["malformed"]), report["lattice"]["resolution"].as_str()), (1, Some("0.001")));
    gdt_batch(few.folder(), &["verify", "out", "--input", path.to_str().unwrap()]).succeeded();
}

#[test]
fn a_cloud_on_both_sides_of_the_date_line_is_no_cloud_at_its_middle() {
    let folder = tempfile::tempdir().unwrap();
    let row = |[x, y, z]: [f64; 3]| [if x < -90.0 { x - 89.999 } else { x + 269.999 }, y, z];
    let rows: Vec<[f64; 3]> = places(0).into_iter().map(row).collect();
    let file = las_of(folder.path(), &rows, "line.las", &[keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4326]])], 1e-6);
    let to = |crs: &str| Job::on(&[&file]).with("input", &format!("to_crs = \"{crs}\""));
    to("utm").run().refused(2, &["line.las", "date line", "name the zone"]);
    let near = to("EPSG:32601").report();
    assert_eq!(number(&near["points"]["kept"]), rows.len() as u64);
    let said = warnings(&near);
    assert!(said.contains("about 0.1 m on the ground") && !said.contains("date line"), "{said}");
    let said = to("EPSG:3857").run_with(&["check"]).succeeded().out;
    assert!(said.contains("both ends of WGS 84 / Pseudo-Mercator"), "{said}");
}

#[test]
fn bounds_hold_before_the_step_of_the_lattice() {
    let folder = tempfile::tempdir().unwrap();
    let way = crate::transformed::way("EPSG:4269", "EPSG:26915");
    let there: Vec<[f64; 3]> =
        places(0).into_iter().map(|[x, y, z]| way.apply([x, y]).map(|[x, y]| [x, y, z]).unwrap()).collect();
    let degrees =
        las_of(folder.path(), &places(0), "degrees.las", &[keys(&[[1024, 0, 1, 2], [2048, 0, 1, 4269]])], 1e-9);
    let metres = las_of(folder.path(), &there, "metres.las", &[code(26915)], 0.001);
    let middle = way.apply([-90.0, 45.0]).unwrap().map(f64::round);
    let bounds = format!(
        "bounds = [{}, {}, {}, {}]\nresolution = 4.0",
        middle[0] - 19.0,
        middle[1] - 19.0,
        middle[0] + 3.0,
        middle[1] + 3.0
    );
    let kept = |file, line: &str| {
        let report = Job::on(&[file]).with("input", &format!("{bounds}\n{line}")).report();
        number(&report["points"]["kept"])
    };
    assert_eq!(kept(&degrees, "to_crs = \"EPSG:26915\""), kept(&metres, ""));
}
