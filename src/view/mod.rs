//! `gdt-batch view`: serves the results in an output directory to a browser on this machine, together with the page that shows it.

mod body;
pub mod browser;
mod content;
mod hosts;
mod response;
mod results;
mod server;
mod site;
mod timed_stream;

use std::fmt;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::error::{Error, Result};
use crate::view::hosts::Hosts;
use crate::view::results::Results;
use crate::view::server::Server;
use crate::view::site::Site;
use tiles::file_names::OutputFiles;
use tiles::page::{imagery_of, is_built_in, page_for};

/// A terrain that waits for browsers: `Display` is for people, `Serialize` for programs.
#[derive(Serialize)]
pub struct View {
    /// The output directory.
    #[serde(serialize_with = "sys::path_text::shown")]
    pub directory: PathBuf,
    /// The address of the page.
    pub url: String,
    /// Whether other machines can reach it.
    pub is_public: bool,
    #[serde(skip)]
    server: Server,
}

impl View {
    /// Opens the port of `wanted` for the terrain in `directory`. Port 0 is any that is free. Browsers may know this machine by the
    /// names `hosts` too. Pages of other servers may read the results if `cors` is set.
    ///
    /// # Errors
    /// [`sys::Error::Config`] if no job has written to the directory, or the address is not one of this machine.
    /// [`verify::Error::Unfinished`] if the job is not done. [`Error::Port`] if another program has the port.
    pub fn open(directory: &Path, wanted: SocketAddr, hosts: &[String], cors: bool) -> Result<View> {
        let terrain = terrain_in(directory)?;
        let root = directory.canonicalize().map_err(sys::Error::io("read", directory))?;
        let listener = TcpListener::bind(wanted).map_err(|error| not_listening(wanted, &error))?;
        let bound = listener.local_addr().map_err(sys::Error::io("listen on", wanted.to_string()))?;
        let (results, page, hosts) = (
            Results::new(&root),
            is_built_in()
                .then(|| page_for(terrain, imagery_of(&OutputFiles::new(&root).page()).as_ref()))
                .transpose()?,
            Hosts::new(hosts),
        );
        let site = Site { results, root, page, hosts, cors };
        // An address such as 0.0.0.0 stands for all of this machine.
        let shown = if wanted.ip().is_unspecified() { "localhost".into() } else { ip_text(wanted.ip()) };
        Ok(View {
            directory: directory.into(),
            url: format!("http://{shown}:{}/", bound.port()),
            is_public: !wanted.ip().is_loopback(),
            server: Server::new(listener, site)?,
        })
    }

    /// Answers browsers until the process is asked to stop.
    ///
    /// # Errors
    /// [`sys::Error::Io`] if the system closes the port.
    pub fn run(&self) -> sys::Result<()> {
        self.server.run()
    }
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (directory, url) = (self.directory.display(), &self.url);
        match is_built_in() {
            true => writeln!(f, "{directory} is shown at {url}")?,
            false => writeln!(
                f,
                "the files in {directory} are at {url}; this build of gdt-batch has no page that shows them"
            )?,
        }
        if self.is_public {
            writeln!(f, "any machine that can reach this one can read the results in it")?;
        }
        write!(f, "Ctrl-C ends it")
    }
}

/// Returns an address as it stands in a URL.
fn ip_text(address: IpAddr) -> String {
    match address {
        IpAddr::V4(ip) => ip.to_string(),
        IpAddr::V6(ip) => format!("[{ip}]"),
    }
}

/// Returns the name of the file in `directory` that the page opens.
fn terrain_in(directory: &Path) -> Result<&'static str> {
    let files = OutputFiles::new(directory);
    if files.tileset().is_file() {
        return Ok("tileset.json");
    }
    if files.terrain().is_file() {
        return Ok("terrain.glb");
    }
    if let (true, Some(folder)) = (directory.is_file(), directory.parent()) {
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        return Err(sys::Error::Config(format!(
            "{} is a file: name the [output] directory of a job, as in `gdt-batch view {}`",
            directory.display(),
            folder.display()
        ))
        .into());
    }
    if files.journal().is_file() {
        return Err(verify::Error::Unfinished { directory: directory.into() }.into());
    }
    Err(sys::Error::Config(format!(
        "{} has neither tileset.json nor terrain.glb: name the [output] directory of a finished job",
        directory.display()
    ))
    .into())
}

fn not_listening(address: SocketAddr, error: &std::io::Error) -> Error {
    use std::io::ErrorKind::{AddrInUse, PermissionDenied};
    let port = address.port();
    match error.kind() {
        AddrInUse => Error::Port(format!("port {port} is in use: choose another --port, or leave it out")),
        PermissionDenied => {
            sys::Error::Config(format!("port {port} is reserved for the system: use --port 1024 or higher")).into()
        }
        _ => {
            sys::Error::Config(format!("cannot listen on {address}: {error}; give an --address of this machine")).into()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    const HERE: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);

    fn error(directory: &Path, port: u16) -> Error {
        View::open(directory, SocketAddr::new(HERE, port), &[], false).map(|view| view.url).unwrap_err()
    }

    #[test]
    fn a_folder_that_is_no_output_is_refused_with_what_it_needs() {
        let folder = tempfile::tempdir().unwrap();
        let refused = error(folder.path(), 0);
        assert_eq!(refused.exit_code(), 2);
        assert!(refused.to_string().contains("tileset.json"), "{refused}");
        assert_eq!(error(&folder.path().join("nowhere"), 0).exit_code(), 2);
        std::fs::create_dir(folder.path().join("job")).unwrap();
        std::fs::write(folder.path().join("job/journal"), "").unwrap();
        assert!(matches!(error(folder.path(), 0), Error::Verify(verify::Error::Unfinished { .. })));
    }

    #[test]
    fn a_port_of_another_program_is_an_error_that_says_what_to_do() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("terrain.glb"), "").unwrap();
        let other = TcpListener::bind((HERE, 0)).unwrap();
        let refused = error(folder.path(), other.local_addr().unwrap().port());
        assert_eq!(refused.exit_code(), 1);
        assert!(refused.to_string().contains("--port"), "{refused}");
    }

    #[test]
    fn tiles_are_preferred_to_one_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("terrain.glb"), "").unwrap();
        assert_eq!(terrain_in(folder.path()).unwrap(), "terrain.glb");
        std::fs::write(folder.path().join("tileset.json"), "").unwrap();
        assert_eq!(terrain_in(folder.path()).unwrap(), "tileset.json");
    }
}
