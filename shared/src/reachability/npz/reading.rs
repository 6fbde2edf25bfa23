//! Reads NumPy archives of uncompressed arrays, as written by this library and by `numpy.savez`.

use crate::invalid::Invalid;
use crate::reachability::checksum::checksum;

/// The arrays of an archive.
pub(super) struct Arrays<'a>(Vec<(String, Array<'a>)>);

/// An array in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array<'a> {
    /// The dtype string in NumPy's headers, such as `<f8`.
    pub(super) dtype: String,
    pub(super) shape: Vec<usize>,
    pub(super) bytes: &'a [u8],
}

/// Sizes of ZIP records without names (bytes): end record, central-directory entry, local file
/// header.
const END: usize = 22;
const ENTRY: usize = 46;
const LOCAL: usize = 30;

impl<'a> Arrays<'a> {
    /// Reads an archive.
    ///
    /// # Errors
    /// [`Invalid`] if the bytes are not an archive of uncompressed arrays.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, Invalid> {
        let no_archive = || Invalid::new("bytes", "a NumPy archive (.npz)", "other bytes");
        // A comment of at most 2¹⁶ bytes can follow the end record. The record contains the
        // comment's length.
        let last = bytes.len().checked_sub(END).ok_or_else(no_archive)?;
        let end = (last.saturating_sub(1 << 16)..=last)
            .rev()
            .find(|&at| bytes[at..].starts_with(b"PK\x05\x06"))
            .ok_or_else(no_archive)?;
        if number(bytes, end + 20, 2) != Some(last - end) {
            let found = "bytes after its end, or too few";
            return Err(Invalid::new("bytes", "a whole NumPy archive (.npz)", found));
        }
        let count = number(bytes, end + 10, 2).ok_or_else(no_archive)?;
        let mut at = number(bytes, end + 16, 4).ok_or_else(no_archive)?;
        let mut arrays = Vec::new();
        for _ in 0..count {
            let (name, array, next) = entry(bytes, at).ok_or_else(no_archive)??;
            arrays.push((name, array));
            at = next;
        }
        Ok(Self(arrays))
    }

    /// Returns the array `name`.
    ///
    /// # Errors
    /// [`Invalid`] if the archive has no array of this name.
    pub(super) fn get(&self, name: &str) -> Result<&Array<'a>, Invalid> {
        let found = self.0.iter().find(|(it, _)| it == name);
        let names = || self.0.iter().map(|(name, _)| &name[..]).collect::<Vec<_>>().join(", ");
        found
            .map(|(_, array)| array)
            .ok_or_else(|| Invalid::new(name, "an array of this name", names()))
    }
}

impl Array<'_> {
    /// The elements of the array.
    ///
    /// # Errors
    /// [`Invalid`] naming the array, if its elements are not float64 or float32.
    pub(super) fn numbers(&self, name: &str) -> Result<Vec<f64>, Invalid> {
        match &self.dtype[..] {
            "<f8" => {
                let (numbers, _) = self.bytes.as_chunks::<8>();
                Ok(numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
            }
            "<f4" => {
                let (numbers, _) = self.bytes.as_chunks::<4>();
                Ok(numbers.iter().map(|bytes| f32::from_le_bytes(*bytes).into()).collect())
            }
            other => Err(Invalid::new(name, "an array of float64 or float32", other)),
        }
    }
}

/// The little-endian unsigned integer in the `count` bytes at offset `at`.
fn number(bytes: &[u8], at: usize, count: usize) -> Option<usize> {
    let bytes = bytes.get(at..at.checked_add(count)?)?;
    Some(bytes.iter().rev().fold(0, |number, byte| number << 8 | usize::from(*byte)))
}

/// The array of the central-directory entry at offset `at`, and the offset of the next entry.
/// Returns `None` if a record has the wrong signature or extends beyond the bytes.
fn entry(bytes: &[u8], at: usize) -> Option<Result<(String, Array<'_>, usize), Invalid>> {
    if number(bytes, at, 4)? != 0x0201_4b50 {
        return None;
    }
    let size = number(bytes, at + 20, 4)?;
    let [name, extra, comment] = [28, 30, 32].map(|field| number(bytes, at + field, 2));
    let (name_end, local) = (at + ENTRY + name?, number(bytes, at + 42, 4)?);
    let name = String::from_utf8_lossy(bytes.get(at + ENTRY..name_end)?).into_owned();
    if number(bytes, at + 10, 2)? != 0 {
        let expected = "an array that is not compressed, as numpy.savez writes it";
        return Some(Err(Invalid::new(name, expected, "a compressed one")));
    }
    if number(bytes, local, 4)? != 0x0403_4b50 {
        return None;
    }
    let start = local + LOCAL + number(bytes, local + 26, 2)? + number(bytes, local + 28, 2)?;
    let content = bytes.get(start..start.checked_add(size)?)?;
    let name = name.strip_suffix(".npy").unwrap_or(&name).to_owned();
    if number(bytes, at + 16, 4)? != checksum(content) as usize {
        let expected = "bytes that match the archive's checksum";
        return Some(Err(Invalid::new(name, expected, "damaged bytes")));
    }
    let array = match array(content) {
        Some(array) => array,
        None => {
            let expected = "an array in NumPy's format 1.0, row-major, with its header";
            return Some(Err(Invalid::new(name, expected, "other bytes")));
        }
    };
    Some(Ok((name, array, name_end + extra? + comment?)))
}

/// Parses an array in NumPy's format 1.0.
fn array(content: &[u8]) -> Option<Array<'_>> {
    let rest = content.strip_prefix(b"\x93NUMPY\x01\x00")?;
    let length = number(rest, 0, 2)?;
    let header = core::str::from_utf8(rest.get(2..2 + length)?).ok()?;
    let bytes = rest.get(2 + length..)?;
    let after = |key: &str| header.split_once(key).map(|(_, value)| value.trim_start());
    let dtype = after("'descr':")?.strip_prefix('\'')?.split_once('\'')?.0.to_owned();
    if !after("'fortran_order':")?.starts_with("False") {
        return None;
    }
    let (shape, _) = after("'shape':")?.strip_prefix('(')?.split_once(')')?;
    let sides = shape.split(',').map(str::trim).filter(|side| !side.is_empty());
    let shape: Vec<usize> = sides.map(|side| side.parse().ok()).collect::<Option<_>>()?;
    let size: usize = dtype.get(2..)?.parse().ok()?;
    let needed = shape.iter().try_fold(size, |bytes, side| bytes.checked_mul(*side))?;
    (needed == bytes.len()).then_some(Array { dtype, shape, bytes })
}
