//! The examples do what they say, and the recipe of the README is the first of them.

#[cfg(feature = "urdf")]
#[expect(dead_code, reason = "what `main` prints is compared here")]
#[path = "../../examples/urdf_arm.rs"]
mod urdf_arm;

#[test]
fn the_recipe_is_the_example() {
    let (readme, example) = (include_str!("../../README.md"), include_str!("../../examples/aim.rs"));
    let program = example.split_once("\n\n").unwrap().1;
    assert!(readme.contains(&format!("```rust\n{program}```\n")), "README.md does not hold examples/aim.rs");
}

#[cfg(feature = "urdf")]
#[test]
fn the_arm_of_the_example_reaches_the_column() {
    assert!(urdf_arm::spray_a_column().unwrap() < 1e-9);
}
