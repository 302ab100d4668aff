//! Advice about options that stand where the command line does not take them.

use crate::cli::Cli;
use crate::cloud_job::option_of_flag;
use crate::config::option_list::options;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, Error, ErrorKind};
use clap::{Arg, Command, CommandFactory};

/// Returns the error with the command that has the option, if the option is one of another command. Names that help does not show are not
/// suggested.
pub fn with_advice(mut error: Error) -> Error {
    if error.kind() != ErrorKind::UnknownArgument {
        return error;
    }
    let all = Cli::command();
    let suggested = text(&error, ContextKind::SuggestedArg);
    if suggested.is_some_and(|option| !all_commands(&all).any(|command| has(command, &option))) {
        error.remove(ContextKind::SuggestedArg);
    }
    let Some(option) = text(&error, ContextKind::InvalidArg) else { return error };
    if let Some(advice) = place_of(&all, &option) {
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(advice)]));
    }
    error
}

fn text(error: &Error, kind: ContextKind) -> Option<String> {
    match error.get(kind) {
        Some(ContextValue::String(text)) => Some(text.clone()),
        _ => None,
    }
}

fn all_commands(all: &Command) -> impl Iterator<Item = &Command> {
    all.get_subcommands().filter(|command| !command.is_hide_set()).chain([all])
}

/// Tells whether help shows this option of a command.
fn has(command: &Command, option: &str) -> bool {
    let is_it = |argument: &Arg| argument.get_long().is_some_and(|name| option == format!("--{name}"));
    command.get_arguments().any(|argument| !argument.is_hide_set() && is_it(argument))
}

/// Says which commands have an option.
fn place_of(all: &Command, option: &str) -> Option<String> {
    if let (true, Some(key)) = (has(all, option), option_of_flag(option)) {
        return Some(format!(
            "{option} is for point clouds, as in gdt-batch cloud.laz {option} ...; a configuration sets {key}"
        ));
    }
    let own = all_commands(all).filter(|command| has(command, option));
    let names: Vec<String> = own.map(name_of).collect();
    match &names[..] {
        [] => key_of(option).map(|key| {
            format!("{option} is not a flag, but a configuration has {key}: gdt-batch cloud.laz --write-config job.toml writes one")
        }),
        names => Some(format!("{option} is an option of {}", names.join(", "))),
    }
}

/// Returns what messages call the key of a configuration with the name of an option.
fn key_of(option: &str) -> Option<String> {
    let key = option.strip_prefix("--")?.replace('-', "_");
    let found = options().into_iter().find(|known| known.key == key)?;
    Some(format!("{} {key}", found.table))
}

fn name_of(command: &Command) -> String {
    match command.get_name() {
        "gdt-batch" => "gdt-batch FILE".into(),
        name => format!("gdt-batch {name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    fn told(words: &[&str]) -> String {
        with_advice(Cli::try_parse_from([&["gdt-batch"], words].concat()).unwrap_err()).to_string()
    }

    #[test]
    fn an_option_at_the_wrong_place_is_sent_to_its_command() {
        for (words, advice) in [
            (&["check", "job.toml", "--histogram"][..], "--histogram is an option of gdt-batch info"),
            (&["job.toml", "--histogram"], "--histogram is an option of gdt-batch info"),
            (&["info", "a.laz", "--restart"], "--restart is an option of gdt-batch submit, gdt-batch FILE"),
            (&["check", "job.toml", "--surface", "all"], "a configuration sets [input] surface"),
            (&["a.laz", "--max-eror", "1"], "similar argument exists: '--max-error'"),
            (&["a.laz", "--max-edge", "30"], "a configuration has [output] max_edge"),
            (&["a.laz", "--copyright", "me"], "a configuration has [output] copyright"),
        ] {
            let told = told(words);
            assert!(told.contains(advice) && !told.contains("as a value"), "{words:?}: {told}");
        }
    }

    #[test]
    fn hidden_names_are_not_suggested() {
        for words in [&["job.toml", "--fres"][..], &["work", "job.toml", "--until-stdin-end"]] {
            let told = told(words);
            assert!(!told.contains("--fresh") && !told.contains("until-stdin-ends"), "{told}");
        }
    }
}
