//! `gdt-batch init` writes configurations that run as they are, unless points are lost, and that say what is in the clouds.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::clouds;
use crate::common::shared;
use crate::program::{Said, gdt_batch, gdt_batch_into, gdt_batch_within_kib, number};

/// What a configuration must say of some clouds.
struct Expected {
    files: &'static [&'static str],
    /// The metres of a unit of x and y, and of z.
    metres: [f64; 2],
    /// How units are called.
    unit: &'static str,
    crs: Option<&'static str>,
    /// The beginning of the sentence about the surface.
    surface: &'static str,
    /// The keys of lines that are needed.
    needed: &'static [&'static str],
    /// Whether points are lost, so that the job stops until the user allows the loss.
    stops: bool,
}

const FOOT: f64 = 0.3048;
const US_FOOT: f64 = 1200.0 / 3937.0;
const NO_UNIT: &str = "not stated by the files";
const METRES: &str = "metre in x and y, metre in z";
/// No record says the unit of heights.
const METRES_IN_XY: &str = "metre in x and y";
const NO_CLASSES: &str = "points are unclassified";
/// Files of PDAL's stadium: a foot is no metre, but two of them name no system.
const STADIUM: &str = "26 % ground";
const UNKNOWN: Expected = Expected {
    files: &[],
    metres: [1.0, 1.0],
    unit: NO_UNIT,
    crs: None,
    surface: NO_CLASSES,
    needed: &[],
    stops: false,
};

/// LAS, LAZ, COPC, texts, feet, degrees, pixels that say they are degrees, two systems, and damaged files.
const CLOUDS: [Expected; 21] = [
    Expected {
        files: &["autzen_trim.las"],
        metres: [FOOT, FOOT],
        unit: "foot in x and y",
        crs: Some("NAD_1983_HARN_Lambert_Conformal_Conic"),
        surface: "23 % ground",
        ..UNKNOWN
    },
    Expected { files: &["100-points.las"], surface: "27 % ground", ..UNKNOWN },
    Expected { files: &["1.2-with-color.las"], surface: STADIUM, ..UNKNOWN },
    Expected {
        files: &["1.2-with-color.copc.laz"],
        metres: [1.0, US_FOOT],
        unit: "metre in x and y, US survey foot in z",
        crs: Some("NAD83 / Oregon LCC (m)"),
        surface: STADIUM,
        ..UNKNOWN
    },
    Expected {
        files: &["32-1-472-150-76.laz"],
        unit: METRES,
        crs: Some("ETRS89 / UTM zone 32N"),
        surface: "35 % ground",
        ..UNKNOWN
    },
    Expected {
        files: &["file_with_both_wkt_and_geotiff_vlrs.las"],
        metres: [US_FOOT, US_FOOT],
        unit: "US survey foot in x and y",
        crs: Some("NAD83_2011_Nebraska_ft"),
        surface: "39 % ground",
        ..UNKNOWN
    },
    Expected {
        files: &["append-bug.laz"],
        unit: METRES_IN_XY,
        crs: Some("RGF93 / Lambert-93"),
        surface: "60 % ground",
        ..UNKNOWN
    },
    Expected { files: &["warsaw_small.las"], surface: "46 % ground", ..UNKNOWN },
    Expected { files: &["dbh.laz"], ..UNKNOWN },
    Expected { files: &["data.xyz"], ..UNKNOWN },
    Expected { files: &["autzen-point-format-3.txt"], ..UNKNOWN },
    Expected { files: &["crlf_test.txt"], ..UNKNOWN },
    Expected { files: &["quoted2.txt"], ..UNKNOWN },
    Expected {
        files: &["autzen-dd.las"],
        unit: METRES_IN_XY,
        crs: Some("WGS 84 / UTM zone 10N"),
        surface: STADIUM,
        needed: &["to_crs"],
        ..UNKNOWN
    },
    Expected { files: &["simple1_4.las"], needed: &["crs"], ..UNKNOWN },
    Expected {
        files: &["32-1-472-150-76.laz", "append-bug.laz"],
        unit: METRES,
        crs: Some("UTM zone 31N"),
        surface: "56 % ground",
        needed: &["to_crs", "datums"],
        ..UNKNOWN
    },
    Expected {
        files: &["bad/bad_vlr_count.las"],
        unit: METRES_IN_XY,
        crs: Some("WGS 84 / UTM zone 17N"),
        surface: "100 % ground",
        ..UNKNOWN
    },
    Expected { files: &["bad/1.2-with-color-clipped.las"], surface: STADIUM, stops: true, ..UNKNOWN },
    Expected { files: &["bad/garbage_nVariableLength.las"], stops: true, ..UNKNOWN },
    Expected {
        files: &["bad/truncated-mid-chunk.laz"],
        unit: METRES_IN_XY,
        crs: Some("NAD83(CSRS) / MTM zone 7"),
        surface: "19 % ground",
        stops: true,
        ..UNKNOWN
    },
    Expected {
        files: &["100-points.las", "bad/git-lfs-pointer.laz", "bad/1.2-no-points.las"],
        surface: "27 % ground",
        needed: &["on_bad_file"],
        ..UNKNOWN
    },
];

