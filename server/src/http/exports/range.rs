//! The requested byte range of an archive.

use axum::http::HeaderMap;
use axum::http::header::{HeaderName, IF_MATCH, IF_NONE_MATCH, IF_RANGE, RANGE};

/// The content that a request asks for, given the tag of the current data.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// The whole archive.
    Whole,
    /// A part of the archive.
    Part(Bytes),
    /// Nothing, because the client has the current data.
    Known,
    /// Data that are no longer current.
    Other,
}

/// A byte range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Bytes {
    /// From the first byte to the last byte, both inclusive. `None` means the end of the archive.
    From(u64, Option<u64>),
    /// A number of bytes at the end.
    Last(u64),
}

impl Wanted {
    /// Parses the headers. Multiple ranges, and units other than bytes, are treated as a request
    /// for the whole archive.
    pub(super) fn of(headers: &HeaderMap, tag: &str) -> Self {
        let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
        let names =
            |list: &str| list.split(',').any(|one| matches!(one.trim(), "*") || one.trim() == tag);
        if text(IF_MATCH).is_some_and(|list| !names(list)) {
            return Self::Other;
        }
        if text(IF_NONE_MATCH).is_some_and(names) {
            return Self::Known;
        }
        if text(IF_RANGE).is_some_and(|known| known != tag) {
            return Self::Whole;
        }
        match text(RANGE).and_then(Bytes::parse) {
            Some(range) => Self::Part(range),
            None => Self::Whole,
        }
    }
}

impl Bytes {
    fn parse(text: &str) -> Option<Self> {
        let (first, last) = text.trim().strip_prefix("bytes=")?.split_once('-')?;
        let number = |text: &str| text.trim().parse::<u64>().ok();
        match (first.trim(), last.trim()) {
            ("", last) => Some(Self::Last(number(last)?)),
            (first, "") => Some(Self::From(number(first)?, None)),
            (first, last) => {
                let (first, last) = (number(first)?, number(last)?);
                (first <= last).then_some(Self::From(first, Some(last)))
            }
        }
    }

    /// The index of the first byte, and the index after the last byte, in an archive of this
    /// length. `None` if the range is outside the archive.
    pub(super) fn within(self, length: u64) -> Option<(u64, u64)> {
        let (begin, end) = match self {
            Self::From(first, last) => {
                (first, last.map_or(length, |last| last.saturating_add(1).min(length)))
            }
            Self::Last(count) => (length.saturating_sub(count), length),
        };
        (begin < end).then_some((begin, end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    #[test]
    fn ranges_and_conditions() {
        let tag = "\"a\"";
        let part = |first, last| Wanted::Part(Bytes::From(first, last));
        let table: [(&[(HeaderName, &str)], Wanted); 14] = [
            (&[], Wanted::Whole),
            (&[(RANGE, "bytes=5-")], part(5, None)),
            (&[(RANGE, "bytes=5-9")], part(5, Some(9))),
            (&[(RANGE, "bytes=-9")], Wanted::Part(Bytes::Last(9))),
            (&[(RANGE, "bytes=9-5")], Wanted::Whole),
            (&[(RANGE, "bytes=1-2,5-6")], Wanted::Whole),
            (&[(RANGE, "lines=1-2")], Wanted::Whole),
            (&[(RANGE, "bytes=5-"), (IF_RANGE, tag)], part(5, None)),
            (&[(RANGE, "bytes=5-"), (IF_RANGE, "\"b\"")], Wanted::Whole),
            (&[(RANGE, "bytes=5-"), (IF_RANGE, "W/\"a\"")], Wanted::Whole),
            (&[(RANGE, "bytes=5-"), (IF_MATCH, "\"b\", \"a\"")], part(5, None)),
            (&[(RANGE, "bytes=5-"), (IF_MATCH, "\"b\"")], Wanted::Other),
            (&[(IF_NONE_MATCH, tag)], Wanted::Known),
            (&[(IF_NONE_MATCH, "\"b\"")], Wanted::Whole),
        ];
        for (headers, wanted) in table {
            let headers = headers
                .iter()
                .map(|(name, value)| (name.clone(), HeaderValue::from_str(value).unwrap()))
                .collect();
            assert_eq!(Wanted::of(&headers, tag), wanted, "{headers:?}");
        }
        assert_eq!(Bytes::From(5, None).within(9), Some((5, 9)));
        assert_eq!(Bytes::From(5, Some(99)).within(9), Some((5, 9)));
        assert_eq!(Bytes::From(5, Some(6)).within(9), Some((5, 7)));
        assert_eq!(Bytes::From(9, None).within(9), None);
        assert_eq!(Bytes::Last(4).within(9), Some((5, 9)));
        assert_eq!(Bytes::Last(40).within(9), Some((0, 9)));
        assert_eq!(Bytes::Last(0).within(9), None);
    }
}
