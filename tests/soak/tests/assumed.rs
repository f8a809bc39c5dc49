//! What is assumed of a line stands in one place, and what is searched and tried relies on nothing else.

use std::fs;
use std::path::Path;

use drivebus_rtu::Assumption;

/// What neither the model nor the soak has on its line; `tests/rust/tests/hostile_line` has some of it.
const ELSEWHERE: &[Assumption] = &[Assumption::SharedInOrder];

#[test]
fn each_assumption_is_one_of_the_model_or_of_the_soak_or_said_to_be_neither() {
    for assumption in Assumption::ALL {
        let is_tried = drivebus_model::ASSUMED.contains(&assumption) || drivebus_soak::ASSUMED.contains(&assumption);
        assert_ne!(is_tried, ELSEWHERE.contains(&assumption), "{assumption:?}");
    }
}

#[test]
fn the_documents_tell_the_same() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/developers/architecture.md");
    let text = fs::read_to_string(path).unwrap();
    let (_, section) = text.split_once("\nWhat is assumed,").unwrap();
    let told: Vec<&str> =
        section.lines().skip_while(|line| !line.starts_with("- ")).map_while(|line| line.strip_prefix("- ")).collect();
    assert_eq!(told, Assumption::ALL.map(Assumption::text));
}