fn text(value: &Value) -> &str {
    value.as_str().unwrap_or_else(|| panic!("{value} is no text"))
}

/// Returns the per cent of a sentence about the surface; 0 if it has none.
fn share_of_ground(sentence: &str) -> f64 {
    let number = sentence.split(" % ground").next().filter(|number| *number != sentence);
    number.map_or(0.0, |number| number.trim_start_matches("about ").parse().unwrap())
}

#[test]
fn configurations_of_real_clouds_run_as_they_are_and_say_what_they_are() {
    let Some(data) = shared().map(|folder| folder.join("data")) else { return };
    for expected in CLOUDS {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<PathBuf> = expected.files.iter().map(|name| data.join(name)).collect();
        let mut arguments = vec!["init", "--json"];
        arguments.extend(files.iter().map(|file| file.to_str().unwrap()));
        let said = gdt_batch(folder.path(), &arguments);
        if expected.stops {
            said.refused(3, &["is written, but its job would stop", "max_malformed_fraction"]);
        }
        let new = said.json();
        let mut configuration = fs::read_to_string(folder.path().join("job.toml")).unwrap();
        assert_eq!(configuration.contains("\n#max_malformed_fraction = "), expected.stops, "{configuration}");
        if expected.stops {
            gdt_batch(folder.path(), &["--quiet", "job.toml"]).refused(3, &["max_malformed_fraction"]);
            configuration = configuration.replace("#max_malformed_fraction", "max_malformed_fraction");
            fs::write(folder.path().join("job.toml"), &configuration).unwrap();
        }
        let report = gdt_batch(folder.path(), &["--json", "--quiet", "job.toml"]).succeeded().json();
        let what = format!("{:?}: {configuration}", expected.files);
        assert!(number(&report["sites"]) > 8, "{what}");

        let flat = configuration.replace("\n# ", " ");
        let has_heights = expected.unit == NO_UNIT || expected.unit.ends_with(" in z");
        assert_eq!(flat.contains("the unit of z is unknown"), !has_heights, "{what}");
        let unit =
            if expected.unit == NO_UNIT { "Unit: no file states it" } else { &format!("Unit: {}", expected.unit) };
        assert!(text(&new["unit"]).contains(expected.unit) && flat.contains(unit), "{} {what}", new["unit"]);
        let place = fs::read(folder.path().join("out/georeference.json")).unwrap();
        let place: Value = serde_json::from_slice(&place).unwrap();
        for (key, metres) in ["metres_per_unit", "metres_per_unit_z"].iter().zip(expected.metres) {
            assert!((place[key].as_f64().unwrap() - metres).abs() < 1e-9, "{key} {what}");
        }
        match expected.crs {
            Some(crs) => {
                assert!(
                    text(&report["crs"]).contains(crs) && flat.contains(&format!("CRS: {}", text(&report["crs"]))),
                    "{what}"
                );
            }
            None => assert!(report["crs"].is_null() && flat.contains("CRS: no"), "{what}"),
        }
        let surface = text(&new["check"]["surface"]);
        assert!(
            surface.contains(expected.surface) && flat.contains(&format!("Surface: {surface}")),
            "{surface} {what}"
        );
        // A sample is as good as this.
        let [sampled, all] = [surface, text(&report["surface"])].map(share_of_ground);
        assert!((sampled - all).abs() <= 2.0, "{} {what}", report["surface"]);
        assert_eq!(
            configuration.contains("#surface = \"ground\""),
            expected.surface.contains("ground") && !expected.surface.starts_with("100")
        );
        let needed: Vec<&str> = new["needed"].as_array().unwrap().iter().map(|line| text(&line["key"])).collect();
        assert_eq!(needed, expected.needed, "{what}");
        for key in expected.needed {
            assert!(configuration.contains(&format!("\n{key} = ")), "{what}");
        }
    }
}

