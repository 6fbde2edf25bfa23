//! Axes: ends, round ticks and their labels.

use crate::math::ln;

/// An axis: quantity, ends and ticks.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Name of the quantity.
    pub name: String,
    /// Unit of the title and the tick labels; may be empty.
    pub unit: String,
    /// The values at the ends of the axis: left and right, or bottom and top.
    pub ends: [f64; 2],
    /// Whether the scale is logarithmic.
    pub logarithmic: bool,
    /// Whether the ticks are categories, centred at 0.5, 1.5, ….
    pub of_categories: bool,
    /// The ticks: values with their labels.
    pub labels: Vec<(f64, String)>,
}

/// A tick of an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Tick {
    /// The value, in the unit of [`Axis::ends`].
    pub value: f64,
    /// The position: 0 at the start of the axis, 1 at its end.
    pub share: f64,
    /// The label.
    pub label: String,
}

impl Axis {
    /// A linear axis with round ticks and at most `most` steps between them.
    #[must_use]
    pub fn linear(name: &str, unit: &str, ends: [f64; 2], most: usize) -> Self {
        let ends = proper(ends);
        let step = round_step(ends[1] - ends[0], most);
        Self::ticked(name, unit, ends, multiples(ends, step, 1.0))
    }

    /// A linear axis whose ends are `range`, rounded outwards to round numbers. It has at most
    /// `most` + 1 steps.
    #[must_use]
    pub fn round(name: &str, unit: &str, range: [f64; 2], most: usize) -> Self {
        let [low, high] = proper(range);
        let step = round_step(high - low, most);
        let first = (low / step + 1e-9).floor();
        let last = (high / step - 1e-9).ceil().max(first + 1.0);
        let ends = [first * step, last * step];
        Self::ticked(name, unit, ends, multiples(ends, step, 1.0))
    }

    /// A time axis whose ends are in seconds. Ticks are round numbers of seconds, minutes or hours,
    /// depending on the duration.
    #[must_use]
    pub fn time(name: &str, ends_s: [f64; 2], most: usize) -> Self {
        let ends = proper(ends_s);
        let duration = ends[1] - ends[0];
        let (unit, seconds) = match duration {
            ..=150.0 => ("s", 1.0),
            ..=9000.0 => ("min", 60.0),
            _ => ("h", 3600.0),
        };
        let step = round_step(duration / seconds, most);
        Self::ticked(name, unit, ends, multiples(ends, step, seconds))
    }

    /// A logarithmic axis between positive ends. Ticks are at powers of ten and, below three
    /// decades, also at 2 and 5 times these powers.
    #[must_use]
    pub fn logarithmic(name: &str, unit: &str, ends: [f64; 2]) -> Self {
        let low = if ends[0] > 0.0 { ends[0] } else { f64::MIN_POSITIVE };
        let ends = [low, ends[1].max(low * (1.0 + 1e-9))];
        let decades = (-307..=307).map(|power| format!("1e{power}").parse::<f64>().unwrap_or(1.0));
        let factors: &[f64] = if ends[1] / ends[0] < 1e3 { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let all = decades.flat_map(|decade| factors.iter().map(move |factor| factor * decade));
        let inside =
            all.filter(|tick| (low * (1.0 - 1e-9)..=ends[1] * (1.0 + 1e-9)).contains(tick));
        let labels = inside.map(|tick| (tick, number(tick))).collect();
        Self { logarithmic: true, ..Self::ticked(name, unit, ends, labels) }
    }

    /// An axis with one place per category, in order.
    #[must_use]
    pub fn categories(name: &str, categories: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let label = |(i, name): (usize, _)| (i as f64 + 0.5, Into::into(name));
        let labels: Vec<(f64, String)> = categories.into_iter().enumerate().map(label).collect();
        let ends = [0.0, labels.len().max(1) as f64];
        Self { of_categories: true, ..Self::ticked(name, "", ends, labels) }
    }

    /// Reverses the axis, so that the first category of a vertical axis is at the top.
    #[must_use]
    pub fn downwards(mut self) -> Self {
        self.ends.reverse();
        self
    }

    /// A linear axis with these ticks.
    #[must_use]
    pub fn ticked(name: &str, unit: &str, ends: [f64; 2], labels: Vec<(f64, String)>) -> Self {
        let (name, unit) = (name.to_owned(), unit.to_owned());
        Self { name, unit, ends, logarithmic: false, of_categories: false, labels }
    }

    /// Name and unit: "distance (m)".
    #[must_use]
    pub fn title(&self) -> String {
        if self.unit.is_empty() {
            self.name.clone()
        } else {
            format!("{} ({})", self.name, self.unit)
        }
    }

    /// The position of a value: 0 at the start of the axis, 1 at its end.
    #[must_use]
    pub fn share(&self, value: f64) -> f64 {
        let place = |value: f64| if self.logarithmic { ln(value) } else { value };
        let [from, to] = self.ends.map(place);
        (place(value) - from) / (to - from)
    }

    /// The ticks, from the start of the axis.
    pub fn ticks(&self) -> impl Iterator<Item = Tick> + '_ {
        self.labels.iter().map(|(value, label)| Tick {
            value: *value,
            share: self.share(*value),
            label: label.clone(),
        })
    }
}

