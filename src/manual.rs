//! The man page, made from the definition of the command line.

use crate::cli::Cli;
use crate::config::nearest::nearest;
use clap::{Command, CommandFactory};
use clap_mangen::Man;
use roff::{Roff, roman};
use std::io;
use sys::{Error, Result};

/// What the program is called, whatever its file is called.
const PROGRAM: &str = "gdt-batch";

/// The part of the manual that programs are in.
const MANUAL: &str = "User Commands";

/// Returns the man page of all commands, or of the one of this name, in roff.
///
/// # Errors
/// [`Error::Config`] if there is no such command.
pub fn man(command: Option<&str>) -> Result<String> {
    let mut all = Cli::command().disable_help_subcommand(true);
    all.build();
    let mut page = Vec::new();
    let written = match command {
        None => write_page(all, &mut page),
        Some(name) => match shown(&all).find(|command| command.get_name() == name) {
            Some(command) => page_of(command.clone()).render(&mut page),
            None => {
                let names: Vec<&str> = shown(&all).map(Command::get_name).collect();
                let meant = match nearest(name, names.iter().copied()) {
                    Some(near) => format!("; did you mean {near}?"),
                    None => format!(": the commands are {}", names.join(", ")),
                };
                return Err(Error::Config(format!("there is no command {name}{meant}")));
            }
        },
    };
    written.map_err(|e| Error::Broken(e.to_string()))?;
    Ok(with_one_preamble(&String::from_utf8_lossy(&page)))
}

/// Returns the page with the definitions that every section begins with once, at its beginning, and with an empty date in its title.
fn with_one_preamble(page: &str) -> String {
    let start = page.lines().take_while(is_definition);
    let rest = page.lines().filter(|line| !is_definition(line));
    start.chain(rest).map(|line| format!("{}\n", dated(line))).collect()
}

/// Tells whether every section begins with this line.
fn is_definition(line: &&str) -> bool {
    line.starts_with(".ie ") || line.starts_with(".el ")
}

/// Returns the line of the title with an empty date: clap_mangen leaves it out, so that the version is shown as the date.
fn dated(line: &str) -> String {
    if line.starts_with(".TH ") { line.replacen("  \"", " \"\" \"", 1) } else { line.trim_end().into() }
}

/// Returns the commands that help shows.
fn shown(all: &Command) -> impl Iterator<Item = &Command> {
    all.get_subcommands().filter(|command| !command.is_hide_set())
}

fn page_of(command: Command) -> Man {
    let source = concat!("gdt-batch ", env!("CARGO_PKG_VERSION"));
    // Without a date the page is the same whenever it is made.
    Man::new(command).date("").source(source).manual(MANUAL)
}

/// Writes one page about all commands: a section for each.
fn write_page(all: Command, page: &mut Vec<u8>) -> io::Result<()> {
    let whole = page_of(all.clone());
    whole.render_title(page)?;
    whole.render_name_section(page)?;
    whole.render_synopsis_section(page)?;
    whole.render_description_section(page)?;
    whole.render_options_section(page)?;
    heading("SH", "COMMANDS").to_writer(page)?;
    for command in shown(&all) {
        write_command(command.clone(), page)?;
    }
    notes(&all).to_writer(page)
}

/// Writes what a command does, and its own options: those of all commands have been said.
fn write_command(command: Command, page: &mut Vec<u8>) -> io::Result<()> {
    heading("SS", &format!("{PROGRAM} {}", command.get_name())).to_writer(page)?;
    let is_common = |argument: &clap::Arg| argument.is_global_set() || argument.get_id() == "help";
    let command = command.mut_args(|argument| if is_common(&argument) { argument.hide(true) } else { argument });
    let own = Man::new(command);
    let mut is_first = true;
    for render in [Man::render_synopsis_section, Man::render_description_section, Man::render_options_section] {
        let mut section = Vec::new();
        render(&own, &mut section)?;
        let text = String::from_utf8_lossy(&section);
        // The section of the command has no headings in it.
        let lines = text.lines().filter(|line| !line.starts_with(".SH ") && !is_definition(line));
        let text: String = lines.map(|line| format!("{line}\n")).collect();
        // Headings and options are apart from what stands before them.
        if !std::mem::take(&mut is_first) && !text.starts_with('.') {
            page.extend_from_slice(b".PP\n");
        }
        page.extend_from_slice(text.as_bytes());
    }
    Ok(())
}

fn heading(kind: &str, text: &str) -> Roff {
    let mut roff = Roff::new();
    roff.control(kind, [text]);
    roff
}

/// Returns what `--help` shows at the end: a line that ends in a colon is a heading, and lines that are indented are shown as they are.
fn notes(all: &Command) -> Roff {
    let mut roff = Roff::new();
    let text = all.get_after_help().map(ToString::to_string).unwrap_or_default();
    let mut is_as_written = false;
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let is_indented = line.starts_with(' ');
        if is_indented != is_as_written {
            roff.control(if is_indented { "nf" } else { "fi" }, []);
            is_as_written = is_indented;
        }
        match line.strip_suffix(':').filter(|_| !is_indented) {
            Some(title) => roff.control("SH", [title.to_uppercase().as_str()]),
            None if is_indented => roff.text([roman(line.trim_start())]),
            None => roff.control("PP", []).text([roman(line)]),
        };
    }
    if is_as_written {
        roff.control("fi", []);
    }
    roff
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the commands, and the options of all of them with their dashes.
    fn names() -> (Vec<String>, Vec<String>) {
        let mut all = Cli::command();
        all.build();
        let commands: Vec<Command> = shown(&all).filter(|c| c.get_name() != "help").cloned().collect();
        let arguments = commands.iter().chain([&all]).flat_map(Command::get_arguments).filter(|a| !a.is_hide_set());
        let long = arguments.filter_map(|argument| argument.get_long()).map(|name| format!("--{name}"));
        (commands.iter().map(|command| command.get_name().to_string()).collect(), long.collect())
    }

    #[test]
    fn the_man_page_has_all_commands_and_options_and_what_help_says_at_the_end() {
        let page = man(None).unwrap().replace("\\-", "-");
        let (commands, options) = names();
        for command in commands {
            assert!(page.contains(&format!(".SS \"gdt-batch {command}\"")), "{command}: {page}");
            let own = man(Some(&command)).unwrap().replace("\\-", "-");
            assert!(own.contains(&format!("gdt-batch-{command}")) && own.contains(".SH SYNOPSIS"), "{own}");
        }
        let lost: Vec<&String> = options.iter().filter(|option| !page.contains(*option)).collect();
        assert!(lost.is_empty(), "{lost:?}");
        assert!(
            page.contains(".SH EXAMPLES\n.nf\ngdt-batch sample") && page.contains(".SH \"EXIT CODES\"\n"),
            "{page}"
        );
        assert!(!page.contains("--fresh"));
        assert!(page.contains(concat!(".TH gdt-batch 1 \"\" \"gdt-batch ", env!("CARGO_PKG_VERSION"), "\"")), "{page}");
        assert!(!page.contains("\"\n.PP\n") && !page.contains(".PP\n."), "no paragraph is empty: {page}");
        // The options of all commands are said once.
        assert_eq!(page.matches("Print the result as JSON").count(), 1);
    }

    #[test]
    fn a_command_that_there_is_not_is_refused_with_those_that_there_are() {
        let what = man(Some("chek")).unwrap_err().to_string();
        assert!(what.contains("no command chek; did you mean check?"), "{what}");
        let what = man(Some("sing")).unwrap_err().to_string();
        assert!(what.contains("no command sing: ") && what.contains("verify"), "{what}");
    }
}
