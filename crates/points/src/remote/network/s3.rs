//! Where buckets are and who asks for them, as the environment says.

use std::sync::LazyLock;

use crate::remote::network::signature::Credentials;
use sys::{Error, Result};

/// What the environment says about S3.
#[derive(Clone)]
pub(crate) struct S3Settings {
    pub(crate) region: String,
    /// The server of S3, without a slash at its end; `None` for that of Amazon.
    pub(crate) endpoint: Option<String>,
    /// Who asks; `None` where requests are not signed.
    pub(crate) credentials: Option<Credentials>,
}

/// Where an object or the list of a bucket is.
#[derive(Debug, PartialEq)]
pub(crate) struct S3Place {
    pub(crate) scheme: String,
    pub(crate) host: String,
    /// The path, encoded.
    pub(crate) path: String,
}

static OF_PROCESS: LazyLock<std::result::Result<S3Settings, String>> =
    LazyLock::new(|| S3Settings::of(|name| std::env::var(name).ok().filter(|value| !value.is_empty())));

impl S3Settings {
    /// Returns what the environment of this process says.
    ///
    /// # Errors
    /// [`Error::Config`] if that is not enough or contradictory.
    pub(crate) fn of_process() -> Result<&'static S3Settings> {
        OF_PROCESS.as_ref().map_err(|what| Error::Config(format!("s3:// {what}")))
    }

    fn of(variable: impl Fn(&str) -> Option<String>) -> std::result::Result<S3Settings, String> {
        let is_set =
            |name| variable(name).is_some_and(|value| ["true", "1", "yes"].contains(&value.to_lowercase().as_str()));
        let endpoint = variable("AWS_ENDPOINT_URL_S3").or_else(|| variable("AWS_ENDPOINT_URL"));
        if endpoint.as_ref().is_some_and(|url| url.split_once("://").is_none_or(|(_, host)| host.contains('@'))) {
            return Err("needs a URL in AWS_ENDPOINT_URL, such as https://s3.example.org, without a password".into());
        }
        if endpoint.as_ref().is_some_and(|url| !url.starts_with("https://")) && !is_set("AWS_ALLOW_HTTP") {
            return Err("uses https:// only: set AWS_ALLOW_HTTP=true to allow an http:// AWS_ENDPOINT_URL".into());
        }
        let credentials = match (variable("AWS_ACCESS_KEY_ID"), variable("AWS_SECRET_ACCESS_KEY")) {
            _ if is_set("AWS_SKIP_SIGNATURE") => None,
            (Some(key), Some(secret)) => Some(Credentials { key, secret, token: variable("AWS_SESSION_TOKEN") }),
            _ => {
                return Err("needs AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY in the environment (with a profile or a role: \
                            `eval \"$(aws configure export-credentials --format env)\"`), or AWS_SKIP_SIGNATURE=true for a \
                            public bucket"
                    .into());
            }
        };
        let region = variable("AWS_REGION").or_else(|| variable("AWS_DEFAULT_REGION"));
        Ok(S3Settings {
            region: region.unwrap_or_else(|| "us-east-1".into()),
            endpoint: endpoint.map(|url| url.trim_end_matches('/').into()),
            credentials,
        })
    }

    /// Returns where the bucket is, or an object in it, whose key is encoded.
    pub(crate) fn place(&self, bucket: &str, key: &str) -> S3Place {
        match &self.endpoint {
            Some(endpoint) => {
                let (scheme, rest) = endpoint.split_once("://").unwrap_or(("https", endpoint));
                let (host, folder) =
                    rest.split_once('/').map_or((rest, String::new()), |(host, path)| (host, format!("/{path}")));
                S3Place { scheme: scheme.into(), host: host.into(), path: format!("{folder}/{bucket}/{key}") }
            }
            // A name with a dot is not covered by the certificate for one level.
            None if bucket.contains('.') => {
                let host = format!("s3.{}.amazonaws.com", self.region);
                S3Place { scheme: "https".into(), host, path: format!("/{bucket}/{key}") }
            }
            None => {
                let host = format!("{bucket}.s3.{}.amazonaws.com", self.region);
                S3Place { scheme: "https".into(), host, path: format!("/{key}") }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(variables: &[(&str, &str)]) -> std::result::Result<S3Settings, String> {
        S3Settings::of(|name| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| value.to_string()))
    }

    #[test]
    fn the_environment_says_who_asks_and_where() {
        let keys = [("AWS_ACCESS_KEY_ID", "a"), ("AWS_SECRET_ACCESS_KEY", "b"), ("AWS_SESSION_TOKEN", "c")];
        let found = settings(&keys).unwrap();
        assert_eq!(found.credentials.as_ref().unwrap().token.as_deref(), Some("c"));
        let place = |settings: &S3Settings, bucket| {
            let S3Place { scheme, host, path } = settings.place(bucket, "x/y.laz");
            format!("{scheme} {host} {path}")
        };
        assert_eq!(place(&found, "bucket"), "https bucket.s3.us-east-1.amazonaws.com /x/y.laz");
        assert_eq!(place(&found, "a.b"), "https s3.us-east-1.amazonaws.com /a.b/x/y.laz");
        let own = [("AWS_SKIP_SIGNATURE", "true"), ("AWS_REGION", "eu"), ("AWS_ENDPOINT_URL", "https://host:9000/s3/")];
        let found = settings(&own).unwrap();
        assert!(found.credentials.is_none() && found.region == "eu");
        assert_eq!(place(&found, "bucket"), "https host:9000 /s3/bucket/x/y.laz");
    }

    #[test]
    fn what_is_missing_is_named_without_any_value() {
        for (variables, words) in [
            (vec![], "AWS_SKIP_SIGNATURE=true"),
            (vec![("AWS_ACCESS_KEY_ID", "secret")], "AWS_SECRET_ACCESS_KEY"),
            (vec![("AWS_ENDPOINT_URL", "http://secret")], "AWS_ALLOW_HTTP=true"),
            (vec![("AWS_ENDPOINT_URL", "https://user:secret@host")], "without a password"),
            (vec![("AWS_ENDPOINT_URL", "secret")], "needs a URL"),
        ] {
            let what = settings(&variables).err().unwrap();
            assert!(what.contains(words) && !what.contains("secret"), "{what}");
        }
    }
}
