//! A web server of this machine for the tests: it hands out parts of files, writes down what it was asked, and fails as it is told.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::ops::Range;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Longer than any test waits for an answer that never comes.
const NEVER: Duration = Duration::from_secs(20);

/// A request and what became of it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Request {
    /// Path and query.
    pub(crate) target: String,
    /// The headers by their names in lower case.
    pub(crate) headers: BTreeMap<String, String>,
    /// The bytes of files that were sent.
    pub(crate) sent: usize,
}

impl Request {
    /// Returns the bytes that it asks for.
    pub(crate) fn range(&self) -> Range<usize> {
        let range = self.headers.get("range").and_then(|range| range.strip_prefix("bytes="));
        let (first, last) = range.and_then(|range| range.split_once('-')).expect("only parts are asked for");
        first.parse().unwrap()..last.parse::<usize>().unwrap() + 1
    }
}

/// What the server does with a request.
#[derive(Clone, Debug)]
pub(crate) enum Answer {
    /// What servers do.
    Right,
    /// This status, with this header.
    Status(u16, &'static str),
    /// Only so many bytes of the body, though it promises all.
    CutOff(usize),
    /// Nothing, for ever.
    Nothing,
    /// The whole file, whatever part is asked for.
    Whole,
    /// The part, of a file with another tag.
    Tagged(&'static str),
    /// The part, without a tag and a time.
    Untagged,
    /// This text, such as a list.
    Text(String),
}

/// Decides on the answer to the n-th request, from 0 on.
type Rule = Box<dyn Fn(usize, &Request) -> Answer + Send + Sync>;

struct Shared {
    files: BTreeMap<String, Vec<u8>>,
    requests: Mutex<Vec<Request>>,
    rule: Mutex<Rule>,
}

/// A server that runs until the process ends.
pub(crate) struct WebServer {
    port: u16,
    shared: Arc<Shared>,
}

impl WebServer {
    /// Starts a server of these files, by their paths.
    pub(crate) fn of(files: &[(&str, Vec<u8>)]) -> WebServer {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let files = files.iter().map(|(name, bytes)| (name.to_string(), bytes.clone())).collect();
        let rule: Rule = Box::new(|_, _| Answer::Right);
        let shared = Arc::new(Shared { files, requests: Mutex::default(), rule: Mutex::new(rule) });
        let (port, for_threads) = (listener.local_addr().unwrap().port(), shared.clone());
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let shared = for_threads.clone();
                std::thread::spawn(move || serve(stream, &shared));
            }
        });
        WebServer { port, shared }
    }

    /// Answers by this rule from now on, and counts requests from 0 again.
    pub(crate) fn answer(&self, rule: impl Fn(usize, &Request) -> Answer + Send + Sync + 'static) {
        self.shared.requests.lock().unwrap().clear();
        *self.shared.rule.lock().unwrap() = Box::new(rule);
    }

    pub(crate) fn url(&self, target: &str) -> String {
        format!("http://127.0.0.1:{}{target}", self.port)
    }

    /// Returns the requests since the last rule.
    pub(crate) fn requests(&self) -> Vec<Request> {
        self.shared.requests.lock().unwrap().clone()
    }

    /// Returns the bytes of files that were sent since the last rule.
    pub(crate) fn sent(&self) -> usize {
        self.requests().iter().map(|request| request.sent).sum()
    }
}

/// Answers the requests of a connection.
fn serve(mut stream: TcpStream, shared: &Shared) {
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    while let Some(request) = read_request(&mut reader) {
        let number = {
            let mut requests = shared.requests.lock().unwrap();
            requests.push(request.clone());
            requests.len() - 1
        };
        let answer = shared.rule.lock().unwrap()(number, &request);
        if matches!(answer, Answer::Nothing) {
            return std::thread::sleep(NEVER);
        }
        let cut = if let Answer::CutOff(bytes) = answer { Some(bytes) } else { None };
        let (head, body) = made(shared, &request, answer);
        let sent = &body[..cut.unwrap_or(body.len()).min(body.len())];
        if let Some(request) = shared.requests.lock().unwrap().get_mut(number) {
            request.sent = sent.len();
        }
        let is_sent = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(sent)).is_ok();
        if cut.is_some() || !is_sent {
            return;
        }
    }
}

fn read_request(reader: &mut impl BufRead) -> Option<Request> {
    let mut line = String::new();
    reader.read_line(&mut line).ok().filter(|count| *count > 0)?;
    let target = line.split(' ').nth(1)?.to_string();
    let mut headers = BTreeMap::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let Some((name, value)) = line.trim().split_once(':') else {
            return Some(Request { target, headers, sent: 0 });
        };
        headers.insert(name.to_lowercase(), value.trim().to_string());
    }
}

/// Returns the head and the body of an answer.
fn made(shared: &Shared, request: &Request, answer: Answer) -> (String, Vec<u8>) {
    let head = |status: &str, headers: &str, body: &[u8]| {
        format!("HTTP/1.1 {status}\r\nContent-Length: {}\r\n{headers}\r\n", body.len())
    };
    let path = request.target.split('?').next().unwrap();
    let file = shared.files.get(path);
    match (answer, file) {
        (Answer::Status(status, header), _) => {
            (head(&format!("{status} Told"), &format!("{header}\r\n"), &[]), Vec::new())
        }
        (Answer::Text(text), _) => (head("200 OK", "", text.as_bytes()), text.into_bytes()),
        (_, None) => (head("404 Not Found", "", &[]), Vec::new()),
        (Answer::Whole, Some(file)) => (head("200 OK", "", file), file.clone()),
        // Small files are asked for whole.
        (_, Some(file)) if !request.headers.contains_key("range") => {
            (head("200 OK", "ETag: \"first\"\r\n", file), file.clone())
        }
        (answer, Some(file)) => {
            let Range { start: first, end } = request.range();
            if first >= file.len() {
                let place = format!("Content-Range: bytes */{}\r\n", file.len());
                return (head("416 Range Not Satisfiable", &place, &[]), Vec::new());
            }
            let part = file[first..end.min(file.len())].to_vec();
            let tag = if let Answer::Tagged(tag) = answer { tag } else { "first" };
            let tag = if matches!(answer, Answer::Untagged) { String::new() } else { format!("ETag: \"{tag}\"\r\n") };
            let place = format!("Content-Range: bytes {first}-{}/{}\r\n{tag}", first + part.len() - 1, file.len());
            (head("206 Partial Content", &place, &part), part)
        }
    }
}
