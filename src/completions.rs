//! The scripts that let shells complete the command line. clap_complete writes them from a definition of the command line that is made for
//! them here; what is wrong in the scripts for bash and zsh is mended afterwards.

use crate::cli::Cli;
use clap::builder::{PossibleValuesParser, Resettable};
use clap::{Arg, Command, CommandFactory};
use clap_complete::Shell;

/// What the program is called, whatever its file is called.
const PROGRAM: &str = "gdt-batch";

/// What the command line calls the files of a job, which stand where a command may stand.
const FILES: &str = "files";

/// Where the script for zsh completes the first word.
const FIRST_WORD: &str = "\":: :_gdt-batch_commands\" \\\n";

/// What completes it: a command, a point cloud, or the configuration of a job.
const COMMAND_OR_FILE: &str = "\
':: :{_alternative \"commands:command:_gdt-batch_commands\" \"files:point cloud or configuration:_files\"}' \\
";

/// Returns the script that lets `shell` complete the command line.
pub fn script(shell: Shell) -> String {
    let mut definition = match shell {
        Shell::Bash => visible(&Cli::command()),
        // With a place for files, zsh would take a command for one, and the word after that for the command.
        Shell::Zsh => without(&visible(&Cli::command()), FILES),
        _ => with_values_as_commands(&visible(&Cli::command())),
    };
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut definition, PROGRAM, &mut script);
    let script = String::from_utf8_lossy(&script);
    match shell {
        Shell::Bash => for_bash(&script),
        Shell::Zsh => for_zsh(&script),
        _ => script.into_owned(),
    }
}

/// Returns what is to be completed: all that help shows. `help` and `man` take the name of a command.
fn visible(all: &Command) -> Command {
    let shown: Vec<&Command> = all.get_subcommands().filter(|command| !command.is_hide_set()).collect();
    let names: Vec<String> = shown.iter().map(|command| command.get_name().to_string()).collect();
    let name = Arg::new("command").value_parser(PossibleValuesParser::new(names));
    let help = Command::new("help").about("Print this message or the help of a command").arg(name.clone());
    let commands = shown.into_iter().map(|command| match command.get_name() {
        "man" => copy(command, command.get_arguments()).mut_arg("command", |_| name.clone()),
        _ => copy(command, command.get_arguments()),
    });
    let version = all.get_version().unwrap_or_default().to_string();
    copy(all, all.get_arguments())
        .version(version)
        .disable_help_subcommand(true)
        .subcommands(commands.collect::<Vec<_>>())
        .subcommand(help)
}

/// Returns a command of the same name with those of `arguments` that help shows.
fn copy<'a>(command: &Command, arguments: impl Iterator<Item = &'a Arg>) -> Command {
    let about = command.get_about().cloned().unwrap_or_default();
    let shown = arguments.filter(|argument| !argument.is_hide_set());
    // An option that is left out may be one that another one needs.
    let shown = shown.map(|argument| argument.clone().requires(Resettable::Reset));
    Command::new(command.get_name().to_string()).about(about).args(shown)
}

/// Returns the definition without one of its arguments.
fn without(all: &Command, name: &str) -> Command {
    let rest = all.get_arguments().filter(|argument| argument.get_id() != name);
    let version = all.get_version().unwrap_or_default().to_string();
    copy(all, rest).version(version).disable_help_subcommand(true).subcommands(all.get_subcommands().cloned())
}

/// Returns the definition with values that have no option, such as names of shells, as commands: clap_complete offers only these to fish,
/// PowerShell and Elvish.
fn with_values_as_commands(all: &Command) -> Command {
    all.clone().mut_subcommands(|command| {
        let values =
            command.get_positionals().flat_map(Arg::get_possible_values).map(|value| value.get_name().to_string());
        // Fish would find the command itself among those that have been given already.
        let values: Vec<String> = values.filter(|value| value != command.get_name()).collect();
        if values.is_empty() {
            return command;
        }
        let bare = values.into_iter().map(|name| Command::new(name).disable_help_flag(true));
        copy(&command, command.get_opts()).disable_help_subcommand(true).subcommands(bare)
    })
}

/// Returns the script for bash with one name for each of its functions, and with options offered only after a hyphen, so that files are
/// offered where a command takes some.
fn for_bash(script: &str) -> String {
    // clap_complete 4.6 has two names for one function if the program's name has a hyphen, so that options were not completed.
    let script = script.replace("gdt__subcmd__batch", "gdt__batch");
    let mut lines = Vec::new();
    for line in script.lines() {
        lines.push(line.to_string());
        if let Some(words) = line.trim_start().strip_prefix("opts=\"").and_then(|rest| rest.strip_suffix('"')) {
            let others: Vec<&str> = words.split(' ').filter(|word| !word.starts_with('-')).collect();
            lines.push(format!("            [[ ${{cur}} == -* ]] || opts=\"{}\"", others.join(" ")));
        }
    }
    lines.iter().skip_while(|line| line.is_empty()).map(|line| format!("{line}\n")).collect()
}

/// Returns the script for zsh with a file as the first word too. After it, the options of a job and more files are completed.
fn for_zsh(script: &str) -> String {
    let Some((head, _)) = script.split_once(FIRST_WORD) else { return script.into() };
    let options: String = head.lines().filter(|line| line.starts_with('\'')).map(|line| format!("{line}\n")).collect();
    let of_job = format!(
        "case $line[1] in\n            (*.*|*/*)\n_arguments \"${{_arguments_options[@]}}\" : \\\n{options}'*:point cloud:_files' \\\n&& ret=0\n;;"
    );
    script.replacen(FIRST_WORD, COMMAND_OR_FILE, 1).replacen("case $line[1] in", &of_job, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::ValueEnum;

    #[test]
    fn every_shell_is_offered_what_help_shows_and_nothing_else() {
        let mut all = Cli::command();
        all.build();
        let commands: Vec<&Command> = all.get_subcommands().filter(|command| command.get_name() != "help").collect();
        let arguments = commands.iter().flat_map(|command| command.get_arguments()).chain(all.get_arguments());
        let options = arguments.filter(|argument| !argument.is_hide_set()).filter_map(Arg::get_long);
        let names: Vec<&str> = commands.iter().map(|command| command.get_name()).chain(options).collect();
        assert!(names.len() > 45, "{names:?}");
        for shell in Shell::value_variants() {
            let script = script(*shell);
            let lost: Vec<&&str> = names.iter().filter(|name| !script.contains(**name)).collect();
            assert!(lost.is_empty() && script.contains(PROGRAM) && !script.contains("fresh"), "{shell}: {lost:?}");
        }
    }

    /// What zsh does with this, tests/job/command_line.rs tries where it is installed.
    #[test]
    fn zsh_takes_the_first_word_for_a_command_or_for_a_file() {
        let script = script(Shell::Zsh);
        let (head, rest) = script.split_once("case $line[1] in").unwrap();
        assert!(head.contains(COMMAND_OR_FILE) && !head.contains("files --"), "{head}");
        assert!(rest.trim_start().starts_with("(*.*|*/*)") && !script.contains("$line[2]"), "{script}");
        let (of_job, _) = rest.split_once(";;").unwrap();
        assert!(of_job.contains("'--restart[") && of_job.contains("'*:point cloud:_files'"), "{of_job}");
    }
}
