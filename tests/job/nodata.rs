//! Heights that stand for "nothing measured", such as -9999: they are left out where they are sure, and refused where they are doubtful.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::las_file::LasFile;
use crate::program::{Job, gdt_batch, number};

/// Points of a made grid.
const POINTS: usize = 1000;

/// Every so many points have no height.
const EVERY: usize = 50;

/// Heights in centimetres of a slope from 1500 m on.
fn slope(i: usize) -> i32 {
    150_000 + (i * 37 % 900) as i32 + 2 * i as i32
}

fn has_no_height(i: usize) -> bool {
    i % EVERY == 6
}

struct Files(tempfile::TempDir);

impl Files {
    fn new() -> Files {
        Files(tempfile::tempdir().unwrap())
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }

    /// Writes a grid as text, with `mark` where there is no height.
    fn text(&self, mark: &str, is_marked: impl Fn(usize) -> bool) -> PathBuf {
        let row = |i: usize| {
            let height = if is_marked(i) { mark.to_owned() } else { format!("{:.2}", f64::from(slope(i)) / 100.0) };
            format!("{} {} {height}\n", 400_000 + 2 * (i % 50), 5_000_000 + 2 * (i / 50))
        };
        self.write("grid.xyz", (0..POINTS).map(row).collect::<String>())
    }

    /// Writes the same grid as LAS, or as LAZ, in centimetres. The header claims heights between `claimed`.
    fn las(&self, name: &str, mark: i32, claimed: [f64; 2]) -> PathBuf {
        let record = |i: usize| {
            let height = if has_no_height(i) { mark } else { slope(i) };
            let place = [200 * (i % 50) as i32, 200 * (i / 50) as i32, height];
            let mut record: Vec<u8> = place.iter().flat_map(|raw| raw.to_le_bytes()).collect();
            record.extend([0, 0, 0b1001, 2, 0, 0, 0, 0]);
            record
        };
        let records = (0..POINTS).flat_map(record).collect();
        let file = LasFile { minor: 2, format: 0, extra: 0, stray: 0, records };
        let mut bytes = if name.ends_with("laz") { file.laz(&[500; 2], false) } else { file.las() };
        let [low, high] = claimed;
        let claims = [500_098.0, 500_000.0, 4_000_098.0, 4_000_000.0, high, low];
        bytes[179..227].copy_from_slice(&claims.map(f64::to_le_bytes).concat());
        self.write(name, bytes)
    }
}

/// Runs a job, and asserts that it left out all points without a height, and that its mesh is that of the others.
#[track_caller]
fn left_out(path: &PathBuf, options: &[&str]) -> Value {
    let job = options.iter().fold(Job::on(&[path]), |job, option| job.with("input", option));
    let report = job.report();
    let points = &report["points"];
    let (kept, nodata) = ((POINTS - POINTS / EVERY) as u64, (POINTS / EVERY) as u64);
    assert_eq!(["kept", "nodata", "malformed"].map(|name| number(&points[name])), [kept, nodata, 0], "{points}");
    assert_eq!(report["lattice"]["resolution_z"], "0.01");
    let input = path.to_str().unwrap();
    let verdict = gdt_batch(job.folder(), &["verify", "out", "--json", "--input", input]).succeeded().json();
    assert_eq!(verdict["failures"], serde_json::json!([]));
    report
}

fn warnings(report: &Value) -> String {
    report["warnings"].to_string()
}

#[test]
fn numbers_for_nodata_in_a_text_are_left_out() {
    for mark in
        ["-9999", "-9999.000", "-32768", "-99999.0", "9999", "-3.4028235e38", "-3.40282346638529E+38", "1e20", "1e+30"]
    {
        let files = Files::new();
        let warnings = warnings(&left_out(&files.text(mark, has_no_height), &[]));
        // No option keeps a height that no lattice holds.
        let remedy = if mark.contains(['e', 'E']) { "left out" } else { "[input] nodata = " };
        for words in ["grid.xyz: 20 lines have the height", "the first is line 7", remedy] {
            assert!(warnings.contains(words), "{mark}: {words:?} in {warnings}");
        }
    }
}

#[test]
fn one_number_for_nodata_is_left_out() {
    let files = Files::new();
    let report = Job::on(&[files.text("-9999", |i| i == 804)]).report();
    assert_eq!(number(&report["points"]["nodata"]), 1);
    assert!(
        warnings(&report).contains("line 805 has the height -9999, far from all others: treated as nodata"),
        "{report}"
    );
}

#[test]
fn numbers_for_nodata_that_a_header_claims_are_left_out() {
    let files = Files::new();
    for (name, mark, low) in [
        ("a.las", -999_900, -9999.0),
        ("b.las", -3_276_800, -32768.0),
        ("c.las", i32::MIN, -21_474_836.48),
        ("d.laz", -999_900, -9999.0),
    ] {
        let report = left_out(&files.las(name, mark, [low, 1560.0]), &[]);
        let warnings = warnings(&report);
        assert!(
            warnings.contains(&format!("{name}: 20 points have the height {low} (the first is point 6)")),
            "{warnings}"
        );
    }
}

