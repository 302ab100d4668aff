//! What the benchmarks of whole jobs share: the cloud, the kinds of jobs, and their folders.

use std::path::{Path, PathBuf};

pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// Plain tiles alone.
pub(crate) const PLAIN: &str = "compression = \"none\"\nlevels = false";
/// Everything that viewers use: tiles packed with meshopt, and levels of detail.
pub(crate) const FULL: &str = "format = \"3dtiles\"";

/// Returns autzen.laz from the test data, or a sample terrain of 4 million points if there is none.
pub(crate) fn default_file(scratch: &Path) -> Outcome<PathBuf> {
    let shared = std::env::var_os("GDT_SHARED")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"), PathBuf::from);
    let autzen = shared.join("data/autzen.laz");
    if autzen.is_file() {
        return Ok(autzen);
    }
    let sample = scratch.join("sample.laz");
    gdt_batch::sample::write(&sample, 4_000_000, 1, true)?;
    Ok(sample)
}

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
