//! Minifies style sheets.

/// Removes comments, line breaks and insignificant space from a style sheet. The sheet's strings
/// must not contain comment delimiters.
pub(super) fn without_space(css: &str) -> String {
    let mut words = Vec::new();
    let mut rest = css;
    while let Some((before, comment)) = rest.split_once("/*") {
        words.extend(before.split_whitespace());
        rest = comment.split_once("*/").map_or("", |(_, after)| after);
    }
    words.extend(rest.split_whitespace());
    let mut css = words.join(" ");
    for sign in ["{", "}", ";"] {
        css = css.replace(&format!(" {sign}"), sign).replace(&format!("{sign} "), sign);
    }
    // Space before `:` and `,` stays, because it can be significant, as in `a :hover`.
    css.replace(": ", ":").replace(", ", ",").replace(";}", "}")
}

#[cfg(test)]
mod tests {
    use super::without_space;

    #[test]
    fn only_space_that_means_nothing_goes() {
        for (sheet, short) in [
            ("/* one */\na { b: c; d: e }\n", "a{b:c;d:e}"),
            (
                "a b > c, d :hover {\n  e: calc(1px + 2vw) /* two */ 3px;\n}",
                "a b > c,d :hover{e:calc(1px + 2vw) 3px}",
            ),
            ("@media (max-width: 1px) {\n  a { b: c; }\n}", "@media (max-width:1px){a{b:c}}"),
        ] {
            assert_eq!(without_space(sheet), short);
        }
    }
}
