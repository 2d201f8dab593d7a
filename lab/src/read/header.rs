//! From a file's first line to a plan: which of its columns stands for what, and how its values become SI units.

use super::at::At;
use super::column_map::{Mapping, Part};
use super::role::{Role, Wanted};
use super::unit::{Dimension, Unit};
use super::{ColumnMap, Expected, ReadError};
use crate::digits::digits;
use crate::machine::nearest;
use crate::tip::N_POS;
use std::path::Path;

/// A column of the file that is read.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Column {
    /// Place in a row.
    pub field: usize,
    /// The file's name for it.
    pub name: String,
    pub role: Role,
    pub factor: f64,
    pub shift: f64,
    /// A turn after which an encoder begins anew, in the file's unit.
    pub wraps: Option<f64>,
    /// Largest magnitude, and what to say of a larger one.
    pub limit: Option<(f64, String)>,
}

/// Every column that is read, in the order of a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    pub columns: Vec<Column>,
    pub n_inputs: usize,
    pub n_outputs: usize,
}

impl Plan {
    /// The place of a role among the columns.
    pub(super) fn place(&self, role: Role) -> Option<usize> {
        self.columns.iter().position(|column| column.role == role)
    }

    /// The names of columns, for a sentence.
    pub(super) fn names(&self, is_one: impl Fn(Role) -> bool) -> String {
        let names: Vec<&str> = self.columns.iter().filter(|c| is_one(c.role)).map(|c| c.name.as_str()).collect();
        names.join(", ")
    }
}

/// Finds the columns of an expected machine among a file's names.
pub(super) fn plan(
    path: &Path,
    at: At,
    names: &[String],
    map: &ColumnMap,
    expected: Expected,
) -> Result<Plan, ReadError> {
    let names = &Header { path, at, names }.left_in(map)?;
    let header = Header { path, at, names };
    let wanted = expected.wanted();
    targets_exist(map, &wanted)?;
    header.same_machine(map, expected)?;
    let mut columns = Vec::with_capacity(names.len());
    for one in &wanted {
        columns.extend(header.find(one, map)?);
    }
    let has = |columns: &[Column], role| columns.iter().any(|c| c.role == role);
    let is_polar =
        has(&columns, Role::ThetaL) && has(&columns, Role::Delta) && !(0..2).all(|k| has(&columns, Role::Output(k)));
    let has_bends = is_polar || (0..2).any(|k| has(&columns, Role::Output(k)));
    // A position is looked at where no shape is there: it says less of it, in a frame of its own.
    let is_tip = !has_bends && (0..N_POS).any(|k| has(&columns, Role::TipPos(k)));
    let unused = |role| match role {
        Role::Output(_) => is_polar || is_tip,
        Role::ThetaL | Role::Delta => !is_polar,
        Role::TipPos(_) => !is_tip,
        _ => false,
    };
    let of_other_file = |role: Role| match map.part {
        Part::Whole => false,
        Part::Commands => role.is_of_shape() || matches!(role, Role::Sigma | Role::Weight),
        Part::Seen => matches!(role, Role::Input(_) | Role::Load(_) | Role::StemAngle | Role::Temperature),
    };
    columns.retain(|column| !unused(column.role) && !of_other_file(column.role));
    for one in &wanted {
        let is_needed = match one.role {
            Role::Time | Role::Input(_) => true,
            Role::Output(_) => !is_polar && !is_tip,
            Role::TipPos(_) => is_tip,
            _ => false,
        } && !of_other_file(one.role);
        if is_needed && !has(&columns, one.role) {
            return Err(header.missing(one));
        }
    }
    header.one_uncertainty(&columns)?;
    header.loads_of_all_lines(&columns, &wanted, map)?;
    for (field, name) in names.iter().enumerate() {
        if !name.is_empty() && !columns.iter().any(|column| column.field == field) {
            let name = name.clone();
            columns.push(Column { field, name, role: Role::Extra, factor: 1.0, shift: 0.0, wraps: None, limit: None });
        }
    }
    columns.sort_by_key(|column| column.field);
    let (n_inputs, n_bends) = expected.widths();
    let n_outputs = if is_tip { N_POS } else { n_bends };
    Ok(Plan { columns, n_inputs, n_outputs })
}

