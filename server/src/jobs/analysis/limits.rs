//! Upper bounds on the cost of an analysis. An estimate of the cost is checked before the analysis
//! is accepted.

use crate::store::studies::StoredStudy;
use crate::store::{Store, StoreError};
use sidestep::comparison::models::Grids;
use sidestep::comparison::{Cost, Request};
use sidestep::invalid::Invalid;
use sidestep::trial::Phase;

/// Upper bounds on the cost of an analysis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Memory (MiB).
    pub memory_mib: u64,
    /// Processor time (hours of one processor).
    pub hours: f64,
    /// Number of threads that share the memory.
    pub threads: usize,
}

/// The ways to make a request cheaper. Each has the field to change, the cheaper request, and a
/// description.
fn lighter(request: &Request) -> Vec<(String, Request, &'static str)> {
    let with = |field: &str, change: fn(&mut Request), how| {
        let mut lighter = request.clone();
        change(&mut lighter);
        (field.to_owned(), lighter, how)
    };
    let grid = |name| {
        let lighter = Request { grids: request.grids.with_protocols(name), ..request.clone() };
        (format!("grids.{name}"), lighter, "with the protocol's values")
    };
    let mut ways = vec![with("sets", |request| request.sets.clear(), "without them")];
    ways.extend(Grids::names().map(grid));
    ways.push(with("leakage", |request| request.leakage = false, "without it"));
    ways.push(with("paper_only", |request| request.paper_only = true, "with it"));
    ways
}

impl Limits {
    /// Estimates the cost of an analysis of the study in its present state.
    ///
    /// # Errors
    /// The outer error if the database cannot be read. The inner error if the analysis would cost
    /// too much; it names the field that costs most.
    pub async fn check(
        &self,
        store: &Store,
        study: &StoredStudy,
        request: &Request,
    ) -> Result<Result<Cost, Invalid>, StoreError> {
        let tasks: Vec<usize> = store
            .roster(study.id, false)
            .await?
            .into_iter()
            .filter(|entry| entry.exclusion.is_none())
            .map(|entry| Phase::ALL.iter().zip(entry.trials))
            .filter_map(|trials| {
                let mut tasks = trials.filter(|(phase, _)| **phase == Phase::Task);
                tasks.next()?.1.try_into().ok()
            })
            .collect();
        Ok(self.compare(request, &tasks, study.config.parameters.steps))
    }

    /// Like [`Self::check`], for participants with these numbers of tasks.
    fn compare(&self, request: &Request, tasks: &[usize], steps: usize) -> Result<Cost, Invalid> {
        let of = |request: &Request| {
            Ok::<_, Invalid>(Cost::of(&request.settings()?, tasks, steps, self.threads))
        };
        let cost = of(request)?;
        let excess = |cost: &Cost| {
            let [hours, memory_mib] = figures(cost);
            f64::max(hours / self.hours, memory_mib / self.memory_mib as f64)
        };
        if excess(&cost) <= 1.0 {
            return Ok(cost);
        }
        let mut best: Option<(String, &str, Cost)> = None;
        for (field, lighter, how) in lighter(request) {
            let lighter = of(&lighter)?;
            let least = best.as_ref().map_or(&cost, |(.., least)| least);
            if excess(&lighter) < excess(least) {
                best = Some((field, how, lighter));
            }
        }
        let (hours, memory_mib) = (self.hours, self.memory_mib);
        let expected = format!(
            "an analysis that takes at most {hours} hours of one processor and {memory_mib} MiB of memory, \
             as this server allows (--analysis-hours, --analysis-memory)"
        );
        let (field, advice) = match best {
            Some((field, how, lighter)) => (field, format!("{how}, {}", said(&lighter))),
            None => {
                ("paper_only".to_owned(), "run the command `sidestep analyze` instead".to_owned())
            }
        };
        let found = format!("one that is estimated to take {}; {advice}", said(&cost));
        Err(Invalid::new(field, expected, found))
    }
}

/// The cost as processor hours and MiB.
fn figures(cost: &Cost) -> [f64; 2] {
    [cost.processor_s / 3600.0, cost.memory_bytes / f64::from(1 << 20)]
}

fn said(cost: &Cost) -> String {
    let [hours, memory_mib] = figures(cost);
    format!("{hours:.1} hours and {memory_mib:.0} MiB")
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { memory_mib: 2048, hours: 24.0, threads: 1 };

    fn refused(json: &str, people: usize, tasks: usize) -> Invalid {
        let request = serde_json::from_str(json).unwrap();
        LIMITS.compare(&request, &vec![tasks; people], 50).unwrap_err()
    }

    #[test]
    fn a_study_of_a_laboratory_is_accepted() {
        let request = Request { leakage: true, ..Request::default() };
        let cost = LIMITS.compare(&request, &[50; 100], 50).unwrap();
        assert!(cost.processor_s > 60.0 && cost.processor_s < 7200.0, "{cost:?}");
    }

    #[test]
    fn what_costs_most_is_named_with_figures() {
        let values: Vec<String> = (1..=64).map(|value| value.to_string()).collect();
        let values = values.join(",");
        let gammas = format!(r#"{{"grids": {{"rbf_gamma": [{values}]}}}}"#);
        let refused = refused(&gammas, 80, 100);
        assert_eq!(refused.field, "grids.rbf_gamma");
        for words in ["24 hours", "2048 MiB", "--analysis-hours", "--analysis-memory"] {
            assert!(refused.expected.contains(words), "{refused}");
        }
        assert!(refused.found.contains("with the protocol's values, "), "{refused}");
    }

    #[test]
    fn other_ways_are_named_where_grids_are_the_protocols() {
        assert_eq!(refused("{}", 4000, 100).field, "paper_only");
        let papers = refused(r#"{"paper_only": true}"#, 100_000, 100);
        assert!(papers.found.contains("sidestep analyze"), "{papers}");
    }
}
