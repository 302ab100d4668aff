//! Puts the page of `viewer/` where the crate includes it, if it was made.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let variable = |name| PathBuf::from(env::var_os(name).unwrap_or_default());
    let page = variable("CARGO_MANIFEST_DIR").join("../../viewer/dist/index.html");
    // A file that is missing would count as changed in every build, so its folder is watched then.
    let watched = if page.is_file() { page.clone() } else { variable("CARGO_MANIFEST_DIR").join("../../viewer") };
    println!("cargo::rerun-if-changed={}", watched.display());
    let (text, target) = (fs::read(&page).unwrap_or_default(), variable("OUT_DIR").join("index.html"));
    if fs::read(&target).ok().as_ref() != Some(&text) {
        fs::write(target, text).expect("the folder for what is built can be written to");
    }
}
