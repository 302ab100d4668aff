//! The server: takes connections, and keeps clients that are slow or say nothing from holding up the others.

use std::convert::Infallible;
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::time::Duration;

use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::runtime::{Builder, Runtime};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{sleep, timeout};

use crate::view::response::response;
use crate::view::site::Site;
use crate::view::timed_stream::TimedStream;
use sys::{Error, Result, interrupt};

/// How long the server may take to see that it was asked to stop.
const PATIENCE: Duration = Duration::from_millis(200);

/// How long a client may take to say what it wants.
const SILENCE: Duration = Duration::from_secs(20);

/// How long a client may take nothing of an answer.
const STILLNESS: Duration = Duration::from_secs(30);

/// The most connections at one time. A browser has six; others wait.
const MOST_CONNECTIONS: usize = 256;

/// Threads that read files and pack them.
const THREADS: usize = 4;

/// A server that listens already.
pub(super) struct Server {
    listener: TcpListener,
    site: Arc<Site>,
    runtime: Runtime,
    stillness: Duration,
}

impl Server {
    pub(super) fn new(listener: TcpListener, site: Site) -> Result<Server> {
        listener.set_nonblocking(true).map_err(Error::io("listen for", &site.root))?;
        let runtime = Builder::new_multi_thread().worker_threads(THREADS).enable_io().enable_time().build();
        let runtime = runtime.map_err(Error::io("start the threads that serve", &site.root))?;
        Ok(Server { listener, site: Arc::new(site), runtime, stillness: STILLNESS })
    }

    /// Answers requests until the process is asked to stop.
    pub(super) fn run(&self) -> Result<()> {
        self.runtime.block_on(async {
            let listener = self.listener.try_clone().and_then(tokio::net::TcpListener::from_std);
            let listener = listener.map_err(Error::io("listen for", &self.site.root))?;
            let free = Arc::new(Semaphore::new(MOST_CONNECTIONS));
            while interrupt::check().is_ok() {
                let Ok(Ok(permit)) = timeout(PATIENCE, Arc::clone(&free).acquire_owned()).await else { continue };
                match timeout(PATIENCE, listener.accept()).await {
                    Ok(Ok((stream, client))) => {
                        let stream = TimedStream::new(stream, self.stillness);
                        tokio::spawn(converse(stream, client, Arc::clone(&self.site), permit));
                    }
                    // The client is gone again, or the process has too many files open: that passes.
                    Ok(Err(_)) => sleep(PATIENCE).await,
                    Err(_) => {}
                }
            }
            Ok(())
        })
    }
}

/// Answers the requests that come over one connection.
async fn converse(stream: TimedStream, client: SocketAddr, site: Arc<Site>, permit: OwnedSemaphorePermit) {
    let answer = service_fn(|request| {
        let response = response(&site, &request, client.ip().is_loopback());
        async { Ok::<_, Infallible>(response) }
    });
    let mut builder = http1::Builder::new();
    let connection =
        builder.timer(TokioTimer::new()).header_read_timeout(SILENCE).serve_connection(TokioIo::new(stream), answer);
    // A client that goes away in the middle is nothing to tell of.
    let _ = connection.await;
    drop(permit);
}

#[cfg(test)]
mod tests;
