//! Style sheets without comments and needless white space.
//!
//! Nothing is understood or rewritten: strings, `url(…)` and escapes are copied,
//! and a space is dropped only where CSS gives it no meaning (beside `{ } ; ,`
//! and after `:`; not before `:`, where it is a descendant selector).

/// Stands for a character without meaning of its own: that of a word.
const WORD: char = 'w';

/// The same rules in fewer bytes.
pub(super) fn minify(source: &str) -> String {
    let mut out = String::with_capacity(source.len());
    // What the last character written means, and whether white space followed it.
    let mut last = ';';
    let mut spaced = false;
    let mut rest = source;
    while let Some(first) = rest.chars().next() {
        let (length, meaning) = match first {
            '/' if rest.starts_with("/*") => {
                let length = comments(rest);
                if !spaced && is_open(last) && rest[length..].starts_with(is_open) {
                    // It is all that keeps two words apart.
                    out += "/**/";
                    last = WORD;
                }
                rest = &rest[length..];
                continue;
            }
            space if space.is_ascii_whitespace() => {
                spaced = true;
                rest = rest.trim_ascii_start();
                continue;
            }
            '"' | '\'' => (string(rest, first), WORD),
            '\\' => {
                let escaped = rest[1..].chars().next();
                (1 + escaped.map_or(0, char::len_utf8), WORD)
            }
            _ if starts_with_url(rest) => (url(rest), WORD),
            _ => (first.len_utf8(), first),
        };
        if spaced && !"{};,:".contains(last) && !"{};,".contains(meaning) {
            out.push(' ');
        }
        if last == ';' && meaning == '}' {
            // The last declaration needs no end.
            out.pop();
        }
        out += &rest[..length];
        rest = &rest[length..];
        last = meaning;
        spaced = false;
    }
    out
}

/// Length of the comments at the start, with nothing between them.
fn comments(text: &str) -> usize {
    let mut rest = text;
    while let Some(inside) = rest.strip_prefix("/*") {
        rest = inside.split_once("*/").map_or("", |(_, after)| after);
    }
    text.len() - rest.len()
}

/// Whether a character would join with a word beside it.
fn is_open(c: char) -> bool {
    !c.is_ascii_whitespace() && !"{};,:".contains(c)
}

/// Length of the string at the start, with its quotes.
fn string(text: &str, quote: char) -> usize {
    let mut escaped = false;
    for (index, c) in text.char_indices().skip(1) {
        if escaped {
            escaped = false;
        } else if c == '\\' {
            escaped = true;
        } else if c == quote {
            return index + 1;
        }
    }
    text.len()
}

/// Whether a `url(` starts here, in any case of its letters.
fn starts_with_url(text: &str) -> bool {
    text.get(..4).is_some_and(|start| start.eq_ignore_ascii_case("url("))
}

/// Length of the `url(…)` at the start; inside, `/*` starts no comment.
fn url(text: &str) -> usize {
    let inside = text[4..].trim_ascii_start();
    let skipped = text.len() - inside.len();
    match inside.chars().next() {
        // The rest of it needs no care once the string is over.
        Some(quote @ ('"' | '\'')) => skipped + string(inside, quote),
        _ => text.find(')').map_or(text.len(), |end| end + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::minify;

    #[track_caller]
    fn check(source: &str, expected: &str) {
        assert_eq!(minify(source), expected);
        assert_eq!(minify(expected), expected, "small stays small");
    }

    #[test]
    fn space_that_means_nothing_goes() {
        check(
            "\n:root {\n  --a: 1px;\n  color : red ;\n}\n\nb , i { }\n",
            ":root{--a:1px;color :red}b,i{}",
        );
        check(
            "@media (min-width: 40rem) and (hover) { a { b: c; } }",
            "@media (min-width:40rem) and (hover){a{b:c}}",
        );
    }

    #[test]
    fn space_that_means_something_stays() {
        check("a :hover > b + c {}", "a :hover > b + c{}");
        check("a{width:calc(1px + 2px)}", "a{width:calc(1px + 2px)}");
        check("a{margin:1px   2px\n3px}", "a{margin:1px 2px 3px}");
    }

    #[test]
    fn comments_go_but_keep_words_apart() {
        check("/* a */ b { /* c: d; */ e: f /* g */ }", "b{e:f}");
        check("a{margin:1px /* x */ 2px}", "a{margin:1px 2px}");
        check("a/* x */.b{}", "a/**/.b{}");
        check("a/* x *//* y */ b{}", "a b{}");
        check("a{} /* no end", "a{}");
    }

    #[test]
    fn strings_urls_and_escapes_are_copied() {
        check(r#"a::before { content: "  /* } \" ; " }"#, r#"a::before{content:"  /* } \" ; "}"#);
        check("a { b: url( data:x;/*y*/  ) }", "a{b:url( data:x;/*y*/  )}");
        check("a { b: URL( ') ; ' ) }", "a{b:URL( ') ; ' )}");
        check(r"a\;  b { c: d\;; }", r"a\; b{c:d\;}");
        check("a { content: 'ψ – ü' }", "a{content:'ψ – ü'}");
    }
}