#[test]
fn nodata_that_a_header_hides_is_refused_until_an_option_decides() {
    let files = Files::new();
    let path = files.las("a.las", -999_900, [1500.0, 1560.0]);
    let words = ["a.las", "the height -9999", "[input] nodata = -9999", "\"none\""];
    for command in ["check", "run"] {
        let job = Job::on(&[&path]);
        let said = if command == "run" { job.run() } else { job.run_with(&["check"]) };
        said.refused(3, &words);
    }
    left_out(&path, &["nodata = -9999"]);
    let report = Job::on(&[&path]).with("input", "nodata = \"none\"").report();
    assert_eq!(number(&report["points"]["kept"]), POINTS as u64);
}

#[test]
fn another_height_that_many_points_share_far_from_all_others_is_doubtful() {
    let files = Files::new();
    let inputs =
        [files.text("0", has_no_height), files.las("a.las", 0, [0.0, 1560.0]), files.las("b.laz", 0, [1500.0, 1560.0])];
    for path in inputs {
        let words = ["20 ", "have the height 0", "between 150", "[input] nodata = 0", "\"none\""];
        Job::on(&[&path]).run().refused(3, &words);
        Job::on(&[&path]).run_with(&["check"]).refused(3, &words);
        let report = left_out(&path, &["nodata = 0"]);
        assert!(!warnings(&report).contains("nodata"), "{report}");
        let report = Job::on(&[&path]).with("input", "nodata = \"none\"").report();
        assert_eq!(number(&report["points"]["kept"]), POINTS as u64);
    }
}

#[test]
fn the_sea_and_low_ground_are_heights() {
    let files = Files::new();
    let coast = |i: usize| format!("{} {} {}\n", i % 50, i / 50, (i / 50).saturating_sub(8) * 9);
    for path in
        [files.write("coast.xyz", (0..POINTS).map(coast).collect::<String>()), files.text("1498.2", has_no_height)]
    {
        let report = Job::on(&[&path]).report();
        assert_eq!((number(&report["points"]["nodata"]), number(&report["points"]["kept"])), (0, POINTS as u64));
        assert!(!warnings(&report).contains("nodata"), "{report}");
    }
}

#[test]
fn tasks_and_bounds_leave_out_the_same() {
    let files = Files::new();
    let path = files.text("-9999", has_no_height);
    let whole = Job::on(&[&path]).tiles_of(200).digest();
    assert_eq!(Job::on(&[&path]).tiles_of(700).threads(1).digest(), whole);
    let bounds = "bounds = [400000.0, 5000000.0, 400100.0, 5000018.0]";
    let report = Job::on(&[&path]).with("input", bounds).report();
    let points = &report["points"];
    assert_eq!((number(&points["nodata"]), number(&points["out_of_bounds"])), (10, 500), "{points}");
}

#[test]
fn a_file_of_nodata_alone_leaves_no_point() {
    let files = Files::new();
    let path = files.text("-9999", |_| true);
    Job::on(&[&path]).run().refused(3, &["no point is left", "1000 nodata", "nodata = \"none\""]);
}

/// Writes 900 rows with heights from `low` on, in a range of so many hundredths, and this height in every 30th.
fn rows(files: &Files, name: &str, header: &str, [low, range]: [i32; 2], mark: &str) -> PathBuf {
    let row = |i: usize| {
        let height = f64::from(low) + f64::from((i as i32 * 37) % range) / 100.0;
        let height = if i % 30 == 7 { mark.to_string() } else { format!("{height:.2}") };
        format!("{},{},{height}\n", 400_000 + 2 * (i % 30), 5_000_000 + 2 * (i / 30))
    };
    files.write(name, header.to_string() + &(0..900).map(row).collect::<String>())
}

#[test]
fn a_usual_number_across_a_gap_is_told_at_any_share() {
    let files = Files::new();
    let valley = |i: usize| 39.9 + (i * 37 % 562) as f64 / 10.0;
    let told = |share: usize, mark: f64, height: &dyn Fn(usize) -> f64| {
        let row = |i: usize| {
            let height = if i * 7 % 100 < share { mark } else { height(i) };
            format!("{} {} {height:.1}\n", 400_000 + 25 * (i % 30), 5_000_000 + 25 * (i / 30))
        };
        let path = files.write("clip.xyz", (0..900).map(row).collect::<String>());
        let checked = Job::on(&[&path]).run_with(&["check", "--json"]).succeeded().json();
        warnings(&checked).contains("may stand for nodata; fix: [input] nodata")
    };
    for share in [3, 30, 58] {
        assert!(told(share, 0.0, &valley) && told(share, 255.0, &valley), "{share}");
        // The sea beside a shore, a polder, whole metres beside the sea.
        assert!(!told(share, 0.0, &|i| valley(i) - 39.8), "{share}");
        assert!(!told(share, 0.0, &|i| valley(i) - 60.0), "{share}");
        assert!(!told(share, 0.0, &|i| (valley(i) - 38.0).floor()), "{share}");
        // A lake at one height in a country around it.
        assert!(!told(share, 52.0, &valley), "{share}");
    }
}