/// Makes ends finite, ordered and distinct.
fn proper([low, high]: [f64; 2]) -> [f64; 2] {
    if !(low.is_finite() && high.is_finite()) {
        return [0.0, 1.0];
    }
    let [low, high] = if low <= high { [low, high] } else { [high, low] };
    // If the ends differ by little more than rounding errors, there is no round number between
    // them.
    let least = 1e-9 * low.abs().max(high.abs()).max(1e-9);
    if high - low < least {
        [low - 0.5 * least.max(1.0), high + 0.5 * least.max(1.0)]
    } else {
        [low, high]
    }
}

/// The smallest step of 1, 2 or 5 times a power of ten such that at most `most` steps cover
/// `length`.
#[must_use]
pub fn round_step(length: f64, most: usize) -> f64 {
    let least = length.clamp(1e-300, 1e300) / most.max(1) as f64;
    // The power of ten comes from the number's decimal text. Steps are parsed from text, so that
    // 0.1 is exact.
    let text = format!("{least:e}");
    let power = text.split_once('e').map_or("0", |(_, power)| power);
    let factors = ["1", "2", "5", "10"].map(|factor| format!("{factor}e{power}"));
    let steps = factors.iter().filter_map(|step| step.parse::<f64>().ok());
    steps.into_iter().find(|step| *step >= least * (1.0 - 1e-9)).unwrap_or(least)
}

/// The ticks between the ends, at multiples of `step`, with their labels. `step` and the labels are in
/// a unit that is `unit` times the unit of the ends: 60 for minutes, if the ends are in seconds.
fn multiples([low, high]: [f64; 2], step: f64, unit: f64) -> Vec<(f64, String)> {
    let (first, last) = ((low / unit / step - 1e-6).ceil(), (high / unit / step + 1e-6).floor());
    let is_whole = |number: f64| (number - number.round()).abs() < 1e-6 * number;
    let places = (0..12).find(|places| is_whole(step * ten(*places)));
    // Limits the count, because rounding errors could cause far too many steps.
    let count = (last - first).clamp(-1.0, 1000.0);
    let tick = |i: i32| (first + f64::from(i)) * step;
    let label = |value: f64| match places {
        Some(places) if value.abs() < 1e6 => fixed(value, places as usize),
        _ => number(value),
    };
    (0..=count as i32).map(tick).map(|value| (value * unit, label(value))).collect()
}

fn ten(power: u32) -> f64 {
    (0..power).fold(1.0, |product, _| 10.0 * product)
}

/// The number with `places` decimal places and a typographic minus; never −0.
#[must_use]
pub fn fixed(number: f64, places: usize) -> String {
    let text = format!("{number:.places$}");
    match text.strip_prefix('-') {
        Some(size) if size.chars().all(|c| c == '0' || c == '.') => size.to_owned(),
        Some(size) => format!("−{size}"),
        None => text,
    }
}

/// Words for a nonzero number that would be printed as zero with `places` decimal places; `None`
/// for other numbers.
#[must_use]
pub fn beside_zero(number: f64, places: usize) -> Option<&'static str> {
    let is_printed_as_zero = fixed(number, places).chars().all(|c| "0.".contains(c));
    let words = if number > 0.0 { "just above 0" } else { "just below 0" };
    (number != 0.0 && is_printed_as_zero).then_some(words)
}

