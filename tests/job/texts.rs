//! Texts as people have them: mistakes among few rows, bounds between lattice points, degrees, classes, decimal commas.

use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::program::{Job, gdt_batch, number};
use crate::random::Random;

/// Centimetres on 100 m, with this delimiter and this sign before decimals.
fn rows(count: usize, seed: u64, delimiter: &str, sign: &str) -> String {
    let mut random = Random(seed);
    let mut text = String::new();
    for _ in 0..count {
        let row = [(565_000, 100), (5_933_000, 100), (10, 8)].map(|(from, size)| {
            let cents = random.below(size * 100);
            format!("{}{sign}{:02}", from + cents / 100, cents % 100)
        });
        writeln!(text, "{}", row.join(delimiter)).unwrap();
    }
    text
}

fn plain(count: usize) -> String {
    rows(count, 11, " ", ".")
}

struct Texts {
    _folder: tempfile::TempDir,
    paths: Vec<PathBuf>,
}

impl Texts {
    fn new(contents: &[String]) -> Texts {
        let folder = tempfile::tempdir().unwrap();
        let paths: Vec<PathBuf> = (0..contents.len()).map(|i| folder.path().join(format!("{i}.txt"))).collect();
        paths.iter().zip(contents).for_each(|(path, content)| fs::write(path, content).unwrap());
        Texts { _folder: folder, paths }
    }

    fn one(content: &str) -> Texts {
        Texts::new(&[content.to_owned()])
    }

    fn job(&self) -> Job {
        let paths: Vec<&std::path::Path> = self.paths.iter().map(PathBuf::as_path).collect();
        Job::on(&paths)
    }
}

fn step(report: &Value) -> &str {
    report["lattice"]["resolution"].as_str().unwrap()
}

fn warnings(report: &Value) -> String {
    report["warnings"].to_string()
}

#[test]
fn one_mistake_among_few_rows_does_not_round_all_others_to_a_metre() {
    for content in [
        plain(20) + "0 0 0\n",
        plain(49) + "0 0 0\n",
        rows(30, 3, " ", ".").replace("565", "2600").replace("5933", "1200") + "0 0 0\n",
        // Rows at one place are one mistake.
        plain(500) + &"0 0 0\n".repeat(11),
    ] {
        let texts = Texts::one(&content);
        let words = &["far from all other rows", "0 0 0", "max_malformed_fraction"];
        texts.job().run().refused(3, words);
        texts.job().run_with(&["check"]).refused(3, words);
        let report = texts.job().with("input", "max_malformed_fraction = 0.1").report();
        assert_eq!(step(&report), "0.01", "{report}");
    }
}

#[test]
fn mistakes_are_counted_over_all_files() {
    let contents: Vec<String> =
        (0..40).map(|file| rows(20, file + 1, " ", ".") + if file == 7 { "0 0 0\n" } else { "" }).collect();
    let texts = Texts::new(&contents);
    texts.job().run().refused(3, &["7.txt: line 21", "far from all other rows"]);
    let job = texts.job().with("input", "max_malformed_fraction = 0.01");
    let report = job.report();
    assert_eq!((step(&report), number(&report["points"]["malformed"])), ("0.01", 1));
    let output = job.out();
    let files = texts.paths.iter().map(|path| path.to_str().unwrap());
    let args: Vec<&str> = ["verify", output.to_str().unwrap(), "--input"].into_iter().chain(files).collect();
    gdt_batch(job.folder(), &args).succeeded();
}

#[test]
fn the_row_that_makes_the_lattice_coarse_is_named() {
    let texts = Texts::one(&(plain(300) + &rows(20, 5, " ", ".").replace("565", "4565")));
    let report = texts.job().report();
    assert_eq!(number(&report["points"]["kept"]), 320);
    let said = warnings(&report);
    assert!(said.contains("rounded to") && said.contains("farthest from the others is"), "{said}");
    assert!(said.contains("0.txt: line 3") && said.contains("4565"), "{said}");
    // Files that lie far apart are no row's fault. The one with fewer points is named.
    let apart = Texts::new(&[plain(300), rows(200, 5, " ", ".").replace("565", "4565")]);
    let said = warnings(&apart.job().report());
    assert!(said.contains("rounded to") && !said.contains("the row farthest"), "{said}");
    assert!(said.contains("the file farthest from the others is") && said.contains("1.txt (x 4565"), "{said}");
}

