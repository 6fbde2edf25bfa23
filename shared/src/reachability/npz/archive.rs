//! Writes NumPy archives (.npz): ZIP archives of uncompressed arrays (.npy).

use crate::reachability::checksum::checksum;

/// An archive to which arrays are added one by one.
#[derive(Default)]
pub(super) struct Archive {
    bytes: Vec<u8>,
    /// The ZIP central directory, which is written last.
    contents: Vec<u8>,
    count: u16,
}

/// Element types of arrays.
pub(super) trait Number: Copy {
    /// The dtype string in NumPy's headers.
    const DTYPE: &'static str;
    /// Appends the number as little-endian bytes.
    fn push(self, bytes: &mut Vec<u8>);
}

impl Number for u8 {
    const DTYPE: &'static str = "|u1";
    fn push(self, bytes: &mut Vec<u8>) {
        bytes.push(self);
    }
}

impl Number for f32 {
    const DTYPE: &'static str = "<f4";
    fn push(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

impl Number for f64 {
    const DTYPE: &'static str = "<f8";
    fn push(self, bytes: &mut Vec<u8>) {
        bytes.extend(self.to_le_bytes());
    }
}

/// Size of a ZIP local file header without the name (bytes).
const LOCAL: usize = 30;
/// 1 January 1980, the earliest date that ZIP can represent. A fixed date makes the bytes
/// reproducible.
const DAY: u16 = 0x21;

impl Archive {
    /// Adds an array. `values` are in row-major order.
    pub(super) fn add<T: Number>(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl Iterator<Item = T>,
    ) {
        let name = format!("{name}.npy");
        let begin = self.bytes.len();
        let start = begin + LOCAL + name.len();
        self.bytes.resize(begin + LOCAL, 0);
        self.bytes.extend(name.as_bytes());
        self.bytes.reserve(shape.iter().product::<usize>() * size_of::<T>() + 128);
        self.bytes.extend(header(T::DTYPE, shape));
        values.for_each(|value| value.push(&mut self.bytes));
        let size = (self.bytes.len() - start) as u32;
        // The fields after the signature: version 2.0, no flags, no compression, time and date,
        // checksum, both sizes, name length, no extra field.
        let mut about = Vec::new();
        for half in [20, 0, 0, 0, DAY] {
            about.extend(half.to_le_bytes());
        }
        for word in [checksum(&self.bytes[start..]), size, size] {
            about.extend(word.to_le_bytes());
        }
        about.extend((name.len() as u16).to_le_bytes());
        about.extend([0; 2]);
        self.bytes[begin..begin + 4].copy_from_slice(b"PK\x03\x04");
        self.bytes[begin + 4..begin + LOCAL].copy_from_slice(&about);
        self.contents.extend(b"PK\x01\x02\x14\x00");
        self.contents.extend(about);
        // Only in the central directory: no comment, disk 0, no attributes.
        self.contents.extend([0; 10]);
        self.contents.extend((begin as u32).to_le_bytes());
        self.contents.extend(name.as_bytes());
        self.count += 1;
    }

    /// The bytes of the whole archive.
    pub(super) fn finish(mut self) -> Vec<u8> {
        let (begin, size) = (self.bytes.len() as u32, self.contents.len() as u32);
        self.bytes.append(&mut self.contents);
        self.bytes.extend(b"PK\x05\x06\0\0\0\0");
        self.bytes.extend(self.count.to_le_bytes());
        self.bytes.extend(self.count.to_le_bytes());
        self.bytes.extend(size.to_le_bytes());
        self.bytes.extend(begin.to_le_bytes());
        self.bytes.extend([0; 2]);
        self.bytes
    }
}

/// The header of an array in NumPy's format 1.0, padded to a multiple of 64 bytes.
fn header(dtype: &str, shape: &[usize]) -> Vec<u8> {
    let shape: Vec<String> = shape.iter().map(|count| format!("{count}, ")).collect();
    let shape = shape.concat();
    let mut text = format!(
        "{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({}), }}",
        shape.trim_end()
    );
    let blanks = 64 - (10 + text.len() + 1) % 64;
    text.extend(core::iter::repeat_n(' ', blanks % 64));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_aligned() {
        for shape in [&[3][..], &[65, 96, 96], &[100_000, 1, 7], &[]] {
            let header = header("<f4", shape);
            assert!(header.len().is_multiple_of(64) && header.ends_with(b"\n"));
        }
        let header = String::from_utf8_lossy(&header("<f8", &[12])[10..]).into_owned();
        assert!(header.starts_with("{'descr': '<f8', 'fortran_order': False, 'shape': (12,), }"));
    }
}