/// The number to six significant digits, without trailing zeros: "0.25", "−3", "2·10⁻⁷".
#[must_use]
pub fn number(value: f64) -> String {
    let text = format!("{:.5e}", value.abs());
    let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
    let sign = if value < 0.0 { "−" } else { "" };
    if value == 0.0 || !value.is_finite() {
        return format!("{sign}{}", value.abs());
    }
    let power: i32 = power.parse().unwrap_or(0);
    if (-4..6).contains(&power) {
        let places = (5 - power).max(0) as usize;
        let plain = format!("{:.places$}", value.abs());
        let plain =
            if places > 0 { plain.trim_end_matches('0').trim_end_matches('.') } else { &plain };
        return format!("{sign}{plain}");
    }
    let raised = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        // The other superscripts are contiguous in Unicode.
        _ => c.to_digit(10).and_then(|digit| char::from_u32('⁰' as u32 + digit)).unwrap_or(c),
    };
    let power: String = power.to_string().chars().map(raised).collect();
    let digits = digits.trim_end_matches('0').trim_end_matches('.');
    if digits == "1" { format!("{sign}10{power}") } else { format!("{sign}{digits}·10{power}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis) -> Vec<&str> {
        axis.labels.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_for_any_duration() {
        // Regression: 8 s had the ticks 0 1 2 2 3 4 5 6 6 7 8.
        let eight = Axis::time("time", [0.0, 8.0], 10);
        assert_eq!(labels(&eight), ["0", "1", "2", "3", "4", "5", "6", "7", "8"]);
        assert_eq!(labels(&Axis::time("time", [0.0, 10.0], 10)).len(), 11);
        assert_eq!(labels(&Axis::time("time", [0.0, 7.4], 5)), ["0", "2", "4", "6"]);
        assert_eq!(
            labels(&Axis::time("time", [0.0, 1.0], 5)),
            ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        let five_minutes = Axis::time("time", [0.0, 300.0], 6);
        assert_eq!(
            (five_minutes.title().as_str(), labels(&five_minutes)),
            ("time (min)", vec!["0", "1", "2", "3", "4", "5"])
        );
        assert_eq!(five_minutes.labels[5].0, 300.0);
        let day = Axis::time("time", [0.0, 86_400.0], 5);
        assert_eq!((day.unit.as_str(), labels(&day)), ("h", vec!["0", "5", "10", "15", "20"]));
    }

    /// Steps are 1, 2 or 5 times a power of ten, there are no more steps than requested, and all
    /// labels differ.
    #[test]
    fn ticks_are_round_for_any_range() {
        let mut rng = crate::math::SeededRng::new(20);
        for _ in 0..2000 {
            let length = format!("1e{}", rng.below(20) as i32 - 10).parse::<f64>().unwrap();
            let low = rng.uniform(-3.0, 3.0) * length;
            let high = low + rng.uniform(0.01, 9.0) * length;
            let most = 2 + rng.below(9);
            let axis = Axis::linear("", "", [low, high], most);
            let count = axis.labels.len();
            assert!((1..=most + 1).contains(&count) || count == 0 && most < 3, "{axis:?}");
            let named = labels(&axis).into_iter().collect::<std::collections::BTreeSet<_>>();
            assert_eq!(named.len(), count, "{axis:?}");
            assert!(axis.ticks().all(|tick| (-1e-6..=1.0 + 1e-6).contains(&tick.share)));
            let wide = Axis::round("", "", [low, high], most);
            assert!(wide.ends[0] <= low + 1e-6 * length && wide.ends[1] >= high - 1e-6 * length);
            assert!(wide.labels.len() >= 2 && wide.labels.len() <= most + 2, "{wide:?}");
            assert_eq!([wide.labels[0].0, wide.labels[wide.labels.len() - 1].0], wide.ends);
        }
    }

    #[test]
    fn axes_widen_to_round_numbers() {
        let axis = Axis::round("", "", [57.2, 80.8], 5);
        assert_eq!(labels(&axis), ["55", "60", "65", "70", "75", "80", "85"]);
        let axis = Axis::round("", "", [0.0, 0.31], 4);
        assert_eq!(
            (axis.ends, labels(&axis)),
            ([0.0, 0.4], vec!["0.0", "0.1", "0.2", "0.3", "0.4"])
        );
        assert_eq!(
            labels(&Axis::linear("x", "m", [-6.0, 20.0], 6)),
            ["−5", "0", "5", "10", "15", "20"]
        );
    }

    #[test]
    fn ends_that_make_no_sense_still_give_an_axis() {
        for ends in [
            [3.0, 3.0],
            [0.0, 0.0],
            [2.0, 1.0],
            [f64::NAN, 1.0],
            [0.0, f64::INFINITY],
            [1e12, 1e12],
        ] {
            for axis in [
                Axis::linear("", "", ends, 5),
                Axis::round("", "", ends, 5),
                Axis::time("", ends, 5),
            ] {
                assert!(axis.ends[0] < axis.ends[1], "{axis:?}");
                assert!((2..=8).contains(&axis.labels.len()), "{axis:?}");
            }
        }
    }

    #[test]
    fn logarithmic_axes_have_powers_of_ten() {
        let axis = Axis::logarithmic("error", "m", [3e-10, 3e-2]);
        assert_eq!(labels(&axis)[..2], ["10⁻⁹", "10⁻⁸"]);
        assert_eq!(labels(&axis)[7], "0.01");
        assert!((axis.share(3e-6) - 0.5).abs() < 1e-12);
        assert_eq!(labels(&Axis::logarithmic("", "", [0.2, 2.4])), ["0.2", "0.5", "1", "2"]);
        assert!(Axis::logarithmic("", "", [-1.0, 0.0]).share(1.0).is_finite());
    }

    #[test]
    fn numbers() {
        assert_eq!(
            [0.25, -3.0, 100.0, 2e-7, 1e-9, 123_456_789.0, -0.0].map(number),
            ["0.25", "−3", "100", "2·10⁻⁷", "10⁻⁹", "1.23457·10⁸", "0"]
        );
        assert_eq!([fixed(-0.004, 2), fixed(-1.25, 1), fixed(3.0, 0)], ["0.00", "−1.2", "3"]);
    }
}
