//! Texts and numbers as HTML.

pub(super) use sidestep::chart::fixed;

use sidestep::comparison::gains::LEVEL;

/// A text with everything escaped that means something in HTML and XML, attributes included.
/// Control characters, which XML forbids, become U+FFFD.
pub(super) fn escaped(text: &str) -> String {
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

/// With that many decimal places, and a sign unless it is nothing.
pub(super) fn signed(number: f64, places: usize) -> String {
    let text = fixed(number, places);
    let is_nothing = text.chars().all(|c| "0.".contains(c));
    if is_nothing || text.starts_with('−') { text } else { format!("+{text}") }
}

/// "p = 0.031" or "p < 0.001", escaped.
pub(super) fn p_is(p: f64) -> String {
    if p < 0.001 { "p &lt; 0.001".to_owned() } else { format!("p = {p:.3}") }
}

/// A p-value in a table, escaped.
pub(super) fn p_value(p: f64) -> String {
    if p < 0.001 { "&lt; 0.001".to_owned() } else { format!("{p:.3}") }
}

/// "1 person", "2 persons": `one` and `many` with the number before.
pub(super) fn count(number: usize, one: &str, many: &str) -> String {
    format!("{} {}", grouped(number), if number == 1 { one } else { many })
}

/// With a narrow space between thousands.
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

/// "a", "a and b", "a, b and c".
pub(super) fn listed(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [one] => one.clone(),
        [before @ .., last] => format!("{} and {last}", before.join(", ")),
    }
}

/// A table that can be scrolled sideways: a caption, column headers and rows, whose first entry
/// heads the row. Everything is HTML already.
pub(super) fn table(
    caption: &str,
    class: &str,
    columns: &[String],
    rows: &[Vec<String>],
) -> String {
    let head: String =
        columns.iter().map(|name| format!("<th scope=\"col\">{name}</th>")).collect();
    let row = |row: &Vec<String>| {
        let entries = row.iter().enumerate().map(|(i, entry)| match i {
            0 => format!("<th scope=\"row\">{entry}</th>"),
            _ => format!("<td>{entry}</td>"),
        });
        format!("<tr>{}</tr>\n", entries.collect::<String>())
    };
    let body: String = rows.iter().map(row).collect();
    // What scrolls must be reachable with the keyboard.
    format!(
        "<div class=\"scroll\" role=\"group\" tabindex=\"0\" aria-label=\"{label}\">\n\
         <table class=\"{class}\">\n<caption>{caption}</caption>\n\
         <thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n</table>\n</div>\n",
        label = without_tags(caption),
    )
}

/// What is read of HTML.
fn without_tags(html: &str) -> String {
    let (mut out, mut inside) = (String::new(), false);
    for c in html.chars() {
        match c {
            '<' => inside = true,
            '>' if inside => inside = false,
            c if !inside => out.push(c),
            _ => {}
        }
    }
    out
}

/// How much something gains.
pub(super) struct GainItem {
    /// In which model.
    pub(super) name: String,
    /// HTML.
    pub(super) gain: String,
    /// Of the paired test, before and after Holm's correction; none where people are too few for
    /// it to show anything.
    pub(super) p_values: Option<[f64; 2]>,
}

/// Gains side by side.
pub(super) fn gains(all: &[GainItem]) -> String {
    let one = |of: &GainItem| {
        let is_below = of.p_values.is_some_and(|[_, holm]| holm < LEVEL);
        let class = if is_below { " class=\"below\"" } else { "" };
        let sure = of.p_values.map_or_else(String::new, |[p, holm]| {
            format!("<small>{}<br/>Holm {}</small>", p_is(p), p_value(holm))
        });
        format!("<li{class}><span>{}</span><b>{}</b>{sure}</li>\n", of.name, of.gain)
    };
    format!("<ul class=\"gains\">\n{}</ul>\n", all.iter().map(one).collect::<String>())
}

/// Sections that are unfolded on demand.
pub(super) fn details(summary: &str, content: &str) -> String {
    format!("<details>\n<summary>{summary}</summary>\n{content}</details>\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_text_is_markup() {
        let text = escaped("<script>alert(\"x\" & 'y')</script>\u{0}");
        assert_eq!(
            text,
            "&lt;script&gt;alert(&quot;x&quot; &amp; &#39;y&#39;)&lt;/script&gt;\u{fffd}"
        );
        assert_eq!(without_tags("a <b>c</b> d"), "a c d");
    }

    #[test]
    fn numbers() {
        assert_eq!([fixed(-0.004, 2), fixed(-1.25, 1), fixed(3.0, 0)], ["0.00", "−1.2", "3"]);
        assert_eq!([signed(0.004, 2), signed(2.0, 1), signed(-2.0, 1)], ["0.00", "+2.0", "−2.0"]);
        assert_eq!([p_is(0.0004), p_is(0.0312)], ["p &lt; 0.001", "p = 0.031"]);
        assert_eq!([grouped(4000), grouped(20_000)], ["4000", "20\u{202f}000"]);
        assert_eq!(listed(&["a", "b", "c"].map(str::to_owned)), "a, b and c");
        assert_eq!(
            [count(1, "person", "people"), count(8, "person", "people")],
            ["1 person", "8 people"]
        );
    }
}
