//! A small chart: an SVG of its own with axes, whose colours come from the page's style sheet.

use super::html::{escaped, fixed};

/// How wide every chart is, CSS pixels. It is drawn for a telephone's width, and several stand
/// side by side on a wider page, so that letters keep their size.
pub(super) const WIDTH: f64 = 340.0;

/// An axis: its ends, the numbers along it and its name with the unit.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) ticks: Vec<f64>,
    pub(super) name: String,
}

impl Axis {
    /// From `low` to `high`, widened to round numbers, about `most` of them.
    pub(super) fn round(low: f64, high: f64, most: usize, name: &str) -> Self {
        let step = round_step(high - low, most);
        let (first, last) =
            ((low / step).floor(), (high / step).ceil().max((low / step).floor() + 1.0));
        let ticks = (0..=(last - first) as usize).map(|i| (first + i as f64) * step).collect();
        Self { from: first * step, to: last * step, ticks, name: name.to_owned() }
    }

    /// Between these ends.
    pub(super) fn exact(from: f64, to: f64, ticks: Vec<f64>, name: &str) -> Self {
        Self { from, to, ticks, name: name.to_owned() }
    }
}

/// 1, 2 or 5 times a power of ten, so that at most `most` of them cover `length`.
fn round_step(length: f64, most: usize) -> f64 {
    let least = length.max(1e-9) / most.max(1) as f64;
    let mut power = 1e-12;
    while power * 10.0 <= least {
        power *= 10.0;
    }
    let steps = [1.0, 2.0, 5.0, 10.0].map(|factor| factor * power);
    let enough = |step: &f64| *step >= least * (1.0 - 1e-9);
    // Not through many products: 0.1 must print as 0.1.
    let step = steps.into_iter().find(enough).unwrap_or(10.0 * power);
    format!("{step:.0e}").parse().unwrap_or(step)
}

/// How far the plot is from the left, the top, the right and the bottom, px.
#[derive(Clone, Copy)]
pub(super) struct Margins(pub(super) [f64; 4]);

/// Where a text is, seen from its anchor.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// What stands at a point.
#[derive(Clone, Copy)]
pub(super) enum Mark {
    Circle,
    Square,
    Triangle,
}

/// A chart in the making.
pub(super) struct Chart {
    body: String,
    height: f64,
    margins: [f64; 4],
    x: Axis,
    y: Axis,
}

impl Chart {
    /// With both axes; `heading` stands above, `description` is for those who do not see it.
    pub(super) fn new(
        heading: &str,
        description: &str,
        height: f64,
        margins: Margins,
        (x, y): (Axis, Axis),
    ) -> Self {
        let body =
            format!("<title>{}</title>\n<desc>{}</desc>\n", escaped(heading), escaped(description));
        let mut chart = Self { body, height, margins: margins.0, x, y };
        chart.text("head", [chart.margins[0], 14.0], Anchor::Start, heading);
        chart.axes();
        chart
    }

    fn axes(&mut self) {
        let [left, top, right, bottom] = self.edges();
        let (x, y) = (self.x.clone(), self.y.clone());
        for &tick in &y.ticks {
            let level = self.y(tick);
            self.segment("rule", [left, level], [right, level]);
            let label = tick_label(tick, &y.ticks);
            self.text("tick", [left - 6.0, level + 4.0], Anchor::End, &label);
        }
        for &tick in &x.ticks {
            let place = self.x(tick);
            self.segment("rule", [place, top], [place, bottom]);
            let label = tick_label(tick, &x.ticks);
            self.text("tick", [place, bottom + 15.0], Anchor::Middle, &label);
        }
        self.segment("axis", [left, bottom], [right, bottom]);
        if !x.name.is_empty() {
            let middle = 0.5 * (left + right);
            self.text("name", [middle, self.height - 5.0], Anchor::Middle, &x.name);
        }
        if !y.name.is_empty() {
            let (at, turn) = ([12.0, 0.5 * (top + bottom)], "rotate(-90");
            let place = format!("transform=\"{turn} {} {})\"", px(at[0]), px(at[1]));
            self.element(
                "text",
                "name",
                &format!("{} {place} text-anchor=\"middle\"", xy(at)),
                &y.name,
            );
        }
    }

    /// Left, top, right and bottom of the plot, px.
    pub(super) fn edges(&self) -> [f64; 4] {
        let [left, top, right, bottom] = self.margins;
        [left, top, WIDTH - right, self.height - bottom]
    }

    /// Where a number is, px from the left.
    pub(super) fn x(&self, number: f64) -> f64 {
        let [left, _, right, _] = self.edges();
        left + (right - left) * (number - self.x.from) / (self.x.to - self.x.from)
    }

    /// Where a number is, px from the top.
    pub(super) fn y(&self, number: f64) -> f64 {
        let [_, top, _, bottom] = self.edges();
        bottom - (bottom - top) * (number - self.y.from) / (self.y.to - self.y.from)
    }

