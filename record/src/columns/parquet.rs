//! The measurements as Parquet: the same columns as in the CSV, a null where nothing was measured.

use super::header::columns;
use super::{ColumnUnits, Columns};
use parquet::basic::{Compression, Encoding};
use parquet::column::writer::ColumnWriter;
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;
use std::io::Write;
use std::sync::Arc;

/// Rows of a group: 90 MB of doubles at most in memory, a quarter of an hour at 1 kHz.
const GROUP_ROWS: usize = 1_000_000;

/// Writes the columns of [`super::write_csv`], Snappy-compressed.
///
/// # Errors
/// What the system or the format says.
pub fn write_parquet(table: &Columns, units: Option<&ColumnUnits>, out: impl Write + Send) -> Result<()> {
    let doubles = columns(table, units);
    let fields: String = doubles.iter().map(|column| format!("optional double {}; ", column.name)).collect();
    let schema = parse_message_type(&format!("message krait {{ {fields} required int32 trial; }}"))?;
    let made_by = KeyValue::new("made_by".to_owned(), format!("krait {}", env!("CARGO_PKG_VERSION")));
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        // Measured values hardly repeat; the bytes of neighbours do.
        .set_dictionary_enabled(false)
        .set_encoding(Encoding::BYTE_STREAM_SPLIT)
        .set_column_encoding("trial".into(), Encoding::PLAIN)
        .set_key_value_metadata(Some(vec![made_by]))
        .build();
    let mut file = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties))?;
    for begin in (0..table.n_rows()).step_by(GROUP_ROWS) {
        let rows = begin..(begin + GROUP_ROWS).min(table.n_rows());
        let mut group = file.next_row_group()?;
        for own in &doubles {
            let values = rows.clone().map(|row| own.value(row));
            let levels: Vec<i16> = values.clone().map(|v| i16::from(!v.is_nan())).collect();
            let known: Vec<f64> = values.filter(|v| !v.is_nan()).collect();
            column(&mut group, |writer| match writer {
                ColumnWriter::DoubleColumnWriter(w) => w.write_batch(&known, Some(&levels), None).map(|_| ()),
                _ => Err(ParquetError::General("a column of doubles expected".to_owned())),
            })?;
        }
        let trials: Vec<i32> = table.trial[rows].iter().map(|trial| trial.cast_signed()).collect();
        column(&mut group, |writer| match writer {
            ColumnWriter::Int32ColumnWriter(w) => w.write_batch(&trials, None, None).map(|_| ()),
            _ => Err(ParquetError::General("a column of numbers expected".to_owned())),
        })?;
        group.close()?;
    }
    file.close()?;
    Ok(())
}

fn column<W: Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    fill: impl FnOnce(&mut ColumnWriter<'_>) -> Result<()>,
) -> Result<()> {
    let next = group.next_column()?;
    let mut writer = next.ok_or_else(|| ParquetError::General("the schema has fewer columns".to_owned()))?;
    fill(writer.untyped())?;
    writer.close()
}
