//! A text with the path or the URL of a point cloud in each line. Empty lines and those that begin with `#` do not count.

use std::path::Path;

use crate::file::random_access::RandomAccessFile;
use crate::lists::listed_cloud::{ListedCloud, is_cloud, name_in, place_of};
use crate::remote::name::is_url;
use sys::{Error, Result};

/// The bytes by which a list is told from a table of points.
const HEAD: u64 = 1 << 14;

/// The most bytes of a list.
const MOST: u64 = 1 << 28;

/// The endings of texts that a line may name.
const TEXTS: [&str; 5] = [".csv", ".xyz", ".asc", ".pts", ".tsv"];

/// The endings of lists.
const LISTS: [&str; 4] = [".txt", ".lst", ".vpc", ".json"];

/// Returns the clouds that the text names; `None` if its first lines name none, or one of them is a row of numbers.
///
/// # Errors
/// [`Error::Input`] names the first line that names no cloud, [`Error::Io`] a file that cannot be read.
pub(super) fn clouds_of(path: &Path) -> Result<Option<Vec<ListedCloud>>> {
    let file = RandomAccessFile::open(path)?;
    let head = file.bytes(0..file.size().min(HEAD))?;
    let is_whole = head.len() as u64 == file.size();
    if !is_list(&String::from_utf8_lossy(&head), is_whole) {
        return Ok(None);
    }
    if file.size() > MOST {
        return Err(Error::input(path, format!("is a list of more than {} MiB: divide it", MOST >> 20)));
    }
    let bytes = if is_whole { head } else { file.bytes(0..file.size())? };
    let text = String::from_utf8(bytes).map_err(|_| Error::input(path, "is a list, but not in UTF-8: save it so"))?;
    let mut clouds = Vec::new();
    for (number, line) in entries(&text) {
        let refused = |what: String| Error::input(path, format!("line {number}: {what}"));
        let place = place_of(path, line).map_err(refused)?;
        if is_pattern(line) && !place.exists() {
            return Err(refused(format!(
                "{line:?} is a pattern, and a list takes paths and URLs; fix: write a line for each file, or write the pattern into [input] files"
            )));
        }
        if names_list(line) {
            return Err(refused(format!(
                "{line:?} may be a list or a table, and a list names .las, .laz, ept.json, and texts such as .csv; fix: write it into [input] files"
            )));
        }
        if !names_cloud(line) {
            return Err(refused(format!(
                "{line:?} is not a point cloud (.las, .laz, ept.json, or a text such as .csv), as the other lines are; fix: remove the line, or put # before it"
            )));
        }
        clouds.push(ListedCloud { path: place, claim: None, unusable_box: None });
    }
    Ok(Some(clouds))
}

/// Returns whether a line names a point cloud, and no line is a row of numbers. A text of nothing but patterns and lists is meant as a list
/// too. The last line is looked at only if the text `is_whole`.
fn is_list(head: &str, is_whole: bool) -> bool {
    let end = if is_whole { head.len() } else { head.rfind('\n').unwrap_or(0) };
    let lines = || entries(&head[..end]).map(|(_, line)| line);
    let is_meant = |line| is_pattern(line) || names_list(line);
    (lines().any(names_cloud) || lines().next().is_some() && lines().all(is_meant)) && !lines().any(is_row)
}

/// Returns whether a line has characters of patterns, and none that separate columns.
fn is_pattern(line: &str) -> bool {
    !is_url(line) && line.contains(['*', '?']) && !line.contains([',', ';', '\t', ' '])
}

/// Returns whether a line names another list.
fn names_list(line: &str) -> bool {
    let name = name_in(line);
    LISTS.iter().any(|ending| name.len() > ending.len() && name.ends_with(ending)) && !is_cloud(line)
}

/// Returns whether a line begins with three numbers, as those of tables of points do.
fn is_row(line: &str) -> bool {
    let mut fields = line.split([',', ';', '\t', ' ']).filter(|field| !field.is_empty());
    (0..3).all(|_| fields.next().is_some_and(|field| field.parse::<f64>().is_ok()))
}

