//! `gdt-batch cloud.laz`: a job without a configuration is the job of the configuration that `--write-config` writes.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::clouds;
use crate::program::{Said, gdt_batch};

/// Degrees, which no job takes as they are.
const DEGREES: &str = "lon,lat,z\n11.51,48.11,500\n11.52,48.12,510\n11.53,48.11,505\n11.52,48.10,503\n";

/// Returns the names and checksums of all results in `folder`.
#[track_caller]
fn results(folder: &Path) -> String {
    let sums = fs::read_to_string(folder.join("XXH128SUMS")).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    assert!(sums.contains("tiles/000000.glb"), "{sums}");
    sums
}

/// A folder with clouds whose names have blanks and letters beyond ASCII.
fn folder_with_clouds() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    for (name, seed) in [("my tiles/Größe 1.laz", "1"), ("my tiles/b.laz", "2"), ("cloud.copc.las", "3")] {
        gdt_batch(root, &["sample", name, "--points", "3000", "--seed", seed]).succeeded();
    }
    fs::write(root.join("degrees.csv"), DEGREES).unwrap();
    folder
}

#[test]
fn a_job_has_the_bytes_of_its_configuration() {
    let folder = folder_with_clouds();
    let root = folder.path();
    let square = "565000,5933000,565020.5,5933020";
    let crs = r#""crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::25832"}}"#;
    let ring = "[[565000, 5933000], [565090, 5933010], [565020, 5933080], [565000, 5933000]]";
    fs::write(root.join("area.geojson"), format!(r#"{{"type": "Polygon", {crs}, "coordinates": [{ring}]}}"#)).unwrap();
    for (words, out) in [
        (&["cloud.copc.las"][..], "cloud-terrain"),
        (&["my tiles"], "my tiles-terrain"),
        (&["my tiles/*.laz", "--surface", "ground", "--max-error", "0.05"], "my tiles-terrain"),
        (
            &["my tiles/b.laz", "my tiles/Größe 1.laz", "--raster", "2", "--bounds", square, "--export", "ply,obj"],
            "my tiles-terrain",
        ),
        (&["cloud.copc.las", "--clip", "area.geojson", "--hull", "whole"], "cloud-terrain"),
        (&["my tiles", "cloud.copc.las", "-o", "out/of two", "--to-crs", "EPSG:25833"], "out/of two"),
        // What the clouds need is set in both.
        (&["degrees.csv"], "degrees-terrain"),
        (
            &["degrees.csv", "--to-crs", "EPSG:32633", "--raster", "500", "--contours", "0.5", "--terrain"],
            "degrees-terrain",
        ),
    ] {
        gdt_batch(root, &[words, &["--quiet"]].concat()).succeeded();
        let own = results(&root.join(out));
        fs::remove_dir_all(root.join(out)).unwrap();
        // The configuration may be in another folder.
        for file in ["job.toml", "my tiles/job.toml"] {
            gdt_batch(root, &[words, &["--quiet", "--force", "--write-config", file]].concat()).succeeded();
            assert!(!root.join(out).exists(), "{words:?}: it runs nothing");
            gdt_batch(root, &[file, "--quiet"]).succeeded();
            assert_eq!(results(&root.join(out)), own, "{words:?}, {file}");
            fs::remove_dir_all(root.join(out)).unwrap();
            fs::remove_file(root.join(file)).unwrap();
        }
        assert_eq!(own.contains("terrain.tif"), words.contains(&"--raster"), "{words:?}");
        assert_eq!(own.contains("terrain.ply"), words.contains(&"--export"), "{words:?}");
        assert_eq!(own.contains("terrain/layer.json"), words.contains(&"--terrain"), "{words:?}");
    }
}

#[test]
fn what_is_written_and_what_comes_next_is_said() {
    let folder = folder_with_clouds();
    let said = gdt_batch(folder.path(), &["my tiles/b.laz"]).succeeded();
    assert!(said.err.starts_with("the terrain goes to b-terrain\n"), "{}", said.err);
    let last = said.out.lines().last().unwrap();
    let next = if tiles::page::is_built_in() { "gdt-batch view b-terrain" } else { "preview.png" };
    assert!(last.starts_with("next ") && last.contains(next), "{last}");
    // Reasons for what no flag has set.
    let said = gdt_batch(folder.path(), &["degrees.csv"]).succeeded();
    assert!(said.err.contains("[input] to_crs = \"utm\": ") && said.err.contains("[input] missing_crs = "), "{said:?}");
    let quiet = gdt_batch(folder.path(), &["degrees.csv", "--quiet"]).succeeded();
    assert!(quiet.out.is_empty() && quiet.err.is_empty(), "{quiet:?}");
    let report = gdt_batch(folder.path(), &["my tiles/b.laz", "--json", "--quiet"]).succeeded().json();
    assert_eq!(report["sites"], 3000);
}

#[test]
fn the_written_configuration_has_the_flags_and_offers_none_of_them_again() {
    let folder = folder_with_clouds();
    let root = folder.path();
    let flags = [
        "--surface",
        "ground",
        "--unit",
        "metre",
        "--raster",
        "1",
        "--contours",
        "2",
        "--max-error",
        "0.1",
        "--export",
        "landxml",
        "--export=dxf",
        "--terrain",
    ];
    let words = [&["my tiles", "--bounds", "-1,2,3e6,4e7", "--write-config", "-"], &flags[..]].concat();
    let text = gdt_batch(root, &words).succeeded().out;
    for line in [
        "bounds = [-1.0, 2.0, 3000000.0, 40000000.0]",
        "surface = \"ground\"",
        "unit = \"metre\"",
        "max_error = 0.1",
        "raster = { resolution = 1.0 }",
        "export = [\"landxml\", \"dxf\"]",
        "contours = { dxf = true, interval = 2.0 }",
        "terrain = { format = \"quantized-mesh\" }",
        "directory = \"my tiles-terrain\"",
        "files = [\"my tiles/*.laz\"]",
    ] {
        assert!(text.contains(&format!("\n{line}\n")), "{line}: {text}");
    }
    for key in ["bounds", "surface", "unit", "max_error", "raster", "contours", "export"] {
        assert!(!text.contains(&format!("#{key} ")), "{key}: {text}");
    }
    assert!(!root.join("my tiles-terrain").exists());
    // A configuration is replaced only if that is asked for.
    let write = |more: &[&str]| gdt_batch(root, &[&["degrees.csv", "--write-config", "job.toml"], more].concat());
    write(&[]).succeeded();
    write(&[]).refused(2, &["job.toml exists already: choose another name, or add --force"]);
    write(&["--force"]).succeeded();
    let said = gdt_batch(root, &["degrees.csv", "--write-config", "-", "--json"]);
    said.refused(2, &["--json"]);
}

/// A configuration is never run with other options, nor taken for a cloud.
#[test]
fn configurations_and_point_clouds_do_not_mix() {
    let folder = folder_with_clouds();
    let root = folder.path();
    fs::write(root.join("job.toml"), "[input]\nfiles = [\"degrees.csv\"]\n[output]\ndirectory = \"out\"\n").unwrap();
    for (words, told) in [
        (&["cloud.copc.las", "job.toml"][..], "job.toml is a configuration: name one configuration alone"),
        (&["job.toml", "job.toml"], "name one configuration alone"),
        (&["job.toml", "--surface", "ground"], "--surface is for point clouds: set [input] surface in job.toml"),
        (&["job.toml", "-o", "x"], "--output is for point clouds: set [output] directory in job.toml"),
        (&["job.toml", "--raster=1"], "set [output] raster in job.toml"),
        (&["job.toml", "--write-config", "x"], "job.toml is a configuration already"),
        (&["job.toml", "check"], "`gdt-batch check job.toml`"),
        (&["no.laz"], "there is no file no.laz"),
        (&["no/"], "there is no file no/"),
        (&["my tiles/no*.laz"], "there is no file my tiles/no*.laz"),
        (&["--surface", "ground"], "name point clouds or a configuration"),
        (&["degrees.csv", "--bounds", "3,2,1"], "xmin,ymin,xmax,ymax"),
        (&["degrees.csv", "--max-error", "-1"], "--max-error: "),
        (&["degrees.csv", "--raster", "0"], "--raster: "),
        (&["degrees.csv", "--export", "ply,landxm"], "a similar value exists: 'landxml'"),
        (&["degrees.csv", "--contours", "0"], "--contours: "),
        (&["degrees.csv", "--bounds", "1,1,0,0"], "--bounds: "),
        (&["degrees.csv", "--clip", "no.gpkg"], "there is no file no.gpkg"),
        (&["job.toml", "--clip", "area.gpkg"], "--clip is for point clouds: set [input] clip in job.toml"),
        (&["degrees.csv", "-o", "degrees.csv"], "degrees.csv is not a directory"),
    ] {
        gdt_batch(root, words).refused(2, &[told]);
    }
    let names = fs::read_dir(root).unwrap().count();
    assert_eq!(names, 4, "nothing is written");
}

/// A bad file stops the job and its configuration, until the user leaves it out.
#[test]
fn a_bad_file_of_several_is_named_with_the_flag_that_leaves_it_out() {
    let folder = folder_with_clouds();
    let root = folder.path();
    fs::write(root.join("my tiles/bad.laz"), "version https://git-lfs.github.com/spec/v1\n").unwrap();
    gdt_batch(root, &["my tiles"]).refused(3, &["bad.laz", "--on-bad-file skip leaves bad files out"]);
    let written = gdt_batch(root, &["my tiles", "--write-config", "job.toml"]);
    written.refused(3, &["is written, but its job would stop", "bad.laz"]);
    gdt_batch(root, &["job.toml"]).refused(3, &["bad.laz"]);
    let said = gdt_batch(root, &["my tiles", "--on-bad-file", "skip"]).succeeded();
    assert!(said.out.contains("LEFT OUT: 1 of 3"), "{}", said.out);
    // A message that names an option has its flag too.
    fs::write(root.join("clash.csv"), "x,y,z\n0,0,1\n9,0,2\n9,9,3\n").unwrap();
    let said = gdt_batch(root, &["degrees.csv", "clash.csv"]);
    said.refused(2, &["--to-crs sets [input] to_crs"]);
}

#[test]
fn a_folder_in_a_configuration_stands_for_its_clouds() {
    let folder = folder_with_clouds();
    let root = folder.path();
    fs::write(root.join("my tiles/notes.txt"), "1 2 3\n").unwrap();
    let run = |files: &str| -> Said {
        fs::write(root.join("job.toml"), format!("[input]\nfiles = {files}\n[output]\ndirectory = \"out\"\n")).unwrap();
        gdt_batch(root, &["job.toml", "--json", "--quiet"])
    };
    let by_pattern = run("[\"my tiles/*.laz\"]").succeeded().json();
    for files in ["[\"my tiles\"]", "[\"my tiles/\"]", "[\"./my tiles\"]", "[\"my t*\"]"] {
        let report = run(files).succeeded().json();
        assert_eq!(report["file_list"], by_pattern["file_list"], "{files}");
        let warnings = report["warnings"].to_string();
        assert!(warnings.contains("notes.txt is not read, because the folder has LAS or LAZ"), "{warnings}");
    }
    // Texts count where there is nothing else.
    fs::create_dir_all(root.join("texts/inner")).unwrap();
    fs::copy(root.join("cloud.copc.las"), root.join("texts/inner/a.las")).unwrap();
    run("[\"texts\"]").refused(2, &["[input] files: ", "texts has no point clouds", "texts/inner, which has some"]);
    clouds::write(&root.join("texts"), "a.csv", &clouds::uniform(50, 1_000, 9));
    fs::write(root.join("texts/readme.txt"), "What these files are.\n").unwrap();
    let report = run("[\"texts\"]").succeeded().json();
    assert_eq!((&report["sites"], &report["files"]), (&50.into(), &1.into()));
    assert!(report["warnings"].to_string().contains("readme.txt"), "{report}");
}

/// A run that was killed goes on, as that of a configuration does.
#[test]
#[cfg(all(unix, feature = "fault-injection"))]
fn a_run_that_was_killed_goes_on_with_the_same_command() {
    let folder = folder_with_clouds();
    let root = folder.path();
    for words in [&["cloud.copc.las"][..], &["degrees.csv"]] {
        gdt_batch(root, &[words, &["-o", "whole", "--quiet"]].concat()).succeeded();
        for fault in ["tile:1", "published:1", "replacing:1"] {
            let mut killed = Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
            killed.args(words).args(["-o", "killed"]).env("GDT_FAULT", fault).current_dir(root);
            assert_eq!(killed.output().unwrap().status.code(), None, "{fault}");
            let said = gdt_batch(root, &[words, &["-o", "killed"]].concat()).succeeded();
            assert!(fault != "tile:1" || said.err.contains("continuing an interrupted run"), "{said:?}");
            assert_eq!(results(&root.join("killed")), results(&root.join("whole")), "{words:?} {fault}");
            assert!(!root.join("killed/job").exists());
        }
    }
}

#[test]
fn a_url_that_cannot_be_read_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let said = gdt_batch(folder.path(), &["ftp://x/a.laz"]);
    said.refused(2, &["files can be read by https://, http:// and s3://, not by ftp://"]);
}
