//! MATLAB files of level 5 (`save -v6`, `save -v7`): vectors and matrices of one length as columns.

mod stream;
mod variable;

use super::ReadError;
use super::grid::{Grid, GridCells, GridColumn, MOST_CELLS, MOST_COLUMNS};
use super::unit::Unit;
use flate2::read::ZlibDecoder;
use krait_ipc::input;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;
use stream::Stream;
use variable::{Content, MATRIX, Variable, variable, within};

const N_HEAD: usize = 128;
/// The element whose content is compressed.
const COMPRESSED: u32 = 15;
/// Bytes that compressed variables may unpack to, all together: what is left out of a table is unpacked to be skipped.
const MOST_UNPACKED: u64 = 4 << 30;
/// Columns of a matrix that is taken for several columns of measurements.
const MOST_WIDTH: usize = 64;

/// Whether a file begins as one of level 5 does: a text, then the version and the byte order.
pub(super) fn is_level_5(start: &[u8]) -> bool {
    start.starts_with(b"MATLAB") || matches!(start.get(124..N_HEAD), Some([0, 1, b'I', b'M'] | [1, 0, b'M', b'I']))
}

/// Whether a file begins as one of level 4 does: five whole numbers, the type, rows, columns, 0 or 1, length of the name.
pub(super) fn is_level_4(start: &[u8]) -> bool {
    let word = |k: usize| start.get(4 * k..4 * k + 4)?.try_into().ok();
    let words: Option<Vec<[u8; 4]>> = (0..5).map(word).collect();
    let Some(words) = words else { return false };
    [u32::from_le_bytes, u32::from_be_bytes].into_iter().any(|read| {
        let [sort, n_rows, n_columns, is_complex, n_name] =
            [0, 1, 2, 3, 4].map(|k| words.get(k).copied().map_or(0, read));
        let is_sort = sort < 5000 && sort % 10 <= 2 && sort / 10 % 10 <= 5 && sort / 100 % 10 == 0;
        is_sort
            && n_rows < 1 << 30
            && n_columns < 1 << 30
            && n_rows + n_columns > 0
            && is_complex <= 1
            && (2..64).contains(&n_name)
    })
}

/// Reads every variable.
pub(super) fn grid(path: &Path, file: File) -> Result<Grid, ReadError> {
    let unusable = |reason: String| ReadError::Unusable { path: path.to_owned(), reason };
    let failed = |source| ReadError::Io { path: path.to_owned(), source };
    input::check_size(&file, input::TABLE_BYTES).map_err(failed)?;
    let n_bytes = file.metadata().map_err(failed)?.len();
    let variables = variables(BufReader::new(file), n_bytes)
        .map_err(|what| unusable(format!("this MATLAB file is cut or damaged ({what}); save it again")))?;
    table(variables).map_err(unusable)
}

fn variables(mut file: impl Read, n_bytes: u64) -> Result<Vec<Variable>, String> {
    let mut head = [0; N_HEAD];
    file.read_exact(&mut head).map_err(|_error| "it ends in its head")?;
    let is_big = match head.get(126..) {
        Some(b"IM") => false,
        Some(b"MI") => true,
        _ => return Err("its byte order is unknown".to_owned()),
    };
    let mut stream = Stream::new(&mut file, is_big, n_bytes.saturating_sub(N_HEAD as u64));
    let mut found = Vec::new();
    let (mut n_cells, mut n_left) = (0, MOST_UNPACKED);
    while !stream.is_over() {
        let tag = stream.tag()?;
        let one = match tag.sort {
            MATRIX => within(&mut stream, tag.n_bytes, |inner| variable(inner, 0))?,
            COMPRESSED => within(&mut stream, tag.n_bytes, |packed| unpacked(packed, &mut n_left))?,
            // Other elements hold nothing that a user saved.
            _ => {
                stream.data(&tag, |_| {})?;
                continue;
            }
        };
        n_cells += cells(&one);
        if n_cells > MOST_CELLS || found.len() >= MOST_COLUMNS {
            return Err(format!("more than {MOST_CELLS} cells or {MOST_COLUMNS} variables"));
        }
        found.push(one);
    }
    Ok(found)
}

