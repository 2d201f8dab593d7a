//! The measurements as Parquet: the same columns as in the CSV, a null where nothing was measured.

use super::{Columns, Row};
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

type Column = (&'static str, fn(&Row) -> f64);

/// Columns that every recording has, and how a row fills them.
const COLUMNS: [Column; 7] = [
    ("time_s", |row| row.time_s),
    ("q1_m", |row| row.q_m[0]),
    ("q2_m", |row| row.q_m[1]),
    ("q3_m", |row| row.q_m[2]),
    ("bend_x_rad", |row| row.bend_rad[0]),
    ("bend_y_rad", |row| row.bend_rad[1]),
    ("sigma_bend_rad", |row| row.sigma_bend_rad),
];
const LOADS: [Column; 3] =
    [("tau1_n", |row| row.tau_n[0]), ("tau2_n", |row| row.tau_n[1]), ("tau3_n", |row| row.tau_n[2])];

/// Writes the columns of [`super::write_csv`], Snappy-compressed.
///
/// # Errors
/// What the system or the format says.
pub fn write_parquet(columns: &Columns, out: impl Write + Send) -> Result<()> {
    let doubles: Vec<Column> = COLUMNS.into_iter().chain(LOADS.into_iter().filter(|_| columns.has_tau())).collect();
    let fields: String = doubles.iter().map(|(name, _)| format!("optional double {name}; ")).collect();
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
    for rows in columns.rows.chunks(GROUP_ROWS) {
        let mut group = file.next_row_group()?;
        for (_, value) in &doubles {
            let values = rows.iter().map(value);
            let levels: Vec<i16> = values.clone().map(|v| i16::from(!v.is_nan())).collect();
            let known: Vec<f64> = values.filter(|v| !v.is_nan()).collect();
            column(&mut group, |writer| match writer {
                ColumnWriter::DoubleColumnWriter(w) => w.write_batch(&known, Some(&levels), None).map(|_| ()),
                _ => Err(ParquetError::General("a column of doubles expected".to_owned())),
            })?;
        }
        let trials: Vec<i32> = rows.iter().map(|row| row.trial.cast_signed()).collect();
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
