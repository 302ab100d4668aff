//! The names that a browser may know this machine by.
//!
//! Any page on the web could give its own name the address of this server and then read the files: the browser takes both for one site. The
//! Host header still tells that name. An address cannot be taken over like that, and the names of this machine are not the page's.

use std::fmt;
use std::net::IpAddr;

/// The names that the server answers to, besides localhost and all addresses.
pub(super) struct Hosts {
    names: Vec<String>,
}

impl Hosts {
    /// Returns the names of this machine and those that the user has `added`.
    pub(super) fn new(added: &[String]) -> Hosts {
        let own = gethostname::gethostname().to_string_lossy().into_owned();
        Hosts::with_own(&own, added)
    }

    fn with_own(own: &str, added: &[String]) -> Hosts {
        let short = own.split('.').next().unwrap_or(own);
        // Networks without a name server know machines by the last of these.
        let names = [own.to_owned(), short.to_owned(), format!("{short}.local")];
        let mut names: Vec<String> = if short.is_empty() { Vec::new() } else { names.into() };
        names.extend_from_slice(added);
        names.dedup();
        Hosts { names }
    }

    /// Tells whether a request with this Host header may be answered. The port may be another one, if it is forwarded from another machine.
    pub(super) fn answer_to(&self, header: Option<&str>) -> bool {
        let Some(host) = header else { return false };
        let name = match host.rsplit_once(':') {
            Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) && !name.ends_with(':') => name,
            _ => host,
        };
        let is_address = name.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>().is_ok();
        let name = name.strip_suffix('.').unwrap_or(name);
        let is_name = |known: &String| name.eq_ignore_ascii_case(known);
        is_address || name.eq_ignore_ascii_case("localhost") || self.names.iter().any(is_name)
    }
}

impl fmt::Display for Hosts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "localhost, IP addresses")?;
        self.names.iter().try_for_each(|name| write!(f, ", {name}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_this_machine_and_addresses_are_answered() {
        let hosts = Hosts::with_own("ws7.example.org", &["Maps.Example.com".into()]);
        for host in [
            "localhost",
            "LOCALHOST:8080",
            "localhost.:1",
            "127.0.0.1:1",
            "192.0.2.1",
            "[::1]:99",
            "[2001:db8::1]",
            "WS7:8080",
            "ws7.local",
            "ws7.example.org:80",
            "maps.example.com",
        ] {
            assert!(hosts.answer_to(Some(host)), "{host}");
        }
    }

    #[test]
    fn names_that_a_page_may_have_given_itself_are_not() {
        let hosts = Hosts::with_own("ws7.example.org", &[]);
        for host in [
            "evil.example",
            "evil.example:8080",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "ws7.evil.example",
            "ws7.example.org.evil.example",
            "",
            ".",
            ":1",
        ] {
            assert!(!hosts.answer_to(Some(host)), "{host}");
        }
        assert!(!hosts.answer_to(None));
        assert!(!Hosts::with_own("", &[]).answer_to(Some("")), "a machine without a name");
    }
}