fn unpacked(packed: &mut Stream, n_left: &mut u64) -> Result<Variable, String> {
    let is_big = packed.is_big;
    let mut bytes = packed.bytes();
    let mut source = ZlibDecoder::new(&mut bytes);
    let mut stream = Stream::new(&mut source, is_big, *n_left);
    let tag = stream.tag()?;
    if tag.sort != MATRIX {
        return Err(format!("a compressed element of the type {} is no variable", tag.sort));
    }
    let found = within(&mut stream, tag.n_bytes, |inner| variable(inner, 0))?;
    *n_left = stream.n_left();
    // The next element begins where this one ends, not where unpacking stopped.
    io::copy(&mut bytes, &mut io::sink()).map_err(|error| error.to_string())?;
    Ok(found)
}

/// What a variable weighs, in numbers.
fn cells(variable: &Variable) -> usize {
    match &variable.content {
        Content::Matrix { cells, .. } => cells.weight(),
        Content::Struct(fields) => fields.iter().map(cells).sum(),
        Content::Other(_) => 0,
    }
}

/// Variables side by side; a struct's fields have its name before theirs where other variables stand beside it.
fn table(variables: Vec<Variable>) -> Result<Grid, String> {
    let is_alone = variables.iter().filter(|own| cells(own) > 1).count() <= 1;
    let mut flat = Vec::new();
    for Variable { name, content } in variables {
        match content {
            Content::Struct(fields) => flat.extend(fields.into_iter().map(|field| match is_alone {
                true => field,
                false => Variable { name: format!("{name}.{}", field.name), content: field.content },
            })),
            content => flat.push(Variable { name, content }),
        }
    }
    let length = length(&flat).ok_or(
        "it holds no vector of numbers; save vectors of one length, such as save('run.mat', 't', 'u', 'y', '-v7')",
    )?;
    let (mut columns, mut notes) = (Vec::new(), Vec::new());
    for Variable { name, content } in flat {
        match content {
            Content::Other(what) => notes.push(format!("{name:?} is left out: {what}")),
            Content::Matrix { n_rows: 1, n_columns: 1, .. } if length > 1 => {
                notes.push(format!("{name:?} is left out: one number"));
            }
            Content::Matrix { n_rows, n_columns, cells } => {
                let is_upright = n_rows == length;
                let width = if is_upright { n_columns } else { n_rows };
                if !(is_upright || n_columns == length) || width > MOST_WIDTH {
                    return Err(format!(
                        "{name:?} is {n_rows} x {n_columns}, expected {length} rows as the others have; save vectors of one length, such as save('run.mat', 't', 'u', 'y', '-v7')"
                    ));
                }
                columns.extend((0..width).map(|k| GridColumn {
                    name: if width == 1 { name.clone() } else { numbered(&name, k + 1) },
                    cells: column(&cells, k, length, width, is_upright),
                    is_held: false,
                }));
            }
            Content::Struct(_) => {}
        }
    }
    Ok(Grid { how: "a MATLAB file of level 5".to_owned(), columns, notes })
}

/// The length that most vectors have; without a vector, the longer side of the first matrix.
fn length(variables: &[Variable]) -> Option<usize> {
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    let mut longest = None;
    for own in variables {
        if let Content::Matrix { n_rows, n_columns, .. } = own.content {
            let (short, long) = (n_rows.min(n_columns), n_rows.max(n_columns));
            if short == 1 && long > 1 {
                *counts.entry(long).or_default() += 1;
            }
            longest = longest.or((long > 1).then_some(long));
        }
    }
    counts.into_iter().max_by_key(|(length, count)| (*count, *length)).map(|(length, _)| length).or(longest)
}

