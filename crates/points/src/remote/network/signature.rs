//! Signatures of requests to S3: AWS Signature Version 4, as "Authenticating Requests: Using the Authorization Header" in the
//! documentation of S3 describes it.

use std::time::{SystemTime, UNIX_EPOCH};

use chrono::DateTime;
use ring::{digest, hmac};

/// The hash of the empty body that every request here has.
const EMPTY_BODY: &str = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";

const ALGORITHM: &str = "AWS4-HMAC-SHA256";

/// Who asks. Nothing prints or writes it.
#[derive(Clone)]
pub(crate) struct Credentials {
    pub(crate) key: String,
    pub(crate) secret: String,
    /// The token of a session that ends.
    pub(crate) token: Option<String>,
}

/// A request that is to be signed.
pub(crate) struct UnsignedRequest<'a> {
    pub(crate) host: &'a str,
    /// The path with all its bytes encoded as in the URL.
    pub(crate) path: &'a str,
    /// The query, encoded, with its parameters in the order of their names.
    pub(crate) query: &'a str,
    /// More headers, with names in lower case.
    pub(crate) headers: &'a [(&'static str, String)],
}

impl UnsignedRequest<'_> {
    /// Returns the headers that sign this request to a bucket in `region`, besides those that it has.
    pub(crate) fn sign(&self, who: &Credentials, region: &str, now: SystemTime) -> Vec<(&'static str, String)> {
        let seconds = now.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs() as i64);
        let time = DateTime::from_timestamp(seconds, 0).unwrap_or_default().format("%Y%m%dT%H%M%SZ").to_string();
        let scope = format!("{}/{region}/s3/aws4_request", &time[..8]);
        let mut added = vec![("x-amz-content-sha256", EMPTY_BODY.to_string()), ("x-amz-date", time.clone())];
        added.extend(who.token.iter().map(|token| ("x-amz-security-token", token.clone())));
        let host = [("host", self.host.to_string())];
        let mut signed: Vec<&(&str, String)> = host.iter().chain(self.headers).chain(&added).collect();
        signed.sort_unstable();
        let lines: String = signed.iter().map(|(name, value)| format!("{name}:{}\n", value.trim())).collect();
        let names = signed.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(";");
        let request = format!("GET\n{}\n{}\n{lines}\n{names}\n{EMPTY_BODY}", self.path, self.query);
        let text = format!(
            "{ALGORITHM}\n{time}\n{scope}\n{}",
            hexadecimal(digest::digest(&digest::SHA256, request.as_bytes()).as_ref())
        );
        let mut key = format!("AWS4{}", who.secret).into_bytes();
        for part in [&time[..8], region, "s3", "aws4_request", &text] {
            key = hmac::sign(&hmac::Key::new(hmac::HMAC_SHA256, &key), part.as_bytes()).as_ref().to_vec();
        }
        let (who, signature) = (&who.key, hexadecimal(&key));
        added.push((
            "authorization",
            format!("{ALGORITHM} Credential={who}/{scope},SignedHeaders={names},Signature={signature}"),
        ));
        added
    }
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Encodes a text for a URL as signatures want it: every byte but letters, digits, `-._~` and those of `kept`.
pub(crate) fn encoded(text: &str, kept: &str) -> String {
    let byte = |byte: u8| match byte {
        b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => char::from(byte).to_string(),
        byte if kept.as_bytes().contains(&byte) => char::from(byte).to_string(),
        byte => format!("%{byte:02X}"),
    };
    text.bytes().map(byte).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// The examples of the documentation are of midnight on 24 May 2013.
    const THEN: Duration = Duration::from_secs(1_369_353_600);

    fn signature(query: &str, path: &str, headers: &[(&'static str, String)]) -> String {
        let who = Credentials {
            key: "AKIAIOSFODNN7EXAMPLE".into(),
            secret: "wJalrXUtnFEMI/K7MDENG/bPxRfiCYEXAMPLEKEY".into(),
            token: None,
        };
        let request = UnsignedRequest { host: "examplebucket.s3.amazonaws.com", path, query, headers };
        let signed = request.sign(&who, "us-east-1", UNIX_EPOCH.checked_add(THEN).unwrap());
        let (_, value) = signed.into_iter().find(|(name, _)| *name == "authorization").unwrap();
        value.rsplit_once('=').unwrap().1.into()
    }

    #[test]
    fn signatures_are_those_of_the_documentation() {
        assert_eq!(
            signature("", "/test.txt", &[("range", "bytes=0-9".into())]),
            "f0e8bdb87c964420e857bd35b5d6ed310bd44f0170aba48dd91039c6036bdb41"
        );
        assert_eq!(
            signature("max-keys=2&prefix=J", "/", &[]),
            "34b48302e7b5fa45bde8084f4b7868a86f0a534bc59db6670ed5711ef69dc6f7"
        );
    }

    #[test]
    fn keys_are_encoded_byte_by_byte() {
        assert_eq!(encoded("a/b c+d~é", "/"), "a/b%20c%2Bd~%C3%A9");
        assert_eq!(encoded("a/b", ""), "a%2Fb");
    }
}
