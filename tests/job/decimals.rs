//! Texts with more decimals than a lattice holds, with noise, with rows far from all others: the step is what the data mean.

use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::program::{Job, gdt_batch, number};
use crate::random::Random;

/// Coordinates in UTM with this many decimals, over a square of `size` metres.
fn random_text(count: usize, decimals: usize, size: f64) -> String {
    let mut random = Random(5);
    let mut text = String::from("x,y,z\n");
    for _ in 0..count {
        let [x, y, z] = [(565_000.0, size), (5_933_000.0, size), (10.0, 50.0)]
            .map(|(from, size): (f64, f64)| from + size * random.unit());
        writeln!(text, "{x:.decimals$},{y:.decimals$},{z:.decimals$}").unwrap();
    }
    text
}

/// Centimetres on 300 m, as `print` writes them.
fn centimetres(count: usize, print: impl Fn(f64) -> String) -> String {
    let mut random = Random(7);
    let mut text = String::from("x,y,z\n");
    for _ in 0..count {
        let row = [(56_500_000, 30_000), (593_300_000, 30_000), (1_000, 4_000)]
            .map(|(from, size)| print((from + random.below(size) as i64) as f64 / 100.0));
        writeln!(text, "{}", row.join(",")).unwrap();
    }
    text
}

fn plain(value: f64) -> String {
    format!("{value:.2}")
}

struct Text {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Text {
    fn new(content: &str) -> Text {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.csv");
        fs::write(&path, content).unwrap();
        Text { _folder: folder, path }
    }

