//! Names of files that are not UTF-8, that look like patterns, or that a terminal would obey, and what else messages quote.

use std::ffi::{OsStr, OsString};
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use crate::program::{Said, gdt_batch, number};

/// Writes a text of `side` times `side` points that begins at x = `first`.
fn write_square(path: &Path, first: usize, side: usize) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let rows = (0..side * side).map(|i| format!("{} {} {}\n", first + i / side, i % side, (i * i) % 7));
    fs::write(path, rows.collect::<String>()).unwrap();
}

fn write_config(path: &Path, files: &str) {
    fs::write(path, format!("[input]\nfiles = {files}\n[output]\ndirectory = \"out\"\n")).unwrap();
}

/// Runs the program in `folder` with words that need not be UTF-8.
#[track_caller]
fn run(folder: &Path, words: &[&OsStr]) -> Said {
    gdt_batch(folder, words)
}

/// Returns a name in Latin-1.
fn latin(name: &str) -> OsString {
    OsStr::from_bytes(&name.chars().map(|c| c as u8).collect::<Vec<_>>()).into()
}

#[test]
fn files_in_latin_1_are_read_wherever_they_are() {
    let root = tempfile::tempdir().unwrap();
    let (home, other) = (root.path().join(latin("Gelände")), root.path().join("plain"));
    for (folder, names) in [(&home, ["a.xyz", "Süd/Höhe.xyz"]), (&other, ["a.xyz", "b/c.xyz"])] {
        write_square(&folder.join(latin(names[0])), 0, 12);
        write_square(&folder.join(latin(names[1])), 12, 12);
        write_config(&folder.join("job.toml"), "[\"*.xyz\", \"**/*.xyz\"]");
    }
    let [report, expected] = [&home, &other].map(|folder| {
        let check = gdt_batch(folder, &["check", "--json", "job.toml"]).succeeded().json();
        assert_eq!(number(&check["records"]), 288);
        run(root.path(), &["--json".as_ref(), "--quiet".as_ref(), folder.join("job.toml").as_ref()]).succeeded().json()
    });
    assert_eq!(number(&report["sites"]), 288);
    assert_eq!(report["mesh_digest"], expected["mesh_digest"]);
    let sums = [&home, &other].map(|folder| fs::read_to_string(folder.join("out/XXH128SUMS")).unwrap());
    assert_eq!(sums[0], sums[1]);
    let inputs = [home.join("a.xyz"), home.join(latin("Süd/Höhe.xyz"))];
    let words = ["verify", "out", "--json", "--input"].map(OsStr::new);
    let verdict = run(&home, &[&words[..], &[inputs[0].as_ref(), inputs[1].as_ref()]].concat()).succeeded().json();
    assert_eq!(verdict["failures"], serde_json::json!([]));
    // Tasks read the plan of another process.
    let words = ["submit", "job.toml", "--engine", "local", "--tasks", "2", "--restart"];
    gdt_batch(&home, &words).succeeded();
    assert_eq!(fs::read_to_string(home.join("out/XXH128SUMS")).unwrap(), sums[0]);
}

#[test]
fn a_bad_file_in_latin_1_stops_the_job_or_is_left_out() {
    let root = tempfile::tempdir().unwrap();
    let bad = root.path().join(latin("Höhe.laz"));
    write_square(&root.path().join("a.xyz"), 0, 12);
    fs::write(&bad, "version https://git-lfs.github.com/spec/v1\n").unwrap();
    write_config(&root.path().join("job.toml"), "[\"a.xyz\", \"*.laz\"]\non_bad_file = \"stop\"");
    gdt_batch(root.path(), &["job.toml"]).refused(3, &["H\u{fffd}he.laz: is a Git LFS pointer"]);
    write_config(&root.path().join("job.toml"), "[\"a.xyz\", \"*.laz\"]\non_bad_file = \"skip\"");
    let said = gdt_batch(root.path(), &["job.toml", "--json", "--quiet"]).succeeded();
    assert!(said.err.contains("LEFT OUT: 1 of 2"), "{}", said.err);
    assert_eq!(said.json()["skipped"][0]["file"], "H\0f6he.laz");
    // The report names it so that it is known again.
    let words = ["verify", "out", "--input", "a.xyz"].map(OsStr::new);
    run(root.path(), &[&words[..], &[bad.as_ref()]].concat()).succeeded();
}

#[test]
fn init_names_files_in_latin_1_by_patterns() {
    let root = tempfile::tempdir().unwrap();
    write_square(&root.path().join(latin("Süd/Höhe.xyz")), 0, 12);
    let file = root.path().join(latin("Süd/Höhe.xyz"));
    run(root.path(), &["init".as_ref(), file.as_ref()]).succeeded();
    let text = fs::read_to_string(root.path().join("job.toml")).unwrap();
    assert!(text.contains("S?d/H?he.xyz\"]"), "{text}");
    let report = gdt_batch(root.path(), &["--json", "--quiet", "job.toml"]).succeeded().json();
    assert_eq!(number(&report["sites"]), 144);
}

