//! The split into training and test trials.
//!
//! Whole trials are held out. Neighbouring steps are so similar that a model trained on one step
//! would already know the next step.

use crate::dataset::Dataset;

/// Number of folds of cross-validation.
pub const FOLDS: usize = 5;

/// Minimum number of tasks of a compared participant.
pub const LEAST_TASKS: usize = FOLDS;

/// Index of the first test task, if a participant has `tasks` tasks. The last fifth of the tasks is
/// for testing, but at least one task (none if there are no tasks).
#[must_use]
pub fn first_test_task(tasks: usize) -> usize {
    tasks - (tasks / 5).max(1).min(tasks)
}

/// The fold that holds out the task with this index.
#[must_use]
pub fn fold_of(task: usize) -> usize {
    task % FOLDS
}

/// A split of the rows of one participant's tasks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Training rows, ascending.
    pub training: Vec<usize>,
    /// The fold of each training row.
    pub folds: Vec<usize>,
    /// Test rows, ascending.
    pub test: Vec<usize>,
}

impl Split {
    /// Splits by whole tasks. The last fifth is for testing. The other tasks are assigned to the
    /// folds cyclically.
    #[must_use]
    pub fn grouped(data: &Dataset) -> Self {
        let tasks = data.trials.iter().max().map_or(0, |last| last + 1);
        let first_test = first_test_task(tasks);
        let (training, test): (Vec<usize>, Vec<usize>) =
            (0..data.len()).partition(|&row| data.trials[row] < first_test);
        let folds = training.iter().map(|&row| fold_of(data.trials[row])).collect();
        Self { training, folds, test }
    }

    /// Like [`Self::grouped`], but only the first `tasks` tasks are for training.
    #[must_use]
    pub fn of_first_tasks(data: &Dataset, tasks: usize) -> Self {
        let all = Self::grouped(data);
        let training: Vec<usize> =
            all.training.into_iter().filter(|&row| data.trials[row] < tasks).collect();
        let folds = training.iter().map(|&row| fold_of(data.trials[row])).collect();
        Self { training, folds, test: all.test }
    }

    /// Splits by time step, regardless of trials. Every fifth row is for testing. The other rows
    /// are assigned to the folds cyclically. This split is **wrong**. It exists to show how much
    /// such a split overstates accuracy.
    #[must_use]
    pub fn leaking(data: &Dataset) -> Self {
        let (test, training): (Vec<usize>, Vec<usize>) =
            (0..data.len()).partition(|row| row % FOLDS == FOLDS - 1);
        let folds = (0..training.len()).map(fold_of).collect();
        Self { training, folds, test }
    }

    /// The training rows outside `fold` and the training rows in `fold`, as indices into
    /// [`Self::training`].
    #[must_use]
    pub fn fold(&self, fold: usize) -> (Vec<usize>, Vec<usize>) {
        (0..self.training.len()).partition(|&place| self.folds[place] != fold)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::features::FeatureSet;
    use crate::vehicle::TurnInput;

    fn data(tasks: usize, steps: usize) -> Dataset {
        Dataset {
            features: FeatureSet::of(&["distance"]).unwrap(),
            values: vec![0.0; tasks * steps],
            labels: vec![TurnInput::Straight; tasks * steps],
            trials: (0..tasks * steps).map(|row| row / steps).collect(),
        }
    }

    #[test]
    fn the_papers_fifty_tasks() {
        let data = data(50, 50);
        let split = Split::grouped(&data);
        assert_eq!((split.training.len(), split.test.len()), (2000, 500));
        assert_eq!(split.test[0], 40 * 50);
        for fold in 0..FOLDS {
            let (learned, held) = split.fold(fold);
            assert_eq!((learned.len(), held.len()), (1600, 400));
            let tasks = |rows: &[usize]| {
                let mut tasks: Vec<usize> = rows.iter().map(|&row| row / 50).collect();
                tasks.dedup();
                tasks
            };
            assert!(tasks(&held).iter().all(|task| task % 5 == fold));
            assert!(tasks(&learned).iter().all(|task| !tasks(&held).contains(task)));
        }
    }

    #[test]
    fn fewer_tasks_train_and_the_same_tasks_test() {
        let data = data(50, 50);
        let (split, all) = (Split::of_first_tasks(&data, 10), Split::grouped(&data));
        assert_eq!(split.training, (0..500).collect::<Vec<_>>());
        assert_eq!(split.folds[..], all.folds[..500]);
        assert_eq!(split.test, all.test);
        assert_eq!(Split::of_first_tasks(&data, 60), all);
    }

    #[test]
    fn the_last_fifth_tests() {
        assert_eq!([5, 7, 10, 14, 50].map(first_test_task), [4, 6, 8, 12, 40]);
        assert_eq!([0, 1].map(first_test_task), [0, 0]);
    }

    #[test]
    fn a_leaking_split_has_every_trial_on_both_sides() {
        let data = data(10, 50);
        let split = Split::leaking(&data);
        assert_eq!((split.training.len(), split.test.len()), (400, 100));
        for task in 0..10 {
            assert_eq!(split.test.iter().filter(|&&row| row / 50 == task).count(), 10);
        }
    }
}
