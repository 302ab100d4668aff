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
  gdt-batch sample cloud.laz            write a sample terrain to try things on
  gdt-batch cloud.laz                   make a terrain of it, in cloud-terrain
  gdt-batch tiles/ --surface ground     make bare earth of all point clouds in a folder, in tiles-terrain
  gdt-batch init *.laz                  write job.toml, a configuration for these clouds
  gdt-batch job.toml                    run the job of a configuration
  gdt-batch check job.toml              show what the job would do, and whether it fits
  gdt-batch info --histogram a.laz      count the points of each class
  gdt-batch view out                    look at the terrain in a browser
  gdt-batch verify out                  prove that the tiles in out are the exact Delaunay triangulation
  gdt-batch verify out --input *.laz    and that its vertices are the points of these files
  gdt-batch diff before after           compute cut and fill between two terrains

The shortest configuration:
  [input]
  files = [\"clouds/*.laz\"]
  [output]
  directory = \"out\"
`gdt-batch init` writes one with more options; the manual explains all in options.md.

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
    /// Compute only what has changed since the last run with this option, and keep what the next one needs. The first run computes all.
    #[arg(long, requires = "files")]
    pub update: bool,
    /// Start the job over instead of continuing an interrupted run.
    #[arg(long, requires = "files")]
    pub restart: bool,
    /// The old name of `--restart`.
    #[arg(long, requires = "files", hide = true)]
    pub fresh: bool,
    /// Run the job even if it does not seem to fit the disk or the memory. With --write-config, replace the configuration.
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
    /// How to show progress on standard error: json prints a line a second for programs.
    #[arg(long, global = true, value_name = "HOW", default_value = "auto")]
    pub progress: ShownProgress,
}

