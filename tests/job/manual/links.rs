//! Links and tables of the manual.

use std::path::{Component, Path, PathBuf};

use super::markdown::{Page, developers_pages, pages, root};
use crate::tileset::files_below;

#[test]
fn every_link_leads_somewhere() {
    let mut checked = 0;
    let all: Vec<Page> = pages().into_iter().chain(developers_pages()).collect();
    for page in &all {
        for link in page.links() {
            let wrong = complaint(page, &link);
            assert_eq!(wrong, None, "{}: {link}", page.path.display());
            checked += 1;
        }
    }
    assert!(checked > 100, "{checked}");
}

/// Developers find a file by the end of its path, without `crates/` and `src/`.
#[test]
fn sources_that_pages_for_developers_name_are_there() {
    let folders = [
        "crates",
        "src",
        "benches",
        "tests/common",
        "tests/gpu",
        "tests/job",
        "tests/resume",
        "tests/architecture",
        "tests/shaders",
    ]
    .map(|name| root().join(name));
    let relative = |path: PathBuf| path.strip_prefix(root()).unwrap().to_str().unwrap().to_owned();
    let short = |path: String| match path.strip_prefix("crates/") {
        Some(rest) => rest.replacen("/src/", "/", 1),
        None => path,
    };
    let files: Vec<String> = folders.iter().flat_map(|folder| files_below(folder)).map(relative).map(short).collect();
    let mut checked = 0;
    for page in developers_pages() {
        for name in page.code().into_iter().filter(|code| code.ends_with(".rs") && !code.contains(' ')) {
            let end = format!("/{}", short(name.to_string()));
            let is_there = files.iter().any(|file| format!("/{file}").ends_with(&end));
            assert!(is_there, "{}: there is no {name}", page.path.display());
            checked += 1;
        }
    }
    assert!(checked > 80, "{checked}");
}

/// Returns what is wrong with a link.
fn complaint(page: &Page, link: &str) -> Option<&'static str> {
    if let Some(address) = link.strip_prefix("https://") {
        let host = address.split('/').next().unwrap();
        let is_name = host.contains('.') && host.bytes().all(|b| b.is_ascii_alphanumeric() || b".-".contains(&b));
        return (!is_name || address.contains(char::is_whitespace)).then_some("no address");
    }
    let (file, anchor) = link.split_once('#').map_or((link, None), |(file, anchor)| (file, Some(anchor)));
    let path = match file {
        "" => page.path.clone(),
        _ => plain(&page.path.parent().unwrap().join(file)),
    };
    if !root().join(&path).exists() {
        return Some("there is no such file");
    }
    let anchor = anchor?;
    let is_there = Page::read(path).anchors().iter().any(|known| known == anchor);
    (!is_there).then_some("there is no such heading")
}

/// Returns the path without `..`.
fn plain(path: &Path) -> PathBuf {
    path.components().fold(PathBuf::new(), |mut plain, component| {
        if component == Component::ParentDir {
            plain.pop();
        } else {
            plain.push(component);
        }
        plain
    })
}

#[test]
fn the_list_of_pages_has_all_of_them() {
    let pages = pages();
    let list = pages.iter().find(|page| page.path == Path::new("docs/SUMMARY.md")).unwrap();
    let listed = list.links();
    for page in pages.iter().filter(|page| page.path.starts_with("docs") && page.path != list.path) {
        let name = page.path.strip_prefix("docs").unwrap().to_str().unwrap();
        assert!(listed.iter().any(|link| link == name), "docs/SUMMARY.md does not list {name}");
    }
}

/// GitHub cuts rows that are too long, also at a `|` in code.
#[test]
fn the_rows_of_a_table_have_as_many_cells_as_its_head() {
    for page in pages() {
        for table in page.tables() {
            for row in &table {
                assert_eq!(row.len(), table[0].len(), "{}: {row:?}", page.path.display());
            }
        }
    }
}
