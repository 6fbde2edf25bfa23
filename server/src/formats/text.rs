//! Decodes texts from editors and spreadsheets: UTF-8, UTF-16 with a byte-order mark, or Windows-1252
//! if no other encoding is likely.

use std::borrow::Cow;
use std::io::{self, Chain, Cursor, Read};

/// The encoding of a text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoding {
    /// UTF-8, with or without byte-order mark.
    #[default]
    Utf8,
    /// UTF-16 with byte-order mark.
    Utf16,
    /// Windows-1252, which includes Latin-1.
    Windows1252,
}

impl Encoding {
    /// A remark for the user if a text is not UTF-8.
    #[must_use]
    pub fn remark(self) -> Option<&'static str> {
        match self {
            Self::Utf8 => None,
            Self::Utf16 => Some("UTF-16"),
            Self::Windows1252 => Some("Windows-1252 (Latin-1)"),
        }
    }
}

/// Advice to the user for a text that cannot be read.
const WAY_OUT: &str = "save the file as UTF-8";

/// The byte-order mark of UTF-8.
pub const MARK: &[u8] = b"\xef\xbb\xbf";

/// Decodes bytes piece by piece. All pieces must be UTF-8, or all must be Windows-1252.
#[derive(Clone, Copy, Debug, Default)]
pub struct Decoder {
    /// The encoding, known once a piece contains more than ASCII.
    known: Option<Encoding>,
}

impl Decoder {
    /// The encoding of the pieces so far.
    #[must_use]
    pub fn encoding(self) -> Encoding {
        self.known.unwrap_or_default()
    }

    /// Decodes a piece that contains only whole characters.
    ///
    /// # Errors
    /// A description of the invalid bytes, with advice.
    pub fn text<'a>(&mut self, bytes: &'a [u8]) -> Result<Cow<'a, str>, String> {
        let (read, text) = match std::str::from_utf8(bytes) {
            Ok(text) if text.is_ascii() => return Ok(Cow::Borrowed(text)),
            Ok(text) => (Encoding::Utf8, Cow::Borrowed(text)),
            Err(error) => {
                let first = bytes.get(error.valid_up_to()).copied().unwrap_or_default();
                let text = windows_1252(bytes).ok_or_else(|| {
                    format!("a byte 0x{first:02x}, which is not UTF-8; {WAY_OUT}")
                })?;
                (Encoding::Windows1252, Cow::Owned(text))
            }
        };
        match *self.known.get_or_insert(read) == read {
            true => Ok(text),
            false => Err(format!("UTF-8 and another encoding in one file; {WAY_OUT}")),
        }
    }
}

/// Decodes Windows-1252. Returns `None` if another encoding is likely.
///
/// Letters from 0xC0 on and signs from 0xA0 on are as in Latin-1. From 0x80 to 0x9F, only quotation
/// marks, dashes, the ellipsis, the bullet and the euro sign are accepted. In this range, the
/// encodings of DOS and old Macintoshes have ä, ö, ü and é, and Windows-1252 has letters that are
/// rare in the languages that use it. In these languages, three accented letters in a row, or a
/// sign between two letters, never occur. So a text with such a sequence is in another alphabet.
fn windows_1252(bytes: &[u8]) -> Option<String> {
    let character = |byte: &u8| match byte {
        0x80 => Some('€'),
        0x82 => Some('‚'),
        0x84 => Some('„'),
        0x85 => Some('…'),
        0x91 => Some('‘'),
        0x92 => Some('’'),
        0x93 => Some('“'),
        0x94 => Some('”'),
        0x95 => Some('•'),
        0x96 => Some('–'),
        0x97 => Some('—'),
        // 0xff is ÿ, which is rare in names but common in binary data.
        0x00 | 0x7f..=0x9f | 0xff => None,
        other => Some(char::from(*other)),
    };
    let text: Vec<char> = bytes.iter().map(character).collect::<Option<_>>()?;
    let is_likely = |at: usize| {
        let beside = |at: Option<usize>| at.and_then(|at| text.get(at)).copied().unwrap_or(' ');
        let [before, after] = [at.checked_sub(1), Some(at + 1)].map(beside);
        let [is_before, is_after] = [before, after].map(char::is_alphabetic);
        match text[at] {
            // If no letter is adjacent, this byte is the euro sign of old Macintoshes.
            'Û' => is_before || is_after,
            letter if letter.is_alphabetic() && !"ªºµ".contains(letter) => true,
            '’' | '´' | '·' => true,
            _ => !(is_before && is_after),
        }
    };
    let others = |run: &[char]| run.iter().filter(|c| c.is_alphabetic()).count();
    let words = text.split(|c: &char| c.is_ascii());
    let has_rows = words.into_iter().any(|run| others(run) > 2);
    let is_all_likely = (0..text.len()).all(|at| text[at].is_ascii() || is_likely(at));
    (is_all_likely && !has_rows).then(|| text.into_iter().collect())
}

