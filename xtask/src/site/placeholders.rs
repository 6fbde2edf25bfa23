//! Replaces placeholders in a page, such as `{{style.css}}`, by the paths of the assets.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, bail};

/// A text after its placeholders were replaced.
#[derive(Debug, PartialEq)]
pub(super) struct Filled {
    /// The text.
    pub(super) text: String,
    /// The asset names in its placeholders.
    pub(super) used: BTreeSet<String>,
}

/// Replaces each placeholder in the file `static/<file>` by `/` and the asset's path in `assets`.
///
/// # Errors
/// If a placeholder is unknown or unterminated. The error names the file, the line and the
/// placeholder.
pub(super) fn fill(file: &str, source: &str, assets: &BTreeMap<String, String>) -> Result<Filled> {
    let mut text = String::with_capacity(source.len());
    let mut used = BTreeSet::new();
    let mut rest = source;
    while let Some((before, after)) = rest.split_once("{{") {
        let line = source[..source.len() - after.len()].lines().count();
        let Some((inside, following)) = after.split_once("}}") else {
            bail!("static/{file}:{line}: expected }}}} after {{{{, found the end of the file");
        };
        let name = inside.trim();
        let Some(path) = assets.get(name) else {
            let known: Vec<&str> = assets.keys().map(String::as_str).collect();
            bail!(
                "static/{file}:{line}: {{{{{name}}}}} is no asset: expected one of {}",
                known.join(", ")
            );
        };
        text += before;
        text.push('/');
        text += path;
        used.insert(name.to_owned());
        rest = following;
    }
    text += rest;
    Ok(Filled { text, used })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(source: &str) -> Result<Filled> {
        let assets = [("style.css", "assets/style-1.css"), ("a.js", "assets/a-2.js")];
        let assets = assets.map(|(name, path)| (name.to_owned(), path.to_owned()));
        fill("index.html", source, &assets.into())
    }

    #[test]
    fn each_is_replaced_and_noted() {
        let filled = filled("<{{style.css}}> <{{ a.js }}> <{{a.js}}> {b} }}").expect("valid");
        assert_eq!(filled.text, "</assets/style-1.css> </assets/a-2.js> </assets/a-2.js> {b} }}");
        assert_eq!(filled.used, ["a.js", "style.css"].map(String::from).into());
    }

    #[test]
    fn errors_name_file_line_and_placeholder() {
        let error = filled("one\n{{style.css}}\n{{styl.css}}").expect_err("a slip");
        assert_eq!(
            error.to_string(),
            "static/index.html:3: {{styl.css}} is no asset: expected one of a.js, style.css"
        );
        let error = filled("\n{{style.css").expect_err("unfinished");
        assert!(error.to_string().starts_with("static/index.html:2: "), "{error}");
    }
}
