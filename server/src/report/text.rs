//! Converts words and numbers to text, HTML and LaTeX. The functions are filters of the templates.

use sidestep::chart;
use sidestep::comparison::gains::LEVEL;
use sidestep::comparison::sets::{BODY_FRAME_SETS, PAPERS_SETS};
use sidestep::features::HISTORY_SET;

/// Escapes all special characters of HTML and XML, including attributes. Control characters, which
/// XML forbids, become U+FFFD.
pub(super) fn html(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c if (c.is_control() && !c.is_whitespace()) || "\u{fffe}\u{ffff}".contains(c) => {
                out.push('\u{fffd}');
            }
            c => out.push(c),
        }
    }
    out
}

/// Escapes all special characters of LaTeX. A character that LaTeX's own fonts lack becomes an
/// `\orcode`. Unicode engines show the character, and other engines show its number.
pub(super) fn tex(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' => out.push_str("\\textbackslash{}"),
            '{' | '}' | '$' | '&' | '#' | '_' | '%' => out.extend(['\\', c]),
            '~' => out.push_str("\\textasciitilde{}"),
            '^' => out.push_str("\\textasciicircum{}"),
            // In the default encoding of the standard fonts, these three codes are other characters.
            '<' | '>' | '|' => out.extend(['$', c, '$']),
            '≤' => out.push_str("$\\le$"),
            '≥' => out.push_str("$\\ge$"),
            '“' => out.push_str("``"),
            '”' => out.push_str("''"),
            '‘' => out.push('`'),
            '’' => out.push('\''),
            '–' => out.push_str("--"),
            '…' => out.push_str("\\ldots{}"),
            c if c.is_whitespace() || c.is_control() => out.push(' '),
            c if c.is_ascii() || is_accented(c) => out.push(c),
            c => out.push_str(&format!("\\orcode{{{c}}}{{{:04X}}}", u32::from(c))),
        }
    }
    out
}

/// Whether this is a letter of the Latin-1 block that every font has.
fn is_accented(c: char) -> bool {
    ('À'..='ÿ').contains(&c) && !"×÷ÐðÞþ".contains(c)
}

/// The text of HTML without its tags.
pub(super) fn without_tags(html: &str) -> String {
    let mut inside = false;
    let mut is_text = |c: &char| {
        let is_tag = inside || *c == '<';
        inside = is_tag && *c != '>';
        !is_tag
    };
    html.chars().filter(&mut is_text).collect()
}

/// A number with this number of decimal places.
pub(super) fn fixed(number: f64, places: usize) -> String {
    chart::fixed(number, places)
}

/// Like [`fixed`], but with a sign, unless the number is printed as zero.
pub(super) fn signed(number: f64, places: usize) -> String {
    let text = fixed(number, places);
    let is_zero = text.chars().all(|c| "0.".contains(c));
    if is_zero || text.starts_with('−') { text } else { format!("+{text}") }
}

/// Like [`signed`], but a nonzero number that would be printed as zero is "just above 0" or "just below 0".
pub(super) fn beside_zero(number: f64, places: usize) -> String {
    chart::beside_zero(number, places).map_or_else(|| signed(number, places), str::to_owned)
}

/// A p-value with three places, or with more places if rounding would move it across [`LEVEL`].
pub(super) fn p_places(p: f64) -> String {
    let told = |places: &usize| {
        format!("{p:.places$}").parse().is_ok_and(|told: f64| (told < LEVEL) == (p < LEVEL))
    };
    fixed(p, (3..15).find(told).unwrap_or(15))
}

/// A number with a narrow space between thousands.
pub(super) fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) && digits.len() > 4 {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// A number with its noun, such as "1 person" or "2 people".
pub(super) fn count(number: usize, one: &str, many: &str) -> String {
    format!("{} {}", grouped(number), if number == 1 { one } else { many })
}

/// A feature set as HTML: B with its letters, or the name given by a user.
pub(super) fn set(name: &str) -> String {
    let is_body = |name: &str| BODY_FRAME_SETS.iter().any(|(set, _)| *set == name);
    if !PAPERS_SETS.contains(&name) && !is_body(name) && name != HISTORY_SET {
        return format!("<code>{name}</code>");
    }
    let (name, memory) =
        name.strip_suffix("_history").map_or((name, ""), |name| (name, " + memory"));
    let (letters, body) = name.strip_suffix("_body").map_or((name, ""), |name| (name, " + body"));
    format!("<i>B</i><sub>{letters}</sub>{body}{memory}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_text_is_markup() {
        let text = html("<script>alert(\"x\" & 'y')</script>\u{0}");
        let expected =
            "&lt;script&gt;alert(&quot;x&quot; &amp; &#39;y&#39;)&lt;/script&gt;\u{fffd}";
        assert_eq!(text, expected);
        assert_eq!(without_tags("a <b>c</b> d > e"), "a c d > e");
    }

    #[test]
    fn nothing_of_a_text_is_a_latex_command() {
        let text = tex("\\input{x} 100% & $a_b^c# ~\n");
        let expected = "\\textbackslash{}input\\{x\\} 100\\% \\& \\$a\\_b\\textasciicircum{}c\\# \
                        \\textasciitilde{} ";
        assert_eq!(text, expected);
        assert_eq!(tex("a<b|c ≥ 1…"), "a$<$b$|$c $\\ge$ 1\\ldots{}");
        assert_eq!(tex("Zoë ψ"), "Zoë \\orcode{ψ}{03C8}");
    }

    /// A rounded number contradicts neither an interval nor a verdict.
    #[test]
    fn numbers_stay_on_their_side() {
        let beside = [0.04, -0.04, 0.0, 0.05, -2.0].map(|number| beside_zero(number, 1));
        assert_eq!(beside, ["just above 0", "just below 0", "0.0", "+0.1", "−2.0"]);
        let p = [0.0312, 0.0496, 0.04999, 0.05, 0.0504, 1.0].map(p_places);
        assert_eq!(p, ["0.031", "0.0496", "0.04999", "0.050", "0.050", "1.000"]);
    }

    #[test]
    fn numbers() {
        assert_eq!([signed(0.004, 2), signed(2.0, 1), signed(-2.0, 1)], ["0.00", "+2.0", "−2.0"]);
        assert_eq!([grouped(4000), grouped(20_000)], ["4000", "20\u{202f}000"]);
        assert_eq!([1, 8].map(|n| count(n, "person", "people")), ["1 person", "8 people"]);
    }
}
