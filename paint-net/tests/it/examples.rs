//! The examples do what they say, and the recipe of the README is the first of them.

#[expect(dead_code, reason = "what `main` prints is compared here")]
#[path = "../../examples/painters.rs"]
mod painters;

#[test]
fn the_recipe_is_the_example() {
    let (readme, example) = (include_str!("../../README.md"), include_str!("../../examples/paint.rs"));
    let program = example.split_once("\n\n").unwrap().1;
    assert!(readme.contains(&format!("```rust\n{program}```\n")), "README.md does not hold examples/paint.rs");
}

#[test]
fn the_painters_of_the_example_paint() {
    let rows = painters::compare().unwrap();
    assert_eq!(rows.len(), 5);
    assert!(rows.iter().all(|(_, likeness, sprays)| *likeness > 25.0 && *sprays > 0), "{rows:?}");
}
