//! `--map bend_x_rad=cam.x:deg`: which column of a file stands for which of the lab's, and in which unit.

use super::ReadError;
use super::unit::Unit;
use std::fmt;
use std::str::FromStr;

/// The target of a mapping that takes a column out.
pub(crate) const NONE: &str = "none";

/// One mapping: a column of the lab, the file's name for it, and the unit that the file has it in.
#[derive(Clone, Debug, PartialEq)]
pub struct Mapping {
    pub(crate) target: String,
    pub(crate) source: String,
    pub(crate) unit: Option<Unit>,
    /// A turn after which the file's values begin anew, in its unit.
    pub(crate) wraps: Option<f64>,
}

/// Mappings of columns; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColumnMap {
    pub(crate) mappings: Vec<Mapping>,
    pub(super) part: Part,
}

/// Which part of the measurements a file has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Part {
    /// Commands and measurements.
    #[default]
    Whole,
    /// Commands, and what stands beside them.
    Commands,
    /// What was measured of them, by a clock of its own.
    Seen,
}

impl ColumnMap {
    /// The same for a file that has this part.
    pub(super) fn of_part(&self, part: Part) -> Self {
        Self { part, ..self.clone() }
    }
}

impl Mapping {
    /// The column of the lab without its unit, `y1`, as these mappings or the names of a file have it.
    pub fn of_column(base: &str, map: &ColumnMap, names: &[String]) -> Option<Self> {
        let mapped = map.mappings.iter().find(|own| own.is_of(base)).cloned();
        let named = || names.iter().map(|name| Self::new(name.clone(), name, None, None)).find(|own| own.is_of(base));
        mapped.or_else(named)
    }

    /// Whether it says the same column of the lab, whatever its unit.
    pub fn is_of(&self, base: &str) -> bool {
        self.target.strip_prefix(base).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
    }

    /// The file's column of this mapping, in its unit, for another column of the lab; `None` where that takes more than one option says.
    pub fn moved(&self, from: &str, to: &str) -> Option<Self> {
        let target = format!("{to}{}", self.target.strip_prefix(from)?);
        self.wraps.is_none().then(|| Self { target, ..self.clone() })
    }

    /// Whether the file's column is taken out: `none=NAME`.
    pub(crate) fn takes_out(&self) -> bool {
        self.target == NONE
    }

    /// A column of the lab, the file's name for it, and its unit where the file has another than the target names.
    pub(crate) fn new(target: String, source: &str, unit: Option<Unit>, wraps: Option<f64>) -> Self {
        Self { target, source: source.to_owned(), unit, wraps }
    }
}

impl FromStr for Mapping {
    type Err = ReadError;

    /// `LAB_COLUMN=FILE_COLUMN` or `LAB_COLUMN=FILE_COLUMN:UNIT`; without a unit the lab column's own counts.
    fn from_str(text: &str) -> Result<Self, ReadError> {
        let syntax = || ReadError::MapSyntax { found: text.to_owned() };
        let (target, source) = text.split_once('=').ok_or_else(syntax)?;
        let (source, unit) = match source.rsplit_once(':') {
            Some((source, suffix)) => {
                let unit = Unit::from_suffix(suffix)
                    .ok_or_else(|| ReadError::MapUnit { found: text.to_owned(), unit: suffix.to_owned() })?;
                (source, Some(unit))
            }
            None => (source, None),
        };
        if target.is_empty() || source.is_empty() || target == NONE && unit.is_some() {
            return Err(syntax());
        }
        Ok(Self { target: target.to_owned(), source: source.to_owned(), unit, wraps: None })
    }
}

impl fmt::Display for Mapping {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = self.unit.map_or(String::new(), |unit| format!(":{}", unit.suffix));
        write!(f, "{}={}{unit}", self.target, self.source)
    }
}

impl FromIterator<Mapping> for ColumnMap {
    fn from_iter<T: IntoIterator<Item = Mapping>>(mappings: T) -> Self {
        Self { mappings: mappings.into_iter().collect(), part: Part::Whole }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mapping_has_a_target_a_source_and_perhaps_a_unit() {
        let mapping: Mapping = "bend_x_rad=cam.x:deg".parse().expect("well formed");
        assert_eq!((mapping.target.as_str(), mapping.source.as_str()), ("bend_x_rad", "cam.x"));
        assert_eq!(mapping.unit.map(|unit| unit.suffix), Some("deg"));
        assert_eq!(mapping.to_string(), "bend_x_rad=cam.x:deg");
        assert_eq!("q1_m=motor 1".parse::<Mapping>().expect("well formed").unit, None);
    }

    #[test]
    fn what_is_no_mapping_is_refused_with_the_form_expected() {
        for text in ["", "none=a:mm", "q1_m", "=x", "q1_m=", "q1_m=a:furlong"] {
            let error = text.parse::<Mapping>().expect_err(text).to_string();
            assert!(error.contains("--map"), "{error}");
        }
    }
}
