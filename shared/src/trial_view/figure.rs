//! A moment of a trial as a figure: the picture with its legend.

use super::Playback;
use super::view::View;
use crate::chart::{Align, Drawing, LegendItem, colours, fixed};
use crate::picture::Picture;

/// Width of the picture, and margin (px).
const WIDTH: f64 = 900.0;
const MARGIN: f64 = 28.0;
/// Smallest and largest height of the picture (px).
const HEIGHTS: [f64; 2] = [300.0, 900.0];

/// Width of each of two pictures side by side, and the gap between them (px).
const HALF: f64 = 560.0;
const BETWEEN: f64 = 20.0;

/// The legend of two pictures side by side. It has all items of the first picture, and then the
/// items of the second picture that the first lacks.
#[must_use]
pub fn legend_of_both(first: &Playback, second: &Playback, view: &View) -> Vec<LegendItem> {
    let mut items = first.legend(view);
    let mut others = second.legend(view);
    others.retain(|other| items.iter().all(|item| item.text != other.text));
    items.extend(
        others
            .into_iter()
            .map(|LegendItem { sign, text }| LegendItem { sign, text: format!("beside: {text}") }),
    );
    items
}

/// Two predictions of one moment side by side, each below its caption, with a common title and a
/// common legend.
#[must_use]
pub fn side_by_side(panes: [(&mut Playback, &str); 2], view: &View, heading: &str) -> Drawing {
    let [(first, _), (second, _)] = &panes;
    let window = first.window();
    let [wide, high] = [0, 1].map(|axis| window.high[axis] - window.low[axis]);
    let height = (HALF * high / wide).clamp(HEIGHTS[0], HEIGHTS[1]).round();
    let time = fixed(first.now().time_s, 1);
    let legend = legend_of_both(first, second, view);
    let (width, top) = (2.0 * HALF + BETWEEN, MARGIN + 64.0);
    let description =
        format!("The trial seen from above, {time} s after its start, predicted in two ways.");
    let mut drawing = Drawing::new(heading, &description, [0.0; 2]);
    drawing.bold(heading, [MARGIN, MARGIN + 8.0], 17.0, colours::TEXT, Align::Left);
    let below = [MARGIN, MARGIN + 30.0];
    drawing.text(&format!("t = {time} s"), below, 13.0, colours::MUTED, Align::Left);
    for (place, (playback, caption)) in panes.into_iter().enumerate() {
        let mut picture = Picture::default();
        picture.begin("", window);
        playback.paint(view, &mut picture);
        let mut pane = picture.drawing("", "", [HALF, height]);
        pane.cut();
        let left = MARGIN + place as f64 * (HALF + BETWEEN);
        drawing.place(&pane, [left, top]);
        drawing.bold(caption, [left, MARGIN + 52.0], 13.0, colours::TEXT, Align::Left);
    }
    let below = top + height + 26.0;
    let rows = drawing.legend(&legend, [MARGIN, below], width);
    drawing.size = [width + 2.0 * MARGIN, below + rows + 4.0];
    drawing
}

impl Playback {
    /// The picture of the current moment with a title and a legend.
    #[must_use]
    pub fn figure(&mut self, view: &View, heading: &str) -> Drawing {
        let mut picture = Picture::default();
        let window = self.window();
        picture.begin("", window);
        self.paint(view, &mut picture);
        let [wide, high] = [0, 1].map(|axis| window.high[axis] - window.low[axis]);
        let height = (WIDTH * high / wide).clamp(HEIGHTS[0], HEIGHTS[1]).round();
        let time = fixed(self.now().time_s, 1);
        let description = format!("The trial seen from above, {time} s after its start.");
        let size = [WIDTH + 2.0 * MARGIN, height];
        let mut drawing = Drawing::new(heading, &description, size);
        let top = MARGIN + 44.0;
        drawing.place(&picture.drawing("", "", [WIDTH, height]), [MARGIN, top]);
        // Bars in the page's background colour cover shapes that extend beyond the picture.
        let (right, bottom) = (MARGIN + WIDTH, top + height);
        let far = 4.0 * (WIDTH + HEIGHTS[1]);
        let frames = [
            [-far, -far, far, top],
            [-far, bottom, far, far],
            [-far, top, MARGIN, bottom],
            [right, top, far, bottom],
        ];
        drawing.boxes(frames.to_vec(), colours::SURFACE);
        drawing.bold(heading, [MARGIN, MARGIN + 8.0], 17.0, colours::TEXT, Align::Left);
        let below = [MARGIN, MARGIN + 30.0];
        drawing.text(&format!("t = {time} s"), below, 13.0, colours::MUTED, Align::Left);
        let rows = drawing.legend(&self.legend(view), [MARGIN, bottom + 26.0], WIDTH);
        drawing.size = [WIDTH + 2.0 * MARGIN, bottom + 26.0 + rows + 4.0];
        drawing
    }
}
