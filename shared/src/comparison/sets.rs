//! The feature sets of a comparison.

use crate::features::{FeatureSet, HISTORY_SET};
use crate::invalid::Invalid;
use serde::Serialize;

/// A named feature set.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct NamedSet {
    /// The name of the set in tables.
    pub name: String,
    /// The features of the set.
    pub features: FeatureSet,
}

/// The letters of the paper's seven sets, in the order of the tables.
pub const PAPERS_SETS: [&str; 7] = ["hrd", "hr", "hd", "rd", "h", "r", "d"];

/// Sets that add the robot's position in the human's body frame to one of the paper's sets. They
/// show how much this position explains. Unlike absolute differences in the world frame, it
/// contains the side on which the robot is. Each entry has the new set and the paper's set that it
/// extends.
pub const BODY_FRAME_SETS: [(&str, &str); 2] = [("hrd_body", "hrd"), ("d_body", "d")];

impl NamedSet {
    /// The paper's seven sets.
    ///
    /// # Errors
    /// Never, because all names are valid.
    pub fn papers() -> Result<Vec<Self>, Invalid> {
        let set =
            |name: &str| Ok(Self { name: name.to_owned(), features: FeatureSet::subset(name)? });
        PAPERS_SETS.into_iter().map(set).collect()
    }

    /// Two of the paper's sets, extended by the robot's position in the human's body frame.
    ///
    /// # Errors
    /// Never, because all names are valid.
    pub fn with_body_frame() -> Result<Vec<Self>, Invalid> {
        let set = |(name, papers): (&str, _)| {
            let mut names: Vec<String> = FeatureSet::subset(papers)?.into();
            names.extend(["robot_ahead", "robot_left"].map(str::to_owned));
            Ok(Self { name: name.to_owned(), features: FeatureSet::of(&names)? })
        };
        BODY_FRAME_SETS.into_iter().map(set).collect()
    }

    /// The set [`HISTORY_SET`].
    ///
    /// # Errors
    /// Never, because all names are valid.
    pub fn with_history() -> Result<Self, Invalid> {
        Ok(Self { name: HISTORY_SET.to_owned(), features: FeatureSet::with_history()? })
    }
}
