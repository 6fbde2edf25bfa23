//! Clips curves to a rectangle, which is given as left, top, right, bottom.

use super::drawing::{Drawing, Form, Point, Shape};
use crate::math::{TAU, sin_cos};

/// Number of vertices of a circle that is clipped.
const CORNERS: usize = 96;

impl Drawing {
    /// Clips all shapes to the drawing's size. Text stays if its anchor is inside.
    pub fn cut(&mut self) {
        let frame @ [_, _, right, bottom] = [0.0, 0.0, self.size[0], self.size[1]];
        let is_inside = |[x, y]: Point| (0.0..=right).contains(&x) && (0.0..=bottom).contains(&y);
        for shape in core::mem::take(&mut self.shapes) {
            match &shape.form {
                Form::Line(points) => self.cut_line(points, &shape, frame),
                Form::Polygon(points) => self.cut_polygon(points, &shape, frame),
                Form::Circle { centre: [x, y], radius } => {
                    let corner = |i: usize| {
                        let (sin, cos) = sin_cos(i as f64 * TAU / CORNERS as f64);
                        [x + radius * cos, y + radius * sin]
                    };
                    let corners: Vec<Point> = (0..CORNERS).map(corner).collect();
                    match corners.iter().all(|&corner| is_inside(corner)) {
                        true => self.shapes.push(shape),
                        false => self.cut_polygon(&corners, &shape, frame),
                    }
                }
                Form::Boxes(boxes) => {
                    let cut = |[a, b, c, d]: &[f64; 4]| {
                        [a.max(0.0), b.max(0.0), c.min(right), d.min(bottom)]
                    };
                    let boxes = boxes.iter().map(cut).filter(|[a, b, c, d]| a < c && b < d);
                    self.shapes.push(Shape { form: Form::Boxes(boxes.collect()), ..shape });
                }
                Form::Text(text) if is_inside(text.at) => self.shapes.push(shape),
                Form::Text(_) => {}
            }
        }
    }

    fn cut_line(&mut self, points: &[Point], shape: &Shape, frame: [f64; 4]) {
        let pieces = line_inside(points, frame).into_iter().filter(|piece| piece.len() > 1);
        self.shapes.extend(pieces.map(|piece| Shape {
            form: Form::Line(piece),
            fill: None,
            ..shape.clone()
        }));
    }

    /// Clips the area and its outline separately, because the frame is not part of the outline.
    fn cut_polygon(&mut self, points: &[Point], shape: &Shape, frame: [f64; 4]) {
        let inside = polygon_inside(points, frame);
        if inside.len() > 2 {
            self.shapes.push(Shape { form: Form::Polygon(inside), stroke: None, ..shape.clone() });
        }
        if shape.stroke.is_some() {
            let around: Vec<Point> = points.iter().chain(points.first()).copied().collect();
            self.cut_line(&around, shape, frame);
        }
    }
}

/// The pieces of a polyline inside the rectangle (Liang and Barsky). Non-finite points split it.
pub(super) fn line_inside(line: &[Point], [left, top, right, bottom]: [f64; 4]) -> Vec<Vec<Point>> {
    let mut pieces: Vec<Vec<Point>> = Vec::new();
    let mut joined = false;
    for (from, to) in line.iter().zip(line.iter().skip(1)) {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        // Fractions of the segment at which it enters and leaves the rectangle.
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for (speed, room) in [
            (-dx, from[0] - left),
            (dx, right - from[0]),
            (-dy, from[1] - top),
            (dy, bottom - from[1]),
        ] {
            if speed < 0.0 {
                enters = enters.max(room / speed);
            } else if speed > 0.0 {
                leaves = leaves.min(room / speed);
            } else if room < 0.0 {
                leaves = -1.0;
            }
        }
        if !(dx.is_finite() && dy.is_finite()) || enters > leaves {
            joined = false;
            continue;
        }
        let at = |share: f64| [from[0] + share * dx, from[1] + share * dy];
        let end = if leaves < 1.0 { at(leaves) } else { *to };
        match pieces.last_mut() {
            Some(piece) if joined && enters == 0.0 => piece.push(end),
            _ => pieces.push(vec![if enters > 0.0 { at(enters) } else { *from }, end]),
        }
        joined = leaves == 1.0;
    }
    pieces
}

