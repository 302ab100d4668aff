//! The flags of a job without a configuration: each stands for a key of one.

use crate::cloud_job::options::{Bounds, CloudOptions, Offset};
use crate::config;
use crate::init::NeededLine;
use std::path::{Path, PathBuf};
use sys::{Error, Result};
use toml::Value;

/// A flag, and the key that it stands for.
pub(crate) struct Flag {
    name: &'static str,
    table: &'static str,
    key: &'static str,
    /// Returns the value of the key, if the flag is given.
    value: fn(&CloudOptions) -> Option<Value>,
}

/// The flags that are lines of a configuration and no paths.
const FLAGS: [Flag; 17] = [
    Flag { name: "surface", table: "input", key: "surface", value: |given| text(&given.surface) },
    Flag {
        name: "bounds",
        table: "input",
        key: "bounds",
        value: |given| given.bounds.map(|Bounds(sides)| list(sides)),
    },
    Flag { name: "crs", table: "input", key: "crs", value: |given| text(&given.crs) },
    Flag { name: "to-crs", table: "input", key: "to_crs", value: |given| text(&given.to_crs) },
    Flag { name: "unit", table: "input", key: "unit", value: |given| text(&given.unit) },
    Flag { name: "height-unit", table: "input", key: "height_unit", value: |given| text(&given.height_unit) },
    Flag { name: "on-bad-file", table: "input", key: "on_bad_file", value: |given| text(&given.on_bad_file) },
    Flag { name: "max-error", table: "output", key: "max_error", value: |given| given.max_error.map(Value::Float) },
    Flag { name: "hull", table: "output", key: "hull", value: |given| text(&given.hull) },
    Flag {
        name: "height-offset",
        table: "output",
        key: "height_offset",
        value: |given| given.height_offset.as_ref().map(offset),
    },
    Flag { name: "color", table: "output", key: "color", value: |given| text(&given.color) },
    Flag { name: "raster", table: "output", key: "raster", value: |given| given.raster.map(raster) },
    Flag { name: "export", table: "output", key: "export", value: |given| words(&given.export) },
    Flag { name: "contours", table: "output", key: "contours", value: contours },
    Flag {
        name: "page",
        table: "output",
        key: "page",
        value: |given| (given.page || given.imagery.is_some()).then(|| true.into()),
    },
    Flag { name: "imagery", table: "output", key: "imagery", value: |given| text(&given.imagery) },
    Flag { name: "terrain", table: "output", key: "terrain", value: |given| given.terrain.then(terrain) },
];

/// The flags that are paths: the configuration counts them from its own folder.
const PATHS: [Flag; 2] = [
    Flag { name: "output", table: "output", key: "directory", value: |given| path(&given.output) },
    Flag { name: "clip", table: "input", key: "clip", value: |given| path(&given.clip) },
];

fn path(given: &Option<PathBuf>) -> Option<Value> {
    given.as_ref().map(|path| Value::from(path.to_string_lossy().into_owned()))
}

fn text(given: &Option<String>) -> Option<Value> {
    given.as_deref().map(Value::from)
}

fn words(given: &[String]) -> Option<Value> {
    (!given.is_empty()).then(|| given.to_vec().into())
}

fn list(sides: [f64; 4]) -> Value {
    sides.to_vec().into()
}

fn offset(given: &Offset) -> Value {
    match given {
        Offset::Egm96 => "egm96".into(),
        Offset::Metres(metres) => (*metres).into(),
        Offset::Grid(path) => path.as_str().into(),
    }
}

fn raster(resolution: f64) -> Value {
    toml::Table::from_iter([("resolution".to_string(), Value::Float(resolution))]).into()
}

/// Who wants DXF of the mesh wants it of the lines too.
fn contours(given: &CloudOptions) -> Option<Value> {
    let interval = ("interval".to_string(), Value::Float(given.contours?));
    let dxf = given.export.iter().any(|format| format == "dxf").then(|| ("dxf".to_string(), true.into()));
    Some(toml::Table::from_iter([Some(interval), dxf].into_iter().flatten()).into())
}

fn terrain() -> Value {
    toml::Table::from_iter([("format".to_string(), Value::from("quantized-mesh"))]).into()
}

impl Flag {
    /// Returns all flags that stand for a key.
    pub(crate) fn all() -> impl Iterator<Item = &'static Flag> {
        PATHS.iter().chain(&FLAGS)
    }

    /// Returns the flag as the command line has it.
    pub(crate) fn name(&self) -> String {
        format!("--{}", self.name)
    }

    /// Returns what messages call the key.
    pub(crate) fn option(&self) -> String {
        format!("[{}] {}", self.table, self.key)
    }
}

