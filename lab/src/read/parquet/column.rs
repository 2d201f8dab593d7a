//! One column of a Parquet table: what its type holds, and its values.

use super::super::grid::{GridCells, MOST_CELLS};
use parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::schema::types::ColumnDescriptor;

/// Values that are read at once.
const BATCH: usize = 4096;
const NS_PER_DAY: i64 = 86_400_000_000_000;
/// Julian day of 1 January 1970.
const EPOCH_JULIAN_DAY: i64 = 2_440_588;

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Numbers, to be multiplied by this power of ten.
    Numbers(i32),
    Whole,
    /// 64 bits without a sign.
    Unsigned,
    /// Times since 1970 in this unit.
    Times(&'static str),
    Texts,
}

impl Kind {
    /// What a column of this description holds.
    ///
    /// # Errors
    /// Why it is not read.
    pub(super) fn of(column: &ColumnDescriptor) -> Result<Self, String> {
        if column.max_rep_level() > 0 || column.path().parts().len() != 1 || column.max_def_level() > 1 {
            return Err("it is nested".to_owned());
        }
        let times = match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Timestamp(own)), _) => Some(match own.unit {
                TimeUnit::MILLIS => "ms",
                TimeUnit::MICROS => "us",
                TimeUnit::NANOS => "ns",
            }),
            (_, ConvertedType::TIMESTAMP_MILLIS) => Some("ms"),
            (_, ConvertedType::TIMESTAMP_MICROS) => Some("us"),
            _ => None,
        };
        let other = |what: &str| Err(format!("it holds {what}"));
        match (column.physical_type(), column.converted_type(), times) {
            (Type::INT96, ..) => Ok(Self::Times("ns")),
            (Type::INT64, _, Some(unit)) => Ok(Self::Times(unit)),
            (_, ConvertedType::DATE, _) => other("dates"),
            (_, ConvertedType::TIME_MILLIS | ConvertedType::TIME_MICROS, _) => other("times of a day"),
            (Type::INT32 | Type::INT64, ConvertedType::DECIMAL, _) => Ok(Self::Numbers(-column.type_scale())),
            (Type::INT64, ConvertedType::UINT_64, _) => Ok(Self::Unsigned),
            (Type::INT64, ..) => Ok(Self::Whole),
            (Type::BOOLEAN | Type::INT32 | Type::FLOAT | Type::DOUBLE, ..) => Ok(Self::Numbers(0)),
            (Type::BYTE_ARRAY, ConvertedType::UTF8 | ConvertedType::ENUM, _) => Ok(Self::Texts),
            _ => other("bytes that are no numbers"),
        }
    }

    /// Room for its values.
    pub(super) fn room(self, n_rows: usize) -> GridCells {
        match self {
            Self::Numbers(_) | Self::Unsigned => GridCells::Numbers(Vec::with_capacity(n_rows)),
            Self::Whole | Self::Times(_) => GridCells::Whole(Vec::with_capacity(n_rows)),
            Self::Texts => GridCells::Texts(Vec::with_capacity(n_rows)),
        }
    }

    /// Adds a row group's values; counts the bytes of labels, of which those beyond [`MOST_CELLS`] are not kept.
    ///
    /// # Errors
    /// What is damaged.
    pub(super) fn read(
        self,
        reader: ColumnReader,
        n_rows: u64,
        cells: &mut GridCells,
        n_text_bytes: &mut usize,
    ) -> Result<(), String> {
        let scale = if let Self::Numbers(power) = self { 10.0_f64.powi(power) } else { 1.0 };
        match (reader, cells) {
            (ColumnReader::BoolColumnReader(own), GridCells::Numbers(out)) => {
                values(own, n_rows, |v| out.push(v.map_or(f64::NAN, |v| f64::from(u8::from(*v)))))
            }
            (ColumnReader::Int32ColumnReader(own), GridCells::Numbers(out)) => {
                values(own, n_rows, |v| out.push(v.map_or(f64::NAN, |v| f64::from(*v) * scale)))
            }
            (ColumnReader::Int64ColumnReader(own), GridCells::Numbers(out)) => {
                let is_unsigned = self == Self::Unsigned;
                let number = |v: &i64| if is_unsigned { v.cast_unsigned() as f64 } else { *v as f64 * scale };
                values(own, n_rows, |v| out.push(v.map_or(f64::NAN, number)))
            }
            (ColumnReader::FloatColumnReader(own), GridCells::Numbers(out)) => {
                values(own, n_rows, |v| out.push(v.map_or(f64::NAN, |v| f64::from(*v))))
            }
            (ColumnReader::DoubleColumnReader(own), GridCells::Numbers(out)) => {
                values(own, n_rows, |v| out.push(v.copied().unwrap_or(f64::NAN)))
            }
            (ColumnReader::Int64ColumnReader(own), GridCells::Whole(out)) => {
                values(own, n_rows, |v| out.push(v.copied()))
            }
            (ColumnReader::Int96ColumnReader(own), GridCells::Whole(out)) => {
                values(own, n_rows, |v| out.push(v.map(|v| epoch_ns(v.data()))))
            }
            (ColumnReader::ByteArrayColumnReader(own), GridCells::Texts(out)) => values(own, n_rows, |v| {
                let text = v.map_or(&[][..], |v| v.data());
                *n_text_bytes += text.len();
                out.push(if *n_text_bytes > MOST_CELLS { Box::default() } else { text.into() });
            }),
            _ => Err("a column's values are not of its type".to_owned()),
        }
    }
}

/// Nanoseconds since 1970 of a Julian day and the nanoseconds in it.
fn epoch_ns(parts: &[u32]) -> i64 {
    let [low, high, day] = *parts else { return 0 };
    let in_day = (u64::from(high) << 32 | u64::from(low)).cast_signed();
    (i64::from(day) - EPOCH_JULIAN_DAY).saturating_mul(NS_PER_DAY).saturating_add(in_day)
}

/// Gives the values of so many rows, one after the other.
fn values<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    n_rows: u64,
    mut take: impl FnMut(Option<&T::T>),
) -> Result<(), String> {
    let (mut found, mut levels) = (Vec::new(), Vec::new());
    let mut n_left = n_rows;
    while n_left > 0 {
        found.clear();
        levels.clear();
        let n_wanted = usize::try_from(n_left).unwrap_or(BATCH).min(BATCH);
        let (n_read, ..) =
            reader.read_records(n_wanted, Some(&mut levels), None, &mut found).map_err(|error| error.to_string())?;
        if n_read == 0 || n_read as u64 > n_left {
            return Err(format!("a column ends {n_left} rows too early"));
        }
        let mut there = found.iter();
        for row in 0..n_read {
            // Without levels every value is there.
            take(if levels.get(row).is_none_or(|level| *level > 0) { there.next() } else { None });
        }
        n_left -= n_read as u64;
    }
    Ok(())
}
