//! Common mistakes in configurations and command lines: the message says what is wrong in words that need no knowledge of TOML, names the
//! line, and suggests what may be meant. It never suggests a name that no page of the manual has.

use std::fs;
use std::path::Path;

use crate::clouds;
use crate::program::gdt_batch;

/// What parsers say, and names that are old or only for the program.
const NEVER: [&str; 14] = [
    "TOML parse error",
    "invalid type",
    "unknown field",
    "unknown variant",
    "missing field",
    "sequence",
    "expected",
    "struct",
    "malformed_share",
    "without_ignored_ground",
    "level_sites",
    "sites_per_tile",
    "\"tiles\"",
    "--fresh",
];

/// A line for `[input]`, and what the message has.
const IN_INPUT: [(&str, &[&str]); 19] = [
    ("surfce = \"ground\"", &["line 3: [input] has no key surfce; did you mean surface = \"ground\"?"]),
    ("Surface = 3", &["line 3: [input] has no key Surface; did you mean surface, as in surface = \"all\"?"]),
    ("colour = \"rgb\"", &["line 3: [input] has no key colour", "files, surface, returns"]),
    (
        "surface = \"gorund\"",
        &[
            "line 3: [input] surface takes \"all\", \"ground\", \"bare-earth\", \"first\" or \"last\"",
            "did you mean surface = \"ground\"?",
        ],
    ),
    ("surface = ground", &["line 3: [input] surface: put the text in quotes: surface = \"ground\""]),
    ("surface = “ground”", &["line 3: [input] surface: write straight quotes: surface = \"ground\""]),
    ("surface: \"ground\"", &["line 3: [input] surface: put an equals sign", "surface = \"ground\""]),
    ("surface = \"all\"\nsurface = \"all\"", &["line 4: [input] surface: it is set twice"]),
    (
        "classes = [\"ground\"]",
        &[
            "line 3: [input] classes takes a list of whole numbers from 0 to 255",
            "[2, 9]",
            "did you mean surface = \"ground\"?",
        ],
    ),
    ("classes = \"2, 9\"", &["line 3: [input] classes takes a list", "did you mean classes = [2, 9]?"]),
    ("classes = 2", &["line 3: [input] classes takes a list", "did you mean classes = [2]?"]),
    ("unit = \"feet\"", &["\"metre\", \"foot\" or \"us-foot\"", "did you mean unit = \"foot\"?"]),
    ("unit = \"Meters\"", &["did you mean unit = \"metre\"?"]),
    ("crs = 26915", &["line 3: [input] crs takes text", "did you mean crs = \"EPSG:26915\"?"]),
    (
        "bounds = \"1,2,3,4\"",
        &["line 3: [input] bounds takes a list of numbers", "did you mean bounds = [1, 2, 3, 4]?"],
    ),
    ("max_error = 0.1", &["line 3: [input] has no key max_error: it is a key of [output]"]),
    ("csv = true", &["line 3: [input] csv takes a table in braces"]),
    ("[input.cvs]\nheader = true", &["line 3: [input] has no key cvs; did you mean the table [input.csv]?"]),
    ("[input.csv]\ncoluns = [\"x\"]", &["line 4: [input.csv] has no key coluns; did you mean columns = [\"x\"]?"]),
];

/// A line for `[output]`, and what the message has.
const IN_OUTPUT: [(&str, &[&str]); 17] = [
    (
        "[output.raster]\nresolution = 1.0\npmtiles = true",
        &["line 7: [output.raster] pmtiles takes \"terrarium\" or \"terrain-rgb\""],
    ),
    ("raster = 2.0", &["line 5: [output] raster takes a table", "did you mean raster = { resolution = 2.0 }?"]),
    ("[output.raster]\norigin = [0, 0]", &["line 5: [output.raster] has no key resolution", "resolution = 1.0"]),
    (
        "[breaklines]\nfiles = [\"a.gpkg\"]",
        &["line 5: there can be several tables of breaklines", "write [[breaklines]]"],
    ),
    ("[[breaklines]]\nkind = \"lake\"", &["line 5: [[breaklines]] has no key files", "files = [\"lakes.gpkg\"]"]),
    (
        "[[breaklines]]\nfiles = [\"a\"]\nkind = \"lakes\"",
        &["line 7: [[breaklines]] kind takes", "did you mean kind = \"lake\"?"],
    ),
    ("max_error = 0,1", &["line 5: [output] max_error: write a decimal point: max_error = 0.1"]),
    (
        "max_error = \"0.1\"",
        &["line 5: [output] max_error is \"none\" or a positive number", "did you mean max_error = 0.1?"],
    ),
    ("page = False", &["line 5: [output] page: write true or false in small letters: page = false"]),
    ("normals = \"yes\"", &["line 5: [output] normals takes true or false; did you mean normals = true?"]),
    ("format = \"tile\"", &["line 5: [output] format takes \"3dtiles\", \"glb\" or \"auto\""]),
    (
        "attributes = [\"clasification\"]",
        &["line 5: [output] attributes is a list of", "did you mean attributes = [\"classification\"]?"],
    ),
    (
        "export = [\"obj\", \"land-xml\"]",
        &["line 5: [output] export is a list of \"landxml\"", "did you mean export = [\"obj\", \"landxml\"]?"],
    ),
    ("[limits]\nthreads = \"4\"", &["line 6: [limits] threads takes a number; did you mean threads = 4?"]),
    ("[limits]\nmemory = 8", &["line 6: [limits] memory takes text", "did you mean memory = \"8 GiB\"?"]),
    ("[csv]\ndelimiter = \";\"", &["line 5: there is no table [csv]; did you mean [input.csv]?"]),
    ("[input]\nsurface = \"all\"", &["line 5: the table [input] appears twice"]),
];

