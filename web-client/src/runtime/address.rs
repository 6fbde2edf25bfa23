//! Addresses of pages, and the encoding of texts in addresses.

/// The parts of an address that identify a page.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Address {
    /// Scheme and host, such as `http://127.0.0.1:8080`.
    pub origin: String,
    /// Path, such as `/s/default`.
    pub path: String,
    /// The raw query with its `?`. Empty if there is no query.
    pub search: String,
    /// The decoded query.
    pub query: Vec<(String, String)>,
    /// The fragment, without its `#`.
    pub fragment: String,
}

impl Address {
    /// The value of a query parameter.
    #[must_use]
    pub fn parameter(&self, name: &str) -> Option<&str> {
        self.query.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
    }
}

/// Percent-encodes a text for a query. Encodes everything except letters, digits and `-._~`.
#[must_use]
pub fn encoded(text: &str) -> String {
    let mut encoded = String::new();
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || b"-._~".contains(&byte) {
            encoded.push(char::from(byte));
        } else {
            encoded.push_str(&format!("%{byte:02X}"));
        }
    }
    encoded
}
