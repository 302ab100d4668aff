//! What the benchmarks of whole jobs share: the cloud, the kinds of jobs, and their folders.

#[path = "../cloud/mod.rs"]
mod cloud;

pub(crate) use cloud::{Outcome, default_file};
use std::path::{Path, PathBuf};

/// Plain tiles alone.
pub(crate) const PLAIN: &str = "compression = \"none\"\nlevels = false";
/// Everything that viewers use: tiles packed with meshopt, and levels of detail.
pub(crate) const FULL: &str = "format = \"3dtiles\"";

/// Writes the same points without compression, and returns the path.
pub(crate) fn as_las(file: &Path, scratch: &Path) -> Outcome<PathBuf> {
    let path = scratch.join("unpacked.las");
    let mut reader = las::Reader::from_path(file)?;
    let mut writer = las::Writer::from_path(&path, reader.header().clone())?;
    let mut batch = las::PointDataBuilder::new().for_header(reader.header()).build();
    while reader.fill_points(100_000, &mut batch)? > 0 {
        writer.write_points(&batch)?;
    }
    writer.close()?;
    Ok(path)
}

/// Writes the configuration of a job that reads `file` and writes to `output`, and returns its path. `more` follows `[output]`.
pub(crate) fn write_config(file: &Path, output: &Path, more: &str) -> Outcome<PathBuf> {
    let config = output.with_extension("toml");
    let file = file.canonicalize()?;
    let text = format!("[input]\nfiles = [{file:?}]\nunit = \"metre\"\n[output]\ndirectory = {output:?}\n{more}\n");
    std::fs::write(&config, text)?;
    Ok(config)
}

/// Truncates the files in `folder`, so that every job starts with the same disk and memory in use. The files themselves stay: after
/// many files were removed, ext4 is slow to make new ones for minutes.
pub(crate) fn empty(folder: &Path) -> Outcome<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        match path.is_dir() {
            true => empty(&path)?,
            false => std::fs::File::options().write(true).open(&path)?.set_len(0)?,
        }
    }
    Ok(())
}
