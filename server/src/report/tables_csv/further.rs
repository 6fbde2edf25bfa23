//! Tables that are not in the paper: behaviour, learning curves, unseen people and importance.

use super::{p_value, places, write};
use sidestep::behaviour::BehaviourSummary;
use sidestep::comparison::Analysis;
use std::io::{self, Write};

/// A fraction with six decimal places.
fn fraction(number: f64) -> String {
    format!("{number:.6}")
}

pub(super) fn behaviour(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "participant,tasks,in_danger,closest_m,least_m,steered,first_turn_left,\
                  robot_on_left,onset_s,onset_distance_m,turning";
    let rows = analysis.behaviour.people.iter().map(|person| {
        let BehaviourSummary { tasks, in_danger, steered, to_left, robot_on_left, .. } = person.all;
        let of = &person.all;
        (
            (&person.name, tasks, in_danger, places(of.closest_m), places(of.least_m)),
            (steered, to_left, robot_on_left),
            (of.onset_s.map(places), of.onset_distance_m.map(places), fraction(of.turning)),
        )
    });
    write(out, header, rows)
}

pub(super) fn behaviour_robots(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "robot,participants,tasks,in_danger,danger_share,danger_low,danger_high,closest_m,\
                  least_m,steered,onset_s,onset_distance_m,turning,robot_to_goal_m";
    let rows = analysis.behaviour.robots.iter().map(|robot| {
        let (of, danger) = (&robot.all, robot.danger_of_people);
        (
            (&robot.name, robot.people, of.tasks, of.in_danger),
            [danger.value, danger.low, danger.high].map(fraction),
            (places(of.closest_m), places(of.least_m), of.steered),
            (of.onset_s.map(places), of.onset_distance_m.map(places), fraction(of.turning)),
            places(of.robot_to_goal_m),
        )
    });
    write(out, header, rows)
}

pub(super) fn behaviour_trials(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "participant,trial,in_danger,closest_m,robot_on_left,onset_s,onset_distance_m,\
                  first_turn,turning";
    let people = analysis.behaviour.people.iter();
    let rows = people.flat_map(|person| person.tasks.iter().map(move |task| (person, task)));
    let rows = rows.map(|(person, task)| {
        let first = task.onset.map_or(0, |onset| if onset.to_left { 1 } else { -1 });
        (
            (&person.name, task.trial, u8::from(task.in_danger), places(task.closest_m)),
            u8::from(task.robot_on_left),
            (task.onset.map(|of| places(of.time_s)), task.onset.map(|of| places(of.distance_m))),
            (first, fraction(task.turning)),
        )
    });
    write(out, header, rows)
}

pub(super) fn learning(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,features,training_tasks,participants,accuracy_percent,\
                  balanced_accuracy_percent";
    let rows = analysis.learning.iter().map(|of| {
        (
            (of.model.word(), of.experiment.number(), &of.features),
            (of.tasks.to_string(), of.people),
            (places(of.accuracy), places(of.balanced)),
        )
    });
    write(out, header, rows)
}

pub(super) fn unseen(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,features,participant,accuracy_percent,own_accuracy_percent,\
                  wilcoxon_persons,wilcoxon_persons_holm,rank_biserial,differing";
    let people = &analysis.comparison.participants;
    let rows = analysis.unseen.iter().flat_map(|of| {
        let each = people.iter().zip(of.accuracies.iter().zip(&of.own.paired.gains));
        each.map(move |(person, (accuracy, gain))| {
            let own = &of.own;
            (
                (own.model.word(), own.experiment.number(), &of.features, &person.name),
                (places(*accuracy), places(accuracy + gain)),
                (p_value(own.paired.p), p_value(own.holm), places(own.paired.rank_biserial)),
                own.paired.differing,
            )
        })
    });
    write(out, header, rows)
}

pub(super) fn importance(analysis: &Analysis, out: &mut dyn Write) -> io::Result<()> {
    let header = "model,experiment,features,permuted,participant,loss";
    let people = &analysis.comparison.participants;
    let rows = analysis.importance.iter().flat_map(|of| {
        people.iter().zip(&of.losses).map(move |(person, loss)| {
            (
                (of.model.word(), of.experiment.number(), &of.features, &of.permuted),
                (&person.name, places(*loss)),
            )
        })
    });
    write(out, header, rows)
}
