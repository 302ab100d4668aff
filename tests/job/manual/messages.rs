//! The messages in `docs/troubleshooting.md` are those that the program has.

use std::path::Path;

use super::markdown::{code, pages, root};

#[test]
fn the_messages_of_troubleshooting_are_those_of_the_program() {
    let all = sources(&root().join("src")) + &sources(&root().join("crates"));
    let page = pages().into_iter().find(|page| page.path == Path::new("docs/troubleshooting.md")).unwrap();
    let tables = page.tables();
    let rows = tables.iter().filter(|table| table[0][0] == "message").flat_map(|table| &table[1..]);
    let messages: Vec<String> = rows.flat_map(|row| code(&row[0])).collect();
    assert!(messages.len() > 50, "{}", messages.len());
    for message in &messages {
        for part in message.split("...").map(str::trim).filter(|part| part.len() > 3) {
            assert!(all.contains(part), "no source has {part:?} of {message:?}");
        }
    }
}

/// Returns the text of all sources below a folder, with every text of more than one line on one line.
fn sources(folder: &Path) -> String {
    let mut all = String::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all += &sources(&path);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = std::fs::read_to_string(path).unwrap().replace("\\\"", "\"");
            let mut parts = text.split("\\\n");
            all += parts.next().unwrap();
            parts.for_each(|part| all += part.trim_start());
        }
    }
    all
}
