//! Configurations that are written: every option that they offer is one that the program takes.

use super::*;
use crate::config;
use job::preflight::check::check;
use std::fs;
use sys::ErrorKind;

/// Asks for a configuration for these clouds.
fn of(clouds: &[PathBuf]) -> ConfigRequest {
    ConfigRequest { clouds: clouds.to_vec(), ..ConfigRequest::default() }
}

/// Makes the configuration of the clouds in `folder`.
fn made(folder: &Path) -> NewConfiguration {
    init(&of(&[folder.to_path_buf()]), &folder.join("job.toml"), true).unwrap()
}

/// Returns the text with each of its options on in turn. Options that follow a table of their own belong to it.
fn with_each_option(text: &str) -> Vec<(String, String)> {
    let lines: Vec<&str> = text.lines().collect();
    let is_option = |line: &str| line.starts_with('#') && !line.starts_with("# ");
    let mut variants = Vec::new();
    let mut at = 0;
    while at < lines.len() {
        let is_table = lines[at].starts_with("#[");
        let count = if is_table { lines[at..].iter().take_while(|line| is_option(line)).count() } else { 1 };
        if is_option(lines[at]) {
            let mut changed: Vec<&str> = lines.clone();
            changed[at..at + count].iter_mut().for_each(|line| *line = &line[1..]);
            variants.push((lines[at].to_string(), changed.join("\n")));
        }
        at += count.max(1);
    }
    variants
}

#[test]
fn every_option_that_is_offered_is_taken_and_lets_the_job_run() {
    let folder = tempfile::tempdir().unwrap();
    crate::sample::write(&folder.path().join("cloud.laz"), 2000, 1, false).unwrap();
    let text = made(folder.path()).text;
    let variants = with_each_option(&text);
    let offered: String = variants.iter().map(|(line, _)| line.as_str()).collect::<Vec<_>>().join("\n");
    // Its CRS says the unit.
    assert!(!offered.contains("#unit"), "{offered}");
    for key in [
        "crs",
        "to_crs",
        "bounds",
        "format",
        "compression",
        "max_edge",
        "raster",
        "height_offset",
        "copyright",
        "memory",
        "threads",
        "[[breaklines]]",
    ] {
        assert!(offered.lines().any(|line| line.starts_with(&format!("#{key}"))), "no {key} in {offered}");
    }
    let plain = serde_json::to_value(config::of_text(&text, folder.path()).unwrap()).unwrap();
    for (line, text) in variants {
        let options = config::of_text(&text, folder.path()).unwrap_or_else(|e| panic!("{line}: {e}"));
        let is_default = ["#memory"].iter().any(|key| line.starts_with(key));
        assert_eq!(serde_json::to_value(&options).unwrap() == plain, is_default, "{line} changes nothing");
        // There are no lines.
        if options.breaklines.is_empty() {
            check(&options).unwrap_or_else(|e| panic!("{line}: {e}"));
        }
    }
}

#[test]
fn bare_earth_is_offered_where_there_is_ground_and_something_else() {
    for (classes, is_offered) in [([2, 2, 2, 5], true), ([2, 2, 2, 2], false), ([0, 1, 1, 5], false)] {
        let folder = tempfile::tempdir().unwrap();
        let [a, b, c, d] = classes;
        let rows = format!("x,y,z,classification\n0,0,1,{a}\n9,0,2,{b}\n9,9,3,{c}\n0,9,4,{d}\n");
        fs::write(folder.path().join("cloud.csv"), rows).unwrap();
        let offers = with_each_option(&made(folder.path()).text);
        let ground = offers.into_iter().find(|(line, _)| line.starts_with("#surface = \"ground\""));
        assert_eq!(ground.is_some(), is_offered, "{classes:?}");
        if let Some((line, text)) = ground {
            check(&config::of_text(&text, folder.path()).unwrap()).unwrap_or_else(|e| panic!("{line}: {e}"));
        }
    }
}