/// A matrix's column: `q_mm` becomes `q1_mm`.
fn numbered(name: &str, number: usize) -> String {
    match name.rsplit_once('_').filter(|(stem, unit)| !stem.is_empty() && Unit::from_suffix(unit).is_some()) {
        Some((stem, unit)) => format!("{stem}{number}_{unit}"),
        None => format!("{name}{number}"),
    }
}

fn column(cells: &GridCells, k: usize, length: usize, width: usize, is_upright: bool) -> GridCells {
    let places = (0..length).map(|row| if is_upright { k * length + row } else { row * width + k });
    match cells {
        GridCells::Numbers(own) => {
            GridCells::Numbers(places.map(|place| own.get(place).copied().unwrap_or(f64::NAN)).collect())
        }
        GridCells::Whole(own) => GridCells::Whole(places.map(|place| own.get(place).copied().flatten()).collect()),
        GridCells::Texts(_) => GridCells::Texts(Vec::new()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(sort: u32, bytes: &[u8]) -> Vec<u8> {
        let mut all = [sort.to_be_bytes(), (bytes.len() as u32).to_be_bytes()].concat();
        all.extend_from_slice(bytes);
        all.resize(all.len().next_multiple_of(8), 0);
        all
    }

    /// A variable as a machine with the other byte order writes it.
    fn big(name: &str, sizes: [u32; 2], sort: u32, numbers: &[u8]) -> Vec<u8> {
        let flags = element(6, &[0, 0, 0, DOUBLE, 0, 0, 0, 0]);
        let sizes = element(5, &sizes.map(u32::to_be_bytes).concat());
        element(MATRIX, &[flags, sizes, element(1, name.as_bytes()), element(sort, numbers)].concat())
    }

    const DOUBLE: u8 = 6;

    #[test]
    fn the_other_byte_order_and_narrow_numbers_are_read_and_a_size_beyond_the_file_is_refused() {
        let mut file = vec![b' '; 124];
        file.extend([1, 0, b'M', b'I']);
        assert!(is_level_5(&file));
        let wide: Vec<u8> = [1.5_f64, -2.0, 3.25].iter().flat_map(|v| v.to_be_bytes()).collect();
        file.extend(big("t", [3, 1], 9, &wide));
        file.extend(big("q_mm", [2, 3], 3, &[0, 1, 0xff, 0xfe, 0, 3, 0, 4, 0, 5, 0, 6]));
        let found = variables(&file[..], file.len() as u64).and_then(table).expect("a file");
        let named: Vec<(&str, &GridCells)> = found.columns.iter().map(|own| (own.name.as_str(), &own.cells)).collect();
        let numbers = |values: [f64; 3]| GridCells::Numbers(values.to_vec());
        let expected = [numbers([1.5, -2.0, 3.25]), numbers([1.0, 3.0, 5.0]), numbers([-2.0, 4.0, 6.0])];
        assert_eq!(named, [("t", &expected[0]), ("q1_mm", &expected[1]), ("q2_mm", &expected[2])]);
        file.extend(big("x", [1 << 30, 1 << 30], 9, &[0; 8]));
        assert!(variables(&file[..], file.len() as u64).is_err_and(|why| why.contains("too large")));
    }

    #[test]
    fn a_vector_of_another_length_is_named() {
        let column = |name: &str, n: usize| Variable {
            name: name.to_owned(),
            content: Content::Matrix { n_rows: n, n_columns: 1, cells: GridCells::Numbers(vec![0.0; n]) },
        };
        let sentence = table(vec![column("t", 5), column("u", 5), column("gains", 3)]).expect_err("lengths");
        assert!(sentence.contains("\"gains\" is 3 x 1, expected 5 rows"), "{sentence}");
        assert!(table(vec![column("rate", 1)]).is_err());
    }
}
