//! A drawing as SVG: a tree of elements, or the text of a file.

use super::colours::{Colour, Ink, SURFACE};
use super::drawing::{Align, Drawing, Form, Pen, Point, Shape};
use core::fmt::{self, Display, Formatter, Write};

/// Fonts of a file. The first font is also embedded in the program, for PNG files.
const FONTS: &str = "DejaVu Sans, Verdana, sans-serif";

/// How colours are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourStyle {
    /// Values for a light background, for files.
    Light,
    /// Custom properties of the page's style sheet, which follows the reader's preference for light
    /// or dark.
    Properties,
}

/// An SVG element, which a page can turn into a DOM node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    /// Tag name, such as `polyline`.
    pub name: &'static str,
    /// Names and unescaped values of the attributes.
    pub attributes: Vec<(&'static str, String)>,
    /// Its unescaped text.
    pub text: String,
    /// Child elements.
    pub children: Vec<Element>,
}

impl Element {
    fn new(name: &'static str) -> Self {
        Self { name, attributes: Vec::new(), text: String::new(), children: Vec::new() }
    }

    fn with(mut self, name: &'static str, value: impl ToString) -> Self {
        self.attributes.push((name, value.to_string()));
        self
    }

    fn holding(name: &'static str, text: &str) -> Self {
        Self { text: text.to_owned(), ..Self::new(name) }
    }
}

impl Drawing {
    /// The text of an SVG file with its own light background.
    #[must_use]
    pub fn svg(&self) -> String {
        let mut root = self.element(ColourStyle::Light);
        let [width, height] = self.size.map(short);
        let size = [("width", width.clone()), ("height", height.clone())];
        root.attributes.splice(0..0, size.iter().cloned());
        root.attributes.push(("font-family", FONTS.to_owned()));
        let mut ground = Element::new("rect");
        ground.attributes.extend(size);
        let fill = hex(SURFACE.light);
        let titles = root.children.iter().take_while(|of| ["title", "desc"].contains(&of.name));
        root.children.insert(titles.count(), ground.with("fill", fill));
        format!("{root}\n")
    }

    /// The `svg` element without a fixed size, for a page.
    #[must_use]
    pub fn element(&self, style: ColourStyle) -> Element {
        let [width, height] = self.size.map(short);
        let mut root = Element::new("svg")
            .with("role", "img")
            .with("viewBox", format!("0 0 {width} {height}"))
            .with("xmlns", "http://www.w3.org/2000/svg")
            .with("fill", "none")
            .with("stroke-linejoin", "round");
        let titles = [("title", &self.title), ("desc", &self.description)];
        let titles = titles.into_iter().filter(|(_, text)| !text.is_empty());
        root.children = titles.map(|(name, text)| Element::holding(name, text)).collect();
        root.children.extend(elements(&self.shapes, style));
        root
    }
}

/// The elements of shapes. Consecutive shapes with the same style share a group that carries the style.
fn elements(shapes: &[Shape], style: ColourStyle) -> Vec<Element> {
    let look = |shape: &Shape| paint(shape, style);
    let alike = shapes.chunk_by(|a, b| look(a) == look(b));
    let group = |shapes: &[Shape]| {
        let mut paint = look(&shapes[0]);
        let mut inner: Vec<Element> = shapes.iter().map(geometry).collect();
        match &mut inner[..] {
            [only] => {
                paint.append(&mut only.attributes);
                only.attributes = paint;
                inner
            }
            _ => vec![Element { attributes: paint, children: inner, ..Element::new("g") }],
        }
    };
    alike.flat_map(group).collect()
}

/// The style attributes of a shape, without its geometry.
fn paint(shape: &Shape, style: ColourStyle) -> Vec<(&'static str, String)> {
    let mut paint = Vec::new();
    if let Some(Ink { colour, opacity }) = shape.fill {
        paint.push(("fill", written(colour, style)));
        if opacity < 1.0 {
            paint.push(("fill-opacity", short(opacity)));
        }
    }
    if let Some(Pen { ink, width, dash, .. }) = shape.stroke {
        paint.push(("stroke", written(ink.colour, style)));
        if ink.opacity < 1.0 {
            paint.push(("stroke-opacity", short(ink.opacity)));
        }
        if width != 1.0 {
            paint.push(("stroke-width", short(width)));
        }
        if let Some([dash, gap]) = dash {
            paint.push(("stroke-dasharray", format!("{} {}", short(dash), short(gap))));
        }
    }
    match &shape.form {
        Form::Text(text) => {
            paint.push(("font-size", short(text.size)));
            if text.bold {
                paint.push(("font-weight", "700".to_owned()));
            }
            match text.align {
                Align::Left => {}
                Align::Centre => paint.push(("text-anchor", "middle".to_owned())),
                Align::Right => paint.push(("text-anchor", "end".to_owned())),
            }
            if text.halo {
                paint.push(("stroke", written(SURFACE, style)));
                paint.push(("stroke-width", "3".to_owned()));
                paint.push(("paint-order", "stroke".to_owned()));
            }
        }
        Form::Boxes(_) => paint.push(("shape-rendering", "crispEdges".to_owned())),
        _ => {}
    }
    paint
}