/// Returns the lines that the flags stand for.
///
/// # Errors
/// [`Error::Config`] names the flag whose value is wrong.
pub(crate) fn lines(options: &CloudOptions) -> Result<Vec<NeededLine>> {
    let given = FLAGS.iter().filter_map(|flag| Some((flag, (flag.value)(options)?)));
    let line = |(flag, value): (&Flag, Value)| match config::check_value(&format!("[{}]", flag.table), flag.key, &value)
    {
        Ok(()) => Ok(NeededLine::chosen(flag.table, flag.key, &value)),
        Err(what) => Err(Error::Config(format!("{}: {what}", flag.name()))),
    };
    given.map(line).collect()
}

/// Returns what messages call the key for which a flag such as `--surface` stands.
pub(crate) fn option_of_flag(flag: &str) -> Option<String> {
    Flag::all().find(|known| known.name() == flag).map(Flag::option)
}

/// Returns a text in which flags take the place of the options that they stand for, such as `--unit foot` in place of
/// `[input] unit = "foot"`.
pub fn in_flags(text: &str) -> String {
    let mut words = text.to_string();
    for flag in Flag::all() {
        let mut done = String::with_capacity(words.len());
        let mut rest = words.as_str();
        while let Some((before, after)) = rest.split_once(&flag.option()) {
            let is_longer = after.starts_with(|next: char| next == '_' || next.is_alphanumeric());
            let name = if is_longer { flag.option() } else { flag.name() };
            done.extend([before, &name]);
            rest = match after.strip_prefix(" = ") {
                Some(value) if !is_longer => {
                    done.push(' ');
                    without_quotes(value, &mut done)
                }
                _ => after,
            };
        }
        done.push_str(rest);
        words = done;
    }
    words
}

/// Adds a word, or several such as `"metre", "foot" or "us-foot"`, to `done` without quotes, which a command line does not need. Returns the rest of
/// the text.
fn without_quotes<'a>(text: &'a str, done: &mut String) -> &'a str {
    let mut rest = text;
    let mut between = "";
    while let Some((word, after)) = rest.strip_prefix(between).and_then(|next| next.strip_prefix('"')?.split_once('"'))
    {
        if word.contains(' ') {
            break;
        }
        done.extend([between, word]);
        rest = after;
        between = [", ", " or "].into_iter().find(|between| rest.starts_with(between)).unwrap_or(between);
    }
    rest
}

/// Refuses flags of point clouds beside a command.
///
/// # Errors
/// [`Error::Config`] names the flag.
pub fn refuse_beside_command(options: &CloudOptions) -> Result<()> {
    let writes = options.write_config.as_ref().map(|_| "--write-config".to_string());
    match given(options).map(Flag::name).or(writes) {
        Some(name) => Err(Error::Config(format!(
            "{name} is for jobs of point clouds, as in gdt-batch cloud.laz; a command takes the configuration that --write-config job.toml \
                 writes of them"
        ))),
        None => Ok(()),
    }
}

/// Returns a flag that is given and stands for a key.
fn given(options: &CloudOptions) -> Option<&'static Flag> {
    Flag::all().find(|flag| (flag.value)(options).is_some())
}

/// Refuses flags of point clouds beside the configuration at `path`, which has keys for them.
///
/// # Errors
/// [`Error::Config`] names the flag and the key.
pub fn refuse_beside_configuration(options: &CloudOptions, path: &Path) -> Result<()> {
    let path = path.display();
    if options.write_config.is_some() {
        return Err(Error::Config(format!("--write-config needs point clouds, but {path} is a configuration already")));
    }
    match given(options) {
        Some(flag) => {
            Err(Error::Config(format!("{} is for point clouds: set {} in {path}", flag.name(), flag.option())))
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_in_a_text_become_flags() {
        for (said, words) in [
            ("set [input] unit = \"foot\"", "set --unit foot"),
            ("[input] crs or [input] crs_of_all, [output] hull", "--crs or [input] crs_of_all, --hull"),
            ("[output] raster", "--raster"),
            ("[input] unit = \"metre\", \"foot\" or \"us-foot\"; \"auto\"", "--unit metre, foot or us-foot; \"auto\""),
            ("[input] crs = \"a b\" or \"c\"", "--crs \"a b\" or \"c\""),
            ("[input] unit = \"foot\"\"", "--unit foot\""),
            ("[output.raster] resolution", "[output.raster] resolution"),
        ] {
            assert_eq!(in_flags(said), words);
        }
    }
}
