//! The page that shows a terrain in a browser. Its source is in `viewer/`; `build.rs` finds the page if it was made.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use crate::imagery_url::ImageryUrl;
use sys::{Error, Result};

/// The page as `npm run build --prefix viewer` makes it; empty if it was not there when the program was built.
const PAGE: &str = include_str!(concat!(env!("OUT_DIR"), "/index.html"));

/// Where the page has room for the name of the file that it opens. Nobody else's page has this.
const TERRAIN: &str = "data-terrain=\"";

/// What stands behind it where the page drapes imagery over the terrain.
const IMAGES: &str = " data-images=\"";

/// [`TERRAIN`] is within this many bytes from the beginning of the page.
const HEAD: u64 = 200;

/// Why there is no page, and the commands that make one.
pub const NOT_BUILT_IN: &str = "this build of gdt-batch has no page that shows a terrain: in its source folder, run \
    npm ci --prefix viewer && npm run build --prefix viewer && cargo install --path .";

/// Tells whether the page is built in.
pub fn is_built_in() -> bool {
    !PAGE.is_empty()
}

/// Returns the page that opens the file `terrain`, a URI relative to the page, and drapes `imagery` over it.
///
/// # Errors
/// [`Error::Config`] if the page is not built in.
pub fn page_for(terrain: &str, imagery: Option<&ImageryUrl>) -> Result<String> {
    if !is_built_in() {
        return Err(Error::Config(NOT_BUILT_IN.into()));
    }
    let images = imagery.map_or(String::new(), |url| format!("{IMAGES}{}\"", url.as_str().replace('&', "&amp;")));
    Ok(PAGE.replacen(&format!("{TERRAIN}\""), &format!("{TERRAIN}{terrain}\"{images}"), 1))
}

/// Returns the imagery of the page at `path`; `None` if there is no such page, or none that can be read.
pub fn imagery_of(path: &Path) -> Option<ImageryUrl> {
    let page = std::fs::read_to_string(path).ok().filter(|_| is_page(path).unwrap_or(false))?;
    let (url, _) = page.split_once(IMAGES)?.1.split_once('"')?;
    ImageryUrl::try_from(url.replace("&amp;", "&")).ok()
}

/// Tells whether the file at `path` is such a page, whatever version wrote it.
///
/// # Errors
/// What the system says if the file cannot be read.
pub fn is_page(path: &Path) -> std::io::Result<bool> {
    match path.metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(false),
        // Opening a pipe would wait for another process.
        data => {
            if !data?.is_file() {
                return Ok(false);
            }
        }
    }
    let mut head = Vec::new();
    File::open(path)?.take(HEAD).read_to_end(&mut head)?;
    Ok(memchr::memmem::find(&head, TERRAIN.as_bytes()).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_our_own_page_is_taken_for_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("index.html");
        assert!(!is_page(&path).unwrap() && !is_page(folder.path()).unwrap());
        std::fs::write(&path, "<!doctype html>\n<html lang=\"en\"><title>My survey</title>").unwrap();
        assert!(!is_page(&path).unwrap());
        std::fs::write(&path, "<!doctype html>\n<html lang=\"en\" data-terrain=\"terrain.glb\">").unwrap();
        assert!(is_page(&path).unwrap());
    }

    #[test]
    fn the_page_names_the_file_that_it_opens() {
        let imagery = ImageryUrl::try_from("https://a.example/{z}/{x}/{y}.png?a=1&b=2".to_string()).unwrap();
        match page_for("terrain.glb", Some(&imagery)) {
            Ok(page) => {
                let folder = tempfile::tempdir().unwrap();
                let path = folder.path().join("index.html");
                std::fs::write(&path, &page).unwrap();
                assert!(is_page(&path).unwrap());
                assert_eq!(imagery_of(&path), Some(imagery));
                let at = page.find("data-terrain=\"terrain.glb\"").unwrap();
                assert!(at < HEAD as usize && page.contains("three.js authors"), "no licences");
                // The page works without any other host.
                assert!(!page.contains("src=\"http") && !page.contains("href=\"http"));
            }
            Err(error) => {
                assert!(!is_built_in());
                assert_eq!(error.kind(), sys::ErrorKind::Usage);
                assert!(error.to_string().contains("npm run build --prefix viewer"), "{error}");
            }
        }
    }
}