/// Finds columns among a file's names, each of which must be there; others are passed over.
pub(super) fn required(
    path: &Path,
    at: At,
    names: &[String],
    map: &ColumnMap,
    wanted: &[Wanted],
) -> Result<Plan, ReadError> {
    let names = &Header { path, at, names }.left_in(map)?;
    let header = Header { path, at, names };
    targets_exist(map, wanted)?;
    let found = |one: &Wanted| header.find(one, map)?.ok_or_else(|| header.missing(one));
    let mut columns = wanted.iter().map(found).collect::<Result<Vec<_>, _>>()?;
    header.no_further(wanted)?;
    columns.sort_by_key(|column| column.field);
    Ok(Plan { columns, n_inputs: wanted.len() - 1, n_outputs: 0 })
}

struct Header<'a> {
    path: &'a Path,
    at: At,
    names: &'a [String],
}

impl Header<'_> {
    fn no_name_twice(&self) -> Result<(), ReadError> {
        for (k, name) in self.names.iter().enumerate().filter(|(_, name)| !name.is_empty()) {
            if let Some(first) = self.names.iter().take(k).position(|earlier| earlier == name) {
                return Err(self.duplicate(name.clone(), first, k));
            }
        }
        Ok(())
    }

    /// The names, each once, empty where a column is taken out.
    fn left_in(&self, map: &ColumnMap) -> Result<Vec<String>, ReadError> {
        self.no_name_twice()?;
        let mut left = self.names.to_vec();
        for mapping in map.mappings.iter().filter(|mapping| mapping.takes_out()) {
            match left.iter_mut().find(|name| **name == mapping.source) {
                Some(name) => name.clear(),
                None if map.part == Part::Whole => return Err(self.no_source(mapping)),
                None => {}
            }
        }
        Ok(left)
    }

    /// A column of the file that a mapping names and that is not there.
    fn no_source(&self, mapping: &Mapping) -> ReadError {
        let column = mapping.source.clone();
        ReadError::MapSource { path: self.path.to_owned(), at: self.at, nearest: self.nearest(&column), column }
    }

    fn duplicate(&self, quantity: String, first: usize, second: usize) -> ReadError {
        let place = |k: usize| format!("{} ({:?})", k + 1, self.names.get(k).map_or("", String::as_str));
        ReadError::DuplicateColumn {
            path: self.path.to_owned(),
            at: self.at,
            quantity,
            first: place(first),
            second: place(second),
        }
    }

    fn find(&self, wanted: &Wanted, map: &ColumnMap) -> Result<Option<Column>, ReadError> {
        let mapped = map.mappings.iter().find_map(|m| target_unit(wanted, &m.target).map(|unit| (m, unit)));
        let field = |source: &str| self.names.iter().position(|name| name == source);
        match mapped.map(|(mapping, unit)| (mapping, unit, field(&mapping.source))) {
            Some((mapping, target_unit, Some(field))) => {
                let unit = mapping.unit.map_or(target_unit, |unit| unit.suffix.to_owned());
                let hint = format!("map it with --map {}={}:", mapping.target, mapping.source);
                let column = self.column(wanted, field, &unit, &hint)?;
                return Ok(Some(Column { wraps: mapping.wraps, ..column }));
            }
            // The other file may have it, and this one a name of the lab's own.
            Some((mapping, ..)) if map.part == Part::Whole => return Err(self.no_source(mapping)),
            _ => {}
        }
        let mut found = None;
        let mut unknown = None;
        for (field, name) in self.names.iter().enumerate() {
            let Some(suffix) = suffix(wanted, name) else { continue };
            if conversion(wanted, suffix).is_none() {
                unknown = unknown.or(Some((name, suffix)));
            } else if let Some(first) = found.replace(field) {
                return Err(self.duplicate(wanted.name(), first, field));
            }
        }
        match (found, unknown) {
            (Some(field), _) => {
                let name = self.names.get(field).map_or("", String::as_str);
                let hint = format!("call the column {}_", wanted.base);
                self.column(wanted, field, suffix(wanted, name).unwrap_or(""), &hint).map(Some)
            }
            (None, Some((name, suffix))) => Err(self.unknown_unit(wanted, name, suffix)),
            (None, None) => Ok(None),
        }
    }

    fn column(&self, wanted: &Wanted, field: usize, suffix: &str, hint: &str) -> Result<Column, ReadError> {
        let name = self.names.get(field).cloned().unwrap_or_default();
        let (factor, shift) = conversion(wanted, suffix).ok_or_else(|| self.unknown_unit(wanted, &name, suffix))?;
        let limit = wanted.limit.map(|(limit, what)| {
            let advice = match wanted.suggestion().filter(|_| factor == 1.0) {
                Some(unit) => format!("{hint}{unit} if that is what it is in"),
                None => "check the unit in its name".to_owned(),
            };
            let (most, unit) = ((limit - shift) / factor, if suffix.is_empty() { &wanted.unit } else { suffix });
            let empty = "leave the cell empty where nothing was measured";
            (limit, format!("{what}: more than {} {unit}; {advice}, and {empty}", digits(most)))
        });
        Ok(Column { field, name, role: wanted.role, factor, shift, wraps: None, limit })
    }

    fn unknown_unit(&self, wanted: &Wanted, name: &str, suffix: &str) -> ReadError {
        let units = match wanted.dimension {
            Some(Dimension::Number) | None => wanted.unit.clone(),
            Some(dimension) => dimension.suffixes(),
        };
        ReadError::UnknownUnit {
            path: self.path.to_owned(),
            at: self.at,
            found: match suffix {
                "" => format!("{name:?} has no unit"),
                _ => format!("{name:?} has the unknown unit {suffix:?}"),
            },
            expected: wanted.name(),
            units,
        }
    }

    fn missing(&self, wanted: &Wanted) -> ReadError {
        let column = wanted.name();
        ReadError::MissingColumn { path: self.path.to_owned(), at: self.at, nearest: self.nearest(&column), column }
    }

    fn nearest(&self, given: &str) -> String {
        nearest(given, self.names.iter().map(String::as_str))
    }

    fn one_uncertainty(&self, columns: &[Column]) -> Result<(), ReadError> {
        let field = |role| columns.iter().find(|column| column.role == role).map(|column| column.field);
        match (field(Role::Sigma), field(Role::Weight)) {
            (Some(sigma), Some(weight)) => Err(self.duplicate("the uncertainty of a row".to_owned(), sigma, weight)),
            _ => Ok(()),
        }
    }

    /// Loads are there of every line or of none: which line they were of could not be told otherwise.
    fn loads_of_all_lines(&self, columns: &[Column], wanted: &[Wanted], map: &ColumnMap) -> Result<(), ReadError> {
        let n_lines = wanted.iter().filter(|one| matches!(one.role, Role::Load(_))).count();
        let found: Vec<&str> =
            columns.iter().filter(|own| matches!(own.role, Role::Load(_))).map(|own| own.name.as_str()).collect();
        let has_more = n_lines > 0 && map.mappings.is_empty() && self.has_base(&format!("tau{}", n_lines + 1));
        if found.is_empty() || (found.len() == n_lines && !has_more) {
            return Ok(());
        }
        let beyond = (n_lines + 1..=99).take_while(|k| has_more && self.has_base(&format!("tau{k}"))).count();
        Err(ReadError::Loads { path: self.path.to_owned(), at: self.at, found: found.len() + beyond, n_lines })
    }

    /// No column is of one more joint or segment than is wanted.
    fn no_further(&self, wanted: &[Wanted]) -> Result<(), ReadError> {
        let numbered = |base: &str| {
            let stem = base.trim_end_matches(|letter: char| letter.is_ascii_digit());
            Some((stem.to_owned(), base.get(stem.len()..)?.parse::<usize>().ok()?))
        };
        let is_wanted = |base: &str| wanted.iter().any(|own| own.base == base);
        let beyond = wanted.iter().filter_map(|one| numbered(&one.base)).map(|(stem, k)| format!("{stem}{}", k + 1));
        let Some(found) = beyond.filter(|base| !is_wanted(base)).find(|base| self.has_base(base)) else {
            return Ok(());
        };
        Err(ReadError::OtherMachine {
            path: self.path.to_owned(),
            found: format!("there is a column of {found}"),
            expected: format!(
                "a machine with {} alone",
                wanted.iter().skip(1).map(Wanted::name).collect::<Vec<_>>().join(", ")
            ),
        })
    }

    /// Whether the names are those of the expected machine, as far as names tell.
    fn same_machine(&self, map: &ColumnMap, expected: Expected) -> Result<(), ReadError> {
        if !map.mappings.is_empty() || map.part != Part::Whole {
            return Ok(());
        }
        let other = |found: String, expected: String| {
            Err(ReadError::OtherMachine { path: self.path.to_owned(), found, expected })
        };
        let count = |letter| (1..=99).take_while(|k| self.has_base(&format!("{letter}{k}"))).count();
        let (commanded, measured) = (count('u'), count('y'));
        match expected {
            Expected::Snake if count('q') == 0 && commanded > 0 => other(
                format!("the columns u1..u{commanded} and y1..y{measured} are those of joints"),
                "a snake".to_owned(),
            ),
            Expected::Joints(_) if commanded == 0 && self.has_base("q1") => {
                other("the columns q1..q3 are those of a snake".to_owned(), "joints".to_owned())
            }
            Expected::Joints(joints) if commanded > joints.n || measured > joints.n => other(
                format!("there are columns for {} joints", commanded.max(measured)),
                format!("{} joint{}", joints.n, if joints.n == 1 { "" } else { "s" }),
            ),
            Expected::Segments(_) if commanded == 0 && self.has_base("q1") => {
                other("the columns q1..q3 are those of a snake".to_owned(), "kind segments".to_owned())
            }
            Expected::Segments(_) if commanded > expected.widths().0 || measured > expected.widths().1 => {
                let (n_lines, n_bends) = expected.widths();
                other(
                    format!("there are columns for {commanded} lines and {measured} components of bend vectors"),
                    format!("{n_lines} lines and {n_bends} components"),
                )
            }
            Expected::Force(_) if commanded > 0 && !self.has_base("q1") => other(
                format!("the columns u1..u{commanded} and y1..y{measured} are those of joints"),
                "kind force".to_owned(),
            ),
            _ => Ok(()),
        }
    }

    fn has_base(&self, base: &str) -> bool {
        self.names
            .iter()
            .any(|name| name.strip_prefix(base).is_some_and(|rest| rest.is_empty() || rest.starts_with('_')))
    }
}

