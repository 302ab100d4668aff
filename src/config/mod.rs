//! Reads configuration files: TOML in, checked options out. An unknown key, a wrong type or an impossible value is an error that
//! shows the line.

mod config_file;
mod least;
mod mistake;
mod mistakes;
pub(crate) mod nearest;
pub(crate) mod option_list;
mod paths;
mod place;
mod short_message;
mod syntax;
mod wrong_name;
mod wrong_value;

use crate::config::config_file::{ConfigFile, TriangulationTable};
use crate::config::least::refusal;
use crate::config::mistakes::all_explained;
use crate::config::option_list::ConfigOption;
use crate::config::paths::{Anchored, anchor, as_pattern};
use crate::config::wrong_value::about_value;
use delaunay_gpu::options::GpuOptions;
use delaunay_gpu::triangulation_options::TriangulationOptions;
use glob::Pattern;
use job::options::JobOptions;
use points::lines::options::LineOptions;
use points::options::is_by_url;
use points::public_name;
use std::path::Path;
use sys::path_text::encoded;
use sys::{Error, Result, Warnings};

/// A key or a value that has a new name.
struct Renamed {
    table: &'static str,
    key: &'static str,
    /// The value that was renamed; `None` if the key was.
    value: Option<&'static str>,
    now: &'static str,
}

/// Old names still work, and a warning says the new one.
const RENAMED: [Renamed; 7] = [
    Renamed { table: "input", key: "malformed_share", value: None, now: "[input] max_malformed_fraction" },
    Renamed { table: "triangulation", key: "sites_per_tile", value: None, now: "[triangulation] max_points_per_tile" },
    Renamed { table: "triangulation", key: "voronoi", value: None, now: "[gpu] voronoi" },
    Renamed { table: "triangulation", key: "adapter", value: None, now: "[gpu] adapter" },
    Renamed { table: "triangulation", key: "texture", value: None, now: "[gpu] texture" },
    Renamed { table: "output", key: "level_sites", value: None, now: "[output] max_points_per_level_tile" },
    Renamed { table: "output", key: "format", value: Some("tiles"), now: "format = \"3dtiles\"" },
];

/// Reads and checks the file at `path`. Relative paths in it count from its directory.
///
/// # Errors
/// [`Error::Config`] with the offending line if the text is not a valid configuration or the file cannot be read.
pub fn load(path: &Path) -> Result<JobOptions> {
    if path.is_dir() {
        let path = path.display();
        return Err(Error::Config(format!(
            "{path} is a folder, not a configuration; `gdt-batch verify {path}` checks results"
        )));
    }
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Err(Error::Config(format!(
                "there is no configuration file {}; fix: correct its name, or write one with `gdt-batch init`",
                path.display()
            )));
        }
        Err(e) => return Err(Error::Config(format!("cannot read the configuration {}: {e}", path.display()))),
    };
    let refused = |what: String| Error::Config(format!("{}: {what}", path.display()));
    if bytes.starts_with(b"LASF") {
        return Err(refused(
            "this is a point cloud, not a configuration; fix: `gdt-batch cloud.laz --write-config job.toml` writes a configuration for it".into(),
        ));
    }
    let text = String::from_utf8(bytes).map_err(|error| refused(not_utf_8(&error)))?;
    let mut options = parse(&text).map_err(refused)?;
    resolve_paths(&mut options, path.parent().unwrap_or(Path::new(""))).map_err(refused)?;
    Ok(options)
}

fn not_utf_8(error: &std::string::FromUtf8Error) -> String {
    let bytes = error.as_bytes();
    let at = error.utf8_error().valid_up_to();
    let line = 1 + bytes[..at].iter().filter(|byte| **byte == b'\n').count();
    let byte = bytes.get(at).copied().unwrap_or_default();
    format!("line {line} has the byte {byte:#04x}, which is not UTF-8 there: save the file in UTF-8")
}

