//! `surface` and `returns`: bare earth, first and last returns, and what the mesh is said to be.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::las_file::LasFile;
use crate::program::{Job, gdt_batch, number};

const COUNT: usize = 3000;

/// The class of point i.
fn class(i: usize) -> u8 {
    [2, 5, 1, 9, 6, 2, 20, 8, 3, 7][i % 10]
}

/// The number of the return of point i, and the number of returns of its pulse.
fn pulse_return(i: usize) -> (u8, u8) {
    [(1, 1), (1, 2), (2, 2), (1, 3), (2, 3), (3, 3), (0, 0)][i % 7]
}

/// Points with these classes and returns. None of them is withheld.
fn cloud(classes: impl Fn(usize) -> u8) -> LasFile {
    let mut file = LasFile::new(4, 6, 0, COUNT);
    let length = file.length() as usize;
    for (i, record) in file.records.chunks_exact_mut(length).enumerate() {
        let (number, of) = pulse_return(i);
        (record[14], record[15], record[16]) = (number | of << 4, 0, classes(i));
    }
    file
}

/// Returns the points as a text.
fn text(file: &LasFile) -> String {
    let row = |record: &[u8]| {
        let raw = |at: usize| i32::from_le_bytes(record[at..at + 4].try_into().unwrap());
        let [x, y, z] = [raw(0) + 50_000_000, raw(4) + 400_000_000, raw(8)].map(|raw| raw as f64 / 100.0);
        format!("{x:.2},{y:.2},{z:.2},{},{},{}\n", record[16], record[14] & 15, record[14] >> 4)
    };
    let rows: String = file.records.chunks_exact(file.length() as usize).map(row).collect();
    format!("X,Y,Z,Classification,ReturnNumber,NumberOfReturns\n{rows}")
}

/// Writes a cloud as LAS, LAZ and text.
fn files(folder: &Path, file: &LasFile) -> [PathBuf; 3] {
    let path = |name: &str, bytes: &[u8]| {
        fs::write(folder.join(name), bytes).unwrap();
        folder.join(name)
    };
    [path("a.las", &file.las()), path("a.laz", &file.laz(&[700], false)), path("a.csv", text(file).as_bytes())]
}

/// Returns how many points of the cloud are noise or are not `wanted`, by class and by return.
fn dropped(wanted: impl Fn(usize) -> (bool, bool)) -> [u64; 2] {
    let fates: Vec<(bool, bool)> = (0..COUNT).map(wanted).collect();
    let count = |is: &dyn Fn(&(bool, bool)) -> bool| fates.iter().filter(|fate| is(fate)).count() as u64;
    [count(&|(class, _)| !class), count(&|(class, pulse)| *class && !pulse)]
}

#[test]
fn each_surface_keeps_its_classes_and_returns_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let files = files(folder.path(), &cloud(class));
    let ground = |i| [2, 8, 9, 20].contains(&class(i));
    let (no_noise, returns) = (|i| class(i) != 7, pulse_return);
    for (lines, expected) in [
        ("surface = \"all\"", dropped(|i| (no_noise(i), true))),
        ("surface = \"ground\"", dropped(|i| (ground(i), true))),
        ("surface = \"first\"", dropped(|i| (no_noise(i), returns(i).0 <= 1))),
        ("surface = \"last\"", dropped(|i| (no_noise(i), returns(i).0 == returns(i).1))),
        ("returns = [2]", dropped(|i| (no_noise(i), returns(i).0 == 2))),
        ("surface = \"ground\"\nreturns = \"last\"", dropped(|i| (ground(i), returns(i).0 == returns(i).1))),
    ] {
        let run = |file: &PathBuf| {
            let job = Job::on(&[file]).with("input", lines).with("output", "levels = false");
            let report = job.report();
            let points = &report["points"];
            assert_eq!(["other_class", "other_return"].map(|name| number(&points[name])), expected, "{lines} {file:?}");
            let input = ["verify", "out", "--input", file.to_str().unwrap()];
            gdt_batch(job.folder(), &input).succeeded();
            report
        };
        let [las, laz, csv] = files.each_ref().map(run);
        // The CRS and the lattice of a text are its own, its points are the same.
        assert_eq!(las["vertex_digest"], laz["vertex_digest"], "{lines}");
        let same = |name: &str| [&las, &csv].map(|report| number(&report["points"][name]));
        for name in ["kept", "ground", "unclassified"] {
            assert_eq!(same(name)[0], same(name)[1], "{lines} {name}");
        }
        assert_eq!(las["points"]["classes"], csv["points"]["classes"]);
        let unclear = las["warnings"]
            .as_array()
            .unwrap()
            .iter()
            .any(|w| w.as_str().unwrap().contains("have no valid return number"));
        assert_eq!(unclear, lines.contains("return") || lines.contains("first") || lines.contains("last"), "{lines}");
    }
}

