//! One variable of a MATLAB file: numbers, a struct of such, or something that is left out.

use super::super::grid::{GridCells, MOST_CELLS};
use super::stream::Stream;

/// The element that holds an array.
pub(super) const MATRIX: u32 = 14;
const CELL: u8 = 1;
const STRUCT: u8 = 2;
const CHAR: u8 = 4;
const DOUBLE: u8 = 6;
const INT64: u8 = 14;
const UINT64: u8 = 15;
/// Bit of complex numbers in an array's flags.
const COMPLEX: u32 = 0x0800;
/// Longest name, and the names of a struct's fields together.
const MOST_NAME: u64 = 4096;
const MOST_NAMES: u64 = 1 << 20;
const MOST_DIMENSIONS: u64 = 4 * 32;

/// A variable.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Variable {
    pub name: String,
    pub content: Content,
}

/// What it holds.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Content {
    /// Column after column.
    Matrix { n_rows: usize, n_columns: usize, cells: GridCells },
    /// One level deep.
    Struct(Vec<Variable>),
    /// Why it is no column.
    Other(String),
}

/// Reads the inside of an array's element.
pub(super) fn variable(stream: &mut Stream, depth: usize) -> Result<Variable, String> {
    let flags = stream.short(8)?;
    let word = flags.get(..4).and_then(|own| own.try_into().ok()).map(|own| stream.whole(own));
    let word = word.ok_or("the flags of a variable are cut")?;
    let class = (word & 0xff) as u8;
    let bytes = stream.short(MOST_DIMENSIONS)?;
    let sizes: Vec<usize> =
        bytes.chunks_exact(4).map(|own| own.try_into().map_or(0, |own| stream.whole(own) as usize)).collect();
    let name = String::from_utf8_lossy(&stream.short(MOST_NAME)?).replace(char::is_control, " ");
    let content = match class {
        STRUCT if depth == 0 && sizes.iter().all(|n| *n == 1) => fields(stream)?,
        DOUBLE..=UINT64 if word & COMPLEX != 0 => Content::Other("complex numbers".to_owned()),
        DOUBLE..=UINT64 => matrix(stream, class, &sizes)?,
        STRUCT => {
            Content::Other(if depth == 0 { "an array of structs" } else { "a struct within a struct" }.to_owned())
        }
        CHAR => Content::Other("text".to_owned()),
        CELL => Content::Other("a cell array".to_owned()),
        5 => Content::Other("a sparse matrix".to_owned()),
        _ => Content::Other("an object, a table or a function".to_owned()),
    };
    Ok(Variable { name, content })
}

fn fields(stream: &mut Stream) -> Result<Content, String> {
    let width = stream.short(8)?;
    let width = width.get(..4).and_then(|own| own.try_into().ok()).map_or(0, |own| stream.whole(own) as usize);
    let names = stream.short(MOST_NAMES)?;
    if width == 0 || names.len() % width != 0 {
        return Err("the names of a struct's fields are damaged".to_owned());
    }
    let (mut found, mut n_cells) = (Vec::new(), 0);
    for name in names.chunks_exact(width) {
        let text = name.split(|byte| *byte == 0).next().unwrap_or_default();
        let name = String::from_utf8_lossy(text).replace(char::is_control, " ");
        let tag = stream.tag()?;
        if tag.sort != MATRIX {
            return Err(format!("the field {name:?} of a struct is no array"));
        }
        // An empty field has no content.
        let content = match tag.n_bytes {
            0 => Content::Other("empty".to_owned()),
            n_bytes => within(stream, n_bytes, |inner| variable(inner, 1))?.content,
        };
        if let Content::Matrix { cells, .. } = &content {
            n_cells += cells.weight();
        }
        found.push(Variable { name, content });
        if n_cells > MOST_CELLS {
            return Err(format!("a struct of more than {MOST_CELLS} cells"));
        }
    }
    Ok(Content::Struct(found))
}

/// Reads an element's inside and skips what is left of it.
pub(super) fn within<T>(
    stream: &mut Stream,
    n_bytes: u64,
    read: impl FnOnce(&mut Stream) -> Result<T, String>,
) -> Result<T, String> {
    let mut inner = stream.inner(n_bytes)?;
    let found = read(&mut inner)?;
    inner.skip_rest()?;
    Ok(found)
}