/// The commands other than running a job.
#[derive(Subcommand, Debug)]
pub enum CliCommand {
    /// Write a configuration for point clouds, with comments on what they contain.
    ///
    /// Reads headers and a sample of the points, and all of a text. Sets what the job needs, such as to_crs for degrees, and says why in
    /// a comment. If no configuration makes a job of the clouds, the message and the exit code are those of `check`.
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
    /// Overlays the triangles of both. Cut is what was removed: AFTER lies below BEFORE. Fill is what was added. Both must have the same
    /// CRS, units and vertical datum. Results in metres, and in the units of the terrains. With --output, also writes difference.tif (AFTER
    /// minus BEFORE, a GeoTIFF) and AFTER as 3D Tiles in colours, red for cut and blue for fill, which `gdt-batch view` shows.
    Diff(DiffOptions),
    /// Write the heights of a terrain along lines as CSV.
    ///
    /// A row for each vertex of a line and each edge of the mesh that it crosses: line, distance, x, y, z, in units of the terrain. Outside of
    /// the terrain z is empty. Where a line leaves the terrain there are two rows, the second without z.
    Profile {
        /// The terrain: the output directory of a finished job, or its configuration.
        #[arg(value_hint = ValueHint::AnyPath)]
        terrain: PathBuf,
        /// The lines: GeoJSON, GeoPackage or Shapefile, in the CRS of the terrain or in one that can be transformed into it.
        #[arg(value_hint = ValueHint::FilePath)]
        lines: PathBuf,
        /// The file to write; an existing CSV is overwritten. Default: standard output.
        #[arg(long, short, value_name = "FILE")]
        output: Option<PathBuf>,
    },
    /// Show the terrain in a browser.
    ///
    /// Serves the results, and opens a page. Only browsers on this machine can reach it, unless --address is set. Ctrl-C ends it.
    View(ViewOptions),
    /// Run one task of a distributed job (called by the scheduler).
    ///
    /// The tasks of all phases, on machines that share the output directory, do the job together. The results have the same bytes for any
    /// number of tasks. Exit code 1: the task may be tried again; if an earlier phase is not complete, the message names its missing
    /// tasks.
    Work {
        /// The configuration of the job.
        config: PathBuf,
        /// The phase to work on.
        #[arg(long, value_enum)]
        phase: Phase,
        /// The task: number i, from 1 on, of N. Default: from the environment of an array job (Slurm, Kubernetes, AWS Batch).
        #[arg(long, value_name = "i/N")]
        task: Option<Task>,
        /// The number of tasks of each phase, where the environment has only the number of this one.
        #[arg(long, value_name = "N", conflicts_with = "task", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_TASKS)))]
        tasks: Option<u32>,
        /// Worker threads of this task, instead of `[limits] threads`.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
        threads: Option<u16>,
        /// Plan the job even if it does not seem to fit the disk or the memory of this machine.
        #[arg(long)]
        force: bool,
        /// The number of a submission that starts the job over, as `submit --restart` gives it.
        #[arg(long, value_name = "NUMBER", default_value_t = 0, hide_default_value = true)]
        submission: u64,
        /// Stop when standard input ends. The engine `local` holds its other end, so no task outlives the engine.
        #[arg(long, hide = true)]
        until_stdin_ends: bool,
    },
    /// Run a large job on many machines.
    ///
    /// All machines must see the inputs, the configuration and the output directory under the same paths. Only missing
    /// tasks are sent: after failures, run the same command again.
    Submit {
        /// The configuration of the job.
        config: PathBuf,
        /// The engine.
        #[arg(long, value_enum)]
        engine: Engine,
        /// The number of tasks of each phase. With `local`, at most as many run at once.
        #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_TASKS)))]
        tasks: u32,
        /// Start the job over, also if it is done or under way.
        #[arg(long)]
        restart: bool,
        /// Send nothing, and print what would be sent.
        #[arg(long)]
        dry_run: bool,
        /// Options of the engine: with slurm those of sbatch; with kubernetes see `-- --help`.
        #[arg(last = true, value_name = "ENGINE OPTIONS")]
        added: Vec<String>,
    },
    /// Show the progress of a distributed job.
    Status {
        /// The configuration of the job.
        config: PathBuf,
        /// The number of tasks of each phase: name missing tasks, not parts.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_TASKS)))]
        tasks: Option<u32>,
    },
    /// Show what point clouds contain.
    Info {
        /// Point clouds: LAS, LAZ, COPC, EPT or text, folders, or lists of them.
        #[arg(required = true)]
        files: Vec<PathBuf>,
        /// Read all points, and count those of each class and of each return.
        #[arg(long)]
        histogram: bool,
    },
    /// List the GPUs of this machine, test one, and measure how much faster a job is with it.
    Gpu {
        /// Part of the name of the GPU to test. Default: the GPU that backend = "gpu" takes.
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
        /// Different seeds make different terrains.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Overwrite an existing file.
        #[arg(long)]
        overwrite: bool,
    },
    /// Print the script that lets a shell complete commands and options.
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
        /// A command, for a page about it alone. Default: one page about all commands.
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
    /// Count cut and fill only where the height changes by at least this much, in units of the heights. Default: 0.
    #[arg(long, value_name = "HEIGHT", default_value_t = 0.0, hide_default_value = true, value_parser = threshold)]
    pub threshold: f64,
    /// Also figures for each of these polygons: GeoJSON, GeoPackage or Shapefile. Their attribute "name" is shown.
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub areas: Option<PathBuf>,
    /// Also write a raster of the differences and a mesh in their colours to this folder: a new one, or that of an earlier difference.
    #[arg(long, short, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub output: Option<PathBuf>,
    /// Cell size of the raster, in units of x and y. Default: about the point spacing of the finer terrain.
    #[arg(long, value_name = "LENGTH", requires = "output", value_parser = length)]
    pub resolution: Option<f64>,
    /// The change with the strongest colours, in units of the heights. Default: more than nearly all changes.
    #[arg(long, value_name = "HEIGHT", requires = "output", value_parser = length)]
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
    /// The port to listen on. Default: one that is free.
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub port: u16,
    /// Do not open a browser.
    #[arg(long)]
    pub no_open: bool,
    /// The address to listen on. With 0.0.0.0, every machine that reaches this one can read the results.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    pub address: IpAddr,
    /// Another host name that browsers may use, such as that of a proxy. May be given several times.
    #[arg(long, value_name = "NAME", value_parser = host_name)]
    pub host: Vec<String>,
    /// Send CORS headers, so that pages of other servers can read the results, such as your own map. Any page in a browser that reaches the
    /// server can then read them.
    #[arg(long)]
    pub cors: bool,
}

fn host_name(text: &str) -> Result<String, String> {
    let is_name = |byte: u8| byte.is_ascii_alphanumeric() || b"-._".contains(&byte);
    if text.is_empty() || !text.bytes().all(is_name) {
        return Err("give the name alone, such as maps.example.org, without http:// and without a port".into());
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