#[test]
fn a_height_far_below_all_others_for_their_range_is_told() {
    let files = Files::new();
    let told = |path: &PathBuf| warnings(&Job::on(&[path]).report()).contains("may stand for nodata");
    for (low, range, mark, is_told) in [
        (85, 1001, "0", true),
        (60, 200, "0", true),
        (60, 1000, "0", true),
        (30, 4500, "0", true),
        (17, 3200, "255", true),
        (17, 3200, "400", true),
        (60, 4500, "32", false),
        (17, 3200, "65", false),
        (3, 20, "0", false),
        (60, 200, "52", false),
    ] {
        let path = rows(&files, "a.csv", "", [low, range], mark);
        assert_eq!(told(&path), is_told, "{low} {range} {mark}");
    }
    let path = rows(&files, "a.csv", "", [60, 200], "0");
    for choice in ["nodata = 0", "nodata = \"none\""] {
        let report = Job::on(&[&path]).with("input", choice).report();
        assert!(!warnings(&report).contains("nodata"), "{report}");
    }
    // In millimetres and in centimetres.
    for (unit, low) in [("mm", 500), ("cm", 200)] {
        let header = format!("x [{unit}],y [{unit}],z [{unit}]\n");
        let path = rows(&files, "a.csv", &header, [low, 6000], "30");
        assert!(!told(&path), "{unit}");
    }
}

#[test]
fn a_number_too_large_for_a_height_is_nodata_if_it_is_named_or_known() {
    let files = Files::new();
    for (mark, options) in
        [("9.96921e+36", &[][..]), ("9.96921e+36", &["nodata = 9.96921e36"]), ("1.5e25", &["nodata = 1.5e25"])]
    {
        left_out(&files.text(mark, has_no_height), options);
    }
    let path = files.text("9.96921e+36", has_no_height);
    let report = Job::on(&[&path]).report();
    assert!(!warnings(&report).contains("\\\"none\\\" keeps"), "{report}");
    Job::on(&[&path]).with("input", "nodata = \"none\"").run().refused(3, &["too large"]);
    Job::on(&[&files.text("1.5e25", has_no_height)]).run().refused(3, &["too large"]);
}

#[test]
fn real_points_that_nodata_leaves_out_are_told() {
    let files = Files::new();
    let peaks = files.las("peaks.las", 0, [0.0, 1560.0]);
    let coast = |i: usize| format!("{} {} {}\n", 400_000 + i % 50, 5_000_100 + i / 50, (i / 50).saturating_sub(8) * 2);
    let coast = files.write("coast.xyz", (0..POINTS).map(coast).collect::<String>());
    let report = Job::on(&[&peaks, &coast]).with("input", "nodata = 0").report();
    let warnings = warnings(&report);
    assert!(
        warnings.contains("coast.xyz: 450 lines have the height 0 (the first is line 1), which [input] nodata"),
        "{warnings}"
    );
    assert!(!warnings.contains("peaks.las: "), "{warnings}");
    let low = files.las("low.las", 150_000, [1500.0, 1560.0]);
    let report = Job::on(&[&low]).with("input", "nodata = 1500").report();
    // The marks, and point 0, which really lies there.
    assert!(report["warnings"].to_string().contains("low.las: 21 points have the height 1500"), "{report}");
}

#[test]
fn points_of_one_height_are_told() {
    let files = Files::new();
    let flat = |i: usize| format!("{} {} -99\n", i % 50, i / 50);
    let path = files.write("flat.xyz", (0..POINTS).map(flat).collect::<String>());
    let report = Job::on(&[&path]).report();
    assert!(warnings(&report).contains("all 1000 points have the height -99, so the terrain is flat"), "{report}");
    let inclined = |i: usize| format!("{} {} {}\n", i % 50, i / 50, i % 50);
    let path = files.write("plane.xyz", (0..POINTS).map(inclined).collect::<String>());
    assert!(!warnings(&Job::on(&[&path]).report()).contains("flat"));
}

#[test]
fn init_offers_what_the_message_names() {
    let files = Files::new();
    let path = files.las("a.las", -999_900, [1500.0, 1560.0]);
    let output = path.with_file_name("job.toml");
    let made = gdt_batch(path.parent().unwrap(), &["init", "a.las"]);
    made.refused(3, &["is written, but its job would stop", "the height -9999"]);
    let text = fs::read_to_string(&output).unwrap();
    assert!(text.contains("\n#nodata = -9999\n"), "{text}");
    fs::write(&output, text.replace("#nodata", "nodata")).unwrap();
    gdt_batch(path.parent().unwrap(), &["check", "job.toml"]).succeeded();
}
