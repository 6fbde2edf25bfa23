//! The arrays of an archive.

use npyz::WriterBuilder;
use sidestep::invalid::Invalid;
use std::io::{self, Read, Seek, Write};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Most entries of an array of unknown length.
const SHORT: usize = 1 << 16;

/// Most bytes before an array's values.
const HEADER_LIMIT: u64 = 1 << 16;

/// Adds an array to the archive.
pub(super) fn array<T: npyz::AutoSerialize>(
    archive: &mut ZipWriter<impl Write + Seek>,
    name: &str,
    shape: &[usize],
    values: impl Iterator<Item = T>,
) -> io::Result<()> {
    let bytes = shape.iter().product::<usize>() as u64 * size_of::<T>() as u64;
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(bytes > u64::from(u32::MAX) / 2);
    archive.start_file(format!("{name}.npy"), options)?;
    let shape: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
    let mut writer =
        npyz::WriteOptions::new().default_dtype().shape(&shape).writer(archive).begin_nd()?;
    writer.extend(values)?;
    writer.finish()
}

/// The values of an array with this type and shape (a short list without a shape). No more bytes are read
/// from the archive than needed.
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
    // Read to the end, where the checksum is compared.
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
