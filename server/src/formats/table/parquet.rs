//! Batches as a Parquet file. Each batch is one row group, so that readers need memory for only one
//! group at a time.

use super::batch::{Batch, Cells, Texts};
use super::{Column, Kind};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::{ParquetError, Result};
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, Type};
use std::io::{self, Write};
use std::sync::Arc;

/// A Parquet file that is being written.
pub struct ParquetFile<W: Write + Send> {
    file: SerializedFileWriter<W>,
}

impl<W: Write + Send> ParquetFile<W> {
    /// Begins a file. Whole numbers are INT64, numbers are DOUBLE, and everything else is UTF-8.
    /// Every column is nullable.
    ///
    /// # Errors
    /// The error of `out`.
    pub fn begin(out: W, columns: &[Column]) -> io::Result<Self> {
        Self::try_begin(out, columns).map_err(failed)
    }

    fn try_begin(out: W, columns: &[Column]) -> Result<Self> {
        let mut properties = WriterProperties::builder()
            .set_created_by(format!("sidestep {}", env!("CARGO_PKG_VERSION")))
            .set_compression(Compression::SNAPPY)
            .set_statistics_enabled(EnabledStatistics::Chunk);
        let mut fields = Vec::new();
        for column in columns {
            let (physical, logical) = match column.kind {
                Kind::Whole => (Physical::INT64, None),
                Kind::Number | Kind::Time => (Physical::DOUBLE, None),
                Kind::Text | Kind::Word | Kind::Hash | Kind::Json => {
                    (Physical::BYTE_ARRAY, Some(LogicalType::String))
                }
            };
            if physical != Physical::BYTE_ARRAY {
                // Few numbers repeat, and repeated numbers compress well without a dictionary.
                let path = ColumnPath::from(column.name.to_string());
                properties = properties.set_column_dictionary_enabled(path, false);
            }
            let field = Type::primitive_type_builder(&column.name, physical)
                .with_repetition(Repetition::OPTIONAL)
                .with_logical_type(logical);
            fields.push(Arc::new(field.build()?));
        }
        let schema = Type::group_type_builder("row").with_fields(fields).build()?;
        let properties = Arc::new(properties.build());
        Ok(Self { file: SerializedFileWriter::new(out, Arc::new(schema), properties)? })
    }

    /// Adds the rows of a batch as a row group.
    ///
    /// # Errors
    /// The error of the file.
    pub fn write(&mut self, batch: &Batch) -> io::Result<()> {
        if batch.rows() == 0 {
            return Ok(());
        }
        self.try_write(batch).map_err(failed)
    }

    fn try_write(&mut self, batch: &Batch) -> Result<()> {
        let mut group = self.file.next_row_group()?;
        for cells in batch.columns() {
            write_column(&mut group, cells)?;
        }
        group.close()?;
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The error of the file.
    pub fn finish(self) -> io::Result<W> {
        self.file.into_inner().map_err(failed)
    }
}

fn failed(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(error) => match error.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}

fn write_column(
    group: &mut SerializedRowGroupWriter<'_, impl Write + Send>,
    cells: &Cells,
) -> Result<()> {
    let Some(mut column) = group.next_column()? else {
        return Err(ParquetError::General("more columns than in the schema".to_owned()));
    };
    match cells {
        Cells::Whole(cells) => {
            let values: Vec<i64> = cells.iter().copied().flatten().collect();
            column.typed::<Int64Type>().write_batch(&values, Some(&levels(cells)), None)?;
        }
        Cells::Number(cells) => {
            let values: Vec<f64> = cells.iter().copied().flatten().collect();
            column.typed::<DoubleType>().write_batch(&values, Some(&levels(cells)), None)?;
        }
        Cells::Text(Texts { distinct, rows }) => {
            let distinct: Vec<ByteArray> =
                distinct.iter().map(|text| ByteArray::from(text.as_str())).collect();
            let values: Vec<ByteArray> =
                rows.iter().flatten().map(|&place| distinct[place as usize].clone()).collect();
            column.typed::<ByteArrayType>().write_batch(&values, Some(&levels(rows)), None)?;
        }
    }
    column.close()
}

/// Definition levels: 1 for each row with a value, and 0 for other rows.
fn levels<T>(cells: &[Option<T>]) -> Vec<i16> {
    cells.iter().map(|cell| i16::from(cell.is_some())).collect()
}
