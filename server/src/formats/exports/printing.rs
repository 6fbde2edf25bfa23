//! Fills tables from the trials of participants.

use super::damage::Damage;
use super::dataset::People;
use super::table::Table;
use super::table_file::TableFile;
use super::{ExportError, Filter, Format};
use crate::formats::table::Batch;
use std::io::{self, Write};
use tokio_util::sync::CancellationToken;

/// Tables that are filled from the same participants.
pub(super) struct Printing<W: Write + Send> {
    filter: Filter,
    damage: Damage,
    batch_rows: usize,
    tables: Vec<(TableFile<W>, Batch)>,
}

impl<W: Write + Send> Printing<W> {
    pub(super) fn of(format: Format, filter: &Filter, tables: Vec<TableFile<W>>) -> Self {
        let begun = |file: TableFile<W>| {
            let batch = Batch::new(&file.columns);
            (file, batch)
        };
        let tables = tables.into_iter().map(begun).collect();
        Self {
            filter: filter.clone(),
            damage: Damage::default(),
            batch_rows: format.batch_rows(),
            tables,
        }
    }

    /// Adds participants until there are no more. Blocks this thread.
    pub(super) fn add_all(
        &mut self,
        mut people: People,
        cancel: &CancellationToken,
    ) -> Result<(), ExportError> {
        while let Some(person) = people.blocking_recv() {
            if cancel.is_cancelled() {
                return Err(io::Error::other("stopped").into());
            }
            let person = person?;
            person.damaged().for_each(|damaged| self.damage.add(damaged));
            for (file, batch) in &mut self.tables {
                Table::add(file.table, batch, &person, &self.filter)?;
                if batch.rows() >= self.batch_rows {
                    file.write(batch)?;
                    batch.clear();
                }
            }
        }
        // Write the remaining rows.
        for (file, batch) in &mut self.tables {
            file.write(batch)?;
        }
        Ok(())
    }

    /// The tables and the damage.
    pub(super) fn finish(self) -> (Vec<TableFile<W>>, Damage) {
        (self.tables.into_iter().map(|(file, _)| file).collect(), self.damage)
    }
}
