//! The model files that are built into the program.

/// Names and texts of the built-in model files, from the least compensation to the most.
pub const BUILT_IN: [(&str, &str); 3] = [
    ("off", include_str!("../../models/off.toml")),
    ("naive", include_str!("../../models/naive.toml")),
    ("estimated", include_str!("../../models/estimated.toml")),
];

/// The text of a built-in model file.
pub fn built_in(name: &str) -> Option<&'static str> {
    BUILT_IN.into_iter().find(|(own, _)| *own == name).map(|(_, text)| text)
}

#[cfg(test)]
mod tests {
    use super::super::ModelFile;
    use super::*;
    use crate::KnownColumns;

    #[test]
    fn each_is_a_model_that_the_compensator_can_use_and_no_two_are_the_same() {
        let hashes = BUILT_IN.map(|(name, text)| {
            let file = ModelFile::parse(text).unwrap_or_else(|error| panic!("{name}: {error}"));
            let chain = file.chain(KnownColumns::default()).unwrap().unwrap();
            chain.compensator().unwrap();
            assert_eq!(chain.hash(), file.hash());
            file.hash()
        });
        assert!(hashes[0] != hashes[1] && hashes[1] != hashes[2] && hashes[0] != hashes[2]);
    }
}