    /// A point of numbers in px.
    pub(super) fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.x(x), self.y(y)]
    }

    fn element(&mut self, name: &str, class: &str, attributes: &str, text: &str) {
        let text = escaped(text);
        self.body.push_str(&format!("<{name} class=\"{class}\" {attributes}>{text}</{name}>\n"));
    }

    /// A line between two points, px.
    pub(super) fn segment(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        let [x1, y1, x2, y2] = [from[0], from[1], to[0], to[1]].map(px);
        self.raw(&format!(
            "<line class=\"{class}\" x1=\"{x1}\" y1=\"{y1}\" x2=\"{x2}\" y2=\"{y2}\"/>"
        ));
    }

    /// A line through points, px.
    pub(super) fn line(&mut self, class: &str, points: &[[f64; 2]]) {
        let points: Vec<String> =
            points.iter().map(|[x, y]| format!("{},{}", px(*x), px(*y))).collect();
        self.raw(&format!("<polyline class=\"{class}\" points=\"{}\"/>", points.join(" ")));
    }

    /// A closed curve, px.
    pub(super) fn polygon(&mut self, class: &str, points: &[[f64; 2]]) {
        let points: Vec<String> =
            points.iter().map(|[x, y]| format!("{},{}", px(*x), px(*y))).collect();
        self.raw(&format!("<polygon class=\"{class}\" points=\"{}\"/>", points.join(" ")));
    }

    /// A mark around a point, px, about as large as a circle of this radius. `says` appears under
    /// a pointer.
    pub(super) fn mark(&mut self, class: &str, mark: Mark, [x, y]: [f64; 2], r: f64, says: &str) {
        let shape = match mark {
            Mark::Circle => {
                format!(
                    "<circle class=\"{class}\" cx=\"{}\" cy=\"{}\" r=\"{}\"",
                    px(x),
                    px(y),
                    px(r)
                )
            }
            Mark::Square => {
                let side = 1.75 * r;
                let [x, y, side] = [x - 0.5 * side, y - 0.5 * side, side].map(px);
                format!(
                    "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{side}\" height=\"{side}\""
                )
            }
            Mark::Triangle => {
                let points =
                    [[x, y - 1.25 * r], [x + 1.15 * r, y + 0.75 * r], [x - 1.15 * r, y + 0.75 * r]];
                let points = points.map(|[x, y]| format!("{},{}", px(x), px(y))).join(" ");
                format!("<polygon class=\"{class}\" points=\"{points}\"")
            }
        };
        self.raw(&format!(
            "{shape}><title>{}</title></{}>",
            escaped(says),
            match mark {
                Mark::Circle => "circle",
                Mark::Square => "rect",
                Mark::Triangle => "polygon",
            }
        ));
    }

    /// A line of text on its base line, px.
    pub(super) fn text(&mut self, class: &str, at: [f64; 2], anchor: Anchor, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        self.element("text", class, &format!("{} text-anchor=\"{anchor}\"", xy(at)), text);
    }

    /// Anything else.
    pub(super) fn raw(&mut self, svg: &str) {
        self.body.push_str(svg);
        self.body.push('\n');
    }

    /// The SVG.
    pub(super) fn finished(self) -> String {
        format!(
            "<svg role=\"img\" viewBox=\"0 0 {} {}\" xmlns=\"http://www.w3.org/2000/svg\">\n{}</svg>\n",
            px(WIDTH),
            px(self.height),
            self.body
        )
    }
}

fn xy([x, y]: [f64; 2]) -> String {
    format!("x=\"{}\" y=\"{}\"", px(x), px(y))
}

/// Tenths of a pixel.
pub(super) fn px(length: f64) -> String {
    let text = format!("{length:.1}");
    let short = text.strip_suffix(".0").unwrap_or(&text);
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

/// With as many places as the ticks need to differ.
fn tick_label(tick: f64, ticks: &[f64]) -> String {
    let whole = |places: usize| {
        ticks
            .iter()
            .all(|tick| (tick - format!("{tick:.places$}").parse().unwrap_or(*tick)).abs() < 1e-9)
    };
    fixed(tick, (0..4).find(|places| whole(*places)).unwrap_or(4))
}

/// A figure: its charts side by side, and what they show. `legend` and `caption` are HTML.
pub(super) fn figure(charts: &[String], legend: &str, caption: &str) -> String {
    format!(
        "<figure>\n<div class=\"charts\">\n{}</div>\n{legend}<figcaption>{caption}</figcaption>\n</figure>\n",
        charts.concat()
    )
}

/// Signs and what they mean: an SVG's content of 26 × 12 px, and a text.
pub(super) fn legend(items: &[(&str, &str)]) -> String {
    let item = |(sign, text): &(&str, &str)| {
        format!(
            "<li><svg viewBox=\"0 0 26 12\" width=\"26\" height=\"12\" aria-hidden=\"true\" \
             xmlns=\"http://www.w3.org/2000/svg\">{sign}</svg><span>{text}</span></li>\n"
        )
    };
    format!("<ul class=\"legend\">\n{}</ul>\n", items.iter().map(item).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_round_numbers() {
        let axis = Axis::round(57.2, 80.8, 5, "");
        assert_eq!(axis.ticks, [55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0]);
        let axis = Axis::round(0.0, 0.31, 4, "");
        assert_eq!((axis.from, axis.to), (0.0, 0.4));
        assert_eq!(
            axis.ticks.iter().map(|t| tick_label(*t, &axis.ticks)).collect::<Vec<_>>(),
            ["0.0", "0.1", "0.2", "0.3", "0.4"]
        );
        let axis = Axis::round(3.0, 3.0, 4, "");
        assert!(axis.from < axis.to);
    }

    #[test]
    fn numbers_are_where_the_axes_say() {
        let axes = (Axis::exact(0.0, 10.0, vec![], "time (s)"), Axis::exact(0.0, 1.0, vec![], ""));
        let chart = Chart::new("a", "b", 200.0, Margins([40.0, 20.0, 0.0, 30.0]), axes);
        assert_eq!([chart.x(0.0), chart.x(10.0)], [40.0, 340.0]);
        assert_eq!([chart.y(0.0), chart.y(1.0)], [170.0, 20.0]);
        assert!(chart.finished().contains("time (s)"));
    }
}