/// As [`load`], for the text of a configuration in the directory `base`.
///
/// # Errors
/// As [`load`].
pub fn of_text(text: &str, base: &Path) -> Result<JobOptions> {
    let mut options = parse(text).map_err(Error::Config)?;
    resolve_paths(&mut options, base).map_err(Error::Config)?;
    Ok(options)
}

/// Checks that a configuration in the directory `base` can name this output directory.
///
/// # Errors
/// [`Error::Config`] if it means something only to a shell.
pub(crate) fn check_directory(directory: &str, base: &Path) -> Result<()> {
    anchor("[output] directory", directory, base).map(drop).map_err(Error::Config)
}

/// Checks the value of an option, whose table is named as a configuration has it.
///
/// # Errors
/// A sentence about what is wrong with it.
pub(crate) fn check_value(table: &str, key: &str, value: &toml::Value) -> std::result::Result<(), String> {
    match (refusal(table, key, value), ConfigOption::find(table, key)) {
        (None, _) => Ok(()),
        (Some(said), Some(option)) => Err(about_value(&option, Some(value), &said)),
        (Some(said), None) => Err(said),
    }
}

/// Returns the words that an option takes, if it takes no others.
pub(crate) fn choices(table: &str, key: &str) -> Vec<String> {
    ConfigOption::find(table, key).map_or(Vec::new(), |option| option.choices())
}

/// Makes the paths count from the working directory instead of `base`, the directory of the configuration. URLs stay, without what nobody
/// may see.
fn resolve_paths(options: &mut JobOptions, base: &Path) -> std::result::Result<(), String> {
    if let Some(directory) = options.output.directory.to_str() {
        let Anchored { base, path } = anchor("[output] directory", directory, base)?;
        options.output.directory = base.join(path);
    }
    options.input.hide_queries().map_err(|what| format!("[input] files: {what}"))?;
    if let Some(grid) = options.output.height_offset.as_mut().and_then(|offset| offset.grid_mut()) {
        let name = grid.to_string_lossy().into_owned();
        refuse_url("[output] height_offset", &name)?;
        let Anchored { base, path } = anchor("[output] height_offset", &name, base)?;
        *grid = base.join(path);
    }
    if let Some(photo) = options.output.color.photo_mut() {
        let name = photo.to_string_lossy().into_owned();
        *photo = if is_by_url(&name) {
            public_name(&name).map_err(|what| format!("[output] color: {what}"))?.into()
        } else {
            let Anchored { base, path } = anchor("[output] color", &name, base)?;
            base.join(path)
        };
    }
    if let Some(clip) = options.input.clip.as_mut() {
        refuse_url("[input] clip", clip)?;
        let Anchored { base, path } = anchor("[input] clip", clip, base)?;
        *clip = base.join(path).to_string_lossy().into_owned();
    }
    // A shell's signs mean other things in a URL.
    let of_points = options.input.files.iter_mut().filter(|file| !is_by_url(file)).map(|file| ("[input] files", file));
    let line_files = || options.breaklines.iter().flat_map(|lines| &lines.files);
    line_files().try_for_each(|file| refuse_url("[[breaklines]] files", file))?;
    let of_lines = options.breaklines.iter_mut().flat_map(|lines| &mut lines.files);
    for (key, file) in of_points.chain(of_lines.map(|file| ("[[breaklines]] files", file))) {
        let Anchored { base, path } = anchor(key, file, base)?;
        let (pattern, warning) = as_pattern(key, path, &base);
        options.warnings.extend(warning);
        *file = if Path::new(path).is_absolute() { pattern } else { format!("{}{pattern}", glob_prefix(&base)) };
    }
    Ok(())
}

/// Refuses a URL where only a file of this machine can be read.
fn refuse_url(option: &str, name: &str) -> std::result::Result<(), String> {
    match is_by_url(name) {
        // Its query may be a secret.
        true => {
            let place = name.split('?').next().unwrap_or_default();
            Err(format!(
                "{option}: {place}: only point clouds and orthophotos are read by URL; download this file and name the copy"
            ))
        }
        false => Ok(()),
    }
}

