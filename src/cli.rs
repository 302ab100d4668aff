//! The command line: the commands and their options.

use crate::cloud_job::CloudOptions;
use crate::submit::Engine;
use clap::{Args, Parser, Subcommand, ValueEnum, ValueHint};
use clap_complete::Shell;
use job::phase::{MOST_TASKS, Phase, Task};
use job::progress::stage::ProgressOutput;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;

/// What `--help` shows after the options.
const AFTER_HELP: &str = "\
Examples:
  gdt-batch sample cloud.laz            write a sample point cloud
  gdt-batch cloud.laz                   make a terrain from it, in cloud-terrain
  gdt-batch tiles/ --surface ground     make bare earth from all point clouds in a folder, in tiles-terrain
  gdt-batch init *.laz                  write job.toml, a configuration for these clouds
  gdt-batch job.toml                    run the job of a configuration
  gdt-batch check job.toml              show what the job would do, and whether it fits
  gdt-batch info --histogram a.laz      count the points of each class
  gdt-batch view out                    show the terrain in a browser
  gdt-batch verify out                  prove that the tiles in out are the exact Delaunay triangulation
  gdt-batch verify out --input *.laz    and that its vertices are the points of these files
  gdt-batch diff before after           compute cut and fill between two terrains

The shortest configuration:
  [input]
  files = [\"clouds/*.laz\"]
  [output]
  directory = \"out\"
`gdt-batch init` writes one with more options. The manual explains all options in options.md.

After an interruption, run the same command again: the job continues where it stopped.

Exit codes:
  0  done
  1  may be retried (disk, memory, Ctrl-C)
  2  command line or configuration
  3  bad input; for verify: no error found, but a file that the proof needs is missing
  4  a guarantee does not hold (verify failed, or an internal check)";

/// What `--version` shows: also the commit, if it is known, and the features that are built in. build.rs makes it.
const LONG_VERSION: &str = env!("GDT_LONG_VERSION");

/// Turns point clouds of any size into one exact Delaunay terrain, written as glTF tiles.
#[derive(Parser, Debug)]
#[command(name = "gdt-batch", version, long_version = LONG_VERSION, after_help = AFTER_HELP, arg_required_else_help = true)]
pub struct Cli {
    /// The command; without one, gdt-batch runs a job.
    #[command(subcommand)]
    pub command: Option<CliCommand>,
    /// Point clouds: files, folders, patterns such as "tiles/*.laz", URLs. Or the configuration of a job (TOML).
    #[arg(value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Compute only what has changed since the last run with --update. The first such run computes everything.
    #[arg(long, requires = "files")]
    pub update: bool,
    /// Start the job over instead of continuing an interrupted run.
    #[arg(long, requires = "files")]
    pub restart: bool,
    /// The old name of `--restart`.
    #[arg(long, requires = "files", hide = true)]
    pub fresh: bool,
    /// Run the job even if disk or memory seem too small. With --write-config, overwrite the configuration.
    #[arg(long, requires = "files")]
    pub force: bool,
    /// What to print.
    #[command(flatten)]
    pub print: PrintOptions,
    /// What to make of point clouds.
    #[command(flatten)]
    pub clouds: CloudOptions,
}

/// How progress is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ShownProgress {
    /// Bars on a terminal, lines in a log.
    Auto,
    /// JSON objects, one a line.
    Json,
}

impl PrintOptions {
    /// Returns where the progress of a job goes.
    pub fn progress_output(self) -> ProgressOutput {
        match (self.quiet, self.progress) {
            (true, _) => ProgressOutput::Quiet,
            (false, ShownProgress::Json) => ProgressOutput::Json,
            (false, ShownProgress::Auto) => ProgressOutput::detect(),
        }
    }
}

/// What to print. These options may stand anywhere on the command line.
#[derive(Args, Clone, Copy, Debug)]
pub struct PrintOptions {
    /// Print only errors and essential notices.
    #[arg(long, short, global = true, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Print all figures of a job: stages, points, triangulation.
    #[arg(long, short, global = true)]
    pub verbose: bool,
    /// Print the result as JSON on standard output.
    #[arg(long, global = true)]
    pub json: bool,
    /// How to show progress on standard error; json prints one JSON object a line, about once a second.
    #[arg(long, global = true, value_name = "HOW", default_value = "auto")]
    pub progress: ShownProgress,
}

