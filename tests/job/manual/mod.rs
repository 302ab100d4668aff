//! README and the manual say what is so: their configurations and commands run, their keys, options and messages exist, and their links
//! lead somewhere.

mod data;
mod keys;
mod links;
mod markdown;
mod messages;
mod run;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use gdt_batch::cli::Cli;
use rayon::prelude::*;

use keys::Key;
use markdown::{Page, code, only_code, pages, root};

use crate::tileset::files_below;

#[test]
fn every_configuration_and_every_command_runs() {
    let episodes: Vec<_> = pages().iter().flat_map(run::episodes).collect();
    assert!(episodes.len() > 30, "{}", episodes.len());
    episodes.par_iter().for_each(run::Episode::run);
}

/// Files that pages link to.
#[test]
fn every_configuration_in_a_file_is_one() {
    let all = ["configs", "docs"].into_iter().flat_map(|folder| files_below(&root().join(folder)));
    let is_configuration =
        |path: &PathBuf| path.extension().is_some_and(|e| e == "toml") && !path.ends_with("book.toml");
    let read: Vec<_> = all.filter(is_configuration).map(|path| gdt_batch::config::load(&path).unwrap()).collect();
    assert!(read.len() >= 2);
}

/// Commands in the text are commands of the program. A name in capitals stands for others.
#[test]
fn every_command_in_the_text_is_one() {
    for page in pages() {
        let in_tables = page.tables().concat().concat();
        let all = page.code().into_iter().chain(in_tables.iter().flat_map(|cell| code(cell)));
        let is_name = |word: &str| word.bytes().all(|byte| byte.is_ascii_uppercase());
        for command in all.filter(|code| code.starts_with("gdt-batch ") && !code.split(' ').any(is_name)) {
            assert!(is_command(&command), "{}: {command} is no command", page.path.display());
        }
    }
}

/// Tells whether this is a command, or the beginning of one.
fn is_command(text: &str) -> bool {
    match Cli::try_parse_from(text.split(' ')) {
        // An ending tells a file from a mistyped command.
        Ok(Cli { command: None, files, .. }) => files.iter().all(|file| file.extension().is_some() || is_folder(file)),
        Ok(_) => true,
        Err(error) => matches!(
            error.kind(),
            ErrorKind::DisplayHelp | ErrorKind::DisplayVersion | ErrorKind::MissingRequiredArgument
        ),
    }
}

fn is_folder(path: &Path) -> bool {
    path.to_str().is_some_and(|path| path.ends_with('/'))
}

#[test]
fn the_manual_has_every_key_and_no_others() {
    let known = keys::to_explain();
    let mut said: BTreeSet<Key> = BTreeSet::new();
    for page in pages() {
        let rows = rows_of_keys(&page);
        for (table, key, default) in &rows {
            let at = format!("{}: {table} {key}", page.path.display());
            assert!(known.contains(&(table.clone(), key.clone())), "{at} is no key");
            if let Some(default) = only_code(default) {
                let value = keys::value(default).unwrap_or_else(|| panic!("{at}: {default} is no value"));
                assert_eq!(keys::load(table, key, value), Ok(()), "{at}: its default");
            }
        }
        if page.path.starts_with("docs") {
            said.extend(rows.into_iter().map(|(table, key, _)| (table, key)));
        }
    }
    let missing: Vec<_> = known.difference(&said).collect();
    assert!(missing.is_empty(), "no table of the manual has {missing:?}");
}

/// Returns the keys in the tables of a page, with their tables and what is said to be their default. Such a table has the name of a table
/// of the configuration above its keys, or the word "option".
fn rows_of_keys(page: &Page) -> Vec<(String, String, String)> {
    let mut found = Vec::new();
    for table in page.tables() {
        let name = only_code(&table[0][0]).filter(|name| keys::TABLES.contains(name));
        for row in &table[1..] {
            let Some(key) = only_code(&row[0]) else { continue };
            let default = || row[1].clone();
            match name {
                Some(name) => found.push((name.to_owned(), key.to_owned(), default())),
                None if table[0][0] != "option" => {}
                None if key.starts_with("--") => is_an_option(page, key),
                // An entry of lines alone.
                None if keys::TABLES.contains(&key) => {}
                None => match keys::parted(key) {
                    Some((name, key, None)) => found.push((name.to_owned(), key.to_owned(), default())),
                    _ => panic!("{}: {key} is no option", page.path.display()),
                },
            }
        }
    }
    found
}

fn is_an_option(page: &Page, option: &str) {
    let name = option.trim_start_matches('-').split(' ').next().unwrap();
    let cli = Cli::command();
    let mut all = cli.get_arguments().chain(cli.get_subcommands().flat_map(|command| command.get_arguments()));
    assert!(all.any(|option| option.get_long() == Some(name)), "{}: {option} is no option", page.path.display());
}

/// `[output] page = true` in the text names a key, and a value that it can have.
#[test]
fn keys_in_the_text_exist() {
    let mut values = 0;
    for page in pages() {
        let in_tables = page.tables().concat().concat();
        let all = page.code().into_iter().chain(in_tables.iter().flat_map(|cell| code(cell)));
        for code in all {
            let Some((table, key, value)) = keys::parted(&code) else { continue };
            let at = format!("{}: {code}", page.path.display());
            assert!(keys::is_known(table, key), "{at}: there is no such key");
            if let Some(value) = value.filter(|value| !value.contains("...")) {
                let value = keys::value(value).unwrap_or_else(|| panic!("{at}: no value"));
                assert_eq!(keys::load(table, key, value), Ok(()), "{at}");
                values += 1;
            }
        }
    }
    assert!(values > 10, "{values}");
}