/// Returns a message without what may be a secret: the queries of the URLs in the line that it shows.
fn without_queries(message: &str) -> String {
    let ends_url = |c: char| c.is_whitespace() || "\"'`,]".contains(c);
    let mut out = String::with_capacity(message.len());
    let mut rest = message;
    while let Some(at) = rest.find("://") {
        let (before, url) = rest.split_at(at);
        let end = url.find(ends_url).unwrap_or(url.len());
        out += before;
        match url[..end].split_once('?') {
            Some((place, _)) => out = out + place + "?...",
            None => out += &url[..end],
        }
        rest = &url[end..];
    }
    out + rest
}

/// No configuration has so many opening brackets in a row. The parser would keep some 50 bytes for each.
const BRACKETS: &str = "[[[[[[[[[[[[[[[[";

/// Reads and checks the text of a configuration. The error shows the line.
fn parse(text: &str) -> std::result::Result<JobOptions, String> {
    if let Some(line) = text.lines().position(|line| line.contains(BRACKETS)) {
        return Err(format!("line {} has more brackets in a row than any value needs: remove them", line + 1));
    }
    let mut file: ConfigFile = toml::from_str(text).map_err(|error| without_queries(&all_explained(text, error)))?;
    if let Some(place) = text.parse::<toml::Table>().ok().and_then(|table| nul_in(&table.into())) {
        return Err(format!("{place} has a NUL character (\\u0000), which no name of a file can have: remove it"));
    }
    if file.input.files.is_empty() {
        return Err("[input] files is empty: name at least one point cloud".into());
    }
    if file.input.classes.as_ref().is_some_and(Vec::is_empty) {
        return Err(
            "[input] classes is empty, so no point would be left; leave the key out to keep all but noise".into()
        );
    }
    if let Some(what) = file.input.contradiction() {
        return Err(format!("[input] {what}"));
    }
    if let Some(contradiction) = file.breaklines.iter().find_map(LineOptions::contradiction) {
        return Err(contradiction.into());
    }
    // Points near breaklines that somebody has found and marked.
    file.input.without_ignored_ground = !file.breaklines.is_empty();
    if file.output.directory.as_os_str().is_empty() {
        return Err("[output] directory is empty".into());
    }
    let TriangulationTable { backend, max_points_per_tile, max_points_per_part, voronoi, adapter, texture } =
        file.triangulation;
    let gpu = GpuOptions {
        voronoi: one_of("voronoi", file.gpu.voronoi, voronoi)?.unwrap_or_default(),
        adapter: one_of("adapter", file.gpu.adapter, adapter)?,
        texture: one_of("texture", file.gpu.texture, texture)?.unwrap_or_default(),
    };
    Ok(JobOptions {
        updates: false,
        input: file.input,
        breaklines: file.breaklines,
        triangulation: TriangulationOptions { backend, max_points_per_tile, max_points_per_part },
        gpu,
        output: file.output,
        limits: file.limits,
        warnings: old_names(text),
    })
}

/// Returns the place of a text with a NUL character in the value of a configuration, such as `output directory`.
fn nul_in(value: &toml::Value) -> Option<String> {
    match value {
        toml::Value::String(text) => text.contains('\0').then(String::new),
        toml::Value::Array(values) => values.iter().find_map(nul_in),
        toml::Value::Table(table) => table
            .iter()
            .find_map(|(key, value)| nul_in(value).map(|rest| format!("{key} {rest}").trim_end().to_string())),
        _ => None,
    }
}