#[test]
fn clouds_of_which_no_job_can_be_made_are_refused_as_check_refuses_them() {
    let Some(data) = shared().map(|folder| folder.join("data")) else { return };
    for (name, words) in [
        ("utm15.las", "utm15.las: the points make no triangle"),
        ("bad/1.2-no-points.las", "all are missing"),
        ("bad/badheader.txt", "names 2 columns x"),
        ("bad/git-lfs-pointer.laz", "git lfs pull"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        gdt_batch(folder.path(), &["init", data.join(name).to_str().unwrap()]).refused(3, &[words]);
        assert!(fs::read_dir(folder.path()).unwrap().next().is_none(), "{name}");
    }
    // What the first reason advises was tried.
    let refuses = |names: [&str; 2], words: &[&str]| {
        let files = names.map(|name| data.join(name));
        let arguments = ["init", "-o", "-", files[0].to_str().unwrap(), files[1].to_str().unwrap()];
        gdt_batch(Path::new("."), &arguments).refused(2, words);
    };
    refuses(["autzen-dd.las", "1.2-with-color.las"], &["are in degrees", "; with to_crs = \"utm\": ", "names no CRS"]);
    // Pixels and degrees have no plane in common.
    refuses(["simple1_4.las", "autzen-dd.las"], &["are in degrees", "the longitudes of"]);
}

#[test]
fn only_options_that_the_job_takes_are_offered() {
    let folder = tempfile::tempdir().unwrap();
    let classes = |last: &str| format!("x,y,z,classification\n0,0,1,2\n9,0,2,5\n9,9,3,2\n0,9,4,{last}\n");
    for (last, is_offered) in [("2", true), ("bad", false)] {
        fs::write(folder.path().join("a.csv"), classes(last)).unwrap();
        let text = gdt_batch(folder.path(), &["init", "-o", "-", "a.csv"]).succeeded().out;
        assert_eq!(text.contains("#surface = \"ground\""), is_offered, "{text}");
    }
    let Some(data) = shared().map(|folder| folder.join("data")) else { return };
    // No UTM zone has its datum.
    let text = gdt_batch(&data, &["init", "-o", "-", "append-bug.laz"]).succeeded().out;
    assert!(text.contains("CRS: RGF93") && !text.contains("#to_crs"), "{text}");
}

#[test]
fn clouds_without_a_triangle_are_refused_by_name() {
    for (rows, words) in [
        ("0,0,0\n1,1,1\n2,2,2\n", "a.csv: the points make no triangle"),
        ("1,1,1\n1,1,1\n1,1,2\n", "a.csv: the points make no triangle"),
        ("x,y,z\n", "a.csv: no point is left to triangulate, because none is there"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a.csv"), rows).unwrap();
        gdt_batch(folder.path(), &["init", "a.csv"]).refused(3, &[words]);
        assert!(!folder.path().join("job.toml").exists());
    }
}

#[test]
fn names_of_configurations_have_any_signs() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), "0 0 1\n9 0 2\n9 9 3\n").unwrap();
    let long = format!("{}.toml", "x".repeat(240));
    for (name, command) in [("-a$b %A%.toml", "gdt-batch './-a$b %A%.toml'"), (&long, &*format!("gdt-batch {long}"))] {
        let said = gdt_batch(folder.path(), &["init", "a.csv", &format!("--output={name}")]).succeeded().out;
        assert!(said.contains(command), "{said}");
        gdt_batch(folder.path(), &["--quiet", &format!("./{name}")]).succeeded();
    }
    assert!(folder.path().join("out--a_b _A_/tileset.json").is_file());
}

#[test]
#[cfg(target_os = "linux")]
fn a_configuration_that_is_written_is_not_said_to_be_missing() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.csv"), "0 0 1\n9 0 2\n9 9 3\n").unwrap();
    let said = gdt_batch_into("/dev/full", folder.path(), &["init", "a.csv"]);
    assert!(said.code == 0 && said.err.contains("job.toml is written, but"), "{said:?}");
    let said = gdt_batch_into("/dev/full", folder.path(), &["init", "a.csv", "--force", "--json"]);
    assert!(said.code == 1 && said.err.contains("job.toml is written\n"), "{said:?}");
    // A limit to the size of files leaves nothing behind.
    let limited =
        format!("(ulimit -f 0; {} init a.csv -o b.toml 2>&1; echo code $?) | cat", env!("CARGO_BIN_EXE_gdt-batch"));
    let output = Command::new("sh").args(["-c", &limited]).current_dir(folder.path()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("error: cannot write b.toml") && said.contains("code 1"), "{said}");
    let names = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name());
    assert_eq!(names.collect::<BTreeSet<_>>(), BTreeSet::from(["a.csv", "job.toml"].map(Into::into)));
}

/// Runs init in a folder with a sample terrain in `clouds/`.
fn init(folder: &Path, arguments: &[&str]) -> Said {
    let cloud = folder.join("clouds/a.laz");
    if !cloud.exists() {
        gdt_batch(folder, &["sample", "clouds/a.laz", "--points", "3000"]).succeeded();
    }
    gdt_batch(folder, &[&["init"], arguments].concat())
}

