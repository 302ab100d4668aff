//! The command line: what it accepts, and which part of the library each command calls.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

/// What `--help` teaches beside the options.
const AFTER_HELP: &str = "\
Examples:
  gdt-batch sample terrain.laz          make a sample terrain to try things on
  gdt-batch configs/quickstart.toml     run a job
  gdt-batch check job.toml              what would it read, how large is it, does it fit?
  gdt-batch verify out                  prove that the tiles in out are the exact Delaunay triangulation

The least configuration:
  [input]
  files = [\"clouds/*.laz\"]
  [output]
  directory = \"out\"
All options, explained: configs/full.toml

A job that was interrupted goes on where it was when the same command is run again.

Exit codes: 0 done; 1 may be retried (disk, memory, Ctrl-C); 2 command line or configuration;
3 bad input; 4 a guarantee does not hold (verify failed, or an internal check).";

/// One exact Delaunay terrain out of point clouds of any size, as glTF tiles.
#[derive(Parser, Debug)]
#[command(name = "gdt-batch", version, after_help = AFTER_HELP, arg_required_else_help = true)]
pub struct Cli {
    /// What to do; a configuration file alone runs its job.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The configuration of the job to run (TOML).
    pub config: Option<PathBuf>,
    /// Start over where an interrupted run of the job could be gone on with.
    #[arg(long, requires = "config")]
    pub fresh: bool,
    /// Run the job even where the disk or the memory does not seem to suffice.
    #[arg(long, requires = "config")]
    pub force: bool,
    /// How to talk.
    #[command(flatten)]
    pub talk: Talk,
}

/// How to talk; may stand anywhere on the command line.
#[derive(Args, Clone, Copy, Debug)]
pub struct Talk {
    /// No progress, and no table at the end.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Print the result as JSON on standard output.
    #[arg(long, global = true)]
    pub json: bool,
}

/// The commands beside running a job.
#[derive(Subcommand, Debug)]
pub enum Command {
    /// Look at the inputs of a job and say what it would do and whether it fits; writes nothing.
    Check {
        /// The configuration of the job.
        config: PathBuf,
    },
    /// Read written tiles back and prove with exact arithmetic that they are the Delaunay triangulation.
    Verify {
        /// The output directory of a job.
        directory: PathBuf,
        /// The most memory to use, such as "4 GiB".
        #[arg(long, default_value = "4 GiB", value_parser = memory)]
        memory: u64,
    },
    /// Say what point clouds hold.
    Info {
        /// Point clouds: LAS, LAZ, COPC or text.
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// List the GPUs of this machine, compare every step on one of them with plain code, and time it.
    Gpu {
        /// A part of the name of the GPU to test; without it the one that backend = "gpu" takes.
        #[arg(long)]
        adapter: Option<String>,
        /// The side of the largest texture to time, in pixels.
        #[arg(long)]
        side: Option<u32>,
    },
    /// Write a sample terrain, made up from a seed, as LAS or LAZ.
    Sample {
        /// The file to write: .las or .laz.
        file: PathBuf,
        /// How many points.
        #[arg(long, default_value_t = 1_000_000)]
        points: u64,
        /// Another seed gives another terrain.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
}

fn memory(text: &str) -> Result<u64, String> {
    crate::job::options::MemoryLimit::try_from(text.to_owned()).map(|memory| memory.0)
}
