//! Whether a value of a model file was fitted to the very data at hand: data must not count twice.

use krait_model::model_file::ModelFile;

/// The data that a value of a model file was fitted to.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedData {
    /// What the file calls them; of several recordings with ", " between.
    name: String,
    /// SHA-256 that the file's history has for this name and day.
    sha256: Vec<String>,
}

impl FittedData {
    /// The data of this name and day, with their SHA-256 from the file's history; a history with that name on other days alone
    /// gives those; `None` for a value that came from no data. Of a file whose history does not have the name, a copy under another
    /// name counts as other data, and other data of that name as the same.
    pub(crate) fn of(file: &ModelFile, from: Option<&str>, date: Option<&str>) -> Option<Self> {
        let name = from?;
        let named: Vec<_> = file.history().iter().filter(|entry| entry.data == name).collect();
        let of_day: Vec<_> = named.iter().copied().filter(|entry| entry.date.as_deref() == date).collect();
        let entries = if of_day.is_empty() { named } else { of_day };
        let sha256 = entries.into_iter().flat_map(|entry| parts(&entry.data_sha256)).map(str::to_owned).collect();
        Some(Self { name: name.to_owned(), sha256 })
    }

    /// Whether it is the data of this name and SHA-256: one recording that both have is enough.
    pub(crate) fn is(&self, source: &str, sha256: &str) -> bool {
        if self.sha256.is_empty() {
            return parts(&self.name).any(|own| parts(source).any(|other| own == other));
        }
        self.sha256.iter().any(|own| parts(sha256).any(|other| own == other))
    }
}

/// The recordings of a joined name or hash.
fn parts(joined: &str) -> impl Iterator<Item = &str> {
    joined.split(", ").filter(|part| !part.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MACHINE: &str = "format = 1\n[machine]\nkind = \"joints\"\nn = 1\n";
    const ENTRY: &str = "heldout_rms_deg = { before = 2.0, after = 1.0 }\n";

    #[test]
    fn a_copy_is_the_same_data_and_another_file_of_the_name_is_not() {
        let hash = |digit: &str| digit.repeat(64);
        let entry = |day: &str, digit: &str| {
            format!(
                "[[history]]\neffect = \"x\"\ndata = \"a.csv\"\ndata_sha256 = \"{}\"\ndate = \"{day}\"\n{ENTRY}",
                hash(digit)
            )
        };
        let text = format!("{MACHINE}{}{}", entry("2026-11-21", "a"), entry("2026-11-22", "b"));
        let file = ModelFile::parse(&text).expect("a model file");
        let second = FittedData::of(&file, Some("a.csv"), Some("2026-11-22")).expect("data");
        assert!(second.is("copy.csv", &hash("b")), "renamed");
        assert!(second.is("z.csv, copy.csv", &format!("{}, {}", hash("c"), hash("b"))), "one of two recordings");
        assert!(!second.is("a.csv", &hash("a")), "the name of another day's data");
        assert!(!second.is("a.csv", &hash("c")));
        // A name alone, as older files have it.
        let bare = ModelFile::parse(MACHINE).expect("a model file");
        let by_name = FittedData::of(&bare, Some("a.csv"), None).expect("data");
        assert!(by_name.is("a.csv", &hash("c")) && !by_name.is("copy.csv", &hash("c")));
    }
}