    fn job(&self) -> Job {
        Job::on(&[&self.path])
    }
}

#[track_caller]
fn steps(report: &Value) -> [&str; 2] {
    ["resolution", "resolution_z"].map(|name| report["lattice"][name].as_str().unwrap())
}

/// Runs `check` and the job. Asserts that they agree, and that the mesh is exact. Returns the report and the digest.
#[track_caller]
fn run(job: &Job) -> (Value, String) {
    let check = job.run_with(&["check", "--json"]).succeeded().json();
    let report = job.report();
    assert_eq!([check["resolution"][0].as_str().unwrap(), check["resolution"][1].as_str().unwrap()], steps(&report));
    assert_eq!(number(&report["points"]["malformed"]), 0, "{report}");
    (report, job.verified()["digest"].as_str().unwrap().to_owned())
}

#[test]
fn texts_with_many_decimals_are_read_on_a_coarser_lattice() {
    for (decimals, size, expected) in
        [(8, 100.0, "0.00001"), (7, 1_000.0, "0.0001"), (6, 5_000.0, "0.001"), (5, 100_000.0, "0.01")]
    {
        let text = Text::new(&random_text(500, decimals, size));
        let job = text.job();
        let (report, _) = run(&job);
        let name = format!("{decimals} decimals over {size} m");
        assert_eq!(number(&report["points"]["kept"]), 500, "{name}");
        assert_eq!(steps(&report)[0], expected, "{name}");
        assert!(report["warnings"].to_string().contains("x and y are rounded to"), "{name}: {}", report["warnings"]);
        let check = job.run_with(&["check", "--json"]).succeeded().json();
        let width = check["size"][0].as_f64().unwrap();
        assert!(width > 0.9 * size && width <= size, "{name}: check says {width} m");
    }
}

#[test]
fn noise_of_floating_point_printing_is_no_precision() {
    let clean = centimetres(300, plain);
    let (report, digest) = run(&Text::new(&clean).job());
    assert_eq!(steps(&report), ["0.01", "0.01"]);
    let last = clean.trim_end().rfind('\n').unwrap() + 1;
    let mut row: Vec<String> = clean[last..].trim_end().split(',').map(str::to_owned).collect();
    let next = |text: &str| f64::from_bits(text.parse::<f64>().unwrap().to_bits() + 1).to_string();
    row[0] = next(&row[0]);
    row[2] = next(&row[2]);
    let one = format!("{}{}\n", &clean[..last], row.join(","));
    let exponents = centimetres(300, |value| {
        let text = format!("{value:.18e}");
        let (digits, power) = text.split_once('e').unwrap();
        format!("{digits}e+{power:0>2}")
    });
    let neighbours = centimetres(300, |value| format!("{}", f64::from_bits(value.to_bits() - 1)));
    for (name, text) in [("one noisy value", one), ("%.18e", exponents), ("neighbours", neighbours)] {
        let (report, noisy) = run(&Text::new(&text).job());
        assert_eq!(steps(&report), ["0.01", "0.01"], "{name}");
        assert_eq!(noisy, digest, "{name}");
        assert!(report["warnings"].to_string().contains("more digits than floating point holds"), "{name}");
    }
}

#[test]
fn single_precision_printed_in_full_is_as_coarse_as_it_is() {
    let mut random = Random(9);
    let mut text = String::from("x y z\n");
    for _ in 0..300 {
        let [x, y, z] = [(); 3].map(|()| (100_000 + random.below(900_000)) as f32 / 1000.0).map(f64::from);
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    let (report, _) = run(&Text::new(&text).job());
    assert_eq!(steps(&report), ["0.001", "0.001"], "{}", report["warnings"]);
}

#[test]
fn an_outlier_is_told_from_the_rest() {
    let clean = centimetres(300, plain);
    let (_, digest) = run(&Text::new(&clean).job());
    for (outlier, keeps) in
        [("0,0,0", "resolution = 1"), ("565100.25,5933100.5,9e9", "resolution_z = 10000"), ("9e16,1,1", "")]
    {
        let text = Text::new(&format!("{clean}{outlier}\n"));
        let words = &["1 of 301 records", "line 302", "far from all other rows", "max_malformed_fraction"];
        text.job().run().refused(3, words);
        text.job().run_with(&["check"]).refused(3, words);
        let without = text.job().with("input", "max_malformed_fraction = 0.01");
        let report = without.report();
        assert_eq!((number(&report["points"]["malformed"]), steps(&report)), (1, ["0.01", "0.01"]), "{outlier}");
        assert_eq!(without.verified()["digest"].as_str(), Some(digest.as_str()), "{outlier}");
        if !keeps.is_empty() {
            let (report, _) = run(&text.job().with("input", keeps));
            assert_eq!(number(&report["points"]["kept"]), 301, "{outlier}");
        }
    }
    // Where one lattice holds all, nothing is left out.
    let (report, _) = run(&Text::new(&format!("{clean}570000.25,5933000.5,3\n")).job());
    assert_eq!((number(&report["points"]["kept"]), steps(&report)[0]), (301, "0.01"));
}

/// The step of so wide a text depends on the mesh, which is known only later.
#[test]
fn an_outlier_of_a_wide_text_is_told_from_the_rest() {
    let mut random = Random(4);
    let mut text = String::new();
    for _ in 0..3000 {
        let [x, y, z] = [(); 3].map(|()| random.below(20_000_000) as f64 / 100.0);
        writeln!(text, "{:.2},{:.2},{:.2}", 400_000.0 + x, 5_500_000.0 + y, z / 400.0).unwrap();
    }
    Text::new(&format!("{text}0,0,0\n"))
        .job()
        .run()
        .refused(3, &["1 of 3001 records", "line 3001", "far from all other rows"]);
    // The mesh proves too fine for the step that `check` names.
    let report = Text::new(&text).job().report();
    assert_eq!((number(&report["points"]["kept"]), steps(&report)[0]), (3000, "0.1"));
}

#[test]
fn outliers_of_a_long_text_are_told_wherever_they_are() {
    let clean = centimetres(150_000, plain);
    let middle = clean[..clean.len() / 2].rfind('\n').unwrap() + 1;
    let text = Text::new(&format!("{}0,0,0\n{}0.00,0.00,0.00\n", &clean[..middle], &clean[middle..]));
    text.job().run_with(&["check"]).refused(3, &["2 of 150002 records"]);
    let (_, digest) = run(&Text::new(&clean).job());
    assert_eq!(text.job().with("input", "max_malformed_fraction = 0.01").digest(), digest);
}

#[test]
fn a_terrestrial_scan_has_no_outliers() {
    let mut random = Random(11);
    let mut scan = |decimals: usize| -> String {
        let row = |()| {
            // As dense as 1/r^2 along the ground, up to 900 m.
            let (r, angle) = (1.5 / (1.0 - random.unit() * (1.0 - 1.5 / 900.0)), random.unit() * std::f64::consts::TAU);
            let [x, y] = [565_000.0 + r * f64::cos(angle), 5_933_000.0 + r * f64::sin(angle)];
            format!("{x:.decimals$} {y:.decimals$} {:.decimals$}\n", 3.0 * random.unit())
        };
        (0..5000).map(|_| ()).map(row).collect()
    };
    let text = Text::new(&format!("{}565880.5 5933000.5 1\n", scan(8)));
    let (report, _) = run(&text.job());
    assert_eq!((number(&report["points"]["kept"]), steps(&report)[0]), (5001, "0.001"), "{report}");
}

#[test]
fn a_row_of_a_few_is_no_outlier_unless_it_spoils_the_rest() {
    let few = "0.001 0 0\n10.002 0 1\n5 10 1.003\n5 5 1\n2 8 1\n3 3 3\n";
    let text = Text::new(&format!("{few}100000 500 3\n"));
    let (report, _) = run(&text.job());
    assert_eq!(number(&report["points"]["kept"]), 7);
    let text = Text::new(&format!("{few}9e14 500000 3\n"));
    text.job().run().refused(3, &["1 of 7 records", "far from all other rows"]);
}

#[test]
fn what_to_do_about_outliers_is_said_once() {
    let text = Text::new(&format!("{}{}", centimetres(300, plain), "0,0,0\n".repeat(5)));
    let said = text.job().run();
    assert_eq!(said.code, 3, "{}", said.err);
    assert_eq!(said.err.matches("far from all other rows").count(), 5, "{}", said.err);
    assert_eq!(said.err.matches("leave such rows out with [input] bounds").count(), 1, "{}", said.err);
}

#[test]
fn bounds_hold_for_the_numbers_in_the_text() {
    let clean = centimetres(300, plain);
    let bounds = "bounds = [565000.0, 5933000.0, 565150.0, 5934000.0]";
    let (before, digest) = run(&Text::new(&clean).job().with("input", bounds));
    let text = Text::new(&format!("{clean}565150.004,5933050.00,1.00\n564999.996,5933050.00,1.00\n"));
    let job = text.job().with("input", bounds);
    let (report, found) = run(&job);
    assert_eq!(report["points"]["kept"], before["points"]["kept"]);
    assert_eq!(number(&report["points"]["out_of_bounds"]), number(&before["points"]["out_of_bounds"]) + 2);
    assert_eq!(found, digest);
    let output = job.out();
    let args = ["verify", output.to_str().unwrap(), "--input", text.path.to_str().unwrap()];
    gdt_batch(job.folder(), &args).succeeded();
}

#[test]
fn texts_have_no_headers_that_say_where_they_lie() {
    let said = Text::new(&centimetres(50, plain)).job().with("input", "bounds = [0.0, 0.0, 1.0, 1.0]").run();
    assert!(said.err.contains("the inputs lie in [565") && !said.err.contains("header"), "{}", said.err);
}

#[test]
fn two_places_are_no_outliers() {
    let far: String = centimetres(300, |value| format!("{:.2}", value + 4e6)).split_once('\n').unwrap().1.to_owned();
    let text = Text::new(&(centimetres(300, plain) + &far));
    let report = text.job().report();
    text.job().run_with(&["check"]).succeeded();
    assert_eq!(number(&report["points"]["kept"]), 600);
    assert!(report["warnings"].to_string().contains("x and y are rounded to"), "{report}");
}

#[test]
fn rows_that_are_filtered_out_have_no_say_about_the_lattice() {
    let clean = centimetres(300, plain);
    let (_, digest) = run(&Text::new(&clean).job());
    let bounds = "bounds = [564000.0, 5932000.0, 566000.0, 5934000.0]";
    for row in ["9e16,1,1", "0,0,0", "12345.123456789,1.5,1", "1e17,1e17,1e17"] {
        let (report, found) = run(&Text::new(&format!("{clean}{row}\n")).job().with("input", bounds));
        assert_eq!(number(&report["points"]["out_of_bounds"]), 1, "{row}");
        assert_eq!((steps(&report), found), (["0.01", "0.01"], digest.clone()), "{row}");
    }
    let with_class: String = clean.lines().skip(1).map(|row| format!("{row},2\n")).collect();
    let text = Text::new(&format!("x,y,z,class\n{with_class}9e16,0.123456789,7,7\n"));
    let (report, found) = run(&text.job());
    assert_eq!(number(&report["points"]["other_class"]), 1);
    assert_eq!((steps(&report), found), (["0.01", "0.01"], digest));
}

#[test]
fn the_step_in_z_can_be_set() {
    let text = Text::new(&random_text(300, 3, 100.0));
    let (report, _) = run(&text.job().with("input", "resolution_z = 0.1"));
    assert_eq!(steps(&report), ["0.001", "0.1"]);
    assert!(number(&report["points"]["rounded_z"]) > 200, "{report}");
    text.job().with("input", "resolution_z = 1e-9").run().refused(2, &["resolution_z = 0.000000001", "too fine"]);
    text.job().with("input", "resolution_z = 0").run().refused(2, &["resolution"]);
}

#[test]
fn real_points_keep_their_step_beside_noise_and_mistakes() {
    let Some(shared) = crate::common::shared() else { return };
    let clean = fs::read_to_string(shared.join("data/topography.csv")).unwrap();
    let (report, digest) = run(&Text::new(&clean).job());
    assert_eq!(steps(&report)[0], "0.00025");
    let text = Text::new(&format!("{}\n0,0,0\n", clean.trim_end()));
    text.job().run().refused(3, &["1 of 73404 records", "line 73405", "0,0,0"]);
    assert_eq!(text.job().with("input", "max_malformed_fraction = 0.001").digest(), digest);
}

#[test]
fn an_outlier_within_the_bounds_is_malformed() {
    let Some(shared) = crate::common::shared() else { return };
    let clean = fs::read_to_string(shared.join("data/topography.csv")).unwrap();
    let text = Text::new(&format!("{}\n0,0,0\n", clean.trim_end()));
    let job = || text.job().with("input", "bounds = [-1.0, -1.0, 1e7, 1e7]");
    job().run().refused(3, &["1 of 73404 records", "line 73405", "0,0,0"]);
    let report = job().with("input", "max_malformed_fraction = 0.001").report();
    assert_eq!([&report["points"]["malformed"], &report["points"]["out_of_bounds"]].map(number), [1, 0]);
}

#[test]
fn a_text_that_was_cut_off_is_refused() {
    let clean = centimetres(300, plain);
    for cut in [2, 3, 4, 5] {
        let text = Text::new(&clean[..clean.len() - cut]);
        for run in [text.job().run(), text.job().run_with(&["check"])] {
            run.refused(3, &["line 301", "no line end", "cut off"]);
        }
        let report = text.job().with("input", "max_malformed_fraction = 0.01").report();
        assert_eq!((number(&report["points"]["malformed"]), number(&report["points"]["kept"])), (1, 299));
    }
    run(&Text::new(clean.trim_end()).job());
    run(&Text::new(&format!("{}\n# end", clean.trim_end())).job());
}

#[test]
fn degrees_are_refused_by_the_names_of_columns() {
    let mut random = Random(3);
    let rows: String = (0..50)
        .map(|_| {
            format!("{:.7},{:.7},{}\n", 9.0 + random.unit() / 100.0, 48.0 + random.unit() / 100.0, random.below(90))
        })
        .collect();
    for header in [
        "longitude,latitude,height",
        "lon,lat,z",
        "X [deg],Y [deg],Z",
        "X (lon),Y (lat),Z",
        "X (longitude),Y (latitude),Elevation",
        "x [Longitude],y [Latitude],z [m]",
        "x (lng),y (lat),z",
        "Easting (lon),Northing (lat),z",
        "x (degrees east),y (degrees north),z",
        "x,y,z\ndeg E,deg N,m",
    ] {
        let text = Text::new(&format!("{header}\n{rows}"));
        text.job().run().refused(2, &["cloud.csv", "degrees", "to_crs", "unit"]);
        text.job().with("input", "unit = \"metre\"").run().refused(2, &["degrees", "unit is metre"]);
        run(&text.job().with("input", "crs = \"none\"\nunit = \"metre\""));
        run(&text.job().with("input", "crs = \"none\""));
    }
    // Metres may begin at zero.
    let local: String = (0..50).map(|i| format!("{},{},1\n", i * 1000, i * i % 50 * 1000)).collect();
    run(&Text::new(&format!("lon,lat,z\n{local}")).job());
    // A few rows that are mistakes do not make metres of degrees, wherever they lie.
    for stray in ["565000,5933000,1", "-9999,-9999,-9999", "9,91,1"] {
        let text = Text::new(&format!("lon,lat,h\n{rows}{stray}\n"));
        text.job().run().refused(2, &["degrees"]);
        text.job().with("input", "bounds = [9.0, 48.0, 10.0, 49.0]").run().refused(2, &["degrees"]);
    }
    run(&Text::new(&format!("x,y,z\n{rows}")).job());
    let metres = centimetres(50, plain).replace("x,y,z", "lon,lat,z");
    run(&Text::new(&metres).job());
    run(&Text::new(&format!("{metres}0,0,0\n")).job().with("input", "resolution = 1\nresolution_z = 1"));
}

#[test]
fn colours_that_cannot_be_read_do_not_stop_a_job() {
    let rows: String = centimetres(50, plain).lines().skip(1).map(|row| format!("{row},red,-5,0x1\n")).collect();
    let text = Text::new(&format!("x,y,z,r,g,b\n{rows}"));
    let (report, _) = run(&text.job());
    assert!(report["warnings"].to_string().contains("and are ignored"), "{report}");
    run(&text.job().with("output", "color = \"elevation\""));
}
