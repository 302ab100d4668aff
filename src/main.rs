//! The program: parses the command line, runs a command, prints its result or error, and exits with its code.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

use clap::Parser;
use gdt_batch::cli::{Cli, CliCommand, PrintOptions};
use gdt_batch::gpu::selftest;
use gdt_batch::job;
use gdt_batch::job::options::RunOptions;
use gdt_batch::job::preflight::check;
use gdt_batch::job::progress::stage::ProgressOutput;
use gdt_batch::job::report::skipped::skipped_summary;
use gdt_batch::output::file_names::OutputFiles;
use gdt_batch::{Error, Result, config, input, interrupt, sample, say, verify};
use serde::Serialize;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    // clap itself exits with code 2 if the command line is wrong.
    match run(Cli::parse()) {
        Ok(code) => code,
        Err(error) => {
            say(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(cli: Cli) -> Result<ExitCode> {
    let print = cli.print;
    match (&cli.command, &cli.config) {
        (Some(_), Some(config)) => {
            let config = config.display();
            Err(Error::Config(format!("{config} and a command: name the configuration after the command, or alone")))
        }
        (Some(CliCommand::Check { config }), _) => check_job(config, print),
        (Some(CliCommand::Verify { directory, memory }), _) => verify_output(directory, *memory, print),
        (Some(CliCommand::Info { files }), _) => show_info(files, print),
        (Some(CliCommand::Gpu { adapter, side }), _) => test_gpu(adapter.as_deref(), *side, print),
        (Some(CliCommand::Sample { file, points, seed }), _) => {
            sample::write(file, *points, *seed).map(|()| ExitCode::SUCCESS)
        }
        (None, Some(config)) => run_job(config, &cli),
        (None, None) => Err(Error::Config("name a configuration file; --help shows how".into())),
    }
}

/// Runs the job of a configuration file. Files that were left out are reported on standard error too, even with `--quiet`.
fn run_job(path: &Path, cli: &Cli) -> Result<ExitCode> {
    if cli.fresh {
        say("--fresh has a new name: --restart; the old one still works");
    }
    let options = RunOptions {
        progress: ProgressOutput::detect(cli.print.quiet),
        force: cli.force,
        restart: cli.restart || cli.fresh,
    };
    let config = config::load(path)?;
    interrupt::listen()?;
    let report = job::run(&config, options)?;
    print_result(&report, cli.print)?;
    if let Some(summary) = skipped_summary(report.files, &report.skipped) {
        say(&format!("{summary}: see {}", OutputFiles::new(&config.output.directory).report().display()));
    }
    Ok(ExitCode::SUCCESS)
}

fn check_job(path: &Path, print: PrintOptions) -> Result<ExitCode> {
    let preflight = check::check(&config::load(path)?)?;
    print_result(&preflight, print)?;
    preflight.passes().map(|()| ExitCode::SUCCESS)
}

fn verify_output(directory: &Path, memory: u64, print: PrintOptions) -> Result<ExitCode> {
    let verdict = verify::verify(directory, memory)?;
    print_result(&verdict, print)?;
    if verdict.holds() {
        return Ok(ExitCode::SUCCESS);
    }
    say(&format!("error: {} does not hold the exact Delaunay triangulation", directory.display()));
    Ok(ExitCode::from(4))
}

fn test_gpu(adapter: Option<&str>, side: Option<u32>, print: PrintOptions) -> Result<ExitCode> {
    let test = selftest::run(adapter, side)?;
    print_result(&test, print)?;
    if test.holds() {
        return Ok(ExitCode::SUCCESS);
    }
    say("error: a shader and its twin disagree on this GPU; jobs are exact all the same, but slow");
    Ok(ExitCode::from(4))
}

fn show_info(files: &[PathBuf], print: PrintOptions) -> Result<ExitCode> {
    let is_missing = |file: &&PathBuf| file.symlink_metadata().is_err_and(|e| e.kind() == ErrorKind::NotFound);
    if let Some(missing) = files.iter().find(is_missing) {
        return Err(Error::Config(format!("there is no file {}: name the point clouds to look at", missing.display())));
    }
    for file in files {
        let source = input::open(file, &input::TextOptions::default())?;
        print_result(&input::info::describe(&source), print)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints a result for people or as JSON.
fn print_result(result: &(impl Display + Serialize), print: PrintOptions) -> Result<()> {
    let text = if print.json {
        serde_json::to_string_pretty(result).map_err(|e| Error::Broken(e.to_string()))?
    } else if print.quiet {
        return Ok(());
    } else {
        result.to_string()
    };
    match writeln!(std::io::stdout(), "{}", text.trim_end()) {
        // The reader has closed the pipe because it has read enough.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        outcome => outcome.map_err(Error::io("write to", "standard output")),
    }
}