/// Whole configurations, and what the message has.
const WHOLE: [(&str, &[&str]); 12] = [
    (
        "[input]\nfiles = \"a.laz\"\n",
        &["line 2: [input] files takes a list of texts", "did you mean files = [\"a.laz\"]?"],
    ),
    (
        "[input]\nfiles = [\"C:\\data\\x.laz\"]\n",
        &["line 2: [input] files: a backslash", "\"C:/data/x.laz\" or 'C:\\data\\x.laz'"],
    ),
    ("[input]\nfiles = [\"a.laz\" \"b.laz\"]\n", &["line 2: [input] files: put a comma between two values"]),
    ("[input]\nfiles = [\"a.laz]\n[output]\n", &["line 2: [input] files: a text has no closing quote"]),
    ("[input]\nfiles = [\"a.laz\"\n[output]\n", &["line 3: [input]: close the list above with ]"]),
    (
        "[input]\nfiles = [a.laz, \"b.laz\"]\n",
        &["line 2: [input] files: put the text in quotes: files = [\"a.laz\", \"b.laz\"]"],
    ),
    (
        "[input]\nfiles = a.laz, b.laz\n",
        &["line 2: [input] files: put the text in quotes: files = [\"a.laz\", \"b.laz\"]"],
    ),
    ("[input\nfiles = [\"a.laz\"]\n", &["line 1: close the name of the table"]),
    ("files = [\"a.laz\"]\n", &["line 1: files is in no table: it is a key of [input]"]),
    ("[input]\nfiles = [\"a.laz\"]\n[ouput]\n", &["line 3: there is no table [ouput]; did you mean [output]?"]),
    ("[input]\nfiles = [\"a.laz\"]\n", &["job.toml: there is no table [output]", "directory = "]),
    ("[input]\nfiles = [\"a.laz\"]\n[output]\n", &["line 3: [output] has no key directory", "directory = "]),
];

#[test]
fn mistakes_in_a_configuration_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let input = |line: &str| format!("[input]\nfiles = [\"a.laz\"]\n{line}\n[output]\ndirectory = \"out\"\n");
    let output = |line: &str| format!("[input]\nfiles = [\"a.laz\"]\n[output]\ndirectory = \"out\"\n{line}\n");
    let of_input = IN_INPUT.iter().map(|(line, words)| (input(line), *words));
    let of_output = IN_OUTPUT.iter().map(|(line, words)| (output(line), *words));
    let whole = WHOLE.iter().map(|(text, words)| (text.to_string(), *words));
    for (text, words) in of_input.chain(of_output).chain(whole) {
        fs::write(folder.path().join("job.toml"), &text).unwrap();
        let said = gdt_batch(folder.path(), &["check", "job.toml"]);
        said.refused(2, &[&["job.toml: "], words].concat());
        // The text of the user is shown below the sentence.
        let sentence = said.err.lines().next().unwrap();
        let jargon: Vec<&&str> =
            NEVER.iter().filter(|word| sentence.contains(**word) && !text.contains(**word)).collect();
        assert!(jargon.is_empty(), "{jargon:?} in {sentence}");
        assert_eq!(said.err.contains('^'), sentence.contains(": line "), "{}", said.err);
    }
}

/// TOML reads `\t` as a tab, and such a file is not there.
#[test]
fn a_path_with_an_escape_that_toml_knows_is_explained_too() {
    let folder = tempfile::tempdir().unwrap();
    let text = "[input]\nfiles = [\"C:\\temp\\a.laz\"]\n[output]\ndirectory = \"out\"\n".replace("\\a", "/a");
    fs::write(folder.path().join("job.toml"), text).unwrap();
    gdt_batch(folder.path(), &["check", "job.toml"])
        .refused(2, &["there is no file C:", "a backslash has a meaning of its own"]);
}

