//! File names with a content hash.

use sha2::{Digest, Sha256};

/// Turns `style.css` into `style-<hash>.css`. The hash is the first 16 hexadecimal digits of
/// SHA-256.
pub(super) fn name(name: &str, content: &[u8]) -> String {
    let digest = hex::encode(Sha256::digest(content));
    let hash = &digest[..16];
    let file = name.rfind('/').map_or(0, |slash| slash + 1);
    match name[file..].rfind('.') {
        Some(dot) => format!("{}-{hash}{}", &name[..file + dot], &name[file + dot..]),
        None => format!("{name}-{hash}"),
    }
}

#[cfg(test)]
mod tests {
    use super::name;

    #[test]
    fn the_hash_stands_before_the_extension() {
        // printf '' | sha256sum
        let hash = "e3b0c44298fc1c14";
        assert_eq!(name("style.css", b""), format!("style-{hash}.css"));
        assert_eq!(name("a.b/LICENCE", b""), format!("a.b/LICENCE-{hash}"));
        assert_eq!(name("lib.min.js", b""), format!("lib.min-{hash}.js"));
        // printf 'a' | sha256sum
        assert_eq!(name("style.css", b"a"), "style-ca978112ca1bbdca.css");
    }
}
