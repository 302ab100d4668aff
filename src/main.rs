//! The program: parses the command line, runs a command, prints its result or error, and exits with its code.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

use clap::Parser;
use gdt_batch::cli::{Cli, CliCommand, PrintOptions};
use gdt_batch::gpu::selftest;
use gdt_batch::job;
use gdt_batch::job::options::RunOptions;
use gdt_batch::job::phase::PhaseTasks;
use gdt_batch::job::preflight::check;
use gdt_batch::job::progress::stage::ProgressOutput;
use gdt_batch::job::report::skipped_inputs::skipped_summary;
use gdt_batch::output::file_names::OutputFiles;
use gdt_batch::submit::Engine;
use gdt_batch::submit::request::Request;
use gdt_batch::threads::{self, on_threads};
use gdt_batch::verify::Conclusion;
use gdt_batch::{Error, Result, config, input, interrupt, sample, say, shortage, verify};
use serde::Serialize;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    // clap itself exits with code 2 if the command line is wrong.
    match shortage::listen().and_then(|()| run(Cli::parse())) {
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
        (Some(CliCommand::Verify { directory, memory, input }), _) => verify_output(directory, *memory, input, print),
        (Some(CliCommand::Work { phase, .. }), _) => Err(Error::Config(format!("phase {phase} is not there yet"))),
        (Some(CliCommand::Submit { config, engine, tasks, dry_run, added }), _) => {
            let request = Request::new(config, &config::load(config)?, PhaseTasks::all(*tasks))?;
            submit_job(*engine, &request, *dry_run, added, print)
        }
        (Some(CliCommand::Info { files }), _) => show_info(files, print),
        (Some(CliCommand::Gpu { adapter, side }), _) => test_gpu(adapter.as_deref(), *side, print),
        (Some(CliCommand::Sample { file, points, seed, overwrite }), _) => {
            interrupt::listen()?;
            sample::write(file, *points, *seed, *overwrite).map(|()| ExitCode::SUCCESS)
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
    if let Err(error) = print_result(&report, cli.print) {
        let report = OutputFiles::new(&config.output.directory).report();
        let done = format!("the job is done, and its report is in {}", report.display());
        if cli.print.json {
            say(&done);
            return Err(error);
        }
        // The results are there: to run the job again would only repeat it.
        say(&format!("{done}, but it cannot be shown: {error}"));
    }
    if let Some(summary) = skipped_summary(report.files, &report.skipped) {
        say(&format!("{summary}: see {}", OutputFiles::new(&config.output.directory).report().display()));
    }
    Ok(ExitCode::SUCCESS)
}

fn submit_job(
    engine: Engine,
    request: &Request,
    dry_run: bool,
    added: &[String],
    print: PrintOptions,
) -> Result<ExitCode> {
    if dry_run {
        print_text(&engine.show(request, added)?)?;
    } else {
        print_result(&engine.send(request, added)?, print)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn check_job(path: &Path, print: PrintOptions) -> Result<ExitCode> {
    let config = config::load(path)?;
    let preflight = on_threads(config.threads(), || check::check(&config))?;
    print_result(&preflight, print)?;
    preflight.passes().map(|()| ExitCode::SUCCESS)
}

/// Verifies the output of a job. With `--quiet` too, an error says what is wrong or cannot be proved.
fn verify_output(directory: &Path, memory: u64, inputs: &[PathBuf], print: PrintOptions) -> Result<ExitCode> {
    none_is_missing(inputs)?;
    let verdict = on_threads(threads::available(), || verify::verify_against(directory, memory, inputs))?;
    let printed = print_result(&verdict, print);
    if verdict.verdict == Conclusion::Proved {
        return printed.map(|()| ExitCode::SUCCESS);
    }
    if let Err(error) = printed {
        say(&format!("error: {error}"));
    }
    let first = verdict.failures.first().or(verdict.unproved.as_ref()).map_or("", String::as_str);
    say(&format!("error: {}: {}: {first}", directory.display(), verdict.sentence()));
    Ok(ExitCode::from(verdict.verdict.exit_code()))
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
    none_is_missing(files)?;
    for file in files {
        let source = on_threads(threads::available(), || input::open(file, &input::TextOptions::default()))?;
        print_result(&input::info::describe(&source), print)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn none_is_missing(files: &[PathBuf]) -> Result<()> {
    let is_missing = |file: &&PathBuf| file.symlink_metadata().is_err_and(|e| e.kind() == ErrorKind::NotFound);
    match files.iter().find(is_missing) {
        Some(missing) => Err(Error::Config(format!("there is no file {}: correct its name", missing.display()))),
        None => Ok(()),
    }
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
    print_text(&text)
}

fn print_text(text: &str) -> Result<()> {
    match writeln!(std::io::stdout(), "{}", text.trim_end()) {
        // The reader has closed the pipe because it has read enough.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        outcome => outcome.map_err(Error::io("write to", gdt_batch::error::STANDARD_OUTPUT)),
    }
}