#[test]
fn mistakes_about_files_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    clouds::write(folder.path(), "a.csv", &clouds::uniform(50, 1_000, 9));
    fs::create_dir(folder.path().join("empty")).unwrap();
    write("list.txt", "a.csv\nnotes for me\nb.csv\n");
    write("gone.txt", "a.csv\ngone.csv\n");
    write("scan.ply", "ply\nformat ascii 1.0\nelement vertex 3\n");
    write("names.csv", "id,foo,bar\n1,2,3\n4,5,6\n7,8,9\n");
    write("far.toml", "[input]\nfiles = [\"a.csv\"]\nbounds = [9e6, 9e6, 1e7, 1e7]\n[output]\ndirectory = \"out\"\n");
    write("pattern.toml", "[input]\nfiles = [\"tiles/*.laz\"]\n[output]\ndirectory = \"out\"\n");
    write("no-table.toml", "[input]\nfiles = [\"a.csv\"]\n");
    for (word, code, what, fix) in [
        ("b.laz", 2, "there is no file b.laz", "correct its name"),
        ("jop.toml", 2, "there is no configuration file jop.toml", "\n  fix: correct its name, or write one"),
        ("pattern.toml", 2, "[input] files: there is no file tiles/*.laz", "\n  fix: correct the path"),
        ("no-table.toml", 2, "there is no table [output]", "directory = \"out\""),
        ("far.toml", 3, "no point is left to triangulate", "\n  fix: [input] bounds"),
        ("empty", 2, "empty has no point clouds", "name files or folders"),
        ("list.txt", 3, "list.txt: line 2: \"notes for me\" is not a point cloud", "\n  fix: remove the line"),
        ("gone.txt", 3, "gone.txt: names gone.csv, which does not exist", "\n  fix: correct the list"),
        ("scan.ply", 3, "scan.ply: is PLY", "convert it to LAZ first"),
        ("names.csv", 3, "names.csv: the first line", "name the columns"),
    ] {
        gdt_batch(folder.path(), &[word]).refused(code, &["error: ", what, fix]);
    }
}

#[test]
fn mistyped_commands_and_options_get_a_suggestion() {
    let folder = tempfile::tempdir().unwrap();
    clouds::write(folder.path(), "a.csv", &clouds::uniform(50, 1_000, 9));
    fs::write(folder.path().join("job.toml"), "[input]\nfiles = [\"a.csv\"]\n[output]\ndirectory = \"out\"\n").unwrap();
    for (words, told) in [
        (&["chek", "job.toml"][..], "there is no file chek; did you mean the command `gdt-batch check job.toml`?"),
        (&["chek"], "did you mean the command `gdt-batch check`?"),
        (&["verfy", "out"], "`gdt-batch verify out`"),
        (&["something-else"], "there is no file something-else, and no command of this name"),
        (&["man", "chek"], "there is no command chek; did you mean check?"),
        (&["check", "job.toml", "--histogram"], "--histogram is an option of gdt-batch info"),
        (&["job.toml", "--histogram"], "--histogram is an option of gdt-batch info"),
        (&["check", "job.toml", "--surface", "all"], "a configuration sets [input] surface"),
        (&["--surface", "all", "check", "job.toml"], "--surface is for jobs of point clouds"),
        (&["a.csv", "--max-eror", "1"], "'--max-error'"),
        (&["info", "a.csv", "--histogramm"], "'--histogram'"),
        (&["a.csv", "--surface", "gorund"], "'ground'"),
        (&["a.csv", "--unit", "feet"], "metre, foot, us-foot"),
        (&["a.csv", "--crs", "EPSG:1"], "--crs: "),
        (&["job.toml", "--fres"], "'--fres'"),
    ] {
        let said = gdt_batch(folder.path(), words);
        said.refused(2, &[told]);
        assert!(!said.err.contains("--fresh") && !said.err.contains("as a value"), "{}", said.err);
    }
    fs::write(folder.path().join("points.dat"), "1 2 3\n4 5 6\n").unwrap();
    gdt_batch(folder.path(), &["points.dat"])
        .refused(2, &["points.dat: line 1", "a text file of points ends in .csv, .txt"]);
    assert!(!folder.path().join("out").exists() && !folder.path().join("a-terrain").exists());
    // A file or a folder that is called like a mistyped command is meant.
    fs::create_dir(folder.path().join("chek")).unwrap();
    clouds::write(&folder.path().join("chek"), "a.csv", &clouds::uniform(50, 1_000, 9));
    gdt_batch(Path::new(folder.path()), &["chek", "--quiet"]).succeeded();
    assert!(folder.path().join("chek-terrain/tileset.json").is_file());
}
