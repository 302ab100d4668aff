//! The program: parses the command line, runs a command, prints its result or error, and exits with its code.

#![warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable)]

use clap::{CommandFactory, Parser};
use gdt_batch::cli::{Cli, CliCommand, DiffOptions, PrintOptions, ViewOptions};
use gdt_batch::cli_advice::with_advice;
use gdt_batch::cloud_job::{self, CloudJob};
use gdt_batch::command_words::{self, Named};
use gdt_batch::error::{Error, Result};
use gdt_batch::exit_code::{exit_code, exit_code_of_verify};
use gdt_batch::init::{ConfigRequest, NewConfiguration, as_argument};
use gdt_batch::step_progress::StepProgress;
use gdt_batch::submit::local::LocalEngine;
use gdt_batch::submit::request::Request;
use gdt_batch::submit::{Engine, kubernetes, slurm};
use gdt_batch::{completions, config, init, manual, sample};
use job::options::{JobOptions, RunOptions, Threads};
use job::phase::{Phase, PhaseTasks, Task};
use job::plan::folder_files::FolderFiles;
use job::preflight::check;
use job::report::job_report::Report;
use job::report::skipped_inputs::skipped_summary;
use job::report::summary::Summary;
use job::report::task_outcome::TaskOutcome;
use points::Source;
use points::histogram::Histogram;
use points::info::{SourceDescription, describe};
use serde::Serialize;
use std::fmt::Display;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use survey::diff::{self, DiffRequest};
use survey::profile::{self, Profile, ProfileRequest};
use survey::written::DifferenceOutput;
use sys::threads;
use sys::threads::on_threads;
use sys::{ShownWarning, fault, interrupt, say, shortage, terminal, with_remedy_below};
use tiles::file_names::OutputFiles;
use verify::{Conclusion, Watcher};

/// A file of lines may take this many bytes of memory.
const MEMORY_FOR_LINES: u64 = 1 << 30;