/// Every mapping is to a column that the lab knows, in a unit that it can have, and none is there twice.
fn targets_exist(map: &ColumnMap, wanted: &[Wanted]) -> Result<(), ReadError> {
    let known = || wanted.iter().map(Wanted::name).collect::<Vec<_>>().join(", ");
    let wrong = |target: &str, reason: &str| {
        Err(ReadError::MapTarget { target: target.to_owned(), reason: reason.to_owned(), known: known() })
    };
    let mut seen: Vec<Role> = Vec::new();
    for mapping in map.mappings.iter().filter(|mapping| !mapping.takes_out()) {
        let Some(one) = wanted.iter().find(|one| target_unit(one, &mapping.target).is_some()) else {
            return wrong(&mapping.target, "the lab has no such column");
        };
        if mapping.unit.is_some_and(|unit| conversion(one, unit.suffix).is_none()) {
            return wrong(&mapping.target, "it cannot have this unit");
        }
        if seen.contains(&one.role) {
            return wrong(&mapping.target, "it is mapped twice");
        }
        seen.push(one.role);
    }
    Ok(())
}

/// The unit in a mapping's target, if the target is this column.
fn target_unit(wanted: &Wanted, target: &str) -> Option<String> {
    if target == wanted.base {
        return Some(wanted.unit.clone());
    }
    suffix(wanted, target).filter(|unit| conversion(wanted, unit).is_some()).map(str::to_owned)
}

