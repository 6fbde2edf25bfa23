//! Converts researchers' Markdown to inert HTML.

use pulldown_cmark::{CowStr, Event, HeadingLevel, Parser, Tag, TagEnd, html};

/// The HTML of a text in Markdown (CommonMark). HTML in the text is shown literally. Links lead
/// only to http, https and mailto addresses, and open in a new tab. Pictures become their
/// description. Headings begin at the second level, below the page's own heading.
#[must_use]
pub fn html_of(text: &str) -> String {
    let mut links = Vec::new();
    let events = Parser::new(text).flat_map(|event| match event {
        Event::Html(raw) | Event::InlineHtml(raw) => vec![Event::Text(raw)],
        // A block of HTML becomes a paragraph.
        Event::Start(Tag::HtmlBlock) => vec![Event::Start(Tag::Paragraph)],
        Event::End(TagEnd::HtmlBlock) => vec![Event::End(TagEnd::Paragraph)],
        Event::Start(Tag::Heading { level, id, classes, attrs }) => {
            vec![Event::Start(Tag::Heading { level: below(level), id, classes, attrs })]
        }
        Event::End(TagEnd::Heading(level)) => vec![Event::End(TagEnd::Heading(below(level)))],
        Event::Start(Tag::Link { dest_url, .. }) => {
            let allowed = is_allowed(&dest_url);
            links.push(allowed);
            allowed.then(|| Event::InlineHtml(opening(&dest_url))).into_iter().collect()
        }
        Event::End(TagEnd::Link) => {
            let allowed = links.pop().unwrap_or(false);
            allowed.then_some(Event::InlineHtml("</a>".into())).into_iter().collect()
        }
        Event::Start(Tag::Image { .. }) | Event::End(TagEnd::Image) => Vec::new(),
        other => vec![other],
    });
    let mut out = String::new();
    html::push_html(&mut out, events);
    out
}

fn below(level: HeadingLevel) -> HeadingLevel {
    match level {
        HeadingLevel::H1 => HeadingLevel::H2,
        HeadingLevel::H2 => HeadingLevel::H3,
        HeadingLevel::H3 => HeadingLevel::H4,
        HeadingLevel::H4 => HeadingLevel::H5,
        HeadingLevel::H5 | HeadingLevel::H6 => HeadingLevel::H6,
    }
}

/// Whether a URL is safe, which means that it runs no script. Leading characters that a browser would
/// skip make it unsafe.
fn is_allowed(address: &str) -> bool {
    let lower = address.to_ascii_lowercase();
    ["https://", "http://", "mailto:"].iter().any(|scheme| lower.starts_with(scheme))
}

fn opening(address: &str) -> CowStr<'static> {
    let mut escaped = String::with_capacity(address.len());
    for c in address.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    format!("<a href=\"{escaped}\" rel=\"noopener\" target=\"_blank\">").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_can_run_is_shown_as_text() {
        let link = "<p><a href=\"https://a.example/?x=1&amp;y=2\" rel=\"noopener\" \
                    target=\"_blank\">b</a></p>\n";
        let cases = [
            ("# Consent", "<h2>Consent</h2>\n"),
            ("###### Small", "<h6>Small</h6>\n"),
            ("*a* **b**", "<p><em>a</em> <strong>b</strong></p>\n"),
            ("- a\n- b", "<ul>\n<li>a</li>\n<li>b</li>\n</ul>\n"),
            ("[b](https://a.example/?x=1&y=2)", link),
            ("[b](javascript:alert(1))", "<p>b</p>\n"),
            ("[b](JaVaScript:alert(1))", "<p>b</p>\n"),
            ("[b](data:text/html,x)", "<p>b</p>\n"),
            ("[b](/lab)", "<p>b</p>\n"),
            ("<javascript:alert(1)>", "<p>javascript:alert(1)</p>\n"),
            ("![robot](https://a.example/x.png)", "<p>robot</p>\n"),
            ("a <b onclick=x>b</b>", "<p>a &lt;b onclick=x&gt;b&lt;/b&gt;</p>\n"),
        ];
        for (text, expected) in cases {
            assert_eq!(html_of(text), expected, "{text}");
        }
        for text in [
            "<script>alert(1)</script>",
            "<!-- x --><img src=x onerror=alert(1)>",
            "[x](<https://a\" onmouseover=\"alert(1)>)",
            "[a]: javascript:alert(1)\n\n[a]",
            "```<script>\n<script>\n```",
            "<div>\n<iframe src=//x>\n</div>",
        ] {
            let html = html_of(text);
            let tags = html.split('<').skip(1).map(|tag| tag.split(['>', ' ', '\n']).next());
            let known = ["p", "/p", "a", "/a", "pre", "code", "/code", "/pre"];
            assert!(tags.clone().all(|tag| known.contains(&tag.unwrap())), "{html}");
            assert!(!html.contains("\" onmouseover"), "{html}");
        }
    }
}
