//! Charts of people's behaviour, and of its change from the first tasks to the last.

use super::{Figure, figure, range};
use sidestep::behaviour::{Behaviour, BehaviourSummary, PARTS};
use sidestep::chart::{Axis, Chart, Group, Mark, Swarm, colours, fixed};
use sidestep::comparison::Analysis;

/// A measure of one part of a participant's tasks. `None` if no task of the part has this measure.
type Of = fn(&BehaviourSummary) -> Option<f64>;

/// A chart for each measure, with a dot for each person and a column for each part of their tasks.
pub(super) fn behaviour(analysis: &Analysis) -> Option<Figure> {
    const MEASURES: [(&str, &str, &str, Of); 3] = [
        ("In the danger zone", "tasks", "%", |of| {
            Some(100.0 * of.in_danger as f64 / of.tasks as f64)
        }),
        ("Closest distance", "mean distance", "m", |of| Some(of.closest_m)),
        ("First turn", "mean time", "s", |of| of.onset_s),
    ];
    let of = &analysis.behaviour;
    let charts: Vec<Chart> = MEASURES.iter().filter_map(|measure| chart(of, measure)).collect();
    (!charts.is_empty()).then(|| figure("behaviour", &charts, 220.0))
}

fn chart(of: &Behaviour, (heading, name, unit, value): &(&str, &str, &str, Of)) -> Option<Chart> {
    let group = |(values, mean)| Group { values, centre: mean, interval: None };
    let groups: Vec<Group> = of.by_part(value).into_iter().map(group).collect();
    let numbers = groups.iter().flat_map(|group| group.values.iter().copied());
    numbers.clone().next()?;
    let x = Axis::categories("", (1..=PARTS).map(|part| format!("fifth {part}")));
    let y = Axis::round(name, unit, range(numbers), 5);
    let means: Vec<String> = groups.iter().map(|group| fixed(group.centre, 1)).collect();
    let description = format!("Means over people, fifth by fifth: {}.", means.join(", "));
    let mut chart = Chart::new(heading, &description, x, y);
    chart.add(Swarm {
        name: "a person".to_owned(),
        groups,
        mark: Mark::Circle,
        ink: colours::HUMAN.at(0.55),
        centre: "mean",
        interval: None,
        places: 1,
    });
    Some(chart)
}
