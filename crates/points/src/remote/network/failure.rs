//! Why a request failed, and what that means for the job.

use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

use sys::Error;

/// What a failure means for the next request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FailureKind {
    /// It may pass.
    Passing,
    /// The server cannot be reached. It may pass, but rarely does before the server was ever reached.
    Unreachable,
    /// There is no such file.
    Missing,
    /// The server does not hand out this file, or not in this way, however often it is asked.
    Refused,
    /// No file of this server can be read.
    Unsuitable,
}

/// Why a request failed.
#[derive(Clone, Debug)]
pub(crate) struct Failure {
    pub(crate) kind: FailureKind,
    /// A sentence.
    pub(crate) what: String,
    /// How long the server wants to be left alone.
    pub(crate) pause: Option<Duration>,
}

impl Failure {
    /// Returns a failure of a kind.
    pub(crate) fn new(kind: FailureKind, what: impl Into<String>) -> Failure {
        Failure { kind, what: what.into(), pause: None }
    }

    /// Returns whether it may help to ask again.
    pub(crate) fn may_pass(&self) -> bool {
        matches!(self.kind, FailureKind::Passing | FailureKind::Unreachable)
    }

    /// Returns the failure of a request that got no answer from `host`.
    pub(crate) fn of_request(error: ureq::Error, host: &str) -> Failure {
        use ureq::Error::{
            BadUri, ConnectProxyFailed, HostNotFound, Io, Protocol, RequireHttpsOnly, Rustls, Timeout, TooManyRedirects,
        };
        use ureq::Timeout::{Connect, Resolve};
        let (kind, what) = match error {
            HostNotFound => {
                (FailureKind::Unreachable, format!("unknown host {host}: correct its name, or check the network"))
            }
            Timeout(Connect | Resolve) => (
                FailureKind::Unreachable,
                format!("the server {host} cannot be reached: it does not answer; check the network"),
            ),
            // The resolver has no kind of its own for this.
            Io(error) if error.to_string().contains("lookup address") => (
                FailureKind::Unreachable,
                format!("unknown host {host} ({error}): correct its name, or check the network"),
            ),
            Timeout(_) => (FailureKind::Passing, "the server did not answer in time".into()),
            Io(error) if error.kind() == ErrorKind::ConnectionRefused => {
                (FailureKind::Unreachable, format!("the server {host} refuses connections"))
            }
            // So the TLS library calls what it does not like.
            Io(error) if error.kind() == ErrorKind::InvalidData => {
                (FailureKind::Refused, no_tls(host, &error.to_string()))
            }
            Io(error) if error.kind() == ErrorKind::NetworkUnreachable => {
                (FailureKind::Unreachable, format!("the server {host} cannot be reached: {error}; check the network"))
            }
            Rustls(error) => (FailureKind::Refused, no_tls(host, &error.to_string())),
            Io(error) => (FailureKind::Passing, format!("the connection failed: {error}")),
            ConnectProxyFailed(_) => (FailureKind::Unreachable, "the proxy did not make the connection".into()),
            TooManyRedirects => (FailureKind::Refused, "the server redirects endlessly".into()),
            // The URL of a job has a scheme that is read, so a redirect led to this one.
            RequireHttpsOnly(place) => (FailureKind::Refused, not_followed("https", &place)),
            BadUri(what) if what.starts_with("unknown scheme") => (FailureKind::Refused, not_followed("http", &what)),
            Protocol(error) if error.to_string().contains("location header") => (
                FailureKind::Refused,
                "the server redirects to an address that is neither http:// nor https://: correct the URL".into(),
            ),
            Protocol(error) => (FailureKind::Passing, format!("the answer is not HTTP: {error}")),
            // Others may name the URL with its query.
            _ => (FailureKind::Refused, "the request is invalid: check the URL".into()),
        };
        Failure::new(kind, what)
    }

    /// Returns the error of a job that opens the file with this public name. `part` says what it asked for.
    pub(crate) fn into_error(self, name: &Path, part: &str) -> Error {
        match self.kind {
            FailureKind::Missing => Error::Config(format!("there is no file {}: {}", name.display(), self.what)),
            FailureKind::Unsuitable => Error::Config(format!("{}: {}", name.display(), self.what)),
            _ => self.into_read_error(name, part),
        }
    }

    /// Returns the error of a job that reads `part` of a file that was there.
    pub(crate) fn into_read_error(self, name: &Path, part: &str) -> Error {
        Error::io("read", name)(std::io::Error::other(format!("{part}{}", self.what)))
    }
}

/// Says why a redirect is not followed. `place` is the URL that it leads to, or ends with its scheme.
fn not_followed(from: &str, place: &str) -> String {
    let before = place.split("://").next().unwrap_or_default();
    let scheme = before.rsplit(|c: char| !c.is_ascii_alphanumeric() && !"+-.".contains(c)).next().unwrap_or_default();
    let why = match scheme {
        "http" => "which is not safe and not followed: use the http:// URL itself",
        _ => {
            "which is not followed, because only https:// and http:// are supported: correct the URL, or ask the server's operator"
        }
    };
    format!("the server redirects from {from} to {scheme}, {why}")
}

/// Says why there is no safe connection.
fn no_tls(host: &str, error: &str) -> String {
    if error.contains("certificate") {
        format!(
            "the certificate of {host} is not trusted ({error}): SSL_CERT_FILE can name a file with other certificate authorities"
        )
    } else {
        format!("TLS failed with {host} ({error}): if it is a plain http:// server, correct the URL")
    }
}