#[test]
fn a_text_without_a_name_gets_the_options_that_help_it() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cloud.csv"), "x,y,z\n0,0,1\n9,0,2\n9,9,3\n0,9,4\n4,5,6\n").unwrap();
    let new = made(folder.path());
    for words in [
        "# Unit: no file states it",
        "\n#unit = \"us-foot\"",
        "# CRS: no file names one",
        "\n#crs = ",
        "the points have none",
    ] {
        assert!(new.text.contains(words), "no {words:?} in {}", new.text);
    }
    assert!(new.needed.is_empty() && !new.text.contains("surface = \"ground\""), "{}", new.text);
    for (line, text) in with_each_option(&new.text) {
        config::of_text(&text, folder.path()).unwrap_or_else(|e| panic!("{line}: {e}"));
    }
}

#[test]
fn what_is_needed_stands_there_with_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let rows = "lon,lat,z\n11.51,48.11,500\n11.52,48.12,510\n11.53,48.11,505\n11.52,48.10,503\n";
    fs::write(folder.path().join("a.csv"), rows).unwrap();
    let new = made(folder.path());
    let needed: Vec<(&str, &str)> = new.needed.iter().map(|line| (line.key, line.value.as_str())).collect();
    assert_eq!(needed, [("to_crs", "\"utm\""), ("missing_crs", "\"EPSG:4326\"")]);
    assert!(new.text.contains("\nto_crs = \"utm\"\n") && new.text.contains("UTM zone 32N"), "{}", new.text);
    assert!(!new.text.contains("#to_crs") && !new.text.contains("#unit"), "{}", new.text);
    // Names of columns say no unit of z, nor does the system of the map.
    assert_eq!(new.unit, "metre in x and y; the unit of z is unknown: that of x and y is assumed");
    // One row that is damaged, and one file that is no cloud.
    fs::write(folder.path().join("a.csv"), format!("{rows}11.5x,48,1\n")).unwrap();
    fs::write(folder.path().join("b.csv"), "version https://git-lfs.github.com/spec/v1\n").unwrap();
    let files = ["a.csv", "b.csv"].map(|name| folder.path().join(name));
    let new = init(&of(&files), &folder.path().join("job.toml"), true).unwrap();
    let keys: Vec<&str> = new.needed.iter().map(|line| line.key).collect();
    assert_eq!(keys, ["to_crs", "missing_crs"]);
    // Whether points may be lost, the user decides.
    let choices: Vec<(&str, &str)> = new.choices.iter().map(|line| (line.key, line.value.as_str())).collect();
    assert_eq!(choices, [("on_bad_file", "\"skip\""), ("max_malformed_fraction", "0.2")]);
    assert!(new.choices[0].why.contains("b.csv: is a Git LFS pointer"), "{:?}", new.choices);
    // Comments are wrapped, where depends on the length of paths.
    let unwrapped = new.text.replace("\n# ", " ");
    assert!(
        new.text.contains("\n#max_malformed_fraction = 0.2\n") && unwrapped.contains("So the job stops"),
        "{}",
        new.text
    );
    let why = new.obstacle.unwrap();
    assert!(why.kind() == ErrorKind::Input && why.to_string().contains("b.csv: is a Git LFS pointer"), "{why}");
    let decided = new.text.replace("#max_malformed", "max_malformed").replace("#on_bad_file", "on_bad_file");
    check(&config::of_text(&decided, folder.path()).unwrap()).unwrap();
}

#[test]
fn a_folder_in_which_something_else_is_keeps_it() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cloud.csv"), "0 0 1\n9 0 2\n9 9 3\n").unwrap();
    for (in_the_way, directory) in [("none", "out"), ("out/tileset.json", "out-2"), ("out-2", "out-3")] {
        let path = folder.path().join(in_the_way);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "{}").unwrap();
        assert!(made(folder.path()).text.contains(&format!("\ndirectory = \"{directory}\"\n")), "{in_the_way}");
    }
    let east = init(&of(&[folder.path().to_path_buf()]), &folder.path().join("east.toml"), false).unwrap();
    assert!(east.text.contains("directory = \"out-east\""), "{}", east.text);
}

#[test]
fn control_characters_do_not_reach_the_terminal() {
    let folder = tempfile::tempdir().unwrap();
    crate::sample::write(&folder.path().join("cloud.laz"), 2000, 1, false).unwrap();
    let mut new = made(folder.path());
    new.check.crs = Some("a\u{1b}[31mb".into());
    assert!(!new.to_string().contains('\u{1b}') && new.to_string().contains("a\u{fffd}[31mb"), "{new}");
}
