//! Where the imagery comes from that the page drapes over a terrain.

use serde::{Deserialize, Serialize};

/// A template of the URLs of map tiles in Web Mercator.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ImageryUrl(String);

impl ImageryUrl {
    /// Returns the template.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for ImageryUrl {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<ImageryUrl, String> {
        let is_url = ["https://", "http://"].iter().any(|scheme| text.starts_with(scheme));
        let is_template =
            text.contains("{z}") && text.contains("{x}") && (text.contains("{y}") || text.contains("{-y}"));
        let is_plain = !text.chars().any(|c| c.is_control() || c.is_whitespace() || matches!(c, '"' | '<' | '>'));
        match is_url && is_template && is_plain {
            true => Ok(ImageryUrl(text)),
            false => Err("imagery is the URL of map tiles with {z}, {x} and {y} or {-y}, such as \
                          \"https://tiles.example.org/{z}/{x}/{y}.png\""
                .into()),
        }
    }
}

impl From<ImageryUrl> for String {
    fn from(url: ImageryUrl) -> String {
        url.0
    }
}
