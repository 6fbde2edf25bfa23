//! The arrays of an archive.

use sidestep::invalid::Invalid;
use std::io::{self, Read, Seek};
use zip::ZipArchive;

/// Maximum number of entries of an array whose length is not given.
const SHORT: usize = 1 << 16;

/// Maximum number of bytes before an array's values.
const HEADER_LIMIT: u64 = 1 << 16;

/// The values of an array with this type and shape. Without a shape, the array must be a short
/// list. Reads no more bytes from the archive than needed.
pub(super) fn values<R: Read + Seek, T: npyz::AutoSerialize + npyz::Deserialize>(
    archive: &mut ZipArchive<R>,
    name: &str,
    shape: Option<&[usize]>,
) -> Result<Vec<T>, Invalid> {
    let broken = |e: io::Error| Invalid::new(name, "a NumPy array, whole", e);
    let file = archive
        .by_name(&format!("{name}.npy"))
        .map_err(|e| Invalid::new(name, "an array of that name", e))?;
    let count = shape.map_or(SHORT, |shape| shape.iter().product());
    let limit = (count * size_of::<T>()) as u64 + HEADER_LIMIT;
    let mut bytes = Vec::new();
    // Reading to the end of the file verifies its checksum.
    file.take(limit).read_to_end(&mut bytes).map_err(broken)?;
    let mut rest = &bytes[..];
    let array = npyz::NpyFile::new(&mut rest).map_err(broken)?;
    let wanted = T::default_dtype().descr();
    let found = array.dtype().descr();
    if found != wanted {
        return Err(Invalid::new(name, format!("dtype {wanted}"), found));
    }
    let found = array.shape().to_vec();
    let fits = match shape {
        Some(shape) => shape.iter().map(|n| *n as u64).eq(found.iter().copied()),
        None => found.len() == 1 && found[0] <= SHORT as u64,
    };
    if !fits {
        let expected = shape.map_or(format!("[up to {SHORT}]"), |shape| format!("{shape:?}"));
        return Err(Invalid::new(format!("{name}.shape"), expected, format!("{found:?}")));
    }
    if array.order() != npyz::Order::C && found.len() > 1 {
        return Err(Invalid::new(name, "row-major order", "Fortran order"));
    }
    let values = array.into_vec().map_err(broken)?;
    if !rest.is_empty() {
        return Err(Invalid::new(name, "its end", format!("{} bytes more", rest.len())));
    }
    Ok(values)
}