/// A name without the unit in brackets at its end, and that unit.
pub(crate) fn in_brackets(name: &str) -> Option<(&str, &str)> {
    let open = match name.chars().last()? {
        ']' => '[',
        ')' => '(',
        _ => return None,
    };
    let (stem, unit) = name.get(..name.len() - 1)?.rsplit_once(open)?;
    Some((stem.trim_end(), unit.trim()))
}

/// What stands where this column's unit stands, if a name is this column's: `q1_mm`, `q1 [mm]`.
fn suffix<'a>(wanted: &Wanted, name: &'a str) -> Option<&'a str> {
    if let Some((stem, unit)) = in_brackets(name) {
        return (wanted.dimension.is_some() && stem.eq_ignore_ascii_case(&wanted.base)).then_some(unit);
    }
    let (stem, rest) = name.split_at_checked(wanted.base.len())?;
    if !stem.eq_ignore_ascii_case(&wanted.base) {
        return None;
    }
    if wanted.dimension.is_none() {
        return rest.is_empty().then_some("");
    }
    let suffix = if rest.is_empty() { "" } else { rest.strip_prefix('_')? };
    (!suffix.contains('_')).then_some(suffix)
}

/// Factor and shift from a unit to the column's own.
fn conversion(wanted: &Wanted, suffix: &str) -> Option<(f64, f64)> {
    let Some(dimension) = wanted.dimension else { return suffix.is_empty().then_some((1.0, 0.0)) };
    if suffix.eq_ignore_ascii_case(&wanted.unit) {
        return Some((1.0, 0.0));
    }
    let own = Unit::from_suffix(&wanted.unit)?;
    let unit = Unit::from_suffix(suffix).filter(|unit| unit.dimension == dimension)?;
    Some((unit.factor / own.factor, (unit.shift - own.shift) / own.factor))
}
