//! The known name that somebody most likely meant.

/// The one of `names` that looks most like `given` (Jaro-Winkler); `None` where there are none.
///
/// ```
/// assert_eq!(krait_model::nearest_name("backlsh", ["creep", "backlash"]), Some("backlash"));
/// ```
pub fn nearest_name<'a>(given: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let alike = |name: &str| strsim::jaro_winkler(given, name);
    names.into_iter().max_by(|a, b| alike(a).total_cmp(&alike(b)))
}