/// Decodes a whole text and removes the byte-order mark. Also returns the encoding.
///
/// # Errors
/// A description of the invalid bytes, with advice.
pub fn whole(bytes: &[u8]) -> Result<(String, Encoding), String> {
    let (mut reader, is_wide) = opened(bytes).map_err(|error| error.to_string())?;
    if is_wide {
        let mut text = String::new();
        reader.read_to_string(&mut text).map_err(|error| error.to_string())?;
        return Ok((text, Encoding::Utf16));
    }
    let mut decoder = Decoder::default();
    let text = decoder.text(bytes.strip_prefix(MARK).unwrap_or(bytes))?.into_owned();
    Ok((text, decoder.encoding()))
}

/// The bytes of a file. A UTF-16 file with a byte-order mark is converted to UTF-8. Also returns
/// whether it was converted.
///
/// # Errors
/// If the first bytes cannot be read.
pub fn opened<R: Read>(mut file: R) -> io::Result<(TextBytes<R>, bool)> {
    let mut first = Vec::new();
    file.by_ref().take(2).read_to_end(&mut first)?;
    let unit = match &first[..] {
        [0xff, 0xfe] => u16::from_le_bytes,
        [0xfe, 0xff] => u16::from_be_bytes,
        _ => return Ok((TextBytes::AsTheyAre(Cursor::new(first).chain(file)), false)),
    };
    let wide = Wide { file, unit, bytes: Vec::new(), text: Cursor::default() };
    Ok((TextBytes::Wide(Box::new(wide)), true))
}

/// The bytes of a text.
pub enum TextBytes<R> {
    /// Unchanged bytes in an encoding other than UTF-16.
    AsTheyAre(Chain<Cursor<Vec<u8>>, R>),
    /// UTF-16, converted to UTF-8.
    Wide(Box<Wide<R>>),
}

impl<R: Read> Read for TextBytes<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::AsTheyAre(file) => file.read(buffer),
            Self::Wide(wide) => wide.read(buffer),
        }
    }
}

/// A reader that converts a text of 16-bit units to UTF-8.
pub struct Wide<R> {
    file: R,
    unit: fn([u8; 2]) -> u16,
    /// Bytes that were read but not decoded yet.
    bytes: Vec<u8>,
    /// The decoded text, as UTF-8.
    text: Cursor<Vec<u8>>,
}

/// Maximum number of bytes that are decoded at a time.
const PIECE: u64 = 1 << 16;

impl<R: Read> Read for Wide<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let count = self.text.read(buffer)?;
            if count > 0 || buffer.is_empty() {
                return Ok(count);
            }
            let is_end = self.file.by_ref().take(PIECE).read_to_end(&mut self.bytes)? == 0;
            if is_end && self.bytes.is_empty() {
                return Ok(0);
            }
            self.decode(is_end)?;
        }
    }
}