#[test]
fn a_first_job_is_two_commands() {
    let folder = tempfile::tempdir().unwrap();
    let said = init(folder.path(), &["clouds/*.laz"]).succeeded();
    for words in ["1 with 3", "metre in x and y", "ETRS89 / UTM zone 32N", "% ground", "gdt-batch job.toml"] {
        assert!(said.out.contains(words), "no {words:?} in {}", said.out);
    }
    let text = fs::read_to_string(folder.path().join("job.toml")).unwrap();
    assert!(text.contains("files = [\"clouds/*.laz\"]") && text.contains("from the well-known text (WKT)"), "{text}");
    gdt_batch(folder.path(), &["job.toml"]).succeeded();
    assert!(folder.path().join("out/tileset.json").is_file());
    // In the folder of the clouds it needs no names.
    let clouds = folder.path().join("clouds");
    gdt_batch(&clouds, &["init", "--quiet"]).succeeded();
    let text = fs::read_to_string(clouds.join("job.toml")).unwrap();
    assert!(text.contains("files = [\"a.laz\"]"), "{text}");
    gdt_batch(folder.path(), &["check", "clouds/job.toml"]).succeeded();
}

#[test]
fn a_configuration_is_replaced_only_if_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("job.toml");
    fs::write(&path, "mine").unwrap();
    for arguments in [&["clouds"][..], &["clouds", "--force"]] {
        let said = init(folder.path(), arguments);
        said.refused(2, &["job.toml exists already and is not a configuration"]);
        assert!(!said.err.contains("--force") && fs::read_to_string(&path).unwrap() == "mine", "{said:?}");
    }
    let cloud = fs::read(folder.path().join("clouds/a.laz")).unwrap();
    init(folder.path(), &["clouds/a.laz", "--force", "-o", "clouds/a.laz"]).refused(2, &["not a configuration"]);
    assert!(fs::read(folder.path().join("clouds/a.laz")).unwrap() == cloud, "the cloud stays");
    fs::write(&path, "[input]\nfiles = []\n").unwrap();
    init(folder.path(), &["clouds"]).refused(2, &["job.toml exists already", "--force"]);
    init(folder.path(), &["clouds", "--force"]).succeeded();
    assert!(fs::read_to_string(&path).unwrap().contains("clouds/a.laz"));
    init(folder.path(), &["clouds", "--output", "clouds"]).refused(2, &["not a regular file"]);
    init(folder.path(), &["clouds", "--output", "no/job.toml"]).refused(2, &["create it first"]);
    init(folder.path(), &["nothing.laz"]).refused(2, &["exists already"]);
    init(folder.path(), &["nothing.laz", "-o", "-"]).refused(2, &["there is no file nothing.laz"]);
    init(folder.path(), &["-o", "-"]).refused(2, &["has no point clouds", "clouds, which has some"]);
    init(folder.path(), &["clouds", "-o", "-", "--json"]).refused(2, &["--json"]);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        fs::write(folder.path().join("other"), "").unwrap();
        assert_eq!(mode(&path), mode(&folder.path().join("other")), "others may read it as they may read other files");
    }
}

#[test]
fn what_is_printed_is_what_is_written() {
    let folder = tempfile::tempdir().unwrap();
    init(folder.path(), &["clouds", "-o", "east.toml"]).succeeded();
    let printed = init(folder.path(), &["clouds", "-o", "-"]).succeeded().out;
    let written = fs::read_to_string(folder.path().join("east.toml")).unwrap();
    // How much is free may change, and only a file has a name.
    let lasting = |text: &str| -> Vec<String> {
        let lines = text.lines().filter(|line| !line.contains("gdt-batch") && !line.starts_with("directory"));
        lines.take_while(|line| *line != "[limits]").map(String::from).collect()
    };
    assert_eq!(lasting(&printed), lasting(&written));
    assert!(written.contains("directory = \"out-east\"") && printed.contains("directory = \"out\""));
}

#[test]
#[cfg(target_os = "linux")]
fn a_job_that_fits_on_fewer_threads_gets_them_and_one_that_fits_nowhere_says_so() {
    let folder = tempfile::tempdir().unwrap();
    clouds::write(folder.path(), "cloud.csv", &clouds::uniform(100_000, 100_000, 4));
    let run = |mebibytes: u64, arguments: &[&str]| gdt_batch_within_kib(mebibytes << 10, folder.path(), arguments);
    let need =
        || number(&gdt_batch(folder.path(), &["check", "--json", "job.toml"]).succeeded().json()["memory"]) >> 20;
    gdt_batch(folder.path(), &["init", "cloud.csv", "--quiet"]).succeeded();
    let most = need();
    // As much as the job takes, and what the program is.
    let said = run(most - 10, &["init", "cloud.csv", "--force"]);
    if said.code == 0 {
        let text = fs::read_to_string(folder.path().join("job.toml")).unwrap();
        assert!(text.contains("\nthreads = ") && said.out.contains("set       threads = "), "{text}");
        assert!(need() < most);
    }
    let said = run(100, &["init", "cloud.csv", "--force"]);
    said.refused(1, &["not enough memory"]);
}
