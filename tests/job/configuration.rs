//! Configurations: the shipped ones run, wrong ones are refused with the line, and an output that cannot be written is named.

use std::fs;
use std::path::Path;

use crate::clouds;
use crate::program::{Job, gdt_batch};

const LEAST: &str = "[input]\nfiles = [\"cloud.csv\"]\n[output]\ndirectory = \"out\"\n";

fn folder_with_cloud() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    clouds::write(folder.path(), "cloud.csv", &clouds::uniform(100, 1_000, 9));
    folder
}

/// A folder with copies of the shipped configurations and with the sample terrain that they name.
fn shipped() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let configs = folder.path().join("configs");
    fs::create_dir(&configs).unwrap();
    for name in ["quickstart.toml", "full.toml"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs").join(name);
        fs::copy(from, configs.join(name)).unwrap();
    }
    gdt_batch(folder.path(), &["sample", "sample/terrain.laz", "--points", "60000"]).succeeded();
    folder
}

#[test]
fn the_shipped_configurations_run() {
    let folder = shipped();
    for (config, out) in [("configs/quickstart.toml", "sample/out"), ("configs/full.toml", "sample/out-full")] {
        gdt_batch(folder.path(), &["check", config]).succeeded();
        gdt_batch(folder.path(), &[config]).succeeded();
        gdt_batch(folder.path(), &["verify", out]).succeeded();
        for name in ["terrain.glb", "georeference.json", "report.json", "preview.png"] {
            assert!(folder.path().join(out).join(name).is_file(), "{config}: no {name}");
        }
        assert!(!folder.path().join(out).join("job").exists(), "{config}: no temporary file stays");
    }
}

#[test]
fn the_full_configuration_shows_every_option_with_its_default() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/full.toml");
    let mut full = gdt_batch::config::load(&path).unwrap();
    (full.input.classes, full.input.bounds, full.input.heights) = (None, None, None);
    // What they show is no default either.
    assert!(full.output.height_offset.take().is_some() && full.output.copyright.take().is_some());
    assert!(full.output.imagery.take().is_some());
    assert!(full.output.raster.take().is_some_and(|raster| raster.nodata == Default::default()));
    assert!(!std::mem::take(&mut full.output.export).is_empty());
    assert!(full.output.contours.take().is_some() && full.output.terrain.take().is_some());
    let folder = folder_with_cloud();
    let least = folder.path().join("job.toml");
    fs::write(&least, LEAST).unwrap();
    let mut least = gdt_batch::config::load(&least).unwrap();
    (least.input.files, least.output.directory) = (full.input.files.clone(), full.output.directory.clone());
    assert_eq!(toml::to_string(&full).unwrap(), toml::to_string(&least).unwrap());
    let text = fs::read_to_string(path).unwrap();
    for (section, options) in toml::Value::try_from(&least).unwrap().as_table().unwrap() {
        assert!(text.contains(&format!("[{section}]")), "{section}");
        let options = options.as_table().unwrap().keys().filter(|name| *name != "csv");
        options.for_each(|name| assert!(text.contains(&format!("\n{name} = ")), "{section}.{name}"));
    }
    for name in ["delimiter", "header", "columns", "comment"] {
        assert!(text.contains(&format!("\n# {name} = ")), "input.csv.{name}");
    }
}

