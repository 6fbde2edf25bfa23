//! `sidestep retention`.

use super::{CommandError, print_json, study_named};
use crate::store::audit::NewEntry;
use crate::store::retention::{Concern, Due};
use crate::store::studies::StoredStudy;
use crate::store::{Purpose, Store};
use crate::support::clock::{date_time, now_ms};
use clap::ArgGroup;
use serde::Serialize;
use sidestep::api::Action;

/// The actor in the audit trail.
const WHO: &str = "sidestep retention";

const DAY_MS: i64 = 86_400_000;

/// List data past their retention period, by rules, and delete them with --delete.
///
/// Without --delete, the summary only lists what would be deleted. The audit trail has an entry for
/// each deletion. A participant may be listed under several rules. Participants who return before
/// their deletion are kept. Backups are separate files; delete old backups too.
///
/// Prints a JSON summary.
#[derive(Clone, Debug, clap::Args)]
#[command(group = ArgGroup::new("rule").required(true).multiple(true)
    .args(["data", "unfinished", "identities", "analyses", "audit"]))]
pub struct RetentionArgs {
    /// Database: sqlite:FILE or postgres://USER@HOST/DATABASE. A server may use it at the same time.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
    /// Only the study with this name [default: all studies].
    #[arg(long, value_name = "SLUG", conflicts_with = "audit")]
    pub study: Option<String>,
    /// Delete all data of participants last seen more than DAYS days ago.
    ///
    /// Also deletes the results of analyses that used these data. The participants' numbers remain
    /// and count as withdrawn.
    #[arg(long, value_name = "DAYS", value_parser = days())]
    pub data: Option<i64>,
    /// Like --data, but only for participants who did not finish the study.
    #[arg(long, value_name = "DAYS", value_parser = days())]
    pub unfinished: Option<i64>,
    /// Delete external ids and recruitment parameters of participants last seen more than DAYS days ago.
    ///
    /// Their trials are kept.
    #[arg(long, value_name = "DAYS", value_parser = days())]
    pub identities: Option<i64>,
    /// Delete analyses that ended more than DAYS days ago, with their files.
    #[arg(long, value_name = "DAYS", value_parser = days())]
    pub analyses: Option<i64>,
    /// Delete entries of the audit trail that are older than DAYS days.
    #[arg(long, value_name = "DAYS", value_parser = days())]
    pub audit: Option<i64>,
    /// Delete instead of only listing.
    #[arg(long)]
    pub delete: bool,
}

fn days() -> clap::builder::RangedI64ValueParser {
    clap::value_parser!(i64).range(1..=36_500)
}

/// The data in one study that one rule affects.
#[derive(Debug, Serialize)]
struct Concerned {
    rule: &'static str,
    /// The cut-off time. Only older data are affected.
    before: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    study: Option<String>,
    count: usize,
    /// The numbers of participants, or the ids of analyses.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    which: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Summary {
    /// Whether the data were deleted or only listed.
    deleted: bool,
    rules: Vec<Concerned>,
}

/// Applies the given rules, deletes data if requested, and prints the result.
///
/// # Errors
/// [`CommandError`] for an unknown study (input), or if the database fails (failure).
pub async fn run(args: RetentionArgs) -> Result<(), CommandError> {
    let purpose = if args.delete { Purpose::Change } else { Purpose::Read };
    let store = Store::open(&args.database, purpose).await?;
    let mut studies = Vec::new();
    let slugs = match &args.study {
        Some(slug) => vec![slug.clone()],
        None => store.slugs().await?,
    };
    for slug in slugs {
        studies.push(study_named(&store, &slug).await?);
    }
    let sweep = Sweep { store: &store, now_ms: now_ms(), delete: args.delete };
    let mut rules = Vec::new();
    for study in &studies {
        for (rule, concern, days) in [
            ("data", Concern::Data, args.data),
            ("unfinished", Concern::Unfinished, args.unfinished),
            ("identities", Concern::Identity, args.identities),
        ] {
            if let Some(days) = days {
                rules.push(sweep.participants(study, rule, concern, days).await?);
            }
        }
        if let Some(days) = args.analyses {
            rules.push(sweep.analyses(study, days).await?);
        }
    }
    if let Some(days) = args.audit {
        rules.push(sweep.audit(days).await?);
    }
    store.close().await;
    print_json(&Summary { deleted: args.delete, rules })?;
    if !args.delete {
        eprintln!("Nothing was deleted. To delete this, add --delete.");
    }
    Ok(())
}

struct Sweep<'a> {
    store: &'a Store,
    now_ms: i64,
    delete: bool,
}

impl Sweep<'_> {
    fn before_ms(&self, days: i64) -> i64 {
        self.now_ms - days * DAY_MS
    }

    fn entry(&self, action: Action, study: Option<&str>, subject: Option<String>) -> NewEntry {
        NewEntry {
            at_ms: self.now_ms,
            key_id: None,
            who: WHO.to_owned(),
            action,
            study: study.map(str::to_owned),
            subject,
        }
    }

    async fn participants(
        &self,
        study: &StoredStudy,
        rule: &'static str,
        concern: Concern,
        days: i64,
    ) -> Result<Concerned, CommandError> {
        let before_ms = self.before_ms(days);
        let slug = &study.slug;
        let mut which = Vec::new();
        for Due { id, number, pilot } in
            self.store.participants_due(study.id, concern, before_ms).await?
        {
            let name = if pilot { format!("pilot {number}") } else { number.to_string() };
            let action = match concern {
                Concern::Data | Concern::Unfinished => Action::ParticipantDeleted,
                Concern::Identity => Action::IdentityDeleted,
            };
            let entry = self.entry(action, Some(slug), Some(name.clone()));
            if !self.delete || self.store.delete_due(&id, concern, before_ms, entry).await? {
                which.push(name);
            }
        }
        let (before, study) = (date_time(before_ms), Some(slug.clone()));
        Ok(Concerned { rule, before, study, count: which.len(), which })
    }

    async fn analyses(&self, study: &StoredStudy, days: i64) -> Result<Concerned, CommandError> {
        let before_ms = self.before_ms(days);
        let slug = &study.slug;
        let which = self.store.analyses_due(study.id, before_ms).await?;
        if self.delete {
            for id in &which {
                let entry = self.entry(Action::AnalysisDeleted, Some(slug), Some(id.clone()));
                self.store.delete_analysis(id, entry).await?;
            }
        }
        let (before, study) = (date_time(before_ms), Some(slug.clone()));
        Ok(Concerned { rule: "analyses", before, study, count: which.len(), which })
    }

    async fn audit(&self, days: i64) -> Result<Concerned, CommandError> {
        let before_ms = self.before_ms(days);
        let count = if self.delete {
            let entry = self.entry(Action::AuditShortened, None, None);
            self.store.shorten_audit(before_ms, entry).await?
        } else {
            usize::try_from(self.store.audit_due(before_ms).await?).unwrap_or(0)
        };
        let before = date_time(before_ms);
        Ok(Concerned { rule: "audit", before, study: None, count, which: Vec::new() })
    }
}
