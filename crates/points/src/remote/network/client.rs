//! Single requests: over HTTP/1.1 and TLS, of web servers and of S3.

use std::sync::{Arc, LazyLock};
use std::time::{Duration, SystemTime};

use ureq::http::{Response, header};
use ureq::tls::{Certificate, RootCerts, TlsConfig};
use ureq::{Agent, Body};

use crate::remote::name::address;
use crate::remote::network::failure::{Failure, FailureKind};
use crate::remote::network::s3::S3Settings;
use crate::remote::network::signature::{UnsignedRequest, encoded};
use crate::remote::network::timeouts::Timeouts;
use crate::remote::traffic::count_request;
use sys::Result;

/// Headers of a request, by names in lower case.
pub(crate) type Headers = Vec<(&'static str, String)>;

/// How many connections stay open for further requests.
const IDLE_CONNECTIONS: usize = 64;

/// The most bytes of an answer's body that are looked at for what S3 says is wrong.
const LONGEST_REASON: u64 = 1 << 14;

/// What can be asked for.
#[derive(Clone, Debug)]
pub(crate) enum Address {
    /// A whole URL of the web, with its query.
    Web(String),
    /// An object in a bucket.
    Object { bucket: String, key: String },
    /// The list of a bucket, with its query.
    List { bucket: String, query: String },
}

/// The ways to ask.
struct Agents {
    /// Follows redirects, but never from https to http.
    secure: Agent,
    /// Follows all redirects.
    open: Agent,
    /// Follows none: they would need a signature of their own.
    s3: Agent,
}

static AGENTS: LazyLock<Agents> = LazyLock::new(|| {
    let Timeouts { answer, .. } = Timeouts::standard();
    let tls = TlsConfig::builder().root_certs(trusted()).build();
    let agent = |https_only, redirects| {
        Agent::config_builder()
            .http_status_as_error(false)
            .https_only(https_only)
            .max_redirects(redirects)
            .max_redirects_will_error(redirects > 0)
            .user_agent(concat!("gdt-batch/", env!("CARGO_PKG_VERSION")))
            .accept_encoding("identity")
            .max_idle_connections(IDLE_CONNECTIONS)
            .max_idle_connections_per_host(IDLE_CONNECTIONS)
            .timeout_resolve(Some(answer))
            .timeout_connect(Some(answer))
            .timeout_recv_response(Some(answer))
            .timeout_recv_body(Some(answer))
            .tls_config(tls.clone())
            .build()
            .new_agent()
    };
    Agents { secure: agent(true, 10), open: agent(false, 10), s3: agent(false, 0) }
});

/// Returns the authorities that this system trusts. Where it has none, as in small containers, those that Mozilla trusts.
fn trusted() -> RootCerts {
    let found = rustls_native_certs::load_native_certs();
    let is_own_choice = std::env::var_os("SSL_CERT_FILE").is_some() || std::env::var_os("SSL_CERT_DIR").is_some();
    if found.certs.is_empty() && !is_own_choice {
        return RootCerts::WebPki;
    }
    let certificates = found.certs.iter().map(|certificate| Certificate::from_der(certificate).to_owned());
    RootCerts::Specific(Arc::new(certificates.collect()))
}

impl Address {
    /// Returns the address of the file with this public name.
    ///
    /// # Errors
    /// [`sys::Error::Config`] if nobody knows its query.
    pub(crate) fn of(name: &str) -> Result<Address> {
        let object = name.strip_prefix("s3://").and_then(|rest| rest.split_once('/'));
        match object {
            Some((bucket, key)) => Ok(Address::Object { bucket: bucket.into(), key: key.into() }),
            None => address(name).map(Address::Web),
        }
    }

    /// Asks for this with these headers. An answer of any status is an answer.
    ///
    /// # Errors
    /// [`Failure`] if none comes.
    pub(crate) fn ask(&self, headers: &Headers) -> std::result::Result<Response<Body>, Failure> {
        let (agent, url, added) = match self {
            Address::Web(url) if url.starts_with("http://") => (&AGENTS.open, url.clone(), Headers::new()),
            Address::Web(url) => (&AGENTS.secure, url.clone(), Headers::new()),
            Address::Object { bucket, key } => signed(bucket, &encoded(key, "/"), "", headers)?,
            Address::List { bucket, query } => signed(bucket, "", query, headers)?,
        };
        let host = url.split('/').nth(2).unwrap_or_default();
        let request =
            headers.iter().chain(&added).fold(agent.get(&url), |request, (name, value)| request.header(*name, value));
        count_request();
        request.call().map_err(|error| Failure::of_request(error, host))
    }
}

/// Returns the way to ask S3, the URL, and the headers that sign the request.
fn signed(
    bucket: &str,
    key: &str,
    query: &str,
    headers: &Headers,
) -> std::result::Result<(&'static Agent, String, Headers), Failure> {
    let settings =
        S3Settings::of_process().map_err(|error| Failure::new(FailureKind::Unsuitable, error.to_string()))?;
    let place = settings.place(bucket, key);
    let (host, path) = (&place.host, &place.path);
    let request = UnsignedRequest { host, path, query, headers };
    let sign = |who| request.sign(who, &settings.region, SystemTime::now());
    let mark = if query.is_empty() { "" } else { "?" };
    let url = format!("{}://{host}{path}{mark}{query}", place.scheme);
    Ok((&AGENTS.s3, url, settings.credentials.as_ref().map(sign).unwrap_or_default()))
}

/// Returns what an answer says that is none of what was asked for.
pub(crate) fn refusal(answer: Response<Body>, address: &Address) -> Failure {
    let status = answer.status();
    let text =
        |name: header::HeaderName| answer.headers().get(name).and_then(|value| value.to_str().ok().map(str::to_string));
    let region = answer.headers().get("x-amz-bucket-region").and_then(|value| value.to_str().ok().map(str::to_string));
    let seconds = text(header::RETRY_AFTER).and_then(|value| value.parse().ok());
    let is_s3 = !matches!(address, Address::Web(_));
    let kind = match status.as_u16() {
        404 | 410 => FailureKind::Missing,
        408 | 425 | 429 | 500 | 502..=504 => FailureKind::Passing,
        _ => FailureKind::Refused,
    };
    let advice = match (status.as_u16(), region) {
        (301 | 307 | 400, Some(region)) if is_s3 => format!("; the bucket is in another region: set AWS_REGION={region}"),
        (401 | 403, _) if is_s3 => {
            "; check AWS_ACCESS_KEY_ID and its permissions. S3 also answers this for a missing object if the key may not list the bucket"
                .into()
        }
        (401 | 403, _) => "; a signature in the URL may have expired: replace it by a new one".into(),
        _ => String::new(),
    };
    let reason = if is_s3 { reason_of_s3(answer) } else { String::new() };
    Failure {
        pause: seconds.map(Duration::from_secs),
        ..Failure::new(kind, format!("the server answered {status}{reason}{advice}"))
    }
}

/// Returns what S3 says is wrong, as a part of a sentence. Only that, because the rest of its answer names who asked.
fn reason_of_s3(mut answer: Response<Body>) -> String {
    let text = answer.body_mut().with_config().limit(LONGEST_REASON).read_to_string().unwrap_or_default();
    let Ok(document) = roxmltree::Document::parse(&text) else { return String::new() };
    let value = |name: &str| {
        let node = document.descendants().find(|node| node.has_tag_name(name));
        node.and_then(|node| node.text()).unwrap_or_default().to_string()
    };
    let (code, message) = (value("Code"), value("Message"));
    if code.is_empty() { String::new() } else { format!(" ({code}: {})", message.trim_end_matches('.')) }
}