impl<R> Wide<R> {
    /// Decodes the buffered bytes. Keeps an incomplete unit or character at the end for the next
    /// call.
    fn decode(&mut self, is_end: bool) -> io::Result<()> {
        let (pairs, _) = self.bytes.as_chunks::<2>();
        let mut units: Vec<u16> = pairs.iter().map(|&pair| (self.unit)(pair)).collect();
        // Keep the first half of a surrogate pair until the second half is read.
        if !is_end && units.last().is_some_and(|unit| (0xd800..0xdc00).contains(unit)) {
            units.pop();
        }
        let half = || {
            let what = format!("UTF-16 with half a character; {WAY_OUT}");
            io::Error::new(io::ErrorKind::InvalidData, what)
        };
        let text = String::from_utf16(&units).map_err(|_| half())?;
        self.bytes.drain(..2 * units.len());
        if is_end && !self.bytes.is_empty() {
            return Err(half());
        }
        self.text = Cursor::new(text.into_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn utf_16(text: &str, bytes: fn(u16) -> [u8; 2]) -> Vec<u8> {
        "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(bytes).collect()
    }

    #[test]
    fn texts_are_read_in_the_encoding_that_they_have() {
        let text = "Größe: 3 µm – “ok” 😀";
        let read = |bytes: &[u8]| whole(bytes).unwrap();
        assert_eq!(read(text.as_bytes()), (text.to_owned(), Encoding::Utf8));
        assert_eq!(read(&[MARK, text.as_bytes()].concat()), (text.to_owned(), Encoding::Utf8));
        for bytes in [utf_16(text, u16::to_le_bytes), utf_16(text, u16::to_be_bytes)] {
            assert_eq!(read(&bytes), (text.to_owned(), Encoding::Utf16));
        }
        // The bytes are from the table of Windows-1252.
        let bytes = b"Gr\xf6\xdfe: 3 \xb5m \x96 \x93ok\x94 \x80";
        assert_eq!(read(bytes), ("Größe: 3 µm – “ok” €".to_owned(), Encoding::Windows1252));
        let french = b"cr\xe9\xe9e \xe0 l\x92\xe9cole, na\xefvet\xe9 : \xab oui \xbb, 5 \xb0C";
        let words = "créée à l’école, naïveté : « oui », 5 °C";
        assert_eq!(read(french), (words.to_owned(), Encoding::Windows1252));
        assert_eq!(read(b""), (String::new(), Encoding::Utf8));
        assert_eq!(read(b"a"), ("a".to_owned(), Encoding::Utf8));
    }

    #[test]
    fn what_may_be_another_encoding_is_refused_with_the_way_out() {
        let check = |bytes: &[u8], words: &str| {
            let said = whole(bytes).unwrap_err();
            assert!(said.contains(words) && said.ends_with("; save the file as UTF-8"), "{said}");
        };
        check(b"f\x81r", "0x81");
        // This is "für" on an old Macintosh, with "Ÿ" in Windows-1252.
        check(b"f\x9fr", "0x9f");
        check(
            "Größe"
                .as_bytes()
                .iter()
                .copied()
                .chain(*b"Gr\xf6\xdfe")
                .collect::<Vec<_>>()
                .as_slice(),
            "0xf6",
        );
        // Russian, Chinese and Polish text, then Spanish text and the euro sign from an old Macintosh.
        check(b"\xcf\xf0\xe8\xe2\xe5\xf2", "0xcf");
        check(b"title = \"\xb1\xdc\xbf\xaa\xbb\xfa\"", "0xb1");
        check(b"Za\xbf\xf3\xb3\xe6", "0xbf");
        check(b"Evitaci\x97n", "0x97");
        check(b"Preis: 5 \xdb", "0xdb");
        check(b"\xff\xfe\x00\xd8a\x00", "half a character");
        check(b"\xff\xfea", "half a character");
        check(b"a\xff\x00", "0xff");
        let mut decoder = Decoder::default();
        decoder.text("ö".as_bytes()).unwrap();
        let mixed = decoder.text(b"\xf6").unwrap_err();
        assert_eq!(mixed, "UTF-8 and another encoding in one file; save the file as UTF-8");
    }

    /// A reader that returns one byte at a time.
    struct Slow<'a>(&'a [u8]);

    impl Read for Slow<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let count = self.0.len().min(buffer.len()).min(1);
            self.0.read(&mut buffer[..count])
        }
    }

    proptest! {
        #[test]
        fn every_text_comes_through(text in any::<String>(), repeat in 1usize..3) {
            // The text is long enough for several decoding steps.
            let text = text.repeat(repeat) + &"😀".repeat(20_000 * (repeat - 1));
            for bytes in [utf_16(&text, u16::to_le_bytes), utf_16(&text, u16::to_be_bytes)] {
                prop_assert_eq!(&whole(&bytes).unwrap().0, &text);
                let (mut reader, is_wide) = opened(Slow(&bytes[..bytes.len().min(400) & !1])).unwrap();
                let mut found = String::new();
                let _ = reader.read_to_string(&mut found);
                prop_assert!(is_wide && text.starts_with(&found));
            }
        }
    }
}
