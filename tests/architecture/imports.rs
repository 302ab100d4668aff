//! Finds for every import the file that defines it.

use std::collections::BTreeMap;

use crate::source::{NamedPath, paths};

/// An import: the file `from` names `path`, which the file `to` defines. Files are relative to `src`.
pub(crate) struct Arrow {
    pub(crate) from: String,
    pub(crate) to: String,
    pub(crate) line: usize,
    pub(crate) path: String,
    /// Whether a mod.rs or lib.rs only re-exports a name from its own folder. An import through it leads to the file that defines
    /// the name.
    pub(crate) passes_on: bool,
}

/// All modules of the crate by place, such as "job/plan/scan", or "" for lib.rs.
pub(crate) struct Imports(BTreeMap<String, Module>);

struct Module {
    file: String,
    paths: Vec<NamedPath>,
}

impl Imports {
    /// Reads the files of a crate: their names relative to `src`, and their texts.
    pub(crate) fn new<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Imports {
        let module = |(file, text): (&str, &str)| (place(file), Module { file: file.into(), paths: paths(text) });
        Imports(files.into_iter().filter(|(file, _)| !is_test(file)).map(module).collect())
    }

    /// Returns the imports between files, one for each pair of files.
    pub(crate) fn arrows(&self) -> Vec<Arrow> {
        let mut arrows = BTreeMap::new();
        for (place, module) in &self.0 {
            for path in &module.paths {
                let Some(target) = self.absolute(place, &path.segments) else { continue };
                let (from, to) = (module.file.clone(), self.definition(&target));
                let passes_on = path.reexport && facade_folder(&from).is_some_and(|folder| to.starts_with(folder));
                if from != to {
                    let key = (from.clone(), to.clone(), passes_on);
                    let arrow = Arrow { from, to, line: path.line, path: path.segments.join("::"), passes_on };
                    arrows.entry(key).or_insert(arrow);
                }
            }
        }
        arrows.into_values().collect()
    }

    /// Returns the path, as the module at `place` names it, from the root of the crate. `None` if it leads to another crate or to
    /// an item of the module itself.
    fn absolute(&self, place: &str, path: &[String]) -> Option<Vec<String>> {
        let (first, rest) = path.split_first()?;
        match first.as_str() {
            "crate" => return Some(rest.to_vec()),
            "self" => return Some(join(place, rest)),
            "super" => {
                let parent = place.rsplit_once('/').map_or("", |(parent, _)| parent);
                let is_last = rest.first().is_none_or(|next| next != "super");
                return if is_last { Some(join(parent, rest)) } else { self.absolute(parent, rest) };
            }
            _ => {}
        }
        if self.is_module(&child(place, first)) {
            return Some(join(place, path));
        }
        let bound = self.binding(place, first).filter(|bound| bound.segments.first() != Some(first))?;
        let mut path = self.absolute(place, &bound.segments)?;
        path.extend_from_slice(rest);
        Some(path)
    }

    /// Follows re-exports and returns the file that defines the item at a path from the root.
    fn definition(&self, path: &[String]) -> String {
        let mut place = String::new();
        for (at, segment) in path.iter().enumerate() {
            let below = child(&place, segment);
            if self.is_module(&below) {
                place = below;
                continue;
            }
            let bound = self.binding(&place, segment).and_then(|bound| self.absolute(&place, &bound.segments));
            let Some(mut target) = bound else { break };
            target.extend_from_slice(&path[at + 1..]);
            return self.definition(&target);
        }
        self.0.get(&place).map_or_else(|| child(&place, "mod.rs"), |module| module.file.clone())
    }

    /// Tells whether there is a file or a folder at this place.
    fn is_module(&self, place: &str) -> bool {
        self.0.contains_key(place) || self.0.keys().any(|other| other.starts_with(&format!("{place}/")))
    }

    fn binding(&self, place: &str, name: &str) -> Option<&NamedPath> {
        self.0.get(place)?.paths.iter().find(|path| path.binds.as_deref() == Some(name))
    }
}

/// Returns the folder of a mod.rs or lib.rs, or `None` for other files.
fn facade_folder(file: &str) -> Option<&str> {
    file.strip_suffix("mod.rs").or(file.strip_suffix("lib.rs"))
}

/// Tells whether a file holds only tests.
fn is_test(file: &str) -> bool {
    file == "tests.rs" || file.ends_with("/tests.rs")
}

fn place(file: &str) -> String {
    let stem = file.trim_end_matches(".rs");
    let stem = stem.strip_suffix("/mod").unwrap_or(stem);
    if stem == "lib" { String::new() } else { stem.into() }
}

fn child(place: &str, name: &str) -> String {
    if place.is_empty() { name.into() } else { format!("{place}/{name}") }
}

fn join(place: &str, rest: &[String]) -> Vec<String> {
    place.split('/').filter(|part| !part.is_empty()).map(String::from).chain(rest.iter().cloned()).collect()
}