/// The commands other than running a job.
#[derive(Subcommand, Debug)]
pub enum CliCommand {
    /// Write a configuration for point clouds, with comments on what they contain.
    ///
    /// Reads headers and a sample of the points, and text files completely. Sets the options that the job needs, such as to_crs for
    /// degrees, and explains them in comments. If no configuration works for the clouds, it fails with the message and exit code of
    /// `check`.
    Init {
        /// Point clouds: files, folders, patterns such as "clouds/*.laz", URLs. Default: the point clouds in the current folder.
        files: Vec<PathBuf>,
        /// The configuration to write; - for standard output.
        #[arg(long, short, value_name = "FILE", default_value = "job.toml")]
        output: PathBuf,
        /// Overwrite an existing configuration, never another file.
        #[arg(long)]
        force: bool,
    },
    /// Show what a job would do and whether it fits; write nothing.
    Check {
        /// The configuration of the job.
        config: PathBuf,
    },
    /// Read the results back and prove with exact arithmetic that the tiles are the Delaunay triangulation.
    ///
    /// Also compares every file with its checksum. Exit code 0: proved. 3: no error found, but a file that the proof needs is missing.
    /// 4: something is wrong.
    Verify {
        /// The output directory of a job.
        #[arg(value_hint = ValueHint::DirPath)]
        directory: PathBuf,
        /// The memory that verify may use, such as "4 GiB".
        #[arg(long, default_value = "4 GiB", value_parser = memory)]
        memory: u64,
        /// The inputs of the job: prove that the vertices are their points, heights included.
        #[arg(long, num_args = 1.., value_name = "FILE")]
        input: Vec<PathBuf>,
    },
    /// Compute cut and fill between two terrains, exactly, over the area that both cover.
    ///
    /// Overlays the triangles of both. Cut is what was removed: AFTER lies below BEFORE. Fill is what was added. Both terrains must have
    /// the same CRS, units and vertical datum. Results are in metres and in the units of the terrains. With --output, also writes
    /// difference.tif (AFTER minus BEFORE, a GeoTIFF), and AFTER as coloured 3D Tiles (red for cut, blue for fill) for `gdt-batch view`.
    Diff(DiffOptions),
    /// Write the heights of a terrain along lines as CSV.
    ///
    /// Writes a row for each vertex of a line and for each edge of the mesh that it crosses: line, distance, x, y, z, in units of the
    /// terrain. Outside the terrain, z is empty. Where a line leaves the terrain there are two rows, the second without z.
    Profile {
        /// The terrain: the output directory of a finished job, or its configuration.
        #[arg(value_hint = ValueHint::AnyPath)]
        terrain: PathBuf,
        /// The lines: GeoJSON, GeoPackage or Shapefile, in any CRS that can be transformed into that of the terrain.
        #[arg(value_hint = ValueHint::FilePath)]
        lines: PathBuf,
        /// The file to write; an existing CSV is overwritten. Default: standard output.
        #[arg(long, short, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Show the terrain in a browser.
    ///
    /// Starts a web server and opens a browser. Only this machine can connect, unless --address is set. Ctrl-C stops the server.
    View(ViewOptions),
    /// Run one task of a distributed job (called by the scheduler).
    ///
    /// The tasks of all phases do the job together, on machines that share the output directory. The results are byte-identical for any
    /// number of tasks. Exit code 1: the task may be retried. If an earlier phase is incomplete, the message names its missing tasks.
    Work {
        /// The configuration of the job.
        config: PathBuf,
        /// The phase of the task.
        #[arg(long, value_enum)]
        phase: Phase,
        /// The task: number i, from 1 on, of N. Default: from the environment of an array job (Slurm, Kubernetes, AWS Batch).
        #[arg(long, value_name = "i/N")]
        task: Option<Task>,
        /// The number of tasks in each phase, if the environment has only the index of this one.
        #[arg(long, value_name = "N", conflicts_with = "task", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_TASKS)))]
        tasks: Option<u32>,
        /// Worker threads of this task, instead of `[limits] threads`.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
        threads: Option<u16>,
        /// Plan the job even if disk or memory of this machine seem too small.
        #[arg(long)]
        force: bool,
        /// The submission number of a job that is started over; set by `submit --restart`.
        #[arg(long, value_name = "NUMBER", default_value_t = 0, hide_default_value = true)]
        submission: u64,
        /// Stop when standard input ends. The engine `local` holds its other end, so no task outlives the engine.
        #[arg(long, hide = true)]
        until_stdin_ends: bool,
    },
    /// Run a large job on many machines.
    ///
    /// Inputs, configuration and output directory must have the same paths on all machines. Only missing tasks are submitted: after
    /// failures, run the same command again.
    Submit {
        /// The configuration of the job.
        config: PathBuf,
        /// The scheduler.
        #[arg(long, value_enum)]
        engine: Engine,
        /// The number of tasks in each phase. With `local`, up to this many run at once.
        #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_TASKS)))]
        tasks: u32,
        /// Start the job over, even if it is done or in progress.
        #[arg(long)]
        restart: bool,
        /// Print what would be submitted, and submit nothing.
        #[arg(long)]
        dry_run: bool,
        /// Options for the scheduler: those of sbatch with slurm; `-- --help` lists those with kubernetes.
        #[arg(last = true, value_name = "ENGINE OPTIONS")]
        added: Vec<String>,
    },
    /// Show the progress of a distributed job.
    Status {
        /// The configuration of the job.
        config: PathBuf,
        /// The number of tasks in each phase: lists missing tasks instead of missing parts.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_TASKS)))]
        tasks: Option<u32>,
    },
    /// Show what point clouds contain.
    Info {
        /// Point clouds: LAS, LAZ, COPC, EPT or text, folders, or lists of them.
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Read all points, and count them by class and by return.
        #[arg(long)]
        histogram: bool,
    },
    /// List the GPUs of this machine, test one, and measure its speed-up.
    Gpu {
        /// Part of the name of the GPU to test. Default: the GPU that backend = "gpu" uses.
        #[arg(long)]
        adapter: Option<String>,
        /// Largest batch to benchmark; 0 skips it.
        #[arg(long)]
        leaves: Option<usize>,
    },
    /// Write a sample terrain as LAS or LAZ.
    Sample {
        /// The file to write: .las or .laz.
        file: PathBuf,
        /// The number of points.
        #[arg(long, default_value_t = 1_000_000)]
        points: u64,
        /// Seed of the random terrain.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Overwrite an existing file.
        #[arg(long)]
        overwrite: bool,
    },
    /// Print a shell completion script.
    ///
    /// For bash: gdt-batch completions bash > ~/.local/share/bash-completion/completions/gdt-batch
    Completions {
        /// The shell.
        shell: Shell,
    },
    /// Print the man page in roff.
    ///
    /// To read it: gdt-batch man | man -l -
    Man {
        /// The command to document. Default: all commands, on one page.
        command: Option<String>,
    },
}

/// What to compare.
#[derive(Args, Debug)]
pub struct DiffOptions {
    /// The earlier terrain: the output directory of a finished job, or its configuration.
    #[arg(value_hint = ValueHint::AnyPath)]
    pub before: PathBuf,
    /// The later terrain.
    #[arg(value_hint = ValueHint::AnyPath)]
    pub after: PathBuf,
    /// Ignore height changes smaller than this, in units of the heights. Default: 0.
    #[arg(long, value_name = "HEIGHT", default_value_t = 0.0, hide_default_value = true, value_parser = threshold, allow_negative_numbers = true)]
    pub threshold: f64,
    /// Also report each polygon of this GeoJSON, GeoPackage or Shapefile, by its attribute "name".
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub areas: Option<PathBuf>,
    /// Also write a difference raster and a coloured mesh to this folder: a new one, or that of an earlier diff.
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub output: Option<PathBuf>,
    /// Cell size of the raster, in units of x and y. Default: about the point spacing of the finer terrain.
    #[arg(long, value_name = "LENGTH", requires = "output", value_parser = length, allow_negative_numbers = true)]
    pub resolution: Option<f64>,
    /// The change with the strongest colours, in units of the heights. Default: a round number above 98 % of all changes.
    #[arg(long, value_name = "HEIGHT", requires = "output", value_parser = length, allow_negative_numbers = true)]
    pub range: Option<f64>,
    /// The memory that diff may use, such as "4 GiB".
    #[arg(long, default_value = "4 GiB", value_parser = memory)]
    pub memory: u64,
}

/// What to show, and to whom.
#[derive(Args, Debug)]
pub struct ViewOptions {
    /// The output directory of a job.
    #[arg(value_hint = ValueHint::DirPath)]
    pub directory: PathBuf,
    /// The port to listen on. Default: a free port.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub port: u16,
    /// Do not open a browser.
    #[arg(long)]
    pub no_open: bool,
    /// The address to listen on. With 0.0.0.0, any machine that can reach this one can read the results.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    pub address: IpAddr,
    /// Another host name that browsers may use, such as that of a proxy. Can be repeated.
    #[arg(long, value_name = "NAME", value_parser = host_name)]
    pub host: Vec<String>,
    /// Send CORS headers, so that pages from other origins, such as your own map, can read the results. So can any other page in a
    /// browser that can reach the server.
    #[arg(long)]
    pub cors: bool,
}

fn host_name(text: &str) -> Result<String, String> {
    let is_name = |byte: u8| byte.is_ascii_alphanumeric() || b"-._".contains(&byte);
    if text.is_empty() || !text.bytes().all(is_name) {
        return Err("give only the name, such as maps.example.org, without http:// or a port".into());
    }
    Ok(text.into())
}

fn length(text: &str) -> Result<f64, String> {
    let length = text.parse().ok().filter(|length: &f64| length.is_finite() && *length > 0.0);
    length.ok_or_else(|| "give a number above 0, such as 0.5".into())
}

fn threshold(text: &str) -> Result<f64, String> {
    let height = text.parse().ok().filter(|height: &f64| height.is_finite() && *height >= 0.0);
    height.ok_or_else(|| "give a height of 0 or more, such as 0.05".into())
}

fn memory(text: &str) -> Result<u64, String> {
    job::options::MemoryLimit::try_from(text.to_owned()).map(|memory| memory.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_of_the_command_line_is_sound() {
        <Cli as clap::CommandFactory>::command().debug_assert();
    }

    #[test]
    fn restart_has_an_old_name_that_help_does_not_show() {
        let cli = Cli::try_parse_from(["gdt-batch", "--fresh", "job.toml"]).unwrap();
        assert!(cli.fresh && !cli.restart);
        let help = <Cli as clap::CommandFactory>::command().render_long_help().to_string();
        assert!(help.contains("--restart") && !help.contains("--fresh"), "{help}");
    }
}
