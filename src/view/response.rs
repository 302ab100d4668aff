//! The answer to one request: whole files, parts of files, packed with gzip where that helps, and what is not there.

use std::fs::{File, Metadata};
use std::io::{Cursor, Read, Seek, SeekFrom};
use std::path::Path;
use std::time::UNIX_EPOCH;

use flate2::Compression;
use flate2::read::GzEncoder;
use http_range_header::{RangeUnsatisfiableError, parse_range_header};
use hyper::header::{HeaderName, HeaderValue};
use hyper::{Method, StatusCode, Version};

use crate::view::body::Pieces;
use crate::view::content::{content_type, is_packed, is_worth_packing};
use crate::view::site::{Site, Target};

/// A request. Its body does not matter.
type Request = hyper::Request<hyper::body::Incoming>;

type Response = hyper::Response<Pieces>;

/// Returns the answer to `request`. `stays_here` tells whether the client is on this machine.
pub(super) fn response(site: &Site, request: &Request, stays_here: bool) -> Response {
    let answer = answer(site, request, stays_here);
    if site.cors { for_all_pages(answer) } else { answer }
}

/// Returns the answer as pages of other servers may read it. They may ask for parts of files: browsers let them send such a header
/// without asking first only if it is simple, as `bytes=0-99` is.
fn for_all_pages(answer: Response) -> Response {
    let headers = [
        ("Access-Control-Allow-Origin", "*"),
        ("Access-Control-Allow-Methods", "GET, HEAD"),
        ("Access-Control-Allow-Headers", "Range, If-Range, If-None-Match"),
        ("Access-Control-Expose-Headers", "Accept-Ranges, Content-Length, Content-Range, ETag"),
        ("Cross-Origin-Resource-Policy", "cross-origin"),
    ];
    headers.into_iter().fold(answer, |answer, (name, value)| with(answer, name, value))
}

fn answer(site: &Site, request: &Request, stays_here: bool) -> Response {
    if !site.hosts.answer_to(header(request, "Host")) {
        return unknown_host(site);
    }
    // What browsers ask before a request with other headers (the fetch standard, CORS-preflight).
    if site.cors && *request.method() == Method::OPTIONS {
        return text(204, "");
    }
    if !matches!(*request.method(), Method::GET | Method::HEAD) {
        return with(text(405, "only GET and HEAD are answered\n"), "Allow", "GET, HEAD");
    }
    match site.target(request.uri().path()) {
        Target::Page(page) => answer_page(page, request),
        Target::File(path, file) => file_response(request, &path, file, stays_here)
            .unwrap_or_else(|error| text(500, &format!("the file cannot be read: {error}\n"))),
        Target::Nothing => text(404, "there is no such file\n"),
    }
}

fn unknown_host(site: &Site) -> Response {
    let known = &site.hosts;
    text(
        403,
        &format!("this server answers to {known}; gdt-batch view --host NAME adds the name in the browser's address\n"),
    )
}

/// Returns an answer with a text.
fn text(status: u16, text: &str) -> Response {
    plain(Cursor::new(text.to_owned()), text.len() as u64, status, "text/plain; charset=utf-8")
}

fn answer_page(page: String, request: &Request) -> Response {
    let kind = "text/html; charset=utf-8";
    if takes_gzip(request) {
        return packed(Cursor::new(page), kind);
    }
    let length = page.len() as u64;
    plain(Cursor::new(page), length, 200, kind)
}

fn file_response(request: &Request, path: &Path, mut file: File, stays_here: bool) -> std::io::Result<Response> {
    let data = file.metadata()?;
    let (length, [tag, packed_tag], kind) = (data.len(), tags(&data), content_type(path));
    let is_known = |tag: &&String| header(request, "If-None-Match").is_some_and(|known| known.contains(tag.as_str()));
    if let Some(tag) = [&tag, &packed_tag].into_iter().find(is_known) {
        return Ok(with(plain(Cursor::new(""), 0, 304, kind), "ETag", tag));
    }
    // A part of a file that has changed would not fit to the others.
    let is_same = header(request, "If-Range").is_none_or(|known| known == tag);
    // Ranges mean something for GET only (RFC 9110, section 14.2).
    let takes_parts = is_same && *request.method() == Method::GET;
    let range = header(request, "Range").filter(|_| takes_parts).map_or(Wanted::All, |range| wanted(range, length));
    let answer = match range {
        Wanted::Part(start, end) => {
            file.seek(SeekFrom::Start(start))?;
            let part = plain(file, end - start + 1, 206, kind);
            with(part, "Content-Range", &format!("bytes {start}-{end}/{length}"))
        }
        Wanted::Nowhere => with(text(416, "the file is shorter\n"), "Content-Range", &format!("bytes */{length}")),
        Wanted::All if takes_gzip(request) && is_worth_packing(path, &mut file, stays_here)? => {
            return Ok(with(packed(file, kind), "ETag", &packed_tag));
        }
        Wanted::All => plain(file, length, 200, kind),
    };
    let answer = if is_packed(path) { with(answer, "Content-Encoding", "gzip") } else { answer };
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

/// Returns texts that change with the file: for its own bytes, and for those that are packed.
fn tags(data: &Metadata) -> [String; 2] {
    let time = data.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
    ["", "-gzip"].map(|form| format!("\"{:x}-{:x}{form}\"", time.as_nanos(), data.len()))
}

fn plain(content: impl Read + Send + 'static, length: u64, status: u16, kind: &str) -> Response {
    with_headers(Pieces::new(content, Some(length)), StatusCode::from_u16(status).unwrap_or_default(), kind)
}

fn packed(content: impl Read + Send + 'static, kind: &str) -> Response {
    let content = GzEncoder::new(content, Compression::fast());
    with(with_headers(Pieces::new(content, None), StatusCode::OK, kind), "Content-Encoding", "gzip")
}

/// Returns an answer with the headers of every answer. A job may replace its results, so browsers must ask each time whether a file has
/// changed.
fn with_headers(body: Pieces, status: StatusCode, kind: &str) -> Response {
    let mut response = Response::new(body);
    *response.status_mut() = status;
    let headers = [
        ("Cache-Control", "no-cache"),
        ("Vary", "Accept-Encoding"),
        ("X-Content-Type-Options", "nosniff"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
        ("Content-Type", kind),
    ];
    headers.into_iter().fold(response, |response, (name, value)| with(response, name, value))
}

fn with(mut response: Response, name: &str, value: &str) -> Response {
    if let (Ok(name), Ok(value)) = (HeaderName::try_from(name), HeaderValue::try_from(value)) {
        response.headers_mut().insert(name, value);
    }
    response
}

fn header<'a>(request: &'a Request, name: &str) -> Option<&'a str> {
    request.headers().get(name)?.to_str().ok()
}

/// Tells whether the browser unpacks gzip. Version 1.0 of HTTP cannot send what has no known length.
fn takes_gzip(request: &Request) -> bool {
    let offers = |accepted: &str| {
        accepted.split(',').any(|coding| {
            let (name, quality) = coding.split_once(';').unwrap_or((coding, ""));
            name.trim() == "gzip" && !matches!(quality.trim(), "q=0" | "q=0.0" | "q=0.00" | "q=0.000")
        })
    };
    request.version() >= Version::HTTP_11 && header(request, "Accept-Encoding").is_some_and(offers)
}
