//! The examples do what they say, and the recipe of the README is the first of them.

#[expect(dead_code, reason = "what `main` prints is compared here")]
#[path = "../../examples/chart.rs"]
mod chart;

#[test]
fn the_recipe_is_the_example() {
    let (readme, example) = (include_str!("../../README.md"), include_str!("../../examples/atlas.rs"));
    let program = example.split_once("\n\n").unwrap().1;
    assert!(readme.contains(&format!("```rust\n{program}```\n")), "README.md does not hold examples/atlas.rs");
}

#[test]
fn the_wall_of_the_example_unfolds() {
    let chart = chart::folded_wall().unwrap();
    assert!((chart.width() - 2.0).abs() < 1e-9 && (chart.height() - 1.0).abs() < 1e-9);
}
