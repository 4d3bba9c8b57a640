//! The recipe of the README is the first of the examples, and short.

#[test]
fn the_recipe_is_the_example_and_short() {
    let (readme, example) = (include_str!("../../README.md"), include_str!("../../examples/mission.rs"));
    let program = example.split_once("\n\n").unwrap().1;
    assert!(readme.contains(&format!("```rust\n{program}```\n")), "README.md does not hold examples/mission.rs");
    let lines = example.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("//"));
    assert!(lines.count() <= 40);
}