#[test]
fn wrong_configurations_are_refused_with_the_line_number() {
    let folder = folder_with_cloud();
    fs::create_dir(folder.path().join("empty")).unwrap();
    for (from, to, words) in [
        ("files", "fils", &["line 2", "fils"][..]),
        ("[\"cloud.csv\"]", "3", &["line 2", "[input] files takes a list of texts"]),
        ("[output]", "bounds = [9, 0, 1, 1]\n[output]", &["line 3", "xmin"]),
        (
            "[output]",
            "bounds = [0, 0, 5, 9, 9, 9]\n[output]",
            &["line 3", "four numbers", "without heights, and not 6"],
        ),
        ("[output]", "classes = [300]\n[output]", &["line 3", "300"]),
        ("[output]", "duplicates = \"last\"\n[output]", &["line 3", "last", "lowest"]),
        ("[output]", "resolution = -1\n[output]", &["line 3", "resolution"]),
        ("[output]", "max_malformed_fraction = 2.0\n[output]", &["line 3", "fraction"]),
        ("[output]", "[input.csv]\ndelimeter = \",\"\n[output]", &["line 4", "delimeter"]),
        ("[output]", "[triangulation]\nmax_points_per_tile = 1\n[output]", &["line 4", "max_points_per_tile"]),
        ("[output]", "[triangulation]\nbackend = \"cuda\"\n[output]", &["line 4", "cuda"]),
        ("[output]", "[gpu]\ntexture = 3\n[output]", &["line 4", "texture"]),
        ("[output]", "[limits]\nmemory = \"1 MiB\"\n[output]", &["line 4", "128 MiB"]),
        ("[output]", "[limits]\nmemory = 4\n[output]", &["line 4", "memory takes text", "4 GiB"]),
        ("[output]", "[limits]\nthreads = -1\n[output]", &["line 4", "threads"]),
        ("[output]", "[ouput]", &["line 3", "ouput"]),
        ("directory", "height_offset = -1e6\ndirectory", &["height_offset", "100000"]),
        ("directory", "height_offset = nan\ndirectory", &["height_offset", "100000"]),
        ("directory", "normals = 1\ndirectory", &["line 4", "true or false"]),
        ("\"out\"", "\"out", &["line 4", "a text has no closing quote"]),
        ("[\"cloud.csv\"]", "[]", &["files is empty"]),
        ("[\"cloud.csv\"]", "[\"no such *.laz\"]", &["no such *.laz"]),
        ("[\"cloud.csv\"]", "[\"empty\"]", &["[input] files: ", "empty has no point clouds"]),
        ("[\"cloud.csv\"]", "[\"a[\"]", &["a["]),
    ] {
        fs::write(folder.path().join("job.toml"), LEAST.replacen(from, to, 1)).unwrap();
        gdt_batch(folder.path(), &["job.toml"]).refused(2, words);
        gdt_batch(folder.path(), &["check", "job.toml"]).refused(2, words);
    }
    assert!(!folder.path().join("out").exists(), "a refused job writes nothing");
}

#[test]
fn a_command_line_without_a_readable_configuration_is_refused() {
    let folder = folder_with_cloud();
    gdt_batch(folder.path(), &["no.toml"]).refused(2, &["no configuration file no.toml"]);
    fs::write(folder.path().join("old.toml"), b"[input]\nfiles = [\"Stra\xdfe.laz\"]\n").unwrap();
    gdt_batch(folder.path(), &["old.toml"]).refused(2, &["old.toml: line 2 has the byte 0xdf, which is not UTF-8"]);
    gdt_batch(folder.path(), &["check", "."]).refused(2, &[". is a folder, not a configuration", "gdt-batch verify"]);
    fs::write(folder.path().join("cloud.las"), b"LASF\0\0").unwrap();
    gdt_batch(folder.path(), &["check", "cloud.las"])
        .refused(2, &["cloud.las: this is a point cloud, not a configuration", "--write-config"]);
    fs::write(folder.path().join("binary.toml"), [0xff, 0xfe, 0x00]).unwrap();
    gdt_batch(folder.path(), &["binary.toml"]).refused(2, &["binary.toml"]);
    gdt_batch(folder.path(), &["--no-such-option"]).refused(2, &["--no-such-option"]);
    assert_eq!(gdt_batch::<&str>(folder.path(), &[]).code, 2, "without arguments it shows the help");
}

#[test]
#[cfg(target_os = "linux")]
fn a_job_that_cannot_make_its_output_directory_may_be_retried() {
    let folder = folder_with_cloud();
    // Not even root can write there.
    fs::write(folder.path().join("job.toml"), LEAST.replace("\"out\"", "\"/proc/none/out\"")).unwrap();
    gdt_batch(folder.path(), &["job.toml"]).refused(1, &["/proc/none/out", "cannot write"]);
}

/// A job may write to the folder of its inputs and its configuration. It leaves them there, and takes none of them for a result.
#[test]
fn a_job_in_the_folder_of_its_inputs_leaves_them_alone() {
    let folder = folder_with_cloud();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("job.toml"), LEAST.replace("\"out\"", "\".\"")).unwrap();
    fs::write(path(".env"), "theirs").unwrap();
    let own = || ["cloud.csv", "job.toml", ".env"].map(|name| fs::read(path(name)).unwrap());
    let before = own();
    for _ in 0..2 {
        gdt_batch(folder.path(), &["job.toml"]).succeeded();
        gdt_batch(folder.path(), &["verify", "."]).succeeded();
    }
    assert!(own() == before && !path("job").exists());
    let sums = fs::read_to_string(path("XXH128SUMS")).unwrap();
    assert!(
        sums.contains("  terrain.glb\n") && ["cloud.csv", "job.toml", ".env"].iter().all(|name| !sums.contains(name))
    );
}

