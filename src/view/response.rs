//! The answer to one request: whole files, parts of files, packed with gzip where that helps, and what is not there.

use std::fs::{File, Metadata};
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::UNIX_EPOCH;

use flate2::Compression;
use flate2::read::GzEncoder;
use http_range_header::{RangeUnsatisfiableError, parse_range_header};
use tiny_http::{Header, Method, Request, Response, ResponseBox, StatusCode};

use crate::view::content::{content_type, is_worth_packing};
use crate::view::site::{Site, Target};

/// Returns the answer to `request`.
pub(super) fn response(site: &Site, request: &Request) -> ResponseBox {
    if !site.answers_to(header(request, "Host")) {
        return text(403, "this server answers to localhost only; gdt-batch view --address changes that\n");
    }
    if !matches!(request.method(), Method::Get | Method::Head) {
        return with(text(405, "only GET and HEAD are answered\n"), "Allow", "GET, HEAD");
    }
    match site.target(request.url()) {
        Target::Page => page(site, request),
        Target::File(path, file) => file_response(request, &path, file)
            .unwrap_or_else(|error| text(500, &format!("the file cannot be read: {error}\n"))),
        Target::Nothing => text(404, "there is no such file\n"),
    }
}

/// Returns an answer with a text.
pub(super) fn text(status: u16, text: &str) -> ResponseBox {
    plain(Cursor::new(text.to_owned()), text.len() as u64, status, "text/plain; charset=utf-8")
}

fn page(site: &Site, request: &Request) -> ResponseBox {
    let (page, kind) = (site.page.clone(), "text/html; charset=utf-8");
    if takes_gzip(request) {
        return packed(Cursor::new(page), kind);
    }
    let length = page.len() as u64;
    plain(Cursor::new(page), length, 200, kind)
}

fn file_response(request: &Request, path: &Path, mut file: File) -> std::io::Result<ResponseBox> {
    let data = file.metadata()?;
    let (length, tag, kind) = (data.len(), tag(&data), content_type(path));
    if header(request, "If-None-Match").is_some_and(|known| known.contains(&tag)) {
        return Ok(with(plain(Cursor::new(""), 0, 304, kind), "ETag", &tag));
    }
    // A part of a file that has changed would not fit to the others.
    let is_same = header(request, "If-Range").is_none_or(|known| known == tag);
    let range = header(request, "Range").filter(|_| is_same).map_or(Wanted::All, |range| wanted(range, length));
    let answer = match range {
        Wanted::Part(start, end) => {
            file.seek(SeekFrom::Start(start))?;
            let part = plain(file, end - start + 1, 206, kind);
            with(part, "Content-Range", &format!("bytes {start}-{end}/{length}"))
        }
        Wanted::Nowhere => with(text(416, "the file is shorter\n"), "Content-Range", &format!("bytes */{length}")),
        Wanted::All if takes_gzip(request) && is_worth_packing(path, &mut file, stays_here(request))? => {
            packed(file, kind)
        }
        Wanted::All => plain(file, length, 200, kind),
    };
    Ok(with(with(answer, "ETag", &tag), "Accept-Ranges", "bytes"))
}

/// Which part of a file is asked for.
enum Wanted {
    All,
    /// From the first byte to the last one.
    Part(u64, u64),
    Nowhere,
}

/// Returns the part that the text of a Range header means. A server may answer with the whole file to what it does not understand, and
/// to several ranges.
fn wanted(range: &str, length: u64) -> Wanted {
    match parse_range_header(range).and_then(|parsed| parsed.validate(length)) {
        Ok(parts) => match parts.as_slice() {
            [part] => Wanted::Part(*part.start(), *part.end()),
            _ => Wanted::All,
        },
        Err(RangeUnsatisfiableError::Unsatisfiable) => Wanted::Nowhere,
        Err(_) => Wanted::All,
    }
}

/// Returns a text that changes with the file.
fn tag(data: &Metadata) -> String {
    let time = data.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
    format!("\"{:x}-{:x}\"", time.as_nanos(), data.len())
}

fn plain(content: impl Read + Send + 'static, length: u64, status: u16, kind: &str) -> ResponseBox {
    // A file may grow while it is sent.
    let content = content.take(length);
    let response = Response::new(StatusCode(status), headers(kind), content, usize::try_from(length).ok(), None);
    // Browsers show how far a download is if they know its length.
    response.with_chunked_threshold(usize::MAX).boxed()
}

fn packed(content: impl Read + Send + 'static, kind: &str) -> ResponseBox {
    let content = GzEncoder::new(content, Compression::fast());
    let response = Response::new(StatusCode(200), headers(kind), content, None, None).boxed();
    with(response, "Content-Encoding", "gzip")
}

/// Returns the headers of every answer. A job may replace its results, so browsers must ask each time whether a file has changed.
fn headers(kind: &str) -> Vec<Header> {
    let fixed = [
        ("Cache-Control", "no-cache"),
        ("Vary", "Accept-Encoding"),
        ("X-Content-Type-Options", "nosniff"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
    ];
    fixed.into_iter().chain([("Content-Type", kind)]).filter_map(|(name, value)| make_header(name, value)).collect()
}

fn make_header(name: &str, value: &str) -> Option<Header> {
    Header::from_bytes(name, value).ok()
}

fn with(response: ResponseBox, name: &str, value: &str) -> ResponseBox {
    match make_header(name, value) {
        Some(header) => response.with_header(header),
        None => response,
    }
}

fn header<'a>(request: &'a Request, name: &'static str) -> Option<&'a str> {
    request.headers().iter().find(|header| header.field.equiv(name)).map(|header| header.value.as_str())
}

/// Tells whether the browser unpacks gzip. Version 1.0 of HTTP cannot send what has no known length.
fn takes_gzip(request: &Request) -> bool {
    let offers = |accepted: &str| {
        accepted.split(',').any(|coding| {
            let (name, quality) = coding.split_once(';').unwrap_or((coding, ""));
            name.trim() == "gzip" && !matches!(quality.trim(), "q=0" | "q=0.0" | "q=0.00" | "q=0.000")
        })
    };
    *request.http_version() >= (1, 1) && header(request, "Accept-Encoding").is_some_and(offers)
}

fn stays_here(request: &Request) -> bool {
    request.remote_addr().is_some_and(|address| address.ip().is_loopback())
}
