//! The file of a configuration that is to be written: whether it may be, and writing it whole or not at all.

use crate::exit_code::exit_code;
use crate::init::config_folder::named;
use crate::init::configuration::FIRST_WORDS;
use std::fs::{File, Metadata};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use sys::{Error, Result, interrupt};

/// No configuration is longer. What is longer is something else, and may be very long.
const LONGEST: u64 = 1 << 20;

/// Fails if something stands at `file` that may not be replaced: with `replace` only a configuration may.
///
/// # Errors
/// [`Error::Config`] says what stands there; [`Error::Io`] if it cannot be read.
pub(crate) fn check_may_be_written(file: &Path, replace: bool) -> Result<()> {
    match file.metadata() {
        Ok(data) if !data.is_file() => Err(Error::Config(format!(
            "{} exists and is not a regular file: choose another name, or - for standard output",
            file.display()
        ))),
        Ok(_) => match (is_configuration(file)?, replace) {
            (true, true) => Ok(()),
            (true, false) => Err(exists_already(file)),
            (false, _) => Err(Error::Config(format!(
                "{} exists already and is not a configuration of gdt-batch, so it is not overwritten: choose another name",
                file.display()
            ))),
        },
        Err(_) if file.is_symlink() => {
            Err(Error::Config(format!("{} is a broken link: remove it, or choose another name", file.display())))
        }
        Err(_) => Ok(()),
    }
}

/// Fails if the file is one of `clouds`: it would be lost.
///
/// # Errors
/// [`Error::Config`] if it is.
pub(crate) fn check_is_no_cloud(file: &Path, clouds: &[PathBuf]) -> Result<()> {
    let Ok(file_itself) = file.canonicalize() else { return Ok(()) };
    let is_it = |cloud: &PathBuf| cloud.canonicalize().is_ok_and(|cloud| cloud == file_itself);
    match clouds.iter().find(|cloud| is_it(cloud)) {
        Some(cloud) => Err(Error::Config(format!(
            "{} is one of the point clouds ({}), so it is not overwritten: choose another name",
            file.display(),
            cloud.display()
        ))),
        None => Ok(()),
    }
}

/// Tells whether the file is a configuration of this program: one that `init` has written, or TOML with its table `[input]`. An empty file
/// counts as one, because nothing is lost with it.
///
/// # Errors
/// [`Error::Io`] if it cannot be read.
pub(crate) fn is_configuration(file: &Path) -> Result<bool> {
    let mut bytes = Vec::new();
    let read = File::open(file).and_then(|opened| opened.take(LONGEST + 1).read_to_end(&mut bytes));
    read.map_err(Error::io("read", file))?;
    if bytes.len() as u64 > LONGEST {
        return Ok(false);
    }
    let Ok(text) = String::from_utf8(bytes) else { return Ok(false) };
    let has_inputs =
        || text.parse::<toml::Table>().is_ok_and(|table| table.get("input").is_some_and(toml::Value::is_table));
    Ok(text.is_empty() || text.starts_with(&format!("# {FIRST_WORDS}")) || has_inputs())
}

fn exists_already(file: &Path) -> Error {
    Error::Config(format!("{} exists already: choose another name, or add --force to overwrite it", file.display()))
}

/// Writes the file whole or not at all. A link stays, and its target is replaced, which keeps its permissions.
///
/// # Errors
/// [`Error::Io`] if it cannot be written, [`Error::Config`] if it has come to be there and may not be replaced.
pub(crate) fn write(file: &Path, text: &str, replace: bool) -> Result<()> {
    // A limit to the size of files must not leave half of one behind.
    interrupt::listen(exit_code)?;
    let failed = |error: std::io::Error| match error.kind() {
        ErrorKind::AlreadyExists => exists_already(file),
        _ => Error::io("write", file)(error),
    };
    let target = if replace { file.canonicalize().unwrap_or(file.to_path_buf()) } else { file.to_path_buf() };
    let folder = named(target.parent().unwrap_or(Path::new("")));
    let mut new = builder().tempfile_in(folder).map_err(failed)?;
    new.write_all(text.as_bytes()).map_err(failed)?;
    if let Some(old) = target.metadata().ok().filter(|_| replace) {
        let permissions = Metadata::permissions(&old);
        new.as_file().set_permissions(permissions).map_err(failed)?;
    }
    let placed = if replace { new.persist(&target) } else { new.persist_noclobber(&target) };
    placed.map(drop).map_err(|error| failed(error.error))
}

/// Returns what makes files with the permissions that others of the user have.
#[cfg(unix)]
fn builder() -> tempfile::Builder<'static, 'static> {
    use std::os::unix::fs::PermissionsExt;
    let mut builder = tempfile::Builder::new();
    builder.permissions(std::fs::Permissions::from_mode(0o666));
    builder
}

#[cfg(not(unix))]
fn builder() -> tempfile::Builder<'static, 'static> {
    tempfile::Builder::new()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn only_a_configuration_may_be_replaced_and_no_cloud() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a");
        check_may_be_written(&file, false).unwrap();
        for (content, is_configuration) in [
            (&b"# A job for gdt-batch, written by hand\nbad"[..], true),
            (b"[input]\nfiles = [\"a.laz\"]\n", true),
            (b"", true),
            (b"[package]\nname = \"x\"\n", false),
            (b"input = 3\n", false),
            (b"1 2 3\n", false),
            (b"LASF\xff\x00", false),
        ] {
            fs::write(&file, content).unwrap();
            let what = check_may_be_written(&file, false).unwrap_err().to_string();
            assert!(what.contains("exists already") && what.contains("--force") == is_configuration, "{what}");
            assert_eq!(check_may_be_written(&file, true).is_ok(), is_configuration, "{content:?}");
        }
        fs::write(&file, vec![b' '; LONGEST as usize + 1]).unwrap();
        assert!(check_may_be_written(&file, true).is_err());
        let what = check_is_no_cloud(&file, &[folder.path().join(".").join("a")]).unwrap_err().to_string();
        assert!(what.contains("one of the point clouds"), "{what}");
        check_is_no_cloud(&file, &[folder.path().join("b")]).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_link_and_permissions_stay() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["a.toml", "link.toml"].map(|name| folder.path().join(name));
        symlink("a.toml", &link).unwrap();
        let what = check_may_be_written(&link, true).unwrap_err().to_string();
        assert!(what.contains("broken link"), "{what}");
        write(&file, "[input]", false).unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        write(&link, "new", true).unwrap();
        assert!(link.is_symlink() && fs::read_to_string(&file).unwrap() == "new");
        assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777, 0o600);
        assert!(write(&file, "newer", false).is_err());
    }
}
