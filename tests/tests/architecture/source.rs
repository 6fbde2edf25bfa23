//! Source files as the compiler sees them: tokens, without comments and tests.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// The content of a file outside its tests.
pub(crate) struct Source {
    /// The paths in the file, segment by segment. A `use` with braces contributes one path for each
    /// name.
    pub(crate) paths: Vec<Vec<String>>,
    /// The modules that the file declares, in order.
    pub(crate) modules: Vec<String>,
    /// The string literals of the file.
    pub(crate) strings: Vec<String>,
}

impl Source {
    /// Parses the text of a file.
    ///
    /// # Panics
    /// If it is not Rust.
    pub(crate) fn new(text: &str) -> Self {
        let tokens: TokenStream = text.parse().unwrap_or_else(|error| panic!("{error}: {text}"));
        let mut source = Self { paths: Vec::new(), modules: Vec::new(), strings: Vec::new() };
        source.read(tokens);
        source
    }

    fn read(&mut self, tokens: TokenStream) {
        let tokens: Vec<TokenTree> = tokens.into_iter().collect();
        let mut at = 0;
        while at < tokens.len() {
            if is_test_attribute(&tokens[at..]) {
                at = end_of_item(&tokens, at);
                continue;
            }
            match &tokens[at] {
                // The compiler sees a documentation comment as an attribute.
                TokenTree::Group(group) if group.stream().to_string().starts_with("doc =") => {}
                TokenTree::Group(group) => self.read(group.stream()),
                TokenTree::Literal(literal) => {
                    let text = literal.to_string();
                    if text.contains('"') {
                        self.strings.push(text);
                    }
                }
                TokenTree::Ident(word) => {
                    if word == "mod"
                        && let Some(TokenTree::Ident(name)) = tokens.get(at + 1)
                        && is_punct(tokens.get(at + 2), ';')
                    {
                        self.modules.push(name.to_string());
                    }
                    at = paths(&tokens, at, &[], &mut self.paths);
                    continue;
                }
                TokenTree::Punct(_) => {}
            }
            at += 1;
        }
    }
}

/// Reads the path at `at`, including the paths in braces at its end. Returns the index after the
/// path.
fn paths(
    tokens: &[TokenTree],
    at: usize,
    before: &[String],
    found: &mut Vec<Vec<String>>,
) -> usize {
    let mut path = before.to_vec();
    let mut at = at;
    loop {
        match tokens.get(at) {
            Some(TokenTree::Ident(word)) => path.push(word.to_string()),
            Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Brace => {
                let inside: Vec<TokenTree> = group.stream().into_iter().collect();
                for part in inside.split(|token| is_punct(Some(token), ',')) {
                    if !part.is_empty() {
                        paths(part, 0, &path, found);
                    }
                }
                return at + 1;
            }
            // The token is `*`, or the `<` of generic arguments.
            _ => break,
        }
        at += 1;
        if !(is_punct(tokens.get(at), ':') && is_punct(tokens.get(at + 1), ':')) {
            break;
        }
        at += 2;
    }
    found.push(path);
    at
}

fn is_punct(token: Option<&TokenTree>, wanted: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == wanted)
}

/// Whether the tokens begin with `#[test]` or `#[cfg(test)]`.
fn is_test_attribute(tokens: &[TokenTree]) -> bool {
    let [TokenTree::Punct(hash), TokenTree::Group(group), ..] = tokens else { return false };
    let text = group.stream().to_string().replace(' ', "");
    hash.as_char() == '#' && (text == "test" || text == "cfg(test)")
}

/// The index after the item that begins with an attribute at `at`. The item ends with its braces or
/// its `;`.
fn end_of_item(tokens: &[TokenTree], at: usize) -> usize {
    let ends = |token: &TokenTree| match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        token => is_punct(Some(token), ';'),
    };
    tokens[at..].iter().position(ends).map_or(tokens.len(), |after| at + after + 1)
}