/// Returns the value of a key that may be in `[gpu]` or, under its old name, in `[triangulation]`.
fn one_of<T>(key: &str, in_gpu: Option<T>, in_triangulation: Option<T>) -> std::result::Result<Option<T>, String> {
    match (in_gpu, in_triangulation) {
        (Some(_), Some(_)) => {
            Err(format!("[gpu] {key} and its old name [triangulation] {key} are both set: keep [gpu]"))
        }
        (value, old) => Ok(value.or(old)),
    }
}

/// Returns a warning for every old name in the text.
fn old_names(text: &str) -> Warnings {
    let mut warnings = Warnings::default();
    let Ok(file) = text.parse::<toml::Table>() else { return warnings };
    for Renamed { table, key, value, now } in RENAMED {
        let Some(found) = file.get(table).and_then(|table| table.get(key)) else { continue };
        match value {
            None => warnings.push(format!("[{table}] {key} is an old name, which still works; fix: write {now}")),
            Some(value) if found.as_str() == Some(value) => {
                warnings
                    .push(format!("[{table}] {key} = \"{value}\" is an old name, which still works; fix: write {now}"));
            }
            Some(_) => {}
        }
    }
    warnings
}

/// Returns `directory` as the beginning of a pattern, with its own special characters escaped.
fn glob_prefix(directory: &Path) -> String {
    if directory.as_os_str().is_empty() {
        return String::new();
    }
    format!("{}/", Pattern::escape(&encoded(directory.as_os_str())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use points::options::Duplicates;
    use tiles::options::OutputFormat;

    const LEAST: &str = "[input]\nfiles = [\"a.laz\"]\n[output]\ndirectory = \"out\"\n";

    fn error(text: &str) -> String {
        parse(text).unwrap_err()
    }

    #[test]
    fn a_message_about_the_text_hides_queries() {
        let error = parse("[input]\nfiles = \"https://host/a.laz?X-Amz-Signature=SECRET\"\n").unwrap_err();
        assert!(error.contains("https://host/a.laz?...") && !error.contains("SECRET"), "{error}");
        assert_eq!(without_queries("a \"s3://b/c?d=e\", b?c"), "a \"s3://b/c?...\", b?c");
    }

    #[test]
    fn the_least_configuration_has_the_documented_defaults() {
        let options = parse(LEAST).unwrap();
        assert_eq!(options.limits.memory.0, 4 << 30);
        assert_eq!(options.input.duplicates, Duplicates::Lowest);
        assert!(options.output.normals);
        let kept = options.input.kept_classes();
        assert!(kept[2] && !kept[7] && !kept[18]);
        assert!(options.warnings.is_empty());
    }

    #[test]
    fn surfaces_are_choices_of_classes_and_returns() {
        let with = |lines: &str| parse(&LEAST.replace("[output]", &format!("{lines}\n[output]")));
        let kept = |lines: &str| {
            let input = with(lines).unwrap().input;
            let classes = (0..=255u8).filter(|&class| input.kept_classes()[class as usize]);
            (classes.collect::<Vec<u8>>(), toml::Value::from(input.kept_returns()).to_string())
        };
        let (all, ground) = (kept("").0, vec![2, 8, 9, 20]);
        let with_returns = |classes: &[u8], returns: &str| (classes.to_vec(), returns.to_string());
        assert_eq!(all.len(), 254);
        assert_eq!(kept("surface = \"all\"\nreturns = \"all\""), with_returns(&all, "\"all\""));
        assert_eq!(kept("surface = \"ground\""), with_returns(&ground, "\"all\""));
        assert_eq!(kept("surface = \"first\""), with_returns(&all, "\"first\""));
        assert_eq!(kept("returns = [2, 3]"), with_returns(&all, "[2, 3]"));
        // Those that agree with a surface take some of its points.
        assert_eq!(kept("surface = \"ground\"\nclasses = [2]"), with_returns(&[2], "\"all\""));
        assert_eq!(kept("surface = \"ground\"\nreturns = \"last\""), with_returns(&ground, "\"last\""));
        assert_eq!(kept("surface = \"first\"\nreturns = [1]\nclasses = [6]"), with_returns(&[6], "\"first\""));
        for (lines, words) in [
            ("surface = \"ground\"\nclasses = [2, 6]", "class 6 in classes is neither"),
            ("surface = \"first\"\nreturns = \"last\"", "leave out one"),
            ("surface = \"last\"\nreturns = [1]", "leave out one"),
            ("surface = \"roofs\"", "line 3"),
            ("returns = [0]", "a list of numbers from 1 to 15"),
        ] {
            let what = with(lines).unwrap_err();
            assert!(what.contains(words), "{lines}: {what}");
        }
    }

    #[test]
    fn errors_show_the_line() {
        let unknown = error(&LEAST.replace("files", "fils"));
        assert!(unknown.contains("line 2") && unknown.contains("fils"), "{unknown}");
        let wrong = error(&format!("{LEAST}color = \"blue\"\n"));
        assert!(wrong.contains("line 5") && wrong.contains("elevation"), "{wrong}");
        let memory = error(&format!("{LEAST}[limits]\nmemory = \"4 GB of it\"\n"));
        assert!(memory.contains("line 6") && memory.contains("4 GiB"), "{memory}");
        let deep = error(&LEAST.replace("[output]", &format!("classes = {}\n[output]", "[".repeat(100_000))));
        assert!(deep.contains("line 3") && deep.contains("brackets") && deep.len() < 100, "{deep}");
        let bounds = error(&LEAST.replace("[output]", "bounds = [1, 1, 0, 2]\n[output]"));
        assert!(bounds.contains("line 3") && bounds.contains("xmin"), "{bounds}");
        let edge = error(&format!("{LEAST}max_edge = -1\n"));
        assert!(edge.contains("line 5") && edge.contains("auto"), "{edge}");
        let points = error(&format!("{LEAST}[triangulation]\nmax_points_per_tile = 2\n"));
        assert!(points.contains("line 6") && points.contains("auto"), "{points}");
    }

    #[test]
    fn all_mistakes_are_told_at_once() {
        let text = "[input]\nfils = [\"a.laz\"]\nsurface = \"gorund\"\n[output]\ndirectory = \"out\"\nmax_eror = 0.1\nnormals = \"yes\"\n\
                    [limits]\nthreads = 2\nmemry = \"4 GiB\"\n";
        let told = error(text);
        let lines: Vec<&str> = told.lines().filter(|line| line.starts_with("line ")).collect();
        assert_eq!(lines.len(), 5, "{told}");
        for (line, [place, word]) in lines.iter().zip([
            ["line 2: [input]", "files"],
            ["line 3: [input]", "\"ground\""],
            ["line 6: [output]", "max_error"],
            ["line 7: [output]", "normals"],
            ["line 10: [limits]", "memory"],
        ]) {
            assert!(line.starts_with(place) && line.contains(word), "{line}");
        }
        let inner = error(&LEAST.replace("[output]", "[output.contours]\nintervall = 1.0\n[output]\nmax_eror = 1"));
        assert_eq!(inner.lines().filter(|line| line.starts_with("line ")).count(), 2, "{inner}");
        // Nothing is told that only follows from another mistake.
        let lost = error("[input]\nfiles = 3\n[output]\ndirctory = \"out\"\n");
        assert_eq!(lost.lines().filter(|line| line.starts_with("line ")).count(), 2, "{lost}");
        assert!(!lost.contains("has no key directory:"), "{lost}");
        // What is missing anyway is told, and nothing that the user did not write.
        let missing = error("[input]\nsurfce = \"ground\"\n[output]\ndirectory = \"o\"\n");
        assert!(missing.contains("surface") && missing.contains("files"), "{missing}");
        assert!(!missing.contains("one key and one value"), "{missing}");
        // Letters of several bytes, and entries that are read in another order than they are written in.
        let accents = format!(
            "[input.csv]\ncolumxs = [\"x\"]\n[output]\ndirectory = \"out\"\n# {}\n[input]\ncrss = \"a\"\n",
            "é".repeat(50)
        );
        assert_eq!(error(&accents).lines().filter(|line| line.starts_with("line ")).count(), 3, "{}", error(&accents));
        let many: String = (0..50).map(|k| format!("foo{k} = 1\n")).collect();
        let many = error(&LEAST.replace("[output]", &format!("[output]\n{many}")));
        assert!(many.ends_with("there are more mistakes"), "{many}");
        assert_eq!(many.lines().filter(|line| line.starts_with("line ")).count(), 20, "{many}");
    }

    #[test]
    fn old_names_work_and_say_the_new_one() {
        let old = "[input]\nfiles = [\"a.laz\"]\nmalformed_share = 0.25\n[triangulation]\nsites_per_tile = 1000\n\
                   voronoi = \"jfa\"\nadapter = \"lava\"\ntexture = 512\n\
                   [output]\ndirectory = \"out\"\nlevel_sites = 2000\nformat = \"tiles\"\n";
        let new = "[input]\nfiles = [\"a.laz\"]\nmax_malformed_fraction = 0.25\n\
                   [triangulation]\nmax_points_per_tile = 1000\n\
                   [gpu]\nvoronoi = \"jfa\"\nadapter = \"lava\"\ntexture = 512\n\
                   [output]\ndirectory = \"out\"\nmax_points_per_level_tile = 2000\nformat = \"3dtiles\"\n";
        let (old, mut new) = (parse(old).unwrap(), parse(new).unwrap());
        assert!(new.warnings.is_empty());
        assert_eq!(new.output.format, OutputFormat::Tiles3d);
        let warnings: Vec<&str> = old.warnings.iter().collect();
        assert_eq!(warnings.len(), RENAMED.len(), "{warnings:?}");
        for (warning, renamed) in warnings.iter().zip(RENAMED) {
            assert!(warning.contains(renamed.now) && warning.contains(renamed.key), "{warning}");
        }
        new.warnings = old.warnings.clone();
        assert_eq!(serde_json::to_string(&old).unwrap(), serde_json::to_string(&new).unwrap());
    }

    #[test]
    fn options_are_read_back_as_they_were_written() {
        let odd = "[input]\nfiles = [\"a.laz\"]\nclasses = [2]\nbounds = [0.1, -3, 7e9, 2.5]\nresolution = 0.003\nunit = \"us-foot\"\n\
                   [triangulation]\nmax_points_per_tile = 77\n[gpu]\ntexture = 512\nadapter = \"x\"\n\
                   [output]\ndirectory = \"out\"\nmax_edge = 0.1\nmax_points_per_level_tile = 1234\n\
                   [limits]\nmemory = \"1.4 GiB\"\nthreads = 3\n";
        for text in
            [LEAST, odd, &odd.replace("0.003", "10").replace("512", "\"max\"").replace("= 0.1\n", "= \"auto\"\n")]
        {
            let options = parse(text).unwrap();
            let written = serde_json::to_string(&options).unwrap();
            let read: JobOptions = serde_json::from_str(&written).unwrap();
            assert_eq!(serde_json::to_string(&read).unwrap(), written);
            assert_eq!(read.input.resolution, options.input.resolution);
            assert_eq!((read.output.max_edge, read.limits.memory), (options.output.max_edge, options.limits.memory));
        }
    }

    #[test]
    fn a_key_under_both_its_names_is_an_error() {
        let both = error(&format!("{LEAST}[triangulation]\nvoronoi = \"jfa\"\n[gpu]\nvoronoi = \"exact\"\n"));
        assert!(both.contains("[gpu] voronoi"), "{both}");
        let twice = error(&format!("{LEAST}[triangulation]\nsites_per_tile = 50\nmax_points_per_tile = 60\n"));
        assert!(twice.contains("max_points_per_tile"), "{twice}");
    }
}
