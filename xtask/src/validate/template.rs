//! Fills page templates with formatted numbers.

use anyhow::Result;
use minijinja::syntax::SyntaxConfig;
use minijinja::value::{Serde, Value};
use minijinja::{Environment, UndefinedBehavior};

/// Fills the template with the measured numbers.
///
/// # Errors
/// When the template is invalid or uses an undefined value.
pub(super) fn filled(template: &str, measured: serde_json::Value) -> Result<String> {
    let mut pages = Environment::new();
    // A line that contains only a tag produces no output.
    let mut syntax = SyntaxConfig::builder();
    syntax.trim_blocks(true).lstrip_blocks(true).keep_trailing_newline(true);
    pages.set_syntax(syntax.build()?);
    pages.set_undefined_behavior(UndefinedBehavior::Strict);
    pages.set_formatter(|out, _, value: &Value| {
        // 2.0 is written as 2.
        let text = f64::try_from(value.clone()).map_or_else(|_| value.to_string(), plain);
        Ok(out.write_str(&text)?)
    });
    pages.add_filter("plain", plain);
    pages.add_filter("fixed", fixed);
    pages.add_filter("signed", signed);
    pages.add_filter("cm", cm);
    pages.add_filter("mm", mm);
    pages.add_filter("seconds", seconds);
    pages.add_filter("thousands", thousands);
    pages.add_filter("power", power);
    Ok(pages.render_str(template, Serde(measured))?)
}

/// Replaces hyphens by typographic minus signs.
fn minus(text: String) -> String {
    text.replace('-', "−")
}

/// The shortest decimal representation that is parsed as the same number.
fn plain(number: f64) -> String {
    minus(number.to_string())
}

/// Rounded to `places` decimal places. 0 has no sign.
fn fixed(number: f64, places: usize) -> String {
    let text = format!("{number:.places$}");
    let zero = text.chars().all(|c| "-0.".contains(c));
    minus(if zero { text.replace('-', "") } else { text })
}

/// Rounded, with a leading + or −.
fn signed(number: f64, places: usize) -> String {
    minus(format!("{number:+.places$}"))
}

/// Formats metres as centimetres.
fn cm(metres: f64) -> String {
    sized(100.0 * metres, &[(1.0, 2)], 1)
}

/// Formats metres as millimetres.
fn mm(metres: f64) -> String {
    if metres == 0.0 { "0".to_owned() } else { sized(1000.0 * metres, &[(0.1, 4), (10.0, 2)], 1) }
}

/// Formats a duration in seconds.
fn seconds(seconds: f64) -> String {
    sized(seconds, &[(1.0, 3), (10.0, 1)], 0)
}

/// Rounds to a number of decimal places that depends on the magnitude. `limits` lists pairs (limit,
/// places) in ascending order, and the first limit above the magnitude counts. `otherwise` is the
/// number of places above all limits.
fn sized(number: f64, limits: &[(f64, usize)], otherwise: usize) -> String {
    let limit = limits.iter().find(|(limit, _)| number.abs() < *limit);
    fixed(number, limit.map_or(otherwise, |(_, places)| *places))
}

/// Adds thousands separators: 1234567 becomes 1,234,567.
fn thousands(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Scientific notation of a number ≥ 0, such as 1.2·10⁻³.
fn power(number: f64) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    if number == 0.0 {
        return "0".to_owned();
    }
    let text = format!("{number:.1e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let raised = |c: char| c.to_digit(10).map_or('⁻', |digit| RAISED[digit as usize]);
    format!("{digits}·10{}", exponent.chars().map(raised).collect::<String>())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn numbers_are_written_for_readers() {
        let numbers = json!({ "of": {
            "int": 1_234_567, "two": 2.0, "low": -0.42, "small": 3.4e-8, "large": 1.23e10, "no": 0.0,
            "near": 0.000_012, "far": -0.0534,
        }});
        for (template, expected) in [
            ("{{ of.int }} {{ of.two }} {{ of.low }}", "1234567 2 −0.42"),
            ("{{ of.int|thousands }} {{ 999|thousands }}", "1,234,567 999"),
            ("{{ of.low|fixed(1) }} {{ of.low|fixed(0) }} {{ of.two|signed(2) }}", "−0.4 0 +2.00"),
            ("{{ of.small|power }} {{ of.large|power }} {{ of.no|power }}", "3.4·10⁻⁸ 1.2·10¹⁰ 0"),
            ("{{ 0.0154|cm }} {{ 0.00049|cm }}", "1.5 0.05"),
            (
                "{{ of.no|mm }} {{ of.near|mm }} {{ 0.0012|mm }} {{ of.far|mm }}",
                "0 0.0120 1.20 −53.4",
            ),
            ("{{ 0.096|seconds }} {{ 9.6|seconds }} {{ 191.5|seconds }}", "0.096 9.6 192"),
            ("{{ [1.5, 2.0]|map('plain')|join(', ') }}", "1.5, 2"),
        ] {
            assert_eq!(filled(template, numbers.clone()).expect(template), expected);
        }
    }

    #[test]
    fn a_template_names_what_was_measured() {
        let error = filled("{{ of.nothing }}", json!({ "of": {} })).expect_err("no such number");
        assert!(error.to_string().contains("undefined"), "{error}");
    }

    #[test]
    fn tags_of_their_own_line_leave_no_line() {
        let rows = filled(
            "| a |\n{% for n in of %}\n| {{ n }} |\n{% endfor %}\n",
            json!({ "of": [1, 2] }),
        );
        assert_eq!(rows.expect("rows"), "| a |\n| 1 |\n| 2 |\n");
    }
}