/// The element of a shape, without its style.
fn geometry(shape: &Shape) -> Element {
    let mut element = match &shape.form {
        Form::Line(points) => Element::new("polyline").with("points", listed(points)),
        Form::Polygon(points) => Element::new("polygon").with("points", listed(points)),
        Form::Circle { centre: [x, y], radius } => Element::new("circle")
            .with("cx", short(*x))
            .with("cy", short(*y))
            .with("r", short(*radius)),
        Form::Boxes(boxes) => {
            let mut path = String::new();
            for [left, top, right, bottom] in boxes {
                let [x, y, right, bottom] = [*left, *top, *right, *bottom].map(short);
                // Writing to a string cannot fail.
                let _ = write!(path, "M{x} {y}H{right}V{bottom}H{x}z");
            }
            Element::new("path").with("d", path)
        }
        Form::Text(text) => {
            let element = Element::holding("text", &text.text);
            element.with("x", short(text.at[0])).with("y", short(text.base_line()))
        }
    };
    if !shape.says.is_empty() {
        element.children.push(Element::holding("title", &shape.says));
    }
    element
}

fn listed(points: &[Point]) -> String {
    let mut list = String::with_capacity(12 * points.len());
    for [x, y] in points {
        let space = if list.is_empty() { "" } else { " " };
        let _ = write!(list, "{space}{},{}", short(*x), short(*y));
    }
    list
}

fn written(colour: Colour, style: ColourStyle) -> String {
    match (style, colour.name) {
        (ColourStyle::Properties, Some(name)) => format!("var(--{name})"),
        _ => hex(colour.light),
    }
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Rounds to hundredths, without trailing zeros.
fn short(number: f64) -> String {
    let text = format!("{number:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

impl Display for Element {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "<{}", self.name)?;
        for (name, value) in &self.attributes {
            write!(f, " {name}=\"{}\"", Escaped(value))?;
        }
        if self.text.is_empty() && self.children.is_empty() {
            return f.write_str("/>");
        }
        f.write_str(">")?;
        write!(f, "{}", Escaped(&self.text))?;
        for child in &self.children {
            write!(f, "\n{child}")?;
        }
        if !self.children.is_empty() {
            f.write_str("\n")?;
        }
        write!(f, "</{}>", self.name)
    }
}

/// Text escaped for XML. Characters that XML forbids become U+FFFD.
struct Escaped<'a>(&'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                '\u{fffe}' | '\u{ffff}' => f.write_char('\u{fffd}')?,
                c if c.is_control() && !c.is_whitespace() => f.write_char('\u{fffd}')?,
                c => f.write_char(c)?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::colours;
    use super::*;

    fn drawing() -> Drawing {
        let mut drawing = Drawing::new("a & b", "", [100.0, 50.0]);
        for x in [1.0, 2.0] {
            drawing.circle([x, 3.0], 2.5, Some(colours::HUMAN.at(0.5)), None);
            drawing.saying("5 < 6");
        }
        drawing.line([[0.0, 0.0], [0.333_3, 7.0]], Pen::new(colours::ROBOT, 1.5).dashed(4.0, 2.0));
        drawing.text("é\u{1}", [5.0, 6.0], 10.0, colours::TEXT, Align::Right);
        drawing
    }

    #[test]
    fn a_file_stands_alone() {
        let svg = drawing().svg();
        let expected = "<svg width=\"100\" height=\"50\" role=\"img\" viewBox=\"0 0 100 50\" \
                        xmlns=\"http://www.w3.org/2000/svg\" fill=\"none\" \
                        stroke-linejoin=\"round\" font-family=\"DejaVu Sans, Verdana, sans-serif\">\n\
                        <title>a &amp; b</title>\n\
                        <rect width=\"100\" height=\"50\" fill=\"#ffffff\"/>\n\
                        <g fill=\"#2d6fe0\" fill-opacity=\"0.5\">\n\
                        <circle cx=\"1\" cy=\"3\" r=\"2.5\">\n<title>5 &lt; 6</title>\n</circle>\n\
                        <circle cx=\"2\" cy=\"3\" r=\"2.5\">\n<title>5 &lt; 6</title>\n</circle>\n</g>\n\
                        <polyline stroke=\"#e0453a\" stroke-width=\"1.5\" stroke-dasharray=\"4 2\" points=\"0,0 0.33,7\"/>\n\
                        <text fill=\"#1c1e22\" font-size=\"10\" text-anchor=\"end\" x=\"5\" y=\"9.65\">é\u{fffd}</text>\n</svg>\n";
        assert_eq!(svg, expected);
    }

    #[test]
    fn a_page_gives_the_colours() {
        let element = drawing().element(ColourStyle::Properties).to_string();
        assert!(element.starts_with("<svg role=\"img\" viewBox"));
        assert!(element.contains("var(--human)") && !element.contains('#'), "{element}");
    }
}
