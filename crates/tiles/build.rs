//! Puts the page of `viewer/` where the crate includes it, if it was made.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let variable = |name| PathBuf::from(env::var_os(name).unwrap_or_default());
    let page = variable("CARGO_MANIFEST_DIR").join("../../viewer/dist/index.html");
    println!("cargo::rerun-if-changed={}", page.display());
    let text = fs::read(&page).unwrap_or_default();
    fs::write(variable("OUT_DIR").join("index.html"), text).expect("the folder for what is built can be written to");
}
