//! Writes the site and compressed copies of each file, then replaces the old site.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::thread;

use anyhow::{Context, Result, anyhow};
use brotli::enc::backward_references::BrotliEncoderMode;

use super::Files;

/// Writes each of `files` into `folder`, with `.br` and `.gz` copies beside it.
///
/// Writes the new site next to the old one and then swaps the folders, so that a running server
/// never sees a partial site. Reuses the compressed copies of unchanged files. Returns the
/// brotli-compressed size of each file, in bytes.
///
/// # Errors
/// When a file cannot be written.
pub(crate) fn publish(files: &Files, folder: &Path) -> Result<BTreeMap<String, usize>> {
    let parent = folder.parent().context("the site needs a parent folder")?;
    fs::create_dir_all(parent).with_context(|| cannot_write(parent))?;
    let lock_file = folder.with_extension("lock");
    let lock = File::create(&lock_file).with_context(|| cannot_write(&lock_file))?;
    lock.lock().with_context(|| format!("cannot lock {}", lock_file.display()))?;

    let fresh = folder.with_extension("new");
    remove(&fresh)?;
    for path in files.keys() {
        let file = fresh.join(path);
        let parent = file.parent().unwrap_or(&fresh);
        fs::create_dir_all(parent).with_context(|| cannot_write(parent))?;
    }
    // One thread per file, because there are only about a dozen files.
    let sizes = thread::scope(|scope| {
        let fresh = &fresh;
        let threads = files.iter().map(|(path, content)| {
            scope.spawn(move || Ok((path.clone(), write(fresh, folder, path, content)?)))
        });
        let threads: Vec<thread::ScopedJoinHandle<'_, Result<_>>> = threads.collect();
        let panicked = |_| anyhow!("a thread of xtask panicked: see its message above");
        threads.into_iter().map(|thread| thread.join().map_err(panicked)?).collect::<Result<_>>()
    })?;

    let old = folder.with_extension("old");
    remove(&old)?;
    if folder.exists() {
        fs::rename(folder, &old).with_context(|| cannot_write(folder))?;
    }
    fs::rename(&fresh, folder).with_context(|| cannot_write(folder))?;
    remove(&old)?;
    Ok(sizes)
}

/// Writes one file and its compressed copies, and returns its brotli-compressed size.
fn write(fresh: &Path, previous: &Path, path: &str, content: &[u8]) -> Result<usize> {
    put(&fresh.join(path), content)?;
    let is_unchanged = fs::read(previous.join(path)).is_ok_and(|old| old == content);
    let encoded = |extension: &str, encode: fn(&[u8]) -> Result<Vec<u8>>| -> Result<usize> {
        let name = format!("{path}.{extension}");
        let kept = is_unchanged.then(|| fs::read(previous.join(&name)).ok());
        let bytes = match kept.flatten() {
            Some(bytes) => bytes,
            None => encode(content)?,
        };
        put(&fresh.join(&name), &bytes)?;
        Ok(bytes.len())
    };
    encoded("gz", gzip)?;
    encoded("br", brotli)
}

/// Compresses with brotli at its highest quality, in two modes, and returns the smaller result. The
/// default mode suits text. The other mode suits programs, where a byte depends on the high bits of
/// the preceding bytes.
fn brotli(content: &[u8]) -> Result<Vec<u8>> {
    let usual = brotli::enc::BrotliEncoderParams {
        quality: 11,
        size_hint: content.len(),
        ..Default::default()
    };
    let of_programs = brotli::enc::BrotliEncoderParams {
        mode: BrotliEncoderMode::BROTLI_FORCE_MSB_PRIOR,
        lgblock: 16,
        ..usual.clone()
    };
    let encode = |parameters: &brotli::enc::BrotliEncoderParams| -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        brotli::BrotliCompress(&mut &content[..], &mut bytes, parameters)
            .context("brotli cannot compress this")?;
        Ok(bytes)
    };
    let (usual, of_programs) = (encode(&usual)?, encode(&of_programs)?);
    Ok(if of_programs.len() < usual.len() { of_programs } else { usual })
}

/// Gzip at its highest level, without a timestamp, so that the output is deterministic.
fn gzip(content: &[u8]) -> Result<Vec<u8>> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(content)?;
    Ok(encoder.finish()?)
}

/// Writes one file.
fn put(file: &Path, bytes: &[u8]) -> Result<()> {
    fs::write(file, bytes).with_context(|| cannot_write(file))
}

/// Removes a folder, if it exists.
fn remove(folder: &PathBuf) -> Result<()> {
    if folder.exists() {
        fs::remove_dir_all(folder).with_context(|| cannot_write(folder))?;
    }
    Ok(())
}

/// The error message for a file or folder that cannot be written.
fn cannot_write(path: &Path) -> String {
    format!("cannot write {}: check its permissions and the space left", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(list: &[(&str, &str)]) -> Files {
        let owned = |(path, text): &(&str, &str)| ((*path).into(), text.as_bytes().into());
        list.iter().map(owned).collect()
    }

    #[test]
    fn a_new_site_takes_the_place_of_the_old_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let site = folder.path().join("site");
        publish(&files(&[("index.html", "1"), ("assets/a.js", "a")]), &site).expect("written");
        publish(&files(&[("index.html", "2"), ("assets/b.js", "b")]), &site).expect("written");

        let mut names: Vec<_> = fs::read_dir(site.join("assets"))
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name())
            .collect();
        names.sort();
        assert_eq!(names, ["b.js", "b.js.br", "b.js.gz"]);
        assert_eq!(fs::read(site.join("index.html")).expect("a page"), b"2");
        assert!(!site.with_extension("new").exists() && !site.with_extension("old").exists());
    }

    #[test]
    fn compressed_files_hold_the_same_content() {
        let folder = tempfile::tempdir().expect("a folder");
        let site = folder.path().join("site");
        let text = "heading ".repeat(100);
        let sizes = publish(&files(&[("index.html", &text)]), &site).expect("written");

        let br = fs::read(site.join("index.html.br")).expect("brotli");
        assert_eq!(sizes["index.html"], br.len());
        let mut plain = Vec::new();
        brotli::BrotliDecompress(&mut &br[..], &mut plain).expect("valid brotli");
        assert_eq!(plain, text.as_bytes());

        let gz = fs::read(site.join("index.html.gz")).expect("gzip");
        let mut plain = flate2::write::GzDecoder::new(Vec::new());
        plain.write_all(&gz).expect("valid gzip");
        assert_eq!(plain.finish().expect("complete gzip"), text.as_bytes());
    }

    #[test]
    fn only_what_changed_is_compressed_again() {
        let folder = tempfile::tempdir().expect("a folder");
        let site = folder.path().join("site");
        publish(&files(&[("same", "1"), ("other", "1")]), &site).expect("written");
        // Markers that show which files are reused.
        for name in ["same.br", "other.br"] {
            fs::write(site.join(name), "kept").expect("written");
        }
        publish(&files(&[("same", "1"), ("other", "2")]), &site).expect("written");
        assert_eq!(fs::read(site.join("same.br")).expect("a file"), b"kept");
        assert_ne!(fs::read(site.join("other.br")).expect("a file"), b"kept");
    }
}