/// The modules of a package by their path in the crate, such as `["shfrs", "window"]`.
pub(crate) fn modules(folder: &Path) -> BTreeMap<Vec<String>, Source> {
    let mut found = BTreeMap::new();
    for root in ["lib.rs", "main.rs"] {
        if let Ok(text) = fs::read_to_string(folder.join(root)) {
            add(folder, Vec::new(), Source::new(&text), &mut found);
            break;
        }
    }
    assert!(found.len() > 3, "{}: no modules", folder.display());
    found
}

fn add(
    folder: &Path,
    path: Vec<String>,
    source: Source,
    found: &mut BTreeMap<Vec<String>, Source>,
) {
    for name in &source.modules {
        let file = folder.join(name).with_extension("rs");
        let (file, inside) = match file.exists() {
            true => (file, folder.join(name)),
            false => (folder.join(name).join("mod.rs"), folder.join(name)),
        };
        let text = fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let path = [path.clone(), vec![name.clone()]].concat();
        add(&inside, path, Source::new(&text), found);
    }
    found.insert(path, source);
}

/// Uses of a module that is declared below its user, as `user → used`.
pub(crate) fn backward(modules: &BTreeMap<Vec<String>, Source>) -> Vec<String> {
    let mut found = Vec::new();
    for (user, source) in modules {
        for used in source.paths.iter().filter_map(|path| resolve(user, path, modules)) {
            let common = user.iter().zip(&used).take_while(|(a, b)| a == b).count();
            let (Some(here), Some(there)) = (user.get(common), used.get(common)) else { continue };
            let order = &modules[&user[..common]].modules;
            let place = |name: &String| order.iter().position(|other| other == name);
            if place(here) < place(there) {
                found.push(format!("{} → {}", user.join("::"), used.join("::")));
            }
        }
    }
    found.sort();
    found.dedup();
    found
}

/// The module that a path refers to, if the path occurs in the module `user`. `None` if the path
/// does not begin in this crate.
fn resolve(
    user: &[String],
    path: &[String],
    modules: &BTreeMap<Vec<String>, Source>,
) -> Option<Vec<String>> {
    let mut whole = match path[0].as_str() {
        "crate" => Vec::new(),
        "super" | "self" => user.to_vec(),
        _ => return None,
    };
    for part in path {
        match part.as_str() {
            "crate" | "self" => {}
            "super" => {
                whole.pop();
            }
            name => whole.push(name.to_owned()),
        }
    }
    while !modules.contains_key(&whole) {
        whole.pop();
    }
    Some(whole)
}

#[test]
fn comments_tests_and_strings_are_no_code() {
    let source = Source::new(
        "//! crate::a\nmod first;\n#[cfg(test)]\n#[allow(x)]\nmod tests { use crate::b; }\n\
         #[cfg(test)]\nmod later;\nuse crate::{c, d::{self, e as f}};\n\
         fn g() { let s = \"// crate::h\"; super::i::j(); } // crate::k\nmod second;",
    );
    let paths: Vec<_> = source.paths.iter().map(|path| path.join("::")).collect();
    for wanted in ["crate::c", "crate::d::self", "crate::d::e", "super::i::j"] {
        assert!(paths.contains(&wanted.to_owned()), "{wanted} in {paths:?}");
    }
    let absent = |name: &str| !paths.iter().any(|path| path == name);
    assert!(["crate::a", "crate::b", "crate::h", "crate::k"].into_iter().all(absent), "{paths:?}");
    assert_eq!(source.modules, ["first", "second"]);
    assert_eq!(source.strings, ["\"// crate::h\""]);
}

#[test]
fn a_use_of_what_is_declared_below_is_found_at_every_depth() {
    let tree = [
        ("", "mod a; mod b;"),
        ("a", "mod x; mod y; use self::y::Y;"),
        ("a::x", "use super::y::Y; use crate::a::Z;"),
        ("a::y", "use super::x::X;"),
        ("b", "use crate::a::y::Y;"),
    ];
    let parts =
        |name: &str| name.split("::").filter(|part| !part.is_empty()).map(str::to_owned).collect();
    let tree = tree.into_iter().map(|(name, text)| (parts(name), Source::new(text))).collect();
    assert_eq!(backward(&tree), ["a::x → a::y"]);
}
