//! The server: each request has a thread of its own, so that a slow client holds up nobody else.

use std::net::TcpListener;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use crate::view::response::{response, text};
use crate::view::site::Site;
use crate::{Error, Result, interrupt};

/// How long the server may take to see that it was asked to stop.
const PATIENCE: Duration = Duration::from_millis(200);

/// The most requests that are answered at one time. Browsers send six.
const MOST_REQUESTS: usize = 256;

/// A server that listens already.
pub(super) struct Server {
    http: tiny_http::Server,
    site: Arc<Site>,
}

impl Server {
    pub(super) fn new(listener: TcpListener, site: Site) -> Result<Server> {
        let http = tiny_http::Server::from_listener(listener, None).map_err(|error| Error::Io {
            action: "serve",
            path: site.root.clone(),
            source: std::io::Error::other(error),
        })?;
        Ok(Server { http, site: Arc::new(site) })
    }

    /// Answers requests until the process is asked to stop.
    pub(super) fn run(&self) -> Result<()> {
        while interrupt::check().is_ok() {
            if let Some(request) = self.http.recv_timeout(PATIENCE).map_err(Error::io("serve", &self.site.root))? {
                self.answer(request);
            }
        }
        Ok(())
    }

    fn answer(&self, request: tiny_http::Request) {
        // This server holds one, and each thread one more.
        if Arc::strong_count(&self.site) > MOST_REQUESTS {
            let _ = request.respond(text(503, "too many requests at a time\n"));
            return;
        }
        let site = Arc::clone(&self.site);
        // A client that has gone away must not end the server. Without a thread, the request is dropped, which answers it with an error.
        let _ = thread::Builder::new().spawn(move || {
            let answer = response(&site, &request);
            let _ = request.respond(answer);
        });
    }
}

#[cfg(test)]
mod tests;
