use super::super::{Form, Group, Mark, colours, disc};
use super::*;

fn frame() -> Frame {
    Frame { left: 40.0, top: 20.0, width: 300.0, height: 150.0 }
}

fn chart() -> Chart {
    let (x, y) =
        (Axis::linear("time", "s", [0.0, 10.0], 5), Axis::linear("share", "", [0.0, 1.0], 5));
    Chart::new("title", "description", x, y)
}

#[test]
fn numbers_are_where_the_axes_say() {
    let chart = chart();
    assert_eq!(chart.place(frame(), [0.0, 0.0]), [40.0, 170.0]);
    assert_eq!(chart.place(frame(), [10.0, 1.0]), [340.0, 20.0]);
    let svg = chart.drawing([340.0, 200.0]).svg();
    for word in
        ["<title>title</title>", "<desc>description</desc>", ">time (s)<", ">share<", ">0.4<"]
    {
        assert!(svg.contains(word), "{word} in {svg}");
    }
}

#[test]
fn nothing_is_drawn_outside_of_the_frame() {
    let mut chart = chart();
    chart.add(
        Series::line("far", [[-5.0, 0.5], [20.0, 0.5]], colours::HUMAN, 1.0).marked(Mark::Square),
    );
    let fill = Some(colours::ROBOT.into());
    let edge = Some(Pen::new(colours::ROBOT, 1.0));
    chart.add(Area { name: "zone".into(), points: disc([10.0, 0.5], 0.4), fill, edge });
    chart.add(Cells {
        ink: colours::MAP.into(),
        boxes: vec![[9.0, 0.9, 12.0, 1.3], [11.0, 0.0, 12.0, 1.0]],
    });
    let mut drawing = Drawing::new("", "", [400.0, 200.0]);
    chart.draw_layers(&mut drawing, frame());
    let mut points = Vec::new();
    for shape in &drawing.shapes {
        match &shape.form {
            Form::Line(of) | Form::Polygon(of) => points.extend(of.clone()),
            Form::Boxes(of) => points.extend(of.iter().flat_map(|&[l, t, r, b]| [[l, t], [r, b]])),
            other => panic!("{other:?}"),
        }
    }
    assert!(points.len() > 100 && points.iter().all(|point| frame().holds(*point)));
    // The two marks of the line and one of the cells are outside, so they are not drawn.
    assert_eq!(drawing.shapes.len(), 4);
}

#[test]
fn named_layers_are_in_legend_and_table() {
    let mut chart = chart();
    chart.add(Series::line("a", [[0.0, 0.25], [5.0, 0.5]], colours::HUMAN, 2.0));
    chart.add(Series::line("b", [[5.0, 1.0], [10.0, 0.0]], colours::ROBOT, 2.0));
    chart.add(Series::line("", [[0.0, 0.0], [10.0, 1.0]], colours::MUTED, 1.0));
    assert_eq!(chart.legend().iter().map(|item| &item.text[..]).collect::<Vec<_>>(), ["a", "b"]);
    let Table { columns, rows, .. } = chart.table();
    assert_eq!(columns, ["time (s)", "a", "b"]);
    assert_eq!(rows, [["0", "0.25", ""], ["5", "0.5", "1"], ["10", "", "0"]]);
}

#[test]
fn a_swarm_has_a_place_for_each_category() {
    let groups = vec![
        Group { values: vec![1.0, 3.0], centre: 2.0, interval: Some([1e-9, 3.5]) },
        Group { values: vec![], centre: f64::NAN, interval: None },
    ];
    let ink = colours::SERIES[0].at(0.5);
    let swarm = Swarm {
        name: "a person".into(),
        groups,
        mark: Mark::Circle,
        ink,
        centre: "median",
        interval: Some("90 % interval"),
        places: 1,
    };
    let names = Axis::categories("model", ["SVM", "LR"]).downwards();
    let mut chart = Chart::new("", "", Axis::round("gain", "points", [0.0, 4.0], 4), names);
    chart.add(swarm);
    let Table { columns, rows, .. } = chart.table();
    assert_eq!(
        columns[1..],
        [
            "median gain (points)",
            "least gain (points)",
            "greatest gain (points)",
            "90 % interval, gain (points)",
            "number"
        ]
    );
    assert_eq!(rows[0], ["SVM", "2.0", "1.0", "3.0", "just above 0 to 3.5", "2"]);
    assert_eq!(rows[1], ["LR", "", "", "", "", "0"]);
    let legend: Vec<String> = chart.legend().into_iter().map(|item| item.text).collect();
    assert_eq!(legend, ["a person", "median and its 90 % interval"]);
    let mut drawing = Drawing::new("", "", [400.0, 200.0]);
    chart.draw_layers(&mut drawing, frame());
    // Two dots, an interval and a diamond, all in the upper half.
    assert_eq!(drawing.shapes.len(), 4);
    let Form::Line(interval) = &drawing.shapes[2].form else { panic!("an interval") };
    assert!(interval.iter().all(|[_, y]| (y - 57.5).abs() < 1e-9), "{interval:?}");
}