/// Returns the lines that count, with their numbers from 1 on, and without quotes around them.
fn entries(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = text.lines().map(str::trim).enumerate().map(|(index, line)| (index + 1, line));
    let lines = lines.map(|(number, line)| (number, unquoted(line)));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}

/// Returns a line without the quotes around it. Those of several columns stay.
fn unquoted(line: &str) -> &str {
    let inner = line.strip_prefix('"').and_then(|line| line.strip_suffix('"'));
    inner.filter(|inner| !inner.contains('"')).unwrap_or(line)
}

fn names_cloud(line: &str) -> bool {
    let name = name_in(line);
    is_cloud(line) || TEXTS.iter().any(|ending| name.len() > ending.len() && name.ends_with(ending))
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn clouds(text: &[u8]) -> Result<Option<Vec<PathBuf>>> {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("list.txt");
        std::fs::write(&list, text).unwrap();
        let short = |cloud: ListedCloud| {
            cloud.path.strip_prefix(folder.path()).map(Path::to_path_buf).unwrap_or(cloud.path.clone())
        };
        Ok(clouds_of(&list)?.map(|clouds| clouds.into_iter().map(short).collect()))
    }

    #[test]
    fn lines_name_clouds() {
        let text = "\u{feff}# tiles\r\na.laz\r\n\n  \"b c/1.LAS\" \nhttps://host/d.copc.laz?key=1\n/e/ept.json\nf.xyz";
        let expected = ["a.laz", "b c/1.LAS", "https://host/d.copc.laz?...", "/e/ept.json", "f.xyz"];
        assert_eq!(clouds(text.as_bytes()).unwrap().unwrap(), expected.map(PathBuf::from));
    }

    #[test]
    fn a_table_of_points_is_no_list() {
        for text in [
            "1 2 3\n4 5 6\n",
            "# a.laz\n1 2 3\n",
            "x,y,z\n1,2,3\n",
            "a.laz\n1 2 3\n",
            "1.5,2,3,a.laz\n4,5,6,a.laz\n",
            "",
            "# a.laz\n",
            ".csv\n",
            "*** survey ***\n1 2 3\n",
            "x*,y,z\n1,2,3\n",
            "area.txt\n1 2 3\n",
            "\u{0}a.la\n",
        ] {
            assert_eq!(clouds(text.as_bytes()).unwrap(), None, "{text:?}");
        }
    }

    #[test]
    fn a_line_that_names_no_cloud_is_an_error() {
        let text = "tile.laz\n".repeat(HEAD as usize / 8) + "roads.gpkg\n";
        let error = clouds(text.as_bytes()).unwrap_err().to_string();
        assert!(error.contains("line 2049: \"roads.gpkg\" is not a point cloud"), "{error}");
        let error = clouds(&[text.replace("roads.gpkg", "").as_bytes(), b"\xff.laz\n"].concat()).unwrap_err();
        assert!(error.to_string().contains("not in UTF-8"), "{error}");
        let error = clouds(b"tiles of 2024\na.laz\nb.laz\n").unwrap_err().to_string();
        assert!(error.contains("line 1: \"tiles of 2024\" is not a point cloud"), "{error}");
        for text in ["tiles/*.laz\n", "tiles/s??.l??\n*\n", "a.laz\nb*\n"] {
            let error = clouds(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains("is a pattern, and a list takes paths and URLs"), "{text:?}: {error}");
        }
        for text in ["tiles.txt\n", "a.laz\nb.vpc\n"] {
            let error = clouds(text.as_bytes()).unwrap_err().to_string();
            assert!(error.contains("may be a list or a table, and a list names .las"), "{text:?}: {error}");
        }
        let error = clouds(b"a.laz\nftp://host/b.laz\n").unwrap_err().to_string();
        assert!(error.contains("line 2: files can be read by https://"), "{error}");
    }
}
