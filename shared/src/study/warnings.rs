//! Plausibility checks of a study file. Likely mistakes, such as degrees for radians, are errors; a
//! recruiting service without a return URL is only a warning.

use super::StudyConfig;
use crate::invalid::Invalid;
use crate::math::{PI, TAU};

impl StudyConfig {
    /// Checks that the parameters are plausible for a study with people. [`StudyConfig::check`]
    /// accepts more, because recordings from elsewhere may have other parameters.
    ///
    /// # Errors
    /// [`Invalid`] naming the field, with the likely mistake.
    pub fn check_plausible(&self) -> Result<(), Invalid> {
        let parameters = &self.parameters;
        let refuse = |field: &str, expected: &str, found: f64, mistake: String| {
            let found = format!("{found}{mistake}");
            Err(Invalid::new(format!("parameters.{field}"), expected, found))
        };
        for (name, vehicle) in [("human", parameters.human), ("robot", parameters.robot)] {
            let rate = vehicle.turn_rate_radps;
            if rate > TAU {
                let expected = "at most 6.28 rad/s (a full turn in a second)";
                let mistake = format!("; as degrees it would be {:.4} rad/s", rate * PI / 180.0);
                return refuse(&format!("{name}.turn_rate_radps"), expected, rate, mistake);
            }
            let speed = vehicle.speed_mps;
            if !(0.05..=50.0).contains(&speed) {
                let field = format!("{name}.speed_mps");
                return refuse(&field, "a speed from 0.05 to 50 m/s", speed, String::new());
            }
        }
        let step_s = parameters.step_s;
        if !(0.02..=1.0).contains(&step_s) {
            let mistake = match step_s > 1.0 {
                true => format!("; as milliseconds it would be {} s", step_s / 1000.0),
                false => String::new(),
            };
            return refuse("step_s", "a step from 0.02 to 1 s", step_s, mistake);
        }
        let duration_s = parameters.duration_s();
        if !(3.0..=120.0).contains(&duration_s) {
            let mistake = format!(
                " (a scene of {} s); the paper has 50 steps of 0.2 s",
                (1000.0 * duration_s).round() / 1000.0
            );
            let expected = "scenes of 3 to 120 s (steps × step_s)";
            return refuse("steps", expected, parameters.steps as f64, mistake);
        }
        Ok(())
    }

    /// Optional fields that were probably forgotten, with the consequence of each.
    #[must_use]
    pub fn forgotten(&self) -> Vec<(&'static str, String)> {
        let recruitment = &self.recruitment;
        let mut found = Vec::new();
        if recruitment.require_external_id && recruitment.completed_url.is_empty() {
            let what = "none is given, so participants from a recruiting service must enter \
                        their completion code there themselves";
            found.push(("recruitment.completed_url", what.to_owned()));
        }
        // A URL for participants who completed the study implies a recruiting service. Other
        // participants should be able to return to this service, too.
        if !recruitment.completed_url.is_empty() {
            let is_missing = |(field, url): &(&str, &str)| {
                url.is_empty() && (*field != "full_url" || recruitment.quota > 0)
            };
            let missing = recruitment.early_urls().into_iter().filter(is_missing);
            let missing: Vec<_> = missing.map(|(field, _)| field).collect();
            if !missing.is_empty() {
                let what = format!(
                    "no {}, so people whose participation ends this way see the reason, but no link back",
                    missing.join(", ")
                );
                found.push(("recruitment", what));
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_service_without_a_way_back_is_said() {
        let mut study = StudyConfig::default();
        assert_eq!(study.forgotten(), []);
        study.recruitment.require_external_id = true;
        let [(field, what)] = &study.forgotten()[..] else { panic!("{:?}", study.forgotten()) };
        assert_eq!(*field, "recruitment.completed_url");
        assert!(what.starts_with("none is given"), "{what}");
        study.recruitment.return_hosts = vec!["app.prolific.com".into()];
        let url = "https://app.prolific.com/submissions/complete";
        study.recruitment.completed_url = url.into();
        study.check().unwrap();
        // The URLs for all other endings are missing. `full_url` is not needed, because a study
        // without a quota is never full.
        let [(field, what)] = &study.forgotten()[..] else { panic!("{:?}", study.forgotten()) };
        assert_eq!(*field, "recruitment");
        assert!(
            what.starts_with("no screened_out_url, withdrawn_url, finished_url, closed_url,"),
            "{what}"
        );
        study.recruitment.quota = 9;
        assert!(study.forgotten()[0].1.contains("full_url"));
        let recruitment = &mut study.recruitment;
        for early in [
            &mut recruitment.screened_out_url,
            &mut recruitment.withdrawn_url,
            &mut recruitment.finished_url,
            &mut recruitment.full_url,
            &mut recruitment.closed_url,
        ] {
            *early = url.into();
        }
        study.check().unwrap();
        assert_eq!(study.forgotten(), []);
    }

    #[test]
    fn likely_mistakes_are_refused_with_a_reason() {
        let complain = |change: fn(&mut StudyConfig)| {
            let mut study = StudyConfig::default();
            study.check_plausible().unwrap();
            change(&mut study);
            study.check().unwrap();
            study.check_plausible().unwrap_err().to_string()
        };
        let said = complain(|s| s.parameters.human.turn_rate_radps = 28.6);
        assert!(said.contains("human.turn_rate_radps") && said.contains("0.4992 rad/s"), "{said}");
        let said = complain(|s| s.parameters.step_s = 200.0);
        assert!(said.contains("step_s") && said.contains("0.2 s"), "{said}");
        let said = complain(|s| s.parameters.steps = 5);
        assert!(said.contains("steps") && said.contains("a scene of 1 s"), "{said}");
        let said = complain(|s| s.parameters.robot.speed_mps = 200.0);
        assert!(said.contains("robot.speed_mps"), "{said}");
    }
}