/// The part of a polygon inside the rectangle (Sutherland and Hodgman). Empty if the polygon is
/// outside.
pub(super) fn polygon_inside(
    polygon: &[Point],
    [left, top, right, bottom]: [f64; 4],
) -> Vec<Point> {
    let mut inside: Vec<Point> = polygon.to_vec();
    // Axis, limit, and whether the part above the limit stays.
    for (axis, limit, above) in
        [(0, left, true), (0, right, false), (1, top, true), (1, bottom, false)]
    {
        let depth = |p: &Point| if above { p[axis] - limit } else { limit - p[axis] };
        let mut kept = Vec::with_capacity(inside.len() + 4);
        for (from, to) in inside.iter().zip(inside.iter().cycle().skip(1)) {
            let (a, b) = (depth(from), depth(to));
            if a >= 0.0 {
                kept.push(*from);
            }
            if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
                let share = a / (a - b);
                kept.push([0, 1].map(|d| from[d] + share * (to[d] - from[d])));
            }
        }
        inside = kept;
    }
    inside
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{Align, Pen, colours};

    #[test]
    fn a_drawing_is_cut_at_its_edges() {
        let mut drawing = Drawing::new("", "", [10.0, 8.0]);
        let pen = Pen::new(colours::TEXT, 1.0);
        drawing.line(vec![[-5.0, 4.0], [15.0, 4.0]], pen);
        drawing.polygon(
            vec![[8.0, 6.0], [20.0, 6.0], [20.0, 20.0], [8.0, 20.0]],
            Some(colours::HUMAN.into()),
            Some(pen),
        );
        drawing.circle([5.0, 4.0], 1.0, None, Some(pen));
        drawing.circle([0.0, 0.0], 3.0, None, Some(pen));
        drawing.boxes(vec![[-1.0, -1.0, 2.0, 2.0], [20.0, 0.0, 30.0, 1.0]], colours::SURFACE);
        drawing.text("in", [1.0, 1.0], 12.0, colours::TEXT, Align::Left);
        drawing.text("out", [-1.0, 1.0], 12.0, colours::TEXT, Align::Left);
        drawing.cut();
        let points: Vec<Point> = drawing
            .shapes
            .iter()
            .flat_map(|shape| match &shape.form {
                Form::Line(points) | Form::Polygon(points) => points.clone(),
                Form::Boxes(boxes) => boxes.iter().map(|&[a, b, ..]| [a, b]).collect(),
                Form::Circle { centre, .. } => vec![*centre],
                Form::Text(text) => vec![text.at],
            })
            .collect();
        let near = |x: f64, most: f64| (-1e-9..=most + 1e-9).contains(&x);
        assert!(points.iter().all(|&[x, y]| near(x, 10.0) && near(y, 8.0)), "{points:?}");
        let forms = &drawing.shapes;
        assert_eq!(forms[0].form, Form::Line(vec![[0.0, 4.0], [10.0, 4.0]]));
        // The area ends at the frame, and its outline is open there.
        assert!(matches!(&forms[1].form, Form::Polygon(area) if area.len() == 4));
        assert!(forms[1].stroke.is_none() && matches!(&forms[2].form, Form::Line(_)));
        let words = forms.iter().filter(|shape| matches!(shape.form, Form::Text(_))).count();
        let circles = forms.iter().filter(|shape| matches!(shape.form, Form::Circle { .. }));
        assert_eq!((words, circles.count()), (1, 1));
    }

    const FRAME: [f64; 4] = [0.0, 0.0, 10.0, 10.0];

    #[test]
    fn a_line_is_cut_at_the_frame() {
        let inside = [[1.0, 1.0], [5.0, 5.0], [9.0, 1.0]];
        assert_eq!(line_inside(&inside, FRAME), [inside.to_vec()]);
        // The line leaves on the right and enters again from above.
        let line = [[5.0, 5.0], [15.0, 5.0], [15.0, -5.0], [5.0, -5.0], [5.0, 5.0]];
        let pieces = line_inside(&line, FRAME);
        assert_eq!(pieces, [vec![[5.0, 5.0], [10.0, 5.0]], vec![[5.0, 0.0], [5.0, 5.0]]]);
        assert!(line_inside(&[[-1.0, -5.0], [-1.0, 15.0]], FRAME).is_empty());
        assert_eq!(line_inside(&[[-5.0, 3.0], [15.0, 3.0]], FRAME), [[[0.0, 3.0], [10.0, 3.0]]]);
    }

    #[test]
    fn a_number_that_is_none_parts_a_line() {
        let line = [[1.0, 1.0], [2.0, 2.0], [3.0, f64::NAN], [4.0, 4.0], [5.0, 5.0]];
        let pieces = line_inside(&line, FRAME);
        assert_eq!(pieces, [[[1.0, 1.0], [2.0, 2.0]], [[4.0, 4.0], [5.0, 5.0]]]);
    }

    #[test]
    fn a_polygon_is_cut_at_the_frame() {
        let square = [[5.0, 5.0], [15.0, 5.0], [15.0, 15.0], [5.0, 15.0]];
        let cut = polygon_inside(&square, FRAME);
        assert_eq!(cut, [[5.0, 5.0], [10.0, 5.0], [10.0, 10.0], [5.0, 10.0]]);
        assert!(polygon_inside(&[[11.0, 1.0], [12.0, 1.0], [12.0, 2.0]], FRAME).is_empty());
        // This polygon contains the whole frame.
        let around = [[-9.0, -9.0], [99.0, -9.0], [99.0, 99.0], [-9.0, 99.0]];
        assert_eq!(polygon_inside(&around, FRAME).len(), 4);
    }
}