#[test]
fn rows_within_the_bounds_are_kept_whatever_the_lattice() {
    let content =
        plain(300) + "565050.006 5933050.00 12.00\n565050.008 5933051.00 12.00\n565009.994 5933052.00 12.00\n";
    let texts = Texts::one(&content);
    let bounds = [565_009.993, 5_933_010.001, 565_050.007, 5_933_080.499];
    let inside = content.lines().filter(|line| {
        let [x, y] = [0, 1].map(|column| line.split(' ').nth(column).unwrap().parse::<f64>().unwrap());
        (bounds[0]..=bounds[2]).contains(&x) && (bounds[1]..=bounds[3]).contains(&y)
    });
    let inside = inside.count() as u64;
    for resolution in ["0.01", "1.0"] {
        let job = texts.job().with("input", &format!("bounds = {bounds:?}\nresolution = {resolution}"));
        let points = &job.report()["points"];
        assert_eq!(number(&points["out_of_bounds"]), 303 - inside, "{resolution}: {points}");
        let (output, input) = (job.out(), texts.paths[0].to_str().unwrap());
        gdt_batch(job.folder(), &["verify", output.to_str().unwrap(), "--input", input]).succeeded();
    }
}

#[test]
fn columns_named_as_degrees_that_hold_something_else_are_not_silent() {
    let table = |x: f64, y: f64, spread: f64| -> String {
        let row =
            |i: usize| format!("{:.7},{:.7},{}\n", x + spread * i as f64, y + spread * (i * i % 50) as f64, i % 9);
        (0..50).map(row).collect()
    };
    let exchanged = Texts::one(&format!("lat,lon,height\n{}", table(139.0, 35.0, 1e-4)));
    let swapped = Texts::one(&format!("lon,lat,height\n{}", table(35.0, 139.0, 1e-4)));
    exchanged.job().run().refused(2, &["degrees", "exchanged"]);
    swapped.job().run().refused(2, &["degrees", "exchanged"]);
    let unit = Texts::one(&format!("x [dd],y [dd],z [m]\n{}", table(11.0, 48.0, 1e-4)));
    unit.job().run().refused(2, &["degrees"]);
    for (x, y) in [(1131.5, 4812.5), (115_000_000.0, 481_000_000.0)] {
        let texts = Texts::one(&format!("lon,lat,height\n{}", table(x, y, 1.0)));
        let said = warnings(&texts.job().report());
        assert!(said.contains("are not degrees") && said.contains("treated as lengths"), "{said}");
    }
}

#[test]
fn units_of_the_names_are_the_units_of_the_mesh() {
    let rows = rows(50, 2, ";", ".");
    let texts = Texts::one(&format!("x [cm];y [cm];z [mm]\n{rows}"));
    let job = texts.job().with("output", "compression = \"none\"\nlevels = false");
    let report = job.report();
    assert_eq!((report["unit"].as_str(), number(&report["points"]["kept"])), (Some("other"), 50), "{report}");
    assert!(!warnings(&report).contains("no input states a known unit"), "{report}");
    assert!(warnings(&report).contains("heights are in another unit than x and y (0.001 m and 0.01 m)"), "{report}");
    let feet = Texts::one(&format!("x;y;z\nft;ft;ft\n{rows}")).job().report();
    assert_eq!(feet["unit"].as_str(), Some("foot"));
    assert!(warnings(&feet).contains("us-ft"), "{feet}");
}

#[test]
fn classes_without_a_column_of_them_are_refused() {
    let texts = Texts::one(&plain(50));
    texts.job().with("input", "classes = [2]").run().refused(2, &["0.txt", "no column of classes", "have 0 in it"]);
    assert_eq!(number(&texts.job().with("input", "classes = [0, 2]").report()["points"]["kept"]), 50);
    let rows: String = plain(50).lines().map(|row| format!("{row} Ground\n")).collect();
    let texts = Texts::one(&format!("x y z class\n{rows}"));
    assert_eq!(number(&texts.job().report()["points"]["kept"]), 50);
    texts.job().with("input", "classes = [2]").run().refused(3, &["line 2", "column 4 (class)"]);
}

#[test]
fn what_a_german_spreadsheet_writes_has_the_same_mesh() {
    let expected = Texts::one(&plain(200)).job().digest();
    for (header, delimiter) in [("X;Y;Z\r\n", ";"), ("Rechtswert\tHochwert\tHöhe\r\n", "\t"), ("", " ")] {
        let text = rows(200, 11, delimiter, ",").replace('\n', "\r\n");
        assert_eq!(Texts::one(&format!("{header}{text}")).job().digest(), expected, "{header:?}");
    }
}

#[test]
fn check_refuses_a_late_row_with_more_columns_as_the_job_does() {
    let rows: String = plain(8000).lines().map(|row| format!("{},7\n", row.replace(' ', ","))).collect();
    let texts = Texts::one(&format!("x,y,z,i\n{rows}565000.25,5933000.50,12.10,1,2,3\n"));
    for run in [texts.job().run(), texts.job().run_with(&["check"])] {
        run.refused(3, &["line 8002", "but the header names 4"]);
    }
}