#[test]
fn a_file_that_is_called_like_a_pattern_can_be_named() {
    let root = tempfile::tempdir().unwrap();
    for (name, first) in [("a[1].xyz", 0), ("a1.xyz", 100), ("b[.xyz", 200), ("c*.xyz", 300), ("cd.xyz", 400)] {
        write_square(&root.path().join(name), first, 12);
    }
    let job = |files: &str| {
        write_config(&root.path().join("job.toml"), files);
        gdt_batch(root.path(), &["job.toml", "--json", "--quiet", "--restart"])
    };
    for (name, other) in [("a[1].xyz", Some("a1.xyz")), ("b[.xyz", None), ("c*.xyz", Some("cd.xyz"))] {
        let report = job(&format!("[\"{name}\"]")).succeeded().json();
        assert_eq!(number(&report["sites"]), 144, "{name}");
        let warnings = report["warnings"].to_string();
        assert_eq!(warnings.contains("so it is no pattern"), other.is_some(), "{name}: {warnings}");
        assert!(other.is_none_or(|other| warnings.contains(other)), "{name}: {warnings}");
    }
    write_square(&root.path().join("d [2]/e.xyz"), 0, 12);
    assert_eq!(number(&job("[\"d [2]/*.xyz\"]").succeeded().json()["sites"]), 144);
    job("[\"d[.xyz\"]").refused(2, &["d[.xyz", "there is no file of this name, and it is no pattern", "[[]"]);
}

#[test]
fn a_terminal_obeys_no_name() {
    let root = tempfile::tempdir().unwrap();
    let name = "\u{1b}[31mred\nerror: \u{9b}.xyz";
    write_square(&root.path().join(name), 0, 12);
    write_config(&root.path().join("job.toml"), "[\"*.xyz\"]");
    let is_harmless = |said: &Said| {
        let all = format!("{}{}", said.out, said.err);
        assert!(!all.chars().any(|c| c.is_control() && c != '\n' && c != '\t'), "{all:?}");
        all
    };
    let is_escaped = |said: &Said| assert!(is_harmless(said).contains("\\u{1b}[31mred"), "{said:?}");
    is_escaped(&gdt_batch(root.path(), &["check", "job.toml"]).succeeded());
    is_escaped(&gdt_batch(root.path(), &["info", name]).succeeded());
    is_escaped(&gdt_batch(root.path(), &["info", &format!("no{name}")]));
    is_escaped(&gdt_batch(root.path(), &["sample", name]));
    // The parser of arguments leaves such signs out.
    is_harmless(&gdt_batch(root.path(), &[&format!("--{name}")]));
    is_harmless(&gdt_batch(root.path(), &["init", "-o", "-", name]).succeeded());
    fs::write(root.path().join(name), "version https://git-lfs.github.com/spec/v1\n").unwrap();
    let said = gdt_batch(root.path(), &["job.toml"]);
    is_escaped(&said);
    said.refused(3, &["red\\nerror: \\u{9b}.xyz: is a Git LFS pointer"]);
    // What programs read has the name itself.
    write_square(&root.path().join(name), 0, 12);
    assert_eq!(gdt_batch(root.path(), &["info", "--json", name]).succeeded().json()["file"], name);
}

#[test]
fn what_messages_quote_is_short() {
    let root = tempfile::tempdir().unwrap();
    let config = root.path().join("job.toml");
    let long = "x".repeat(300_000);
    for (text, words) in [
        (format!("[input]\nfiles = [\"{long}\"\n"), &["line 2"][..]),
        (format!("[input]\nfiles = \"{long}\"\n"), &["line 2", "[input] files takes a list of texts"]),
        (format!("[input]\n{long} = 1\n"), &["[input] has no key xxx", "it takes files, surface"]),
        (
            format!("[input]\nfiles = [\"{long}.laz\"]\n[output]\ndirectory = \"out\"\n"),
            &["there is no file", "left out"],
        ),
    ] {
        fs::write(&config, text).unwrap();
        let said = gdt_batch(root.path(), &["job.toml"]);
        said.refused(2, words);
        assert!(said.err.len() < 6000, "{} bytes", said.err.len());
    }
}

#[test]
fn a_nul_character_is_an_error_of_the_configuration() {
    let root = tempfile::tempdir().unwrap();
    write_square(&root.path().join("a.xyz"), 0, 12);
    for text in [
        "[input]\nfiles = [\"a\\u0000.xyz\"]\n[output]\ndirectory = \"out\"\n",
        "[input]\nfiles = [\"a.xyz\"]\n[output]\ndirectory = \"o\\u0000ut\"\n",
        "[input]\nfiles = [\"a.xyz\"]\n[output]\ndirectory = \"out\"\nheight_offset = \"a\\u0000.gtx\"\n",
    ] {
        fs::write(root.path().join("job.toml"), text).unwrap();
        gdt_batch(root.path(), &["job.toml"]).refused(2, &["has a NUL character"]);
    }
}