fn matrix(stream: &mut Stream, class: u8, sizes: &[usize]) -> Result<Content, String> {
    let [n_rows, n_columns] = *sizes else {
        return Ok(Content::Other(format!("an array of {} dimensions", sizes.len())));
    };
    let is_whole = matches!(class, INT64 | UINT64);
    let most = MOST_CELLS / room(is_whole, 0).weight_of_one();
    let n_cells = n_rows.checked_mul(n_columns).filter(|n| *n <= most);
    let n_cells = n_cells.ok_or_else(|| format!("a variable of {n_rows} x {n_columns} cells is too large"))?;
    if n_cells == 0 {
        return Ok(Content::Other("empty".to_owned()));
    }
    let tag = stream.tag()?;
    let stored = Stored::of(tag.sort).ok_or_else(|| format!("its numbers are of the unknown type {}", tag.sort))?;
    if tag.n_bytes != (n_cells * stored.width()) as u64 {
        return Err(format!("a variable of {n_rows} x {n_columns} cells holds {} bytes", tag.n_bytes));
    }
    let mut numbers = Numbers { stored, is_big: stream.is_big, rest: Vec::new(), cells: room(is_whole, n_cells) };
    stream.data(&tag, |piece| numbers.take(piece))?;
    Ok(Content::Matrix { n_rows, n_columns, cells: numbers.cells })
}

fn room(is_whole: bool, n_cells: usize) -> GridCells {
    if is_whole {
        GridCells::Whole(Vec::with_capacity(n_cells))
    } else {
        GridCells::Numbers(Vec::with_capacity(n_cells))
    }
}

/// How numbers are stored, whatever their class: MATLAB takes the narrowest type that holds them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stored {
    Int { width: usize, is_signed: bool },
    Single,
    Double,
}

impl Stored {
    fn of(sort: u32) -> Option<Self> {
        Some(match sort {
            1..=6 => Self::Int { width: 1 << ((sort - 1) / 2), is_signed: sort % 2 == 1 },
            7 => Self::Single,
            9 => Self::Double,
            12 | 13 => Self::Int { width: 8, is_signed: sort == 12 },
            _ => return None,
        })
    }

    fn width(self) -> usize {
        match self {
            Self::Int { width, .. } => width,
            Self::Single => 4,
            Self::Double => 8,
        }
    }
}

struct Numbers {
    stored: Stored,
    is_big: bool,
    /// The beginning of a number whose end comes with the next piece.
    rest: Vec<u8>,
    cells: GridCells,
}

impl Numbers {
    fn take(&mut self, piece: &[u8]) {
        let bytes = [&self.rest[..], piece].concat();
        let chunks = bytes.chunks_exact(self.stored.width());
        self.rest = chunks.remainder().to_vec();
        for own in chunks {
            let mut wide = [0; 8];
            for (k, byte) in own.iter().enumerate() {
                let place = if self.is_big { own.len() - 1 - k } else { k };
                if let Some(to) = wide.get_mut(place) {
                    *to = *byte;
                }
            }
            self.push(u64::from_le_bytes(wide));
        }
    }

    fn push(&mut self, bits: u64) {
        let number = match self.stored {
            Stored::Double => f64::from_bits(bits),
            Stored::Single => f64::from(f32::from_bits(bits as u32)),
            Stored::Int { width, is_signed } => {
                let shift = 64 - 8 * width as u32;
                let signed = (bits << shift).cast_signed() >> shift;
                if let GridCells::Whole(own) = &mut self.cells {
                    let whole = if is_signed { Some(signed) } else { i64::try_from(bits).ok() };
                    own.push(whole);
                    return;
                }
                if is_signed { signed as f64 } else { bits as f64 }
            }
        };
        match &mut self.cells {
            GridCells::Numbers(own) => own.push(number),
            GridCells::Whole(own) => own.push(Some(number as i64)),
            GridCells::Texts(_) => {}
        }
    }
}