#[test]
fn an_input_where_a_result_would_be_is_named() {
    let folder = folder_with_cloud();
    let cloud = fs::read(folder.path().join("cloud.csv")).unwrap();
    for directory in [".", "../here"] {
        let here = folder.path().join("here");
        fs::create_dir_all(&here).unwrap();
        fs::write(here.join("breaklines.csv"), &cloud).unwrap();
        let config = LEAST.replace("\"out\"", &format!("{directory:?}")).replace("cloud.csv", "*.csv");
        fs::write(here.join("job.toml"), config).unwrap();
        let words = ["[input] files: ", "breaklines.csv has the name of a result", "choose another [output] directory"];
        gdt_batch(&here, &["job.toml"]).refused(2, &words);
        assert!(fs::read(here.join("breaklines.csv")).unwrap() == cloud);
    }
}

/// Before it reads the first point, a job names anything else that stands where it needs to write, and leaves it there.
#[test]
#[cfg(unix)]
fn anything_in_the_way_of_the_output_is_named() {
    let folder = folder_with_cloud();
    fs::write(folder.path().join("job.toml"), LEAST).unwrap();
    let there = |name: &str| folder.path().join(name);
    let refused = |name: &str, words: &str| {
        for arguments in [&["job.toml"][..], &["job.toml", "--force"], &["check", "job.toml"]] {
            gdt_batch(folder.path(), arguments).refused(2, &[&format!("{name} {words}"), "move it away"]);
        }
    };
    // As files, and as links that lead nowhere. That they can be removed here shows that the job left them alone.
    let by_files = |name: &str| {
        fs::write(there(name), "theirs").unwrap();
        refused(name, "is not a directory");
        fs::remove_file(there(name)).unwrap();
        std::os::unix::fs::symlink("nowhere", there(name)).unwrap();
        refused(name, "is a broken link");
        fs::remove_file(there(name)).unwrap();
    };
    by_files("out");
    fs::create_dir(there("out")).unwrap();
    ["out/tiles", "out/levels", "out/cut", "out/job"].into_iter().for_each(by_files);
    fs::create_dir(there("out/tiles")).unwrap();
    for name in ["out/tileset.json", "out/report.json", "out/tiles/000000.glb"] {
        fs::create_dir(there(name)).unwrap();
        refused(name, "is a directory");
        fs::remove_dir(there(name)).unwrap();
    }
    // A file that no job wrote, in the place of the report.
    fs::write(there("out/report.json"), "theirs").unwrap();
    for arguments in [&["job.toml"][..], &["check", "job.toml"]] {
        gdt_batch(folder.path(), arguments).refused(2, &["out/report.json", "would be overwritten", "move it away"]);
    }
    fs::remove_file(there("out/report.json")).unwrap();
    gdt_batch(folder.path(), &["job.toml"]).succeeded();
}

/// Only what the list of the earlier job names is this program's to remove or replace.
#[test]
fn files_of_others_among_the_results_of_an_earlier_job_are_named_and_stay() {
    let folder = folder_with_cloud();
    fs::write(folder.path().join("job.toml"), LEAST).unwrap();
    let there = |name: &str| folder.path().join("out").join(name);
    let run = |arguments: &[&str]| gdt_batch(folder.path(), arguments);
    run(&["job.toml"]).succeeded();
    for name in
        ["tiles/123456.glb", "tiles/256/482/123456.glb", "terrain.tif", "tilesets/000000.json", "breaklines.csv"]
    {
        fs::create_dir_all(there(name).parent().unwrap()).unwrap();
        fs::write(there(name), "theirs").unwrap();
        let report = fs::read(there("report.json")).unwrap();
        for arguments in [&["job.toml"][..], &["--restart", "job.toml"], &["check", "job.toml"]] {
            run(arguments).refused(2, &[name, "is not known to be a result of an earlier job", "move it away"]);
        }
        assert_eq!(fs::read(there(name)).unwrap(), b"theirs");
        assert!(fs::read(there("report.json")).unwrap() == report, "{name}");
        fs::remove_file(there(name)).unwrap();
    }
    // Names that no job writes.
    fs::write(there("tiles/roof.glb"), "theirs").unwrap();
    fs::write(there("notes.txt"), "theirs").unwrap();
    run(&["job.toml"]).succeeded();
    assert!(there("tiles/roof.glb").exists() && there("notes.txt").exists());
    // Without the list nothing tells whose the files are.
    fs::remove_file(there("XXH128SUMS")).unwrap();
    run(&["job.toml"])
        .refused(2, &["is not known to be a result of an earlier job", "XXH128SUMS is missing or damaged"]);
    fs::remove_dir_all(folder.path().join("out")).unwrap();
    run(&["job.toml"]).succeeded();
}

#[test]
fn help_names_the_commands_examples_and_exit_codes() {
    let help = gdt_batch(Path::new("."), &["--help"]).succeeded().out;
    for words in ["check", "verify", "info", "sample", "Examples", "Exit codes", "options.md"] {
        assert!(help.contains(words), "{words}");
    }
}