fn said(report: &Value) -> &str {
    report["surface"].as_str().unwrap_or_default()
}

#[test]
fn what_the_mesh_is_stands_in_the_report_in_check_and_in_info() {
    let folder = tempfile::tempdir().unwrap();
    let [las, ..] = files(folder.path(), &cloud(class));
    let job = |surface: &str| Job::on(&[&las]).with("input", &format!("surface = \"{surface}\""));
    // Nine of ten are no noise, and five of them are ground.
    let all = "56 % ground: the mesh of all points includes vegetation or buildings; [input] surface = \"ground\" makes bare earth";
    let by_sample = all.replacen("ground:", "ground by a sample:", 1);
    let report = job("all").report();
    assert_eq!(said(&report), all);
    assert!(job("all").run().succeeded().out.contains(all));
    let ground = job("ground").report();
    assert_eq!(said(&ground), "100 % ground: the mesh is bare earth");
    assert_ne!(report["options_fingerprint"], ground["options_fingerprint"]);
    assert!(said(&job("first").report()).contains("roofs and tree tops"));
    let check = job("all").run_with(&["check"]).succeeded().out;
    assert!(check.contains(&format!("about {by_sample}")), "{check}");
    let check = job("ground").run_with(&["check", "--json"]).succeeded().json();
    assert_eq!(said(&check), "about 100 % ground by a sample: the mesh is bare earth");
    let kept = number(&check["kept"]);
    assert!((1500..2200).contains(&kept), "half of the points: {kept}");
    for (option, said) in [("--json", format!("about {by_sample}").replace('"', "\\\"")), ("--histogram", all.into())] {
        let info = gdt_batch(folder.path(), &["info", option, "a.las"]).succeeded().out;
        assert!(info.contains(&said), "{info}");
    }
}

#[test]
fn a_cloud_without_ground_is_refused_with_what_it_has_and_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let unclassified = |i: usize| if i.is_multiple_of(4) { 5 } else { 1 };
    let [las, _, csv] = files(folder.path(), &cloud(unclassified));
    let words = [
        "no point is left",
        "class 1 (unclassified, 75 %), class 5 (high vegetation, 25 %)",
        "[input] surface = \"bare-earth\" finds the ground",
    ];
    for file in [&las, &csv] {
        let job = Job::on(&[file]).with("input", "surface = \"ground\"");
        job.run().refused(3, &words);
        job.run_with(&["check"]).refused(3, &words);
    }
    let all = Job::on(&[&las]).report();
    assert!(said(&all).starts_with("0 % ground: the mesh of all points includes vegetation"), "{}", said(&all));
    // Among files with ground, one without is named.
    let good = folder.path().join("good.las");
    fs::write(&good, cloud(class).las()).unwrap();
    let mixed = Job::on(&[&las, &good]).with("input", "surface = \"ground\"");
    let check = mixed.run_with(&["check"]).succeeded().out;
    assert!(check.contains("a.las: no point of it is used: surface"), "{check}");
    let report = mixed.report();
    let warnings = report["warnings"].to_string();
    assert!(
        warnings.contains("a.las: no point of it is used: surface") && !warnings.contains("good.las: no"),
        "{warnings}"
    );
}

#[test]
fn a_text_that_lacks_the_columns_of_a_surface_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let rows = |names: &str, more: &str| format!("{names}\n0,0,1{more}\n9,0,2{more}\n0,9,3{more}\n9,9,4{more}\n");
    let run = |text: &str, surface: &str| {
        let path = folder.path().join("a.csv");
        fs::write(&path, text).unwrap();
        Job::on(&[&path]).with("input", surface).run()
    };
    let plain = rows("x,y,z", "");
    run(&plain, "surface = \"ground\"").refused(
        3,
        &["a.csv", "surface = \"ground\"", "no column of classes", "surface = \"bare-earth\"", "[input.csv] columns"],
    );
    run(&plain, "classes = [2]").refused(2, &["classes = [2]", "no column of classes", "a.csv", "have 0 in it"]);
    run(&plain, "surface = \"first\"").refused(2, &["return_number", "a.csv"]);
    run(&plain, "returns = [2]").refused(2, &["return_number"]);
    let numbers = rows("x,y,z,return_number", ",1");
    run(&numbers, "surface = \"first\"").succeeded();
    run(&numbers, "surface = \"last\"").refused(2, &["number_of_returns"]);
    run(&rows("x,y,z,return,number of returns", ",1,1"), "surface = \"last\"").succeeded();
    run(&rows("x,y,z,return,returns", ",one,1"), "surface = \"last\"")
        .refused(3, &["column 4 (return number)", "not a number"]);
    // Nobody asks for them.
    run(&rows("x,y,z,return,returns", ",one,1"), "surface = \"all\"").succeeded();
}
