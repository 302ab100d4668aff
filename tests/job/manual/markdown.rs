//! Reads the parts of Markdown that the manual is made of: fenced blocks, headings, links, tables and code in the text.

use std::path::{Path, PathBuf};

/// A page of the manual.
pub(super) struct Page {
    /// Its path from the folder of the repository.
    pub(super) path: PathBuf,
    pub(super) text: String,
}

/// A fenced block.
pub(super) struct Block {
    pub(super) language: String,
    pub(super) text: String,
    /// The page and the line, for messages.
    pub(super) place: String,
}

/// A table, row by row. The first row has the names of the columns.
pub(super) type Table = Vec<Vec<String>>;

/// The folder of the repository.
pub(super) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Where notes for developers are.
const NOTES: &str = "docs/notes";

/// Returns README and all pages below `docs`.
pub(super) fn pages() -> Vec<Page> {
    let mut paths = vec![PathBuf::from("README.md")];
    find(Path::new("docs"), &mut paths);
    paths.into_iter().filter(|path| !path.starts_with(NOTES)).map(Page::read).collect()
}

/// Returns the pages for developers.
pub(super) fn developers_pages() -> Vec<Page> {
    let mut paths = ["ARCHITECTURE.md", "BENCHMARKS.md", "CONTRIBUTING.md"].map(PathBuf::from).to_vec();
    find(Path::new(NOTES), &mut paths);
    paths.into_iter().map(Page::read).collect()
}

fn find(folder: &Path, found: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(root().join(folder)).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    for path in names.iter().map(|name| folder.join(name)) {
        if root().join(&path).is_dir() {
            find(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
}

impl Page {
    /// Reads a page by its path from the folder of the repository.
    pub(super) fn read(path: PathBuf) -> Page {
        Page { text: std::fs::read_to_string(root().join(&path)).unwrap(), path }
    }

    /// Returns all fenced blocks, in order.
    pub(super) fn blocks(&self) -> Vec<Block> {
        let mut blocks: Vec<Block> = Vec::new();
        let mut is_open = false;
        for (number, line) in (1..).zip(self.text.lines()) {
            match line.strip_prefix("```") {
                Some(_) if is_open => is_open = false,
                Some(language) => {
                    is_open = true;
                    let place = format!("{}:{number}", self.path.display());
                    blocks.push(Block { language: language.trim().into(), text: String::new(), place });
                }
                None if is_open => blocks.last_mut().unwrap().text += &format!("{line}\n"),
                None => {}
            }
        }
        assert!(!is_open, "{}: a block is not closed", self.path.display());
        blocks
    }

    /// Returns the lines outside of blocks.
    fn prose(&self) -> impl Iterator<Item = &str> {
        let mut is_open = false;
        self.text.lines().filter(move |line| {
            let is_fence = line.starts_with("```");
            is_open ^= is_fence;
            !is_open && !is_fence
        })
    }

    /// Returns the code in the text, without that in tables.
    pub(super) fn code(&self) -> Vec<String> {
        let text: Vec<&str> = self.prose().filter(|line| !line.starts_with('|')).collect();
        code(&text.join("\n"))
    }

    /// Returns where the links and pictures lead.
    pub(super) fn links(&self) -> Vec<String> {
        let text: Vec<&str> = self.prose().collect();
        let text = text.join("\n");
        // What is between backticks is no link.
        let plain: String = text.split('`').step_by(2).collect();
        let targets = plain.split("](").skip(1).map(|rest| rest.split(')').next().unwrap().to_owned());
        targets.collect()
    }

    /// Returns the anchors of the headings, as GitHub makes them.
    pub(super) fn anchors(&self) -> Vec<String> {
        let mut anchors: Vec<String> = Vec::new();
        for line in self.prose() {
            let Some((_, heading)) = line.split_once("# ").filter(|(marks, _)| marks.bytes().all(|b| b == b'#')) else {
                continue;
            };
            let kept = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
            let plain: String = kept.map(|c| if c == ' ' { '-' } else { c }).flat_map(char::to_lowercase).collect();
            let same = (1..).map(|n| format!("{plain}-{n}"));
            let anchor = std::iter::once(plain.clone()).chain(same).find(|anchor| !anchors.contains(anchor)).unwrap();
            anchors.push(anchor);
        }
        anchors
    }

    /// Returns all tables.
    pub(super) fn tables(&self) -> Vec<Table> {
        let mut tables: Vec<Table> = Vec::new();
        let mut is_in_table = false;
        for line in self.prose() {
            if !line.starts_with('|') {
                is_in_table = false;
                continue;
            }
            if !is_in_table {
                tables.push(Vec::new());
            }
            is_in_table = true;
            tables.last_mut().unwrap().push(cells(line));
        }
        // The second row is the line below the names.
        tables.iter_mut().for_each(|table| drop(table.remove(1)));
        tables
    }
}

/// Returns the cells of a row. GitHub parts them at every `|` without a backslash before it, also in code.
fn cells(line: &str) -> Vec<String> {
    let inner = line.trim().strip_prefix('|').and_then(|rest| rest.strip_suffix('|'));
    let inner = inner.unwrap_or_else(|| panic!("a row ends with |: {line}"));
    let parted = inner.replace("\\|", "\u{1}");
    parted.split('|').map(|cell| cell.trim().replace('\u{1}', "|")).collect()
}

/// Returns what is between backticks.
pub(super) fn code(text: &str) -> Vec<String> {
    text.split('`').skip(1).step_by(2).map(|code| code.split_whitespace().collect::<Vec<_>>().join(" ")).collect()
}

/// Returns the code that is all of a cell.
pub(super) fn only_code(cell: &str) -> Option<&str> {
    cell.strip_prefix('`')?.strip_suffix('`').filter(|code| !code.contains('`'))
}