#[test]
fn a_tilde_is_the_home_directory_and_variables_are_refused_by_name() {
    let folder = folder_with_cloud();
    let run = |files: &str, out: &str| {
        let text = LEAST.replace("cloud.csv", files).replace("\"out\"", &format!("{out:?}"));
        fs::create_dir_all(folder.path().join("jobs")).unwrap();
        fs::write(folder.path().join("jobs/job.toml"), text).unwrap();
        let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_gdt-batch"));
        let program = program.arg("jobs/job.toml").current_dir(folder.path()).env("HOME", folder.path());
        let output = program.env("CLOUDS", "/data/clouds").env_remove("GDT_NOT_SET").output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, said) = run("~/cl*.csv", "~/home out");
    assert_eq!(code, Some(0), "{said}");
    assert!(folder.path().join("home out/report.json").is_file());
    for (files, out, words) in [
        ("$CLOUDS/*.laz", "out", &["[input] files", "$CLOUDS", "CLOUDS is /data/clouds"][..]),
        ("~/cloud.csv", "${GDT_NOT_SET}/out", &["[output] directory", "${GDT_NOT_SET}", "is not set"]),
        ("~someone/cloud.csv", "out", &["~someone", "your own home directory"]),
    ] {
        let (code, said) = run(files, out);
        assert_eq!(code, Some(2), "{said}");
        assert!(words.iter().all(|word| said.contains(word)), "{words:?}: {said}");
    }
    assert!(!folder.path().join("jobs/${GDT_NOT_SET}").exists());
    // What is really called so is meant.
    fs::create_dir_all(folder.path().join("jobs/$CLOUDS")).unwrap();
    fs::copy(folder.path().join("cloud.csv"), folder.path().join("jobs/$CLOUDS/a.csv")).unwrap();
    let (code, said) = run("$CLOUDS/a.csv", "out");
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn a_job_whose_points_are_all_out_of_bounds_says_where_they_lie() {
    let folder = tempfile::tempdir().unwrap();
    let cloud = folder.path().join("cloud.csv");
    fs::write(&cloud, "x,y,z\n1000.123,5000.5,1\n1200,5100,2\n1100,5200.987,3\n").unwrap();
    let job = |bounds: &str| Job::on(&[&cloud]).with("input", &format!("bounds = {bounds}"));
    let place = "[1000.12, 5000.50, 1200.00, 5200.99]";
    job("[0, 0, 10, 10]").run().refused(3, &["3 outside the bounds", "[0.0, 0.0, 10.0, 10.0]", place]);
    assert!(!job("[0, 0, 10, 10]").run().err.contains("exchanged"));
    job("[5000, 1000, 5200, 1200]").run().refused(3, &[place, "x and y look exchanged"]);
    job(place).report();
}

/// Results take their places at once, which the system does on one disk only.
#[test]
#[cfg(target_os = "linux")]
fn a_folder_of_results_on_another_disk_is_refused_before_the_job() {
    use std::os::unix::fs::MetadataExt;
    let folder = folder_with_cloud();
    let Ok(elsewhere) = tempfile::tempdir_in("/dev/shm") else { return eprintln!("skipped: no /dev/shm") };
    if elsewhere.path().metadata().unwrap().dev() == folder.path().metadata().unwrap().dev() {
        return eprintln!("skipped: /dev/shm is the disk of the tests");
    }
    fs::write(folder.path().join("job.toml"), LEAST).unwrap();
    fs::create_dir(folder.path().join("out")).unwrap();
    let tiles = folder.path().join("out/tiles");
    std::os::unix::fs::symlink(elsewhere.path(), &tiles).unwrap();
    gdt_batch(folder.path(), &["job.toml"]).refused(2, &["out/tiles is on another disk"]);
    // On the same disk a link is as good as a folder.
    fs::remove_file(&tiles).unwrap();
    fs::create_dir(folder.path().join("there")).unwrap();
    std::os::unix::fs::symlink("../there", &tiles).unwrap();
    gdt_batch(folder.path(), &["job.toml"]).succeeded();
    assert!(folder.path().join("there/000000.glb").is_file() && tiles.is_symlink());
}

#[test]
fn paths_are_relative_to_the_configuration() {
    let folder = tempfile::tempdir().unwrap();
    let odd = folder.path().join("odd [name] *");
    fs::create_dir(&odd).unwrap();
    clouds::write(&odd, "cloud.csv", &clouds::uniform(100, 1_000, 9));
    fs::write(odd.join("job.toml"), LEAST.replace("cloud.csv", "*.csv")).unwrap();
    gdt_batch(folder.path(), &["odd [name] */job.toml"]).succeeded();
    assert!(odd.join("out/report.json").is_file());
    let job = Job::on(&[odd.join("cloud.csv")]);
    job.run().succeeded();
}