fn main() -> ExitCode {
    if cfg!(feature = "fault-injection") {
        fault::allow();
    }
    match shortage::listen(exit_code).map_err(Error::from).and_then(|()| run(command_line())) {
        Ok(code) => code,
        Err(error) => {
            say(&format!("error: {}", with_remedy_below(&error.to_string())));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Returns what the command line says. If it is wrong, ends the process with code 2, as clap does.
fn command_line() -> Cli {
    Cli::try_parse().map_err(with_advice).unwrap_or_else(|error| {
        let has_signs = std::env::args_os().any(|word| word.to_string_lossy().chars().any(char::is_control));
        if error.use_stderr() && has_signs {
            say(&error.render().to_string());
            std::process::exit(error.exit_code())
        }
        error.exit()
    })
}

fn run(cli: Cli) -> Result<ExitCode> {
    let print = cli.print;
    if cli.command.is_some() {
        cloud_job::refuse_beside_command(&cli.clouds)?;
    }
    match (&cli.command, &cli.files[..]) {
        (Some(_), [first, ..]) => {
            let first = first.display();
            Err(sys::Error::Config(format!("{first} and a command: name files after the command, or without one"))
                .into())
        }
        (Some(CliCommand::Init { files, output, force }), _) => {
            let request = ConfigRequest { clouds: files.clone(), ..ConfigRequest::default() };
            write_configuration(output, print, || Ok(init::init(&request, output, *force)?))
        }
        (Some(CliCommand::Check { config }), _) => check_job(config, print),
        (Some(CliCommand::Verify { directory, memory, input }), _) => verify_output(directory, *memory, input, print),
        (Some(CliCommand::Diff(options)), _) => compare_terrains(options, print),
        (Some(CliCommand::Profile { terrain, lines, output }), _) => {
            write_profile(terrain, lines, output.as_deref(), print)
        }
        (Some(CliCommand::View(options)), _) => view_output(options, print),
        (Some(CliCommand::Work { config, phase, task, tasks, threads, force, submission, until_stdin_ends }), _) => {
            if *until_stdin_ends {
                interrupt::listen_to_stdin()?;
            }
            let task = match task {
                Some(task) => *task,
                None => Task::of_environment(*phase, *tasks, |name| std::env::var(name).ok())?,
            };
            let progress = print.progress_output();
            let run = RunOptions { progress, force: *force, restart: false, update: false, submission: *submission };
            work(config, *phase, task, *threads, run, print)
        }
        (Some(CliCommand::Submit { config, engine, tasks, restart, dry_run, added }), _) => {
            let request = request(config, *engine, *tasks, *restart)?;
            if request.phases.is_empty() {
                nothing_to_send(config, *dry_run, print)
            } else if *dry_run {
                show_tasks(*engine, &request, added)
            } else {
                submit(*engine, &request, added, print)
            }
        }
        (Some(CliCommand::Status { config, tasks }), _) => {
            print_result(&job::status(&config::load(config)?, *tasks)?, print).map(|()| ExitCode::SUCCESS)
        }
        (Some(CliCommand::Info { files, histogram }), _) => show_info(files, *histogram, print),
        (Some(CliCommand::Gpu { adapter, leaves }), _) => test_gpu(adapter.as_deref(), *leaves, print),
        (Some(CliCommand::Sample { file, points, seed, overwrite }), _) => {
            interrupt::listen(exit_code)?;
            sample::write(file, *points, *seed, *overwrite)?;
            Ok(ExitCode::SUCCESS)
        }
        (Some(CliCommand::Completions { shell }), _) => {
            print_text(&completions::script(*shell)).map(|()| ExitCode::SUCCESS)
        }
        (Some(CliCommand::Man { command }), _) => {
            print_text(&manual::man(command.as_deref())?).map(|()| ExitCode::SUCCESS)
        }
        (None, []) => {
            Err(sys::Error::Config("name point clouds or a configuration file; --help shows how".into()).into())
        }
        (None, files) => match command_words::named(files, &command_names())? {
            Named::Configuration(config) => run_job(config, &cli),
            Named::Clouds(clouds) => run_clouds(clouds, &cli),
        },
    }
}

/// Returns the names of the commands that help shows.
fn command_names() -> Vec<String> {
    let all = Cli::command();
    let shown = all.get_subcommands().filter(|command| !command.is_hide_set());
    shown.map(|command| command.get_name().to_string()).collect()
}

/// Runs the job of a configuration file. Files that were left out are reported on standard error too, even with `--quiet`.
fn run_job(path: &Path, cli: &Cli) -> Result<ExitCode> {
    cloud_job::refuse_beside_configuration(&cli.clouds, path)?;
    let options = run_options(cli);
    let config = config::load(path).map_err(|error| command_words::with_endings_of_clouds(error, path))?;
    interrupt::listen(exit_code)?;
    show_report(&job::run(&config, options)?, &config, cli.print, &str::to_owned)
}

/// Returns how the command line wants a job to be run.
fn run_options(cli: &Cli) -> RunOptions {
    if cli.fresh {
        say("--fresh has a new name: --restart; the old one still works");
    }
    RunOptions {
        progress: cli.print.progress_output(),
        force: cli.force,
        restart: cli.restart || cli.fresh,
        update: cli.update,
        submission: 0,
    }
}

/// Runs the job of point clouds, or writes its configuration.
fn run_clouds(clouds: &[PathBuf], cli: &Cli) -> Result<ExitCode> {
    let job = CloudJob::new(clouds, &cli.clouds)?;
    if let Some(file) = &cli.clouds.write_config {
        return write_configuration(file, cli.print, || Ok(job.write_configuration(file, cli.force)?));
    }
    let tell = |sentence: &str| cli.print.progress_output().note(sentence);
    interrupt::listen(exit_code)?;
    let (report, config) = job.run(run_options(cli), tell)?;
    show_report(&report, &config, cli.print, &cloud_job::in_flags)
}

/// Prints the report of a finished job. `words` turns the names of options into those that the user knows.
fn show_report(
    report: &Report,
    config: &JobOptions,
    print: PrintOptions,
    words: &dyn Fn(&str) -> String,
) -> Result<ExitCode> {
    let files = OutputFiles::new(&config.output.directory);
    let file = files.report();
    if let Err(error) = print_report(report, config, print, words) {
        let done = format!("the job is done, and its report is in {}", file.display());
        if print.json {
            say(&done);
            return Err(error);
        }
        // The results are there: to run the job again would only repeat it.
        say(&format!("{done}, but it cannot be shown: {error}"));
    }
    if let Some(summary) = skipped_summary(report.files, &report.skipped) {
        say(&format!("{summary}: see {}", file.display()));
    }
    Ok(ExitCode::SUCCESS)
}

fn print_report(
    report: &Report,
    config: &JobOptions,
    print: PrintOptions,
    words: &dyn Fn(&str) -> String,
) -> Result<()> {
    if print.json || print.quiet {
        return print_result(report, print);
    }
    if print.verbose {
        print_result(report, print)?;
        print_text("")?;
    }
    let summary = Summary::new(report, &config.output, words);
    let directory = as_argument(&config.output.directory);
    let next = match tiles::page::is_built_in() {
        true => format!("gdt-batch view {directory}"),
        false => format!("open preview.png in {directory}"),
    };
    print_text(&terminal::escape_controls(&format!("{summary}next      {next}")))
}

/// Does one task of one phase.
fn work(
    path: &Path,
    phase: Phase,
    task: Task,
    threads: Option<u16>,
    run: RunOptions,
    print: PrintOptions,
) -> Result<ExitCode> {
    let mut config = config::load(path)?;
    if let Some(threads) = threads {
        config.limits.threads = Threads(threads.into());
    }
    interrupt::listen(exit_code)?;
    match job::work(&config, run, phase, task)? {
        TaskOutcome::Published(report) => show_report(&report, &config, print, &str::to_owned),
        TaskOutcome::Done(done) => print_result(&done, print).map(|()| ExitCode::SUCCESS),
    }
}

/// Returns the tasks that are missing of the job that the configuration at `path` describes: all of them if it is to start over.
fn request(path: &Path, engine: Engine, tasks: u32, restart: bool) -> Result<Request> {
    let config = config::load(path)?;
    // The inputs may be where only the pods of Kubernetes see them.
    let is_out_of_sight = engine == Engine::Kubernetes && !config.output.directory.exists();
    let phases = if is_out_of_sight || restart {
        PhaseTasks::all(tasks, config.leaves_points_out())
    } else {
        job::missing_tasks(&config, tasks)?
    };
    let submission = if restart { Some(job::new_submission()) } else { None };
    Ok(Request::new(path, &config, tasks, submission, phases)?)
}

/// Says that a job is done, instead of sending it.
fn nothing_to_send(path: &Path, dry_run: bool, print: PrintOptions) -> Result<ExitCode> {
    say("nothing was submitted, because the job is done; --restart runs it again");
    if dry_run {
        // What it prints is for a shell or for kubectl.
        return Ok(ExitCode::SUCCESS);
    }
    print_result(&job::status(&config::load(path)?, None)?, print).map(|()| ExitCode::SUCCESS)
}

/// Prints what an engine would get.
fn show_tasks(engine: Engine, request: &Request, added: &[String]) -> Result<ExitCode> {
    let text = match engine {
        Engine::Slurm => slurm::show(request, added)?,
        Engine::Kubernetes => kubernetes::show(request, added)?,
        Engine::Local => LocalEngine::new(request, added, false, false)?.show(),
    };
    print_text(&text).map(|()| ExitCode::SUCCESS)
}

fn submit(engine: Engine, request: &Request, added: &[String], print: PrintOptions) -> Result<ExitCode> {
    match engine {
        Engine::Slurm => print_result(&slurm::send(request, added)?, print)?,
        Engine::Kubernetes => print_result(&kubernetes::send(request, added)?, print)?,
        Engine::Local => {
            interrupt::listen(exit_code)?;
            let engine = LocalEngine::new(request, added, print.quiet, print.json)?;
            engine.run(|| job::missing_tasks_of_planned(&config::load(&request.config)?, request.tasks))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the configuration that `make` makes to `file`. If the job does not fit this machine, a message says so once it is written.
fn write_configuration(
    file: &Path,
    print: PrintOptions,
    make: impl FnOnce() -> Result<NewConfiguration> + Send,
) -> Result<ExitCode> {
    let is_printed = file == Path::new("-");
    if is_printed && print.json {
        return Err(sys::Error::Config(
            "--write-config - and --json both print to standard output: leave out one".into(),
        )
        .into());
    }
    let made = on_threads(threads::available(), make)?;
    if is_printed {
        print_text(&made.text)?;
        return made.obstacle.map_or(Ok(ExitCode::SUCCESS), |obstacle| Err(obstacle.into()));
    }
    show_configuration(&made, file, print)?;
    let Some(obstacle) = made.obstacle else { return Ok(ExitCode::SUCCESS) };
    say(&format!("error: {} is written, but its job would stop: {obstacle}", file.display()));
    Ok(ExitCode::from(exit_code(obstacle.kind())))
}

/// Prints what a configuration says that was written. If that fails, it is there nevertheless: to write it again would be refused.
fn show_configuration(made: &NewConfiguration, file: &Path, print: PrintOptions) -> Result<()> {
    let Err(error) = print_result(made, print) else { return Ok(()) };
    let done = format!("{} is written", file.display());
    if print.json {
        say(&done);
        return Err(error);
    }
    say(&format!("{done}, but it cannot be printed: {error}"));
    Ok(())
}

fn check_job(path: &Path, print: PrintOptions) -> Result<ExitCode> {
    let config = config::load(path)?;
    let preflight = on_threads(config.threads(), || check::check(&config))?;
    print_result(&preflight, print)?;
    preflight.passes()?;
    Ok(ExitCode::SUCCESS)
}

/// Verifies the output of a job. With `--quiet` too, an error says what is wrong or cannot be proved.
fn verify_output(directory: &Path, memory: u64, inputs: &[PathBuf], print: PrintOptions) -> Result<ExitCode> {
    let inputs = &named(inputs)?;
    let progress = StepProgress::new(print.progress_output());
    let verdict = on_threads(threads::available(), || verify::verify_watched(directory, memory, inputs, &progress));
    progress.finish();
    let verdict = verdict?;
    let printed = print_result(&verdict, print);
    if verdict.verdict == Conclusion::Proved {
        return printed.map(|()| ExitCode::SUCCESS);
    }
    if let Err(error) = printed {
        say(&format!("error: {error}"));
    }
    let first = verdict.failures.first().or(verdict.unproved.as_ref()).map_or("", String::as_str);
    say(&format!("error: {}: {}: {first}", directory.display(), verdict.sentence()));
    Ok(ExitCode::from(exit_code_of_verify(verdict.verdict)))
}

/// Compares two terrains.
fn compare_terrains(options: &DiffOptions, print: PrintOptions) -> Result<ExitCode> {
    interrupt::listen(exit_code)?;
    let request = DiffRequest {
        before: output_of(&options.before)?,
        after: output_of(&options.after)?,
        threshold: options.threshold,
        areas: options.areas.clone(),
        memory: options.memory,
        output: options.output.clone().map(|directory| DifferenceOutput {
            directory,
            resolution: options.resolution,
            range: options.range,
        }),
    };
    let difference = on_threads(threads::available(), || diff::run(&request))?;
    print_result(&difference, print).map(|()| ExitCode::SUCCESS)
}

/// Writes the heights along lines. Warnings go to standard error, since the heights may go to standard output.
fn write_profile(terrain: &Path, lines: &Path, output: Option<&Path>, print: PrintOptions) -> Result<ExitCode> {
    if print.json {
        return Err(sys::Error::Config("profile writes CSV: leave out --json".into()).into());
    }
    interrupt::listen(exit_code)?;
    let request = ProfileRequest { terrain: output_of(terrain)?, lines: lines.to_path_buf(), memory: MEMORY_FOR_LINES };
    let profile = profile::open(&request)?;
    if !print.quiet {
        profile.warnings.iter().for_each(|warning| say(&ShownWarning(warning).to_string()));
    }
    on_threads(threads::available(), || match output {
        Some(file) => write_new_table(file, &profile),
        None => print_table(&profile),
    })?;
    Ok(ExitCode::SUCCESS)
}

/// Prints a table, row by row.
fn print_table(profile: &Profile) -> Result<()> {
    let mut is_closed = false;
    let print = |piece: &str| {
        let mut out = std::io::stdout().lock();
        let printed = out.write_all(piece.as_bytes()).and_then(|()| out.flush());
        is_closed = printed.as_ref().is_err_and(|error| error.kind() == ErrorKind::BrokenPipe);
        printed.map_err(sys::Error::io("write to", sys::error::STANDARD_OUTPUT))
    };
    match profile.write_csv(print) {
        // The reader has closed the pipe because it has read enough.
        Err(_) if is_closed => Ok(()),
        outcome => Ok(outcome?),
    }
}

/// Writes a table to a file, or in place of an earlier table: nothing else is overwritten.
fn write_new_table(file: &Path, profile: &Profile) -> Result<()> {
    let is_table = file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
    if file.exists() && !(file.is_file() && is_table) {
        let file = file.display();
        return Err(
            sys::Error::Config(format!("{file} exists and is not a CSV file: choose another name with -o")).into()
        );
    }
    let partial = file.with_extension("csv.partial");
    let mut out = std::fs::File::create(&partial).map_err(sys::Error::io("create", &partial))?;
    let mut write = |piece: &str| out.write_all(piece.as_bytes()).map_err(sys::Error::io("write", &partial));
    profile.write_csv(&mut write)?;
    std::fs::rename(&partial, file).map_err(sys::Error::io("write", file))?;
    Ok(())
}

/// Returns the output directory that a command line names: itself, or by the configuration of its job.
fn output_of(path: &Path) -> Result<PathBuf> {
    let is_configuration = path.is_file() && path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"));
    if is_configuration { Ok(config::load(path)?.output.directory) } else { Ok(path.to_path_buf()) }
}

/// Serves a terrain until Ctrl-C. That is how it is meant to end, so the exit code is 0 then.
#[cfg(feature = "viewer")]
fn view_output(options: &ViewOptions, print: PrintOptions) -> Result<ExitCode> {
    use gdt_batch::view::{View, browser};
    let has_page = tiles::page::is_built_in();
    // Pages of other servers need the files alone.
    if !has_page && !options.cors {
        return Err(sys::Error::Config(tiles::page::NOT_BUILT_IN.into()).into());
    }
    let wanted = std::net::SocketAddr::new(options.address, options.port);
    let view = View::open(&options.directory, wanted, &options.host, options.cors)?;
    interrupt::listen(exit_code)?;
    if print.quiet && !print.json {
        // Without the URL nobody could use the command: that a browser was started does not mean that it shows.
        print_text(&view.url)?;
    } else {
        print_result(&view, print)?;
    }
    if let Some(Err(why)) = (has_page && !options.no_open).then(|| browser::open(&view.url)) {
        say(&format!("no browser was opened ({why}): open {} yourself", view.url));
    }
    view.run()?;
    Ok(ExitCode::SUCCESS)
}

#[cfg(not(feature = "viewer"))]
fn view_output(_: &ViewOptions, _: PrintOptions) -> Result<ExitCode> {
    Err(sys::Error::Config(
        "this build of gdt-batch has no server: build it with the feature \"viewer\", which is on by default".into(),
    )
    .into())
}

#[cfg(feature = "gpu")]
fn test_gpu(adapter: Option<&str>, leaves: Option<usize>, print: PrintOptions) -> Result<ExitCode> {
    let check = gdt_batch::gpu_trial::run(adapter, leaves)?;
    print_result(&check, print)?;
    if check.holds() {
        return Ok(check.failure.map_or(ExitCode::SUCCESS, |_| ExitCode::from(exit_code(sys::ErrorKind::Retry))));
    }
    say("error: this GPU and the CPU disagree: see above; please report it");
    Ok(ExitCode::from(exit_code(sys::ErrorKind::Internal)))
}

#[cfg(not(feature = "gpu"))]
fn test_gpu(_: Option<&str>, _: Option<usize>, _: PrintOptions) -> Result<ExitCode> {
    Err(sys::Error::Config("this build of gdt-batch uses no GPU: build it with the feature gpu".into()).into())
}

fn show_info(files: &[PathBuf], histogram: bool, print: PrintOptions) -> Result<ExitCode> {
    let progress = StepProgress::new(print.progress_output());
    let count = |source: &Source| {
        progress.begin("count points", source.records, "points");
        Histogram::of(source, &|amount| progress.advance(amount))
    };
    for file in &named(files)? {
        let described = on_threads(threads::available(), || {
            let source = points::open(file, &points::TextOptions::default())?;
            let histogram = histogram.then(|| count(&source)).transpose()?;
            SourceDescription { histogram, ..describe(&source) }.with_surface(&source)
        });
        progress.finish();
        print_result(&described?, print)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the files that a command line names: those of this machine, which must be there, the point clouds in folders, those that its URLs mean,
/// and those that a list names.
fn named(files: &[PathBuf]) -> sys::Result<Vec<PathBuf>> {
    let files_of = |file: &PathBuf| match file.to_str() {
        Some(url) if points::is_url(url) => points::remote_files(url),
        _ if file.symlink_metadata().is_err_and(|e| e.kind() == ErrorKind::NotFound) => {
            Err(sys::Error::Config(format!("there is no file {}: correct its name", file.display())))
        }
        _ if file.is_dir() => FolderFiles::of(file)?.clouds(&points::TextOptions::default()).map(|found| found.clouds),
        _ => Ok(vec![file.clone()]),
    };
    let of_list = |file: PathBuf| match points::listed_clouds(&file)? {
        Some(clouds) => Ok(clouds.into_iter().map(|cloud| cloud.path).collect()),
        None => Ok(vec![file]),
    };
    let files = files.iter().map(files_of).collect::<sys::Result<Vec<_>>>()?.concat();
    Ok(files.into_iter().map(of_list).collect::<sys::Result<Vec<Vec<PathBuf>>>>()?.concat())
}

/// Prints a result for people or as JSON.
fn print_result(result: &(impl Display + Serialize), print: PrintOptions) -> Result<()> {
    let text = if print.json {
        serde_json::to_string_pretty(result).map_err(|e| sys::Error::Broken(e.to_string()))?
    } else if print.quiet {
        return Ok(());
    } else {
        terminal::escape_controls(&result.to_string())
    };
    print_text(&text)
}

fn print_text(text: &str) -> Result<()> {
    match writeln!(std::io::stdout(), "{}", text.trim_end()) {
        // The reader has closed the pipe because it has read enough.
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(()),
        outcome => Ok(outcome.map_err(sys::Error::io("write to", sys::error::STANDARD_OUTPUT))?),
    }
}
