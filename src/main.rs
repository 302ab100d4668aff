//! The command line: parse, run, print the result or the error, exit with its code.

use clap::Parser;
use gdt_batch::cli::{Cli, Command, Talk};
use gdt_batch::gpu::selftest;
use gdt_batch::job::options::JobOptions;
use gdt_batch::job::preflight::check;
use gdt_batch::job::progress::stage::ProgressOutput;
use gdt_batch::job::report::skipped_summary;
use gdt_batch::job::{self, Options};
use gdt_batch::say;
use gdt_batch::{Error, Result, input, interrupt, sample, verify};
use serde::Serialize;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    // clap itself exits with code 2 on a wrong command line.
    match run(Cli::parse()) {
        Ok(code) => code,
        Err(error) => {
            say(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(cli: Cli) -> Result<ExitCode> {
    let talk = cli.talk;
    match (cli.command, cli.config) {
        (Some(_), Some(config)) => {
            let config = config.display();
            return Err(Error::Config(format!(
                "{config} and a command: name the configuration after the command, or alone"
            )));
        }
        (Some(Command::Check { config }), _) => {
            let preflight = check::run(&gdt_batch::config::load(&config)?)?;
            show(&preflight, talk)?;
            preflight.passes()?;
        }
        (Some(Command::Verify { directory, memory }), _) => return prove(&directory, memory, talk),
        (Some(Command::Info { files }), _) => info(&files, talk)?,
        (Some(Command::Gpu { adapter, side }), _) => return test_gpu(adapter.as_deref(), side, talk),
        (Some(Command::Sample { file, points, seed }), _) => sample::write(&file, points, seed)?,
        (None, Some(config)) => {
            let progress = ProgressOutput::detect(talk.quiet);
            let options = Options { progress, force: cli.force, fresh: cli.fresh };
            run_job(&gdt_batch::config::load(&config)?, options, talk)?;
        }
        (None, None) => return Err(Error::Config("name a configuration file; --help shows how".into())),
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs a job and says what it came to: on standard error too, and even when quiet, if files were left out.
fn run_job(config: &JobOptions, options: Options, talk: Talk) -> Result<()> {
    interrupt::listen()?;
    let report = job::run(config, options)?;
    show(&report, talk)?;
    if let Some(summary) = skipped_summary(report.files, &report.skipped) {
        say(&format!("{summary}: see {}", config.output.directory.join("report.json").display()));
    }
    Ok(())
}

/// Prints a result for people or for machines.
fn show(result: &(impl Display + Serialize), talk: Talk) -> Result<()> {
    let text = if talk.json {
        serde_json::to_string_pretty(result).map_err(|e| Error::Broken(e.to_string()))?
    } else if talk.quiet {
        return Ok(());
    } else {
        result.to_string()
    };
    match writeln!(std::io::stdout(), "{}", text.trim_end()) {
        // Who closes the pipe has read enough.
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        outcome => outcome.map_err(Error::io("write to", "standard output")),
    }
}

fn prove(directory: &Path, memory: u64, talk: Talk) -> Result<ExitCode> {
    let verdict = verify::verify(directory, memory)?;
    show(&verdict, talk)?;
    if verdict.holds() {
        return Ok(ExitCode::SUCCESS);
    }
    say(&format!("error: {} does not hold the exact Delaunay triangulation", directory.display()));
    Ok(ExitCode::from(4))
}

fn test_gpu(adapter: Option<&str>, side: Option<u32>, talk: Talk) -> Result<ExitCode> {
    let test = selftest::run(adapter, side)?;
    show(&test, talk)?;
    if test.holds() {
        return Ok(ExitCode::SUCCESS);
    }
    say("error: a shader and its twin disagree on this GPU; jobs are exact all the same, but slow");
    Ok(ExitCode::from(4))
}

fn info(files: &[PathBuf], talk: Talk) -> Result<()> {
    if let Some(missing) =
        files.iter().find(|file| file.symlink_metadata().is_err_and(|e| e.kind() == ErrorKind::NotFound))
    {
        return Err(Error::Config(format!("there is no file {}: name the point clouds to look at", missing.display())));
    }
    for file in files {
        let source = input::open(file, &input::TextOptions::default())?;
        show(&input::info::describe(&source), talk)?;
    }
    Ok(())
}
